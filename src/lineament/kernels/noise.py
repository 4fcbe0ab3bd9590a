"""Range noise of a scan, estimated from the scan itself.

By the residuals of T. Gasser, L. Sroka, C. Jennen-Steinmetz, *Residual variance and residual
pattern in nonlinear regression*, Biometrika 73 (1986), but their median in place of their mean.
"""

import math

import numpy as np

from . import helper, kernel, usable
from . import layout as at

#: No scanner is better than this [m]; keeps covariances positive where ranges are noiseless.
LEAST_SIGMA = 1e-4
#: No scanner reports its ranges in coarser steps [m].
COARSEST_QUANTUM = 0.15
_BITS_OF_INFINITY = 0x7FF0000000000000


@kernel
def estimate_noise(floats, range_min, range_max, given, noise):
    """Write the noise of a scan: as `given`, or, where that is NaN, estimated.

    It is NaN for a scan without a usable range.
    """
    for part in range(4):
        noise[part] = given[part]
    if math.isnan(given[0]):
        ranges, scratch = at.beams_of(floats)[at.RANGE], at.points_of(floats)[at.SPARE]
        n = floats.shape[1] - at.EXTRA
        sigma = range_sigma(ranges, n, range_min, range_max, scratch)
        noise[0] = sigma
        for part in range(1, 4):
            noise[part] = 0.0 * sigma


@helper
def range_sigma(ranges, n, range_min, range_max, scratch):
    """Estimate the range noise [m] from the second differences of neighbours.

    On a smooth surface ρ[i-1] - 2ρ[i] + ρ[i+1] has the variance 6σ², and the median of its size
    is hardly moved by jumps and corners. Triples do not overlap. Where half of them are exactly
    zero, the ranges lie on a lattice coarser than the noise, and σ is that of the rounding.
    """
    count, any_usable = np.int64(0), False
    for i in range(1, n - 1, 3):
        a, b, c = ranges[i - 1], ranges[i], ranges[i + 1]
        if (
            usable(a, range_min, range_max)
            and usable(b, range_min, range_max)
            and usable(c, range_min, range_max)
        ):
            scratch[count] = abs(a - 2.0 * b + c)
            count += 1
    if count == 0:
        for i in range(n):
            any_usable |= usable(ranges[i], range_min, range_max)
        return LEAST_SIGMA if any_usable else math.nan
    sigma = 1.4826 / math.sqrt(6.0) * ranked(scratch, count, (count - 1) // 2)
    return sigma if sigma >= LEAST_SIGMA else _rounding_sigma(scratch, count)


@helper
def _rounding_sigma(differences, count):
    """Deviation of rounding to a lattice, whose step is the least of the second differences."""
    quantum = math.inf
    for i in range(count):
        # What is coarser than any lattice is a jump.
        if LEAST_SIGMA < differences[i] < min(quantum, COARSEST_QUANTUM):
            quantum = differences[i]
    return max(quantum / math.sqrt(12.0), LEAST_SIGMA) if quantum < math.inf else LEAST_SIGMA


@helper
def ranked(values, count, rank):
    """Return the value of a rank, from 0 on, of the first `count`, all of them at least 0.

    The bits of such numbers have their order, so that bisection ends after 63 rounds at most, and
    most often after twenty. It has no branches that depend on the values.
    """
    bits = values[:count].view(np.int64)
    low, high = np.int64(-1), np.int64(_BITS_OF_INFINITY)
    while high - low > 1:
        middle = low + (high - low) // 2
        below = 0
        for i in range(count):
            below += bits[i] <= middle
        if below > rank:
            high = middle
            if below == rank + 1:
                break
        else:
            low = middle
    largest = np.int64(0)
    for i in range(count):
        largest = max(largest, bits[i] if bits[i] <= high else np.int64(0))
    found = np.int64(largest)
    return found.view(np.float64)
