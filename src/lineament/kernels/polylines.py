"""Polylines through the points of a scan: at most so many vertices, and the least range error.

On the ray of each vertex its inverse range is free. Between two vertices the inverse range is then
linear in theirs, whatever the direction of the line, and that of all vertices follows from
tridiagonal normal equations: neighbours are fitted held together. Which points are vertices is
found by dynamic programming, where what is best so far is a parabola in the last inverse range.
"""

import math

import numpy as np

from . import helper, kernel
from .layout import (
    BEAM,
    BEFORE,
    COST,
    FIRST,
    JOINT_COST,
    LABEL,
    LAST,
    LINE_A,
    LINE_B,
    PIECES,
    POINTS,
    RESPONSE,
    RHO,
    RISE,
    STACK_FIRST,
    STACK_LAST,
    X,
    Y,
)
from .records import C_POSITION, S_ANGLE, S_CENTROID, S_END, S_RMS, S_START

#: How a vertex belongs to the one before: it begins a polyline; its two lines are held together on
#: its ray; or they are free to meet beside it, and its reading is on neither as long as it is open
#: on which, or on the line after it, or on that before.
_BEGIN, _HELD, _OPEN, _AFTER, _BEFORE = 0, 1, 2, 3, 4
#: Points between the vertices of a line that is free.
_ENOUGH = 3
#: Planes of the tables of costs, by point and number of vertices: of the best polylines that come
#: to a vertex there, curvature, place and value of their least cost; and the least cost of all
#: points before it.
CURVATURE, PLACE, LEAST, CLOSED_COST = 0, 1, 2, 3
PLANES = 4


@kernel
def fit_polylines(floats, ints, counts, bearings, budget, max_missing, link, worst, costs, follow):
    """Lay polylines of at most `budget` vertices in all through the points of a scan.

    Such that Σ (error of the range)² over the points of polylines, and `worst`² for each other
    point, is the least. Vertices lie on the rays of readings, but where two lines of enough points
    meet beside one. They become X and Y of their points, the lines between them the pieces.

    Parameters
    ----------
    floats, ints, counts
        See `layout`. BEAM, RHO, X, Y, LABEL and POINTS are read, lines by piece rewritten.
    bearings : float64 array, shape (2, n)
        Cosines and sines.
    budget : int
        At least 1.
    max_missing : int
        Missing beams in a row that a polyline goes over.
    link : float
        How far apart two neighbouring points of a polyline may be [m].
    worst : float
        Error of a range from which on a point is better left out than explained [m].
    costs : float64 array, shape (PLANES, n + 2, budget + 1)
    follow : int64 array, shape (n + 2, budget + 1)
        Scratch.
    """
    points, least, closed = counts[POINTS], costs[LEAST], costs[CLOSED_COST]
    for v in range(budget + 1):
        closed[0, v] = 0.0
        for i in range(points):
            least[i, v] = math.inf
    for i in range(points):
        for v in range(budget + 1):
            closed[i + 1, v] = min(closed[i, v] + worst * worst, least[i, v])
        _extend(floats, ints, bearings, i, points, budget, max_missing, link, worst, costs, follow)
    vertices = _list_vertices(ints, points, budget, worst * worst, costs, follow)
    _place(floats, ints, bearings, vertices)
    pieces = 0
    at, kind = ints[STACK_FIRST], ints[STACK_LAST]
    for k in range(1, vertices):
        if kind[k] != _BEGIN:
            ints[FIRST, pieces], ints[LAST, pieces] = at[k - 1], at[k]
            ints[BEFORE, pieces] = -1 if kind[k - 1] == _BEGIN else pieces - 1
            floats[RESPONSE, pieces] = math.nan
            pieces += 1
    counts[PIECES] = pieces


@helper
def _extend(floats, ints, bearings, i, points, budget, max_missing, link, worst, costs, follow):
    """Lay lines from a vertex at point i to each later point that is linked with it."""
    rho, beam, cosines, sines = floats[RHO], ints[BEAM], bearings[0], bearings[1]
    origin, price = beam[i], worst * worst
    cc, cs, ss, uc, us, uu = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(i + 1, points):
        b = beam[j]
        # Bearings are taken from the first point: the sums are well conditioned anywhere.
        c = cosines[b] * cosines[origin] + sines[b] * sines[origin]
        s = sines[b] * cosines[origin] - cosines[b] * sines[origin]
        if s <= 0.0 or not _linked(floats, beam, j, len(cosines), max_missing, link):
            return
        inner, determinant = j - i - 1, cc * ss - cs * cs
        alone = 0.0
        if inner > 2:
            alone = uu - (ss * uc * uc - 2.0 * cs * uc * us + cc * us * us) / determinant
        # The residual of the inverse range times ρ² is the error of the range.
        w, u = rho[j] ** 4, 1.0 / rho[j]
        cc, cs, ss = cc + w * c * c, cs + w * c * s, ss + w * s * s
        uc, us, uu = uc + w * u * c, us + w * u * s, uu + w * u * u
        if alone > price * inner:
            continue  # No more vertices are needed to leave these points out.
        # By the inverse ranges p and q at both ends the squared error is
        # aa p² + 2 ab p q + bb q² - 2 ua p - 2 ub q + uu.
        ratio = c / s
        aa, ab, bb = cc - 2.0 * ratio * cs + ratio * ratio * ss, (cs - ratio * ss) / s, ss / (s * s)
        _lay(costs, follow, rho[i], i, j, budget, aa, ab, bb, uc - ratio * us, us / s, uu)


@helper
def _linked(floats, beam, j, beams, max_missing, link):
    """Whether a polyline may go on from the point before to this one."""
    dx, dy = floats[X, j] - floats[X, j - 1], floats[Y, j] - floats[Y, j - 1]
    return (beam[j] - beam[j - 1] - 1) % beams <= max_missing and dx * dx + dy * dy <= link * link


@helper
def _lay(costs, follow, rho, i, j, budget, aa, ab, bb, ua, ub, uu):
    """Lay a line from vertex i to j, where a polyline begins at i or goes on there."""
    curvature, place, least, closed = costs[CURVATURE], costs[PLACE], costs[LEAST], costs[CLOSED_COST]
    w, u = rho**4, 1.0 / rho
    first, steep_first, q_first = _least_over(w, w * u, aa, ab, bb, ua, ub)
    first += w * u * u + uu
    for v in range(2, min(budget, i + 2) + 1):
        total, steep, q, before = closed[i, v - 2] + first, steep_first, q_first, -1 - i
        if least[i, v - 1] < math.inf:
            w, u = curvature[i, v - 1], place[i, v - 1]
            rise, steep_on, q_on = _least_over(w, w * u, aa, ab, bb, ua, ub)
            rise += w * u * u + uu
            if least[i, v - 1] + rise < total:
                total, steep, q, before = least[i, v - 1] + rise, steep_on, q_on, i
        if total < least[j, v]:
            least[j, v], curvature[j, v], place[j, v], follow[j, v] = total, steep, q, before


@helper
def _least_over(w, wu, aa, ab, bb, ua, ub):
    """Least of (aa + w) p² + 2 ab p q + bb q² - 2 (ua + wu) p - 2 ub q over p, as a parabola in q.

    Returns its least, its curvature, and where it is. A line that passes a ray behind the sensor
    costs infinitely much.
    """
    a, b = w + aa, wu + ua
    steep, slope = bb - ab * ab / a, ub - ab * b / a
    if steep <= 0.0 or slope <= 0.0 or b * steep <= ab * slope:
        return math.inf, 1.0, 1.0
    q = slope / steep
    return -b * b / a - slope * q, steep, q


@helper
def _list_vertices(ints, points, budget, price, costs, follow):
    """List the points that are vertices, as the tables tell. Returns their number."""
    least, closed = costs[LEAST], costs[CLOSED_COST]
    at, kind = ints[STACK_FIRST], ints[STACK_LAST]
    i, v, n = points, np.int64(0), np.int64(0)
    for k in range(budget + 1):
        if closed[points, k] < closed[points, v]:
            v = np.int64(k)
    while i > 0:
        i -= 1
        if closed[i + 1, v] == closed[i, v] + price:
            continue
        goes_on = True
        while goes_on:
            at[n], kind[n] = i, _HELD
            goes_on, i = follow[i, v] >= 0, max(follow[i, v], -1 - follow[i, v])
            v, n = v - 1, n + 1
        at[n], kind[n] = i, _BEGIN
        v, n = v - 1, n + 1
    for k in range(n // 2):
        at[k], at[n - 1 - k] = at[n - 1 - k], at[k]
        kind[k], kind[n - 1 - k] = kind[n - 1 - k], kind[k]
    return n


@helper
def _place(floats, ints, bearings, vertices):
    """Place the vertices: held together at first, then where free lines meet beside a reading."""
    at, kind, x, y = ints[STACK_FIRST], ints[STACK_LAST], floats[X], floats[Y]
    for step in range(4):
        _solve(floats, ints, bearings, vertices, step > 0)
        for k in range(1, vertices - 1):
            if kind[k] == _BEGIN or kind[k + 1] == _BEGIN:
                continue
            if step == 0:
                if min(at[k] - at[k - 1], at[k + 1] - at[k]) > _ENOUGH:
                    kind[k] = _OPEN
            elif kind[k] != _HELD and step < 3:
                tangent, _ = _meeting(floats, ints, bearings, k)
                if math.isnan(tangent):
                    kind[k] = _HELD
                else:
                    kind[k] = _BEFORE if tangent > 0.0 else _AFTER
    for k in range(vertices):
        i, b = at[k], ints[BEAM, at[k]]
        tangent, u = 0.0, floats[LINE_A, k]
        if kind[k] > _HELD:
            tangent, u = _meeting(floats, ints, bearings, k)
            if math.isnan(tangent):
                tangent, u = 0.0, 0.5 * (floats[LINE_A, k] + floats[LINE_B, k])
        elif kind[k] == _BEGIN:
            u = floats[LINE_B, k]
        if not u > 0.0:
            u = 1.0 / floats[RHO, i]
        x[i] = (bearings[0, b] - tangent * bearings[1, b]) / u
        y[i] = (bearings[1, b] + tangent * bearings[0, b]) / u


@helper
def _turn(bearings, b, to):
    """Cosine and sine of the angle from the ray of one beam to that of another."""
    c = bearings[0, b] * bearings[0, to] + bearings[1, b] * bearings[1, to]
    return c, bearings[0, b] * bearings[1, to] - bearings[1, b] * bearings[0, to]


@helper
def _meeting(floats, ints, bearings, k):
    """Where the two lines of a vertex meet: tangent of the angle from its ray, and 1/ρ cos of it.

    NaN if not between the readings next to it.
    """
    at, beam, before, after = ints[STACK_FIRST], ints[BEAM], floats[LINE_A], floats[LINE_B]
    b = beam[at[k]]
    c, s = _turn(bearings, b, beam[at[k - 1]])
    slope = (after[k - 1] - before[k] * c) / s
    c, s = _turn(bearings, b, beam[at[k + 1]])
    bend = (before[k + 1] - after[k] * c) / s - slope
    if bend == 0.0:
        return math.nan, math.nan
    tangent = (before[k] - after[k]) / bend
    c1, s1 = _turn(bearings, b, beam[at[k] - 1])
    c2, s2 = _turn(bearings, b, beam[at[k] + 1])
    if not s1 < tangent * c1 or not tangent * c2 < s2:
        return math.nan, math.nan
    return tangent, before[k] + slope * tangent


@helper
def _solve(floats, ints, bearings, vertices, again):
    """Inverse range of the line before each vertex (LINE_A) and of that after it (LINE_B).

    Of least squared range errors; with weights from the lines that are there, if `again`.
    """
    kind, before, after = ints[STACK_LAST], floats[LINE_A], floats[LINE_B]
    pivot, right, cross = floats[COST], floats[JOINT_COST], floats[RISE]
    d, h = 0.0, 0.0
    for k in range(vertices):
        if kind[k] == _BEGIN or kind[k] > _HELD:
            d, h = 0.0, 0.0
        if k + 1 == vertices or kind[k + 1] == _BEGIN:
            continue
        aa, ab, bb, ua, ub = _normal_equations(floats, ints, bearings, k, again)
        pivot[k], right[k], cross[k] = d + aa, h + ua, ab
        d, h = bb - ab * ab / pivot[k], ub - ab * right[k] / pivot[k]
        if k + 2 == vertices or kind[k + 2] == _BEGIN or kind[k + 1] > _HELD:
            before[k + 1] = h / d
    for k in range(vertices - 1, 0, -1):
        if kind[k] == _BEGIN:
            continue
        if kind[k] == _HELD and k + 1 < vertices and kind[k + 1] != _BEGIN:
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
    low = at[k] if kind[k] == _BEGIN or kind[k] == _AFTER else at[k] + 1
    high = at[k + 1] if kind[k + 1] == _HELD or kind[k + 1] == _BEFORE else at[k + 1] - 1
    for i in range(low, high + 1):
        _, s = _turn(bearings, origin, beam[i])
        _, rest = _turn(bearings, beam[i], end)
        a, b, r = rest / whole, s / whole, rho[i]
        mapped = r
        if again:
            u = a * floats[LINE_B, k] + b * floats[LINE_A, k + 1]
            mapped = 1.0 / u if u * r > 0.5 else 2.0 * r
        w = r * r * mapped * mapped
        aa, ab, bb = aa + w * a * a, ab + w * a * b, bb + w * b * b
        ua, ub = ua + w / r * a, ub + w / r * b
    return aa, ab, bb, ua, ub


@helper
def hold_together(floats, ints, counts, row, segments, corners, offsets):
    """Let the segments of a scan end in the vertices of its polylines, and corners be there."""
    x, y, segment, corner = floats[X], floats[Y], offsets[row, 0], offsets[row, 1]
    for k in range(counts[PIECES]):
        first, last = ints[FIRST, k], ints[LAST, k]
        dx, dy = x[last] - x[first], y[last] - y[first]
        angle = math.atan2(dy, dx)
        c, s = math.cos(angle), math.sin(angle)
        segments[segment, S_START], segments[segment, S_START + 1] = x[first], y[first]
        segments[segment, S_END], segments[segment, S_END + 1] = x[last], y[last]
        cx, cy = segments[segment, S_CENTROID] - x[first], segments[segment, S_CENTROID + 1] - y[first]
        along = c * cx + s * cy
        segments[segment, S_CENTROID] = x[first] + along * c
        segments[segment, S_CENTROID + 1] = y[first] + along * s
        segments[segment, S_ANGLE] = angle
        segment += 1
        if ints[BEFORE, k] >= 0:
            corners[corner, C_POSITION], corners[corner, C_POSITION + 1] = x[first], y[first]
            corner += 1
