"""The corner detection operator of Liu et al. 2023 (equations 15-22)."""

import math

import numpy as np

from . import helper, kernel, sums
from .arrays import Floats1

#: What the response is: the interpretations of equation 22 and the text of Figure 9.
TANGENT, PRODUCT, RELATIVE, CHORD_SCALED, PRODUCT_SCALED = range(5)
RESPONSES = {
    "relative": RELATIVE,
    "tangent": TANGENT,
    "product": PRODUCT,
    "chord_scaled": CHORD_SCALED,
    "product_scaled": PRODUCT_SCALED,
}


@kernel
def response_along(
    x: Floats1,
    y: Floats1,
    radius: int,
    kind: int,
    out: Floats1,
):
    """Response at every point of one cluster, open at its ends."""
    for i in range(len(x)):
        out[i] = corner_response(x, y, i, np.int64(0), len(x) - 1, radius, kind, False)


@helper
def corner_response(x, y, i, first, last, radius, kind, closed):
    """Response of the corner operator at point `i` of the cluster `first`..`last` (inclusive).

    The support is `radius` points on either side, truncated at the ends of the cluster; a closed
    cluster (its last point is its first again) has no ends. x(s) and y(s) are parabolas through
    the point in its signed arc length s (equations 15-19); their slopes there are the tangent.

    Returns
    -------
    float
        TANGENT: Σd to the tangent [m] (equations 20-22); PRODUCT: that times Σd to the chord of
        the support [m²]; RELATIVE: Σd to the tangent over Σ|s|, in 0..1, free of range and scale;
        CHORD_SCALED: the same over the length of the chord; PRODUCT_SCALED: PRODUCT over the square
        of that length. 0 where the support has no point on one side, or no length.
    """
    before, after = _support(i, first, last, radius, closed)
    if before == 0 or after == 0:
        return 0.0
    s2, s3, s4, arcs = 0.0, 0.0, 0.0, 0.0
    sx, sy, ssx, ssy = 0.0, 0.0, 0.0, 0.0
    for side in range(2):
        sign = 2 * side - 1
        near_x, near_y, arc = x[i], y[i], 0.0
        for k in range(1, (after if side else before) + 1):
            j = _around(i + sign * k, first, last)
            arc += math.sqrt((x[j] - near_x) * (x[j] - near_x) + (y[j] - near_y) * (y[j] - near_y))
            near_x, near_y = x[j], y[j]
            s, dx, dy = sign * arc, near_x - x[i], near_y - y[i]
            square = arc * arc
            arcs += arc
            s2 += square
            s3 += square * s
            s4 += square * square
            sx += s * dx
            sy += s * dy
            ssx += square * dx
            ssy += square * dy
    determinant = s2 * s4 - s3 * s3
    bx, by = s4 * sx - s3 * ssx, s4 * sy - s3 * ssy
    if determinant <= 1e-12 * s2 * s4:
        # All support points at one distance determine no parabola, but a line.
        bx, by = sx, sy
    if bx == 0.0 and by == 0.0:
        return 0.0
    return _accumulate(x, y, i, before, after, first, last, (bx, by), arcs, kind)


@helper
def _accumulate(x, y, i, before, after, first, last, tangent, arcs, kind):
    """Add up the distances of a support to its tangent and its chord, by the form of response."""
    bx, by = tangent
    low, high = i - before, i + after
    to_tangent = _distance_sum(x, y, low, high, first, last, i, bx, by)
    if kind == TANGENT:
        return to_tangent
    if kind == RELATIVE:
        return to_tangent / arcs
    a, b = _around(low, first, last), _around(high, first, last)
    cx, cy = x[b] - x[a], y[b] - y[a]
    square = cx * cx + cy * cy
    if kind != PRODUCT and square == 0.0:
        return 0.0
    if kind == CHORD_SCALED:
        return to_tangent / math.sqrt(square)
    product = to_tangent * _distance_sum(x, y, low, high, first, last, a, cx, cy)
    return product if kind == PRODUCT else product / square


@helper
def _support(i, first, last, radius, closed):
    """Points before and after `i` that support it."""
    if closed:
        # Never the same point twice.
        reach = min(radius, (last - first - 1) // 2)
        return reach, reach
    return min(radius, i - first), min(radius, last - i)


@helper
def _around(i, first, last):
    """Return a point of a cluster; beyond an end of a closed one it is beside the other end."""
    if i < first:
        return i + last - first
    return i - (last - first) if i > last else i


@helper
def _distance_sum(x, y, low, high, first, last, origin, ux, uy):
    """Sum of the distances of points low … high to the line through one along (ux, uy) (21, 22).

    Those beyond an end of a closed cluster are beside its other end.
    """
    total, x0, y0 = 0.0, x[origin], y[origin]
    if low < first:
        beyond = slice(_around(low, first, last), last)
        total += _distances(x[beyond], y[beyond], x0, y0, ux, uy)
        low = first
    if high > last:
        beyond = slice(first + 1, _around(high, first, last) + 1)
        total += _distances(x[beyond], y[beyond], x0, y0, ux, uy)
        high = last
    return total + _distances(x[low : high + 1], y[low : high + 1], x0, y0, ux, uy)


@sums
def _distances(x, y, x0, y0, ux, uy):
    """Sum of the distances of points to a line, or to its point if its direction has no length."""
    norm, total = math.sqrt(ux * ux + uy * uy), 0.0
    if norm == 0.0:
        for i in range(len(x)):
            total += math.sqrt((x[i] - x0) * (x[i] - x0) + (y[i] - y0) * (y[i] - y0))
        return total
    for i in range(len(x)):
        total += abs(uy * (x[i] - x0) - ux * (y[i] - y0))
    return total / norm
