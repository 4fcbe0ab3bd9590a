"""Whether features are found again from another place, in logs with known poses."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..scan import Array, LaserScan, Pose
from ..scan.poses import relative
from .corners import vertices
from .counts import Summable, ratio, rms
from .matching import match
from .segments import ANGLE

__all__ = ["Repeatability", "Repeats", "repeatability"]

#: Places on a segment at which it is looked for, and the share of them that must be in view, and
#: found again.
_PLACES, _SHARE = 16, 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Repeats(Summable):
    """Features of one view that are found again in another.

    Attributes
    ----------
    expected : int
        Features of the one view that are in sight of the other.
    distances : ndarray, shape (m,)
        Of those that were found again: distance between both [m].

    Examples
    --------
    >>> repeats = Repeats(4, np.array([0.03, 0.04, 0.0]))
    >>> repeats.repeated, repeats.rate, round(repeats.rmse, 4)
    (3, 0.75, 0.0289)
    """

    expected: int = 0
    distances: Array = field(default_factory=lambda: np.empty(0))

    @property
    def repeated(self) -> int:
        """How many were found again."""
        return len(self.distances)

    @property
    def rate(self) -> float:
        """Share of the expected that were found again; NaN where none was expected."""
        return ratio(self.repeated, self.expected)

    @property
    def rmse(self) -> float:
        """Root of the mean squared distance [m]; of the errors of both views and of the poses."""
        return rms(self.distances)


@dataclass(frozen=True, slots=True, eq=False)
class Repeatability(Summable):
    """Corners and segments of some views that are found again in others."""

    corners: Repeats = field(default_factory=Repeats)
    segments: Repeats = field(default_factory=Repeats)


def repeatability(
    scan: LaserScan,
    features: Features,
    other_scan: LaserScan,
    other_features: Features,
    *,
    gate: float = 0.10,
) -> Repeatability:
    """Look for the features of another scan in this one.

    They are moved into this scan's frame by the two poses. One is expected here if it lies in
    the field of view and within the limits of range, and a beam that passes by it (the nearest,
    or a neighbour) goes at least that far, less the gate: then nothing occludes it. A corner is
    found again within the gate. A segment is expected if it shows this scanner its front, and at
    least half of 16 places along it are in sight; it is found again as one whose direction
    differs by at most 10° and which is within the gate of at least half of those in sight. Both
    are matched one to one. Edges at jumps are left out.

    Swap the scans for the other direction. A corner of which only one side is in sight from here
    is expected all the same.

    Parameters
    ----------
    scan, features
        Where features are looked for, with its pose.
    other_scan, other_features
        Whose features are looked for, with its pose.
    gate : float
        Largest distance of what is found again [m]; the errors of the poses count.

    Returns
    -------
    Repeatability

    Raises
    ------
    ValueError
        If a scan has no pose, or the gate is not more than 0.

    Examples
    --------
    >>> import lineament as ln
    >>> from lineament.simulation import SENSORS, room
    >>> rng, extract = np.random.default_rng(1), ln.Extractor("liu:scale_free")
    >>> here = SENSORS["paper"].scan(room(), (0, 0, 0), rng)
    >>> there = SENSORS["paper"].scan(room(), (0.3, 0.2, 0.1), rng)
    >>> found = repeatability(here, extract(here), there, extract(there))
    >>> found.corners.rate, found.segments.rate
    (1.0, 1.0)
    """
    if not gate > 0:
        raise ValueError(f"gate is {gate}, expected a distance > 0")
    moved = other_features.transform(*relative(*checked_poses(scan, other_scan)))
    return Repeatability(
        _corners_again(scan, vertices(features)["position"], vertices(moved)["position"], gate),
        _segments_again(scan, features.segments, moved.segments, gate),
    )


def checked_poses(scan: LaserScan, other_scan: LaserScan) -> tuple[Pose, Pose]:
    """Return the poses of two scans; a ValueError if one has none."""
    if scan.pose is None or other_scan.pose is None:
        which = "scan" if scan.pose is None else "other_scan"
        raise ValueError(f"{which} has no pose, expected (x, y, theta)")
    return scan.pose, other_scan.pose


def _corners_again(scan: LaserScan, positions: Array, others: Array, gate: float) -> Repeats:
    expected = others[in_sight(scan, others, gate)]
    difference = positions[:, np.newaxis] - expected
    distance = np.hypot(difference[..., 0], difference[..., 1])
    return Repeats(len(expected), distance[match(distance, distance <= gate)])


def _segments_again(
    scan: LaserScan, segments: NDArray[np.void], others: NDArray[np.void], gate: float
) -> Repeats:
    along = (np.arange(_PLACES) + 0.5)[:, np.newaxis] / _PLACES
    start, end = others["start"][:, np.newaxis], others["end"][:, np.newaxis]
    places = start + along * (end - start)
    seen = in_sight(scan, places.reshape(-1, 2), gate).reshape(-1, _PLACES)
    # Beams run counter-clockwise: a surface that is seen has the scanner on its left.
    normal = np.column_stack((-np.sin(others["angle"]), np.cos(others["angle"])))
    in_front = (others["centroid"] * normal).sum(axis=1) < 0
    expected = in_front & (seen.mean(axis=1) >= _SHARE)
    places, seen = places[expected], seen[expected]
    # By segment here, expected segment, and place on it.
    distance = _distances(segments[:, np.newaxis, np.newaxis], places)
    n_seen = seen.sum(axis=1)
    again = ((distance <= gate) & seen).sum(axis=2) >= _SHARE * n_seen
    turn = segments["angle"][:, np.newaxis] - others["angle"][expected]
    again &= np.cos(turn) >= math.cos(ANGLE)
    mean = np.minimum(distance, gate).sum(axis=2, where=seen) / n_seen
    return Repeats(int(expected.sum()), mean[match(mean, again)])


def _distances(segments: NDArray[np.void], points: Array) -> Array:
    """Distance of each point from its segment, between its ends [m]; shapes are broadcast."""
    start, arm = segments["start"], segments["end"] - segments["start"]
    length_squared = np.maximum((arm**2).sum(axis=-1), np.finfo(float).tiny)
    along = ((points - start) * arm).sum(axis=-1) / length_squared
    away = points - start - np.clip(along, 0.0, 1.0)[..., np.newaxis] * arm
    return np.asarray(np.hypot(away[..., 0], away[..., 1]))


def in_sight(scan: LaserScan, points: Array, margin: float) -> NDArray[np.bool_]:
    """Whether a scan can have seen each point: in view, in range, and with nothing before it.

    Parameters
    ----------
    scan : LaserScan
    points : ndarray, shape (m, 2)
        Points in the frame of the scan [m].
    margin : float
        How much shorter the beam may be than the way to the point [m].

    Examples
    --------
    Behind the wall, on it, before it, and out of the field of view:

    >>> wall = LaserScan([2.0] * 3, angle_min=-0.1, angle_increment=0.1)
    >>> in_sight(wall, np.array([[3.0, 0.0], [2.05, 0.0], [1.0, 0.0], [0.0, 1.0]]), 0.1).tolist()
    [False, True, True, False]
    """
    n = len(scan)
    if n == 0:
        return np.zeros(len(points), dtype=np.bool_)
    distance = np.hypot(points[:, 0], points[:, 1])
    half_step = 0.5 * scan.angle_increment
    first = scan.angles[0] - half_step
    bearing = first + (np.arctan2(points[:, 1], points[:, 0]) - first) % (2 * math.pi)
    in_view = bearing <= scan.angles[-1] + half_step
    nearest = np.searchsorted(0.5 * (scan.angles[1:] + scan.angles[:-1]), bearing)
    beams = nearest[:, np.newaxis] + np.arange(-1, 2)
    beams = beams % n if scan.is_full_circle else np.clip(beams, 0, n - 1)
    reach = np.where(scan.valid, scan.ranges, -np.inf)[beams].max(axis=1)
    in_range = (distance >= scan.range_min) & (distance < scan.range_max)
    return np.asarray(in_view & in_range & (reach >= distance - margin))
