"""Fits of a line to points of a scan, each with the covariance that it claims.

Total least squares minimises Σ w r², r = a x + b y + c, and what differs is the weight w of a point
and how (a, b, c) is normalised, by which r becomes a distance or does not.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from lineament.methods.stages import fit_line
from lineament.scan import Array, RangeNoise

#: Times that weights are taken from the line that they gave.
_ROUNDS = 3


class LineFit(NamedTuple):
    """A line by a point and its direction [rad], with the covariance of its errors.

    The errors are the offset at the point to the left of the line [m] and the angle [rad].
    """

    point: Array
    angle: float
    covariance: Array


#: Fits a line to points (m, 2) [m] in beam order, seen from the origin.
Fit = Callable[[Array, RangeNoise], LineFit]


def unweighted_fit(points: Array, _: RangeNoise) -> LineFit:
    """Fit by unweighted total least squares (UTLS): noise from the residuals, alike in x and y.

    Examples
    --------
    >>> points = np.array([[2.0, -1.0], [2.02, 0.0], [2.0, 1.0]])
    >>> line = unweighted_fit(points, RangeNoise(sigma=0.01))
    >>> line.point.round(4).tolist(), round(line.angle, 4)
    ([2.0067, 0.0], 1.5708)
    """
    line = _geometric(points, np.ones(len(points)))
    off = (points - line.point) @ _normal(line.angle)
    variance = float(off @ off) / max(len(points) - 2, 1)
    return line._replace(covariance=line.covariance * variance)


def algebraic_fit(points: Array, noise: RangeNoise) -> LineFit:
    """Fit by weighted total least squares (WTLS) with a² + b² + c² = 1, by 1/σ² of the range.

    c has other units than a and b: the line depends on the unit and on where the origin is. The
    covariance of (a, b, c) is (a² + b²) M⁺, M = Σ w z zᵀ with z = (x, y, 1), to first order.
    """
    z = np.column_stack((points, np.ones(len(points))))
    weights = 1.0 / noise.range_variance(np.hypot(*points.T))
    values, vectors = np.linalg.eigh(z.T @ (weights[:, np.newaxis] * z))
    a, b, c = vectors[:, 0]
    length = math.hypot(a, b)
    inverse = (vectors[:, 1:] / values[1:]) @ vectors[:, 1:].T * length**2
    centre = weights @ points / weights.sum()
    normal = np.array([a, b]) / length
    point = centre - (normal @ centre + c / length) * normal
    angle = _direction(points, math.atan2(-a, b))
    turned = math.copysign(1.0, _normal(angle) @ normal)
    jacobian = np.array(
        [
            [-turned * point[0] / length, -turned * point[1] / length, -turned / length],
            [-b / length**2, a / length**2, 0.0],
        ]
    )
    return LineFit(point, angle, jacobian @ inverse @ jacobian.T)


def conformal_fit(points: Array, noise: RangeNoise) -> LineFit:
    """Fit by the same weights with a² + b² = 1, so that r is the distance.

    The geometric normalisation of Prieto-Fernández et al., *Enhancement of the total least squares
    method for feature extraction in 2D LiDAR mapped environments* (WCTLS), CMES 147(2), 2026, as
    its abstract has it: its weights are not in there, and here are those of the range.
    """
    return _geometric(points, 1.0 / noise.range_variance(np.hypot(*points.T)))


def conformal_fit_across(points: Array, noise: RangeNoise) -> LineFit:
    """Fit as `conformal_fit`, with the variance of each point across the line for its weight.

    A range is uncertain along its beam: of that, the line sees the part across.
    """
    rho = np.hypot(*points.T)
    weights = 1.0 / noise.range_variance(rho)
    for _ in range(_ROUNDS):
        line = _geometric(points, weights)
        cosine = points @ _normal(line.angle) / rho
        across = noise.range_variance(rho) * cosine**2
        across += (rho * noise.bearing) ** 2 * (1.0 - cosine**2)
        weights = 1.0 / np.maximum(across, 1e-12)
    return _geometric(points, weights)


def best_fit(points: Array, noise: RangeNoise) -> LineFit:
    """Fit as the methods of `lineament` do by default: ``fit="weighted"``."""
    line = fit_line(points, noise=noise, fit="weighted")
    return LineFit(line["centroid"], float(line["angle"]), line["covariance"])


#: The fits, by their names in tables.
FITS: dict[str, Fit] = {
    "UTLS": unweighted_fit,
    "WTLS": algebraic_fit,
    "WCTLS": conformal_fit,
    "WCTLS, weights across the line": conformal_fit_across,
    "lineament": best_fit,
}


def _geometric(points: Array, weights: Array) -> LineFit:
    """Return the line of the least Σ w d², d the distance, with diag(1/Σ w, 1/Σ w t²)."""
    centre = weights @ points / weights.sum()
    arms = points - centre
    moment = arms.T @ (weights[:, np.newaxis] * arms)
    along = np.linalg.eigh(moment)[1][:, 1]
    angle = _direction(points, math.atan2(along[1], along[0]))
    spread = float(along @ moment @ along)
    return LineFit(centre, angle, np.diag([1.0 / float(weights.sum()), 1.0 / spread]))


def _normal(angle: float) -> Array:
    """Return the normal of a line, to its left."""
    return np.array([-math.sin(angle), math.cos(angle)])


def _direction(points: Array, angle: float) -> float:
    """Return the direction of a line in the order of its points."""
    chord = points[-1] - points[0]
    ahead = chord[0] * math.cos(angle) + chord[1] * math.sin(angle) >= 0.0
    return math.remainder(angle if ahead else angle + math.pi, 2.0 * math.pi)
