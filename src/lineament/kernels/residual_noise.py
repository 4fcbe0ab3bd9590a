"""Range noise of a scan, from what its readings are off the lines through them."""

import math

from . import helper
from .inverse_range import line_through
from .layout import COST, FIRST, LABEL, LAST, PIECES, RHO, X, Y
from .line_fit import range_variance
from .noise import set_parts

#: Shorter pieces say little; fewer readings nothing.
_LEAST_POINTS, _LEAST_READINGS = 8, 30
#: Squares above so many variances are no noise.
_OUT = 12.0
#: Deviations that χ² of a piece may be above that of the others, and passes to find out which are.
_ABOVE, _PASSES = 2.0, 6
#: Pieces above it are left out where the others, of at least so much of all degrees of freedom,
#: have less than so much of the variance: by chance some are above it in scans without clutter.
_MAJORITY, _CLEARLY_LESS = 0.5, 0.75


@helper
def refine_noise(floats, ints, counts, noise, sums):
    """Estimate the noise again: e² = σ² + p² ρ² by least squares over the readings of the pieces.

    Of those that are no more off their lines than most: what a line through clutter is off, is no
    noise. p stays 0 if it was.
    """
    scale = _least_scale(floats, ints, counts, sums)
    one, x_sum, xx_sum, q_sum, qx_sum, used = 0.0, 0.0, 0.0, 0.0, 0.0, 0
    for k in range(counts[PIECES]):
        first, last = ints[FIRST, k], ints[LAST, k]
        n = last - first + 1
        if not _tells(floats, k, n, scale):
            continue
        a, b, _ = line_through(sums, ints[LABEL, first], first, last)
        for i in range(first, last + 1):
            rho = floats[RHO, i]
            error = rho - rho / (a * floats[X, i] + b * floats[Y, i])
            # A line through n readings takes two of their degrees of freedom.
            q, variance = error * error * n / (n - 2.0), range_variance(rho, noise)
            if q > _OUT * min(scale, 1.0) * variance:
                continue
            w, x = 1.0 / (variance * variance), rho * rho
            one, x_sum, xx_sum = one + w, x_sum + w * x, xx_sum + w * x * x
            q_sum, qx_sum = q_sum + w * q, qx_sum + w * q * x
            used += 1
    if used < _LEAST_READINGS:
        return
    constant, growth, least = q_sum / one, 0.0, noise[3] * noise[3] / 12.0
    determinant = one * xx_sum - x_sum * x_sum
    if noise[1] > 0.0 and determinant > 1e-6 * one * xx_sum:
        constant = (q_sum * xx_sum - qx_sum * x_sum) / determinant
        growth = (qx_sum * one - q_sum * x_sum) / determinant
        if growth < 0.0:
            constant, growth = q_sum / one, 0.0
        elif constant < least:
            constant, growth = least, max(qx_sum - least * x_sum, 0.0) / xx_sum
    set_parts(noise, constant, growth)


@helper
def _least_scale(floats, ints, counts, sums):
    """χ² of the pieces that are no more off their lines than most, over its degrees of freedom.

    inf if these are hardly less off than all are: then all tell. COST of long pieces is filled.
    """
    for k in range(counts[PIECES]):
        first, last = ints[FIRST, k], ints[LAST, k]
        if last - first + 1 >= _LEAST_POINTS:
            _, _, floats[COST, k] = line_through(sums, ints[LABEL, first], first, last)
    scale, whole, least = math.inf, math.inf, 0.0
    for step in range(_PASSES):
        total, free = 0.0, 0.0
        for k in range(counts[PIECES]):
            n = ints[LAST, k] - ints[FIRST, k] + 1
            if _tells(floats, k, n, scale):
                total += floats[COST, k]
                free += n - 2.0
        # No fewer than most; and the same again, once none is left out any more.
        if free <= least or not 0.0 < total < scale * free:
            break
        scale = total / free
        if step == 0:
            whole, least = scale, max(_MAJORITY * free, _LEAST_READINGS)
    return scale if scale < _CLEARLY_LESS * whole else math.inf


@helper
def _tells(floats, k, n, scale):
    """Whether a piece of n readings is long, and χ² of its line not far above `scale` for each."""
    if n < _LEAST_POINTS:
        return False
    return floats[COST, k] <= scale * (n - 2.0 + _ABOVE * math.sqrt(2.0 * (n - 2.0)))
