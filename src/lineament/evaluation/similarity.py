"""Similarity error: how far each point is from the line that was fitted to it (Figure 12)."""

import math
from dataclasses import dataclass, field

import numpy as np

from ..features import Features
from ..scan import Array, LaserScan
from .beams import beams_of, check_beams
from .counts import Summable, finite_figures, quantile, ratio


@dataclass(frozen=True, slots=True, eq=False)
class SimilarityScores(Summable):
    """Similarity errors of some scans.

    Attributes
    ----------
    errors : ndarray, shape (m,)
        Distance of each point that belongs to a segment or an arc to it [m].
    valid : int
        Valid beams: a method that explains few of them has small errors.
    """

    errors: Array = field(default_factory=lambda: np.empty(0))
    valid: int = 0

    @property
    def mean(self) -> float:
        """Mean error [m]."""
        return ratio(float(self.errors.sum()), len(self.errors))

    @property
    def variance(self) -> float:
        """Variance of the errors [m²]."""
        return float(self.errors.var()) if len(self.errors) else math.nan

    @property
    def maximum(self) -> float:
        """Largest error [m]."""
        return quantile(self.errors, 1.0)

    @property
    def explained(self) -> float:
        """Share of the valid beams that belong to a segment or an arc."""
        return ratio(len(self.errors), self.valid)

    def summary(self) -> dict[str, float]:
        """List all figures by name; those that nothing defines are left out."""
        names = ("mean", "variance", "maximum", "explained")
        return finite_figures({f"similarity_{name}": getattr(self, name) for name in names})


def similarity_errors(scan: LaserScan, features: Features) -> Array:
    """Distance of each beam's point from its fitted line or circle [m], shape (n,).

    That is the segment or arc whose beams, `first_beam` to `last_beam`, contain the beam, the
    nearest of several; NaN if there is none or the beam is not valid. The features are in the
    frame of the scan; ValueError if they are of another number of beams.

    Examples
    --------
    >>> import lineament as ln
    >>> scan = ln.LaserScan([2.0] * 4 + [9.0], angle_min=-0.1, angle_increment=0.1)
    >>> similarity_errors(scan, ln.extract(scan)).round(4).tolist()
    [0.0099, 0.0101, 0.0101, 0.0099, nan]
    """
    check_beams(scan, features)
    n, lines, arcs = len(scan), features.segments, features.arcs
    points = np.where(scan.valid[:, np.newaxis], scan.points, 0.0)
    normals = np.stack((-np.sin(lines["angle"]), np.cos(lines["angle"])))
    to_lines = points @ normals - (lines["centroid"] * normals.T).sum(axis=1)
    from_center = points[:, np.newaxis] - arcs["center"]
    to_arcs = np.hypot(from_center[..., 0], from_center[..., 1]) - arcs["radius"]
    distance = abs(np.hstack((to_lines, to_arcs))).T
    own = np.vstack((beams_of(lines, n), beams_of(arcs, n))) & scan.valid
    nearest = np.min(distance, axis=0, initial=np.inf, where=own)
    return np.where(np.isfinite(nearest), nearest, np.nan)


def similarity_scores(scan: LaserScan, features: Features) -> SimilarityScores:
    """Collect the `similarity_errors` of one scan."""
    errors = similarity_errors(scan, features)
    return SimilarityScores(errors[~np.isnan(errors)], int(scan.valid.sum()))
