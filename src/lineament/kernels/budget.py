"""Pieces joined or left out until they have no more vertices than a budget allows.

By dynamic programming over the pieces, as R. Bellman, *On the approximation of curves by line
segments using dynamic programming*, Communications of the ACM 4 (1961).
"""

import math

import numpy as np

from . import helper, kernel
from .arrays import Floats2, Floats3, Ints2
from . import layout as at
from .rays import add_ray, least_squares, turn

#: How far apart pieces of different clusters may be that become one [m]: the rule of the public
#: benchmark (Schaefer et al., IROS 2018) for points that a map connects.
LINK = 1.0

#: Error in range from which on a point is better left out than explained [m].
WORST = 0.25


@kernel
def limit_pieces(
    floats: Floats2,
    ints: Ints2,
    bearings: Floats2,
    max_vertices: int,
    link: float,
    worst: float,
    costs: Floats3,
    follow: Ints2,
):
    """Simplify the pieces of a scan to at most `max_vertices` vertices.

    A chain of k pieces joined at corners has k + 1 vertices. Where there are too many,
    neighbouring pieces become one, or are left out, such that Σ (χ² - worst² · points) over the
    pieces that remain is the least of all ways. χ² is that of the line with the least squared range
    errors over all points from the first to the last of a piece. Where a corner joined pieces, one
    joins what became of them. The clusters of the points stay. Pieces are in the order of their
    points.

    Parameters
    ----------
    max_vertices : int
        The budget, at least 1.
    link : float
        How far apart two pieces that no corner joins may be to become one [m], if no beam between
        them is missing.
    worst : float
        Error of a range from which on a point is better left out than explained [m].
    costs : float64 array, shape (2, n + 2, max_vertices + 1)
    follow : int64 array, shape (n + 2, max_vertices + 1)
        Scratch.
    """
    work = at.named(floats, ints)
    pieces = work.counts[at.PIECES]
    if _count_vertices(work.pieces[at.BEFORE], pieces) <= max_vertices:
        return
    kept, best = costs[0], costs[1]
    for v in range(max_vertices + 1):
        kept[pieces, v], best[pieces, v] = math.inf, 0.0
    for k in range(pieces - 1, -1, -1):
        _add_piece(work, bearings, k, pieces, max_vertices, link, worst * worst, costs, follow)
    work.counts[at.PIECES] = _follow(
        work.pieces, work.response, pieces, max_vertices, kept, best, follow
    )


@helper
def _count_vertices(before, pieces):
    """Count two for each piece, less one where a corner joins it to the piece before.

    The vertex at which a ring opens counts twice: as a polyline, it begins and ends there.
    """
    vertices = 2 * pieces
    for k in range(1, pieces):
        vertices -= before[k] >= 0
    return vertices


@helper
def _add_piece(work, bearings, k, pieces, budget, link, price, costs, follow):
    """Find the least costs of the pieces from the k-th on, from those of the later ones.

    ``best[k, v]`` is the least with v vertices, ``kept[k, v]`` the least where the k-th is not
    left out. ``follow[k, v]`` then is the piece after those that become one with it, or -1 less
    that where a corner joins it.
    """
    ranges, beam, kept, best = work.beams[at.RANGE], work.marks[at.BEAM], costs[0], costs[1]
    first, last, before = work.pieces[at.FIRST], work.pieces[at.LAST], work.pieces[at.BEFORE]
    for v in range(budget + 1):
        kept[k, v] = math.inf
    cosines, sines, sums = bearings[0], bearings[1], (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    point, origin = first[k], beam[first[k]]
    # The point of a corner belongs to both pieces, and counts for the one before.
    free = max(first[k], last[k - 1] + 1) if k > 0 else first[k]
    for after in range(k + 1, pieces + 1):
        while point <= last[after - 1]:
            c, s = turn(bearings, origin, beam[point])
            sums = add_ray(sums, c, s, ranges[beam[point]])
            point += 1
        cost = max(least_squares(sums), 0.0) - price * (point - free)
        sharp = after < pieces and before[after] >= 0
        for v in range(2, budget + 1):
            if cost + best[after, v - 2] < kept[k, v]:
                kept[k, v], follow[k, v] = cost + best[after, v - 2], after
            if sharp and cost + kept[after, v - 1] < kept[k, v]:
                kept[k, v], follow[k, v] = cost + kept[after, v - 1], -1 - after
        if after < pieces and not sharp:
            a, b = beam[last[after - 1]], beam[first[after]]
            dx = ranges[b] * cosines[b] - ranges[a] * cosines[a]
            dy = ranges[b] * sines[b] - ranges[a] * sines[a]
            missing = (b - a) % len(cosines) > first[after] - last[after - 1]
            if missing or dx * dx + dy * dy > link * link:
                break
    for v in range(budget + 1):
        best[k, v] = min(best[k + 1, v], kept[k, v])


@helper
def _follow(listed, response, pieces, budget, kept, best, follow):
    """Rewrite the list of pieces by the tables. Returns their number."""
    first, last, before = listed[at.FIRST], listed[at.LAST], listed[at.BEFORE]
    n, k, v, after, joined = np.int64(0), np.int64(0), budget, np.int64(0), False
    ring = before[0] >= 0 and kept[0, budget] < best[1, budget]
    while k < pieces:
        if not joined and best[k + 1, v] <= kept[k, v]:
            k += 1
            continue
        after = follow[k, v]
        # Never behind the pieces that are read: no more are written.
        first[n], response[n], before[n] = first[k], response[k], n - 1 if joined else -1
        joined = after < 0
        after = -1 - after if joined else after
        last[n] = last[after - 1]
        k, v = after, v - (1 if joined else 2)
        n += 1
    if ring and n > 1 and after == pieces:
        before[0] = n - 1
    return n
