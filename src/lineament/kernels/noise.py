"""Range noise of a scan, estimated from the scan itself."""

import math

import numpy as np

from . import helper, kernel, usable
from .layout import RANGE, SPARE, X, Y

#: No scanner is better than this [m]; keeps covariances positive where ranges are noiseless.
LEAST_SIGMA = 1e-4
#: No scanner reports its ranges in coarser steps [m].
COARSEST_QUANTUM = 0.15
#: Fewer triples of neighbours say little about how noise grows with range.
_LEAST_TRIPLES = 12


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


@helper
def estimate_by_range(floats, range_min, range_max, grows, noise):
    """Estimate the constant and the proportional part of the noise, from second differences.

    Of the near and of the far half of the readings apart: the variance of a range is
    σ² + p² ρ² in both. As `range_sigma`, but by the mean square of what is not far out, which a
    lattice does not bias and which scatters less than the median. p is 0 where the halves are
    about as noisy, or if it does not grow.
    """
    n = floats.shape[1] - 1
    near, far, at = floats[SPARE], floats[X], floats[Y]
    count = _second_differences(floats[RANGE], n, range_min, range_max, near, at)
    for i in range(count):
        far[i] = at[i]
    middle = _median(far, count) if count > 0 else 0.0
    low, high, near_squares, far_squares = np.int64(0), np.int64(0), 0.0, 0.0
    for i in range(count):
        if at[i] <= middle:
            near_squares += at[i] * at[i]
            near[low] = near[i]
            low += 1
        else:
            far_squares += at[i] * at[i]
            far[high] = near[i]
            high += 1
    if low < _LEAST_TRIPLES or high < _LEAST_TRIPLES:
        noise[0], noise[1] = range_sigma(floats[RANGE], n, range_min, range_max, near), 0.0
        return
    near_squares, far_squares = near_squares / low, far_squares / high
    v_near, v_far = _clipped_variance(near, low), _clipped_variance(far, high)
    if not grows or far_squares < 1.2 * near_squares or v_far < 1.7 * v_near:
        noise[0], noise[1] = math.sqrt((low * v_near + high * v_far) / count), 0.0
        return
    growth = (v_far - v_near) / (far_squares - near_squares)
    constant = v_near - growth * near_squares
    if constant < 0.0:
        constant, growth = 0.0, 0.5 * (v_near / near_squares + v_far / far_squares)
    noise[0], noise[1] = max(math.sqrt(constant), LEAST_SIGMA), math.sqrt(growth)


@helper
def _second_differences(ranges, n, range_min, range_max, out, at):
    """Sizes of ρ[i-1] - 2ρ[i] + ρ[i+1] of every other triple, and its ρ[i]."""
    count = np.int64(0)
    for i in range(1, n - 1, 2):
        a, b, c = ranges[i - 1], ranges[i], ranges[i + 1]
        if (
            usable(a, range_min, range_max)
            and usable(b, range_min, range_max)
            and usable(c, range_min, range_max)
        ):
            out[count], at[count] = abs(a - 2.0 * b + c), b
            count += 1
    return count


@helper
def _clipped_variance(values, count):
    """Variance of a range, of sizes of second differences; those above three deviations are out.

    Where half of them are zero, it is that of rounding.
    """
    limit = 3.0 * 1.4826 * _median(values, count)
    if limit < LEAST_SIGMA:
        sigma = _rounding_sigma(values, count)
        return sigma * sigma
    total, used = 0.0, 0
    for i in range(count):
        if values[i] <= limit:
            total += values[i] * values[i]
            used += 1
    # What is cut off of a normal distribution at three deviations is 3 % of its variance.
    return max(1.03 * total / (6.0 * used), LEAST_SIGMA * LEAST_SIGMA)
