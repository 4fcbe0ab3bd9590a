"""Cramér-Rao bounds: how well lines, corners, arcs and wall ends can be known at all.

A beam of bearing φ meets a surface at range ρ and incidence ψ. An error of the range moves the
measurement along the surface's normal by its cos ψ, an error of the bearing by ρ sin ψ times it, so
that the offset of the surface is measured there with the variance

    b = σ_r(ρ)² cos² ψ + ρ² σ_φ² sin² ψ,   σ_r(ρ)² = σ² + (p ρ)² + q²/12

(`RangeNoise`). The Fisher information of a feature is the sum of g gᵀ/b over its beams, where g is
what the offset changes by with the feature's parameters; the bound is its inverse. The lattice q is
taken for independent noise of variance q²/12, and what the size of the errors says of the
range (2p² to 1 per beam) is left out.

Everything is in the frame of the scanner.

Examples
--------
A wall 2 m ahead, seen over 30° by 91 beams with noise of 1 cm, is known to 1.0 mm and 0.19°:

>>> bearings = np.radians(np.linspace(-15, 15, 91))
>>> wall = line_bound(bearings, (2.0, 0.0), math.pi / 2, RangeNoise(sigma=0.01))
>>> np.sqrt(np.diag(wall.covariance)).round(4).tolist()
[0.001, 0.0033]
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .scan import Array, NoiseLike, RangeNoise

#: No scanner is better than this [m]; keeps bounds positive where ranges are noiseless. As in
#: `lineament.kernels.noise`, which cannot be imported without numba.
_LEAST_SIGMA = 1e-4
#: cos ψ of a beam is kept from 0, 0.06° short of grazing, so that no beam gets all the weight.
_LEAST_COSINE = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class LineBound:
    """How well a line can be known.

    Attributes
    ----------
    centroid : ndarray, shape (2,)
        The mean of the measurements, weighted by their information [m]: there, and only there,
        offset and angle are independent.
    angle : float
        Direction of the line [rad].
    covariance : ndarray, shape (2, 2)
        Bound of (offset at the centroid along the left normal of the direction [m], angle [rad]),
        as in `lineament.features.SEGMENT`: diag(1/W, 1/S) with W = Σ 1/b, S = Σ (t - t̄)²/b.
    """

    centroid: Array
    angle: float
    covariance: Array

    def at(self, point: ArrayLike) -> Array:
        """Bound of (offset, angle) where the line passes `point`.

        With t the distance from the centroid along the line, offset(t) = offset + t angle, so
        that var(offset at t) ≥ 1/W + t²/S. Of `point` [m] only its place along the line matters.

        Examples
        --------
        >>> bound = LineBound(np.zeros(2), 0.0, np.diag([1e-6, 4e-6]))
        >>> bound.at((2.0, 0.0)).tolist()
        [[1.7e-05, 8e-06], [8e-06, 4e-06]]
        """
        x, y = np.asarray(point, dtype=np.float64) - self.centroid
        lever = np.array([[1.0, math.cos(self.angle) * x + math.sin(self.angle) * y], [0.0, 1.0]])
        return np.asarray(lever @ self.covariance @ lever.T)


def line_bound(bearings: ArrayLike, point: ArrayLike, angle: float, noise: NoiseLike) -> LineBound:
    """Bound of a line that is met by beams.

    Parameters
    ----------
    bearings : array_like, shape (n,)
        Bearings of the beams that meet it [rad], two different ones at least.
    point, angle : array_like, shape (2,), and float
        A point of the line [m] and its direction [rad].
    noise : RangeNoise or float
        Noise of the ranges, or its sigma [m].

    Raises
    ------
    ValueError
        If there are fewer than two beams, or one does not meet the line.

    Examples
    --------
    >>> bound = line_bound([-0.1, 0.0, 0.1], (3.0, 5.0), math.pi / 2, 0.01)
    >>> np.abs(bound.centroid).round(9).tolist()
    [3.0, 0.0]
    """
    beams = _bearings(bearings, 2)
    x, y = np.asarray(point, dtype=np.float64)
    c, s = math.cos(angle), math.sin(angle)
    distance = c * y - s * x  # of the line from the scanner, along its left normal
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = distance / np.sin(beams - angle)
    _check_met(beams, ranges, f"the line through ({x:g}, {y:g}) at {angle:g} rad")
    information = 1.0 / _offset_variance(ranges, np.sin(beams - angle), noise)
    along = ranges * np.cos(beams - angle)
    total = information.sum()
    mean = information @ along / total
    spread = information @ (along - mean) ** 2
    if not spread > 0:
        raise ValueError("bearings are all the same, expected two different ones at least")
    centroid = np.array([c * mean - s * distance, s * mean + c * distance])
    return LineBound(centroid, float(angle), np.diag([1.0 / total, 1.0 / spread]))


def corner_bound(before: LineBound, after: LineBound) -> Array:
    """Bound of the corner where two lines meet.

    With n₁, n₂ the normals and s₁², s₂² the variances of the offsets at the corner, it is
    A⁻¹ diag(s₁², s₂²) A⁻ᵀ, A = [n₁ᵀ; n₂ᵀ].

    Returns the covariance of (x, y) [m²], shape (2, 2), as in `lineament.features.CORNER`. Raises
    ValueError if the lines are parallel.

    Examples
    --------
    >>> one = LineBound(np.array([1.0, 0.0]), 0.0, np.diag([1e-6, 1e-6]))
    >>> other = LineBound(np.array([0.0, 2.0]), math.pi / 2, np.diag([1e-6, 1e-6]))
    >>> (corner_bound(one, other) + 0.0).round(12).tolist()
    [[5e-06, 0.0], [0.0, 2e-06]]
    """
    lines = (before, after)
    normals = np.array([[-math.sin(line.angle), math.cos(line.angle)] for line in lines])
    if abs(np.linalg.det(normals)) < 1e-9:
        raise ValueError(f"lines at {before.angle} and {after.angle} rad are parallel: no corner")
    inverse = np.linalg.inv(normals)
    corner = inverse @ [n @ line.centroid for n, line in zip(normals, lines, strict=True)]
    offsets = np.diag([line.at(corner)[0, 0] for line in lines])
    covariance = inverse @ offsets @ inverse.T
    return np.asarray((covariance + covariance.T) / 2)


def arc_bound(bearings: ArrayLike, center: ArrayLike, radius: float, noise: NoiseLike) -> Array:
    """Bound of a circle that is met by beams: on its near side, or from within on its far side.

    With m the unit vector from the centre to the measurement, its offset changes by (m_x, m_y, 1)
    with the parameters.

    Parameters
    ----------
    bearings : array_like, shape (n,)
        Bearings of the beams that meet it [rad], three different ones at least.
    center, radius : array_like, shape (2,), and float
        [m].
    noise : RangeNoise or float
        Noise of the ranges, or its sigma [m].

    Returns
    -------
    ndarray, shape (3, 3)
        Covariance of (x, y, radius) [m²], as in `lineament.features.ARC`.

    Raises
    ------
    ValueError
        If there are fewer than three different beams, or one does not meet the circle.

    Examples
    --------
    >>> bound = arc_bound(np.linspace(-0.05, 0.05, 21), (2.0, 0.0), 0.15, RangeNoise(sigma=0.01))
    >>> np.sqrt(np.diag(bound)).round(3).tolist()
    [0.026, 0.005, 0.024]
    """
    beams = _bearings(bearings, 3)
    if len(np.unique(beams)) < 3:
        raise ValueError("bearings hold fewer than three different ones")
    if not 0 < radius < math.inf:
        raise ValueError(f"radius is {radius!r}, expected a finite length > 0")
    x, y = np.asarray(center, dtype=np.float64)
    cosines, sines = np.cos(beams), np.sin(beams)
    along, across = cosines * x + sines * y, cosines * y - sines * x
    # A beam that touches the circle may pass it by, within rounding.
    square = radius**2 * (1 + 1e-12) - across**2
    half_chord = np.sqrt(np.where(square >= 0, square, np.nan))
    ranges = along + np.where(math.hypot(x, y) < radius, half_chord, -half_chord)
    _check_met(beams, ranges, f"the circle of radius {radius:g} around ({x:g}, {y:g})")
    normals = np.column_stack((ranges * cosines - x, ranges * sines - y)) / radius
    gradient = np.column_stack((normals, np.ones(len(beams))))
    variance = _offset_variance(ranges, half_chord / radius, noise)
    information = gradient.T @ (gradient / variance[:, np.newaxis])
    covariance = np.linalg.inv(information)
    return (covariance + covariance.T) / 2


def wall_end_bound(end: ArrayLike, angle: float, increment: float) -> float:
    """Variance of a wall's end that lies anywhere between the last beam and the next.

    Uniform over one spacing of the beams, (ρ Δφ / cos ψ)²/12: no Cramér-Rao bound, as the end has
    none, but what is left to chance where only the beams that meet the wall are known.

    Takes the end (2,) [m], the direction of the wall and the step Δφ between beams [rad]; returns
    the variance along the wall [m²]. Raises ValueError if the wall points at the scanner.

    Examples
    --------
    >>> round(12 * wall_end_bound((3.0, 0.0), math.pi / 2, 0.01), 6)
    0.0009
    """
    x, y = map(float, np.asarray(end, dtype=np.float64))
    square = x * x + y * y
    distance = abs(math.cos(angle) * y - math.sin(angle) * x)
    if not distance > 0:
        raise ValueError(f"a wall through ({x:g}, {y:g}) at {angle:g} rad points at the scanner")
    return (square / distance * increment) ** 2 / 12  # cos ψ = distance/ρ


def _offset_variance(ranges: Array, cosine: Array, noise: NoiseLike) -> Array:
    """B = σ_r(ρ)² cos² ψ + ρ² σ_φ² sin² ψ [m²]."""
    square = np.maximum(cosine**2, _LEAST_COSINE**2)
    noise = RangeNoise.of(noise)
    along_beam = np.maximum(noise.range_variance(ranges), _LEAST_SIGMA**2)
    across_beam = (ranges * noise.bearing) ** 2
    return np.asarray(along_beam * square + across_beam * (1 - square))


def _bearings(bearings: ArrayLike, least: int) -> Array:
    beams = np.asarray(bearings, dtype=np.float64)
    if beams.ndim != 1 or len(beams) < least:
        raise ValueError(f"bearings have shape {beams.shape}, expected {least} of them at least")
    return beams


def _check_met(bearings: Array, ranges: Array, what: str) -> None:
    """Raise ValueError for the first beam that does not meet the surface."""
    missed = np.flatnonzero(~((ranges > 0) & np.isfinite(ranges)))
    if len(missed):
        i = int(missed[0])
        raise ValueError(f"bearings[{i}] is {bearings[i]:g} rad, which does not meet {what}")
