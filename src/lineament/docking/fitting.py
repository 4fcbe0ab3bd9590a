"""The pose of a shape by the beams of a scan: robust least squares of ranges, and of its ends.

A beam measures the range to a piece of the shape, with the noise of ranges. Where the shape ends
alone, and the next beam passes behind, the bearing of that end is known to the spacing of beams:
this is what shows where a straight piece, or a row of feet, begins. A beam has a width, too. Where
the end splits it, its range may lie between both depths: then the end is at that beam's bearing, to
half its width, for which half a spacing is taken.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scan import Array, LaserScan, Pose, RangeNoise
from .shape import Shape

#: Ranges are taken within so much of the shape, from a first guess on [m]; then within so many σ.
_GATES = 0.3, 0.15, 0.08, 0.04
SIGMAS, _FINE = 3.5, 6
#: A beam that meets a piece at a smaller sine says little of it.
_GRAZING = 0.12
#: Of a piece that ends alone so much is left out [m].
_END = 0.01
#: A step in a direction that nothing shows is no longer [m, rad].
_LONGEST = 0.2
#: A beam past an end is so much behind it [m]; an end is looked for so near to where it should be.
_BEHIND, _AROUND = 0.06, 0.08
#: A beam that is less far behind it than this share of what the next one is, is split by an end.
_SPLIT = 0.9


class Beams(NamedTuple):
    """Bearings, ranges and their variances of the beams near a shape, and their unit vectors."""

    bearings: Array
    ranges: Array
    variances: Array
    along: Array


class Fit(NamedTuple):
    """A pose, the information on it (3, 3), χ², its degrees of freedom, and counts of beams.

    Beams that reach the shape; that pass through it, as it stands; and that end before it.
    """

    pose: Pose
    information: Array
    chi2: float
    freedom: int
    reached: int
    through: int
    short: int


def beams_of(scan: LaserScan, noise: RangeNoise) -> Beams:
    """Return the beams of a scan but those without any range: inf is one that meets nothing."""
    known = scan.valid | np.isposinf(scan.ranges)
    bearings, ranges = scan.angles[known], scan.ranges[known]
    finite = np.where(np.isfinite(ranges), ranges, 1.0)
    variances = np.maximum(noise.range_variance(finite), 1e-8)
    return Beams(bearings, ranges, variances, np.column_stack((np.cos(bearings), np.sin(bearings))))


def fit(beams: Beams, shape: Shape, guess: Pose) -> Fit | None:
    """Fit a shape, from a pose near to its own; None if it does not meet enough beams."""
    pose, found = guess, None
    for gate in (*_GATES, *(0.0,) * _FINE):
        found = _step(beams, shape, pose, gate)
        if found is None:
            return None
        pose = found.pose
    return found


def _step(beams: Beams, shape: Shape, pose: Pose, gate: float) -> Fit | None:
    """Take one step of least squares."""
    pieces = shape.placed(pose)
    expected, which = _cast(beams, pieces, shape.free)
    meets = which >= 0
    off = np.where(meets, beams.ranges - np.where(meets, expected, 0.0), np.inf)
    limit = np.maximum(SIGMAS * np.sqrt(beams.variances), gate)
    reached = meets & (np.abs(off) <= limit)
    if reached.sum() < 5:
        return None
    normals = _normals(pieces)[which[reached]]
    u, t = beams.along[reached], expected[reached]
    facing = (normals * u).sum(axis=1)
    center = np.array(pose[:2])
    turned = np.column_stack((-normals[:, 1], normals[:, 0]))
    by_turn = (turned * (center - t[:, None] * u)).sum(axis=1)
    jacobian = np.column_stack((normals, by_turn)) / facing[:, None]
    residuals, weights = off[reached], 1 / beams.variances[reached]
    if gate == 0:
        of_ends = _ends(beams, shape, pose, pieces)
        jacobian = np.vstack((jacobian, of_ends[0]))
        residuals = np.concatenate((residuals, of_ends[1]))
        weights = np.concatenate((weights, of_ends[2]))
    information = (jacobian.T * weights) @ jacobian
    # Where nothing shows a direction, a step along it would be of any length.
    damped = information + np.eye(3) / _LONGEST**2
    x, y, turn = np.linalg.solve(damped, (jacobian.T * weights) @ residuals).tolist()
    moved = pose[0] + x, pose[1] + y, math.remainder(pose[2] + turn, 2 * math.pi)
    chi2, freedom = float((weights * residuals**2).sum()), max(len(residuals) - 3, 1)
    through, short = meets & (off > limit) & ~_split(beams, expected), meets & (off < -limit)
    counts = (int(which.sum()) for which in (reached, through, short))
    return Fit(moved, information, chi2, freedom, *counts)


def _split(beams: Beams, expected: Array) -> NDArray[np.bool_]:
    """Which beams end between the shape and what the next one meets, past its outline."""
    is_split = np.zeros(len(expected), np.bool_)
    for edge, beyond in ((slice(1, None), slice(-1)), (slice(-1), slice(1, None))):
        behind = np.where(np.isinf(expected[beyond]), beams.ranges[beyond], 0.0)
        nearest = expected[edge]
        with np.errstate(invalid="ignore"):
            is_less = beams.ranges[edge] - nearest < _SPLIT * (behind - nearest)
        is_split[edge] |= is_less & np.isfinite(behind)
    return is_split


def _normals(pieces: Array) -> Array:
    along = pieces[:, 1] - pieces[:, 0]
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    return np.column_stack((-along[:, 1], along[:, 0]))


def _cast(beams: Beams, pieces: Array, free: Array) -> tuple[Array, NDArray[np.intp]]:
    """Range at which each beam meets the first piece, and which; -1 for none."""
    start, along, u = pieces[:, 0], pieces[:, 1] - pieces[:, 0], beams.along
    length = np.linalg.norm(along, axis=1)
    # u t = start + along s, for each beam and piece.
    cross = u[:, None, 0] * along[:, 1] - u[:, None, 1] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / cross
        s = (start[:, 0] * u[:, None, 1] - start[:, 1] * u[:, None, 0]) / cross
    # A beam at the very end is half here and half behind.
    left = np.minimum(_END / length, 0.25)[:, None] * free
    is_met = (t > 0) & (s >= left[:, 0]) & (s <= 1 - left[:, 1])
    t = np.where(is_met & (np.abs(cross) > _GRAZING * length), t, np.inf)
    which = t.argmin(axis=1)
    first = t[np.arange(len(t)), which]
    return first, np.where(np.isfinite(first), which, -1)


def _ends(beams: Beams, shape: Shape, pose: Pose, pieces: Array) -> tuple[Array, Array, Array]:
    """Jacobian, residuals and weights of the bearings of ends behind which beams pass."""
    rows: list[tuple[float, float, float]] = []
    residuals: list[float] = []
    weights: list[float] = []
    normals = _normals(pieces)
    for piece, end in np.argwhere(shape.free).tolist():
        place, other = pieces[piece, end], pieces[piece, 1 - end]
        found = _bracket(beams, place, other, normals[piece])
        if found is None:
            continue
        inside, outside = found
        rho, bearing = math.hypot(*place), math.atan2(place[1], place[0])
        arm = place - pose[:2]
        across = np.array((-math.sin(bearing), math.cos(bearing))) / rho
        rows.append((*across.tolist(), float(across @ (-arm[1], arm[0]))))
        residuals.append(math.remainder((inside + outside) / 2 - bearing, 2 * math.pi))
        weights.append(12 / max((outside - inside) ** 2, 1e-10))
    return np.array(rows).reshape(-1, 3), np.array(residuals), np.array(weights)


def _bracket(beams: Beams, place: Array, other: Array, normal: Array) -> tuple[float, float] | None:
    """Bearings of the last beam on a piece and of the first behind its end; None if unknown."""
    rho, bearing = math.hypot(*place), math.atan2(place[1], place[0])
    if abs(float(normal @ place)) < _GRAZING * rho:
        return None
    side = math.copysign(1.0, place[1] * other[0] - place[0] * other[1])  # where the end is
    away = side * (np.mod(beams.bearings - bearing + math.pi, 2 * math.pi) - math.pi)
    near = np.flatnonzero(np.abs(away) * rho < _AROUND)
    near = near[np.argsort(away[near], kind="stable")]
    line = (normal @ place) / (beams.along[near] @ normal)
    off = beams.ranges[near] - line
    limit = np.maximum(SIGMAS * np.sqrt(beams.variances[near]), 0.01)
    on = np.abs(off) <= limit
    if not on.any() or on[-1]:
        return None
    last = int(np.flatnonzero(on)[-1])
    if on[: last + 1].mean() < 0.5 or off[last + 1] < _BEHIND:
        return None  # what is before it hides the end, or nobody knows where it is
    inside, outside = away[near[[last, last + 1]]]
    beyond = off[last + 2] if last + 2 < len(near) else np.inf
    if np.isfinite(beyond) and off[last + 1] < _SPLIT * beyond:
        inside, outside = (inside + outside) / 2, (3 * outside - inside) / 2
    return bearing + float(side * inside), bearing + float(side * outside)
