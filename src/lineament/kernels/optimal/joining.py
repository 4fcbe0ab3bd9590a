"""Step 5: neighbouring surfaces meet at a corner, or a cluster ends where one hides another."""

import math

import numpy as np

from .. import inlined
from ...features import records as to
from ..writing import grade_corner, write_edge, write_end, write_opening, write_place
from . import layout as at
from .arcs import is_on
from .constants import LEAST, MOST_DEVIATION, REACH, SIGMAS, TAU, UNIFORM
from .geometry import (
    along, around, crossing, distance, missing, over, range_variance, surface_variance, variance_at,
)  # fmt: skip
from .meeting import NO_CORNER, meet, response


@inlined
def join_all(work, tables, scan, surfaces):
    """Write the corners where surfaces meet, and the edges where they end."""
    spans = work.spans
    for k in range(surfaces):
        m, spans[at.CORNER, k] = around(k + 1, surfaces), NO_CORNER
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
    joined = missing(beam[i], beam[j], scan.beams) <= scan.missing
    if joined and kinds[k] == at.ARC:
        joined = kinds[m] == at.LINE and is_on(points, pieces[k], j, work.noise, TAU)
    elif joined and kinds[m] == at.ARC:
        joined = is_on(points, pieces[m], i, work.noise, TAU)
    elif joined:
        joined, work.spans[at.CORNER, k] = meet(work, scan, k, m)
    largest, step, whole, t = j, -1.0, True, i
    while t != j:
        before, t = t, around(t + 1, scan.count)
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
    i, j, kind = spans[at.LAST, k], spans[at.FIRST, m], np.int64(NO_CORNER)
    near = distance(x[i] - x[j], y[i] - y[j]) <= 2.0 * REACH
    if near and spans[at.KIND, k] == spans[at.KIND, m] == at.LINE:
        _, kind = meet(work, scan, k, m)
    return kind


@inlined
def _add_corner(work, tables, scan, k, m, kind):
    """Write the corner of two lines, Σ = A⁻¹ diag(s₁², s₂²) A⁻ᵀ, if their ends have none yet.

    Where they meet, their segments then end there.
    """
    spans, p, q = work.spans, work.pieces[k], work.pieces[m]
    if kind == NO_CORNER or spans[at.END, k] or spans[at.START, m]:
        return
    x, y = crossing(p, q)
    row = tables.offsets[scan + 1, to.CORNERS]
    segments, a, b = tables.segments, spans[at.SEGMENT, k], spans[at.SEGMENT, m]
    sine = p[at.UX] * q[at.UY] - p[at.UY] * q[at.UX]
    first, second = variance_at(p, x, y) / (sine * sine), variance_at(q, x, y) / (sine * sine)
    if not first + second <= MOST_DEVIATION * MOST_DEVIATION:
        return
    corners, ints = tables.corners, tables.corners.view(np.int32)
    write_place(corners, row, x, y, first, q[at.UX], q[at.UY], second, p[at.UX], p[at.UY])
    write_opening(segments, a, b, corners, ints, row)
    corners[row, to.C_RESPONSE] = response(work, k, m)
    ints[row, to.C_BEAM] = work.beams[at.BEAM, spans[at.FIRST, m]]
    ints[row, to.C_SEGMENTS] = a - tables.offsets[scan, to.SEGMENTS]
    ints[row, to.C_SEGMENTS + 1] = b - tables.offsets[scan, to.SEGMENTS]
    grade_corner(corners, ints, row, kind, spans[at.COUNT, k], spans[at.COUNT, m])
    if kind == to.SHARP:
        write_end(segments, a, to.S_END, x, y)
        write_end(segments, b, to.S_START, x, y)
    spans[at.END, k] = spans[at.START, m] = 1
    tables.offsets[scan + 1, to.CORNERS] += 1


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
    here, before = over(p, points, i), over(p, points, i - way)
    dx, dy = x[i] / here - x[i - way] / before, y[i] / here - y[i - way] / before
    spacing = abs(ux * dx + uy * dy) / around(way * (beam[i] - beam[i - way]), n)
    beyond = way * along(p, x[i], y[i]) + 0.5 * spacing
    sine = (ux * x[i] + uy * y[i]) / rho[i]
    px, py = p[at.CX] + beyond * ux, p[at.CY] + beyond * uy
    across, lengthwise = variance_at(p, px, py), spacing * spacing / UNIFORM
    lengthwise += range_variance(points, i, noise) * sine * sine
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
