"""`LocalMap`: what was seen on the last metres of the way, in one frame."""

import math
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._copies import InTurn, in_turn
from ..features import Features
from ..features.features import scan_of
from ..kernels.mapping.layout import BEAM_COLUMNS, LOCAL_COLUMNS
from ..motion.odometry import compose_covariances, covariance_grown
from ..motion.tracker import Tracks
from ..scan import Array, LaserScan, Pose
from ..scan.poses import compose, inverse, relative
from ..walls import SHORTEST, unit, wrapped
from .adjust import adjust
from .hypotheses import anchors, meetings

#: A scan is kept after so much way, or so much turn [m, rad].
SPACING, TURN = 0.3, 0.26
#: Deviations of a motion by odometry and by features [m, rad], and their growth with way and turn.
#: What the features say is known by the walls already; the rest, of directions that are not
#: observed, is the tracker's guess.
ODOMETRY = (0.005, 0.005), (0.1, 0.1)
UNSURE = (0.05, 0.02), (1.0, 0.2)
#: How far a sensor may go between scans in a direction that is not observed [m].
FASTEST = 0.5
#: One beam is kept for each square of so much [m] in which beams end, and at most so many.
_SQUARE, MOST_BEAMS = 0.25, 160


@dataclass(frozen=True, eq=False)
class Query:
    """What is looked for: walls and beams in one frame, the sensor's now.

    Attributes
    ----------
    walls : structured array of `WALL`
    covariance : ndarray, shape (2n, 2n)
        Of (offset, angle) of all walls [m, rad].
    beams : ndarray, shape (b, 10)
        Origin [m], direction, range [m], its variance [m²], weight, covariance of the end [m²].
    """

    walls: NDArray[np.void]
    covariance: Array
    beams: Array

    @cached_property
    def table(self) -> Array:
        """The walls as the kernels take them, shape (n, LOCAL_COLUMNS)."""
        walls = self.walls
        table = np.empty((len(walls), LOCAL_COLUMNS))
        table[:, :2], table[:, 2:4] = walls["centroid"], unit(walls["angle"])
        for column, end in ((4, "start"), (5, "end")):
            table[:, column] = np.linalg.norm(walls[end] - walls["centroid"], axis=1)
        table[:, 6:] = walls["covariance"].reshape(-1, 4)[:, (0, 1, 3)]
        return table

    def mirrored(self) -> "Query":
        """Return its mirror image, which is as rich but belongs nowhere on a plan."""
        walls, beams = self.walls.copy(), self.beams * (1, -1, 1, -1, 1, 1, 1, 1, -1, 1)
        for name, of in (("start", "end"), ("end", "start"), ("centroid", "centroid")):
            walls[name] = self.walls[of] * (1, -1)
        walls["angle"] = wrapped(math.pi - self.walls["angle"])
        walls["covariance"] *= [[1, -1], [-1, 1]]
        signs = np.tile([1.0, -1.0], len(walls))
        return Query(walls, self.covariance * np.outer(signs, signs), beams)

    @property
    def corners(self) -> NDArray[np.void]:
        """Where walls end together, records of `hypotheses.MEETING`."""
        return meetings(self.walls)

    @cached_property
    def anchors(self) -> Array:
        """What votes: these, and ends of walls, see `hypotheses.anchors`."""
        return anchors(self.walls, self.corners)


class LocalMap(InTurn):
    """Walls and beams of the last metres of the way, built scan by scan from a tracker's motions.

    Parameters
    ----------
    way : float
        What was seen before the last so many metres is forgotten [m].
    roughness : float
        How far surfaces are off straight lines, elsewhere in each scan [m]: 0 for simulated ones.

    Examples
    --------
    >>> import lineament as ln
    >>> from lineament.simulation import SENSORS, drive, room
    >>> tracker, local, extract = ln.Tracker(), LocalMap(), ln.Extractor()
    >>> for scan in drive(room(), [(-2, 0), (-1, 0)], SENSORS["utm30lx"], speed=1, rate=10):
    ...     features = extract(scan)
    ...     local.add(features, tracker(features))
    >>> local
    LocalMap(4 scans, 1.0 m)
    """

    def __init__(self, way: float = 5.0, *, roughness: float = 0.005) -> None:
        for name, value in (("way", way), ("roughness", roughness)):
            if not value >= 0:
                raise ValueError(f"{name} is {value}, expected a length ≥ 0")
        self.way, self.roughness = way, roughness
        self._sights: list[_Sight] = []

    @in_turn
    def __repr__(self) -> str:
        return f"LocalMap({len(self._sights)} scans, {self._way:.1f} m)"

    @property
    @in_turn
    def way_seen(self) -> float:
        """Length of the way that it shows [m]."""
        return self._way

    @property
    def _way(self) -> float:
        return sum(sight.way for sight in self._sights[1:])

    @in_turn
    def add(
        self,
        features: Features,
        tracks: Tracks,
        odometry: Pose | None = None,
        scan: LaserScan | None = None,
    ) -> None:
        """Add a scan: its features, and what the tracker says of them.

        `odometry` is the pose by odometry that the tracker had: along a bare corridor the walls do
        not show the motion, and people who walk there feign one. `scan` is needed where the
        features do not have it themselves: those of a batch.
        """
        beams, motion, sights = beams_of(features, scan), tracks.motion, self._sights
        long = features.segments["length"] >= SHORTEST
        here = _Sight(features.segments[long], tracks.segments[long], beams, odometry)
        if not sights or motion is None:
            self._sights = [here]
            return
        before = sights[-1]
        if len(sights) == 1 or before.way > SPACING or before.turn > TURN:
            before = _Sight(before.segments, before.numbers, before.beams, before.odometry)
        else:
            sights.pop()
        moved, sure = motion.pose, UNSURE
        if odometry is not None and before.odometry is not None:
            moved, sure = relative(before.odometry, odometry), ODOMETRY
        spread = covariance_grown(moved, *sure)
        if sure is UNSURE:
            spread += FASTEST**2 * motion.unobserved.T @ motion.unobserved
        here.covariance = compose_covariances(before.motion, before.covariance, moved, spread)
        here.motion = compose(before.motion, moved)
        here.way = before.way + math.hypot(*moved[:2])
        here.turn = before.turn + abs(moved[2])
        sights.append(here)
        while len(sights) > 1 and self._way > self.way:
            del sights[0]

    @in_turn
    def query(self, way: float = math.inf) -> Query:
        """Return walls and beams of the last metres of way, in the frame of the last scan.

        ValueError before there is a scan.
        """
        sights = self._sights
        if not sights:
            raise ValueError("the local map is empty, expected a scan")
        gone = np.cumsum([sight.way for sight in sights[:0:-1]])
        sights = sights[len(sights) - 1 - int((gone <= way).sum()) :]
        poses: list[Pose] = [(0.0, 0.0, 0.0)]
        for sight in sights[:0:-1]:
            poses.append(compose(poses[-1], inverse(sight.motion)))
        motions = [(sight.motion, sight.covariance) for sight in sights[1:]]
        seen = [(sight.segments, sight.numbers) for sight in sights]
        placed, spreads, walls, covariance = adjust(poses[::-1], motions, seen, self.roughness)
        beams = [
            moved_beams(sight.beams, pose, spread)
            for sight, pose, spread in zip(sights, placed, spreads, strict=True)
        ]
        return Query(walls, covariance, thinned(np.concatenate(beams[::-1])))


@dataclass(slots=True, eq=False)
class _Sight:
    """What a scan shows, the numbers of its segments, and the motion since the one kept before."""

    segments: NDArray[np.void]
    numbers: NDArray[np.int64]
    beams: Array
    odometry: Pose | None
    motion: Pose = (0.0, 0.0, 0.0)
    covariance: Array = field(default_factory=lambda: np.zeros((3, 3)))
    way: float = 0.0
    turn: float = 0.0


def query_of_scan(features: Features, scan: LaserScan | None = None) -> Query:
    """Return walls and beams of one scan."""
    beams = thinned(beams_of(features, scan))
    segments = features.segments[features.segments["length"] >= SHORTEST]
    _, _, walls, covariance = adjust([(0.0, 0.0, 0.0)], [], [(segments, np.arange(len(segments)))])
    return Query(walls, covariance, beams)


def some(rows: NDArray[Any], count: int) -> NDArray[Any]:
    """Return so many of the rows, evenly spread, or all if there are no more."""
    return np.asarray(rows[_spread_out(len(rows), count)])


@lru_cache
def _spread_out(n: int, count: int) -> NDArray[np.intp]:
    return np.linspace(0, n - 1, min(count, n)).astype(np.intp)


def thinned(beams: Array) -> Array:
    """Return one beam for each square in which beams end, the first."""
    ends = np.floor((beams[:, :2] + beams[:, 4:5] * beams[:, 2:4]) / _SQUARE).astype(np.int64)
    _, first = np.unique(ends[:, 0] * 1_000_003 + ends[:, 1], return_index=True)
    return np.asarray(beams[some(np.sort(first), MOST_BEAMS)])


def beams_of(features: Features, scan: LaserScan | None = None) -> Array:
    """Return the valid beams of a scan, shape (n, BEAM_COLUMNS)."""
    scan = scan_of(features, scan)
    valid, noise = scan.valid, features.noise
    r, bearings = scan.ranges[valid], scan.angles[valid]
    beams = np.zeros((len(r), BEAM_COLUMNS))
    beams[:, 2:4], beams[:, 4], beams[:, 6] = unit(bearings), r, 1.0
    sigma = 0.02 if noise is None else np.hypot(noise.sigma, noise.proportional * r)
    beams[:, 5] = np.square(sigma)
    return beams


def moved_beams(beams: Array, pose: Pose, covariance: Array) -> Array:
    """Return beams as they are seen from another frame, with the covariance of their ends."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    moved = beams.copy()
    moved[:, :2] = pose[:2]
    moved[:, 2:4] = beams[:, 2:4] @ np.array([[c, s], [-s, c]])
    jacobian = np.zeros((len(beams), 2, 3))
    jacobian[:, 0, 0] = jacobian[:, 1, 1] = 1.0
    jacobian[:, :, 2] = moved[:, 4:5] * moved[:, 3:1:-1] * (-1, 1)
    spread = jacobian @ covariance @ jacobian.transpose(0, 2, 1)
    moved[:, 7:9], moved[:, 9] = spread[:, 0], spread[:, 1, 1]
    return moved
