"""Step 5: neighbouring surfaces meet at a corner, or a cluster ends where one hides another."""

import math

import numpy as np

from .. import helper, inlined
from ...features import records as to
from ..writing import grade_corner, write_edge, write_end, write_opening, write_place
from . import layout as at
from .arcs import is_on
from .constants import BEND, LEAST, MOST_DEVIATION, REACH, SIGMAS, TAU
from .costs import joint_cost
from .merging import gap, surface_variance

#: Of two lines that have no corner.
_NONE = -1


@helper
def _distance(dx, dy):
    """Length of a vector: lengths here need not the care of `math.hypot`, a call."""
    return math.sqrt(dx * dx + dy * dy)


@helper
def around(i, n):
    """Return the number from 0 to n - 1 of what is at most once around more, or less."""
    if i < 0:
        return i + n
    return i - n if i >= n else i


@inlined
def join_all(work, tables, scan, surfaces):
    """Write the corners where surfaces meet, and the edges where they end."""
    spans = work.spans
    for k in range(surfaces):
        m, spans[at.CORNER, k] = around(k + 1, surfaces), _NONE
        if m > k or (scan.circular and m < k):
            _join(work, scan, k, m)
    # Lines meet over a lesser one that does not join them by two corners. What has no corner then
    # may have one over whatever shows through a slit.
    for slits in (False, True):
        for k in range(surfaces):
            m = around(k + 1, surfaces)
            n = around(m + 1, surfaces)
            lesser = spans[at.COUNT, m] < min(spans[at.COUNT, k], spans[at.COUNT, n])
            joins = spans[at.CORNER, k] == spans[at.CORNER, m] == to.SHARP
            free = not (spans[at.END, k] or spans[at.START, n])
            if free and (n > k or (scan.circular and n < k)) and (slits or (lesser and not joins)):
                _add_corner(work, tables, scan.row, k, n, _corner_over(work, scan, k, n))
        for k in range(surfaces):
            _add_corner(work, tables, scan.row, k, around(k + 1, surfaces), spans[at.CORNER, k])
    for k in range(surfaces):
        for way in (-1, 1):
            if spans[at.KIND, k] == at.LINE and not spans[at.END if way > 0 else at.START, k]:
                _add_edge(work, tables, scan, k, way)


@inlined
def _join(work, scan, k, m):
    """Join surface k to the next one, m, where they meet, or break the cluster between them."""
    points, beam, broken = work.points, work.beams[at.BEAM], work.beams[at.BROKEN]
    kinds, pieces = work.spans[at.KIND], work.pieces
    i, j = work.spans[at.LAST, k], work.spans[at.FIRST, m]
    joined = around(beam[j] - beam[i], scan.beams) - 1 <= scan.missing
    if joined and kinds[k] == at.ARC:
        joined = kinds[m] == at.LINE and is_on(points, pieces[k], j, work.noise, TAU)
    elif joined and kinds[m] == at.ARC:
        joined = is_on(points, pieces[m], i, work.noise, TAU)
    elif joined:
        joined, work.spans[at.CORNER, k] = _cross(work, scan, k, m)
    largest, step, whole, t = j, -1.0, True, i
    while t != j:
        before, t = t, t + 1 if t + 1 < scan.count else 0
        if joined:
            broken[t] = 0
        whole = whole and not broken[t]
        if abs(points[at.RHO, t] - points[at.RHO, before]) > step:
            largest, step = t, abs(points[at.RHO, t] - points[at.RHO, before])
    if whole and not joined:
        broken[largest] = 1


@inlined
def _corner_over(work, scan, k, m):
    """Kind of the corner of two lines that have another surface between them."""
    spans, x, y = work.spans, work.points[at.X], work.points[at.Y]
    i, j, kind = spans[at.LAST, k], spans[at.FIRST, m], np.int64(_NONE)
    near = _distance(x[i] - x[j], y[i] - y[j]) <= 2.0 * REACH
    if near and spans[at.KIND, k] == spans[at.KIND, m] == at.LINE:
        _, kind = _cross(work, scan, k, m)
    return kind


@inlined
def _cross(work, scan, k, m):
    """Whether two lines are one surface, and the kind of their corner.

    One that is hardly a turn stands out of the line through both by no less than a surface may.
    """
    p, q, kind = work.pieces[k], work.pieces[m], np.int64(_NONE)
    joined, meets, crosses = _meet(work, scan, k, m)
    turn = abs(p[at.UX] * q[at.UY] - p[at.UY] * q[at.UX])
    lengths = _length(work, k), _length(work, m)
    height = turn * lengths[0] * lengths[1] / (lengths[0] + lengths[1])
    bends = p[at.UX] * q[at.UX] + p[at.UY] * q[at.UY] > BEND
    if crosses and (height > SIGMAS * TAU or not bends) and _response(work, k, m) >= scan.evidence:
        kind = np.int64(to.SHARP if meets else to.SLIT)
    return joined, kind


@helper
def _length(work, k):
    """Distance between the first and the last measurement of a line."""
    x, y = work.points[at.X], work.points[at.Y]
    first, last = work.spans[at.FIRST, k], work.spans[at.LAST, k]
    return _distance(x[last] - x[first], y[last] - y[first])


@helper
def _response(work, k, m):
    """Rise of χ² if two lines were one."""
    first, last = work.spans[at.FIRST], work.spans[at.LAST]
    return joint_cost(work.sums, first[k], last[k] + 1, first[m], last[m] + 1)


@inlined
def _meet(work, scan, k, m):
    """Whether two neighbouring lines are one surface, whether they meet, and whether they cross.

    They meet where they cross between their facing measurements, or are no farther apart there
    than by chance, if no measurement between went on behind both. If not, a face at right angles to
    the nearer one may join them, which the beams at its end graze.
    """
    points, broken, p, q = work.points, work.beams[at.BROKEN], work.pieces[k], work.pieces[m]
    i, j = work.spans[at.LAST, k], work.spans[at.FIRST, m]
    x, y, rho = points[at.X], points[at.Y], points[at.RHO]
    nearer, e = (p, i) if rho[i] <= rho[j] else (q, j)
    error_i = SIGMAS * math.sqrt(surface_variance(points, i, work.noise))
    error_j = SIGMAS * math.sqrt(surface_variance(points, j, work.noise))
    error = max(error_i, error_j)
    between, unbroken, hole, t, depth = -1, True, False, i, 0.0
    while t != j:
        t = t + 1 if t + 1 < scan.count else 0
        between, unbroken = between + 1, unbroken and not broken[t]
        by_p, by_q = p[at.A] * x[t] + p[at.B] * y[t], q[at.A] * x[t] + q[at.B] * y[t]
        hole = hole or (t != j and rho[t] * (min(by_p, by_q) - 1.0) > error * min(by_p, by_q))
        if t != j or e == i:
            depth = max(depth, (by_p if e == i else by_q) - 1.0)
    if e == j:
        depth = max(depth, q[at.A] * x[i] + q[at.B] * y[i] - 1.0)
    step = gap(points, i, j, p[at.A] - q[at.A], p[at.B] - q[at.B])
    meets = between < LEAST and not hole and step * step <= error * error
    # Corners lie near the measurements on both sides, no farther than these have seen of their
    # lines, or within their spacing and its error.
    reach_i = _distance(x[i] - x[i - 1], y[i] - y[i - 1]) + error_i
    reach_j = _distance(x[j + 1] - x[j], y[j + 1] - y[j]) + error_j
    reach_i = max(min(REACH, _length(work, k)), reach_i)
    reach_j = max(min(REACH, _length(work, m)), reach_j)
    determinant = p[at.A] * q[at.B] - q[at.A] * p[at.B]
    inverse = 1.0 / determinant if determinant != 0.0 else math.nan
    cx, cy = (q[at.B] - p[at.B]) * inverse, (p[at.A] - q[at.A]) * inverse
    near = _distance(cx - x[i], cy - y[i]) <= reach_i and (
        _distance(cx - x[j], cy - y[j]) <= reach_j
    )
    beyond = (cx - p[at.CX]) * p[at.UX] + (cy - p[at.CY]) * p[at.UY] > 0.0 and (
        (cx - q[at.CX]) * q[at.UX] + (cy - q[at.CY]) * q[at.UY] < 0.0
    )
    crosses = near and beyond
    joined = meets and (crosses or _distance(x[i] - x[j], y[i] - y[j]) <= reach_i + reach_j)
    if not joined and unbroken and not hole:
        square = nearer[at.A] * nearer[at.A] + nearer[at.B] * nearer[at.B]
        bx, by = x[e] + depth * nearer[at.A] / square, y[e] + depth * nearer[at.B] / square
        face = (x[e] * by - y[e] * bx) / (rho[e] * _distance(bx, by)) * (1.0 if e == i else -1.0)
        beam = (x[i] * y[j] - y[i] * x[j]) / (rho[i] * rho[j] * (between + 1.0))
        joined = 0.5 * beam <= face <= (between + 3.0) * beam
    return joined, meets, crosses


@inlined
def _add_corner(work, tables, scan, k, m, kind):
    """Write the corner of two lines, Σ = A⁻¹ diag(s₁², s₂²) A⁻ᵀ, if their ends have none yet.

    Where they meet, their segments then end there.
    """
    spans, p, q = work.spans, work.pieces[k], work.pieces[m]
    if kind == _NONE or spans[at.END, k] or spans[at.START, m]:
        return
    inverse = 1.0 / (p[at.A] * q[at.B] - q[at.A] * p[at.B])
    x, y = (q[at.B] - p[at.B]) * inverse, (p[at.A] - q[at.A]) * inverse
    row = tables.offsets[scan + 1, to.CORNERS]
    segments, a, b = tables.segments, spans[at.SEGMENT, k], spans[at.SEGMENT, m]
    sine = p[at.UX] * q[at.UY] - p[at.UY] * q[at.UX]
    first, second = _variance_at(p, x, y) / (sine * sine), _variance_at(q, x, y) / (sine * sine)
    if not first + second <= MOST_DEVIATION * MOST_DEVIATION:
        return
    corners, ints = tables.corners, tables.corners.view(np.int32)
    write_place(corners, row, x, y, first, q[at.UX], q[at.UY], second, p[at.UX], p[at.UY])
    write_opening(segments, a, b, corners, ints, row)
    corners[row, to.C_RESPONSE] = _response(work, k, m)
    ints[row, to.C_BEAM] = work.beams[at.BEAM, spans[at.FIRST, m]]
    ints[row, to.C_SEGMENTS] = a - tables.offsets[scan, to.SEGMENTS]
    ints[row, to.C_SEGMENTS + 1] = b - tables.offsets[scan, to.SEGMENTS]
    grade_corner(corners, ints, row, kind, spans[at.COUNT, k], spans[at.COUNT, m])
    if kind == to.SHARP:
        write_end(segments, a, to.S_END, x, y)
        write_end(segments, b, to.S_START, x, y)
    spans[at.END, k] = spans[at.START, m] = 1
    tables.offsets[scan + 1, to.CORNERS] += 1


@helper
def _variance_at(piece, x, y):
    """Variance of the offset of a line at a point: that at its centroid, with the lever arm."""
    t = (x - piece[at.CX]) * piece[at.UX] + (y - piece[at.CY]) * piece[at.UY]
    return piece[at.OO] + 2.0 * t * piece[at.OA] + t * t * piece[at.AA]


@inlined
def _add_edge(work, tables, scan, k, way):
    """Write the edge at an end of line k, in direction `way`, if all is behind it for some beams.

    It lies beyond the last measurement on the line, by half a spacing.
    """
    points, spans, noise, p = work.points, work.spans, work.noise, work.pieces[k]
    x, y, rho, beam = points[at.X], points[at.Y], points[at.RHO], work.beams[at.BEAM]
    i, count, n = spans[at.LAST if way > 0 else at.FIRST, k], scan.count, scan.beams
    jump = math.inf
    for ahead in range(1, LEAST + 1):
        t = around(i + way * ahead, count) if scan.circular else i + way * ahead
        if 0 <= t < count:
            jump = min(jump, rho[t] - rho[i])
    next_beam = beam[around(i + way, count)]
    hides = SIGMAS * math.sqrt(surface_variance(points, i, noise)) < jump < math.inf
    if not hides or around(way * (next_beam - beam[i]), n) - 1 > scan.missing:
        return
    ux, uy = way * p[at.UX], way * p[at.UY]
    # The spacing is that of the beams on the line: bearings are better known than ranges.
    here, before = p[at.A] * x[i] + p[at.B] * y[i], p[at.A] * x[i - way] + p[at.B] * y[i - way]
    dx, dy = x[i] / here - x[i - way] / before, y[i] / here - y[i - way] / before
    spacing = abs(ux * dx + uy * dy) / around(way * (beam[i] - beam[i - way]), n)
    along = ux * (x[i] - p[at.CX]) + uy * (y[i] - p[at.CY]) + 0.5 * spacing
    sine = (ux * x[i] + uy * y[i]) / rho[i]
    px, py = p[at.CX] + along * ux, p[at.CY] + along * uy
    across, lengthwise = _variance_at(p, px, py), spacing * spacing / 12.0
    lengthwise += (noise[0] + noise[1] * rho[i] * rho[i]) * sine * sine
    if across + lengthwise > MOST_DEVIATION * MOST_DEVIATION:
        return
    edges, segment, row = tables.edges, spans[at.SEGMENT, k], tables.offsets[scan.row + 1, to.EDGES]
    write_end(tables.segments, segment, to.S_END if way > 0 else to.S_START, px, py)
    write_place(edges, row, px, py, lengthwise, ux, uy, across, -uy, ux)
    prominence = jump * abs(ux * y[i] - uy * x[i]) / (rho[i] * math.sqrt(max(lengthwise, across)))
    prominence *= spans[at.COUNT, k]
    segment -= tables.offsets[scan.row, to.SEGMENTS]
    side = np.int64(to.AT_END if way > 0 else to.AT_START)
    write_edge(beam[i], segment, side, prominence, edges, edges.view(np.int32), row)
    tables.offsets[scan.row + 1, to.EDGES] += 1
