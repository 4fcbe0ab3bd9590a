"""Corners: how many are found, how far off they are, and whether their covariances tell it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..scan import Array
from .beams import MIN_BEAMS
from .consistency import NormalisedErrors, largest_variance, tolerance
from .counts import Counts, Summable, quantile, rms
from .matching import match

__all__ = ["CornerScores", "corner_scores", "demanded_corners", "vertices"]

#: A found corner is right within one of these distances of a true one [m].
GATES = (0.05, 0.10, 0.25)
#: The errors are of the pairs within this distance [m].
_ERROR_GATE = 0.10


@dataclass(frozen=True, slots=True, eq=False)
class CornerScores(Summable):
    """Scores of the corners of some scans.

    Attributes
    ----------
    counts : dict of float to Counts
        Found, true and paired corners for each distance of `GATES` [m].
    errors : ndarray, shape (m, 2)
        Found less true position of the pairs within 0.10 m [m].
    over_bound, consistency : NormalisedErrors
        The same errors by the bound of the true corner, and by the found covariance.
    """

    counts: dict[float, Counts] = field(default_factory=lambda: {gate: Counts() for gate in GATES})
    errors: Array = field(default_factory=lambda: np.empty((0, 2)))
    over_bound: NormalisedErrors = field(default_factory=lambda: NormalisedErrors.none(2))
    consistency: NormalisedErrors = field(default_factory=lambda: NormalisedErrors.none(2))

    @property
    def distances(self) -> Array:
        """How far each found corner is from its true one [m], shape (m,)."""
        return np.hypot(self.errors[:, 0], self.errors[:, 1])

    @property
    def rmse(self) -> float:
        """Root of the mean squared distance [m]."""
        return rms(self.distances)

    def summary(self) -> dict[str, float]:
        """List all figures by name."""
        figures = {}
        for gate, counts in self.counts.items():
            figures.update(counts.summary(f"_{gate:.2f}"))
        figures |= {"rmse": self.rmse, "median_error": quantile(self.distances, 0.5)}
        return figures | self.over_bound.bound_summary() | self.consistency.nees_summary()


def corner_scores(found: Features, truth: Features) -> CornerScores:
    """Compare the corners of one scan with the true ones.

    They are matched by distance, within each gate or three deviations of the bound, if that is
    more: no estimate can be asked to be nearer. A true corner is demanded if both its segments
    have at least `MIN_BEAMS` beams; demanded ones are matched first, and a found corner that is
    then matched with one of the others is left out of the count. All others that are found, on a
    round column or anywhere else, are mistakes. Edges at jumps are no vertices, and are not
    compared.

    Parameters
    ----------
    found, truth : Features
        Features of one scan, in one frame.

    Returns
    -------
    CornerScores

    Examples
    --------
    >>> import lineament as ln
    >>> bearings = np.linspace(-0.5, 0.5, 101)
    >>> wedge = ln.LaserScan(2.0 / (np.cos(bearings) + abs(np.sin(bearings))), angles=bearings)
    >>> features = ln.extract(wedge, method="liu:scale_free")
    >>> corner_scores(features, features).counts[0.10]
    Counts(correct=1, found=1, true=1)
    """
    corners = vertices(found)
    difference = corners["position"][:, np.newaxis] - truth.corners["position"]
    distance = np.hypot(difference[..., 0], difference[..., 1])
    spread = tolerance(largest_variance(truth.corners["covariance"]))
    demanded = demanded_corners(truth)
    counts = {}
    for gate in GATES:
        near = distance <= np.maximum(gate, spread)
        rows, columns = match(distance, near & demanded)
        unmatched = np.ones(len(distance), dtype=np.bool_)
        unmatched[rows] = False
        excused = np.zeros_like(unmatched)
        excused[match(distance, near & ~demanded & unmatched[:, np.newaxis])[0]] = True
        counts[gate] = Counts.of(rows, excused, demanded)
        if gate == _ERROR_GATE:
            pairs = rows, columns
    errors = difference[pairs]
    return CornerScores(
        counts,
        errors,
        NormalisedErrors.of(errors, truth.corners["covariance"][pairs[1]]),
        NormalisedErrors.of(errors, corners["covariance"][pairs[0]]),
    )


def vertices(features: Features) -> NDArray[np.void]:
    """Corners without the edges at jumps, which are ends of segments and no vertices."""
    return np.asarray(features.corners[features.corners["kind"] != "edge"])


def demanded_corners(truth: Features) -> NDArray[np.bool_]:
    """Whether both sides of each true corner are large enough; one that is not listed is not."""
    large = np.append(truth.segments["n_points"] >= MIN_BEAMS, False)
    return np.asarray(large[truth.corners["segments"]].all(axis=1))
