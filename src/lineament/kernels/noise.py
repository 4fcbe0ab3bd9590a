"""Range noise of a scan, estimated from the scan itself: a variance of constant + growth · ρ².

From what a measurement is off the line through its two neighbours. These three span triangles with
the scanner at the origin: with the cross products c₁ of the first two, c₂ of the last two and c of
the outer ones, the middle range is ρ (c₁ + c₂ - c)/c beyond the line, for any direction of the
line. The square of that has 1.5 times the variance of a range.

Few of these say little, and a noise that is not known is not small: what they say is weighed
against what scanners have.
"""

import math

import numpy as np

from . import FARTHEST, NEAREST, helper, kernel, sums, usable
from .arrays import Floats1, Floats2, Ints2
from . import layout as at

#: No scanner is better than this [m]; keeps covariances positive where ranges are noiseless.
LEAST_SIGMA = 1e-4
#: Nor worse, at its farthest measurement [m]: what is farther off is clutter.
MOST_SIGMA = 0.1
#: What scanners have: root of their mean variance [m], and the variance of the logarithm of theirs.
#: From the medians of eight logs, 0.4 to 14 mm; ``docs/methods.md`` says how far it holds.
TYPICAL_SIGMA, SPREAD = 0.012, 4.5
#: Deviations beyond which errors are no noise.
_SIGMAS = 3.0
#: In single precision, of which twice as many are compared at once.
_BITS_OF_INFINITY, _ONE, _ZERO = 0x7F800000, np.float32(1.0), np.float32(0.0)
_INFINITY, _HALF_OCTAVE = np.float32(math.inf), 2**22
#: Square of a deviation of a normal distribution, over that which a third of its squares is below.
_THIRD = 1.0 / 0.4307**2
#: What a third is below of what scanners have, as the bits of a number in single precision.
_TYPICAL = int(np.float32(TYPICAL_SIGMA * TYPICAL_SIGMA / _THIRD).view(np.int32))
#: What is cut off at three deviations is 3 % of the variance.
_WHOLE = 1.03
#: Of overlapping triples, so many count as one.
_OVERLAP = 1.94
#: Steps of Newton's method at most, and one of which the square is less than rounding; the least
#: and the most that a mean square is of what is expected: what is a metre off is clutter.
_NEWTON_STEPS, _SMALL_STEP, _LEAST_RATIO, _MOST_RATIO = 8, 1e-8, 1e-30, 1e4
#: No scanner reports its ranges in coarser steps [m].
_COARSEST_QUANTUM = 0.15
#: Of ranges on a lattice, at least so large a share differs from the neighbours'.
_SHARE = 0.125


@kernel
def estimate_noise(
    floats: Floats2,
    ints: Ints2,
    bearings: Floats2,
    range_min: float,
    range_max: float,
    given: Floats1,
    noise: Floats1,
):
    """Write the noise of a scan: as `given`, or, where that is NaN, estimated.

    It is NaN for a scan without a usable range. Where most ranges equal their neighbours, they lie
    on a lattice coarser than the noise, and it is that of the rounding. From RANGE; what is in
    points is lost.
    """
    for part in range(5):
        noise[part] = given[part]
    if not math.isnan(given[0]):
        return
    work = at.named(floats, ints)
    ranges, points, beam = work.beams[at.RANGE], work.points, work.marks[at.BEAM]
    x, y, rho = points[at.X], points[at.Y], points[at.RHO]
    count, any_usable = np.int64(0), False
    nearest, farthest = max(range_min, NEAREST), min(range_max, FARTHEST)
    for i in range(bearings.shape[1]):
        beam[count] = i
        count += usable(ranges[i], nearest, farthest)
    for i in range(bearings.shape[1] if count == 0 else 0):
        any_usable |= usable(ranges[i], range_min, range_max)
    any_usable |= count > 0
    for i in range(count):
        b = beam[i]
        r = ranges[b]
        rho[i], x[i], y[i] = r, r * bearings[0, b], r * bearings[1, b]
    constant, growth, noise[4], square = fit_noise(points, beam, count, at.SPACING, at.SPARE)
    if square <= LEAST_SIGMA * LEAST_SIGMA:
        constant = max(constant, _rounding_variance(rho, points[at.SPACING], count))
    noise[0] = math.sqrt(constant) if any_usable else math.nan
    noise[1], noise[2], noise[3] = math.sqrt(growth), 0.0, 0.0


@helper
def fit_noise(points, beam, count, row, spare):
    """Estimate the noise from the triples: constant part, growth, uncertainty; their mean square.

    By the third of them that is least off, as no clutter is; of the nearer and the farther half
    apart: it grows with range where these differ by more than chance. `points` are x, y and range
    first, and two rows of scratch.
    """
    least, most = LEAST_SIGMA * LEAST_SIGMA, MOST_SIGMA * MOST_SIGMA
    middle = _fill_triples(points, beam, count, row)
    near, near_square, near_count, far, far_square, far_count = _least_thirds(
        points, count, row, spare, middle
    )
    used = near_count + far_count
    square = (near * near_count + far * far_count) / max(used, 1.0)
    prior = TYPICAL_SIGMA * TYPICAL_SIGMA
    constant, uncertainty = expected_variance(square, used / _OVERLAP, prior)
    growth, scale = 0.0, constant / max(square, 1e-300)
    both = 1.0 / max(near_count, 1.0) + 1.0 / max(far_count, 1.0)
    chance = _SIGMAS * math.sqrt(2.0 * _OVERLAP * both)
    if far - near > chance * square:
        near, far = scale * near, scale * far
        growth = (far - near) / (far_square - near_square)
        constant = near - growth * near_square
        if constant < least:
            growth = 0.5 * (near / near_square + far / far_square)
    constant = min(max(constant, least), most)
    if growth > 0.0:
        farthest = 0.0
        for i in range(count):
            farthest = max(farthest, points[at.RHO, i])
        growth = min(growth, (most - constant) / (farthest * farthest))
    return constant, growth, uncertainty, square


@helper
def expected_variance(square, degrees, prior):
    """Mean of a variance of which a mean square is known; relative deviation of its root.

    The square has so many degrees of freedom. Before it is known, the logarithm of the variance is
    normal with the variance `SPREAD`, and the mean of the variance is `prior`. By Laplace's method
    for the posterior and for the variance times it (Tierney and Kadane 1986), 6 % off at most.
    """
    ratio = min(max(square / prior, _LEAST_RATIO), _MOST_RATIO)
    height, curvature = _peak(ratio, 0.5 * degrees, -0.5 * SPREAD)
    raised, raised_curvature = _peak(ratio, 0.5 * degrees, 0.5 * SPREAD)
    mean = math.sqrt(curvature / raised_curvature) * math.exp(raised - height)
    return prior * mean, 0.5 / math.sqrt(curvature)


@helper
def _peak(ratio, half, centre):
    """Height and curvature of log posterior of λ, the logarithm of a variance, at its peak.

    By Newton's method from below, where a function such as the derivative is never overshot.
    """
    weight, inverse = half * SPREAD, 1.0 / SPREAD
    level = max((weight * math.log(ratio) + centre) / (weight + 1.0), centre - weight)
    pull = half * ratio * math.exp(-level)
    for _ in range(_NEWTON_STEPS):
        step = (pull - half - inverse * (level - centre)) / (pull + inverse)
        level += step
        pull = half * ratio * math.exp(-level)
        if abs(step) < _SMALL_STEP:
            break
    off = level - centre
    return -0.5 * inverse * off * off - half * level - pull, pull + inverse


@helper
def _rounding_variance(rho, triple, count):
    """Variance of rounding to a lattice, whose step is the least of the second differences."""
    step, off, used = math.inf, 0, 0
    for i in range(1, count - 1):
        if triple[i] < math.inf:
            used += 1
            difference = abs(rho[i - 1] - 2.0 * rho[i] + rho[i + 1])
            # What is coarser than any lattice is a jump.
            if LEAST_SIGMA < difference < _COARSEST_QUANTUM:
                step, off = min(step, difference), off + 1
    return step * step / 12.0 if off > _SHARE * used else 0.0


@sums
def _fill_triples(points, beam, count, row):
    """Fill a row with the squared error of each range by its neighbours; inf where one is missing.

    Returns the mean square of those ranges.
    """
    x, y, rho, triple = points[at.X], points[at.Y], points[at.RHO], points[row]
    x1, y1, rho1, x2, y2 = x[1:], y[1:], rho[1:], x[2:], y[2:]
    beam2, triple1 = beam[2:], triple[1:]
    total, used = 0.0, 0.0
    # Two loops: of one over so many arrays the compiler does no four at once.
    for i in range(count - 2):
        outer = x[i] * y2[i] - y[i] * x2[i]
        inner = x[i] * y1[i] - y[i] * x1[i] + x1[i] * y2[i] - y1[i] * x2[i]
        error = rho1[i] * (inner - outer) / outer
        triple1[i] = error * error / 1.5
    for i in range(count - 2):
        neighbours = beam2[i] - beam[i] == 2
        triple1[i] = triple1[i] if neighbours else math.inf
        total += rho1[i] * rho1[i] if neighbours else 0.0
        used += 1.0 if neighbours else 0.0
    triple[0] = triple[max(count - 1, 0)] = math.inf
    return total / max(used, 1.0)


@sums
def _least_thirds(points, count, row, spare, middle):
    """Variance by triples, their mean square, and number, of the nearer and the farther half.

    That is of squared ranges below `middle`, and from there on.
    """
    rho, triple = points[at.RHO], points[row]
    near, far = points[spare].view(np.float32)[:count], points[spare].view(np.float32)[count:]
    for i in range(count):
        single, is_near = np.float32(triple[i]), rho[i] * rho[i] < middle
        near[i] = single if is_near else _INFINITY
        far[i] = _INFINITY if is_near else single
    near_limit, guess = _limit_of_third(near, count, np.int64(_TYPICAL))
    far_limit, _ = _limit_of_third(far, count, guess)
    near_total, near_squares, near_used = 0.0, 0.0, 0.0
    far_total, far_squares, far_used = 0.0, 0.0, 0.0
    for i in range(count):
        square = rho[i] * rho[i]
        within = (square < middle) & (triple[i] <= near_limit)
        near_total += triple[i] if within else 0.0
        near_squares += square if within else 0.0
        near_used += 1.0 if within else 0.0
        within = (square >= middle) & (triple[i] <= far_limit)
        far_total += triple[i] if within else 0.0
        far_squares += square if within else 0.0
        far_used += 1.0 if within else 0.0
    near_mean, near_square = near_total / max(near_used, 1.0), near_squares / max(near_used, 1.0)
    far_mean, far_square = far_total / max(far_used, 1.0), far_squares / max(far_used, 1.0)
    near_mean, far_mean = _WHOLE * near_mean, _WHOLE * far_mean
    return near_mean, near_square, near_used, far_mean, far_square, far_used


@sums
def _limit_of_third(singles, count, guess):
    """Return what triples are below that count, by the third that is least off, and its bound.

    Infinite ones are none; -1 where all are.
    """
    n = _ZERO
    for i in range(count):
        n += _ONE if singles[i] < _INFINITY else _ZERO
    if n == 0.0:
        return -1.0, guess
    # The last of the third: of few, one less would take too much for clutter.
    bound = ranked(singles, count, min((int(n) + 2) // 3, int(n) - 1), guess)
    most, bits, last = np.int32(bound), singles.view(np.int32), np.int32(0)
    for i in range(count):
        last = max(last, bits[i] if bits[i] <= most else np.int32(0))
    return _SIGMAS * _SIGMAS * _THIRD * np.int32(last).view(np.float32), bound


@sums
def ranked(singles, count, rank, guess):
    """Bits of a bound of the first `count` values: those up to a rank, from 0 on, are not above it.

    Of the others only those are not above it that equal one of these. All are at least 0: the bits
    of such numbers have their order, so that bisection ends after 32 rounds and few more, and most
    often after a dozen. It begins at a guess, and goes four times as far from there each time. It
    has no branches that depend on the values.
    """
    low, high, reach = np.int64(-1), np.int64(_BITS_OF_INFINITY), np.int64(_HALF_OCTAVE)
    while high - low > 1:
        # Inside the bounds: from the guess, no farther than it reaches.
        middle = low + (high - low) // 2
        middle = max(min(middle, max(guess, low + 1) + reach), min(guess, high - 1) - reach)
        reach = min(4 * reach, np.int64(_BITS_OF_INFINITY))
        most, below = np.int32(middle).view(np.float32), _ZERO
        for i in range(count):
            below += _ONE if singles[i] <= most else _ZERO
        if below > rank:
            high = middle
            if below == rank + 1:
                break
        else:
            low = middle
    return high
