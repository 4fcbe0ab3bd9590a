"""Lines through any stretch of points in O(1), by inverse-range regression.

A line is 1/ρ = a cos φ + b sin φ, linear whatever its direction; the residual times ρ² is the error
of the range, so that the weight is ρ⁴/σ². Times ρ, that is a x + b y = 1 with the weight ρ²/σ²: the
normal equations are six sums over points, and running sums give those of every stretch.
"""

import math

from . import helper
from .layout import CLASS_FIRST, CLASS_LAST, CLASSES, POINTS, RHO, WEIGHT, X, Y
from .line_fit import range_variance

#: Columns of the running sums.
SUMS = 6


@helper
def fill_sums(floats, ints, counts, noise, sums):
    """Fill WEIGHT, and the sums of w (xx, xy, yy, x, y, 1) over the points of each class.

    Row i + c is over the points of class c before its point i. They begin anew with each class,
    and keep their digits.
    """
    x, y, rho, weight = floats[X], floats[Y], floats[RHO], floats[WEIGHT]
    for i in range(counts[POINTS]):
        weight[i] = rho[i] * rho[i] / range_variance(rho[i], noise)
    for c in range(counts[CLASSES]):
        xx, xy, yy, sx, sy, s = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        first, last = ints[CLASS_FIRST, c], ints[CLASS_LAST, c]
        for i in range(first, last + 2):
            row = i + c
            sums[row, 0], sums[row, 1], sums[row, 2] = xx, xy, yy
            sums[row, 3], sums[row, 4], sums[row, 5] = sx, sy, s
            if i <= last:
                wx, wy = weight[i] * x[i], weight[i] * y[i]
                xx += wx * x[i]
                xy += wx * y[i]
                yy += wy * y[i]
                sx += wx
                sy += wy
                s += weight[i]


@helper
def line_through(sums, c, first, last):
    """Line a x + b y = 1 of the least χ² through the points `first`..`last` of class c.

    Returns
    -------
    a, b, chi_square : float
        0, 0, 0 where the points determine no line: they lie in one direction.
    """
    i, j = first + c, last + c + 1
    xx, xy, yy = sums[j, 0] - sums[i, 0], sums[j, 1] - sums[i, 1], sums[j, 2] - sums[i, 2]
    sx, sy, s = sums[j, 3] - sums[i, 3], sums[j, 4] - sums[i, 4], sums[j, 5] - sums[i, 5]
    determinant = xx * yy - xy * xy
    if determinant <= 1e-13 * xx * yy:
        return 0.0, 0.0, 0.0
    a, b = (sx * yy - sy * xy) / determinant, (sy * xx - sx * xy) / determinant
    # All of Σ w (1 - a x - b y)²: the errors of a and b by rounding then count as squares only.
    squares = a * a * xx + 2.0 * a * b * xy + b * b * yy
    return a, b, max(s - 2.0 * (a * sx + b * sy) + squares, 0.0)


@helper
def line_and_variance(sums, c, first, last):
    """Line a x + b y = 1 through points, and the variance of its angle atan2(b, a), to first order.

    0, 0, inf where the points determine no line.
    """
    a, b, _ = line_through(sums, c, first, last)
    i, j = first + c, last + c + 1
    xx, xy, yy = sums[j, 0] - sums[i, 0], sums[j, 1] - sums[i, 1], sums[j, 2] - sums[i, 2]
    # (a, b) have the covariance (yy, -xy, xx) over the determinant.
    determinant, norm = xx * yy - xy * xy, a * a + b * b
    if not determinant * norm > 0.0:
        return 0.0, 0.0, math.inf
    variance = (a * a * xx + 2.0 * a * b * xy + b * b * yy) / (determinant * norm * norm)
    return a, b, variance


@helper
def squared_error(floats, a, b, i):
    """Square of what a point is off a line, in variances of its range."""
    off = 1.0 - a * floats[X, i] - b * floats[Y, i]
    return floats[WEIGHT, i] * off * off
