"""Range noise of a scan, from what its readings are off the lines through them."""

from . import helper
from .inverse_range import line_through
from .layout import FIRST, LABEL, LAST, PIECES, RHO, X, Y
from .line_fit import range_variance
from .noise import set_parts

#: Shorter pieces say little; fewer readings nothing.
_LEAST_POINTS, _LEAST_READINGS = 8, 30
#: Squares above so many variances are no noise.
_OUT = 12.0


@helper
def refine_noise(floats, ints, counts, noise, sums):
    """Estimate the noise again: e² = σ² + p² ρ² by least squares over the readings of all pieces.

    p stays 0 if it was.
    """
    one, x_sum, xx_sum, q_sum, qx_sum, used = 0.0, 0.0, 0.0, 0.0, 0.0, 0
    for k in range(counts[PIECES]):
        first, last = ints[FIRST, k], ints[LAST, k]
        n = last - first + 1
        if n < _LEAST_POINTS:
            continue
        a, b, _ = line_through(sums, ints[LABEL, first], first, last)
        for i in range(first, last + 1):
            rho = floats[RHO, i]
            error = rho - rho / (a * floats[X, i] + b * floats[Y, i])
            # A line through n readings takes two of their degrees of freedom.
            q, variance = error * error * n / (n - 2.0), range_variance(rho, noise)
            if q > _OUT * variance:
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
