"""Adaptive clustering of consecutive points on distance and density (equations 10-13)."""

import math

import numpy as np

from . import helper, kernel
from .layout import (
    BEAM,
    CLASS_FIRST,
    CLASS_LAST,
    CLASSES,
    CLOSED,
    DENSITY_THRESHOLD,
    DISTANCE_THRESHOLD,
    FILTERED,
    LABEL,
    POINTS,
    RHO,
    SPACING,
    X,
    Y,
)


@kernel
def cluster(
    floats,
    ints,
    counts,
    bearings,
    step,
    circular,
    noise,
    scale,
    floor,
    density_k,
    min_points,
):
    """Part the usable beams of a scan into classes.

    A point joins the class before it if its spacing is at most T_d = λ max(ρ_i, ρ_{i-1}) Δφ plus
    a noise floor (equation 10), or else at most T_K = μ_K + k σ_K of the class, once that has
    three spacings (11-13): density only joins. Classes under `min_points` are noise.

    Parameters
    ----------
    floats, ints, counts
        See `layout`. FILTERED is read; the lines by point, SPACING and the thresholds are written
        (DENSITY_THRESHOLD is NaN where it was not asked), BEAM, LABEL, the classes.
    bearings : float64 array, shape (2, n)
        Cosines and sines.
    step : float
        Δφ [rad].
    circular : bool
        Whether the last class may go on in the first.
    noise : float64 array, shape (4,)
    scale, floor, density_k : float
        λ, the noise floor in units of √2 σ, and k.
    min_points : int
    """
    count = list_points(floats, ints, bearings)
    rho, limit, second = floats[RHO], floats[DISTANCE_THRESHOLD], floats[DENSITY_THRESHOLD]
    scaled_step, noise_floor = scale * step, floor * math.sqrt(2.0) * noise[0]
    after, limit_after = rho[1:], limit[1:]
    for i in range(count - 1):
        limit_after[i] = scaled_step * max(after[i], rho[i]) + noise_floor
    limit[0] = scaled_step * max(rho[0], rho[count - 1]) + noise_floor
    for i in range(count):
        second[i] = math.nan
    part_points(floats, ints, counts, bearings, circular, count, density_k, min_points)


@helper
def list_points(floats, ints, bearings):
    """List the beams whose range is not NaN, place their points, and measure their spacings.

    The spacing of the first point is that from the last. Returns how many there are.
    """
    ranges, beam, spacing = floats[FILTERED], ints[BEAM], floats[SPACING]
    count = np.int64(0)
    for i in range(bearings.shape[1]):
        beam[count] = i
        count += not math.isnan(ranges[i])
    place(floats, beam, bearings, count)
    x, y = floats[X], floats[Y]
    x_after, y_after, spacing_after = x[1:], y[1:], spacing[1:]
    for i in range(count - 1):
        dx, dy = x_after[i] - x[i], y_after[i] - y[i]
        spacing_after[i] = math.sqrt(dx * dx + dy * dy)
    if count > 0:
        dx, dy = x[0] - x[count - 1], y[0] - y[count - 1]
        spacing[0] = math.sqrt(dx * dx + dy * dy)
    return count


@helper
def place(floats, beam, bearings, count):
    """X = ρ cos θ, y = ρ sin θ of the beams listed (equations 2, 3)."""
    ranges, rho, x, y = floats[FILTERED], floats[RHO], floats[X], floats[Y]
    cosines, sines = bearings[0], bearings[1]
    for i in range(count):
        b = beam[i]
        rho[i] = ranges[b]
        x[i], y[i] = rho[i] * cosines[b], rho[i] * sines[b]


@helper
def part_points(floats, ints, counts, bearings, circular, count, density_k, min_points):
    """Label the points by class, from their spacings and the DISTANCE_THRESHOLD.

    On a full circle whose last class goes on in the first, the points are turned so that they
    begin with it. Where all are one class that closes, the first point is put at the end again.
    """
    beam, label = ints[BEAM], ints[LABEL]
    spacing, limit = floats[SPACING], floats[DISTANCE_THRESHOLD]
    classes, turn = _classes(
        spacing, limit, floats[DENSITY_THRESHOLD], count, density_k, circular, label
    )
    closed = classes == 1 and turn == 0
    if turn >= 0:
        if closed:
            # Opened at its farthest point: that of a polygon is always a vertex.
            turn = _farthest(floats[RHO], count)
        _rotate(beam, label, count, turn)
        if closed:
            beam[count], label[count] = beam[0], label[0]
            count += 1
        place(floats, beam, bearings, count)
    counts[POINTS], counts[CLOSED] = count, closed
    # The first point of a closed class, which stands at its end again, counts once.
    counts[CLASSES] = _list_classes(
        label, count, min_points + closed, ints[CLASS_FIRST], ints[CLASS_LAST]
    )


@helper
def _classes(spacing, t_d, t_k, count, density_k, circular, label):
    """Write the class of each point to `label`.

    Returns the number of classes, and the point at which the last begins if it goes on in the
    first (and then has its number), else -1.
    """
    current, start = -1, 0
    # Sums over the spacings of the class, as far as they were asked for.
    total, squares, summed = 0.0, 0.0, 0
    for turn in range(count + (circular and count >= 3)):
        i = turn if turn < count else 0
        joins = turn > 0 and spacing[i] <= t_d[i]
        inside = turn - 1 - start
        if turn > 0 and not joins and inside >= 3:
            while summed < turn - 1:
                summed += 1
                total += spacing[summed]
                squares += spacing[summed] * spacing[summed]
            t_k[i] = _density_threshold(inside, total, squares, density_k)
            joins = spacing[i] <= t_k[i]
        if turn == count:
            if not joins:
                break
            for k in range(start, count):
                label[k] = 0
            return max(current, 1), start
        if not joins:
            current += 1
            start, summed = turn, turn
            total, squares = 0.0, 0.0
        label[i] = current
    return current + 1, -1


@helper
def _density_threshold(count, total, squares, density_k):
    """T_K = μ_K + k σ_K of the spacings inside a class (equations 11-13)."""
    mean = total / count
    return mean + density_k * math.sqrt(max(squares / count - mean * mean, 0.0))


@helper
def _rotate(beam, label, count, start):
    """Rotate both lists so that they begin at `start`, by three reversals."""
    first = np.int64(0)
    _reverse(beam, label, first, start - 1)
    _reverse(beam, label, start, count - 1)
    _reverse(beam, label, first, count - 1)


@helper
def _farthest(rho, count):
    """Point of the greatest range."""
    best = 0
    for i in range(count):
        if rho[i] > rho[best]:
            best = i
    return best


@helper
def _reverse(beam, label, i, j):
    while i < j:
        beam[i], beam[j] = beam[j], beam[i]
        label[i], label[j] = label[j], label[i]
        i += 1
        j -= 1


@helper
def _list_classes(label, count, min_points, first, last):
    """List the classes; those under `min_points` become noise. Returns how many are left."""
    kept, start = np.int64(0), np.int64(0)
    for i in range(count):
        if i + 1 < count and label[i + 1] == label[i]:
            continue
        number = kept if i + 1 - start >= min_points else -1
        if label[start] != number:
            for k in range(start, i + 1):
                label[k] = number
        if number >= 0:
            first[kept], last[kept] = start, i
            kept += 1
        start = i + 1
    return kept
