"""How uneven the walls of a scan are: real ones are off straight lines by more than the noise."""

import math

from . import helper, sums
from .inverse_range import line_through
from .layout import CLASSES, FIRST, LAST, RHO, WEIGHT, X, Y
from .line_fit import range_variance
from .straightening import is_one_wall

#: Shorter walls say little; squares above so many variances are of no wall.
_LEAST_POINTS, _OUT = 8, 12.0
#: Deviations of χ² from which on walls are uneven: where neighbouring readings, or every other one
#: (beams may be of two sweeps), are off alike by more deviations than by chance, and where not.
_SURE, _ALIKE, _ALONE = 0.5, 2.5, 2.5
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
    chi_square, next_alike, second_alike, points, variance, k = 0.0, 0.0, 0.0, 0.0, 0.0, 0
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
            total, first, second, used = _of_wall(
                floats[X], floats[Y], floats[WEIGHT], start, end, a, b
            )
            # Two parameters of the line take as much of what readings have in common.
            taken = 2.0 * total / max(used, 1.0)
            next_alike, second_alike = next_alike + first + taken, second_alike + second + taken
            chi_square += total
            points += used - 2.0
            middle = floats[RHO, (start + end) // 2]
            variance += (end - start - 1) * range_variance(middle, noise)
    if points < _LEAST_POINTS:
        return 0.0
    # Of white noise, however large, χ² of products has a deviation of that of squares over √n.
    is_alike = max(next_alike, second_alike) * math.sqrt(points) > _ALIKE * chi_square
    sure = _SURE if is_alike else _ALONE
    excess = (chi_square - points - sure * math.sqrt(2.0 * points)) / points
    return min(max(_CUT_AWAY * excess, 0.0) * variance / points, MOST_UNEVEN * MOST_UNEVEN)


@sums
def _of_wall(x, y, weight, first, last, a, b):
    """χ² of the points of a wall to its line, of those that are near it, and their number.

    Between, the same with the error of the next point, and of that after it, in place of the
    square: 0 on average if errors have nothing to do with each other.
    """
    span = slice(first, last + 1)
    x, y, weight = x[span], y[span], weight[span]
    chi_square, alike, second_alike, points = 0.0, 0.0, 0.0, 0.0
    before, earlier = 0.0, 0.0
    for i in range(len(x)):
        off = 1.0 - a * x[i] - b * y[i]
        near = weight[i] * off * off <= _OUT
        off = off if near else 0.0
        chi_square += weight[i] * off * off
        alike += weight[i] * off * before
        second_alike += weight[i] * off * earlier
        points += 1.0 if near else 0.0
        before, earlier = off, before
    return chi_square, alike, second_alike, points
