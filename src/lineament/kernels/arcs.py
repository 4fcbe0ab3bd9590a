"""Circles through stretches of points, and runs of pieces that are one arc."""

import math

import numpy as np

from . import helper
from .inverse_range import line_through
from .layout import (
    ARC_COST,
    ARC_FIRST,
    ARC_GAIN,
    ARC_LAST,
    ARC_R,
    ARC_RMS,
    ARC_RR,
    ARC_X,
    ARC_XR,
    ARC_XX,
    ARC_XY,
    ARC_Y,
    ARC_YR,
    ARC_YY,
    ARCS,
    FIRST,
    LAST,
    RHO,
    X,
    Y,
)
from .line_fit import range_variance

#: Steps of Gauss and Newton from the algebraic circle; the last only measures.
_STEPS = 4
#: An arc has at least so many points, and at most so many pieces of a line each.
_LEAST_POINTS, _MOST_PIECES = 5, 8
#: Larger circles are walls that bow [m].
_LARGEST = 5.0
#: Deviations that a point may be off the circle through three others.
_NEAR = 6.0


@helper
def fit_arc(floats, first, last, noise, k):
    """Fit a circle to the points `first`..`last`, as the k-th arc.

    Begins with the circle of least squares of |p - c|² - r² (Kåsa 1976), and goes on to that of
    least Σ (|p - c| - r)²/b by Gauss and Newton, b = σ_r² (cos² ψ + σ_r/2r): the noise of a range
    moves a point along the normal by its cos ψ, and never less than the circle bends over it.

    Returns
    -------
    bool
        Whether there is one, that turns its outside to the sensor.
    """
    x, y, rho = floats[X], floats[Y], floats[RHO]
    cx, cy, r = _algebraic_circle(x, y, first, last)
    for step in range(_STEPS):
        if not 0.0 < r < _LARGEST:
            return False
        hxx, hxy, hxr, hyy, hyr, hrr = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        gx, gy, gr, chi_square, squares = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(first, last + 1):
            px, py = x[i] - cx, y[i] - cy
            d = math.sqrt(px * px + py * py)
            nx, ny = px / d, py / d
            cosine = (nx * x[i] + ny * y[i]) / rho[i]
            variance = range_variance(rho[i], noise)
            w = 1.0 / (variance * (cosine * cosine + 0.5 * math.sqrt(variance) / r))
            e = d - r
            squares += e * e
            chi_square += w * e * e
            hxx, hxy, hxr = hxx + w * nx * nx, hxy + w * nx * ny, hxr + w * nx
            hyy, hyr, hrr = hyy + w * ny * ny, hyr + w * ny, hrr + w
            gx, gy, gr = gx + w * nx * e, gy + w * ny * e, gr + w * e
        # The inverse of the normal matrix, by its cofactors.
        xx, xy, xr = hyy * hrr - hyr * hyr, hxr * hyr - hxy * hrr, hxy * hyr - hxr * hyy
        yy, yr, rr = hxx * hrr - hxr * hxr, hxy * hxr - hxx * hyr, hxx * hyy - hxy * hxy
        determinant = hxx * xx + hxy * xy + hxr * xr
        if not determinant > 1e-12 * hxx * hyy * hrr:
            return False
        if step < _STEPS - 1:
            cx += (xx * gx + xy * gy + xr * gr) / determinant
            cy += (xy * gx + yy * gy + yr * gr) / determinant
            r += (xr * gx + yr * gy + rr * gr) / determinant
            continue
        floats[ARC_X, k], floats[ARC_Y, k], floats[ARC_R, k] = cx, cy, r
        floats[ARC_RMS, k] = math.sqrt(squares / (last - first + 1))
        floats[ARC_COST, k] = chi_square
        floats[ARC_XX, k], floats[ARC_XY, k] = xx / determinant, xy / determinant
        floats[ARC_XR, k], floats[ARC_YY, k] = xr / determinant, yy / determinant
        floats[ARC_YR, k], floats[ARC_RR, k] = yr / determinant, rr / determinant
    middle = (first + last) // 2
    bulge = x[middle] * (cx - x[middle]) + y[middle] * (cy - y[middle])
    return bulge > 0.0 and xx > 0.0 and yy > 0.0 and rr > 0.0


@helper
def _algebraic_circle(x, y, first, last):
    """Circle of least squares of |p - c|² - r²; its radius is 0 where there is none."""
    n = last - first + 1
    mx, my = 0.0, 0.0
    for i in range(first, last + 1):
        mx += x[i]
        my += y[i]
    mx, my = mx / n, my / n
    xx, xy, yy, xz, yz, z = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(first, last + 1):
        dx, dy = x[i] - mx, y[i] - my
        square = dx * dx + dy * dy
        xx, xy, yy = xx + dx * dx, xy + dx * dy, yy + dy * dy
        xz, yz, z = xz + dx * square, yz + dy * square, z + square
    determinant = xx * yy - xy * xy
    if not determinant > 1e-9 * xx * yy:
        return mx, my, 0.0
    ux, uy = 0.5 * (xz * yy - yz * xy) / determinant, 0.5 * (yz * xx - xz * xy) / determinant
    return mx + ux, my + uy, math.sqrt(ux * ux + uy * uy + z / n)


@helper
def find_arcs(floats, ints, counts, noise, sums, c, low, high, evidence, price):
    """Take out the runs of pieces of class c that one circle explains better, as arcs.

    A piece costs its χ² and `evidence`, an arc its χ² and `price` times as much. Returns one
    more than the last piece that is left.
    """
    first, last = ints[FIRST], ints[LAST]
    kept, k = low, low
    while k < high:
        arc = counts[ARCS]
        end, gain = _best_arc(floats, ints, noise, sums, c, k, high, arc, evidence, price)
        if end >= k:
            fit_arc(floats, first[k], last[end], noise, arc)
            floats[ARC_GAIN, arc] = gain
            ints[ARC_FIRST, arc], ints[ARC_LAST, arc] = first[k], last[end]
            counts[ARCS] += 1
            k = end + 1
        else:
            first[kept], last[kept] = first[k], last[k]
            kept += 1
            k += 1
    return kept


@helper
def _best_arc(floats, ints, noise, sums, c, k, high, arc, evidence, price):
    """Find the last piece of the best arc that begins with the k-th, or -1, and what it gains."""
    lines, most, end = 0.0, 0.0, np.int64(-1)
    for j in range(k, min(high, k + _MOST_PIECES)):
        _, _, chi_square = line_through(sums, c, ints[FIRST, j], ints[LAST, j])
        lines += chi_square + evidence
        points = ints[LAST, j] - ints[FIRST, k] + 1
        # What a line explains is no arc.
        straight = j == k and chi_square < points + 2.0 * math.sqrt(2.0 * points)
        if points < _LEAST_POINTS or straight:
            continue
        if not _may_be_arc(floats, ints[FIRST, k], ints[LAST, j], noise):
            continue
        if fit_arc(floats, ints[FIRST, k], ints[LAST, j], noise, arc):
            cost = floats[ARC_COST, arc]
            gain = lines - cost - price * evidence
            if gain > most and cost < 2.0 * points + 12.0:
                most, end = gain, j
    return end, most


@helper
def _may_be_arc(floats, first, last, noise):
    """Whether the points at the quarters are near the circle through the ends and the middle.

    That bulges towards the sensor. It costs little, and hardly anything else gets further.
    """
    x, y = floats[X], floats[Y]
    middle = (first + last) // 2
    ax, ay = x[first] - x[middle], y[first] - y[middle]
    bx, by = x[last] - x[middle], y[last] - y[middle]
    cross = ax * by - ay * bx
    a, b = ax * ax + ay * ay, bx * bx + by * by
    # Beams run counter-clockwise: seen from the middle, the ends of a bulge span a right turn.
    if not cross > 0.0:
        return False
    ux, uy = (by * a - ay * b) / (2.0 * cross), (ax * b - bx * a) / (2.0 * cross)
    r = math.sqrt(ux * ux + uy * uy)
    if r > _LARGEST:
        return False
    near = _NEAR * math.sqrt(range_variance(floats[RHO, middle], noise))
    for i in ((first + middle) // 2, (middle + last + 1) // 2):
        dx, dy = x[i] - x[middle] - ux, y[i] - y[middle] - uy
        if abs(math.sqrt(dx * dx + dy * dy) - r) > near:
            return False
    return True
