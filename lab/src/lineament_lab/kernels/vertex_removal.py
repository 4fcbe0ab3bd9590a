"""Polylines through all measurements, from which vertices are removed: the first step of PLE.

A. Schaefer, D. Büscher, L. Luft, W. Burgard, *A maximum likelihood approach to extract polylines
from 2-D laser range scans*, IROS 2018.
"""

import math

from lineament.kernels import LARGEST, helper
from lineament.kernels import layout as at
from lineament.kernels.arrays import Floats1, Floats2, Ints2
from lineament.kernels.line_fit import range_variance

from . import kernel

#: Rows of `points` that are scratch until the pieces are settled: by point its weight, what the
#: link to the next vertex costs, and by how much the cost rises if the vertex is removed.
_WEIGHT, _COST, _RISE = at.SLOPE, at.SLACK, at.SPARE
#: Rows of `waiting`: the vertex before and the vertex after, -1 where a polyline ends.
_BEFORE, _AFTER = at.FIRST, at.LAST


@kernel
def remove_vertices(
    floats: Floats2,
    ints: Ints2,
    noise: Floats1,
    most_rise: float,
    line_error: float,
    most_vertices: int,
):
    """Remove the vertices of the polylines through all clusters that the scan needs least.

    The cost of a polyline is Σ ((ρ - ρ̂)/σ)² over the beams that meet it, ρ̂ where they do: -2 ln L
    but for a constant. Again and again the vertex is removed by which it rises least. From points
    and clusters, pieces between the vertices that stay; their response is the rise.

    Parameters
    ----------
    most_rise : float
        No vertex is removed by which the cost rises by more.
    line_error : float
        Error [m] of a measurement that no line explains: the end of a polyline goes at this price.
    most_vertices : int
        Vertices are removed, whatever the rise, until no more are left; 0: any number.
    """
    work = at.named(floats, ints)
    points, links, count = work.points, work.waiting, _count(work)
    for i in range(count):
        points[_WEIGHT, i] = 1.0 / range_variance(points[at.RHO, i], noise)
    left = _link_all(work, line_error)
    while True:
        v, rise = _least(points, count)
        if v < 0 or (rise > most_rise and (most_vertices == 0 or left <= most_vertices)):
            break
        left -= _remove(points, links, v, count, line_error)
    _list_pieces(work, most_rise)


@helper
def _count(work):
    """Return the number of points; that of a ring at its end is its first again."""
    return work.counts[at.POINTS] - (1 if work.counts[at.CLOSED] else 0)


@helper
def _link_all(work, line_error):
    """Make each point a vertex, linked to its neighbours. Returns how many vertices there are."""
    points, links, counts = work.points, work.waiting, work.counts
    count, left = _count(work), 0
    for i in range(count + 1):
        points[_RISE, i], points[_COST, i] = math.inf, 0.0
        links[_BEFORE, i] = links[_AFTER, i] = -1
    for c in range(counts[at.CLUSTERS]):
        first, last = work.clusters[at.FIRST, c], work.clusters[at.LAST, c]
        for i in range(first, last):
            links[_AFTER, i], links[_BEFORE, i + 1] = i + 1, i
        # The point at which a ring was opened stays until the end, see `_list_pieces`.
        opened = 1 if counts[at.CLOSED] else 0
        for i in range(first + opened, last + 1 - opened):
            points[_RISE, i] = _rise(points, links, i, count, line_error)
        left += last + 1 - opened - first
    return left


@helper
def _remove(points, links, v, count, line_error):
    """Remove a vertex, and the other one of a polyline of two. Returns how many are removed."""
    before, after = links[_BEFORE, v], links[_AFTER, v]
    points[_RISE, v], links[_BEFORE, v], links[_AFTER, v] = math.inf, -1, -1
    if before >= 0:
        links[_AFTER, before] = after
    if after >= 0:
        links[_BEFORE, after] = before
    if before >= 0 and after >= 0:
        points[_COST, before] = _cost(points, before, after, count)
    if before < 0 or after < 0:
        # What was next to an end is one: so is, of a polyline of two, the one beyond it.
        u = max(before, after)
        if links[_BEFORE, u] < 0 and links[_AFTER, u] < 0:
            points[_RISE, u] = math.inf
            return 2
        before, after = u, max(links[_BEFORE, u], links[_AFTER, u])
    for u in (before, after):
        if not _is_opened(links, u, count):
            points[_RISE, u] = _rise(points, links, u, count, line_error)
    return 1


@helper
def _is_opened(links, u, count):
    """Whether a vertex is the point at which a ring was opened: only a ring has the other end."""
    return (u == 0 or u == count) and links[_BEFORE, count] >= 0


@helper
def _rise(points, links, v, count, line_error):
    """By how much the cost rises if a vertex is removed."""
    before, after = links[_BEFORE, v], links[_AFTER, v]
    if before >= 0 and after >= 0:
        cost = points[_COST, before] + points[_COST, v]
        return _cost(points, before, after, count) - cost
    # With an end its link goes: the beams that met it have the error that no line explains.
    first, last, other = (v, after, after) if before < 0 else (before, v, before)
    rise = -points[_COST, first]
    is_joint = links[_BEFORE, other] >= 0 and links[_AFTER, other] >= 0
    for i in range(first, last + 1):
        if i != other or not is_joint:
            rise += line_error * line_error * points[_WEIGHT, i]
    return rise


@helper
def _cost(points, first, last, count):
    """Cost of the measurements between two vertices, over the seam too.

    Infinite if a beam between them does not meet the line of the two from this side.
    """
    x, y, rho, end = points[at.X], points[at.Y], points[at.RHO], last % count
    nx, ny = y[end] - y[first], x[first] - x[end]
    offset, cost = nx * x[first] + ny * y[first], 0.0
    for k in range(first + 1, last):
        i = k % count
        along = nx * x[i] + ny * y[i]
        if offset <= 0.0 or along <= 0.0:
            return math.inf
        error = rho[i] - rho[i] * offset / along
        cost += error * error * points[_WEIGHT, i]
    return cost


@helper
def _least(points, count):
    """Return the vertex with the least rise, -1 if that of all is infinite, and the rise."""
    least, rise = -1, math.inf
    for i in range(count):
        if points[_RISE, i] < rise:
            least, rise = i, points[_RISE, i]
    return least, rise


@helper
def _list_pieces(work, most_rise):
    """List the pieces between the vertices that are left.

    The point at which a ring was opened is a vertex if the cost rises by too much without it.
    """
    points, links, pieces, counts = work.points, work.waiting, work.pieces, work.counts
    n, count = 0, _count(work)
    for i in range(count):
        if links[_AFTER, i] < 0:
            continue
        pieces[at.FIRST, n], pieces[at.LAST, n] = i, links[_AFTER, i]
        pieces[at.BEFORE, n], work.response[n] = -1, math.nan
        if links[_BEFORE, i] >= 0:
            pieces[at.BEFORE, n] = n - 1
            work.response[n] = min(points[_RISE, i], LARGEST)
        n += 1
    if counts[at.CLOSED] and n == 1:
        n = 0  # A ring without corners has no straight piece.
    elif counts[at.CLOSED] and n > 1:
        before, after = links[_BEFORE, count], links[_AFTER, 0]
        parts = points[_COST, before] + points[_COST, 0]
        rise = _cost(points, before, after + count, count) - parts
        if rise > most_rise:
            pieces[at.BEFORE, 0], work.response[0] = n - 1, min(rise, LARGEST)
    counts[at.PIECES], counts[at.CANDIDATES] = n, 0
