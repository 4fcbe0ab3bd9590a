"""`Drive`: key frames of a log, each placed by the walls of the last metres of the way."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..features import TABLES, Features, make_records
from ..motion.association import associate, is_landmark
from ..motion.estimate import Motion, estimate_motion
from ..scan import Array, LaserScan, Pose
from ..scan.poses import compose, inverse, poses_along, relative, twist_between
from .evidence import evidence_of
from .local_map import Query, beams_of
from .locate import distinct
from .placing import (
    PASSED,
    ROUGHNESS,
    as_walls,
    fuse,
    index_of,
    likely_turns,
    passed,
    scored,
    some,
    unlikely,
)
from .refine import COARSE, FINE, refined

#: A key frame is taken after so much way, or so much turn [m, rad].
SPACING, TURN = 0.3, math.radians(15.0)
#: Key frames through which a wall is remembered that is not seen.
REMEMBERED = 30
#: Deviations of the motion by odometry [m, rad], and their growth with way and turn.
_ODOMETRY = (0.03, 0.02), (0.1, 0.1)
#: The same where it goes on as it did: robots turn at once.
_CONTINUED = (0.25, 0.35), (0.3, 0.3)
#: A robot is not thought to go on faster [m/s, rad/s].
_FAST = 1.2
_ROUNDS = 4
#: With at least this share of the beams explained, less contradicted, a place is taken at once;
#: more where the deviation of what is expected is larger than that [m].
_SURE, _SURER, _NARROW = 0.75, 0.97, 0.1
#: Poses are tried by so many beams; so many of them are refined.
_BEAMS, _FEW, _TRIED = 120, 40, 32
#: Errors of beams and walls beside their covariances, where poses are tried, and judged [m].
_WIDE, _TIGHT = 0.12, 0.04
#: Poses that are tried are so far from each other [m, rad].
_APART = (0.15, 0.06)
#: With less than this share of the beams explained, less contradicted, the way is lost.
_LOST = 0.25

Numbers = NDArray[np.int64]


@dataclass(slots=True, eq=False)
class KeyFrame:
    """A scan that stands for those around it.

    Attributes
    ----------
    index : int
        Of its scan in the log.
    scan, features
        In the frame of the sensor.
    walls : ndarray of int64, shape (n,)
        Which wall each of the segments shows.
    pose : (x, y, theta)
        In the frame of the first key frame.
    motion : Motion
        From the key frame before.
    """

    index: int
    scan: LaserScan
    features: Features
    walls: Numbers
    pose: Pose
    motion: Motion


class Drive:
    """Places the scans of a log, one after the other, by the walls of the last metres.

    Attributes
    ----------
    frames : list of KeyFrame
    scans : list of (int, Pose)
        Of each scan: the key frame that it belongs to, and its pose in that one's frame.
    lost : list of int
        Key frames that nothing of what was seen before explains.
    """

    def __init__(self) -> None:
        self.frames: list[KeyFrame] = []
        self.scans: list[tuple[int, Pose]] = []
        self.lost: list[int] = []
        #: Walls, corners and arcs of the last metres, in the frame of the last key frame; the
        #: number of each wall, and the key frame that saw it last.
        self._around: Features
        self._numbers, self._seen = np.empty(0, np.int64), np.empty(0, np.int64)
        self._next = 0
        #: Stamp, odometry and pose in the frame of the last key frame of the last scan; its twist.
        self._last: tuple[float, Pose | None, Pose] = (math.nan, None, (0.0, 0.0, 0.0))
        self._twist = (0.0, 0.0, 0.0)
        #: Time from scan to scan, on average: stamps of logs come in bunches.
        self._pace = 0.1

    def add(self, scan: LaserScan, features: Features, odometry: Pose | None = None) -> None:
        """Add the next scan."""
        corners = features.corners
        features = replace(features, corners=corners[is_landmark(corners)])
        if not self.frames:
            empty: dict[str, Any] = {name: make_records(name, []) for name in TABLES}
            self._around = Features(**empty, clusters=np.empty(0, np.int32))
            self._key(features, Motion(0.0, 0.0, 0.0, np.zeros((3, 3))), scan, True)
        else:
            prior, spread = self._expected(scan.stamp, odometry)
            motion, is_lost = self._place(scan, features, prior, spread)
            x, y, turn = motion.pose
            self._go_on(scan.stamp, motion.pose)
            if math.hypot(x, y) >= SPACING or abs(turn) >= TURN or is_lost:
                if is_lost:
                    self.lost.append(len(self.frames))
                self._key(features, motion, scan, is_lost)
            else:
                self.scans.append((len(self.frames) - 1, motion.pose))
                self._last = scan.stamp, odometry, motion.pose
                return
        self.scans.append((len(self.frames) - 1, (0.0, 0.0, 0.0)))
        self._last = scan.stamp, odometry, (0.0, 0.0, 0.0)

    def _go_on(self, stamp: float, pose: Pose) -> None:
        duration = stamp - self._last[0]
        self._pace += 0.1 * (min(max(duration, 0.0), 1.0) - self._pace)
        if duration > 0.02:
            twist = twist_between(self._last[2], pose, duration)
            x, y, turn = (max(-_FAST, min(_FAST, speed)) for speed in twist)
            self._twist = x, y, turn

    def _expected(self, stamp: float, odometry: Pose | None) -> tuple[Pose, Array]:
        """Pose in the frame of the last key frame as it is expected, and its covariance."""
        before, duration = self._last[2], stamp - self._last[0]
        if odometry is not None and self._last[1] is not None:
            (least_way, least_turn), (by_way, by_turn) = _ODOMETRY
            step = relative(self._last[1], odometry)
        else:
            _, (by_way, by_turn) = _CONTINUED
            duration = max(duration, self._pace)
            least_way = min(0.02 + 0.4 * duration, 0.3)
            least_turn = min(0.02 + 0.8 * duration, 2.0)
            x, y, turn = poses_along(self._twist, [min(max(duration, 0.0), 0.5)])[0].tolist()
            step = x, y, turn
        way = least_way + by_way * math.hypot(step[0], step[1])
        turned = least_turn + by_turn * abs(step[2])
        return compose(before, step), np.diag((way, way, turned)) ** 2

    def _place(
        self, scan: LaserScan, features: Features, prior: Pose, spread: Array
    ) -> tuple[Motion, bool]:
        """Find the pose by the walls around; if it may be another, the one that explains most."""
        motion = self._match(features, prior, spread)
        walls = as_walls(features.segments)
        none = np.zeros((2 * len(walls), 2 * len(walls)))
        query = Query(walls, none, some(beams_of(features, scan), _BEAMS))
        best = evidence_of(np.array([motion.pose]), query.beams, self._index, _TIGHT)[0]
        way, turn = math.sqrt(spread[0, 0]), math.sqrt(spread[2, 2])
        sure = _SURE if way < _NARROW else _SURER
        if best[1] - best[3] >= sure and motion.observable:
            return motion, False
        tried = self._tried(features, prior, way, turn)
        few = scored(tried, some(query.beams, _FEW), self._index, _WIDE)
        few -= unlikely(tried, prior, way, turn)
        poses = tried[distinct(tried, few, _APART, _TRIED)]
        poses = np.concatenate((poses, [motion.pose]))
        fine = refined(refined(poses, query, self._index, COARSE)[0], query, self._index, FINE)[0]
        poses = np.concatenate((fine, poses))
        scores = scored(poses, query.beams, self._index, _TIGHT)
        scores -= unlikely(poses, prior, way, turn)
        scores[-1] += 0.5
        k = int(scores.argmax())
        if k < len(poses) - 1:
            x, y, theta = poses[k].tolist()
            motion = self._match(features, (x, y, theta), np.diag((0.05, 0.05, 0.02)) ** 2)
        both = np.array([motion.pose, poses[k]])
        found = scored(both, query.beams, self._index, _TIGHT)
        if found[1] > found[0] + 1.0:
            x, y, theta = poses[k].tolist()
            motion = Motion(x, y, theta, np.diag((0.05, 0.05, 0.02)) ** 2)
        found = evidence_of(both, query.beams, self._index, _TIGHT)
        explained, contradicted = found[found[:, 1].argmax(), (1, 3)]
        if explained - PASSED * contradicted < _LOST:
            return Motion(*prior, spread), True  # what is expected is better than a guess
        return motion, False

    def _tried(self, features: Features, prior: Pose, way: float, turn: float) -> Array:
        """Poses around the expected one, and with the turns that walls suggest, shape (n, 3)."""
        steps = np.arange(-2, 3) * min(max(way, 0.1), 0.3)
        turns = prior[2] + np.arange(-3, 4) * min(max(turn / 2, 0.05), 0.1)
        turns = np.append(turns, likely_turns(self._around, features, prior[2], turn))
        x, y, theta = np.meshgrid(prior[0] + steps, prior[1] + steps, turns, indexing="ij")
        return np.column_stack((x.ravel(), y.ravel(), theta.ravel()))

    def _match(self, features: Features, prior: Pose, spread: Array) -> Motion:
        motion, matches = Motion(*prior, spread), None
        for _ in range(_ROUNDS):
            found = associate(
                self._around, features, motion.pose, motion.covariance, roughness=ROUGHNESS
            )
            if matches is not None and found.same_as(matches):
                break
            matches = found
            motion = estimate_motion(matches, prior, spread, roughness=ROUGHNESS)
        return motion

    def _key(self, features: Features, motion: Motion, scan: LaserScan, is_new: bool) -> None:
        """Take a key frame: the walls around it are those known and those of this scan."""
        pose = compose(self.frames[-1].pose, motion.pose) if self.frames else (0.0, 0.0, 0.0)
        around = self._around.transform(*inverse(motion.pose))
        if is_new:
            empty: dict[str, Any] = {name: make_records(name, []) for name in TABLES}
            around = Features(**empty, clusters=np.empty(0, np.int32))
            self._numbers, self._seen = self._numbers[:0], self._seen[:0]
        matches = associate(around, features, roughness=ROUGHNESS)
        here = len(self.frames)
        walls = np.full(len(features.segments), -1, np.int64)
        before, now = matches.segments.T
        walls[now] = self._numbers[before]
        new = np.flatnonzero(walls < 0)
        walls[new] = self._next + np.arange(len(new))
        self._next += len(new)
        segments = around.segments.copy()
        fuse(segments, before, features.segments[now])
        self._seen[before] = here
        kept = self._seen >= here - REMEMBERED
        kept &= ~passed(segments, scan) | (self._seen == here)
        place = np.cumsum(kept) - 1
        mine = np.empty(len(walls) + 1, np.int32)
        mine[now], mine[new], mine[-1] = place[before], kept.sum() + np.arange(len(new)), -1
        corners = features.corners.copy()
        corners["segments"] = mine[corners["segments"]]
        old = np.append(np.where(kept, place, -1), -1).astype(np.int32)
        others = np.delete(around.corners, matches.corners[:, 0])
        others["segments"] = old[others["segments"]]
        others = others[(others["segments"] >= 0).any(axis=1)]
        arcs = np.delete(around.arcs, matches.arcs[:, 0])
        near = np.hypot(*arcs["center"].T) < 8.0
        self._around = replace(
            around,
            segments=np.concatenate((segments[kept], features.segments[new])),
            corners=np.concatenate((corners, others)),
            arcs=np.concatenate((features.arcs, arcs[near])),
        )
        self._index = index_of(as_walls(self._around.segments))
        self._numbers = np.concatenate((self._numbers[kept], walls[new]))
        self._seen = np.concatenate((self._seen[kept], np.full(len(new), here)))
        self.frames.append(KeyFrame(len(self.scans), scan, features, walls, pose, motion))
