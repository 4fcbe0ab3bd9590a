"""χ² of lines, in O(1) by running sums. ``docs/optimal.md`` has the model of a scan."""

import math

import numpy as np

from .. import contracted, helper
from . import layout as at
from .constants import GROUP, LARGEST, SINGULAR, TAU


@contracted
def fill_sums(points, count, constant, growth, sums):
    """Sum w (xx, xy, yy, x, y, 1), w = ρ² / (σ² + τ²), of all measurements before each one.

    A line is a x + b y = 1, and 1 - a x - b y the error of ρ over ρ: linear whatever the direction
    of the line (inverse-range regression).
    """
    x, y, rho = points[at.X], points[at.Y], points[at.RHO]
    constant += TAU * TAU
    xx, xy, yy, sx, sy, s = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for row in range(at.SUMS):
        sums[row, 0] = 0.0
    for i in range(count):
        square = rho[i] * rho[i]
        w = square / (constant + growth * square)
        wx, wy = w * x[i], w * y[i]
        xx, xy, yy = xx + wx * x[i], xy + wx * y[i], yy + wy * y[i]
        sx, sy, s = sx + wx, sy + wy, s + w
        sums[at.WXX, i + 1], sums[at.WXY, i + 1], sums[at.WYY, i + 1] = xx, xy, yy
        sums[at.WX, i + 1], sums[at.WY, i + 1], sums[at.W, i + 1] = sx, sy, s


@helper
def _before(sums, i):
    """Return the sums over the measurements before i."""
    return (
        sums[at.WXX, i], sums[at.WXY, i], sums[at.WYY, i],
        sums[at.WX, i], sums[at.WY, i], sums[at.W, i],
    )  # fmt: skip


@helper
def _between(sums, i, j):
    """Return the sums over the measurements i … j - 1."""
    (xx, xy, yy, x, y, s), (xx1, xy1, yy1, x1, y1, s1) = _before(sums, i), _before(sums, j)
    return xx1 - xx, xy1 - xy, yy1 - yy, x1 - x, y1 - y, s1 - s


@contracted
def solve(sums, i, j):
    """Return the line a x + b y = 1 of least squares of measurements i … j - 1; 0, 0 if none."""
    xx, xy, yy, x, y, _ = _between(sums, i, j)
    determinant = xx * yy - xy * xy
    if not determinant > SINGULAR * xx * yy:
        return 0.0, 0.0
    return (x * yy - y * xy) / determinant, (y * xx - x * xy) / determinant


@contracted
def chi_square(xx, xy, yy, x, y, s):
    """χ² of the line of least squares, by sums; inf where they determine none."""
    determinant = xx * yy - xy * xy
    if not determinant > SINGULAR * xx * yy:
        return math.inf
    return max(s - (x * (x * yy - y * xy) + y * (y * xx - x * xy)) / determinant, 0.0)


@contracted
def cost(sums, i, j):
    """χ² of the line of least squares through the measurements i … j - 1."""
    xx, xy, yy, x, y, s = _between(sums, i, j)
    return chi_square(xx, xy, yy, x, y, s)


@contracted
def costs_on(sums, i, low, high, energy, out):
    """Write the energy, with that before it, of a line from measurement i to each of low … high."""
    xx0, xy0, yy0, x0, y0, s0 = _before(sums, i)
    xx, xy, yy = sums[at.WXX, low:high], sums[at.WXY, low:high], sums[at.WYY, low:high]
    x, y, s, out = sums[at.WX, low:high], sums[at.WY, low:high], sums[at.W, low:high], out[low:high]
    for k in range(len(out)):
        out[k] = energy + chi_square(
            xx[k] - xx0, xy[k] - xy0, yy[k] - yy0, x[k] - x0, y[k] - y0, s[k] - s0
        )


@contracted
def least_from(sums, low, high, j, energy):
    """Least energy, with that before it, of a line to measurement j from one of low … high - 1.

    There are up to `GROUP`; also returns from which. Positive numbers have the order of their bits:
    with its place in the last five, the least whole number says both. Nothing is written, so that
    no arrays are compared for overlap, and four lines are evaluated at once.
    """
    xx1, xy1, yy1, x1, y1, s1 = _before(sums, j)
    xx, xy, yy = sums[at.WXX, low:high], sums[at.WXY, low:high], sums[at.WYY, low:high]
    x, y, s, energy = (
        sums[at.WX, low:high],
        sums[at.WY, low:high],
        sums[at.W, low:high],
        energy[low:high],
    )
    least = np.int64(LARGEST)
    for k in range(len(energy)):
        value = energy[k] + chi_square(
            xx1 - xx[k], xy1 - xy[k], yy1 - yy[k], x1 - x[k], y1 - y[k], s1 - s[k]
        )
        least = min(least, (np.float64(value).view(np.int64) & -GROUP) | k)
    return np.int64(least & -GROUP).view(np.float64), low + (least & (GROUP - 1))


@helper
def joint_cost(sums, i, j, k, m):
    """Rise of χ² if the measurements i … j - 1 and k … m - 1 are on one line, not on two."""
    xx0, xy0, yy0, x0, y0, s0 = _between(sums, i, j)
    xx, xy, yy, x, y, s = _before(sums, m)
    xx1, xy1, yy1, x1, y1, s1 = _before(sums, k)
    joint = chi_square(
        xx0 + xx - xx1, xy0 + xy - xy1, yy0 + yy - yy1, x0 + x - x1, y0 + y - y1, s0 + s - s1
    )
    return joint - cost(sums, i, j) - cost(sums, k, m)
