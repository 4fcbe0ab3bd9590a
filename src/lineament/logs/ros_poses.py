"""Poses of scans from ROS topics: odometry, stamped poses and transforms, at their stamps."""

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Collection, Iterable
from itertools import pairwise

import numpy as np

from ..errors import one_line, warn
from ..limits import LIMITS, Limits
from ..rosmsg.frames import Place, chained, frame_of
from ..rosmsg.poses import POSE_TYPES, TRANSFORMS, StampedPose, stamped_poses
from ..rosmsg.wire import Buffer
from ..scan import Array, LaserScan, Pose
from ..scan.poses import carried
from .ros_bag import Connection

#: The topic of the frames that do not move in each other.
STATIC = "/tf_static"
#: Poses that are held of each track, and scans that wait for a pose after theirs.
MAX_POSES = 4096
MAX_WAITING = 64
#: Links that a warning lists.
MAX_LISTED = 20
#: Poses are nearer [m, rad]: what is computed from them stays finite.
FARTHEST = 1e100


class PoseFinder:
    """Gives scans the poses of a topic, at their stamps.

    Between two poses it interpolates: linearly in position, along the shorter turn in heading, and
    their covariances, where both have one. A scan after the last pose has that one, a scan before
    the first has none. Of a chain of transforms no covariance is known. Scans wait for a pose
    behind theirs, up to `MAX_WAITING` of them: what a recorder writes later is not looked for.

    What is `wanted` is a topic, ``/odom``, or one of transforms with two frames or more:
    ``/tf:map->odom->base_link`` is the pose of base_link in map, each link of the chain at the
    stamp of the scan. Links that are on the topic with ``_static`` at its end hold at all times.
    The scans of a frame that is upside down are turned over: their pose is that of a frame with the
    same x axis, whose z axis points up.

    Where the frame of the scans is in that of the poses is looked up in the static transforms of
    the log, if they are among its `mountings`, the topics of transforms; where it is not known,
    that is warned of, and the poses are taken for those of the scanner. Without `mountings` it is
    not looked up: the poses are moved by a `laser_pose`, or not at all. A link of a chain that
    never came is warned of at the end: no scan has a pose then.
    """

    def __init__(
        self,
        wanted: str,
        limits: Limits = LIMITS,
        mountings: Collection[str] | None = None,
    ) -> None:
        self._limits, self._is_looked_up = limits, mountings is not None
        self.topic, _, chain = wanted.partition(":")
        frames = [frame_of(name) for name in chain.split("->")] if chain else []
        if chain and (len(frames) < 2 or not all(frames)):
            raise ValueError(
                f"pose topic is {wanted!r}, expected frames as in {self.topic}:odom->base_link"
            )
        static = f"{self.topic}_static" if chain else STATIC
        #: Whether links that hold at all times may still come.
        self._is_static_ahead = static in (mountings or ())
        is_read = chain or self._is_static_ahead
        self.topics = (self.topic, static) if is_read else (self.topic,)
        self._is_chain = bool(chain)
        #: What poses are of, "" if that is not known; and links that hold at all times, by child.
        self._body = frames[-1] if chain else ""
        self._links: dict[str, StampedPose] = {}
        self._is_warned = False
        #: Links that came, for a warning.
        self._came: set[str] = set()
        #: Types of messages that the topic may have.
        self.types = TRANSFORMS if chain else tuple(POSE_TYPES)
        self._tracks = {edge: _Track() for edge in pairwise(frames)} or {("", ""): _Track()}
        self._waiting: deque[tuple[str, LaserScan]] = deque()

    def takes(self, topic: str, kind: str) -> bool:
        """Whether messages of a type on a topic are for `learn`."""
        return topic in self.topics and kind in (self.types if topic == self.topic else TRANSFORMS)

    def learn(self, connection: Connection, data: Buffer) -> list[tuple[str, LaserScan]]:
        """Take a message with poses, and return the scans, by topic, that waited for it."""
        is_static = connection.topic != self.topic
        for found in stamped_poses(data, connection.encoding, connection.type, self._limits):
            frame, child = frame_of(found.frame), frame_of(found.child_frame)
            if is_static and len(self._links) < MAX_POSES:
                self._links[child] = found._replace(frame=frame)
            elif not self._is_chain:
                self._body = child
            edge = (frame, child) if self._is_chain or is_static else ("", "")
            if len(self._came) < MAX_LISTED:
                self._came.add("->".join(edge))
            if edge in self._tracks:
                stamp = -math.inf if is_static else found.stamp
                self._tracks[edge].add(stamp, found.pose, found.covariance)
                self._tracks[edge].is_upside_down = found.is_upside_down
        return self._release(MAX_WAITING)

    def wait(self, topic: str, scan: LaserScan) -> list[tuple[str, LaserScan]]:
        """Let a scan wait for its pose, and return those, by topic, that have waited enough."""
        self._waiting.append((topic, scan))
        return self._release(MAX_WAITING)

    def finish(self) -> list[tuple[str, LaserScan]]:
        """Return the scans that are left."""
        missing = [edge for edge, track in self._tracks.items() if not track.is_known]
        if missing and self._is_chain:
            links = one_line(", ".join(sorted(self._came)) or "none")
            warn(
                f"no scan has a pose: {self.topic} has no {'->'.join(missing[0])}, expected a link "
                f"as it is published; links there are: {links}"
            )
        return self._release(0)

    def _release(self, most: int) -> list[tuple[str, LaserScan]]:
        ready = []
        while self._waiting:
            topic, scan = self._waiting[0]
            is_covered = all(track.covers(scan.stamp) for track in self._tracks.values())
            mounting = self._mounting(frame_of(scan.frame_id))
            if mounting is None and self._is_static_ahead and not self._links:
                is_covered = False
            if len(self._waiting) <= most and not is_covered:
                break
            self._waiting.popleft()
            pose, covariance = self._pose(scan.stamp, mounting or ())
            if mounting is None and pose is not None:
                self._warn(scan.frame_id)
            links = (*self._tracks.values(), *(mounting or ()))
            if sum(link.is_upside_down for link in links) % 2:
                scan = scan.turned_over()
            ready.append((topic, scan.with_pose(pose, covariance)))
        return ready

    def _mounting(self, laser: str) -> list[StampedPose] | None:
        """Links from what poses are of to the frame of a scan; None if they are not known."""
        links: list[StampedPose] = []
        while self._is_looked_up and (not self._body or laser != self._body):
            link = self._links.get(laser)
            if link is None or len(links) > len(self._links):
                return None
            links.insert(0, link)
            laser = link.frame
        return links

    def _warn(self, laser: str) -> None:
        if not self._is_warned:
            self._is_warned = True
            of = f"are those of {self._body!r}" if self._body else "do not say what they are of"
            warn(
                f"poses of {self.topic} {of}, and where {laser!r} is on it is not known: they are "
                "taken for those of the scanner (laser_pose=...)"
            )

    def _pose(
        self, stamp: float, mounting: Iterable[StampedPose]
    ) -> tuple[Pose | None, Array | None]:
        places, covariance = [], None
        for track in self._tracks.values():
            known = track.at(stamp)
            if known is None:
                return None, None
            pose, covariance = known  # only messages that are no links have a covariance
            places.append(Place(pose, track.is_upside_down))
        body = chained(places).pose
        places += [Place(link.pose, link.is_upside_down) for link in mounting]
        pose = chained(places).pose
        if covariance is not None and pose != body:
            covariance = carried(covariance, body, pose)
        return pose, covariance


class _Track:
    """Poses by stamp, the newest `MAX_POSES` of them; a stamp of -inf holds at all times."""

    def __init__(self) -> None:
        self._stamps: list[float] = []
        self._poses: list[tuple[Pose, Array | None]] = []
        self._is_static = False
        #: Whether z of the frame points down in the one that it is in: a mounting, which stays.
        self.is_upside_down = False

    def add(self, stamp: float, pose: Pose, covariance: Array | None) -> None:
        if not all(abs(value) < FARTHEST for value in pose):
            raise ValueError(f"pose is {pose}, expected numbers below {FARTHEST:g}")
        self._is_static = self._is_static or stamp == -math.inf
        i = bisect_right(self._stamps, stamp)
        self._stamps.insert(i, stamp)
        self._poses.insert(i, (pose, covariance))
        if len(self._stamps) >= 2 * MAX_POSES:
            del self._stamps[:MAX_POSES], self._poses[:MAX_POSES]

    @property
    def is_known(self) -> bool:
        """Whether it has any pose."""
        return bool(self._stamps)

    def covers(self, stamp: float) -> bool:
        """Whether waiting for more would not change the pose at `stamp`."""
        return self._is_static or (bool(self._stamps) and self._stamps[-1] >= stamp)

    def at(self, stamp: float) -> tuple[Pose, Array | None] | None:
        i = bisect_right(self._stamps, stamp)
        if i == 0:
            return None
        (x, y, theta), covariance = self._poses[i - 1]
        if i == len(self._stamps) or self._is_static:
            return (x, y, theta), covariance
        before, after = self._stamps[i - 1], self._stamps[i]
        share = (stamp - before) / (after - before)
        (next_x, next_y, next_theta), following = self._poses[i]
        if covariance is not None:
            covariance = None if following is None else _between(covariance, following, share)
        turn = math.remainder(next_theta - theta, 2 * math.pi)
        heading = math.remainder(theta + share * turn, 2 * math.pi)
        return (x + share * (next_x - x), y + share * (next_y - y), heading), covariance


def _between(covariance: Array, following: Array, share: float) -> Array:
    return np.asarray(covariance + share * (following - covariance))
