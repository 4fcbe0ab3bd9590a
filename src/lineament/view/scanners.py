"""The scanners of a log: their topics, where each is on the robot, and what all see at one time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

from ..errors import LineamentError
from ..extractor import Extractor
from ..features import Features
from ..logs import open_log
from ..mapping.scanners import merge_features, merged_scan
from ..motion.rig import TOGETHER, Rig, fixed, period_of
from ..rosmsg.frames import Place
from ..scan import LaserScan, Pose
from ..scan.poses import compose, inverse, relative
from .shown import ShownLog

#: So many scans of a topic show the time from scan to scan.
_FIRST = 100


class Scanners:
    """The topics of a log that carry scans, and where their scanners are on the robot.

    A LogError if the log cannot be read up to its first scan; a ValueError if a mounting is of
    none of them.
    """

    def __init__(
        self,
        path: str,
        reading: Mapping[str, Any],
        mountings: Mapping[str, Pose] | None = None,
        base_frame: str = "base_link",
    ) -> None:
        self._path, self._reading, self._log = path, reading, open_log(path, **reading)
        self._log.scan(0)
        self.topics = [self._log.topic] if self._log.topic else self._log.topics
        self._mountings, self._base_frame = mountings or {}, base_frame
        for topic in self._mountings:
            if topic not in self.topics:
                raise ValueError(
                    f"the mounting is of {topic}, expected one of {', '.join(self.topics)}"
                )

    def __len__(self) -> int:
        return len(self.topics)

    @cached_property
    def places(self) -> list[Place | str]:
        """Where each scanner is on the robot, or why that is not known."""
        frames = fixed(self._log.mountings())
        rig = self.rig(range(len(self)))
        found: list[Place | str] = []
        for topic in self.topics:
            try:
                if self._reading.get("laser_pose") is not None:
                    raise LookupError("--laser-pose is of one scanner alone")
                scan = open_log(self._path, **{**self._reading, "topic": topic}).scan(0)
                found.append(rig.place(topic, scan.frame_id, frames))
            except (LookupError, LineamentError) as error:
                found.append(
                    f"where the scanner of {topic} is on the robot is not known: {error}; "
                    f"expected /tf_static, or --mounting {topic}=X,Y,DEGREES"
                )
        return found

    def place(self, number: int) -> Place | None:
        """Return where the scanner of a topic is on the robot; None if that is not known."""
        place = self.places[number] if len(self) > 1 else None
        return place if isinstance(place, Place) else None

    def rig(self, numbers: Sequence[int]) -> Rig:
        """Return these scanners as those of one robot."""
        topics = tuple(self.topics[number] for number in numbers)
        known = {topic: pose for topic, pose in self._mountings.items() if topic in topics}
        return Rig(topics, known, self._base_frame)

    def checked(self, numbers: Sequence[int]) -> None:
        """Raise a ValueError unless all these are topics, each once, that can be overlaid."""
        for number in numbers:
            if number >= len(self):
                last = len(self) - 1
                raise ValueError(f"topic {number} is not there, expected 0 to {last}")
        if len(numbers) > 1:
            self.rig(numbers)
            for number in numbers:
                if isinstance(problem := self.places[number], str):
                    raise ValueError(problem)


class Together:
    """What several scanners of a robot see at one time: their scans, features, and the merged ones.

    `shown` are the logs of the scanners, opened with their places; those that have no scan near the
    `index`-th of the first one are `missing`.
    """

    def __init__(
        self, shown: Sequence[ShownLog], rig: Rig, index: int, extractor: Extractor
    ) -> None:
        _, first = shown[0].store.item(index)
        periods = [period_of(one.store.stamps(0, _FIRST)) for one in shown]
        self.parts: list[tuple[str, int, LaserScan, Pose]] = []
        self.missing: list[str] = []
        for topic, one in zip(rig.topics, shown, strict=True):
            at = index if one is shown[0] else one.near(first.stamp)
            if at is not None:
                _, scan = one.store.item(at)
                if abs(scan.stamp - first.stamp) <= TOGETHER * max(periods):
                    self.parts.append((topic, at, scan, _on_robot(scan, one, first, shown[0])))
                    continue
            self.missing.append(topic)
        self.features = [extractor(scan) for _, _, scan, _ in self.parts]
        poses = [pose for *_, pose in self.parts]
        self.merged: Features = merge_features(
            self.features, poses, rig.covariance, frame_id=rig.base_frame
        )
        _, self.beams = merged_scan([scan for _, _, scan, _ in self.parts], poses)


def robot_pose(pose: Pose, place: Place | None) -> Pose:
    """Return where the robot is whose scanner is at a pose."""
    return pose if place is None else compose(pose, inverse(place.pose))


def _on_robot(scan: LaserScan, of: ShownLog, first: LaserScan, of_first: ShownLog) -> Pose:
    """Return where a scanner is, from where the robot is at the time of the first scan."""
    assert of.place is not None
    if scan.pose is None or first.pose is None:
        return of.place.pose
    return relative(robot_pose(first.pose, of_first.place), scan.pose)
