"""Vertices of polylines placed: lines held together there, or free to meet beside a reading.

The inverse ranges at the vertices follow from tridiagonal normal equations.
"""

import math

import numpy as np

from . import helper, kernel
from .layout import (
    BEAM, BEFORE, CLOSED, CROSS, FIRST, LAST, PIECES, PIVOT, POINTS, RESPONSE, RHO, RIGHT,
    STACK_FIRST, STACK_LAST, U_AFTER, U_BEFORE, X, Y,
)  # fmt: skip
from ..features.records import C_POSITION, S_ANGLE, S_CENTROID, S_END, S_START
from .writing import write_end

#: How a vertex belongs to the one before: it begins a polyline; its two lines are held together on
#: its ray; or they are free to meet beside it, and its reading is on neither as long as it is open
#: on which, or on the line after it, or on that before.
BEGIN, HELD, _OPEN, _AFTER, _BEFORE = 0, 1, 2, 3, 4
#: Points between the vertices of a line that is free.
_ENOUGH = 3


@helper
def place_vertices(floats, ints, counts, bearings, vertices):
    """Place the vertices listed, and take the lines between them for the pieces.

    STACK_FIRST holds the point of each vertex, STACK_LAST its kind: BEGIN or HELD. X and Y of
    these points become the vertices.
    """
    ring = counts[CLOSED] != 0 and _closes(ints, counts[POINTS], vertices)
    _settle(floats, ints, bearings, vertices, ring)
    _move_points(floats, ints, bearings, vertices, ring)
    counts[PIECES] = _list_pieces(floats, ints, vertices, ring)


@helper
def _closes(ints, points, vertices):
    """Whether polylines begin at the first point of a closed class, and end there again."""
    at, kind = ints[STACK_FIRST], ints[STACK_LAST]
    if vertices < 3 or at[0] != 0 or at[vertices - 1] != points - 1:
        return False
    return kind[1] != BEGIN and kind[vertices - 1] != BEGIN


@helper
def _list_pieces(floats, ints, vertices, ring):
    """Take the lines from vertex to vertex for the pieces. Returns their number."""
    at, kind, n = ints[STACK_FIRST], ints[STACK_LAST], np.int64(0)
    for k in range(1, vertices):
        if kind[k] == BEGIN:
            continue
        ints[FIRST, n], ints[LAST, n], floats[RESPONSE, n] = at[k - 1], at[k], math.nan
        ints[BEFORE, n] = -1 if k == 1 or kind[k - 1] == BEGIN else n - 1
        n += 1
    if ring:
        ints[BEFORE, 0] = n - 1
    return n


@helper
def _settle(floats, ints, bearings, vertices, ring):
    """Find the lines: held together at first, then free where they meet beside a reading.

    The two ends of a ring are one vertex, and free from the start.
    """
    at, kind = ints[STACK_FIRST], ints[STACK_LAST]
    end = vertices if ring else vertices - 1
    for step in range(4):
        _solve(floats, ints, bearings, vertices, step > 0)
        for k in range(1, end if step < 3 else 1):
            m = _leaves(k, vertices)
            if kind[k] == BEGIN or kind[m + 1] == BEGIN:
                continue
            if step == 0 and min(at[k] - at[k - 1], at[m + 1] - at[m]) > _ENOUGH:
                kind[k] = _OPEN
            elif kind[k] != HELD:
                tangent, _ = _meeting(floats, ints, bearings, k, m)
                kind[k] = _BEFORE if tangent > 0.0 else HELD if math.isnan(tangent) else _AFTER
        if ring:
            kind[0] = kind[vertices - 1] if kind[vertices - 1] > HELD else BEGIN


@helper
def _leaves(k, vertices):
    """Vertex from which the line after the k-th goes on: that which begins a ring, at its end."""
    return np.int64(0) if k + 1 == vertices else k


@helper
def _move_points(floats, ints, bearings, vertices, ring):
    """Move the points of the vertices to where their lines meet, or end."""
    at, kind, x, y = ints[STACK_FIRST], ints[STACK_LAST], floats[X], floats[Y]
    before, after = floats[U_BEFORE], floats[U_AFTER]
    for k in range(vertices):
        i, b, tangent = at[k], ints[BEAM, at[k]], 0.0
        m = _leaves(k, vertices)
        begins = k == 0 or kind[k] == BEGIN
        if begins:
            u = after[k]
        elif kind[m + 1] == BEGIN or (m != k and not ring):
            u = before[k]
        else:
            tangent, u = _meeting(floats, ints, bearings, k, m)
            if kind[k] == HELD or math.isnan(tangent):
                tangent, u = 0.0, 0.5 * (before[k] + after[m])
        if not u > 0.0:
            u = 1.0 / floats[RHO, i]
        x[i] = (bearings[0, b] - tangent * bearings[1, b]) / u
        y[i] = (bearings[1, b] + tangent * bearings[0, b]) / u
    if ring:
        x[at[0]], y[at[0]] = x[at[vertices - 1]], y[at[vertices - 1]]


@helper
def _turn(bearings, b, to):
    """Cosine and sine of the angle from the ray of one beam to that of another."""
    c = bearings[0, b] * bearings[0, to] + bearings[1, b] * bearings[1, to]
    return c, bearings[0, b] * bearings[1, to] - bearings[1, b] * bearings[0, to]


@helper
def _meeting(floats, ints, bearings, k, m):
    """Where the lines that come to vertex k and leave m, on the same ray, meet.

    Tangent of the angle from that ray, and 1/ρ times its cosine; NaN if they do not meet between
    the readings next to it.
    """
    at, beam, before, after = (
        ints[STACK_FIRST],
        ints[BEAM],
        floats[U_BEFORE],
        floats[U_AFTER],
    )
    b = beam[at[k]]
    c, s = _turn(bearings, b, beam[at[k - 1]])
    slope = (after[k - 1] - before[k] * c) / s
    c, s = _turn(bearings, b, beam[at[m + 1]])
    bend = (before[m + 1] - after[m] * c) / s - slope
    if bend == 0.0:
        return math.nan, math.nan
    tangent = (before[k] - after[m]) / bend
    c1, s1 = _turn(bearings, b, beam[at[k] - 1])
    c2, s2 = _turn(bearings, b, beam[at[m] + 1])
    if not s1 < tangent * c1 or not tangent * c2 < s2:
        return math.nan, math.nan
    return tangent, before[k] + slope * tangent


@helper
def _solve(floats, ints, bearings, vertices, again):
    """Inverse range of the line before each vertex (U_BEFORE) and of that after it (U_AFTER).

    Of least squared range errors; with weights from the lines that are there, if `again`.
    """
    kind, before, after = ints[STACK_LAST], floats[U_BEFORE], floats[U_AFTER]
    pivot, right, cross = floats[PIVOT], floats[RIGHT], floats[CROSS]
    d, h = 0.0, 0.0
    for k in range(vertices):
        if kind[k] == BEGIN or kind[k] > HELD:
            d, h = 0.0, 0.0
        if k + 1 == vertices or kind[k + 1] == BEGIN:
            continue
        aa, ab, bb, ua, ub = _normal_equations(floats, ints, bearings, k, again)
        pivot[k], right[k], cross[k] = d + aa, h + ua, ab
        d, h = bb - ab * ab / pivot[k], ub - ab * right[k] / pivot[k]
        if k + 2 == vertices or kind[k + 2] == BEGIN or kind[k + 1] > HELD:
            before[k + 1] = h / d
    for k in range(vertices - 1, 0, -1):
        if kind[k] == BEGIN:
            continue
        if kind[k] == HELD and k + 1 < vertices and kind[k + 1] != BEGIN:
            before[k] = after[k]
        after[k - 1] = (right[k - 1] - cross[k - 1] * before[k]) / pivot[k - 1]


@helper
def _normal_equations(floats, ints, bearings, k, again):
    """Sum up the normal equations of the line from a vertex to the next, in their inverse ranges.

    A reading at a vertex counts once: for the line before it, if both are held together.
    """
    at, kind, beam, rho = ints[STACK_FIRST], ints[STACK_LAST], ints[BEAM], floats[RHO]
    origin, end = beam[at[k]], beam[at[k + 1]]
    _, whole = _turn(bearings, origin, end)
    aa, ab, bb, ua, ub = 0.0, 0.0, 0.0, 0.0, 0.0
    low = at[k] if kind[k] == BEGIN or kind[k] == _AFTER else at[k] + 1
    high = at[k + 1] if kind[k + 1] == HELD or kind[k + 1] == _BEFORE else at[k + 1] - 1
    for i in range(low, high + 1):
        _, s = _turn(bearings, origin, beam[i])
        _, rest = _turn(bearings, beam[i], end)
        a, b, r = rest / whole, s / whole, rho[i]
        mapped = r
        if again:
            u = a * floats[U_AFTER, k] + b * floats[U_BEFORE, k + 1]
            mapped = 1.0 / u if u * r > 0.5 else 2.0 * r
        w = r * r * mapped * mapped
        aa, ab, bb = aa + w * a * a, ab + w * a * b, bb + w * b * b
        ua, ub = ua + w / r * a, ub + w / r * b
    return aa, ab, bb, ua, ub


@kernel
def hold_together(floats, ints, counts, row, segments, corners, offsets):
    """Let the segments of a scan end in the vertices of its polylines, and corners be there.

    Centroids move to the nearest point of the new line. Covariances and residuals remain those of
    the lines fitted each to its own readings.
    """
    x, y, segment, corner = floats[X], floats[Y], offsets[row, 0], offsets[row, 1]
    for k in range(counts[PIECES]):
        x1, y1, x2, y2 = x[ints[FIRST, k]], y[ints[FIRST, k]], x[ints[LAST, k]], y[ints[LAST, k]]
        angle = math.atan2(y2 - y1, x2 - x1)
        c, s = math.cos(angle), math.sin(angle)
        cx, cy = segments[segment, S_CENTROID], segments[segment, S_CENTROID + 1]
        along = c * (cx - x1) + s * (cy - y1)
        write_end(segments, segment, S_START, x1, y1)
        write_end(segments, segment, S_END, x2, y2)
        segments[segment, S_CENTROID] = x1 + along * c
        segments[segment, S_CENTROID + 1] = y1 + along * s
        segments[segment, S_ANGLE] = angle
        segment += 1
        if ints[BEFORE, k] >= 0:
            corners[corner, C_POSITION], corners[corner, C_POSITION + 1] = x1, y1
            corner += 1
