"""Frames of a robot: where they are in each other at a time, by what ``/tf`` has said of them."""

import math
from bisect import bisect_left
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

from ..scan import Pose
from ..scan.poses import compose, poses_along, twist_between
from .poses import StampedPose

#: Frames that are known; a robot has fewer, unless names are made up.
_MOST_FRAMES = 1000
#: Poses of a frame that are kept; those of 10 s at 100 Hz.
_MOST_POSES = 1000
#: Between two poses farther apart in time, the way is not known [s].
GAP = 0.5
#: So long after the last pose, the frame goes on as between the last two [s].
LATE = 0.2
#: No robot goes faster: its odometry has begun anew [m/s].
FASTEST = 10.0
#: A clock that is set back by more begins anew [s].
_SET_BACK = 1.0
#: Stamps farther apart are of different clocks [s].
_ANOTHER_CLOCK = 3600.0


class Place(NamedTuple):
    """The pose of a frame in another one, and whether its z axis points down there."""

    pose: Pose
    is_upside_down: bool = False


def chained(places: Iterable[Place]) -> Place:
    """Return where the last of some frames is in the first, each in the one before it."""
    pose, side = (0.0, 0.0, 0.0), 1
    for (x, y, theta), is_upside_down in places:
        pose = compose(pose, (x, side * y, side * theta))
        side = -side if is_upside_down else side
    return Place(pose, side < 0)


class Frames:
    """A tree of frames, each in its parent, at all times or by the stamps of its poses.

    Between two poses, and for `LATE` after the last, a frame moves at constant velocity.

    Examples
    --------
    >>> frames = Frames()
    >>> frames.add(StampedPose(0.0, "base_link", "laser", (0.2, 0.0, 0.0)), is_fixed=True)
    >>> for stamp in (10.0, 10.1):
    ...     frames.add(StampedPose(stamp, "odom", "base_link", (stamp, 0.0, 0.0)))
    >>> [round(value, 2) for value in frames.find("odom", "laser", 10.05).pose]
    [10.25, 0.0, 0.0]
    """

    def __init__(self) -> None:
        self._links: dict[str, _Link] = {}

    def add(self, found: StampedPose, *, is_fixed: bool = False) -> None:
        """Take the pose of a frame in its parent; `is_fixed` is whether it holds at all times."""
        parent, child = frame_of(found.frame), frame_of(found.child_frame)
        link = self._links.get(child)
        if link is None or link.parent != parent or link.is_fixed != is_fixed:
            if link is None and len(self._links) >= _MOST_FRAMES:
                return
            link = self._links[child] = _Link(parent, is_fixed)
        link.is_upside_down = found.is_upside_down
        link.add(found.stamp, found.pose)

    def find(self, parent: str, child: str, stamp: float) -> Place:
        """Return where a frame is in another one, above it in the tree, at a time [s].

        LookupError, with the reason, if that is not known.
        """
        places: list[Place] = []
        frame = child
        while frame != parent:
            link = self._links.get(frame)
            if link is None or len(places) > len(self._links):
                raise LookupError(f"no transforms lead from {parent} to {child}")
            places.append(Place(link.at(stamp, frame), link.is_upside_down))
            frame = link.parent
        return chained(reversed(places))


class _Link:
    """The poses of a frame in its parent, by stamp."""

    def __init__(self, parent: str, is_fixed: bool) -> None:
        self.parent, self.is_fixed, self.is_upside_down = parent, is_fixed, False
        self._poses: deque[tuple[float, Pose]] = deque(maxlen=1 if is_fixed else _MOST_POSES)

    def add(self, stamp: float, pose: Pose) -> None:
        if self._poses and not self.is_fixed and stamp <= self._poses[-1][0]:
            if stamp > self._poses[-1][0] - _SET_BACK:
                return  # said again, or overtaken on the way
            self._poses.clear()
        self._poses.append((stamp, pose))

    def at(self, stamp: float, name: str) -> Pose:
        """Return the pose at a time; LookupError if it is not known."""
        if self.is_fixed:
            return self._poses[-1][1]
        after = bisect_left(self._poses, stamp, key=lambda one: one[0])
        if after < len(self._poses) and self._poses[after][0] == stamp:
            return self._poses[after][1]
        last = min(after, len(self._poses) - 1)
        (begin, pose), (end, following) = self._poses[last - 1], self._poses[last]
        is_covered = after > 0 and stamp - end <= LATE and 0 < end - begin <= GAP
        if not is_covered:
            raise LookupError(f"{name} in {self.parent} is known only {self._known(stamp)}")
        if math.dist(pose[:2], following[:2]) > FASTEST * (end - begin):
            raise LookupError(f"{name} in {self.parent} jumps")
        along = poses_along(twist_between(pose, following, end - begin), [stamp - begin])
        x, y, turn = along[0].tolist()
        return compose(pose, (x, y, math.remainder(turn, 2 * math.pi)))

    def _known(self, stamp: float) -> str:
        """Say where poses are known instead; without the time, so that a gap is one line."""
        early, late = self._poses[0][0] - stamp, stamp - self._poses[-1][0]
        if max(early, late) > _ANOTHER_CLOCK:
            return "at stamps hours away, by another clock"
        if early > 0:
            return "at later stamps"
        return "at earlier stamps" if late > 0 else f"around a gap of more than {GAP} s"


def frame_of(name: str) -> str:
    """Return the name of a frame; those of ROS 1 may begin with a slash, in part of messages."""
    return name.strip().removeprefix("/")
