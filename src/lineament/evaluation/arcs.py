"""Arcs: how many are found, how far off they are, and whether their covariances tell it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..features import Features
from ..scan import Array
from .beams import MIN_BEAMS, beams_of, common_beams, on_small_surfaces, overlap_ratios
from .consistency import NormalisedErrors, tolerance
from .counts import Counts, Summable, rms
from .matching import match

__all__ = ["ArcScores", "arc_scores"]

#: A found arc is right within these distances of a true one, of their centres and of their
#: radii [m], if the beams that both have are at least this share of those that either has.
CENTER, RADIUS, OVERLAP = 0.10, 0.10, 0.5


@dataclass(frozen=True, slots=True, eq=False)
class ArcScores(Summable):
    """Scores of the arcs of some scans.

    Attributes
    ----------
    counts : Counts
        Found, true and paired arcs.
    errors : ndarray, shape (m, 3)
        Centre (x, y) and radius of the pairs, found less true [m].
    over_bound, consistency : NormalisedErrors
        `errors` by the bound of the true arc, and by the found covariance.
    """

    counts: Counts = field(default_factory=Counts)
    errors: Array = field(default_factory=lambda: np.empty((0, 3)))
    over_bound: NormalisedErrors = field(default_factory=lambda: NormalisedErrors.none(3))
    consistency: NormalisedErrors = field(default_factory=lambda: NormalisedErrors.none(3))

    def summary(self) -> dict[str, float]:
        """List all figures by name."""
        return {
            **self.counts.summary(),
            "center_rmse": rms(np.hypot(self.errors[:, 0], self.errors[:, 1])),
            "radius_rmse": rms(self.errors[:, 2]),
            **self.over_bound.bound_summary(),
            **self.consistency.nees_summary(),
        }


def arc_scores(found: Features, truth: Features) -> ArcScores:
    """Compare the arcs of one scan with the true ones.

    A found arc may be a true one if centre and radius are each within 0.10 m, or three deviations
    of the bound if that is more, and the overlap of their beams (intersection over union) is at
    least 0.5. They are matched by that overlap. One that is not matched, and has at least half of
    its beams on surfaces too small to be demanded, is left out of the count.

    Parameters
    ----------
    found, truth : Features
        Features of one scan, in one frame.

    Returns
    -------
    ArcScores

    Raises
    ------
    ValueError
        If the two are of scans with different numbers of beams.

    Examples
    --------
    >>> import lineament as ln
    >>> nothing = ln.extract(ln.LaserScan([2.0] * 9, angle_min=-0.04, angle_increment=0.01))
    >>> arc_scores(nothing, nothing).counts
    Counts(correct=0, found=0, true=0)
    """
    n = common_beams(found, truth)
    arcs, true_arcs = found.arcs, truth.arcs
    spans = beams_of(arcs, n)
    overlap = overlap_ratios(spans, beams_of(true_arcs, n), n)
    demanded = true_arcs["n_points"] >= MIN_BEAMS
    difference = _parameters(found)[:, np.newaxis] - _parameters(truth)
    spread = tolerance(np.diagonal(true_arcs["covariance"], axis1=1, axis2=2))
    center = np.maximum(CENTER, np.hypot(spread[:, 0], spread[:, 1]))
    near = np.hypot(difference[..., 0], difference[..., 1]) <= center
    near &= abs(difference[..., 2]) <= np.maximum(RADIUS, spread[:, 2])
    near &= (overlap >= OVERLAP) & demanded
    rows, columns = match(1.0 - overlap, near)
    errors = difference[rows, columns]
    return ArcScores(
        Counts.of(rows, on_small_surfaces(spans, truth), demanded),
        errors,
        NormalisedErrors.of(errors, true_arcs["covariance"][columns]),
        NormalisedErrors.of(errors, arcs["covariance"][rows]),
    )


def _parameters(features: Features) -> Array:
    """Centre and radius of each arc [m], shape (A, 3)."""
    return np.column_stack((features.arcs["center"], features.arcs["radius"]))
