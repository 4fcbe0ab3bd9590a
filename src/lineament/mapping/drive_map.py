"""`Drive`: key frames of a log, each placed by the walls of the last metres of the way."""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._copies import InTurn, in_turn
from ..features import Features
from ..kernels.mapping.beams import count_passes
from ..motion.association import associate
from ..motion.estimate import Motion, estimate_motion
from ..scan import Array, LaserScan, Pose
from ..scan.poses import compose, inverse, relative
from ..walls import Numbers, as_walls, segments_of, wrapped
from ..walls.sights import WHOLE, lines_of, sights_of, walls_along
from .evidence import Says, evidence_of
from .line_map import LineMap
from .local_map import Query, beams_of, some
from .locate import distinct, squares_off
from .refine import COARSE, FINE, refined

#: How surfaces are off straight lines [m].
_ROUGHNESS = 0.01
#: Bins of turns, and how many of them are tried.
_BINS, _TURNS = 120, 12
#: What a beam that passes through a wall says [nats], and what it takes off those explained; with
#: it, what one says that is explained, and one that is short.
_MILD, _PASSED = -0.8, 0.5
_SAYS = Says(math.log(7 / 3) + 0.5, math.log(0.7), _MILD)
#: A key frame is taken after so much way, or so much turn [m, rad].
SPACING, TURN = 0.3, math.radians(15.0)
#: Key frames through which a wall is remembered that is not seen.
REMEMBERED = 30
#: Deviations of the motion by odometry [m, rad], and their growth with way and turn.
_ODOMETRY = (0.03, 0.02), (0.1, 0.1)
#: The same where it goes on as it did: robots turn at once.
_CONTINUED = (0.3, 0.3)
#: A robot is not thought to go on faster [m/s, rad/s]; longest time from scan to scan [s].
_FAST, _SLOWEST = 1.2, 3.0
#: Motions off what odometry says by so many deviations contradict it.
_CONTRADICTED = 5.0
_ROUNDS = 4
#: With at least this share of the beams explained, less contradicted, a place is taken at once;
#: more where the deviation of what is expected is larger than that [m].
_SURE, _SURER, _NARROW = 0.75, 0.97, 0.1
#: Beams that judge a pose; before, fewer beams, and how many poses they leave.
_BEAMS, _SIFTED = 120, ((12, 100), (40, 32))
#: Errors of beams and walls beside their covariances, where poses are tried, and judged [m].
_WIDE, _TIGHT = 0.12, 0.04
#: Poses that are tried are so far from each other [m, rad].
_APART = (0.15, 0.06)
#: With less than this share of the beams explained, less contradicted, the way is lost.
_LOST = 0.38
#: Covariance of a motion of which nothing is known [m, m, rad].
UNKNOWN = np.diag((10.0, 10.0, 1.0)) ** 2
#: Covariance of a pose that beams found [m, m, rad].
_NEAR = np.diag((0.05, 0.05, 0.02)) ** 2
#: A plan of one wall where no beam ends [m], for where there are no walls.
_NOWHERE = LineMap.from_lines([[999.0, 999.0, 999.1, 999.0]])


@dataclass(slots=True, eq=False)
class KeyFrame:
    """A scan that stands for those around it: number `index` of the log.

    `walls` has the number of the wall that each segment shows, `pose` is that in the frame of the
    first key frame, `motion` that since the one before: a guess where the way is lost, unless it
    `has_odometry`. `expected` is the covariance of the motion before walls say anything of it, and
    `off` is what they say beside what was expected since the key frame before [m, m, rad].
    """

    index: int
    scan: LaserScan
    features: Features
    walls: Numbers
    pose: Pose
    motion: Motion
    expected: Array
    is_lost: bool
    has_odometry: bool
    off: Array

    @property
    def is_contradicted(self) -> bool:
        """Whether walls and odometry contradict each other: either may be wrong."""
        most = _CONTRADICTED * np.sqrt(np.diag(self.expected))
        return self.has_odometry and bool((abs(self.off) > most).any())

    @property
    def is_torn(self) -> bool:
        """Whether nothing says where it is to the one before."""
        return self.is_lost and not self.has_odometry


class Step(NamedTuple):
    """Where a scan was taken.

    The pose is in the frame of the first scan; its covariance, on the axes of that frame, is that
    beside the walls around. `evidence` has log odds and the shares of beams that are explained,
    short and contradicted.
    """

    pose: Pose
    covariance: Array
    evidence: Array


class Drive(InTurn):
    """Places the scans of a log, one after the other, by the walls of the last metres.

    `scans` has the key frame that each belongs to, and its pose in that one's frame.
    """

    def __init__(self) -> None:
        self.frames: list[KeyFrame] = []
        self.scans: list[tuple[int, Pose]] = []
        #: Walls of the last metres and its corners, in the frame of the last key frame; numbers of
        #: the walls, that of the next, those that are gone, and the first key frame since lost.
        self._around: Features
        self._numbers, self._next = np.empty(0, np.int64), 0
        self._gone: set[int] = set()
        self._first = 0
        #: Stamp, odometry and pose in the frame of the last key frame of the last scan; its step.
        self._last: tuple[float, Pose | None, Pose] = (math.nan, None, (0.0, 0.0, 0.0))
        self._step: Pose = (0.0, 0.0, 0.0)
        #: Covariance of the motion since the last key frame, without what walls say.
        self._spread = np.zeros((3, 3))
        #: What the last beams say.
        self._evidence = np.array((0.0, 1.0, 0.0, 0.0))
        #: Odometry at the last key frame.
        self._from: Pose | None = None
        #: Time from scan to scan, on average: stamps of logs come in bunches, or are all the same.
        self._pace = 1.0

    @in_turn
    def add(self, scan: LaserScan, features: Features, odometry: Pose | None = None) -> Step:
        """Add the next scan; return where it was taken."""
        motion, is_key, is_lost = Motion(0.0, 0.0, 0.0, np.zeros((3, 3))), True, False
        has_odometry = odometry is not None and self._last[1] is not None
        if self.frames:
            prior, spread = self._expected(scan.stamp, odometry)
            motion, is_lost = self._place(scan, features, prior, spread)
            if is_lost and has_odometry:
                motion = Motion(*prior, spread)
            self._spread = self._spread + spread
            way, turn = math.hypot(motion.x, motion.y), abs(motion.theta)
            is_key = way >= SPACING or turn >= TURN or is_lost
            self._go_on(scan.stamp, motion.pose)
        if is_key:
            off = np.zeros(3)
            if has_odometry and self._from is not None and odometry is not None:
                off = np.subtract(motion.pose, relative(self._from, odometry))
                off[2] = wrapped(off[2])
            self._key(features, motion, scan, (is_lost, has_odometry, off))
            self._spread, self._from = np.zeros((3, 3)), odometry
        pose = (0.0, 0.0, 0.0) if is_key else motion.pose
        self.scans.append((len(self.frames) - 1, pose))
        self._last = scan.stamp, odometry, pose
        here = compose(self.frames[-1].pose, pose)
        unsure = UNKNOWN if is_lost and not has_odometry else motion.covariance
        # The axes of the motion are those of the key frame before it.
        return Step(here, turned(unsure, here[2] - motion.theta), self._evidence)

    def _go_on(self, stamp: float, pose: Pose) -> None:
        duration = stamp - self._last[0]
        if duration > 0:
            self._pace += 0.1 * (min(duration, _SLOWEST) - self._pace)
        most, step = _FAST * self._pace, relative(self._last[2], pose)
        x, y, turn = (max(-most, min(most, part)) for part in step)
        self._step = x, y, turn

    def _expected(self, stamp: float, odometry: Pose | None) -> tuple[Pose, Array]:
        """Pose in the frame of the last key frame as it is expected, and its covariance."""
        before, duration = self._last[2], stamp - self._last[0]
        if odometry is not None and self._last[1] is not None:
            (least_way, least_turn), (by_way, by_turn) = _ODOMETRY
            step = relative(self._last[1], odometry)
        else:
            by_way, by_turn = _CONTINUED
            duration = max(duration, self._pace)
            least_way = min(0.02 + 0.4 * duration, 0.3)
            least_turn = min(0.02 + 0.8 * duration, 0.7)
            step = self._step
        way = least_way + by_way * math.hypot(step[0], step[1])
        turned = least_turn + by_turn * abs(step[2])
        return compose(before, step), np.diag((way, way, turned)) ** 2

    def _place(
        self, scan: LaserScan, features: Features, prior: Pose, spread: Array
    ) -> tuple[Motion, bool]:
        """Find the pose by the walls around; if it may be another, the one that explains most."""
        motion, beams = self._match(features, prior, spread), some(beams_of(features, scan), _BEAMS)
        way, turn = math.sqrt(spread[0, 0]), math.sqrt(spread[2, 2])
        sure = _SURE if way < _NARROW else _SURER
        if self._explained(motion, beams, 1.0) >= sure and motion.observable:
            return motion, False
        tried = self._tried(features, prior, way, turn)

        def scores(poses: Array, count: int, wide: float, apart: float = math.inf) -> Array:
            """Judge poses by so many of the beams, against that share of the prior."""
            few = some(beams, count)
            share = len(few) / max(len(beams), 1)
            known = -0.5 * share * squares_off(poses, prior, spread)
            found = evidence_of(poses, few, self._index, wide, _SAYS, before=known, apart=apart)
            return np.asarray(found[:, 0])

        for count, most in _SIFTED:
            tried = tried[distinct(tried, scores(tried, count, _WIDE), _APART, most)]
        poses = np.concatenate((tried, [motion.pose]))
        walls = as_walls(features.segments)
        query = Query(walls, np.zeros((2 * len(walls), 2 * len(walls))), beams)
        fine = refined(refined(poses, query, self._index, COARSE)[0], query, self._index, FINE)[0]
        poses = np.concatenate((fine, poses))
        # The motion that was matched is preferred by a little.
        fine_scores = scores(poses, _BEAMS, _TIGHT, apart=0.5)
        fine_scores[-1] += 0.5
        x, y, theta = poses[fine_scores.argmax()].tolist()
        best = Motion(x, y, theta, spread)
        if best.pose != motion.pose:
            motion = self._match(features, best.pose, _NEAR)
            walls_say = np.linalg.inv(motion.covariance) - np.linalg.inv(_NEAR)
            motion = replace(motion, covariance=np.linalg.inv(walls_say + np.linalg.inv(spread)))
        matched, found = scores(np.array([motion.pose, best.pose]), _BEAMS, _TIGHT)
        if found > matched + 1.0:
            motion = best
        return motion, self._explained(motion, beams, _PASSED) < _LOST

    def _explained(self, motion: Motion, beams: Array, less: float) -> float:
        """Return the share of the beams that are explained, less those that pass through walls."""
        found = evidence_of(np.array([motion.pose]), beams, self._index, _TIGHT)[0]
        self._evidence = found
        return float(found[1] - less * found[3])

    def _tried(self, features: Features, prior: Pose, way: float, turn: float) -> Array:
        """Poses around the expected one, and with the turns that walls suggest, shape (n, 3)."""
        steps = np.arange(-2, 3) * min(max(way, 0.1), 0.3)
        turns = prior[2] + np.arange(-3, 4) * min(max(turn / 2, 0.05), 0.1)
        turns = np.append(turns, _likely_turns(self._around, features, prior[2], turn))
        x, y, theta = np.meshgrid(prior[0] + steps, prior[1] + steps, turns, indexing="ij")
        return np.column_stack((x.ravel(), y.ravel(), theta.ravel()))

    def _match(self, features: Features, prior: Pose, spread: Array) -> Motion:
        motion, matches = Motion(*prior, spread), None
        for _ in range(_ROUNDS):
            found = associate(
                self._around, features, motion.pose, motion.covariance, roughness=_ROUGHNESS
            )
            if matches is not None and found.same_as(matches):
                break
            matches = found
            motion = estimate_motion(matches, prior, spread, roughness=_ROUGHNESS)
        return motion

    def _key(
        self,
        features: Features,
        motion: Motion,
        scan: LaserScan,
        found: tuple[bool, bool, Array],
    ) -> None:
        """Take a key frame; its segments are walls that are known, or new ones."""
        here = compose(self.frames[-1].pose, motion.pose) if self.frames else motion.pose
        walls = np.full(len(features.segments), -1, np.int64)
        if found[0]:
            self._first = len(self.frames)
        elif self.frames:
            around = self._around.transform(*inverse(motion.pose))
            before, now = associate(around, features, roughness=_ROUGHNESS).segments.T
            walls[now] = self._numbers[before]
            is_gone = passed(around.segments, beams_of(features, scan))
            is_gone[before] = False
            self._gone.update(self._numbers[is_gone].tolist())
        is_unknown = walls < 0
        walls[is_unknown] = self._next + np.arange(is_unknown.sum())
        self._next += int(is_unknown.sum())
        at, known = len(self.scans), (motion, self._spread, *found)
        key = KeyFrame(at, scan, features, walls, here, *known)
        self.frames.append(key)
        self._look_around()

    def _look_around(self) -> None:
        """Find the walls of the last key frames, in the frame of the last one."""
        last, frames = self.frames[-1], self.frames[self._first :][-REMEMBERED:]
        seen = sights_of([(frame.features.segments, frame.walls) for frame in frames], _ROUGHNESS)
        seen = seen[~np.isin(seen["wall"], [*self._gone])]
        self._numbers, seen["wall"] = np.unique(seen["wall"], return_inverse=True)
        poses = np.array([relative(last.pose, frame.pose) for frame in frames])
        lines = lines_of(seen, poses, len(self._numbers))
        segments = segments_of(walls_along(seen, poses, lines, WHOLE))
        segments["misfit"][seen["wall"]] = np.sqrt(seen["misfit"])
        numbers = np.searchsorted(self._numbers, last.walls)
        numbers = np.append(np.where(np.isin(last.walls, self._numbers), numbers, -1), -1)
        corners = last.features.corners.copy()
        corners["segments"] = numbers[corners["segments"]]
        # Edges may be silhouettes, arcs people.
        edges, arcs = last.features.edges[:0], last.features.arcs[:0]
        self._around = replace(
            last.features, segments=segments, corners=corners, edges=edges, arcs=arcs
        )
        walls = as_walls(segments)
        self._index = (LineMap(walls) if len(walls) else _NOWHERE).index


def turned(covariance: Array, angle: float) -> Array:
    """Return the covariance of a pose on other axes, turned back by so much [rad]."""
    turn = np.eye(3)
    turn[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    return np.asarray(turn @ covariance @ turn.T)


def _likely_turns(around: Features, features: Features, expected: float, spread: float) -> Array:
    """Return the turns by which segments lie along walls around, the likeliest first [rad]."""
    before, now = around.segments, features.segments
    off = before["angle"][:, np.newaxis] - now["angle"]
    weight = np.minimum(before["length"][:, np.newaxis], now["length"])
    bins = np.floor(np.mod(off, 2 * math.pi) / (2 * math.pi) * _BINS).astype(int) % _BINS
    votes = np.bincount(bins.ravel(), weight.ravel(), _BINS)
    votes = votes + 0.5 * (np.roll(votes, 1) + np.roll(votes, -1))
    # Large turns are less likely.
    turns = wrapped((np.arange(_BINS) + 0.5) / _BINS * 2 * math.pi)
    votes = votes * np.exp(-0.5 * (wrapped(turns - expected) / max(spread, 0.5)) ** 2)
    peaks = (votes >= np.roll(votes, 1)) & (votes > np.roll(votes, -1))
    order = np.argsort(-np.where(peaks, votes, 0.0), kind="stable")[:_TURNS]
    return np.asarray(turns[order[votes[order] > 0]])


def passed(walls: NDArray[np.void], beams: Array) -> NDArray[np.bool_]:
    """Whether beams pass through each wall, away from its ends, and end far behind.

    A wall that faces away behind the sensor counts as well: the line of a beam goes through it,
    backwards. It has been left, and what is seen on the way back is for a loop to join.
    """
    ends, passes = np.concatenate((walls["start"], walls["end"]), axis=1), np.empty(len(walls), int)
    count_passes(beams, ends, (0.1, 0.2, 0.3), passes)
    return passes >= 3
