"""Neighbouring pieces joined at corners, or parted where a surface ends before another."""

import math

import numpy as np

from . import helper
from .inverse_range import line_through
from .layout import (
    BEAM,
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
    RESPONSE,
    RHO,
    RISE,
    STACK_FIRST,
    STACK_LAST,
    X,
    Y,
)
from .line_fit import excess, range_variance

#: Points without a piece over which neighbours still meet.
_BETWEEN = 8
#: Sine of the least angle of a corner (5.7°).
_LEAST_SINE = 0.1
#: Spacings that readings of one surface may be apart.
_APART = 2.0


@helper
def join(floats, ints, counts, noise, sums, step):
    """Join the pieces where they meet; a class ends where two neighbours do not.

    RISE is by piece how much χ² rises if it is merged with the one before; where they meet it is
    the RESPONSE of the corner. Each such border is a candidate. Lines by piece are filled, and the
    classes listed anew.
    """
    first, last, before, response = ints[FIRST], ints[LAST], ints[BEFORE], floats[RESPONSE]
    k, classes = np.int64(0), np.int64(0)
    for c in range(counts[CLASSES]):
        start, end, low = ints[CLASS_FIRST, c], ints[CLASS_LAST, c], k
        while k < counts[PIECES] and first[k] <= end:
            before[k], response[k], floats[RISE, k] = -1, math.nan, math.inf
            floats[LINE_A, k], floats[LINE_B, k], floats[COST, k] = line_through(
                sums, c, first[k], last[k]
            )
            if k > low and first[k] - last[k - 1] <= _BETWEEN + 1:
                _, _, joint = line_through(sums, c, first[k - 1], last[k])
                floats[RISE, k] = joint - floats[COST, k - 1] - floats[COST, k]
                _note_candidate(floats, ints, counts, k)
                if _meet(floats, ints, noise, k - 1, k, step):
                    before[k], response[k] = k - 1, floats[RISE, k]
                elif not _touch(floats, ints, noise, k - 1, k):
                    ints[STACK_FIRST, classes], ints[STACK_LAST, classes] = start, first[k] - 1
                    start = first[k]
                    classes += 1
            k += 1
        if counts[CLOSED] and k - low > 2 and _meet(floats, ints, noise, k - 1, low, step):
            before[low], response[low] = k - 1, math.inf
        ints[STACK_FIRST, classes], ints[STACK_LAST, classes] = start, end
        classes += 1
    _list_classes(ints, counts, classes)


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
    """Take the classes from the stack, and label their points."""
    for c in range(classes):
        first, last = ints[STACK_FIRST, c], ints[STACK_LAST, c]
        ints[CLASS_FIRST, c], ints[CLASS_LAST, c] = first, last
        for i in range(first, last + 1):
            ints[LABEL, i] = c
    counts[CLASSES] = classes


@helper
def _meet(floats, ints, noise, p, q, step):
    """Whether a piece and its neighbour meet between their readings.

    Between, but for a beam and three standard deviations of where they meet.
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
    share = 1.0 + _end_share(floats, ints, p) + _end_share(floats, ints, q)
    deviation = math.sqrt(range_variance(rho, noise) * share) / sine
    tolerance = step * rho + 3.0 * deviation
    after = (floats[X, i] * y - floats[Y, i] * x) / floats[RHO, i]
    before = (x * floats[Y, j] - y * floats[X, j]) / floats[RHO, j]
    ahead = floats[X, i] * x + floats[Y, i] * y > 0.0
    return ahead and after > -tolerance and before > -tolerance


@helper
def _touch(floats, ints, noise, p, q):
    """Whether readings of neighbours are no farther apart than those within either of them.

    Then something small is between them, and no surface ends in front of another.
    """
    i, j = ints[LAST, p], ints[FIRST, q]
    x, y, beam = floats[X], floats[Y], ints[BEAM]
    apart = math.hypot(x[j] - x[i], y[j] - y[i])
    before = math.hypot(x[i] - x[i - 1], y[i] - y[i - 1]) / max(beam[i] - beam[i - 1], 1)
    after = math.hypot(x[j + 1] - x[j], y[j + 1] - y[j]) / max(beam[j + 1] - beam[j], 1)
    beams = max(beam[j] - beam[i], 1)
    sigma = math.sqrt(range_variance(max(floats[RHO, i], floats[RHO, j]), noise))
    return apart <= _APART * beams * max(before, after) + 3.0 * sigma


@helper
def _end_share(floats, ints, k):
    """Variance of a piece's offset at its end, in variances of a reading.

    Of n readings on a line it is 4/n. Where a wall bows, twice what χ² has too much is added.
    """
    n = ints[LAST, k] - ints[FIRST, k] + 1
    return 4.0 / n + 4.0 * excess(floats[COST, k], n)
