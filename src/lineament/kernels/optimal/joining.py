"""Step 5: neighbouring surfaces meet at a corner, or a cluster ends where one hides another."""

import math

import numpy as np

from .. import helper
from ...features.records import (
    C_BEAM, C_CONVEX, C_OPENING, C_RESPONSE, C_SEGMENTS, S_END, S_START, SHARP, SLIT,
)  # fmt: skip
from ..writing import grade_corner, grade_edge, write_opening, write_place
from .arcs import is_on
from .constants import LEAST, MOST_DEVIATION, REACH, SIGMAS, TAU
from .layout import (
    A, AA, ARC, B, BEAM, BROKEN, COUNT, CX, CY, END, FIRST, KIND, LAST, LINE, OA, OO, RHO, SEGMENT,
    START, UX, UY, X, Y,
)  # fmt: skip
from .partition import gap, joint_cost, surface_variance


@helper
def join(
    points, beams, spans, pieces, sums, k, m, count, n, missing, noise, segments, corners, row,
    base, evidence,
):  # fmt: skip
    """Join surface k to the next one, m, where they meet, or break the cluster between them.

    The scan's own segments begin at row `base`. Returns the number of the next row of `corners`.
    """
    broken, i, j = beams[BROKEN], spans[LAST, k], spans[FIRST, m]
    joined = (beams[BEAM, j] - beams[BEAM, i]) % n - 1 <= missing
    if joined and spans[KIND, k] == ARC:
        joined = spans[KIND, m] == LINE and is_on(points, pieces[k], j, noise, TAU)
    elif joined and spans[KIND, m] == ARC:
        joined = is_on(points, pieces[m], i, noise, TAU)
    elif joined:
        joined, row = cross(
            points, beams, spans, pieces, sums, k, m, count, noise, segments, corners, row, base,
            evidence,
        )  # fmt: skip
    at, step, whole, t = j, -1.0, True, i
    while t != j:
        before, t = t, t + 1 if t + 1 < count else 0
        if joined:
            broken[t] = 0
        whole = whole and not broken[t]
        if abs(points[RHO, t] - points[RHO, before]) > step:
            at, step = t, abs(points[RHO, t] - points[RHO, before])
    if whole and not joined:
        broken[at] = 1
    return row


@helper
def cross(
    points, beams, spans, pieces, sums, k, m, count, noise, segments, corners, row, base, evidence
):
    """Write the corner of two lines, if there is one.

    Returns whether they are one surface, and the number of the next row of `corners`.
    """
    i, j = spans[LAST, k], spans[FIRST, m]
    joined, meets, x, y = _meet(points, beams, spans, pieces, k, m, count, noise)
    kind = np.int64(SHARP if meets else SLIT)
    rise = joint_cost(sums, spans[FIRST, k], i + 1, j, spans[LAST, m] + 1) if x == x else 0.0
    known = x == x and rise >= evidence
    if known and _add_corner(spans, pieces, k, m, x, y, kind, segments, corners, row, base):
        corners[row, C_RESPONSE], corners.view(np.int32)[row, C_BEAM] = rise, beams[BEAM, j]
        row += 1
    return joined, row


@helper
def are_near(points, spans, k, m):
    """Whether two surfaces are lines that end so near to each other that both reach a corner."""
    dx = points[X, spans[LAST, k]] - points[X, spans[FIRST, m]]
    dy = points[Y, spans[LAST, k]] - points[Y, spans[FIRST, m]]
    near = dx * dx + dy * dy <= 4.0 * REACH * REACH
    return near and spans[KIND, k] == spans[KIND, m] == LINE


@helper
def _meet(points, beams, spans, pieces, k, m, count, noise):
    """Whether two neighbouring lines are one surface, whether they meet, and where (NaN: nowhere).

    They meet where they cross between their facing measurements, or are no farther apart there
    than by chance, if no measurement between went on behind both. If not, a face at right angles to
    the nearer one may join them, which the beams at its end graze.
    """
    i, j, p, q = spans[LAST, k], spans[FIRST, m], pieces[k], pieces[m]
    x, y, rho = points[X], points[Y], points[RHO]
    nearer, e, far = (p, i, j) if rho[i] <= rho[j] else (q, j, i)
    variance = surface_variance(points, far, noise)
    error = SIGMAS * math.sqrt(variance)
    between, unbroken, hole, t, depth = -1, True, False, i, 0.0
    while t != j:
        t = t + 1 if t + 1 < count else 0
        between, unbroken = between + 1, unbroken and not beams[BROKEN, t]
        by_p, by_q = p[A] * x[t] + p[B] * y[t], q[A] * x[t] + q[B] * y[t]
        hole = hole or (t != j and rho[t] * (min(by_p, by_q) - 1.0) > error * min(by_p, by_q))
        if t != j or e == i:
            depth = max(depth, (by_p if e == i else by_q) - 1.0)
    if e == j:
        depth = max(depth, q[A] * x[i] + q[B] * y[i] - 1.0)
    step = gap(points, i, j, p[A] - q[A], p[B] - q[B])
    meets = between < LEAST and not hole and step * step <= error * error
    # Corners lie near the measurements on both sides, or within their spacing and its error.
    reach_i = max(REACH, math.hypot(x[i] - x[i - 1], y[i] - y[i - 1]) + error)
    reach_j = max(REACH, math.hypot(x[j + 1] - x[j], y[j + 1] - y[j]) + error)
    determinant = p[A] * q[B] - q[A] * p[B]
    inverse = 1.0 / determinant if determinant != 0.0 else math.nan
    cx, cy = (q[B] - p[B]) * inverse, (p[A] - q[A]) * inverse
    near = math.hypot(cx - x[i], cy - y[i]) <= reach_i and (
        math.hypot(cx - x[j], cy - y[j]) <= reach_j
    )
    beyond = (cx - p[CX]) * p[UX] + (cy - p[CY]) * p[UY] > 0.0 and (
        (cx - q[CX]) * q[UX] + (cy - q[CY]) * q[UY] < 0.0
    )
    if not (near and beyond):
        cx, cy = math.nan, math.nan
    joined = meets and (cx == cx or math.hypot(x[i] - x[j], y[i] - y[j]) <= reach_i + reach_j)
    if not joined and unbroken and not hole:
        square = nearer[A] * nearer[A] + nearer[B] * nearer[B]
        bx, by = x[e] + depth * nearer[A] / square, y[e] + depth * nearer[B] / square
        face = (x[e] * by - y[e] * bx) / (rho[e] * math.hypot(bx, by)) * (1.0 if e == i else -1.0)
        beam = (x[i] * y[j] - y[i] * x[j]) / (rho[i] * rho[j] * (between + 1.0))
        joined = 0.5 * beam <= face <= (between + 3.0) * beam
    return joined, meets, cx, cy


@helper
def _add_corner(spans, pieces, k, m, x, y, kind, segments, corners, row, base):
    """Write the corner of two lines at (x, y), Σ = A⁻¹ diag(s₁², s₂²) A⁻ᵀ, if it is known so well.

    Where they meet, their segments then end there.
    """
    p, q, a, b = pieces[k], pieces[m], spans[SEGMENT, k], spans[SEGMENT, m]
    sine = p[UX] * q[UY] - p[UY] * q[UX]
    first, second = _variance_at(p, x, y) / (sine * sine), _variance_at(q, x, y) / (sine * sine)
    if not first + second <= MOST_DEVIATION * MOST_DEVIATION:
        return False
    ints = corners.view(np.int32)
    write_place(corners, row, x, y, first, q[UX], q[UY], second, p[UX], p[UY])
    write_opening(segments, a, b, corners, ints, row)
    ints[row, C_SEGMENTS], ints[row, C_SEGMENTS + 1] = a - base, b - base
    grade_corner(corners, ints, row, kind, spans[COUNT, k], spans[COUNT, m])
    if kind == SHARP:
        segments[a, S_END], segments[a, S_END + 1] = x, y
        segments[b, S_START], segments[b, S_START + 1] = x, y
    spans[END, k] = spans[START, m] = 1
    return True


@helper
def _variance_at(piece, x, y):
    """Variance of the offset of a line at a point: that at its centroid, with the lever arm."""
    t = (x - piece[CX]) * piece[UX] + (y - piece[CY]) * piece[UY]
    return piece[OO] + 2.0 * t * piece[OA] + t * t * piece[AA]


@helper
def add_edge(
    points, beams, spans, pieces, k, way, count, n, circular, missing, noise, segments, corners,
    row, base,
):  # fmt: skip
    """Write the edge at an end of line k, in direction `way`, if all is behind it for some beams.

    It lies beyond the last measurement on the line, by half a spacing. Returns the number of the
    next row of `corners`.
    """
    x, y, rho, beam, p = points[X], points[Y], points[RHO], beams[BEAM], pieces[k]
    i, a = spans[LAST, k] if way > 0 else spans[FIRST, k], spans[SEGMENT, k]
    jump = math.inf
    for ahead in range(1, LEAST + 1):
        t = (i + way * ahead) % count if circular else i + way * ahead
        if 0 <= t < count:
            jump = min(jump, rho[t] - rho[i])
    next_beam = beam[(i + way) % count]
    hides = SIGMAS * math.sqrt(surface_variance(points, i, noise)) < jump < math.inf
    if not hides or (way * (next_beam - beam[i])) % n - 1 > missing:
        return row
    ux, uy = way * p[UX], way * p[UY]
    # The spacing is that of the beams on the line: bearings are better known than ranges.
    here, before = p[A] * x[i] + p[B] * y[i], p[A] * x[i - way] + p[B] * y[i - way]
    dx, dy = x[i] / here - x[i - way] / before, y[i] / here - y[i - way] / before
    spacing = abs(ux * dx + uy * dy) / ((way * (beam[i] - beam[i - way])) % n)
    along = ux * (x[i] - p[CX]) + uy * (y[i] - p[CY]) + 0.5 * spacing
    sine = (ux * x[i] + uy * y[i]) / rho[i]
    px, py = p[CX] + along * ux, p[CY] + along * uy
    across, lengthwise = _variance_at(p, px, py), spacing * spacing / 12.0
    lengthwise += (noise[0] + noise[1] * rho[i] * rho[i]) * sine * sine
    if across + lengthwise > MOST_DEVIATION * MOST_DEVIATION:
        return row
    ints, at = corners.view(np.int32), S_END if way > 0 else S_START
    segments[a, at], segments[a, at + 1] = px, py
    write_place(corners, row, px, py, lengthwise, ux, uy, across, -uy, ux)
    corners[row, C_OPENING], corners[row, C_RESPONSE] = 0.0, 0.0
    ints[row, C_CONVEX], ints[row, C_BEAM] = 1, beam[i]
    ints[row, C_SEGMENTS] = a - base if way > 0 else -1
    ints[row, C_SEGMENTS + 1] = a - base if way < 0 else -1
    prominence = jump * abs(ux * y[i] - uy * x[i]) / (rho[i] * math.sqrt(max(lengthwise, across)))
    grade_edge(corners, ints, row, spans[COUNT, k] * prominence)
    return row + 1
