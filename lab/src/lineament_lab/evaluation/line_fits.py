"""Fits of a line to points of a scan or its walls, each with the covariance that it claims.

Total least squares minimises Σ w r², r = a x + b y + c, and what differs is the weight w of a point
and how (a, b, c) is normalised, by which r becomes a distance or does not.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from lineament.features import Features
from lineament.methods.stages import fit_line
from lineament.scan import Array, LaserScan, RangeNoise

from .beams import MIN_BEAMS, beams_of

#: A measurement is of the wall within so many deviations: others are mixed pixels and outliers,
#: which no fit here is made for.
SIGMAS = 5.0
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


def fit_walls(scan: LaserScan, truth: Features, fit: Fit) -> Features:
    """Return the true walls as a fit has them, and their corners where they meet.

    Walls of fewer than six measurements within `SIGMAS` are left out.
    """
    noise = RangeNoise() if truth.noise is None else truth.noise
    masks = beams_of(truth.segments, len(scan)) & scan.valid
    lines: dict[int, LineFit] = {}
    segments = truth.segments.copy()
    for k, wall in enumerate(truth.segments):
        beams = np.flatnonzero(masks[k])
        beams = np.roll(beams, -int(np.searchsorted(beams, wall["first_beam"])))
        on = scan.points[beams[1:-1]]
        spread = np.sqrt(noise.range_variance(np.hypot(*on.T)))
        off = (on - wall["centroid"]) @ _normal(wall["angle"])
        on = on[np.abs(off) <= SIGMAS * spread]
        if len(on) >= MIN_BEAMS:
            lines[k] = line = fit(on, noise)
            segments[k]["centroid"], segments[k]["angle"] = line.point, line.angle
            segments[k]["covariance"] = line.covariance
    kept, corners = list(lines), []
    for corner in truth.corners:
        before, after = corner["segments"].tolist()
        if before in lines and after in lines:
            one = corner.copy()
            one["position"], one["covariance"] = meeting(lines[before], lines[after])
            one["segments"] = kept.index(before), kept.index(after)
            corners.append(one)
    found = np.array(corners, truth.corners.dtype)
    return replace(truth, segments=segments[kept], corners=found)


def meeting(before: LineFit, after: LineFit) -> tuple[Array, Array]:
    """Return where two lines meet, and the covariance that theirs give it: A⁻¹ diag(s²) A⁻ᵀ.

    Examples
    --------
    >>> sure = np.diag([1e-4, 0.0])
    >>> lines = LineFit(np.array([0, 1]), 0.0, sure), LineFit(np.array([2, 0]), 1.6, sure)
    >>> meeting(*lines)[0].round(2).tolist()
    [1.97, 1.0]
    """
    normals: Any = np.array([_normal(line.angle) for line in (before, after)])
    offsets = [normal @ line.point for normal, line in zip(normals, (before, after), strict=True)]
    place = np.linalg.solve(normals, offsets)
    variances = []
    for line in (before, after):
        lever = np.array([1.0, (place - line.point) @ (np.cos(line.angle), np.sin(line.angle))])
        variances.append(lever @ line.covariance @ lever)
    inverse = np.linalg.inv(normals)
    return place, inverse @ np.diag(variances) @ inverse.T
