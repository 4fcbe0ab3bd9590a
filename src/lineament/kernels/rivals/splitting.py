"""Clusters split at their farthest points, again and again."""

import math

import numpy as np

from .. import helper, kernel
from ..corner_operator import farthest_from_chord
from ..cutting import list_pieces
from ..layout import (
    CANDIDATE,
    CANDIDATE_RESPONSE,
    CANDIDATES,
    CHORD_DISTANCE,
    CLASS_FIRST,
    CLASS_LAST,
    CLASSES,
    CLOSED,
    POINTS,
    RESPONSE,
    RHO,
    SPARE,
    STACK_FIRST,
    STACK_LAST,
    X,
    Y,
)
from ..line_fit import WEIGHTED, fit_line, range_variance

#: What decides that a piece is split: its farthest point from the chord of its ends, or from the
#: line fitted to it.
CHORD, LINE = 0, 1


@kernel
def split(
    floats,
    ints,
    counts,
    noise,
    decider,
    threshold,
    proportion,
    noise_factor,
    min_points,
    tolerance,
):
    """Split the clusters of a scan into straight pieces that meet at points.

    A piece is split at the point farthest from the chord of its ends if it is not straight, and
    both its parts are looked at in turn. It is not straight if that distance is above the
    tolerance of the point (CHORD), or if two neighbouring points are off the line fitted to the
    piece, on one side of it and by more than their tolerances (LINE): one alone is an outlier.

    Also where the fitted line decides, the split is at the point farthest from the *chord*: what
    is farthest from the line fitted to the two arms of an L is one of its ends, at which nothing
    can be split.

    Parameters
    ----------
    floats, ints, counts
        See `layout`. The lines by point are read; those by candidate and by piece are written,
        CANDIDATES and PIECES. The response of a candidate, and of the corner that it becomes, is
        the distance that decided over its tolerance: the piece is split if that is above 1.
    noise : float64 array, shape (4,)
    decider : int
        CHORD or LINE.
    threshold, proportion, noise_factor : float
        The tolerance of a point at range ρ is threshold + proportion ρ + noise_factor σ_r [m].
    min_points : int
        No piece gets shorter.
    tolerance : float64 array, shape (n + 1,)
        Scratch.
    """
    response, excess = floats[RESPONSE], floats[CANDIDATE_RESPONSE]
    for i in range(counts[POINTS]):
        sigma = math.sqrt(range_variance(floats[RHO, i], noise))
        tolerance[i] = threshold + proportion * floats[RHO, i] + noise_factor * sigma
        response[i] = math.nan
    found = np.int64(0)
    for c in range(counts[CLASSES]):
        first, last = ints[CLASS_FIRST, c], ints[CLASS_LAST, c]
        found = _split_class(
            floats, ints, first, last, noise, decider, min_points, tolerance, found
        )
    for k in range(found):
        if excess[k] > 1.0:
            response[ints[CANDIDATE, k]] = excess[k]
    if counts[CLOSED]:
        found = _split_seam(floats, ints, counts[POINTS], tolerance, found)
    counts[CANDIDATES] = found
    list_pieces(floats, ints, counts)


@helper
def _split_class(floats, ints, first, last, noise, decider, min_points, tolerance, found):
    """Split one cluster. Returns the number of candidates that stand there now."""
    x, y, rho, spare = floats[X], floats[Y], floats[RHO], floats[SPARE]
    waiting_first, waiting_last = ints[STACK_FIRST], ints[STACK_LAST]
    waiting_first[0], waiting_last[0] = first, last
    depth = np.int64(1)
    while depth > 0:
        depth -= 1
        a, b = waiting_first[depth], waiting_last[depth]
        c, distance = farthest_from_chord(x, y, a, b, min_points - 1, spare)
        if c < 0:
            continue
        if decider == CHORD:
            value = distance / tolerance[c]
        else:
            value = _off_line(x, y, rho, a, b, noise, tolerance)
        ints[CANDIDATE, found] = c
        floats[CHORD_DISTANCE, found], floats[CANDIDATE_RESPONSE, found] = distance, value
        found += 1
        if value > 1.0:
            # The side before it last, so that it is the next.
            waiting_first[depth], waiting_last[depth] = c, b
            waiting_first[depth + 1], waiting_last[depth + 1] = a, c
            depth += 2
    return found


@helper
def _off_line(x, y, rho, first, last, noise, tolerance):
    """Tell by how many tolerances two neighbours are off one side of the line of a piece."""
    cx, cy, c, s, _, _, _, _ = fit_line(x, y, rho, first, last, noise, WEIGHTED)
    most, before = 0.0, 0.0
    for i in range(first, last + 1):
        off = (c * (y[i] - cy) - s * (x[i] - cx)) / tolerance[i]
        if off * before > 0.0:
            most = max(most, min(abs(off), abs(before)))
        before = off
    return most


@helper
def _split_seam(floats, ints, count, tolerance, found):
    """Examine the point at which a ring was opened: its distance from the chord over it.

    That chord leads from the last split to the first. Returns the number of candidates.
    """
    x, y, response = floats[X], floats[Y], floats[RESPONSE]
    after, before = np.int64(0), count - 1
    while after < count and math.isnan(response[after]):
        after += 1
    while before > after and math.isnan(response[before]):
        before -= 1
    if after == count:
        return found
    cx, cy = x[after] - x[before], y[after] - y[before]
    px, py = x[0] - x[before], y[0] - y[before]
    chord = math.sqrt(cx * cx + cy * cy)
    distance = abs(cx * py - cy * px) / chord if chord > 0.0 else math.sqrt(px * px + py * py)
    excess = distance / tolerance[0]
    ints[CANDIDATE, found] = 0
    floats[CHORD_DISTANCE, found], floats[CANDIDATE_RESPONSE, found] = distance, excess
    if excess > 1.0:
        response[0] = excess
    return found + 1
