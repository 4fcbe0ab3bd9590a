"""χ² of lines, in O(1) by running sums. ``docs/optimal.md`` has the model of a scan."""

import math

import numpy as np

from .. import contracted, helper
from . import layout as at
from .constants import TAU

#: Candidates that are evaluated at once, a power of two.
GROUP = 32
#: Of whole numbers.
_LARGEST = 2**63 - 1


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
        sums[0, i + 1], sums[1, i + 1], sums[2, i + 1] = xx, xy, yy
        sums[3, i + 1], sums[4, i + 1], sums[5, i + 1] = sx, sy, s


@helper
def _between(sums, i, j):
    """Return the sums over the measurements i … j - 1."""
    return (
        sums[0, j] - sums[0, i], sums[1, j] - sums[1, i], sums[2, j] - sums[2, i],
        sums[3, j] - sums[3, i], sums[4, j] - sums[4, i], sums[5, j] - sums[5, i],
    )  # fmt: skip


@contracted
def solve(sums, i, j):
    """Return the line a x + b y = 1 of least squares of measurements i … j - 1; 0, 0 if none."""
    xx, xy, yy, x, y, _ = _between(sums, i, j)
    determinant = xx * yy - xy * xy
    if not determinant > 1e-12 * xx * yy:
        return 0.0, 0.0
    return (x * yy - y * xy) / determinant, (y * xx - x * xy) / determinant


@contracted
def chi_square(xx, xy, yy, x, y, s):
    """χ² of the line of least squares, by sums; inf where they determine none."""
    determinant = xx * yy - xy * xy
    if not determinant > 1e-12 * xx * yy:
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
    p0, p1, p2, p3, p4, p5 = sums[0, i], sums[1, i], sums[2, i], sums[3, i], sums[4, i], sums[5, i]
    xx, xy, yy = sums[0, low:high], sums[1, low:high], sums[2, low:high]
    x, y, s, out = sums[3, low:high], sums[4, low:high], sums[5, low:high], out[low:high]
    for k in range(len(out)):
        out[k] = energy + chi_square(
            xx[k] - p0, xy[k] - p1, yy[k] - p2, x[k] - p3, y[k] - p4, s[k] - p5
        )


@contracted
def least_from(sums, low, high, j, energy):
    """Least energy, with that before it, of a line to measurement j from one of low … high - 1.

    There are up to `GROUP`; also returns from which. Positive numbers have the order of their bits:
    with its place in the last five, the least whole number says both. Nothing is written, so that
    no arrays are compared for overlap, and four lines are evaluated at once.
    """
    q0, q1, q2, q3, q4, q5 = sums[0, j], sums[1, j], sums[2, j], sums[3, j], sums[4, j], sums[5, j]
    xx, xy, yy = sums[0, low:high], sums[1, low:high], sums[2, low:high]
    x, y, s, energy = sums[3, low:high], sums[4, low:high], sums[5, low:high], energy[low:high]
    least = np.int64(_LARGEST)
    for k in range(len(energy)):
        value = energy[k] + chi_square(
            q0 - xx[k], q1 - xy[k], q2 - yy[k], q3 - x[k], q4 - y[k], q5 - s[k]
        )
        least = min(least, (np.float64(value).view(np.int64) & -GROUP) | k)
    return np.int64(least & -GROUP).view(np.float64), low + (least & (GROUP - 1))


@helper
def joint_cost(sums, i, j, k, m):
    """Rise of χ² if the measurements i … j - 1 and k … m - 1 are on one line, not on two."""
    joint = chi_square(
        sums[0, j] - sums[0, i] + sums[0, m] - sums[0, k],
        sums[1, j] - sums[1, i] + sums[1, m] - sums[1, k],
        sums[2, j] - sums[2, i] + sums[2, m] - sums[2, k],
        sums[3, j] - sums[3, i] + sums[3, m] - sums[3, k],
        sums[4, j] - sums[4, i] + sums[4, m] - sums[4, k],
        sums[5, j] - sums[5, i] + sums[5, m] - sums[5, k],
    )
    return joint - cost(sums, i, j) - cost(sums, k, m)
