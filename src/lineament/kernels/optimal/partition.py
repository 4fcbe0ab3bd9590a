"""Step 3: the partition of the least energy, exactly.

The energy of a partition is, over its lines, their least χ² at the scale of the surface and the
`evidence` that each costs, and a price for each measurement on no line. Jackson et al., *An
algorithm for optimal partitioning of data on an interval*, IEEE Signal Processing Letters 2005,
find its minimum by a recurrence; most of its terms need not be evaluated here, by what they were
when they were evaluated before. ``docs/optimal.md`` has the derivation.
"""

import math

import numpy as np

from .. import contracted, helper, inlined
from . import layout as at
from .constants import BITS_OF_INFINITY, CLUTTER, GROUP, LEAST, RUNNERS
from .costs import costs_on, least_from


@inlined
def partition(work, count, evidence):
    """List the lines of the partition of the least energy, in order. Returns how many there are.

    No line goes on over a break, so that the stretches between breaks follow one another.
    """
    origin, first, last = work.beams[at.ORIGIN], work.spans[at.FIRST], work.spans[at.LAST]
    work.points[at.ENERGY, 0], begin = 0.0, np.int64(0)
    while begin < count:
        broken, end = work.beams[at.BROKEN, begin + 1 : count], count
        for i in range(len(broken)):
            if broken[i]:
                end = begin + 1 + i
                break
        _part_stretch(work, begin, end, evidence)
        begin = end
    lines, i = 0, count
    while i > 0:
        if origin[i] >= 0:
            first[lines], last[lines] = origin[i], i - 1
            lines += 1
        i = origin[i] if origin[i] >= 0 else i - 1
    for k in range(lines // 2):
        m = lines - 1 - k
        first[k], first[m], last[k], last[m] = first[m], first[k], last[m], last[k]
    return lines


@contracted
def _part_stretch(work, first, last, evidence):
    """Part the measurements first … last - 1, knowing the least energy of those before.

    Candidates for the beginning of the last line come in groups. A group has a lower bound of the
    energy with a line from any of them on; groups whose bound is below the least energy found so
    far are opened. The few candidates that were least run along: they are always evaluated, and do
    not count for their group.
    """
    points, beams, sums = work.points, work.beams, work.sums
    energy, origin, begin = points[at.ENERGY], beams[at.ORIGIN], first + LEAST
    for j in range(first + 1, min(begin, last + 1)):
        energy[j], origin[j] = energy[j - 1] + CLUTTER * evidence, -1
    low = _follow_line(energy, origin, sums, first, last, evidence)
    if low > last:
        return
    for r in range(RUNNERS):
        beams[at.RUNNER, r] = first
    oldest = np.int64(0)
    for start in range(begin, last + 1, GROUP):
        end = min(start + GROUP, last + 1)
        if start < low:
            _add_group(points, first, start, end, evidence)
        else:
            oldest = _part_block(points, beams, sums, first, start, end, oldest, evidence)


@contracted
def _follow_line(energy, origin, sums, first, last, evidence):
    """Follow the first line as long as its χ² is at most the price of clutter.

    It is the best then: two lines, or one and clutter, cost as much at least. Returns the
    measurement, the first of a group of ends, before which the least energies are known.
    """
    limit = energy[first] + evidence + CLUTTER * evidence
    for low in range(first + LEAST, last + 1, GROUP):
        high = min(low + GROUP, last + 1)
        costs_on(sums, first, low, high, energy[first] + evidence, energy)
        for j in range(low, high):
            if not energy[j] <= limit:
                return low
            origin[j] = first
    return last + 1


@contracted
def _part_block(points, beams, sums, first, low, high, oldest, evidence):
    """Find the least energies of the ends low … high - 1, whose candidates are the last group.

    Returns the first group that may still be opened.
    """
    energy, base, ahead, now = (
        points[at.ENERGY], points[at.BASE], points[at.AHEAD :], points[at.NOW]
    )  # fmt: skip
    origin, runner, price = beams[at.ORIGIN], beams[at.RUNNER], CLUTTER * evidence
    most = max(1.0, (LEAST - 1) * CLUTTER) * evidence
    for r in range(RUNNERS):
        costs_on(sums, runner[r], low, high, energy[runner[r]] + evidence, ahead[r])
    q, lowest, total = (low - first - LEAST) // GROUP, math.inf, energy[low - 1]
    oldest, bound = _raise_bounds(points, sums, low, high, oldest, q, total + most)
    # Slices, as numba need not look for negative indices where a loop begins at 0.
    begins, bases = energy[low - LEAST :], base[low - LEAST :]
    one, two = ahead[0, low:high], ahead[1, low:high]
    energies, origins = energy[low:high], origin[low:high]
    for k in range(len(one)):
        leader, least = 1 if two[k] < one[k] else 0, min(two[k], one[k])
        found = runner[leader] if least < total + price else np.int64(-1)
        total = min(least, total + price)
        bases[k] = begins[k] + evidence if low + k > first + LEAST else math.inf
        lowest = min(lowest, bases[k])
        if min(bound, lowest) < total:
            now[q] = lowest
            total, found, oldest, bound = _open_groups(
                points, beams, sums, first, low + k, high, oldest, q, evidence, total, found
            )
            lowest = now[q]
        energies[k], origins[k] = total, found
    points[at.BOUND, q] = lowest
    return oldest


@helper
def _add_group(points, first, low, high, evidence):
    """Make a group of the candidates for ends from low … high."""
    energy, base, lowest = points[at.ENERGY], points[at.BASE], math.inf
    for i in range(low - LEAST, high - LEAST):
        base[i] = energy[i] + evidence if i > first else math.inf
        lowest = min(lowest, base[i])
    points[at.BOUND, (low - first - LEAST) // GROUP] = lowest


@contracted
def _raise_bounds(points, sums, low, high, oldest, groups, most):
    """Take the bounds for the ends low … high - 1, and raise them for those behind.

    A line that goes on over measurements gets worse by as much as their own line is bad. So a
    group whose bound is not below what the runners have over that, at any of these ends, is shut.
    Returns the first group whose bound is not above `most`, so far that it can never be the least
    again, and the least bound.
    """
    while oldest < groups and points[at.BOUND, oldest] > most:
        oldest += 1
    one, two = points[at.AHEAD, low:high], points[at.AHEAD + 1, low:high]
    own, largest = points[at.OWN, low:high], np.int64(0)
    costs_on(sums, low - 1, low, high, 0.0, points[at.OWN])
    for k in range(len(own)):
        own[k] = own[k] if own[k] < math.inf else 0.0
    for k in range(len(own)):
        largest = max(largest, np.float64(min(one[k], two[k]) - own[k]).view(np.int64))
    limit, rise = np.int64(largest).view(np.float64), own[len(own) - 1]
    now, bound = points[at.NOW, oldest:groups], points[at.BOUND, oldest:groups]
    for k in range(len(now)):
        now[k] = bound[k] if bound[k] < limit else math.inf
        bound[k] += rise
    return oldest, _least(now)


@contracted
def _open_groups(points, beams, sums, first, j, end, oldest, newest, evidence, total, found):
    """Open the groups whose bound is less than the least energy before measurement j.

    The least candidate of a group that is now less than a runner takes its place, and the runner
    goes back to its own group. Returns the least energy, the candidate that it is of, the first
    group that may still be opened, and the least bound.
    """
    energy, base, now, bound = (
        points[at.ENERGY], points[at.BASE], points[at.NOW], points[at.BOUND]
    )  # fmt: skip
    bounds, eldest = now[oldest : newest + 1], oldest
    for k in range(len(bounds)):
        if bounds[k] >= total:
            continue
        q = eldest + k
        low = first + q * GROUP
        high = min(low + GROUP, j - LEAST + 1)
        least, best = least_from(sums, low, high, j, base)
        rest = least
        found = best if least < total else found
        total = min(least, total)
        runs, worst = _is_runner(points, j, least)
        if runs:
            base[best] = math.inf
            rest, _ = least_from(sums, low, high, j, base)
        now[q] = bound[q] = rest
        if runs:
            out, back = beams[at.RUNNER, worst], points[at.AHEAD + worst, j]
            group = (out - first) // GROUP
            base[out], oldest = energy[out] + evidence, min(oldest, group)
            now[group], bound[group] = min(now[group], back), min(bound[group], back)
            beams[at.RUNNER, worst], points[at.AHEAD + worst, j] = best, least
            before = energy[best] + evidence
            costs_on(sums, best, j + 1, end, before, points[at.AHEAD + worst])
    return total, found, oldest, _least(now[oldest : newest + 1])


@helper
def _least(values):
    """Return the least of some positive values: their bits have their order."""
    bits, least = values.view(np.int64), np.int64(BITS_OF_INFINITY)
    for k in range(len(bits)):
        least = min(least, bits[k])
    return np.int64(least).view(np.float64)


@helper
def _is_runner(points, j, least):
    """Whether a candidate is less than the worst of the runners, and which that is."""
    worst = 0
    for r in range(1, RUNNERS):
        worst = r if points[at.AHEAD + r, j] > points[at.AHEAD + worst, j] else worst
    return least < points[at.AHEAD + worst, j], worst
