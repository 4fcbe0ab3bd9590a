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
from ..motion.deskew import deskew
from ..motion.estimate import Motion
from ..motion.odometry import covariance_grown
from ..scan import Array, LaserScan, Pose
from ..scan.poses import Twist, compose, inverse, relative, twist_between
from ..walls import Numbers, segments_of, wrapped
from ..walls.sights import WHOLE, lines_of, sights_of, walls_along
from .around import ROUGHNESS, USUAL, Around
from .local_map import beams_of
from .views import looked, views_of
from .wheels import OdometryCheck

#: A key frame is taken after so much way, or so much turn [m, rad].
SPACING, TURN = 0.3, math.radians(15.0)
#: Key frames through which a wall is remembered that is not seen.
REMEMBERED = 30
#: Deviations of the motion by odometry [m, rad], and their growth with way and turn.
_ODOMETRY = (0.03, 0.02), (0.1, 0.1)
#: The same where it goes on as it did: robots turn at once.
_CONTINUED = (0.3, 0.3)
#: Without odometry, errors from scan to scan add up to so much where little shows how far it goes,
#: until more is seen [m, m, rad].
_ADDED_UP = np.diag((0.2, 0.2, 0.0)) ** 2
#: A scan comes soon after the last one if its motion is known so well [m].
_SOON = 0.1
#: A robot is not thought to go on faster [m/s, rad/s]; longest time from scan to scan [s].
_FAST, _SLOWEST = 1.2, 3.0
#: It is expected to go on as in so long [s]: by one step of a fast scanner it would be by noise.
_LASTING = 0.5
#: Motions off what odometry says by so many deviations contradict it.
_CONTRADICTED = 5.0
#: Covariance of a motion of which nothing is known [m, m, rad].
UNKNOWN = np.diag((10.0, 10.0, 1.0)) ** 2


@dataclass(slots=True, eq=False)
class KeyFrame:
    """A scan that stands for those around it: number `index` of the log.

    `walls` has the number of the wall that each segment shows, `pose` is that in the frame of the
    first key frame, `motion` that since the one before: a guess where the way is lost, unless it
    `has_odometry`, of so long a `duration` [s]. `expected` is its covariance before walls are
    matched: by odometry, by how it went on, or by beams where no wall shows how far. There, without
    odometry, `beams_alone` is that by beams alone. `off` is what walls say beside what was expected
    since the key frame before [m, m, rad].
    """

    index: int
    scan: LaserScan
    features: Features
    walls: Numbers
    pose: Pose
    motion: Motion
    duration: float
    expected: Array
    beams_alone: Array | None
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
        #: What is around the last key frame; numbers of its walls, that of the next, those that are
        #: gone, and the first key frame since lost.
        self._around: Around
        self._numbers, self._next = np.empty(0, np.int64), 0
        self._gone: set[int] = set()
        self._first = 0
        #: How far the last key frames have looked.
        self._far: list[Array] = []
        #: Stamp, odometry and pose in the frame of the last key frame of the last scan; its step.
        self._last: tuple[float, Pose | None, Pose] = (math.nan, None, (0.0, 0.0, 0.0))
        self._step: Pose = (0.0, 0.0, 0.0)
        #: Time of the motion since the last key frame [s]; covariance, before walls are matched.
        self._lasted, self._spread = 0.0, np.zeros((3, 3))
        #: What the last beams say.
        self._evidence = np.array((0.0, 1.0, 0.0, 0.0))
        #: Odometry at the last key frame.
        self._from: Pose | None = None
        self._check = OdometryCheck()
        #: Time from scan to scan, on average.
        self._pace = 1.0

    @in_turn
    def straight(self, scan: LaserScan, twist: Twist | None) -> LaserScan:
        """Return the next scan as if it had been taken at once, at its stamp.

        `twist` is the velocity by odometry. If that is not known, or not believed, the sensor is
        thought to go on as in the last half second.
        """
        if twist is None or not self._check.is_believed:
            twist = None
            if len(self.scans) > 1 and scan.stamp > self._last[0]:
                twist = twist_between((0.0, 0.0, 0.0), self._step, self._pace)
        return deskew(scan, twist)

    @in_turn
    def add(self, scan: LaserScan, features: Features, odometry: Pose | None = None) -> Step:
        """Add the next scan; return where it was taken."""
        odometry = self._check(scan, odometry)
        motion, is_key, is_lost = Motion(0.0, 0.0, 0.0, np.zeros((3, 3))), True, False
        has_odometry = odometry is not None and self._last[1] is not None
        by = self._by_odometry(odometry) if has_odometry else None
        if self.frames:
            prior, spread = self._expected(scan.stamp, odometry)
            wide = spread if has_odometry else np.maximum(spread, _ADDED_UP)
            motion, by_beams, is_lost, self._evidence = self._around.place(
                scan, features, prior, wide, math.sqrt(spread[0, 0]) < _SOON
            )
            self._lasted += self._since(scan.stamp)
            self._spread = self._spread + spread if by is None else covariance_grown(by, *_ODOMETRY)
            if is_lost:
                motion = Motion(*prior, spread)
            elif by_beams is not None and not has_odometry:
                self._spread = by_beams
            way, turn = math.hypot(motion.x, motion.y), abs(motion.theta)
            is_key = way >= SPACING or turn >= TURN or is_lost
            self._go_on(scan.stamp, motion.pose, wide, by_beams)
        if is_key:
            off = np.zeros(3) if by is None else np.subtract(motion.pose, by)
            off[2] = wrapped(off[2])
            is_bare = not (is_lost or has_odometry or motion.observable)
            beams_alone = self._around.beams_alone(scan, features, motion) if is_bare else None
            walls = np.full(len(features.segments), -1, np.int64)
            known = motion.pose, motion, self._lasted, self._spread
            found = beams_alone, is_lost, has_odometry, off
            self._key(KeyFrame(len(self.scans), scan, features, walls, *known, *found))
            self._lasted, self._spread, self._from = 0.0, np.zeros((3, 3)), odometry
        pose = (0.0, 0.0, 0.0) if is_key else motion.pose
        self.scans.append((len(self.frames) - 1, pose))
        self._last = scan.stamp, odometry, pose
        here = compose(self.frames[-1].pose, pose)
        unsure = UNKNOWN if is_lost and not has_odometry else motion.covariance
        # The axes of the motion are those of the key frame before it.
        return Step(here, turned(unsure, here[2] - motion.theta), self._evidence)

    def _by_odometry(self, odometry: Pose | None) -> Pose | None:
        """Return the motion since the last key frame by odometry, if it is known."""
        if odometry is None or self._from is None:
            return None
        return relative(self._from, odometry)

    def _go_on(self, stamp: float, pose: Pose, expected: Array, by_beams: Array | None) -> None:
        """Remember the step of the last half second, by as much as beams know it better."""
        duration = stamp - self._last[0]
        if duration > 0:
            self._pace += 0.1 * (min(duration, _SLOWEST) - self._pace)
        most, step = _FAST * self._pace, np.array(self._step)
        off = relative(self._last[2], pose) - step
        off[2] = wrapped(off[2])
        if by_beams is not None:
            usual = USUAL**2 * expected
            off = usual @ np.linalg.inv(usual + by_beams) @ off
        step += min(self._pace / _LASTING, 1.0) * off
        x, y, turn = np.clip(step, -most, most).tolist()
        self._step = x, y, turn

    def _since(self, stamp: float) -> float:
        """Return the time since the last scan: stamps may come in bunches, or be all the same."""
        return max(stamp - self._last[0], self._pace)

    def _expected(self, stamp: float, odometry: Pose | None) -> tuple[Pose, Array]:
        """Pose in the frame of the last key frame as it is expected, and its covariance."""
        before, duration = self._last[2], self._since(stamp)
        if odometry is not None and self._last[1] is not None:
            step = relative(self._last[1], odometry)
            return compose(before, step), covariance_grown(step, *_ODOMETRY)
        least = min(0.02 + 0.4 * duration, 0.3), min(0.02 + 0.8 * duration, 0.7)
        return compose(before, self._step), covariance_grown(self._step, least, _CONTINUED)

    def _key(self, key: KeyFrame) -> None:
        """Take a key frame; its segments are walls that are known, or new ones."""
        walls = key.walls
        if key.is_lost:
            self._first = len(self.frames)
        elif self.frames:
            around = self._around.features.transform(*inverse(key.motion.pose))
            before, now = associate(around, key.features, roughness=ROUGHNESS).segments.T
            walls[now] = self._numbers[before]
            is_gone = passed(around.segments, beams_of(key.features, key.scan))
            is_gone[before] = False
            self._gone.update(self._numbers[is_gone].tolist())
        is_unknown = walls < 0
        walls[is_unknown] = self._next + np.arange(is_unknown.sum())
        self._next += int(is_unknown.sum())
        if self.frames:
            key.pose = compose(self.frames[-1].pose, key.motion.pose)
        self.frames.append(key)
        self._far = [*self._far, looked(key.scan)][-REMEMBERED:]
        self._look_around()

    def _look_around(self) -> None:
        """Find the walls of the last key frames, in the frame of the last one."""
        last, frames = self.frames[-1], self.frames[self._first :][-REMEMBERED:]
        seen = sights_of([(frame.features.segments, frame.walls) for frame in frames], ROUGHNESS)
        seen = seen[~np.isin(seen["wall"], [*self._gone])]
        self._numbers, seen["wall"] = np.unique(seen["wall"], return_inverse=True)
        poses = np.array([relative(last.pose, frame.pose) for frame in frames])
        # The last one first: most places that were seen, it has seen.
        views = views_of(poses[::-1], self._far[-len(frames) :][::-1])
        lines = lines_of(seen, poses, len(self._numbers))
        segments = segments_of(walls_along(seen, poses, lines, WHOLE))
        segments["misfit"][seen["wall"]] = np.sqrt(seen["misfit"])
        numbers = np.searchsorted(self._numbers, last.walls)
        numbers = np.append(np.where(np.isin(last.walls, self._numbers), numbers, -1), -1)
        corners = last.features.corners.copy()
        corners["segments"] = numbers[corners["segments"]]
        # Edges may be silhouettes, arcs people.
        edges, arcs = last.features.edges[:0], last.features.arcs[:0]
        features = replace(
            last.features, segments=segments, corners=corners, edges=edges, arcs=arcs
        )
        self._around = Around.of(features, last.scan, views)


def steps_between(poses: Array) -> Array:
    """Way to each pose from the one before (n,) [m]."""
    return np.asarray(np.hypot(*np.diff(poses[:, :2], axis=0, prepend=poses[:1, :2]).T))


def turned(covariance: Array, angle: float) -> Array:
    """Return the covariance of a pose on other axes, turned back by so much [rad]."""
    turn = np.eye(3)
    turn[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    return np.asarray(turn @ covariance @ turn.T)


def passed(walls: NDArray[np.void], beams: Array) -> NDArray[np.bool_]:
    """Whether beams pass through each wall, away from its ends, and end far behind.

    A wall that faces away behind the sensor counts as well: the line of a beam goes through it,
    backwards. It has been left, and what is seen on the way back is for a loop to join.
    """
    ends, passes = np.concatenate((walls["start"], walls["end"]), axis=1), np.empty(len(walls), int)
    count_passes(beams, ends, (0.1, 0.2, 0.3), passes)
    return passes >= 3
