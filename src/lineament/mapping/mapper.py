"""`Mapper`: follows a sensor scan by scan, while a process beside it makes the map."""

from __future__ import annotations

import os
import signal
from contextlib import suppress
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection
from queue import Empty
from typing import TYPE_CHECKING, NamedTuple

from ..errors import NothingFoundError
from ..features import Features
from ..scan import Pose
from ..scan.poses import compose, inverse
from .drive_map import Drive, KeyFrame, turned
from .evidence import Evidence
from .following import Whereabouts, verdict_of
from .line_map import LineMap
from .locate import LOST
from .making import DriveMap, make_map

if TYPE_CHECKING:
    from multiprocessing.queues import Queue

#: A map is made again after so many key frames.
_EACH = 20
#: By so much the process beside it gives way to others: what is live comes first.
_NICE = 10
#: It looks for new key frames, and for who started it, so often, and is waited for so long [s].
_PERIOD, _PATIENCE = 1.0, 2.0


class Draft(NamedTuple):
    """The map of the first key frames; where it has the last of these, and whether that is sure.

    It is if it hangs together with the first.
    """

    frames: int
    pose: Pose
    is_sure: bool
    map: LineMap


class Mapper:
    """Follows a sensor by its scans, and makes a map of what they saw.

    Each scan is placed by the walls of the last metres. A process beside it closes loops, again and
    again; poses go on from where its last `draft` has the last of its key frames.

    Attributes
    ----------
    drive : Drive
        What was seen.
    draft : Draft or None
        The last map that was made; None before there is one.
    """

    def __init__(self) -> None:
        self.drive, self.draft = Drive(), None
        self._moved: Pose = (0.0, 0.0, 0.0)
        context = get_context("spawn")
        self._frames: Queue[KeyFrame | None] = context.Queue()
        self._drafts, there = context.Pipe(duplex=False)
        self._process = context.Process(target=_make, args=(self._frames, there), daemon=True)
        self._process.start()
        there.close()

    def step(self, features: Features, odometry: Pose | None = None) -> Whereabouts:
        """Take in the next scan, by its features with the scan; return where it was taken.

        The pose is in the frame of the map: that of the first scan. Its covariance is that beside
        the walls around. Where the way to it is not known it is lost, until a draft has it in the
        part of the first scan. `odometry` is the pose of the sensor in any frame that stays.
        """
        if features.scan is None:
            raise ValueError("the features have no scan, expected those of an Extractor")
        before = len(self.drive.frames)
        at = self.drive.add(features.scan, features, odometry)
        for frame in self.drive.frames[before:]:
            self._frames.put(frame)
        self._take()
        covariance = turned(at.covariance, self._moved[2])
        odds, explained, short, contradicted = at.evidence[:4].tolist()
        evidence = Evidence(odds, explained, short, contradicted, int(features.scan.valid.sum()))
        verdict = verdict_of(covariance) if self._is_joined() else LOST
        return Whereabouts(verdict, compose(self._moved, at.pose), covariance, evidence)

    @property
    def is_making(self) -> bool:
        """Whether the process that makes the map runs; without it poses go on, but drift."""
        return self._process.is_alive()

    def _is_joined(self) -> bool:
        """Whether it is known how the last key frame lies to the first."""
        known, is_sure = 0, True
        if self.draft is not None:
            known, is_sure = self.draft.frames, self.draft.is_sure
        return is_sure and not any(
            frame.is_torn or verdict_of(frame.motion.covariance) == LOST
            for frame in self.drive.frames[known:]
        )

    def finish(self) -> DriveMap:
        """Return the map of all scans; NothingFoundError if there are no walls."""
        self.close()
        return make_map(self.drive.frames, self.drive.scans)

    def close(self) -> None:
        """End the process beside it."""
        if self._process.is_alive():
            self._frames.put(None)
            self._process.terminate()
            self._process.join(_PATIENCE)
        self._frames.cancel_join_thread()
        self._frames.close()
        self._drafts.close()

    def _take(self) -> None:
        """Take the last draft, if there is a new one."""
        with suppress(EOFError, OSError):
            while self._drafts.poll():
                self.draft = draft = self._drafts.recv()
                last = self.drive.frames[draft.frames - 1].pose
                self._moved = compose(draft.pose, inverse(last))


def _make(frames: Queue[KeyFrame | None], drafts: Connection) -> None:
    """Make a map of the key frames that have come, whenever there are enough new ones."""
    # Ctrl-C reaches all processes of a terminal: the parent ends the others.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "nice"):
        os.nice(_NICE)
    known: list[KeyFrame] = []
    made, parent = 0, parent_process()
    while parent is None or parent.is_alive():
        with suppress(Empty):
            while True:
                frame = frames.get(timeout=0.0 if len(known) - made >= _EACH else _PERIOD)
                if frame is None:
                    return
                known.append(frame)
        if len(known) - made >= _EACH:
            made = len(known)
            with suppress(NothingFoundError):
                done = make_map(known, [])
                is_sure = bool(done.parts.is_sure[-1] and done.parts.numbers[-1] == 0)
                drafts.send(Draft(made, done.survey.pose(made - 1), is_sure, done.map))
