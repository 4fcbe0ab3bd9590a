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
#: Three deviations of a normal distribution, in sizes that a third of it is below.
CLIP = 3.0 / 0.4307
_ROOT = math.sqrt(1.5)
#: Ranges are on a lattice if so many differences of neighbours, of up to so many steps, tell it.
_LEAST_STEPS, _MOST_STEPS = 8, 50.0


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
    sigma = 1.4826 / math.sqrt(6.0) * _ranked(scratch, count, (count - 1) // 2)
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
def _ranked(values, count, middle):
    """Value of rank `middle` of the first `count`, which it reorders (Hoare's selection)."""
    low, high = 0, count - 1
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
def estimate_by_range(floats, bearings, range_min, range_max, grows, noise):
    """Estimate the lattice of the ranges, and the constant and proportional part of their noise.

    From what readings are off the line through their neighbours. Of the near and of the far half
    of the readings apart: the variance of a range is σ² + p² ρ² in both. By the mean square of
    what is not far out, which scatters less than the median. p is 0 where the halves are about as
    noisy, or if it does not grow.
    """
    ranges, n = floats[RANGE], floats.shape[1] - 1
    noise[3] = find_quantum(ranges, n, range_min, range_max)
    near, far, at = floats[SPARE], floats[X], floats[Y]
    count = _errors(ranges, bearings, n, range_min, range_max, near, at)
    if count < 2 * _LEAST_TRIPLES:
        sigma = range_sigma(ranges, n, range_min, range_max, near)
        set_parts(noise, sigma * sigma, 0.0)
        return
    for i in range(count):
        far[i] = at[i]
    middle = _ranked(far, count, (count - 1) // 2)
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
    v_near, v_far = _clipped_variance(near, low), _clipped_variance(far, high)
    near_squares, far_squares = near_squares / low, far_squares / max(high, 1)
    if (
        not grows
        or high < _LEAST_TRIPLES
        or far_squares < 1.2 * near_squares
        or v_far < 1.7 * v_near
    ):
        set_parts(noise, (low * v_near + high * v_far) / count, 0.0)
        return
    growth = (v_far - v_near) / (far_squares - near_squares)
    constant, least = v_near - growth * near_squares, noise[3] * noise[3] / 12.0
    if constant < least:
        constant = least
        growth = 0.5 * max((v_near - least) / near_squares + (v_far - least) / far_squares, 0.0)
    set_parts(noise, constant, growth)


@helper
def set_parts(noise, constant, growth):
    """Set the noise from its constant variance, that of rounding included, and the p² of ρ."""
    rounding = noise[3] * noise[3] / 12.0
    noise[0], noise[1] = math.sqrt(max(constant - rounding, 0.0)), math.sqrt(growth)
    if constant >= 0.0:  # No NaN, of a scan without readings.
        noise[0] = max(noise[0], LEAST_SIGMA)


@helper
def find_quantum(ranges, n, range_min, range_max):
    """Step of the lattice that the ranges lie on [m], or 0 where they lie on none.

    It is the least difference of neighbours, and other small ones are its multiples.
    """
    quantum, found = COARSEST_QUANTUM, 0
    for i in range(1, n):
        difference = _difference(ranges, i, range_min, range_max)
        if LEAST_SIGMA < difference < quantum:
            quantum = difference
    for i in range(1, n):
        steps = _difference(ranges, i, range_min, range_max) / quantum
        # Those of larger ones are lost in the digits of a float32.
        if 0.5 < steps < _MOST_STEPS:
            if abs(steps - math.floor(steps + 0.5)) > 0.1:
                return 0.0
            found += 1
    return quantum if found >= _LEAST_STEPS and quantum < COARSEST_QUANTUM else 0.0


@helper
def _difference(ranges, i, range_min, range_max):
    """Size of the difference of a range from the one before; inf if one is not usable."""
    a, b = ranges[i - 1], ranges[i]
    both = usable(a, range_min, range_max) and usable(b, range_min, range_max)
    return abs(b - a) if both else math.inf


@helper
def _errors(ranges, bearings, n, range_min, range_max, out, at):
    """Errors of ranges, of every other triple of neighbours, and the ranges that they are of.

    Three points of a line have u₁ sin(φ₃-φ₂) - u₂ sin(φ₃-φ₁) + u₃ sin(φ₂-φ₁) = 0 with u = 1/ρ,
    whatever its direction. An error of ρ is one of u times ρ². The variance of the sum is that of
    a range times sin²(φ₃-φ₂) + sin²(φ₃-φ₁) + sin²(φ₂-φ₁), 1.5 sin²(φ₃-φ₁) for even steps.
    """
    count = np.int64(0)
    for i in range(1, n - 1, 2):
        a, b, c = ranges[i - 1], ranges[i], ranges[i + 1]
        if (
            usable(a, range_min, range_max)
            and usable(b, range_min, range_max)
            and usable(c, range_min, range_max)
        ):
            s1 = bearings[0, i] * bearings[1, i + 1] - bearings[1, i] * bearings[0, i + 1]
            s2 = bearings[0, i - 1] * bearings[1, i + 1] - bearings[1, i - 1] * bearings[0, i + 1]
            s3 = bearings[0, i - 1] * bearings[1, i] - bearings[1, i - 1] * bearings[0, i]
            if s2 > 0.0:  # Beams in the same direction tell nothing.
                off = b * (b * (s1 * c + s3 * a) - s2 * a * c)
                out[count], at[count] = abs(off / (_ROOT * s2 * a * c)), b
                count += 1
    return count


@helper
def _clipped_variance(values, count):
    """Variance of a range, of sizes of errors; those above three deviations are left out."""
    # By the least third: in clutter, half of the readings and more are on no wall.
    limit = max(CLIP * _ranked(values, count, count // 3), LEAST_SIGMA)
    total, used = 0.0, 0
    for i in range(count):
        if values[i] <= limit:
            total += values[i] * values[i]
            used += 1
    # What is cut off of a normal distribution at three deviations is 3 % of its variance.
    return max(1.03 * total / max(used, 1), LEAST_SIGMA * LEAST_SIGMA)
