"""Free space: how much of what is drawn lies where the scanner looked through."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..scan import Array, LaserScan
from .beams import beams_of
from .counts import Summable, quantile, ratio

__all__ = ["FreeSpaceScores", "free_space_scores"]

#: Distance between samples of a segment [m].
SPACING = 0.02
#: A sample is phantom where all beams about it end at least this far from it, on one side [m].
CLEARANCE = 0.2
#: A measurement is covered within this distance [m], and this share of its range, of a feature.
NEAR, NEAR_SHARE = 0.05, 0.01
#: A scan is counted whose longest phantom stretch is above this [m].
STRETCH = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class FreeSpaceScores(Summable):
    """Phantom walls of some scans, and how many of their measurements are covered.

    Attributes
    ----------
    drawn, phantom : float
        Length of all segments, and of their phantom samples [m].
    longest : ndarray, shape (scans,)
        Longest phantom stretch of each scan [m].
    covered, valid : int
        Valid measurements near a segment or an arc, and all valid ones.
    """

    drawn: float = 0.0
    phantom: float = 0.0
    longest: Array = field(default_factory=lambda: np.empty(0))
    covered: int = 0
    valid: int = 0

    @property
    def phantom_share(self) -> float:
        """Metres of phantom in 100 m of segments."""
        return 100.0 * ratio(self.phantom, self.drawn)

    @property
    def covered_share(self) -> float:
        """Share of the valid measurements that are near a feature."""
        return ratio(self.covered, self.valid)

    def summary(self) -> dict[str, float]:
        """List all figures by name; those that nothing defines are left out."""
        figures = {
            "phantom_in_100m": self.phantom_share,
            "longest_phantom": quantile(self.longest, 1.0),
            "phantom_scans": ratio(int((self.longest > STRETCH).sum()), len(self.longest)),
            "covered": self.covered_share,
        }
        return {name: value for name, value in figures.items() if math.isfinite(value)}


def free_space_scores(scan: LaserScan, features: Features) -> FreeSpaceScores:
    """Compare what is drawn with where the beams went. No truth is needed.

    Each segment is sampled every 2 cm. A sample is phantom where the three beams about it, the
    nearest and its two neighbours, all went on by more than 0.2 m, or all ended more than 0.2 m
    before. A beam without a valid range proves nothing, so that a sample beside one is not
    phantom. A measurement is covered within 5 cm and 1 % of its range of a segment or an arc.

    Parameters
    ----------
    scan : LaserScan
    features : Features
        What was found in it, in its frame.

    Returns
    -------
    FreeSpaceScores

    Raises
    ------
    ValueError
        If the features are of a scan with another number of beams.

    Examples
    --------
    A wall at 2 m, and the same drawn half a metre behind it:

    >>> import lineament as ln
    >>> bearings = np.linspace(-0.5, 0.5, 101)
    >>> scan = ln.LaserScan(2.0 / np.cos(bearings), angles=bearings)
    >>> wall = ln.extract(scan)
    >>> free_space_scores(scan, wall).summary()
    {'phantom_in_100m': 0.0, 'longest_phantom': 0.0, 'phantom_scans': 0.0, 'covered': 1.0}
    >>> moved = wall.transform(0.5, 0.0, 0.0)
    >>> free_space_scores(scan, moved).summary()["phantom_in_100m"]
    100.0
    """
    n = len(scan)
    if len(features.clusters) != n:
        raise ValueError(f"features are of {len(features.clusters)} beams, expected the scan's {n}")
    drawn, phantom, longest = 0.0, 0.0, 0.0
    if n:
        lowest, highest = _range_of_three(scan)
        for segment in features.segments:
            spacing, is_phantom = _phantom_samples(scan, segment, lowest, highest)
            drawn += spacing * len(is_phantom)
            phantom += spacing * int(is_phantom.sum())
            longest = max(longest, spacing * _longest_run(is_phantom))
    covered = int(_covered(scan, features).sum())
    return FreeSpaceScores(drawn, phantom, np.array([longest]), covered, int(scan.valid.sum()))


def _range_of_three(scan: LaserScan) -> tuple[Array, Array]:
    """Least and greatest range of each beam and its neighbours; NaN beside an invalid one."""
    ranges = np.where(scan.valid, scan.ranges, np.nan)
    beams = np.arange(len(scan))[:, np.newaxis] + np.arange(-1, 2)
    beams = beams % len(scan) if scan.is_full_circle else np.clip(beams, 0, len(scan) - 1)
    return ranges[beams].min(axis=1), ranges[beams].max(axis=1)


def _phantom_samples(
    scan: LaserScan, segment: np.void, lowest: Array, highest: Array
) -> tuple[float, NDArray[np.bool_]]:
    """Spacing of the samples of a segment [m], and whether each is phantom."""
    arm = segment["end"] - segment["start"]
    length = math.hypot(*arm)
    # A length of whole spacings is no more than that for the rounding of its ends.
    count = max(1, math.ceil(length / SPACING - 1e-9))
    points = segment["start"] + (np.arange(count) + 0.5)[:, np.newaxis] / count * arm
    distance = np.hypot(*points.T)
    beam, in_view = _nearest_beams(scan, np.arctan2(points[:, 1], points[:, 0]))
    went_on = lowest[beam] > distance + CLEARANCE
    ended_before = highest[beam] < distance - CLEARANCE
    return length / count, (went_on | ended_before) & in_view


def _nearest_beams(scan: LaserScan, bearings: Array) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Beam nearest to each bearing, and whether that is within half a step of it."""
    angles, half_step = scan.angles, 0.5 * scan.angle_increment
    first = angles[0] - half_step
    turned = first + (bearings - first) % (2 * math.pi)
    nearest = np.searchsorted(0.5 * (angles[1:] + angles[:-1]), turned)
    return nearest, turned <= angles[-1] + half_step


def _longest_run(marks: NDArray[np.bool_]) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], marks.view(np.int8), [0]))))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def _covered(scan: LaserScan, features: Features) -> NDArray[np.bool_]:
    """Whether each valid measurement is near a segment, or near an arc beside one of its beams."""
    points, ranges = scan.points[scan.valid], scan.ranges[scan.valid]
    near = NEAR + NEAR_SHARE * ranges
    start = features.segments["start"][:, np.newaxis]
    arm = features.segments["end"][:, np.newaxis] - start
    square = np.maximum((arm**2).sum(axis=-1), np.finfo(float).tiny)
    along = np.clip(((points - start) * arm).sum(axis=-1) / square, 0.0, 1.0)
    away = np.linalg.norm(points - start - along[..., np.newaxis] * arm, axis=-1)
    covered = (away <= near).any(axis=0)
    own, n = np.flatnonzero(scan.valid), len(scan)
    for arc, (begin, end) in zip(features.arcs, beams_of(features.arcs, n), strict=True):
        ahead = own - begin + 1
        ahead = ahead % n if scan.is_full_circle else ahead
        in_span = (ahead >= 0) & (ahead <= end - begin + 1)
        off = abs(np.linalg.norm(points - arc["center"], axis=1) - arc["radius"])
        covered |= in_span & (off <= near)
    return np.asarray(covered)
