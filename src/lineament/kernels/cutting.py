"""Clusters cut into straight pieces at their farthest points, again and again.

U. Ramer, *An iterative procedure for the polygonal approximation of plane curves* (1972); steps 5-7
of Liu et al. 2023, with equation 14.
"""

import math

import numpy as np

from . import helper, kernel, sums
from .arrays import Floats2, Ints2
from . import layout as at
from .corner_operator import corner_response


@kernel
def cut(
    floats: Floats2,
    ints: Ints2,
    radius: int,
    threshold: float,
    kind: int,
    min_points: int,
    both_sides: bool,
    whole_support: bool,
):
    """Cut the clusters of a scan where the corner operator responds (Liu et al. 2023, steps 5-7).

    From points and clusters, candidates and pieces.

    Parameters
    ----------
    radius, kind
        As in `corner_operator.corner_response`.
    threshold : float
        A candidate whose response exceeds this is a corner.
    min_points : int
        No piece gets shorter.
    both_sides : bool
        Both sides of a corner are searched in turn, else only that after it (step 7 to the letter).
    whole_support : bool
        Points whose support an end of their cluster cuts short have no response.
    """
    work = at.named(floats, ints)
    points, counts = work.points, work.counts
    x, y = points[at.X], points[at.Y]
    count, closed, found = counts[at.POINTS], counts[at.CLOSED] != 0, np.int64(0)
    if closed and counts[at.CLUSTERS] > 0:
        # The point at which a closed cluster was opened is examined first.
        first = np.int64(0)
        response = corner_response(x, y, first, first, count - 1, radius, kind, closed)
        found = add_candidate(work.candidates, found, first, 0.0, response)
    for c in range(counts[at.CLUSTERS]):
        first, last = work.clusters[at.FIRST, c], work.clusters[at.LAST, c]
        depth = add_side(work.waiting, 0, first, last)
        while depth > 0:
            depth, a, b, i, distance = next_candidate(points, work.waiting, depth, min_points)
            if i < 0:
                continue
            response = 0.0
            if closed or not whole_support or (first + radius <= i <= last - radius):
                response = corner_response(x, y, i, first, last, radius, kind, closed)
            found = add_candidate(work.candidates, found, i, distance, response)
            if response > threshold:
                depth = add_side(work.waiting, depth, i, b)
                if both_sides:
                    depth = add_side(work.waiting, depth, a, i)
    list_pieces(work, found, threshold)


@helper
def next_candidate(points, waiting, depth, min_points):
    """Take the last piece that waits: its farthest point from its chord is a candidate.

    Returns how many pieces still wait, the ends of this one, the candidate or -1, its distance.
    """
    first, last = waiting[at.FIRST, depth - 1], waiting[at.LAST, depth - 1]
    point, distance = farthest_from_chord(
        points[at.X], points[at.Y], first, last, min_points - 1, points[at.SPARE]
    )
    return depth - 1, first, last, point, distance


@helper
def add_side(waiting, depth, first, last):
    """Let a piece wait for its search; the last that is added is the next. Returns the depth."""
    waiting[at.FIRST, depth], waiting[at.LAST, depth] = first, last
    return depth + 1


@helper
def add_candidate(candidates, found, point, distance, value):
    """Note what was found of a candidate. Returns the number of candidates."""
    candidates[at.POINT, found] = point
    candidates[at.CHORD_DISTANCE, found], candidates[at.RESPONSE, found] = distance, value
    return found + 1


@sums
def farthest_from_chord(x, y, first, last, margin, away):
    """Point between `first` and `last` farthest from their chord (equation 14).

    Points nearer than `margin` to an end are not taken, so that no piece gets too short. Where
    the chord has no length (a closed cluster) the distance is that to its one point. `away` is
    scratch. Returns the point and its distance; -1 and 0 where there is none.
    """
    if last - first < 2 * margin:
        return -1, 0.0
    x0, y0 = x[first], y[first]
    cx, cy = x[last] - x0, y[last] - y0
    chord = math.sqrt(cx * cx + cy * cy)
    # Slices, as numba need not look for negative indices where a loop begins at 0.
    x, y = x[first + margin : last - margin + 1], y[first + margin : last - margin + 1]
    point = 0
    for i in range(len(x)):
        px, py = x[i] - x0, y[i] - y0
        away[i] = abs(cx * py - cy * px) if chord > 0.0 else px * px + py * py
    # First how far, then which: each a loop that does several points at once. Numbers from 0 on
    # have the order of their bits.
    bits, largest = away[: len(x)].view(np.int64), np.int64(0)
    for i in range(len(x)):
        largest = max(largest, bits[i])
    while bits[point] < largest:
        point += 1
    best = away[point]
    return first + margin + point, best / chord if chord > 0.0 else math.sqrt(best)


@helper
def list_pieces(work, found, threshold):
    """List the pieces of the clusters between the candidates whose response is above a threshold.

    The response of a corner becomes that of the piece that begins there; NaN where none does.
    """
    response, pieces = work.response, work.pieces
    candidates, counts = work.candidates, work.counts
    # By point at first, then by piece: there are never more pieces than points before.
    for i in range(counts[at.POINTS]):
        response[i] = math.nan
    for k in range(found):
        if candidates[at.RESPONSE, k] > threshold:
            response[np.int64(candidates[at.POINT, k])] = candidates[at.RESPONSE, k]
    n, opened = np.int64(0), counts[at.CLOSED] != 0
    for c in range(counts[at.CLUSTERS]):
        a, b = work.clusters[at.FIRST, c], work.clusters[at.LAST, c]
        pieces[at.FIRST, n], pieces[at.BEFORE, n], response[n] = a, -1, response[a]
        for i in range(a + 1, b):
            if not math.isnan(response[i]):
                pieces[at.LAST, n] = i
                n += 1
                pieces[at.FIRST, n], pieces[at.BEFORE, n], response[n] = i, n - 1, response[i]
        pieces[at.LAST, n] = b
        n += 1
    if opened and n == 1:
        n = 0  # A ring without corners has no straight piece.
    if opened and n > 1 and not math.isnan(response[0]):
        pieces[at.BEFORE, 0] = n - 1
    counts[at.PIECES], counts[at.CANDIDATES] = n, found
