"""Vertices of maps placed: lines held together there, or free to meet beside a measurement.

The inverse ranges at the vertices follow from tridiagonal normal equations.
"""

import math

import numpy as np

from ..features import records as col
from . import helper, kernel
from .arrays import Floats2, Ints2
from . import layout as at
from .rays import turn
from .writing import write_end, write_opening

#: How a vertex belongs to the one before: it begins a polyline; its two lines are held together on
#: its ray; or they are free to meet beside it, and its measurement is on neither as long as it is
#: open on which, or on the line after it, or on that before.
BEGIN, HELD, _OPEN, _AFTER, _BEFORE = 0, 1, 2, 3, 4
#: Points between the vertices of a line that is free.
_ENOUGH = 3
#: A vertex at 10⁹ times the range of its measurement, or behind the scanner, is put on that.
_FAR = 1e-9


@helper
def place_vertices(work, bearings, count):
    """Place the vertices listed (BEGIN or HELD); the lines between them become the pieces.

    X and Y of their points become those of the vertices.
    """
    counts = work.counts
    ring = counts[at.CLOSED] != 0 and _closes(work, count)
    _settle(work, bearings, count, ring)
    _move_points(work, bearings, count, ring)
    counts[at.PIECES] = _list_pieces(work, count, ring)


@helper
def _closes(work, count):
    """Whether polylines begin at the first point of a closed cluster, and end there again."""
    point, kind = work.vertices[at.AT], work.vertices[at.KIND]
    if count < 3 or point[0] != 0 or point[count - 1] != work.counts[at.POINTS] - 1:
        return False
    return kind[1] != BEGIN and kind[count - 1] != BEGIN


@helper
def _list_pieces(work, count, ring):
    """List the lines from vertex to vertex as pieces. Returns their number."""
    point, kind, n = work.vertices[at.AT], work.vertices[at.KIND], np.int64(0)
    pieces, response = work.pieces, work.response
    for k in range(1, count):
        if kind[k] == BEGIN:
            continue
        pieces[at.FIRST, n], pieces[at.LAST, n], response[n] = point[k - 1], point[k], 0.0
        pieces[at.BEFORE, n] = -1 if k == 1 or kind[k - 1] == BEGIN else n - 1
        n += 1
    if ring:
        pieces[at.BEFORE, 0] = n - 1
    return n


@helper
def _settle(work, bearings, count, ring):
    """Find the lines: held together at first, then free where they meet beside a measurement.

    The two ends of a ring are one vertex, and free from the start.
    """
    point, kind = work.vertices[at.AT], work.vertices[at.KIND]
    end = count if ring else count - 1
    for step in range(4):
        _solve(work, bearings, count, step > 0)
        for k in range(1, end if step < 3 else 1):
            m = _leaves(k, count)
            if kind[k] == BEGIN or kind[m + 1] == BEGIN:
                continue
            if step == 0 and min(point[k] - point[k - 1], point[m + 1] - point[m]) > _ENOUGH:
                kind[k] = _OPEN
            elif kind[k] != HELD:
                tangent, _ = _meeting(work, bearings, k, m)
                kind[k] = _BEFORE if tangent > 0.0 else HELD if math.isnan(tangent) else _AFTER
        if ring:
            kind[0] = kind[count - 1] if kind[count - 1] > HELD else BEGIN


@helper
def _leaves(k, count):
    """Vertex from which the line after the k-th goes on: that which begins a ring, at its end."""
    return np.int64(0) if k + 1 == count else k


@helper
def _move_points(work, bearings, count, ring):
    """Move the points of the vertices to where their lines meet, or end."""
    point, kind = work.vertices[at.AT], work.vertices[at.KIND]
    before, after = work.rays[at.U_BEFORE], work.rays[at.U_AFTER]
    x, y = work.points[at.X], work.points[at.Y]
    for k in range(count):
        i, b, tangent = point[k], work.marks[at.BEAM, point[k]], 0.0
        m = _leaves(k, count)
        begins = k == 0 or kind[k] == BEGIN
        if begins:
            u = after[k]
        elif kind[m + 1] == BEGIN or (m != k and not ring):
            u = before[k]
        else:
            tangent, u = _meeting(work, bearings, k, m)
            if kind[k] == HELD or math.isnan(tangent):
                tangent, u = 0.0, 0.5 * (before[k] + after[m])
        if not u * work.points[at.RHO, i] > _FAR:
            u, tangent = 1.0 / work.points[at.RHO, i], 0.0
        x[i] = (bearings[0, b] - tangent * bearings[1, b]) / u
        y[i] = (bearings[1, b] + tangent * bearings[0, b]) / u
    if ring:
        x[point[0]], y[point[0]] = x[point[count - 1]], y[point[count - 1]]


@helper
def _meeting(work, bearings, k, m):
    """Where the lines that come to vertex k and leave m, on the same ray, meet.

    Tangent of the angle from that ray, and 1/ρ times its cosine; NaN if they do not meet between
    the measurements next to it.
    """
    point, beam = work.vertices[at.AT], work.marks[at.BEAM]
    before, after = work.rays[at.U_BEFORE], work.rays[at.U_AFTER]
    b = beam[point[k]]
    c, s = turn(bearings, b, beam[point[k - 1]])
    slope = (after[k - 1] - before[k] * c) / s
    c, s = turn(bearings, b, beam[point[m + 1]])
    bend = (before[m + 1] - after[m] * c) / s - slope
    if bend == 0.0:
        return math.nan, math.nan
    tangent = (before[k] - after[m]) / bend
    c1, s1 = turn(bearings, b, beam[point[k] - 1])
    c2, s2 = turn(bearings, b, beam[point[m] + 1])
    if not s1 < tangent * c1 or not tangent * c2 < s2:
        return math.nan, math.nan
    return tangent, before[k] + slope * tangent


@helper
def _solve(work, bearings, count, again):
    """Inverse range of the line before each vertex (U_BEFORE) and of that after it (U_AFTER).

    Of least squared range errors; with weights from the lines that are there, if `again`.
    """
    kind, rays = work.vertices[at.KIND], work.rays
    before, after = rays[at.U_BEFORE], rays[at.U_AFTER]
    pivot, right, cross = rays[at.PIVOT], rays[at.RIGHT], rays[at.CROSS]
    d, h = 0.0, 0.0
    for k in range(count):
        if kind[k] == BEGIN or kind[k] > HELD:
            d, h = 0.0, 0.0
        if k + 1 == count or kind[k + 1] == BEGIN:
            continue
        aa, ab, bb, ua, ub = _normal_equations(work, bearings, k, again)
        pivot[k], right[k], cross[k] = d + aa, h + ua, ab
        d, h = bb - ab * ab / pivot[k], ub - ab * right[k] / pivot[k]
        if k + 2 == count or kind[k + 2] == BEGIN or kind[k + 1] > HELD:
            before[k + 1] = h / d
    for k in range(count - 1, 0, -1):
        if kind[k] == BEGIN:
            continue
        if kind[k] == HELD and k + 1 < count and kind[k + 1] != BEGIN:
            before[k] = after[k]
        after[k - 1] = (right[k - 1] - cross[k - 1] * before[k]) / pivot[k - 1]


@helper
def _normal_equations(work, bearings, k, again):
    """Sum up the normal equations of the line from a vertex to the next, in their inverse ranges.

    A measurement at a vertex counts once: for the line before it, if both are held together.
    """
    point, kind = work.vertices[at.AT], work.vertices[at.KIND]
    beam, rho = work.marks[at.BEAM], work.points[at.RHO]
    origin, end = beam[point[k]], beam[point[k + 1]]
    _, whole = turn(bearings, origin, end)
    aa, ab, bb, ua, ub = 0.0, 0.0, 0.0, 0.0, 0.0
    low = point[k] if kind[k] == BEGIN or kind[k] == _AFTER else point[k] + 1
    high = point[k + 1] if kind[k + 1] == HELD or kind[k + 1] == _BEFORE else point[k + 1] - 1
    for i in range(low, high + 1):
        _, s = turn(bearings, origin, beam[i])
        _, rest = turn(bearings, beam[i], end)
        a, b, r = rest / whole, s / whole, rho[i]
        mapped = r
        if again:
            u = a * work.rays[at.U_AFTER, k] + b * work.rays[at.U_BEFORE, k + 1]
            mapped = 1.0 / u if u * r > 0.5 else 2.0 * r
        w = r * r * mapped * mapped
        aa, ab, bb = aa + w * a * a, ab + w * a * b, bb + w * b * b
        ua, ub = ua + w / r * a, ub + w / r * b
    return aa, ab, bb, ua, ub


@kernel
def hold_together(
    floats: Floats2,
    ints: Ints2,
    row: int,
    segments: Floats2,
    corners: Floats2,
    offsets: Ints2,
):
    """Let the segments of a scan end in the vertices of its polylines, and corners be there.

    Centroids move to the nearest point of the new segment. Covariances and residuals remain those
    of the lines fitted each to its own measurements.
    """
    work = at.named(floats, ints)
    pieces, x, y = work.pieces, work.points[at.X], work.points[at.Y]
    before, begin = pieces[at.BEFORE], offsets[row, col.SEGMENTS]
    corner = offsets[row, col.CORNERS]
    for k in range(work.counts[at.PIECES]):
        first, last, segment = pieces[at.FIRST, k], pieces[at.LAST, k], begin + k
        x1, y1, x2, y2 = x[first], y[first], x[last], y[last]
        angle = math.atan2(y2 - y1, x2 - x1)
        c, s = math.cos(angle), math.sin(angle)
        cx, cy = segments[segment, col.S_CENTROID], segments[segment, col.S_CENTROID + 1]
        length = math.hypot(x2 - x1, y2 - y1)
        along = min(max(c * (cx - x1) + s * (cy - y1), 0.0), length)
        write_end(segments, segment, col.S_START, x1, y1)
        write_end(segments, segment, col.S_END, x2, y2)
        segments[segment, col.S_CENTROID] = x1 + along * c
        segments[segment, col.S_CENTROID + 1] = y1 + along * s
        segments[segment, col.S_ANGLE] = angle
    for k in range(work.counts[at.PIECES]):
        if before[k] >= 0:
            i = pieces[at.FIRST, k]
            corners[corner, col.C_POSITION], corners[corner, col.C_POSITION + 1] = x[i], y[i]
            write_opening(
                segments, begin + before[k], begin + k, corners, corners.view(np.int32), corner
            )
            corner += 1
