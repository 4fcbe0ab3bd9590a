"""Maps of method `optimal`: polylines of at most so many vertices with the least range error.

On the ray of each vertex its inverse range is free; between two vertices the inverse range then is
linear in theirs, whatever the direction of the line. Which points are vertices is found by dynamic
programming, where what is best so far is a parabola in the last inverse range. `vertices` then
places them.
"""

import math

import numpy as np

from . import helper, kernel
from .arrays import Floats2, Floats3, Ints2
from . import layout as at
from .rays import add_ray, least_squares, turn
from .vertices import BEGIN, HELD, place_vertices

#: Planes of the tables of costs, by point and number of vertices: of the best polylines that come
#: to a vertex there, curvature, place and value of their least cost; and the least cost of all
#: points before it.
CURVATURE, PLACE, LEAST, CLOSED_COST = 0, 1, 2, 3
PLANES = 4
#: What more vertices must spare to be taken, in prices of a point: more than rounding.
_TIE = 1e-9


@kernel
def fit_polylines(
    floats: Floats2,
    ints: Ints2,
    bearings: Floats2,
    budget: int,
    max_missing: int,
    link: float,
    worst: float,
    costs: Floats3,
    follow: Ints2,
):
    """Fit polylines of at most `budget` vertices in all through the points of a scan.

    Such that Σ (error of the range)² over the points of polylines, and `worst`² for each other
    point, is the least. Vertices lie on the rays of measurements, but where two lines of enough
    points meet beside one. They become X and Y of their points, the lines between them the pieces.

    Parameters
    ----------
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
    work = at.extended(floats, ints)
    points, least, closed = work.counts[at.POINTS], costs[LEAST], costs[CLOSED_COST]
    for v in range(budget + 1):
        closed[0, v] = 0.0
        for i in range(points):
            least[i, v] = math.inf
    for i in range(points):
        for v in range(budget + 1):
            closed[i + 1, v] = min(closed[i, v] + worst * worst, least[i, v])
        _extend(work, bearings, i, budget, max_missing, link, worst, costs, follow)
    count = _list_vertices(work.vertices, points, budget, worst * worst, costs, follow)
    place_vertices(work, bearings, count)


@helper
def _extend(work, bearings, i, budget, max_missing, link, worst, costs, follow):
    """Fit lines from a vertex at point i to each later point that is linked with it."""
    rho, beam, price, n = work.points[at.RHO], work.marks[at.BEAM], worst * worst, bearings.shape[1]
    sums = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(i + 1, work.counts[at.POINTS]):
        c, s = turn(bearings, beam[i], beam[j])
        if s <= 0.0 or not _linked(work.points, beam, j, n, max_missing, link):
            return
        inner = j - i - 1
        alone = least_squares(sums) if inner > 2 else 0.0
        sums = add_ray(sums, c, s, rho[j])
        if alone > price * inner:
            continue  # No more vertices are needed to leave these points out.
        # By the inverse ranges p and q at both ends the squared error is
        # aa p² + 2 ab p q + bb q² - 2 ua p - 2 ub q + uu.
        cc, cs, ss, uc, us, uu = sums
        ratio = c / s
        aa, ab, bb = cc - 2.0 * ratio * cs + ratio * ratio * ss, (cs - ratio * ss) / s, ss / (s * s)
        form = aa, ab, bb, uc - ratio * us, us / s
        _add_line(costs, follow, rho[i], i, j, budget, form, uu)


@helper
def _linked(points, beam, j, beams, max_missing, link):
    """Whether a polyline may go on from the point before to this one."""
    dx, dy = points[at.X, j] - points[at.X, j - 1], points[at.Y, j] - points[at.Y, j - 1]
    return (beam[j] - beam[j - 1] - 1) % beams <= max_missing and dx * dx + dy * dy <= link * link


@helper
def _add_line(costs, follow, rho, i, j, budget, form, uu):
    """Add the line from vertex i, where a polyline begins or goes on, to j to the tables."""
    curvature, place = costs[CURVATURE], costs[PLACE]
    least, closed = costs[LEAST], costs[CLOSED_COST]
    w, u = rho**4, 1.0 / rho
    first, steep_first, q_first = _least_over(w, w * u, form)
    first += w * u * u + uu
    for v in range(2, min(budget, i + 2) + 1):
        total, steep, q, before = closed[i, v - 2] + first, steep_first, q_first, -1 - i
        if least[i, v - 1] < math.inf:
            w, u = curvature[i, v - 1], place[i, v - 1]
            rise, steep_on, q_on = _least_over(w, w * u, form)
            rise += w * u * u + uu
            if least[i, v - 1] + rise < total:
                total, steep, q, before = least[i, v - 1] + rise, steep_on, q_on, i
        if total < least[j, v]:
            least[j, v], curvature[j, v], place[j, v], follow[j, v] = total, steep, q, before


@helper
def _least_over(w, wu, form):
    """Least of (aa + w) p² + 2 ab p q + bb q² - 2 (ua + wu) p - 2 ub q over p, as a parabola in q.

    Returns its least, its curvature, and where it is. A line that passes a ray behind the sensor
    costs infinitely much.
    """
    aa, ab, bb, ua, ub = form
    a, b = w + aa, wu + ua
    steep, slope = bb - ab * ab / a, ub - ab * b / a
    if steep <= 0.0 or slope <= 0.0 or b * steep <= ab * slope:
        return math.inf, 1.0, 1.0
    q = slope / steep
    return -b * b / a - slope * q, steep, q


@helper
def _list_vertices(vertices, points, budget, price, costs, follow):
    """List the points that are vertices, and their kinds.

    Returns their number: the least of those that cost the least.
    """
    closed, point, kind = costs[CLOSED_COST], vertices[at.AT], vertices[at.KIND]
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
            point[n], kind[n] = i, HELD
            goes_on, i = follow[i, v] >= 0, max(follow[i, v], -1 - follow[i, v])
            v, n = v - 1, n + 1
        point[n], kind[n] = i, BEGIN
        v, n = v - 1, n + 1
    for k in range(n // 2):
        point[k], point[n - 1 - k] = point[n - 1 - k], point[k]
        kind[k], kind[n - 1 - k] = kind[n - 1 - k], kind[k]
    return n
