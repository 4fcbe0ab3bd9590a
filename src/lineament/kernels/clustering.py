"""Adaptive clustering of consecutive points on distance and density (equations 10-13)."""

import math

import numpy as np

from . import helper, kernel
from .layout import (
    BEAM,
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
def cluster_rows(
    floats,
    ints,
    counts,
    rows,
    cosines,
    sines,
    step,
    circular,
    noises,
    scale,
    floor,
    density_k,
    min_points,
):
    """Part the usable beams of each row into classes.

    A point joins the class before it if its spacing is at most T_d = λ max(ρ_i, ρ_{i-1}) Δφ plus
    a noise floor (equation 10), or else at most T_K = μ_K + k σ_K of the class, once that has
    three spacings (11-13): density only joins. Classes under `min_points` are noise.

    Parameters
    ----------
    floats, ints, counts
        See `layout`. FILTERED is read; the lines by point, SPACING and the thresholds are written
        (DENSITY_THRESHOLD is NaN where it was not asked), BEAM, LABEL, POINTS and CLOSED.
    rows : int
        Rows in use.
    cosines, sines : float64 arrays, shape (n,)
    step : float
        Δφ [rad].
    circular : bool
        Whether the last class may go on in the first.
    noises : float64 array, shape (m, 4)
    scale, floor, density_k : float
        λ, the noise floor in units of √2 σ, and k.
    min_points : int
    """
    n = len(cosines)
    for row in range(rows):
        ranges, beam, label = floats[row, FILTERED], ints[row, BEAM], ints[row, LABEL]
        x, y, rho = floats[row, X], floats[row, Y], floats[row, RHO]
        spacing, limit = floats[row, SPACING], floats[row, DISTANCE_THRESHOLD]
        count = np.int64(0)
        for i in range(n):
            beam[count] = i
            count += not math.isnan(ranges[i])
        place(ranges, cosines, sines, beam, count, rho, x, y)
        noise_floor = floor * math.sqrt(2.0) * noises[row, 0]
        _spacings(x, y, rho, count, scale * step, noise_floor, spacing, limit)
        classes, turn = _classes(
            spacing, limit, floats[row, DENSITY_THRESHOLD], count, density_k, circular, label
        )
        closed = classes == 1 and turn == 0
        if turn >= 0:
            if closed:
                # Opened at its farthest point: that of a polygon is always a vertex.
                turn = _farthest(rho, count)
            _rotate(beam, label, count, turn)
            if closed:
                beam[count], label[count] = beam[0], label[0]
                count += 1
            place(ranges, cosines, sines, beam, count, rho, x, y)
        counts[row, POINTS], counts[row, CLOSED] = count, closed
        # The first point of a closed class, which stands at its end again, counts once.
        _drop_small(label, count, min_points + closed)


@helper
def place(ranges, cosines, sines, beam, count, rho, x, y):
    """X = ρ cos θ, y = ρ sin θ of the beams listed (equations 2, 3)."""
    for i in range(count):
        b = beam[i]
        rho[i] = ranges[b]
        x[i], y[i] = rho[i] * cosines[b], rho[i] * sines[b]


@helper
def _spacings(x, y, rho, count, scaled_step, floor, spacing, threshold):
    """Distance of each point to the one before it, and T_d (equation 10)."""
    for i in range(1, count):
        dx, dy = x[i] - x[i - 1], y[i] - y[i - 1]
        spacing[i] = math.sqrt(dx * dx + dy * dy)
        threshold[i] = scaled_step * max(rho[i], rho[i - 1]) + floor
    if count > 0:
        last = count - 1
        dx, dy = x[0] - x[last], y[0] - y[last]
        spacing[0] = math.sqrt(dx * dx + dy * dy)
        threshold[0] = scaled_step * max(rho[0], rho[last]) + floor


@helper
def _classes(spacing, t_d, t_k, count, density_k, circular, label):
    """Write the class of each point to `label`.

    Returns the number of classes, and the point at which the last begins if it goes on in the
    first (and then has its number), else -1.
    """
    current, start, members = -1, 0, 0
    total, squares = 0.0, 0.0
    for i in range(count):
        d = spacing[i]
        joins = i > 0 and d <= t_d[i]
        t_k[i] = math.nan
        if i > 0 and not joins and members >= 3:
            t_k[i] = _density_threshold(members, total, squares, density_k)
            joins = d <= t_k[i]
        if joins:
            members += 1
            total += d
            squares += d * d
        else:
            current += 1
            start, members = i, 0
            total, squares = 0.0, 0.0
        label[i] = current
    if not circular or count < 3:
        return current + 1, -1
    joins = spacing[0] <= t_d[0]
    if not joins and members >= 3:
        t_k[0] = _density_threshold(members, total, squares, density_k)
        joins = spacing[0] <= t_k[0]
    if not joins:
        return current + 1, -1
    for i in range(start, count):
        label[i] = 0
    return max(current, 1), start


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
def _drop_small(label, count, min_points):
    """Make noise of the classes under `min_points`, and number the others anew."""
    kept, i = 0, 0
    while i < count:
        j = i
        while j < count and label[j] == label[i]:
            j += 1
        number = kept if j - i >= min_points else -1
        kept += number >= 0
        for k in range(i, j):
            label[k] = number
        i = j
