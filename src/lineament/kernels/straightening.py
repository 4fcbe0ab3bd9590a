"""Walls that bow: neighbouring pieces at so shallow an angle that they are one wall."""

import math

from . import helper
from .inverse_range import line_through
from .layout import FIRST, LAST, RHO, X, Y
from .line_fit import excess, range_variance

#: Points without a piece over which a wall goes on.
_BETWEEN = 3
#: Sine of the angle below which neighbours are one wall (10°).
_SHALLOW = 0.17
#: Root mean square of what a wall bows by, over its length, and at most [m].
_BOW, _MOST_BOW = 0.01, 0.03
#: The first of these from which on a piece is no wall.
_CROOKED = 0.05
#: What neighbours may be apart where they meet: over the length of both, but not more than panels
#: and frames stand out [m]; or deviations of a reading, if these are more.
_STEP, _FRAME, _SIGMAS = 0.02, 0.04, 3.0


@helper
def straighten(floats, ints, noise, sums, c, low, high):
    """Merge neighbours that are one wall, though it bows. Returns one more than the last left.

    Real walls are off a line by more than the noise. Neighbours are one where they turn by a
    shallow angle, without a step that a reading would show, and one line through both is off by
    little for its length.
    """
    first, last = ints[FIRST], ints[LAST]
    kept = low
    for k in range(low, high):
        first[kept], last[kept] = first[k], last[k]
        while kept > low and is_one_wall(
            floats, noise, sums, c, first[kept - 1], last[kept - 1], first[kept], last[kept]
        ):
            last[kept - 1] = last[kept]
            kept -= 1
        kept += 1
    return kept


@helper
def is_one_wall(floats, noise, sums, c, start, i, j, end):
    """Whether the points `j`..`end` go on in the wall of the points `start`..`i`."""
    if j - i > _BETWEEN + 1:
        return False
    a1, b1, _ = line_through(sums, c, start, i)
    a2, b2, _ = line_through(sums, c, j, end)
    norm1, norm2 = math.sqrt(a1 * a1 + b1 * b1), math.sqrt(a2 * a2 + b2 * b2)
    sine, cosine = a1 * b2 - a2 * b1, a1 * a2 + b1 * b2
    if cosine <= 0.0 or abs(sine) > _SHALLOW * norm1 * norm2:
        return False
    x, y = 0.5 * (floats[X, i] + floats[X, j]), 0.5 * (floats[Y, i] + floats[Y, j])
    step = abs((1.0 - a1 * x - b1 * y) / norm1 - (1.0 - a2 * x - b2 * y) / norm2)
    dx, dy = floats[X, end] - floats[X, start], floats[Y, end] - floats[Y, start]
    length = math.sqrt(dx * dx + dy * dy)
    sigma = math.sqrt(range_variance(floats[RHO, i], noise))
    if step > max(min(_STEP * length, _FRAME), _SIGMAS * sigma):
        return False
    bow = min(_BOW * length, math.sqrt(_MOST_BOW * _MOST_BOW + sigma * sigma))
    return _is_straight(floats, sums, c, start, end, bow)


@helper
def drop_crooked(floats, ints, sums, c, low, high):
    """Leave out pieces that are no line, nor a wall that bows. Returns one more than the last left.

    Stretches over clutter, that nothing explains.
    """
    first, last, x, y = ints[FIRST], ints[LAST], floats[X], floats[Y]
    kept = low
    for k in range(low, high):
        i, j = first[k], last[k]
        _, _, chi_square = line_through(sums, c, i, j)
        bow = _CROOKED * math.hypot(x[j] - x[i], y[j] - y[i])
        if excess(chi_square, j - i + 1) == 0.0 or _is_straight(floats, sums, c, i, j, bow):
            first[kept], last[kept] = i, j
            kept += 1
    return kept


@helper
def _is_straight(floats, sums, c, first, last, bow):
    """Whether points are off the line through them by at most `bow` [m], root mean square."""
    a, b, _ = line_through(sums, c, first, last)
    squares, norm = 0.0, a * a + b * b
    for i in range(first, last + 1):
        off = 1.0 - a * floats[X, i] - b * floats[Y, i]
        squares += off * off / norm
    return squares <= bow * bow * (last - first + 1)
