"""Range noise of a scan, estimated from the scan itself."""

import math

import numpy as np

from . import helper, kernel, usable
from .layout import RANGE, SPARE

#: No scanner is better than this [m]; keeps covariances positive where ranges are noiseless.
LEAST_SIGMA = 1e-4
#: No scanner reports its ranges in coarser steps [m].
COARSEST_QUANTUM = 0.15


@kernel
def estimate_noise(floats, range_min, range_max, given, noise):
    """Write the noise of a scan: as `given`, or, where that is NaN, estimated.

    Parameters
    ----------
    floats : float64 array, shape (FLOATS, n + 1)
        RANGE is read.
    range_min, range_max : float
    given : float64 array, shape (4,)
        (sigma, proportional, bearing, quantum).
    noise : float64 array, shape (4,)
        Result; NaN for a scan without a usable range.
    """
    for part in range(4):
        noise[part] = given[part]
    if math.isnan(given[0]):
        n = floats.shape[1] - 1
        sigma = range_sigma(floats[RANGE], n, range_min, range_max, floats[SPARE])
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
    sigma = 1.4826 / math.sqrt(6.0) * _median(scratch, count)
    if sigma >= LEAST_SIGMA:
        return sigma
    quantum = math.inf
    for i in range(count):
        # What is coarser than any lattice is a jump.
        if LEAST_SIGMA < scratch[i] < min(quantum, COARSEST_QUANTUM):
            quantum = scratch[i]
    return max(quantum / math.sqrt(12.0), LEAST_SIGMA) if quantum < math.inf else LEAST_SIGMA


@helper
def _median(values, count):
    """Lower median of the first `count` values, which it reorders (Hoare's selection)."""
    low, high, middle = 0, count - 1, (count - 1) // 2
    while low < high:
        pivot = values[(low + high) // 2]
        i, j = low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            break
    return values[middle]
