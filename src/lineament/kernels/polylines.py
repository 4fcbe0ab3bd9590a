"""Polylines through the points of a scan: at most so many vertices, and the least range error.

On the ray of each vertex its inverse range is free; between two vertices the inverse range then is
linear in theirs, whatever the direction of the line. Which points are vertices is found by dynamic
programming, where what is best so far is a parabola in the last inverse range. `vertices` then
places them.
"""

import math

import numpy as np

from . import helper, kernel
from .layout import BEAM, POINTS, RHO, STACK_FIRST, STACK_LAST, X, Y
from .vertices import BEGIN, HELD, place_vertices

#: Planes of the tables of costs, by point and number of vertices: of the best polylines that come
#: to a vertex there, curvature, place and value of their least cost; and the least cost of all
#: points before it.
CURVATURE, PLACE, LEAST, CLOSED_COST = 0, 1, 2, 3
PLANES = 4
#: What more vertices must spare to be taken, in prices of a point: more than rounding.
_TIE = 1e-9


@kernel
def fit_polylines(floats, ints, counts, bearings, budget, max_missing, link, worst, costs, follow):
    """Lay polylines of at most `budget` vertices in all through the points of a scan.

    Such that Σ (error of the range)² over the points of polylines, and `worst`² for each other
    point, is the least. Vertices lie on the rays of readings, but where two lines of enough points
    meet beside one. They become X and Y of their points, the lines between them the pieces.

    Parameters
    ----------
    floats, ints, counts
        See `layout`. BEAM, RHO, X, Y, POINTS and CLOSED are read, lines by piece rewritten.
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
    place_vertices(floats, ints, counts, bearings, vertices)


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
    curvature, place = costs[CURVATURE], costs[PLACE]
    least, closed = costs[LEAST], costs[CLOSED_COST]
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
    """List the points that are vertices, STACK_FIRST, and their kinds, STACK_LAST.

    Returns their number: the least of those that cost the least.
    """
    closed = costs[CLOSED_COST]
    at, kind = ints[STACK_FIRST], ints[STACK_LAST]
    i, v, n = points, np.int64(0), np.int64(0)
    for k in range(budget + 1):
        if closed[points, k] < closed[points, v] - _TIE * price:
            v = np.int64(k)
    while i > 0:
        i -= 1
        if closed[i + 1, v] == closed[i, v] + price:
            continue
        goes_on = True
        while goes_on:
            at[n], kind[n] = i, HELD
            goes_on, i = follow[i, v] >= 0, max(follow[i, v], -1 - follow[i, v])
            v, n = v - 1, n + 1
        at[n], kind[n] = i, BEGIN
        v, n = v - 1, n + 1
    for k in range(n // 2):
        at[k], at[n - 1 - k] = at[n - 1 - k], at[k]
        kind[k], kind[n - 1 - k] = kind[n - 1 - k], kind[k]
    return n
