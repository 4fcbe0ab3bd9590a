"""Where neighbours that do not meet part: a surface ends in front of another, or behind it."""

import math

import numpy as np

from . import helper
from .layout import (
    ARC_FIRST,
    ARC_LAST,
    ARC_R,
    ARC_X,
    ARC_Y,
    COST,
    FIRST,
    LAST,
    LINE_A,
    LINE_B,
    RHO,
    X,
    Y,
)
from .line_fit import excess, range_variance

#: Deviations from which on a reading, or a line, is behind another.
OFF = 3.0
#: Variance of a border between two pieces, in variances of a reading.
_SHARE = 0.2
#: Beams that a face between two pieces has at least: where readings lie between them, and where
#: none do, as these may have been taken for the pieces'.
_SEEN, _SWALLOWED = 0.5, 1.0


@helper
def cleared_at(floats, ints, noise, arc, j, way):
    """First point of the class that begins between an arc and its neighbour at point j, or -1.

    The neighbour goes on in direction `way`; it may come as near as its own readings are apart.
    """
    x, y, other = floats[X], floats[Y], j + way
    spacing = math.hypot(x[other] - x[j], y[other] - y[j])
    sigma = math.sqrt(range_variance(floats[RHO, j], noise))
    clearance = math.hypot(x[j] - floats[ARC_X, arc], y[j] - floats[ARC_Y, arc])
    if clearance - floats[ARC_R, arc] <= spacing + OFF * sigma:
        return np.int64(-1)
    return ints[ARC_LAST, arc] + 1 if way > 0 else ints[ARC_FIRST, arc]


@helper
def parted_at(floats, ints, noise, p, q, step):
    """First point of the class that begins between two pieces that do not meet, or -1.

    They are parted by an edge that hides what is behind it. Points between belong to the farther.
    """
    i, j, rho = ints[LAST, p], ints[FIRST, q], floats[RHO]
    limit = OFF * math.sqrt(range_variance(max(rho[i], rho[j]), noise))
    if j == i + 1:
        front = gap(floats, ints, p, q)
        share = _SHARE + end_share(floats, ints, p) + end_share(floats, ints, q)
        if abs(front) <= limit * math.sqrt(share):
            return np.int64(-1)
        first_is_nearer = front > 0.0
        face = _face(floats, p, i, 1, j) if first_is_nearer else _face(floats, q, j, -1, i)
        return j if face <= _SWALLOWED * step else np.int64(-1)
    before = _behind(floats, p, i + 1) > limit and _face(floats, p, i, 1, j) <= _SEEN * step
    after = _behind(floats, q, j - 1) > limit and _face(floats, q, j, -1, i) <= _SEEN * step
    if not before and not after:
        in_front = 0
        for k in range(i + 1, j):
            in_front += max(_behind(floats, p, k), _behind(floats, q, k)) < -limit
        # A single one is a false return, and the wall goes on behind it.
        before, after = in_front > 1, in_front > 1
    if before and (not after or rho[i] <= rho[j]):
        return i + 1
    return j if after else np.int64(-1)


@helper
def gap(floats, ints, p, q):
    """How far a piece is in front of the next where they come nearest between their readings [m].

    Less than 0 where it is behind; 0 where their lines cross there.
    """
    i, j = ints[LAST, p], ints[FIRST, q]
    a, b = floats[LINE_A, p] - floats[LINE_A, q], floats[LINE_B, p] - floats[LINE_B, q]
    # a x + b y is by how much their inverse ranges differ, over that of the reading.
    here = (a * floats[X, i] + b * floats[Y, i]) * floats[RHO, i]
    there = (a * floats[X, j] + b * floats[Y, j]) * floats[RHO, j]
    if here * there <= 0.0:
        return 0.0
    return here if abs(here) < abs(there) else there


@helper
def _behind(floats, k, i):
    """How far a point is behind the line of a piece, along its beam [m]."""
    inverse = floats[LINE_A, k] * floats[X, i] + floats[LINE_B, k] * floats[Y, i]
    return floats[RHO, i] * (1.0 - 1.0 / inverse) if inverse > 0.0 else -floats[RHO, i]


@helper
def _face(floats, k, i, way, end):
    """Sine of the angle in which a face at right angles to a piece, from its end i, is seen.

    It goes as far back as the points up to `end`, which is `way` from i. Less than 0 is a face that
    the piece hides.
    """
    x, y, a, b = floats[X], floats[Y], floats[LINE_A, k], floats[LINE_B, k]
    square, depth = a * a + b * b, 0.0
    for step in range(1, way * (end - i) + 1):
        j = i + way * step
        depth = max(depth, (a * x[j] + b * y[j] - 1.0) / square)
    back_x, back_y = x[i] + depth * a, y[i] + depth * b
    return way * (x[i] * back_y - y[i] * back_x) / (floats[RHO, i] * math.hypot(back_x, back_y))


@helper
def end_share(floats, ints, k):
    """Variance of a piece's offset at its end, in variances of a reading.

    Of n readings on a line it is 4/n. Where a wall bows, twice what χ² has too much is added.
    """
    n = ints[LAST, k] - ints[FIRST, k] + 1
    return 4.0 / n + 4.0 * excess(floats[COST, k], n)
