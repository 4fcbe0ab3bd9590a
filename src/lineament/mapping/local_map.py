"""`LocalMap`: what was seen on the last metres of the way, in one frame."""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..kernels.mapping import BEAM_COLUMNS, LOCAL_COLUMNS
from ..motion.odometry import compose_jacobians
from ..motion.tracker import Tracks
from ..scan import Array, LaserScan, Pose
from ..scan.poses import compose, relative
from .hypotheses import meetings
from .walls import SHORTEST, WALL, Merger

#: A scan is kept after so much way, or so much turn [m, rad].
SPACING, TURN = 0.3, 0.26
#: One beam is kept for each square of so much [m] in which beams end, and at most so many.
_SQUARE, MOST_BEAMS = 0.25, 160


@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """What is looked for: walls and beams in one frame, the sensor's now.

    Attributes
    ----------
    walls : structured array of `WALL`
    covariance : ndarray, shape (2n, 2n)
        Of (offset, angle) of all walls [m, rad].
    beams : ndarray, shape (b, 7)
        Origin [m], direction, range [m], variance [m²], weight.
    """

    walls: NDArray[np.void]
    covariance: Array
    beams: Array

    @property
    def table(self) -> Array:
        """The walls as the kernels take them, shape (n, LOCAL_COLUMNS)."""
        walls = self.walls
        table = np.empty((len(walls), LOCAL_COLUMNS))
        table[:, :2], table[:, 2] = walls["centroid"], walls["angle"]
        table[:, 3] = np.linalg.norm(walls["start"] - walls["centroid"], axis=1)
        table[:, 4] = np.linalg.norm(walls["end"] - walls["centroid"], axis=1)
        table[:, 5:7], table[:, 7] = walls["covariance"][:, 0], walls["covariance"][:, 1, 1]
        return table

    @property
    def corners(self) -> NDArray[np.void]:
        """Where walls end together, records of `hypotheses.MEETING`."""
        return meetings(self.walls)


class LocalMap:
    """Walls and beams of the last metres of the way, built scan by scan from a tracker's motions.

    Parameters
    ----------
    way : float
        What was seen before the last so many metres is forgotten [m].

    Examples
    --------
    >>> import lineament as ln
    >>> from lineament.simulation import SENSORS, drive, room
    >>> tracker, local, extract = ln.Tracker(), LocalMap(), ln.Extractor()
    >>> for scan in drive(room(), [(-2, 0), (-1, 0)], SENSORS["utm30lx"], speed=1, rate=10):
    ...     features = extract(scan)
    ...     local.add(features, tracker(features))
    >>> local
    LocalMap(6 scans, 1.0 m)
    """

    def __init__(self, way: float = 5.0) -> None:
        if not way >= 0:
            raise ValueError(f"way is {way}, expected a length ≥ 0")
        self.way = way
        self._kept: deque[_Sight] = deque()
        self._last: _Sight | None = None

    def __repr__(self) -> str:
        scans = [*self._kept] + ([self._last] if self._last else [])
        way = self._last.way - scans[0].way if self._last else 0.0
        return f"LocalMap({len(scans)} scans, {way:.1f} m)"

    def add(self, features: Features, tracks: Tracks, scan: LaserScan | None = None) -> None:
        """Add a scan: its features, and what the tracker says of them.

        `scan` is needed where the features do not have it themselves: those of a batch.
        """
        scan = features.scan if scan is None else scan
        if scan is None:
            raise ValueError("the features have no scan, expected it as the third argument")
        before = self._last
        if before is None or tracks.motion is None:
            self._kept.clear()
            self._last = _Sight(features, scan, (0.0, 0.0, 0.0), np.zeros((3, 3)), 0.0, 0.0)
            return
        motion = tracks.motion
        of_pose, of_motion = compose_jacobians(before.pose, motion.pose)
        self._last = _Sight(
            features,
            scan,
            compose(before.pose, motion.pose),
            of_pose @ before.covariance @ of_pose.T + of_motion @ motion.covariance @ of_motion.T,
            before.way + float(np.hypot(motion.x, motion.y)),
            before.turn + abs(motion.theta),
        )
        kept = self._kept[-1] if self._kept else None
        if (
            kept is None
            or self._last.way - kept.way > SPACING
            or self._last.turn - kept.turn > TURN
        ):
            self._kept.append(before)
        while self._kept and self._last.way - self._kept[0].way > self.way:
            self._kept.popleft()

    def query(self) -> Query:
        """Return walls and beams in the frame of the last scan; ValueError before there is one."""
        if self._last is None:
            raise ValueError("the local map is empty, expected a scan")
        merger, beams = Merger(), []
        for sight in (self._last, *reversed(self._kept)):
            pose, spread = _seen_from(sight, self._last)
            merger.add(sight.features.transform(*pose, spread))
            beams.append(beams_of(sight.features, sight.scan, pose, spread))
        walls, _ = merger.result()
        return query_of(walls, None, np.concatenate(beams))


@dataclass(frozen=True, slots=True, eq=False)
class _Sight:
    """A scan, its pose in the frame of the first, and way and turn up to it."""

    features: Features
    scan: LaserScan
    pose: Pose
    covariance: Array
    way: float
    turn: float


def _seen_from(sight: _Sight, last: _Sight) -> tuple[Pose, Array]:
    """Pose of a scan in the frame of the last one, and its covariance."""
    pose = relative(last.pose, sight.pose)
    c, s = np.cos(last.pose[2]), np.sin(last.pose[2])
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
    return pose, turn @ (last.covariance - sight.covariance) @ turn.T + 1e-12 * np.eye(3)


def query_of_scan(features: Features, scan: LaserScan | None = None) -> Query:
    """Return walls and beams of one scan."""
    scan = features.scan if scan is None else scan
    segments = features.segments
    walls = np.zeros(len(segments), WALL)
    for name in ("start", "end", "centroid", "angle", "covariance"):
        walls[name] = segments[name]
    walls["covariance"][:, 0, 0] += segments["misfit"] ** 2
    walls["covariance"][:, 1, 1] += 4 * (segments["misfit"] / segments["length"]) ** 2
    walls["side"] = walls["views"] = 1
    beams = np.zeros((0, BEAM_COLUMNS))
    if scan is not None:
        beams = beams_of(features, scan, (0.0, 0.0, 0.0), np.zeros((3, 3)))
    return query_of(walls[segments["length"] >= SHORTEST], None, beams)


def query_of(walls: NDArray[np.void], covariance: Array | None, beams: Array) -> Query:
    """Make a query of walls and the beams that say most."""
    if covariance is None:
        covariance = np.zeros((2 * len(walls), 2 * len(walls)))
        for k, wall in enumerate(walls):
            covariance[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = wall["covariance"]
    ends = beams[:, :2] + beams[:, 4:5] * beams[:, 2:4]
    squares = np.floor(ends / _SQUARE).astype(np.int64)
    _, first = np.unique(squares, axis=0, return_index=True)
    first = np.sort(first)
    if len(first) > MOST_BEAMS:
        first = first[np.linspace(0, len(first) - 1, MOST_BEAMS).astype(np.intp)]
    return Query(walls, covariance, np.ascontiguousarray(beams[first]))


def beams_of(features: Features, scan: LaserScan, pose: Pose, covariance: Array) -> Array:
    """Return the valid beams of a scan in another frame, shape (n, BEAM_COLUMNS)."""
    valid = scan.valid
    r, bearings = scan.ranges[valid], scan.angles[valid] + pose[2]
    noise = features.noise
    sigma = 0.02 if noise is None else np.hypot(noise.sigma, noise.proportional * r)
    beams = np.empty((len(r), BEAM_COLUMNS))
    beams[:, 0], beams[:, 1] = pose[0], pose[1]
    beams[:, 2], beams[:, 3], beams[:, 4] = np.cos(bearings), np.sin(bearings), r
    beams[:, 5] = sigma**2 + covariance[0, 0] + covariance[1, 1] + r**2 * covariance[2, 2]
    beams[:, 6] = 1.0
    return beams
