"""Similarity error (Figure 12): how far points are from the line that explains them, and how many.

One number misleads: many short pieces have small errors, and what has no line has none.
"""

from dataclasses import dataclass, field

import numpy as np

from lineament.features import Features
from lineament.scan import Array, LaserScan

from .beams import beams_of, check_beams
from .counts import Summable, finite_figures, quantile, ratio, rms


@dataclass(frozen=True, slots=True, eq=False)
class SimilarityScores(Summable):
    """Similarity errors of some scans: how many measurements are explained, and how well."""

    #: Distance of each explained measurement from its segment or arc [m].
    errors: Array = field(default_factory=lambda: np.empty(0))
    #: All valid measurements.
    valid: int = 0

    @property
    def mean(self) -> float:
        """Mean error [m]."""
        return ratio(float(self.errors.sum()), len(self.errors))

    @property
    def maximum(self) -> float:
        """Largest error [m]."""
        return quantile(self.errors, 1.0)

    @property
    def explained(self) -> float:
        """Share of the valid measurements that a segment or an arc explains."""
        return ratio(len(self.errors), self.valid)

    def summary(self) -> dict[str, float]:
        """List all figures by name; those that nothing defines are left out."""
        figures = {
            "explained": self.explained,
            "mean": self.mean,
            "rms": rms(self.errors),
            "p95": quantile(self.errors, 0.95),
            "maximum": self.maximum,
        }
        return finite_figures({f"similarity_{name}": value for name, value in figures.items()})


def similarity_errors(scan: LaserScan, features: Features) -> Array:
    """Distance of each measurement from the line or circle that explains it [m], shape (n,).

    A segment or an arc says how many measurements it has, `n_points`: it explains so many of those
    of its beams, the nearest. What a method itself leaves out between two ends, as noise, is not
    held against it, nor to its credit. Of several that explain a measurement the nearest counts;
    NaN where none does. The features are in the frame of the scan; ValueError if they are of
    another number of beams.

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
    own = np.vstack((beams_of(lines, n), beams_of(arcs, n))) & scan.valid
    distance = np.where(own, abs(np.hstack((to_lines, to_arcs))).T, np.inf)
    rank = np.argsort(np.argsort(distance, axis=1, kind="stable"), axis=1)
    explained = rank < np.concatenate((lines["n_points"], arcs["n_points"]))[:, np.newaxis]
    nearest = np.min(distance, axis=0, initial=np.inf, where=explained)
    return np.where(np.isfinite(nearest), nearest, np.nan)


def similarity_scores(scan: LaserScan, features: Features) -> SimilarityScores:
    """Collect the `similarity_errors` of one scan."""
    errors = similarity_errors(scan, features)
    return SimilarityScores(errors[~np.isnan(errors)], int(scan.valid.sum()))
