"""Pieces joined or left out until they have no more vertices than a budget allows."""

import math

import numpy as np

from . import helper, kernel
from .layout import BEAM, BEFORE, FIRST, LAST, PIECES, RANGE, RESPONSE

#: How far apart pieces of different classes may be that become one [m]: the rule of the public
#: benchmark (Schaefer et al., IROS 2018) for points that a map connects.
LINK = 1.0

#: Error in range from which on a point is better left out than explained [m].
WORST = 0.25


@kernel
def limit_pieces(floats, ints, counts, bearings, max_vertices, link, worst, costs, follow):
    """Simplify the pieces of a scan to at most `max_vertices` vertices.

    A chain of k pieces joined at corners has k + 1 vertices. Where there are too many,
    neighbouring pieces become one, or are left out, such that Σ (χ² - worst² · points) over the
    pieces that remain is the least of all ways. χ² is that of the line with the least squared range
    errors over all points from the first to the last of a piece. Where a corner joined pieces, one
    joins what became of them. The classes of the points stay.

    Parameters
    ----------
    floats, ints, counts
        See `layout`. RANGE, BEAM and the lines by piece are read, the pieces being in the order
        of their points; these lines are rewritten, and PIECES.
    bearings : float64 array, shape (2, n)
        Cosines and sines.
    max_vertices : int
        The budget; 0 sets none.
    link : float
        How far apart two pieces that no corner joins may be to become one [m], if all beams
        between them returned something.
    worst : float
        Error of a range from which on a point is better left out than explained [m].
    costs : float64 array, shape (2, n + 2, max_vertices + 1)
    follow : int64 array, shape (n + 2, max_vertices + 1)
        Scratch.
    """
    pieces, before = counts[PIECES], ints[BEFORE]
    if max_vertices == 0 or count_vertices(before, pieces) <= max_vertices:
        return
    kept, best = costs[0], costs[1]
    first, last = ints[FIRST], ints[LAST]
    for v in range(max_vertices + 1):
        kept[pieces, v], best[pieces, v] = math.inf, 0.0
    for k in range(pieces - 1, -1, -1):
        _add_piece(
            floats[RANGE],
            ints[BEAM],
            bearings,
            first,
            last,
            before,
            k,
            pieces,
            max_vertices,
            link,
            worst * worst,
            kept,
            best,
            follow,
        )
    counts[PIECES] = _follow(
        first, last, before, floats[RESPONSE], pieces, max_vertices, kept, best, follow
    )


@helper
def count_vertices(before, pieces):
    """Count two for each piece, less one where a corner joins it to the piece before.

    The vertex at which a ring opens counts twice: as a polyline, it begins and ends there.
    """
    vertices = 2 * pieces
    for k in range(1, pieces):
        vertices -= before[k] >= 0
    return vertices


@helper
def _add_piece(
    ranges,
    beam,
    bearings,
    first,
    last,
    before,
    k,
    pieces,
    budget,
    link,
    price,
    kept,
    best,
    follow,
):
    """Find the least costs of the pieces from the k-th on, knowing those of the later ones.

    ``best[k, v]`` is the least with v vertices, ``kept[k, v]`` the least where the k-th is not
    left out. ``follow[k, v]`` then is the piece after those that become one with it, or -1 less
    that where a corner joins it.
    """
    for v in range(budget + 1):
        kept[k, v] = math.inf
    cosines, sines = bearings[0], bearings[1]
    cc, cs, ss, uc, us, uu = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    at, origin = first[k], beam[first[k]]
    # The point of a corner belongs to both pieces, and counts for the one before.
    free = max(first[k], last[k - 1] + 1) if k > 0 else first[k]
    for after in range(k + 1, pieces + 1):
        while at <= last[after - 1]:
            b = beam[at]
            # Bearings are taken from the first point: the sums are well conditioned anywhere.
            c = cosines[b] * cosines[origin] + sines[b] * sines[origin]
            s = sines[b] * cosines[origin] - cosines[b] * sines[origin]
            # Inverse-range regression, 1/ρ = A cos φ + B sin φ: its residual times ρ² is the
            # error in range.
            r = ranges[b]
            w = r * r * r * r
            cc, cs, ss = cc + w * c * c, cs + w * c * s, ss + w * s * s
            uc, us, uu = uc + w / r * c, us + w / r * s, uu + r * r
            at += 1
        determinant = cc * ss - cs * cs
        squares = uu - (ss * uc * uc - 2.0 * cs * uc * us + cc * us * us) / determinant
        cost = max(squares, 0.0) - price * (at - free)
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
            silent = (b - a) % len(cosines) > first[after] - last[after - 1]
            if silent or dx * dx + dy * dy > link * link:
                break
    for v in range(budget + 1):
        best[k, v] = min(best[k + 1, v], kept[k, v])


@helper
def _follow(first, last, before, response, pieces, budget, kept, best, follow):
    """Rewrite the list of pieces as the tables tell. Returns their number."""
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
