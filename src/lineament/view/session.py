"""What the page asks for: logs, their scans, and what methods find in them."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from ..explain.explain import explain
from ..extractor import Extractor
from ..logs import find_logs
from ..progress import compiling_now
from ..scan import LaserScan, Pose
from .scanners import Scanners, Together, robot_pose
from .shown import ShownLog

if TYPE_CHECKING:
    from ..mapping import LineMap

#: Logs that are kept open; of more, the one that was asked for least recently is closed.
KEPT = 4
#: Room for the scans of all open logs in temporary files [bytes].
ROOM = 1 << 30


class Session:
    """The logs that are looked at, with one extractor for each method.

    The logs are those that `lineament.logs.find_logs` finds when the session is made, named by
    their number from 0 on; each is opened when it is first asked for, the first at once where
    there is no other. The page shows the extractors by their names, the first of them first.

    Of a log with scans of several topics, `topics` are those that are asked for, by their numbers:
    the first one's scans count, and `scan` has what all of them see. Where a scanner is on the
    robot, ``/tf_static`` says, or `mountings` by its topic. Without `topics` all take turns.

    With a plan, the poses of the logs are odometry, and those on the plan take their place.

    Raises a LogError if no log is found, or the only one cannot be read up to its first scan.
    """

    def __init__(
        self,
        paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
        extractors: Mapping[str, Extractor],
        plan: LineMap | None = None,
        *,
        mountings: Mapping[str, Pose] | None = None,
        base_frame: str = "base_link",
        **reading: Any,
    ) -> None:
        paths = [paths] if isinstance(paths, (str, os.PathLike)) else list(paths)
        self.extractors = dict(extractors)
        self._paths, self._reading, self._plan = find_logs(paths), reading, plan
        self.name = ", ".join(map(str, paths))
        self._robot: dict[str, Any] = {"mountings": mountings, "base_frame": base_frame}
        # By log, and by topic in it; the one that was asked for last is the last.
        self._open: dict[int, dict[int | None, ShownLog]] = {}
        self._scanners: dict[int, Scanners] = {}
        self._opening, self._ended = threading.RLock(), False
        if len(self._paths) == 1:
            topics: list[int | None] = [*self.chosen(0)]
            for topic in topics or [None]:
                self.log(0, topic)
        else:
            self.name += f" ({len(self._paths)} logs)"

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        with self._opening:
            self._ended = True
            while self._open:
                self._close(next(iter(self._open)))

    def log(self, number: int, topic: int | None = None) -> ShownLog:
        """Return a log, or one of its topics, opened if it is not; ValueError if there is none."""
        self._check(number)
        with self._opening:
            if self._ended:
                raise ValueError("the viewer has ended")
            topics = self._open.pop(number, {})
            try:
                if topic not in topics:
                    topics[topic] = self._opened(number, topic)
            finally:
                if topics:
                    self._open[number] = topics
            if len(self._open) > KEPT:
                self._close(next(iter(self._open)))
            return topics[topic]

    def _opened(self, number: int, topic: int | None) -> ShownLog:
        room, reading, place = ROOM // min(len(self._paths), KEPT), self._reading, None
        if topic is not None:
            scanners = self.scanners(number)
            room //= len(scanners)
            reading = reading | {"topic": scanners.topics[topic]}
            place = scanners.place(topic)
        return ShownLog(self._paths[number], room, reading, self._plan, place)

    def scanners(self, number: int) -> Scanners:
        """Return the scanners of a log; ValueError if there is no log of that number."""
        self._check(number)
        with self._opening:
            if number not in self._scanners:
                self._scanners[number] = Scanners(self._paths[number], self._reading, **self._robot)
            return self._scanners[number]

    def chosen(self, log: int) -> list[int]:
        """Return the topics that are shown first: all that can be overlaid, or the first one."""
        scanners = self.scanners(log)
        if len(scanners) < 2:
            return []
        placed = [k for k in range(len(scanners)) if scanners.place(k) is not None]
        return placed if len(placed) > 1 and self._plan is None else [0]

    def topics(self, log: int) -> dict[str, Any]:
        """Return the topics of a log with scans, what keeps one from being overlaid, and `chosen`.

        None are named where there is one alone.
        """
        scanners = self.scanners(log)
        places = scanners.places if len(scanners) > 1 else []
        if self._plan is not None:
            places = ["on a plan, one scanner at a time is shown"] * len(places)
        named = [
            {"name": name, "alone": place if isinstance(place, str) else ""}
            for name, place in zip(scanners.topics, places, strict=False)
        ]
        return {"topics": named, "chosen": self.chosen(log)}

    def _check(self, number: int) -> None:
        if number >= len(self._paths):
            last = len(self._paths) - 1
            raise ValueError(f"log {number} is not there, expected a whole number from 0 to {last}")

    def _close(self, number: int) -> None:
        for shown in self._open.pop(number).values():
            shown.close()

    def _first(self, log: int, topics: Sequence[int]) -> ShownLog:
        """Return the log of the first of some topics, or of all in turns."""
        if topics:
            self.scanners(log).checked(topics)
        return self.log(log, topics[0] if topics else None)

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until the logs that are open are read; return whether they are."""
        opened = [shown for topics in list(self._open.values()) for shown in topics.values()]
        return all(shown.wait(seconds) for shown in opened)

    def logs(self) -> dict[str, Any]:
        """Return the names of all logs, without the folder that they share, and of the methods."""
        shared = os.path.commonprefix(self._paths)  # noqa: RUF071  # cut at a folder below
        start = max(shared.rfind(sign) for sign in ("/", os.sep)) + 1
        names = [path[start:] for path in self._paths]
        return {"name": self.name, "logs": names, "methods": list(self.extractors)}

    def facts(self, log: int, topics: Sequence[int] = ()) -> dict[str, Any]:
        """Return what is known of a log, and how far it has been read."""
        return self._first(log, topics).facts() | {"compiling": compiling_now()}

    def stamps(
        self, log: int, first: int, count: int, topics: Sequence[int] = ()
    ) -> dict[str, Any]:
        """Return the stamps of some scans [s]."""
        stamps = self._first(log, topics).store.stamps(first, count)
        return {"first": first, "stamps": stamps}

    def poses(self, log: int, first: int, count: int, topics: Sequence[int] = ()) -> dict[str, Any]:
        """Return the poses of some scans (m, m, rad), of the robot with several topics; or NaN."""
        shown = self._first(log, topics)
        poses: list[Any] = shown.store.poses(first, count)
        if len(topics) > 1:
            poses = [robot_pose((x, y, theta), shown.place) for x, y, theta in poses]
        return {"first": first, "poses": poses}

    def plan(self) -> dict[str, Any]:
        """Return the walls of the plan, ``x1 y1 x2 y2`` each [m]; none where there is no plan."""
        walls = [] if self._plan is None else self._plan.ends.reshape(-1, 4).round(4).tolist()
        return {"walls": walls}

    def drive(
        self, log: int, first: int, step: int, count: int, topics: Sequence[int] = ()
    ) -> dict[str, Any]:
        """Return poses and points of every `step`-th scan; see `ShownLog.drive`."""
        return self._first(log, topics).drive(first, step, count)

    def npz(self, log: int, index: int, topics: Sequence[int] = ()) -> bytes:
        """Return a scan as an npz log; see `ShownLog.npz`."""
        return self._first(log, topics).npz(index)

    def scan(self, log: int, index: int, method: str, topics: Sequence[int] = ()) -> dict[str, Any]:
        """Return a scan and what a method finds in it; IndexError if it was not read.

        Of several topics it is the scan of all measurements, with the merged features, in the frame
        of the robot, and has ``parts``: the scan of each, its features, where its scanner is on the
        robot, and which of all beams are its own; and ``missing``: those without a scan near it.
        """
        shown, extractor = self._first(log, topics), self.extractors[method]
        if len(topics) > 1:
            return self._together(log, index, method, topics)
        topic, scan = shown.store.item(index)
        about = {"index": index, "method": method, "topic": topic, "where": shown.where(index)}
        return about | _beams(scan) | extractor(scan).to_dict()

    def _together(self, log: int, index: int, method: str, topics: Sequence[int]) -> dict[str, Any]:
        if self._plan is not None:
            raise ValueError("on a plan, one scanner at a time is shown")
        shown, rig = [self.log(log, topic) for topic in topics], self.scanners(log).rig(topics)
        seen = Together(shown, rig, index, self.extractors[method])
        parts: list[dict[str, Any]] = []
        for (topic, at, scan, place), found, beams in zip(
            seen.parts, seen.features, seen.beams, strict=True
        ):
            of = {"topic": topic, "index": at, "method": method, "place": place}
            parts.append(of | {"numbers": beams[:-1].tolist()} | _beams(scan) | found.to_dict())
        names = " + ".join(part["topic"] for part in parts)
        about = {"index": index, "method": method, "topic": names, "where": None}
        assert seen.merged.scan is not None
        whole = about | _beams(seen.merged.scan) | seen.merged.to_dict()
        return whole | {"parts": parts, "missing": seen.missing}

    def trace(
        self, log: int, index: int, method: str, beam: int, topics: Sequence[int] = ()
    ) -> dict[str, Any]:
        """Return what became of a beam; ValueError if it is not there, IndexError for the scan.

        Of several topics it is a beam of the first.
        """
        _, scan = self._first(log, topics).store.item(index)
        trace = self.extractors[method].trace(scan)
        return {"index": index, "method": method, **asdict(explain(trace, beam))}


def _beams(scan: LaserScan) -> dict[str, Any]:
    """Beams of a scan; the range of an invalid one is NaN."""
    bearings: dict[str, Any] = {"angles": scan.angles.tolist()}
    if scan.is_regular:
        bearings = {"angle_min": scan.angle_min, "angle_increment": scan.angle_increment}
    names = ("range_min", "range_max", "is_full_circle", "pose")
    return {
        "beams": len(scan),
        "ranges": np.where(scan.valid, scan.ranges, np.nan).tolist(),
        **bearings,
        **{name: getattr(scan, name) for name in names},
    }
