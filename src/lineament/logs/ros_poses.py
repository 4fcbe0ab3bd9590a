"""Poses of scans from ROS topics: odometry, stamped poses and transforms, at their stamps."""

import math
from bisect import bisect_right
from collections import Counter, deque
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
#: Poses that are held of each track. While half as many come, a scan may wait: those around it are
#: still held.
MAX_POSES = 4096
#: Beams of all scans that wait for a pose after theirs; a scan counts for some more.
MAX_WAITING, _OF_A_SCAN = 4_000_000, 100
#: A scan has a pose if one is so near in time [s]: poses of 1 Hz are, with some jitter.
NEAR = 1.5
#: Poses that differ by no more [m, rad] are of a robot that stood in between. Localisers that wait
#: for a robot to move publish a pose every 0.25 to 0.5, and somewhat more until the next scan.
STEP = 0.7
#: Links that a warning lists.
MAX_LISTED = 20
#: Poses are nearer [m, rad]: what is computed from them stays finite.
FARTHEST = 1e100


class PoseFinder:
    """Gives scans the poses of a topic, at their stamps.

    Between two poses it interpolates: linearly in position, along the shorter turn in heading, and
    their covariances, where both have one. Poses more than `NEAR` apart have none in between,
    unless they differ by less than `STEP`. Scans up to `NEAR` before the first pose, or after the
    last, have that one. At the end a warning says how many scans have none. Of a chain of
    transforms no covariance is known. Scans wait for a pose behind theirs, up to `MAX_WAITING` of
    their beams, and until `MAX_POSES` / 2 came: what a recorder writes later is not looked for.

    What is `wanted` is a topic, ``/odom``, or one of transforms with two frames or more:
    ``/tf:map->odom->base_link`` is the pose of base_link in map, each link of the chain at the
    stamp of the scan. Links that are on the topic with ``_static`` at its end hold at all times.
    The scans of a frame that is upside down are turned over: their pose is that of a frame with the
    same x axis, whose z axis points up. `name` is what warnings call the log.

    Where the frame of the scans is in that of the poses is looked up in the static transforms of
    the log, if they are among its `mountings`, the topics of transforms; where it is not known,
    that is warned of, and the poses are taken for those of the scanner. Without `mountings` it is
    not looked up: the poses are moved by a `laser_pose`, or not at all. A link of a chain that
    never came is warned of at the end: no scan has a pose then.
    """

    def __init__(
        self,
        name: str,
        wanted: str,
        limits: Limits = LIMITS,
        mountings: Collection[str] | None = None,
    ) -> None:
        self._name, self._limits, self._is_looked_up = name, limits, mountings is not None
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
        #: Scans that wait, with their topics and how many poses had come before them; their beams.
        self._waiting: deque[tuple[str, LaserScan, int]] = deque()
        self._beams = self._learned = 0
        #: How many scans there were; and those without a pose, by the link that is not known.
        self._scans, self._unplaced = 0, Counter[tuple[str, str]]()

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
                self._learned += 1
        return self._release()

    def wait(self, topic: str, scan: LaserScan) -> list[tuple[str, LaserScan]]:
        """Let a scan wait for its pose, and return those, by topic, that have waited enough."""
        self._waiting.append((topic, scan, self._learned))
        self._beams += len(scan) + _OF_A_SCAN
        return self._release()

    def finish(self) -> list[tuple[str, LaserScan]]:
        """Return the scans that are left, and warn of those that have no pose."""
        ready = self._release(is_end=True)
        missing = [edge for edge, track in self._tracks.items() if not track.is_known]
        if missing and self._is_chain:
            links = ", ".join(sorted(self._came)) or "none"
            self._warn(
                f"no scan has a pose: {self.topic} has no {'->'.join(missing[0])}, expected a link "
                f"as it is published; links there are: {links}"
            )
        elif self._unplaced:
            ((edge, _),) = self._unplaced.most_common(1)
            none = f"no {'->'.join(edge)}" if self._is_chain else "none"
            self._warn(
                f"{self._unplaced.total()} of {self._scans} scans have no pose: {self.topic} has "
                f"{none} near their stamps, expected one every {NEAR} s at least"
            )
        return ready

    def _release(self, *, is_end: bool = False) -> list[tuple[str, LaserScan]]:
        ready = []
        while self._waiting:
            topic, scan, before = self._waiting[0]
            is_covered = all(track.covers(scan.stamp) for track in self._tracks.values())
            mounting = self._mounting(frame_of(scan.frame_id))
            if mounting is None and self._is_static_ahead and not self._links:
                is_covered = False
            is_long = self._beams > MAX_WAITING or 2 * (self._learned - before) >= MAX_POSES
            if not (is_covered or is_long or is_end):
                break
            self._waiting.popleft()
            self._beams -= len(scan) + _OF_A_SCAN
            self._scans += 1
            pose, covariance = self._pose(scan.stamp, mounting or ())
            if mounting is None and pose is not None:
                self._warn_of_mounting(scan.frame_id)
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

    def _warn(self, problem: str) -> None:
        warn(one_line(f"{self._name}: {problem}"))

    def _warn_of_mounting(self, laser: str) -> None:
        if not self._is_warned:
            self._is_warned = True
            of = f"are those of {self._body!r}" if self._body else "do not say what they are of"
            self._warn(
                f"poses of {self.topic} {of}, and where {laser!r} is on it is not known: they are "
                "taken for those of the scanner (laser_pose=...)"
            )

    def _pose(
        self, stamp: float, mounting: Iterable[StampedPose]
    ) -> tuple[Pose | None, Array | None]:
        places, covariance = [], None
        for edge, track in self._tracks.items():
            known = track.at(stamp)
            if known is None:
                self._unplaced[edge] += 1
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
        """Return the pose at a stamp, and its covariance; None if no pose is near."""
        i = bisect_right(self._stamps, stamp)
        if self._is_static:
            return self._poses[i - 1]
        if 0 < i < len(self._stamps):
            return self._at_between(i - 1, stamp)
        end = max(i - 1, 0)  # The first or the last.
        is_near = self.is_known and abs(stamp - self._stamps[end]) <= NEAR
        return self._poses[end] if is_near else None

    def _at_between(self, i: int, stamp: float) -> tuple[Pose, Array | None] | None:
        """Return the pose at a stamp from that of a pose on, to that of the next one."""
        (x, y, theta), covariance = self._poses[i]
        (next_x, next_y, next_theta), following = self._poses[i + 1]
        passed, whole = stamp - self._stamps[i], self._stamps[i + 1] - self._stamps[i]
        turn = math.remainder(next_theta - theta, 2 * math.pi)
        is_standing = max(math.hypot(next_x - x, next_y - y), abs(turn)) <= STEP
        if passed > 0 and whole > NEAR and not is_standing:
            return None
        share = passed / whole
        if covariance is not None:
            covariance = None if following is None else _between(covariance, following, share)
        heading = math.remainder(theta + share * turn, 2 * math.pi)
        return (x + share * (next_x - x), y + share * (next_y - y), heading), covariance


def _between(covariance: Array, following: Array, share: float) -> Array:
    return np.asarray(covariance + share * (following - covariance))
