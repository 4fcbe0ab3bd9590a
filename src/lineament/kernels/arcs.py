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
    CLASS_FIRST,
    CLASS_LAST,
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
#: χ² that such a reading costs if it is on no arc.
_OUT = 8.0
#: Left-out readings that an arc may have at either end.
_ENDS = 3
#: Share of the evidence that an arc is spared that is all of its class, as a free column is.
_ALONE = 0.2
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
        Whether there is one, that turns its outside to the sensor; else nothing is written.
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
        middle = (first + last) // 2
        bulge = x[middle] * (cx - x[middle]) + y[middle] * (cy - y[middle])
        if not (bulge > 0.0 and xx > 0.0 and yy > 0.0 and rr > 0.0):
            return False
        floats[ARC_X, k], floats[ARC_Y, k], floats[ARC_R, k] = cx, cy, r
        floats[ARC_RMS, k] = math.sqrt(squares / (last - first + 1))
        floats[ARC_COST, k] = chi_square
        floats[ARC_XX, k], floats[ARC_XY, k] = xx / determinant, xy / determinant
        floats[ARC_XR, k], floats[ARC_YY, k] = xr / determinant, yy / determinant
        floats[ARC_YR, k], floats[ARC_RR, k] = yr / determinant, rr / determinant
    return True


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
def find_arcs(floats, ints, counts, noise, uneven, sums, c, low, high, evidence, price):
    """Take out the runs of pieces of class c that one circle explains better, as arcs.

    A piece costs its χ² and `evidence`, an arc its χ² and `price` times as much. An arc may have
    points beside its pieces that are on none: the ends of a column are too steep for any line.
    Returns one more than the last piece that is left.
    """
    first, last = ints[FIRST], ints[LAST]
    kept, k, free = low, low, ints[CLASS_FIRST, c]
    while k < high:
        arc = counts[ARCS]
        end, gain, i, j = _best_arc(
            floats, ints, noise, uneven, sums, c, k, high, free, arc, evidence, price
        )
        if end >= k:
            fit_arc(floats, i, j, noise, arc)
            floats[ARC_GAIN, arc] = gain
            ints[ARC_FIRST, arc], ints[ARC_LAST, arc] = i, j
            counts[ARCS] += 1
            k, free = end + 1, j + 1
        else:
            first[kept], last[kept] = first[k], last[k]
            free = last[k] + 1
            kept += 1
            k += 1
    return kept


@helper
def _best_arc(floats, ints, noise, uneven, sums, c, k, high, free, arc, evidence, price):
    """Find the last piece of the best arc that begins with the k-th, or -1, and what it gains.

    And its first and last point, of those from `free` on.
    """
    first, last, start, stop = ints[FIRST], ints[LAST], ints[CLASS_FIRST, c], ints[CLASS_LAST, c]
    lines, most, end, best_i, best_j = 0.0, 0.0, np.int64(-1), np.int64(-1), np.int64(-1)
    left = min(first[k] - free, _ENDS)
    for q in range(k, min(high, k + _MOST_PIECES)):
        _, _, chi_square = line_through(sums, c, first[q], last[q])
        lines += chi_square + evidence
        points = last[q] - first[k] + 1
        # What a line explains is no arc, if there is more about it.
        straight = q == k and chi_square < points + 2.0 * math.sqrt(2.0 * points)
        right = min((first[q + 1] - 1 if q + 1 < high else stop) - last[q], _ENDS)
        for ends in range((left + 1) * (right + 1)):
            i, j = first[k] - ends % (left + 1), last[q] + ends // (left + 1)
            alone = i <= start + 1 and j >= stop - 1
            if straight and ends == 0 and not alone:
                continue
            gain = lines - _arc_cost(floats, noise, uneven, i, j, arc) - price * evidence
            gain += _OUT * (j - i + 1 - points) + (_ALONE * evidence if alone else 0.0)
            if gain > most:
                most, end, best_i, best_j = gain, q, i, j
    return end, most, best_i, best_j


@helper
def _arc_cost(floats, noise, uneven, i, j, arc):
    """χ² of the circle through points, fitted as an arc; inf if it does not explain them.

    Walls may be `uneven`, which is part of the noise here; what is round is not.
    """
    points = j - i + 1
    if points < _LEAST_POINTS or not _may_be_arc(floats, i, j, noise):
        return math.inf
    if not fit_arc(floats, i, j, noise, arc):
        return math.inf
    cost, variance = floats[ARC_COST, arc], range_variance(floats[RHO, j], noise)
    return cost if cost * variance < (2.0 * points + 12.0) * (variance - uneven) else math.inf


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
