"""`Localiser`: where a robot is on a plan, and its odometry, by its scans and frames."""

import math
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from ..errors import LineamentError
from ..features import Features
from ..mapping import LineMap
from ..mapping.following import Follower, Whereabouts
from ..mapping.grids import Grid
from ..mapping.judging import Judge, Judgement
from ..motion.deskew import beam_times
from ..rosmsg.frames import Frames, Place, frame_of
from ..rosmsg.grids import OccupancyGrid
from ..rosmsg.poses import Odometry, StampedPose
from ..scan import Array, LaserScan, Pose
from ..scan.poses import Twist, carried, compose, inverse, relative
from .config import LiveConfig
from .received import GUESS, JUDGED, MANY, MOUNTINGS, RELOCATE, Heard

#: Scanners that are followed; a robot has fewer, unless names are made up.
_MOST_SCANNERS = 8
#: Cells of a map on a topic are occupied from, and free up to, such values: as of map_server.
_SURE = 65, 25
#: Where they should come from.
_WHENCE = {
    "mounting": "expected on /tf_static, or a laser_pose",
    "odometry": "expected on /tf, or a topic of odometry",
    "pose to judge": "the stamp of the pose that is to be judged",
}
#: Transforms that were sent, by which those of others are known.
_SENT = 50


class Placed(NamedTuple):
    """Where a robot is on the plan.

    Attributes
    ----------
    base : (x, y, theta)
        Pose of the robot [m, m, rad].
    covariance : ndarray, shape (3, 3)
        Of this pose [m, m, rad].
    odom : (x, y, theta) or None
        Pose on the plan of the frame of the odometry; None where no odometry is known.
    """

    base: Pose
    covariance: Array
    odom: Pose | None


class Localiser:
    """Follows the scanners of a robot on a plan, by its odometry and the mountings on ``/tf``.

    Where the scanner is lost, there is no `Placed`. A scanner is known by the frame of its scans: a
    driver that is started again goes on where it was.

    Parameters
    ----------
    config : LiveConfig
        Frames, the mounting of the scanner, whether the odometry has its own topic.
    plan : LineMap, optional
        None until there is a map on a topic.
    extract : callable
        Returns the features of a scan: of one that is upside down, and is turned over for the plan.
    """

    def __init__(
        self, config: LiveConfig, plan: LineMap | None, extract: Callable[[LaserScan], Features]
    ) -> None:
        self._config, self._plan, self._extract = config, plan, extract
        self._map, self._odom, self._base = map(
            frame_of, (config.map_frame, config.odom_frame, config.base_frame)
        )
        self._followers: dict[str, Follower] = {}
        self._frames = Frames()
        self._guess: StampedPose | None = None
        self._judge = None if config.judge is None or plan is None else Judge(plan)
        self._map_heard: OccupancyGrid | None = None
        self._known: dict[str, Whereabouts] = {}
        self._claim: StampedPose | None = None
        self._claimed_odom: Pose | None = None
        self._missing = dict.fromkeys(_WHENCE, 0)
        self._sent: deque[Pose] = deque(maxlen=_SENT)
        self._problems: dict[str, str] = {}

    def hear(self, message: Heard, what: str) -> None:
        """Take what was heard beside the scans; ValueError if it makes no sense."""
        if what == RELOCATE:
            for follower in self._followers.values():
                follower.forget()
        elif isinstance(message, OccupancyGrid):
            self._take(message)
        elif isinstance(message, Odometry):
            base = message.child_frame or self._base
            moved = StampedPose(message.stamp, self._odom, base, message.pose)
            self._frames.add(moved)
        elif isinstance(message, list) and what in (GUESS, JUDGED):
            (said,) = message
            if frame_of(said.frame) != self._map:
                raise ValueError(f"it is in frame {said.frame!r}, expected {self._map!r}")
            if what == GUESS:
                self._guess = said
            else:
                self._claim = said
        elif isinstance(message, list):
            for link in message:
                self._join(link, is_fixed=what == MOUNTINGS)

    def problems(self) -> Iterator[str]:
        """Yield what keeps the robot from being placed, a line each."""
        yield from sorted(self._problems.values())

    def __call__(
        self, features: Features, scan: LaserScan, straight: LaserScan
    ) -> tuple[Whereabouts | None, Placed | None, Judgement | None]:
        """Follow a scanner by its next scan: as it came, and `straight`, as its features have it.

        Only the name of its frame, its time, its pose and the times of its beams are taken of it.
        Nothing is known before there is a plan.
        """
        if not self._is_ready:
            return None, None, None
        mounting, travelled = self._mounting(scan), self._travelled(scan)
        if mounting is not None and mounting.is_upside_down:
            features = self._extract(straight.turned_over())
        laser = scan.pose
        if self._config.is_localiser:
            laser = None
            if mounting is not None and travelled is not None:
                laser = compose(travelled, mounting.pose)
        mounted = (0.0, 0.0, 0.0) if mounting is None else mounting.pose
        if (guess := self._guess) is not None and self._plan is not None:
            base, self._guess = self._moved(guess, travelled), None
            self._follower(scan.frame_id).suppose(compose(base, mounted), guess.covariance)
        where = self._followed(features, scan, laser, is_deskewed=straight is not scan)
        self._known[scan.frame_id] = where
        judgement = None
        if self._judge is not None and mounting is not None:
            claimed = self._claimed(travelled)
            if claimed is not None:
                judgement = self._judge(features, compose(claimed, mounted), where)
        if mounting is None or not where.is_known:
            return where, None, judgement
        base = compose(where.pose, inverse(mounted))
        odom = None if travelled is None else compose(base, inverse(travelled))
        if odom is not None:
            self._sent.append(odom)
        covariance = carried(where.covariance, where.pose, base)
        return where, Placed(base, covariance, odom), judgement

    @property
    def plan(self) -> LineMap | None:
        """The plan, where it is one that grows: here it does not."""
        return None

    def save(self) -> str:
        """Write what was made; return a line about it: here nothing."""
        return ""

    def close(self) -> None:
        """End what runs beside it."""

    @property
    def _is_ready(self) -> bool:
        return self._plan is not None

    def _take(self, grid: OccupancyGrid) -> None:
        """Take a map, unless it is the same again: who was followed is looked for where it was."""
        if frame_of(grid.frame) != self._map:
            raise ValueError(f"it is in frame {grid.frame!r}, expected {self._map!r}")
        before, self._map_heard = self._map_heard, grid
        is_placed_alike = before is not None and before[2:] == grid[2:]
        if before is not None and is_placed_alike and np.array_equal(before.cells, grid.cells):
            return
        try:
            known = Grid(grid.cells, grid.resolution, grid.origin, *_SURE)
            self._plan = plan = LineMap.from_grid(known)
        except LineamentError as error:
            raise ValueError(str(error)) from None
        self._judge = None if self._config.judge is None else Judge(plan)
        self._followers = {frame: Follower(plan) for frame in self._followers}
        for frame, where in self._known.items():
            if where.is_known and frame in self._followers:
                self._followers[frame].suppose(where.pose)

    def _followed(
        self, features: Features, scan: LaserScan, laser: Pose | None, *, is_deskewed: bool
    ) -> Whereabouts:
        """Follow a scanner to its next scan; where it is by odometry, if that is known."""
        follower = self._follower(scan.frame_id)
        skew = (0.0, 0.0, 0.0) if is_deskewed else _skew(scan, follower.twist)
        return follower(features, laser, skew)

    def _follower(self, frame: str) -> Follower:
        assert self._plan is not None
        if frame not in self._followers:
            if len(self._followers) >= _MOST_SCANNERS:
                gone = next(iter(self._followers))
                del self._followers[gone], self._known[gone]
            self._followers[frame] = Follower(self._plan)
        return self._followers[frame]

    def _mounting(self, scan: LaserScan) -> Place | None:
        """Where the scanner is on the robot; None if that is not known."""
        config, frame = self._config, frame_of(scan.frame_id)
        if any(config.laser_pose) or config.upside_down or not config.is_localiser:
            return Place(config.laser_pose, config.upside_down)
        return self._find("mounting", self._base, frame, scan.stamp)

    def _travelled(self, scan: LaserScan) -> Pose | None:
        """Where the robot has come to by its odometry; None if that is not known."""
        if not self._config.is_localiser:
            laser = inverse(self._config.laser_pose)
            return None if scan.pose is None else compose(scan.pose, laser)
        found = self._find("odometry", self._odom, self._base, scan.stamp)
        return None if found is None else found.pose

    def _find(self, what: str, parent: str, child: str, stamp: float) -> Place | None:
        """Return where a frame is in another one; None, and a problem in the end, if unknown."""
        try:
            found = self._frames.find(parent, child, stamp)
        except LookupError as error:
            self._missing[what] += 1
            if self._missing[what] >= MANY:
                done = "judged" if what == "pose to judge" else "placed"
                self._problems[what] = f"the robot is not {done}: {error}, {_WHENCE[what]}"
            return None
        self._missing[what] = 0
        self._problems.pop(what, None)
        return found

    def _moved(self, guess: StampedPose, travelled: Pose | None) -> Pose:
        """Where the robot was said to be, and has gone since."""
        if travelled is not None:
            with suppress(LookupError):  # Who sends it by hand seldom gives a time: it holds now.
                then = self._frames.find(self._odom, self._base, guess.stamp).pose
                return compose(guess.pose, relative(then, travelled))
        return guess.pose

    def _claimed(self, travelled: Pose | None) -> Pose | None:
        """Where somebody else believes the robot to be: at the last pose, and gone on since."""
        if (claim := self._claim) is not None:
            then = self._find("pose to judge", self._odom, self._base, claim.stamp)
            if then is not None:
                self._claim, self._claimed_odom = None, compose(claim.pose, inverse(then.pose))
            elif self._missing["pose to judge"] >= MANY:
                return None
        if travelled is None or self._claimed_odom is None:
            return None
        return compose(self._claimed_odom, travelled)

    def _join(self, link: StampedPose, is_fixed: bool) -> None:
        """Take a transform; note that somebody else places the robot too: it jumps to and fro."""
        parent, child = frame_of(link.frame), frame_of(link.child_frame)
        if child != self._odom:
            if parent != self._odom or self._config.odometry_topic is None:
                self._frames.add(link, is_fixed=is_fixed)
            return
        is_placed = parent == self._map and self._config.is_broadcasting
        if is_placed and not any(np.allclose(link.pose, pose, atol=1e-6) for pose in self._sent):
            self._problems["another"] = (
                f"{self._map} → {self._odom} is on /tf from another node as well: "
                "stop that, or give --no-broadcast"
            )


def _skew(scan: LaserScan, twist: Twist | None) -> Pose:
    """Return what a scan as a whole may be off that was taken on the way, and not deskewed."""
    times = beam_times(scan)
    if times is None or twist is None:
        return (0.0, 0.0, 0.0)
    x, y, turn = (np.abs(twist) * np.ptp(times) / 2).tolist()
    return x, y, math.remainder(turn, 2 * math.pi)
