"""Poses from ROS topics: odometry, stamped poses and transforms, at the stamps of the scans."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterator
from itertools import pairwise

from ..rosmsg.wire import Wire
from ..scan import LaserScan, Pose
from .ros_bag import Buffer, Connection

__all__ = ["POSE_TYPES", "TRANSFORMS", "PoseFinder", "plane_pose"]

#: Poses that are held of each track, and scans that wait for a pose after theirs.
MAX_POSES = 4096
MAX_WAITING = 64
#: Poses are nearer [m, rad]: what is computed of them stays finite.
FARTHEST = 1e100

#: Types of messages of transforms, whose edges are chosen by the names of their frames.
TRANSFORMS = ("tf2_msgs/TFMessage", "tf/tfMessage")

_Edge = tuple[str, str]


class PoseFinder:
    """Gives scans the poses of a topic, at their stamps.

    Between two poses it interpolates: linearly in position, along the shorter turn in heading. A
    scan after the last pose has that one, a scan before the first has none. Scans wait for a pose
    behind theirs, up to `MAX_WAITING` of them: what a recorder writes later is not looked for.

    Parameters
    ----------
    wanted : str
        A topic, ``/odom``, or one of transforms with frames: ``/tf:map->odom->base_link`` is the
        pose of base_link in map, each link of the chain at the stamp of the scan. Links that
        are on the topic with ``_static`` at its end hold at all times.

    Raises
    ------
    ValueError
        If there is a single frame.

    Examples
    --------
    >>> PoseFinder("/tf:map->odom->base_link").topics
    ('/tf', '/tf_static')
    """

    def __init__(self, wanted: str) -> None:
        self.topic, _, chain = wanted.partition(":")
        frames = [_frame(name) for name in chain.split("->")] if chain else []
        if chain and (len(frames) < 2 or not all(frames)):
            raise ValueError(
                f"pose topic is {wanted!r}, expected frames as in {self.topic}:odom->base_link"
            )
        self.topics = (self.topic, f"{self.topic}_static") if chain else (self.topic,)
        self._tracks = {edge: _Track() for edge in (pairwise(frames) if chain else [("", "")])}
        self._waiting: deque[tuple[str, LaserScan]] = deque()

    @property
    def types(self) -> tuple[str, ...]:
        """Types of messages that the topic may have."""
        return TRANSFORMS if len(self.topics) == 2 else tuple(POSE_TYPES)

    def learn(self, connection: Connection, data: Buffer) -> list[tuple[str, LaserScan]]:
        """Take a message with poses, and give the scans, by topic, that were waiting for it.

        Raises
        ------
        ValueError
            If the message is malformed or its numbers are not finite.
        """
        wire = Wire(data, connection.encoding)
        if connection.type in TRANSFORMS:
            is_static = connection.topic != self.topic
            for edge, stamp, pose in _transforms(wire):
                if edge in self._tracks:
                    self._tracks[edge].add(-math.inf if is_static else stamp, pose)
        else:
            self._tracks["", ""].add(*POSE_TYPES[connection.type](wire))
        return self._release(MAX_WAITING)

    def wait(self, topic: str, scan: LaserScan) -> list[tuple[str, LaserScan]]:
        """Let a scan wait for its pose, and give those, by topic, that have waited enough."""
        self._waiting.append((topic, scan))
        return self._release(MAX_WAITING)

    def finish(self) -> list[tuple[str, LaserScan]]:
        """Give the scans that are left."""
        return self._release(0)

    def _release(self, most: int) -> list[tuple[str, LaserScan]]:
        ready = []
        while self._waiting:
            topic, scan = self._waiting[0]
            if len(self._waiting) <= most and not self._covers(scan.stamp):
                break
            self._waiting.popleft()
            ready.append((topic, scan.with_pose(self._pose(scan.stamp))))
        return ready

    def _covers(self, stamp: float) -> bool:
        return all(track.covers(stamp) for track in self._tracks.values())

    def _pose(self, stamp: float) -> Pose | None:
        pose: Pose | None = (0.0, 0.0, 0.0)
        for track in self._tracks.values():
            link = track.at(stamp)
            pose = None if pose is None or link is None else _compose(pose, link)
        return pose


class _Track:
    """Poses by stamp, the newest `MAX_POSES` of them."""

    def __init__(self) -> None:
        self._stamps: list[float] = []
        self._poses: list[Pose] = []
        self._is_static = False

    def add(self, stamp: float, pose: Pose) -> None:
        if not all(abs(value) < FARTHEST for value in pose):
            raise ValueError(f"pose is {pose}, expected numbers below {FARTHEST:g}")
        self._is_static = self._is_static or stamp == -math.inf
        i = bisect_right(self._stamps, stamp)
        self._stamps.insert(i, stamp)
        self._poses.insert(i, pose)
        if len(self._stamps) >= 2 * MAX_POSES:
            del self._stamps[:MAX_POSES], self._poses[:MAX_POSES]

    def covers(self, stamp: float) -> bool:
        """Whether waiting for more would not change the pose at `stamp`."""
        return self._is_static or (bool(self._stamps) and self._stamps[-1] >= stamp)

    def at(self, stamp: float) -> Pose | None:
        i = bisect_right(self._stamps, stamp)
        if i == 0:
            return None
        if i == len(self._stamps) or self._is_static:
            return self._poses[i - 1]
        before, after = self._stamps[i - 1], self._stamps[i]
        return _between(self._poses[i - 1], self._poses[i], (stamp - before) / (after - before))


def _between(a: Pose, b: Pose, share: float) -> Pose:
    turn = math.remainder(b[2] - a[2], 2 * math.pi)
    theta = math.remainder(a[2] + share * turn, 2 * math.pi)
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), theta


def _compose(a: Pose, b: Pose) -> Pose:
    c, s = math.cos(a[2]), math.sin(a[2])
    theta = math.remainder(a[2] + b[2], 2 * math.pi)
    return a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], theta


def _frame(name: str) -> str:
    # Frames of ROS 1 may begin with a slash, in part of the messages.
    return name.strip().removeprefix("/")


def plane_pose(wire: Wire) -> Pose:
    """Take a position and a quaternion: what they are in the plane."""
    x, y, _, qx, qy, qz, qw = wire.numbers("7d")
    return x, y, math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))


def _stamped(wire: Wire) -> tuple[float, Pose]:
    stamp, _ = wire.header()
    return stamp, plane_pose(wire)


def _stamped_of_child(wire: Wire) -> tuple[float, Pose]:
    stamp, _ = wire.header()
    wire.text()
    return stamp, plane_pose(wire)


def _transforms(wire: Wire) -> Iterator[tuple[_Edge, float, Pose]]:
    for _ in range(wire.count()):
        stamp, parent = wire.header()
        child = wire.text()
        yield (_frame(parent), _frame(child)), stamp, plane_pose(wire)


#: How to read each type of message that is a pose of its own: the stamp and the pose.
POSE_TYPES: dict[str, Callable[[Wire], tuple[float, Pose]]] = {
    "geometry_msgs/PoseStamped": _stamped,
    "geometry_msgs/PoseWithCovarianceStamped": _stamped,
    "geometry_msgs/TransformStamped": _stamped_of_child,
    "nav_msgs/Odometry": _stamped_of_child,
}
