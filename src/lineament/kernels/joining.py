"""Neighbouring pieces joined at corners, or parted where a surface ends before another."""

import math

import numpy as np

from . import helper
from .inverse_range import line_through
from .layout import (
    ARC_FIRST,
    ARC_LAST,
    ARCS,
    BEFORE,
    CANDIDATE,
    CANDIDATE_RESPONSE,
    CANDIDATES,
    CHORD_DISTANCE,
    CLASS_FIRST,
    CLASS_LAST,
    CLASSES,
    CLOSED,
    COST,
    FIRST,
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
from .line_fit import range_variance
from .parting import OFF, cleared_at, end_share, gap, parted_at

#: Points without a piece over which neighbours still meet.
_BETWEEN = 8
#: What comes next.
_NONE, _PIECE, _ARC = 0, 1, 2
#: Sine of the least angle of a corner (5.7°).
_LEAST_SINE = 0.1
#: Beams beside their readings where neighbours may still meet.
_MISSED = 0.5
#: Deviations that neighbours which meet may be apart at their readings: walls have frames.
_APART = 6.0


@helper
def join(floats, ints, counts, noise, sums, step):
    """Join the pieces where they meet; a class ends where neighbours do not.

    Neighbours are pieces and arcs. RISE is by piece how much χ² rises if it is merged with the one
    before; where they meet it is the RESPONSE of the corner. Each such border is a candidate. Lines
    by piece are filled, and the classes listed anew.
    """
    k, arc, classes = np.int64(0), np.int64(0), np.int64(0)
    for c in range(counts[CLASSES]):
        # `end` is the last point of what is before, -1 for nothing.
        start, low, end, after_arc = ints[CLASS_FIRST, c], k, np.int64(-1), False
        while True:
            kind, at = _next_kind(ints, counts, k, arc, ints[CLASS_LAST, c]), np.int64(-1)
            if kind == _NONE:
                break
            if kind == _ARC:
                if end >= 0:
                    at = cleared_at(floats, ints, noise, arc, end, -1)
                end, after_arc = ints[ARC_LAST, arc], True
                arc += 1
            else:
                _begin_piece(floats, ints, sums, c, k)
                if after_arc:
                    at = cleared_at(floats, ints, noise, arc - 1, ints[FIRST, k], 1)
                elif end >= 0:
                    at = _bordered_at(floats, ints, counts, noise, sums, c, k, step)
                end, after_arc = ints[LAST, k], False
                k += 1
            if at >= 0:
                ints[STACK_FIRST, classes], ints[STACK_LAST, classes] = start, at - 1
                start = at
                classes += 1
        if counts[CLOSED]:
            _close(floats, ints, counts, noise, low, k - 1, step)
        ints[STACK_FIRST, classes], ints[STACK_LAST, classes] = start, ints[CLASS_LAST, c]
        classes += 1
    _list_classes(ints, counts, classes)


@helper
def _next_kind(ints, counts, k, arc, end):
    """Tell what comes first up to point `end`: the k-th piece, the arc, or none of them."""
    piece_at = ints[FIRST, k] if k < counts[PIECES] else end + 1
    arc_at = ints[ARC_FIRST, arc] if arc < counts[ARCS] else end + 1
    if min(piece_at, arc_at) > end:
        return _NONE
    return _PIECE if piece_at < arc_at else _ARC


@helper
def _begin_piece(floats, ints, sums, c, k):
    """Fill the line of a piece, that is not joined yet."""
    ints[BEFORE, k], floats[RESPONSE, k], floats[RISE, k] = -1, math.nan, math.inf
    floats[LINE_A, k], floats[LINE_B, k], floats[COST, k] = line_through(
        sums, c, ints[FIRST, k], ints[LAST, k]
    )


@helper
def _bordered_at(floats, ints, counts, noise, sums, c, k, step):
    """Join a piece to the one before at a corner, or tell where the next class begins, or -1."""
    if ints[FIRST, k] - ints[LAST, k - 1] <= _BETWEEN + 1:
        _, _, joint = line_through(sums, c, ints[FIRST, k - 1], ints[LAST, k])
        floats[RISE, k] = joint - floats[COST, k - 1] - floats[COST, k]
        _note_candidate(floats, ints, counts, k)
        if _meet(floats, ints, noise, k - 1, k, step):
            ints[BEFORE, k], floats[RESPONSE, k] = k - 1, floats[RISE, k]
            return np.int64(-1)
    return parted_at(floats, ints, noise, k - 1, k, step)


@helper
def _close(floats, ints, counts, noise, low, high, step):
    """Join the last piece of a closed class to its first, or part them."""
    if high - low < 2:
        return
    rho = floats[RHO, ints[FIRST, low]]
    if _meet(floats, ints, noise, high, low, step):
        ints[BEFORE, low], floats[RESPONSE, low] = high, math.inf
    elif abs(gap(floats, ints, high, low)) > OFF * math.sqrt(range_variance(rho, noise)):
        counts[CLOSED] = 0


@helper
def _note_candidate(floats, ints, counts, k):
    """Note the first point of a piece, how far it is off the line before, and its RISE."""
    n, i, a, b = counts[CANDIDATES], ints[FIRST, k], floats[LINE_A, k - 1], floats[LINE_B, k - 1]
    norm = math.sqrt(a * a + b * b)
    # Points all around have no line.
    off = abs(1.0 - a * floats[X, i] - b * floats[Y, i]) / norm if norm > 0.0 else math.inf
    ints[CANDIDATE, n] = i
    floats[CHORD_DISTANCE, n], floats[CANDIDATE_RESPONSE, n] = off, floats[RISE, k]
    counts[CANDIDATES] = n + 1


@helper
def _list_classes(ints, counts, classes):
    """Take the classes from the stack, and label their points: those over a seam alike."""
    for c in range(classes):
        first, last = ints[STACK_FIRST, c], ints[STACK_LAST, c]
        ints[CLASS_FIRST, c], ints[CLASS_LAST, c] = first, last
        for i in range(first, last + 1):
            ints[LABEL, i] = c
    if counts[CLOSED] and classes > 0:
        for i in range(ints[CLASS_FIRST, classes - 1], counts[POINTS]):
            ints[LABEL, i] = 0
    counts[CLASSES] = classes


@helper
def _meet(floats, ints, noise, p, q, step):
    """Whether a piece and its neighbour meet between their readings.

    Between, but for half a beam; or three standard deviations of where they meet, if no reading
    there is far off the other line. If a deviation is more than both are long together, they may
    meet anywhere.
    """
    i, j = ints[LAST, p], ints[FIRST, q]
    a1, b1, a2, b2 = floats[LINE_A, p], floats[LINE_B, p], floats[LINE_A, q], floats[LINE_B, q]
    determinant = a1 * b2 - a2 * b1
    norms = math.sqrt((a1 * a1 + b1 * b1) * (a2 * a2 + b2 * b2))
    if not abs(determinant) > _LEAST_SINE * norms:
        return False
    sine = abs(determinant) / norms
    x, y = (b2 - b1) / determinant, (a1 - a2) / determinant
    rho = 0.5 * (floats[RHO, i] + floats[RHO, j])
    # The border was placed by a reading, with its own noise.
    share = 1.0 + end_share(floats, ints, p) + end_share(floats, ints, q)
    sigma = math.sqrt(range_variance(rho, noise) * share)
    if sigma > sine * (_length(floats, ints, p) + _length(floats, ints, q)):
        return False
    if not floats[X, i] * x + floats[Y, i] * y > 0.0:
        return False  # Behind the sensor.
    after = (floats[X, i] * y - floats[Y, i] * x) / floats[RHO, i]
    before = (x * floats[Y, j] - y * floats[X, j]) / floats[RHO, j]
    outside = -min(after, before) - _MISSED * step * rho
    if outside <= 0.0:
        return True
    # Of a wall that is seen edge-on, little beside the beams is much along them.
    return outside <= 3.0 * sigma / sine and abs(gap(floats, ints, p, q)) <= _APART * sigma


@helper
def _length(floats, ints, k):
    """Distance of the first and the last reading of a piece [m]."""
    i, j = ints[FIRST, k], ints[LAST, k]
    return math.hypot(floats[X, j] - floats[X, i], floats[Y, j] - floats[Y, i])
