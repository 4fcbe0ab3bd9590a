"""Primary corners (equation 14) and the corner detection operator (equations 15-22)."""

import math

import numpy as np

from . import helper, kernel, sums
from .layout import (
    CANDIDATE,
    CANDIDATE_RESPONSE,
    CHORD_DISTANCE,
    SPARE,
    STACK_FIRST,
    STACK_LAST,
    X,
    Y,
)

#: The readings of the response (equation 22 and the text of Figure 9).
TANGENT, PRODUCT, RELATIVE = 0, 1, 2


@kernel
def response_along(x, y, radius, reading, out):
    """Response at every point of one class, open at its ends."""
    for i in range(len(x)):
        out[i] = corner_response(x, y, i, np.int64(0), len(x) - 1, radius, reading, False)


@helper
def corner_response(x, y, i, first, last, radius, reading, closed):
    """Response of the corner operator at point `i` of the class `first`..`last` (inclusive).

    The support is `radius` points on either side, truncated at the ends of the class; a closed
    class (its last point is its first again) has no ends. x(s) and y(s) are parabolas through
    the point in its signed arc length s (equations 15-19); their slopes there are the tangent.

    Returns
    -------
    float
        TANGENT: Σd to the tangent [m] (equations 20-22); PRODUCT: that times Σd to the chord of
        the support [m²]; RELATIVE: that over Σ|s|, in 0..1, free of range and scale. 0 where the
        support has no point on one side, or no length.
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
    norm = math.sqrt(bx * bx + by * by)
    if norm == 0.0:
        return 0.0
    to_tangent = _distance_sum(x, y, i, before, after, first, period, closed, i, bx, by)
    if reading == TANGENT:
        return to_tangent
    if reading == RELATIVE:
        return to_tangent / arcs
    a = _neighbour(i, -before, first, period, closed)
    b = _neighbour(i, after, first, period, closed)
    cx, cy = x[b] - x[a], y[b] - y[a]
    return to_tangent * _distance_sum(x, y, i, before, after, first, period, closed, a, cx, cy)


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


@sums
def farthest_from_chord(x, y, first, last, margin, away):
    """Point between `first` and `last` farthest from their chord (equation 14).

    Points nearer than `margin` to an end are not taken, so that no piece gets too short. Where
    the chord has no length (a closed class) the distance is that to its one point. `away` is
    scratch.

    Returns
    -------
    point, distance : int, float
        -1 and 0 where there is none.
    """
    if last - first < 2 * margin:
        return -1, 0.0
    x0, y0 = x[first], y[first]
    cx, cy = x[last] - x0, y[last] - y0
    chord = math.sqrt(cx * cx + cy * cy)
    # Slices, as numba need not look for negative indices where a loop begins at 0.
    x, y = x[first + margin : last - margin + 1], y[first + margin : last - margin + 1]
    best, point = 0.0, 0
    for i in range(len(x)):
        px, py = x[i] - x0, y[i] - y0
        d = abs(cx * py - cy * px) if chord > 0.0 else px * px + py * py
        away[i] = d
        best = max(best, d)
    # First how far, then which: each a loop that does several points at once.
    while away[point] < best:
        point += 1
    return first + margin + point, best / chord if chord > 0.0 else math.sqrt(best)


@helper
def primary_corners(
    floats, ints, first, last, closed, radius, threshold, reading, min_points, count
):
    """Find the corners of one class (steps 5-7), by the farthest point, again and again.

    The farthest point from the chord of a piece is a candidate. If its response exceeds the
    threshold it is a corner and both sides are searched in turn; a branch ends at its first
    rejected candidate.

    Parameters
    ----------
    floats, ints
        See `layout`. X and Y are read, the lines by candidate written.
    first, last : int
        Ends of the class.
    closed : bool
    radius, threshold, reading
        As in `corner_response`.
    min_points : int
        No piece gets shorter.
    count : int
        Candidates of other classes that stand there already.

    Returns
    -------
    int
        Candidates that stand there now.
    """
    x, y, spare = floats[X], floats[Y], floats[SPARE]
    waiting_first, waiting_last = ints[STACK_FIRST], ints[STACK_LAST]
    waiting_first[0], waiting_last[0] = first, last
    depth = np.int64(1)
    while depth > 0:
        depth -= 1
        a, b = waiting_first[depth], waiting_last[depth]
        c, distance = farthest_from_chord(x, y, a, b, min_points - 1, spare)
        if c < 0:
            continue
        response = corner_response(x, y, c, first, last, radius, reading, closed)
        ints[CANDIDATE, count] = c
        floats[CHORD_DISTANCE, count], floats[CANDIDATE_RESPONSE, count] = distance, response
        count += 1
        if response > threshold:
            # The side before it last, so that it is the next.
            waiting_first[depth], waiting_last[depth] = c, b
            waiting_first[depth + 1], waiting_last[depth + 1] = a, c
            depth += 2
    return count
