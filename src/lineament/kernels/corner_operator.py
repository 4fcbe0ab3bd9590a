"""The corner detection operator of Liu et al. 2023 (equations 15-22)."""

import math

import numpy as np

from . import helper, kernel
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
    period = last - first
    s2, s3, s4, arcs = 0.0, 0.0, 0.0, 0.0
    sx, sy, ssx, ssy = 0.0, 0.0, 0.0, 0.0
    for side in range(2):
        sign = 2 * side - 1
        near_x, near_y, arc = x[i], y[i], 0.0
        for k in range(1, (after if side else before) + 1):
            j = _neighbour(i, sign * k, first, period, closed)
            arc += math.sqrt((x[j] - near_x) * (x[j] - near_x) + (y[j] - near_y) * (y[j] - near_y))
            near_x, near_y = x[j], y[j]
            s, dx, dy = sign * arc, near_x - x[i], near_y - y[i]
            square = s * s
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
    return _accumulate(x, y, i, before, after, first, period, closed, (bx, by), arcs, kind)


@helper
def _accumulate(x, y, i, before, after, first, period, closed, tangent, arcs, kind):
    """Add up the distances of a support to its tangent and its chord, by the form of response."""
    bx, by = tangent
    to_tangent = _distance_sum(x, y, i, before, after, first, period, closed, i, bx, by)
    if kind == TANGENT:
        return to_tangent
    if kind == RELATIVE:
        return to_tangent / arcs
    a = _neighbour(i, -before, first, period, closed)
    b = _neighbour(i, after, first, period, closed)
    cx, cy = x[b] - x[a], y[b] - y[a]
    square = cx * cx + cy * cy
    if kind != PRODUCT and square == 0.0:
        return 0.0
    if kind == CHORD_SCALED:
        return to_tangent / math.sqrt(square)
    product = to_tangent * _distance_sum(x, y, i, before, after, first, period, closed, a, cx, cy)
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
def _neighbour(i, offset, first, period, closed):
    return first + (i - first + offset) % period if closed else i + offset


@helper
def _distance_sum(x, y, i, before, after, first, period, closed, origin, ux, uy):
    """Sum of the distances of a support to the line through a point along (ux, uy) (21, 22)."""
    norm = math.sqrt(ux * ux + uy * uy)
    total = 0.0
    for k in range(-before, after + 1):
        j = _neighbour(i, k, first, period, closed)
        dx, dy = x[j] - x[origin], y[j] - y[origin]
        if norm > 0.0:
            total += abs(uy * dx - ux * dy) / norm
        else:
            total += math.sqrt(dx * dx + dy * dy)
    return total
