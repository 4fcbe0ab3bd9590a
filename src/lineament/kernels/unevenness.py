"""How uneven the walls of a scan are: real ones are off straight lines by more than the noise."""

import math

from . import helper, sums
from .inverse_range import line_through
from .layout import CLASSES, FIRST, LAST, RHO, WEIGHT, X, Y
from .line_fit import range_variance
from .straightening import is_one_wall

#: Shorter walls say little; squares above so many variances are of no wall.
_LEAST_POINTS, _OUT = 8, 12.0
#: Deviations of χ² from which on walls are uneven.
_SURE = 0.5
#: Where they are, the pieces are parts of walls, cut where these are off: so many times more.
_CUT_AWAY = 80.0
#: What plaster, panels and frames are off by, root mean square, and no more [m].
MOST_UNEVEN = 0.015


@helper
def wall_unevenness(floats, ints, counts, noise, running, ends):
    """Variance [m²] that the walls among the pieces have beyond the noise; 0 for straight ones.

    A wall is a run of neighbouring pieces at shallow angles. `ends` are the pieces behind the last
    of each class.
    """
    chi_square, points, variance, k = 0.0, 0.0, 0.0, 0
    for c in range(counts[CLASSES]):
        while k < ends[c]:
            start, end = ints[FIRST, k], ints[LAST, k]
            k += 1
            while k < ends[c] and is_one_wall(
                floats, noise, running, c, start, end, ints[FIRST, k], ints[LAST, k]
            ):
                end = ints[LAST, k]
                k += 1
            if end - start + 1 < _LEAST_POINTS:
                continue
            a, b, _ = line_through(running, c, start, end)
            total, used = _of_wall(floats[X], floats[Y], floats[WEIGHT], start, end, a, b)
            chi_square += total
            points += used - 2.0
            middle = floats[RHO, (start + end) // 2]
            variance += (end - start - 1) * range_variance(middle, noise)
    if points < _LEAST_POINTS:
        return 0.0
    excess = (chi_square - points - _SURE * math.sqrt(2.0 * points)) / points
    return min(max(_CUT_AWAY * excess, 0.0) * variance / points, MOST_UNEVEN * MOST_UNEVEN)


@sums
def _of_wall(x, y, weight, first, last, a, b):
    """χ² of the points of a wall to its line, of those that are near it, and their number."""
    span = slice(first, last + 1)
    x, y, weight = x[span], y[span], weight[span]
    chi_square, points = 0.0, 0.0
    for i in range(len(x)):
        off = 1.0 - a * x[i] - b * y[i]
        error = weight[i] * off * off
        near = error <= _OUT
        chi_square += error if near else 0.0
        points += 1.0 if near else 0.0
    return chi_square, points
