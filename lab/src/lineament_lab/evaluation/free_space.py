"""Free space: how much of what is drawn lies where the scanner looked through."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lineament.features import Features
from lineament.scan import Array, LaserScan

from .beams import beams_of, check_beams, nearest_beams, with_neighbours
from .counts import Summable, finite_figures, quantile, ratio
from .matching import distances_from_segments

#: Distance between samples of a segment [m].
SPACING = 0.02
#: A sample is phantom if all beams about it end at least this far from it, on one side [m].
CLEARANCE = 0.2
#: A measurement is covered within this distance [m], and this share of its range, of a feature.
NEAR, NEAR_SHARE = 0.05, 0.01
#: A scan is counted whose longest phantom stretch is above this [m].
STRETCH = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class FreeSpaceScores(Summable):
    """Phantom walls of some scans, and how many of their measurements are covered."""

    #: Length of all segments, and of their phantom samples [m].
    drawn: float = 0.0
    phantom: float = 0.0
    #: Longest phantom stretch of each scan [m].
    longest: Array = field(default_factory=lambda: np.empty(0))
    #: Valid measurements near a segment or an arc, and all valid ones.
    covered: int = 0
    valid: int = 0

    def summary(self) -> dict[str, float]:
        """List all figures by name; those that nothing defines are left out."""
        return finite_figures(
            {
                "phantom_in_100m": 100.0 * ratio(self.phantom, self.drawn),
                "longest_phantom": quantile(self.longest, 1.0),
                "phantom_scans": ratio(int((self.longest > STRETCH).sum()), len(self.longest)),
                "covered": ratio(self.covered, self.valid),
            }
        )


def free_space_scores(scan: LaserScan, features: Features) -> FreeSpaceScores:
    """Compare what is drawn with where the beams went. No truth is needed.

    Each segment is sampled every 2 cm. A sample is phantom if the three beams about it, the
    nearest and its two neighbours, all went on by more than 0.2 m, or all ended more than 0.2 m
    before. A beam without a valid range proves nothing, so that a sample beside one is not
    phantom. A measurement is covered within 5 cm and 1 % of its range of a segment, or of an arc
    beside one of its beams. The features are in the frame of the scan; ValueError if they are of
    another number of beams.

    Examples
    --------
    A wall at 2 m, and the same drawn half a metre behind it:

    >>> import lineament as ln
    >>> bearings = np.linspace(-0.5, 0.5, 101)
    >>> scan = ln.LaserScan(2.0 / np.cos(bearings), angles=bearings)
    >>> wall = ln.extract(scan)
    >>> free_space_scores(scan, wall).summary()
    {'phantom_in_100m': 0.0, 'longest_phantom': 0.0, 'phantom_scans': 0.0, 'covered': 1.0}
    >>> free_space_scores(scan, wall.transform(0.5, 0.0, 0.0)).summary()["phantom_in_100m"]
    100.0
    """
    check_beams(scan, features)
    drawn, phantom, longest = 0.0, 0.0, 0.0
    # Beside an invalid beam the least and greatest of three are NaN.
    ranges = np.where(scan.valid, scan.ranges, np.nan)[with_neighbours(scan)]
    lowest, highest = ranges.min(axis=1), ranges.max(axis=1)
    for segment in features.segments:
        arm = segment["end"] - segment["start"]
        length = math.hypot(*arm)
        # A length of whole spacings is no more than that for the rounding of its ends.
        count = max(1, math.ceil(length / SPACING - 1e-9))
        spacing = length / count
        points = segment["start"] + (np.arange(count) + 0.5)[:, np.newaxis] / count * arm
        distance = np.hypot(*points.T)
        beam, in_view = nearest_beams(scan, points)
        went_on = lowest[beam] > distance + CLEARANCE
        ended_before = highest[beam] < distance - CLEARANCE
        is_phantom = (went_on | ended_before) & in_view
        drawn += spacing * count
        phantom += spacing * int(is_phantom.sum())
        edges = np.flatnonzero(np.diff(np.concatenate(([0], is_phantom.view(np.int8), [0]))))
        longest = max(longest, spacing * int((edges[1::2] - edges[::2]).max(initial=0)))
    covered, valid = int(_covered(scan, features).sum()), int(scan.valid.sum())
    return FreeSpaceScores(drawn, phantom, np.array([longest]), covered, valid)


def _covered(scan: LaserScan, features: Features) -> NDArray[np.bool_]:
    """Whether each valid measurement is near a segment, or near an arc beside one of its beams."""
    points = scan.points[scan.valid]
    near = NEAR + NEAR_SHARE * scan.ranges[scan.valid]
    off_lines = distances_from_segments(points, features.segments[:, np.newaxis])
    from_center = np.linalg.norm(points - features.arcs["center"][:, np.newaxis], axis=-1)
    off_arcs = abs(from_center - features.arcs["radius"][:, np.newaxis])
    masks = beams_of(features.arcs, len(scan))
    beside = np.asarray(masks[:, with_neighbours(scan)].any(axis=2))[:, scan.valid]
    return np.asarray((off_lines <= near).any(axis=0) | (beside & (off_arcs <= near)).any(axis=0))
