"""Step 3: the partition of the least energy, exactly.

The energy of a partition is, over its lines, their least χ² at the scale of the surface and the
`evidence` that each costs, and a price for each measurement on no line. Jackson et al., *An
algorithm for optimal partitioning of data on an interval*, IEEE Signal Processing Letters 2005,
find its minimum by a recurrence; most of its terms need not be evaluated here, by a bound that is
kept lazily. ``docs/optimal.md`` has the derivation.
"""

import math

import numpy as np

from .. import contracted, helper, inlined
from . import layout as at
from .constants import CLUTTER, LEAST
from .costs import cost, costs_from, costs_on

#: Measurements of the blocks that bound χ² from below, candidates of a group, groups of a row, and
#: candidates that run along. They change the time, not the result: a group is whole blocks, and
#: `_part_block` names the three runners.
BLOCK, GROUP, ROW, RUNNERS = 8, 16, 16, 3


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

    Candidates for the beginning of the last line come in groups, and groups in rows. A group has a
    key: with the blocks that end by now it is a lower bound of the energy with a line from any of
    them on. Groups below the least energy found so far are opened. The few candidates that were
    least run along: they are always evaluated, and do not count for their group.
    """
    points, beams, sums = work.points, work.beams, work.sums
    energy, origin, begin = points[at.ENERGY], beams[at.ORIGIN], first + LEAST
    for j in range(first + 1, min(begin, last + 1)):
        energy[j], origin[j] = energy[j - 1] + CLUTTER * evidence, -1
    low = _follow_line(energy, origin, sums, first, last, evidence)
    if low > last:
        return
    _bound_blocks(points[at.BLOCKS], sums, first, last)
    for r in range(RUNNERS):
        beams[at.RUNNER, r] = first
    points[at.BASE, first], oldest, bound = math.inf, np.int64(0), math.inf
    for start in range(begin, last + 1, GROUP):
        end = min(start + GROUP, last + 1)
        if start < low:
            key = _add_group(points, beams, first, start, end, evidence)
            bound = min(bound, key)
        else:
            oldest, bound = _part_block(
                points, beams, sums, first, start, end, oldest, bound, evidence
            )


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
def _part_block(points, beams, sums, first, low, high, oldest, bound, evidence):
    """Find the least energies of the ends low … high, whose candidates are the last group.

    `bound` is the least key of the groups before. Returns the first group that may still be
    opened, and the least key.
    """
    energy, base, blocks, ahead = (
        points[at.ENERGY], points[at.BASE], points[at.BLOCKS], points[at.AHEAD :]
    )  # fmt: skip
    origin, runner, price = beams[at.ORIGIN], beams[at.RUNNER], CLUTTER * evidence
    most = max(1.0, (LEAST - 1) * CLUTTER) * evidence
    for r in range(RUNNERS):
        costs_on(sums, runner[r], low, high, energy[runner[r]] + evidence, ahead[r])
    q, key, lowest, anchor = (low - first - LEAST) // GROUP, math.inf, math.inf, first
    total = energy[low - 1]
    # Slices, as numba need not look for negative indices where a loop begins at 0.
    begins, bases, blocks = energy[low - LEAST :], base[low - LEAST :], blocks[q * GROUP // BLOCK :]
    one, two, three = ahead[0, low:high], ahead[1, low:high], ahead[2, low:high]
    energies, origins = energy[low:high], origin[low:high]
    for k in range(len(one)):
        leader, least = 0, one[k]
        leader = 1 if two[k] < least else leader
        least = min(two[k], least)
        leader = 2 if three[k] < least else leader
        least = min(three[k], least)
        found = runner[leader] if least < total + price else np.int64(-1)
        total = min(least, total + price)
        own, ended = begins[k] + evidence, blocks[(k + LEAST) // BLOCK]
        bases[k] = own if low + k > first + LEAST else math.inf
        key = min(key, bases[k] - blocks[(k + BLOCK - 1) // BLOCK])
        lowest, anchor = min(lowest, own), low + k - LEAST
        if min(bound, key) + ended < total:
            _set_group(points, beams, q, key, lowest, anchor)
            total, found, oldest = _open_groups(
                points, beams, sums, first, low + k, high, oldest, evidence, total, found
            )
            # What is so far above can never be the least again.
            while oldest < q and points[at.KEY, oldest] + ended > total + most:
                oldest += 1
            key, lowest, bound = points[at.KEY, q], points[at.LOWEST, q], math.inf
            anchor = beams[at.ANCHOR, q]
            for row in range(oldest // ROW, q // ROW + 1):
                bound = min(bound, points[at.ROW_KEY, row])
        energies[k], origins[k] = total, found
    _set_group(points, beams, q, key, lowest, anchor)
    return oldest, min(bound, key)


@helper
def _add_group(points, beams, first, low, high, evidence):
    """Make a group of the candidates for ends from low … high, and return its key."""
    energy, base, blocks = points[at.ENERGY], points[at.BASE], points[at.BLOCKS]
    q, key, lowest = (low - first - LEAST) // GROUP, math.inf, math.inf
    for i in range(low - LEAST, high - LEAST):
        base[i] = energy[i] + evidence if i > first else math.inf
        key = min(key, base[i] - blocks[(i - first + BLOCK - 1) // BLOCK])
        lowest = min(lowest, energy[i] + evidence)
    _set_group(points, beams, q, key, lowest, high - 1 - LEAST)
    return key


@helper
def _set_group(points, beams, q, key, lowest, anchor):
    """Write the key of the last group, the least energy before its lines, and its anchor."""
    points[at.KEY, q], points[at.LOWEST, q], beams[at.ANCHOR, q] = key, lowest, anchor
    others = points[at.ROW_KEY, q // ROW] if q % ROW else math.inf
    points[at.ROW_KEY, q // ROW] = min(others, key)


@contracted
def _open_groups(points, beams, sums, first, j, end, oldest, evidence, total, found):
    """Open the groups whose key is less than the least energy before measurement j.

    The least candidate of a group that is now less than a runner takes its place, and the runner
    goes back to its own group. Returns the least energy, the candidate that it is of, and the first
    group that may still be opened.
    """
    blocks = points[at.BLOCKS]
    ended, began = blocks[(j - first) // BLOCK], blocks[(j - first + BLOCK - 1) // BLOCK]
    energy, key, row_key = points[at.ENERGY], points[at.KEY], points[at.ROW_KEY]
    lowest, anchor = points[at.LOWEST], beams[at.ANCHOR]
    base, scratch = points[at.BASE], points[at.SCRATCH]
    last, back = j - LEAST + 1, oldest
    groups = (last - 1 - first) // GROUP + 1
    for row in range(oldest // ROW, (groups - 1) // ROW + 1):
        if row_key[row] + ended >= total:
            continue
        row_key[row] = math.inf
        least_group = max(row * ROW, oldest)
        keys = key[least_group : min((row + 1) * ROW, groups)]
        for k in range(len(keys)):
            if keys[k] + ended >= total:
                continue
            q = least_group + k
            low = first + q * GROUP
            # Each line is at least as bad as one up to the anchor and one from there on. Of few
            # measurements, the differences of the running sums have lost too many digits.
            rest = cost(sums, anchor[q], j) if j - anchor[q] >= BLOCK else 0.0
            key[q] = lowest[q] - began + (rest if rest < math.inf else 0.0)
            if key[q] + began >= total:
                continue
            high = min(low + GROUP, last)
            costs_from(sums, low, high, j, base, scratch)
            least, best = _least(scratch[low:high])
            rest, best = least, low + best
            found = best if least < total else found
            total = min(least, total)
            runs, worst = _is_runner(points, j, least)
            if runs:
                scratch[best] = math.inf
                rest, _ = _least(scratch[low:high])
            key[q] = rest - began
            if low + GROUP <= last:
                anchor[q], lowest[q] = j, key[q] + began
            if runs:
                out = beams[at.RUNNER, worst]
                group = (out - first) // GROUP
                base[out], base[best] = energy[out] + evidence, math.inf
                key[group] = min(key[group], points[at.AHEAD + worst, j] - began)
                row_key[group // ROW] = min(row_key[group // ROW], key[group])
                rest = cost(sums, out, anchor[group])
                rest = energy[out] + evidence + (rest if rest < math.inf else 0.0)
                lowest[group] = min(lowest[group], rest)
                back = min(back, group)
                beams[at.RUNNER, worst], points[at.AHEAD + worst, j] = best, least
                before = energy[best] + evidence
                costs_on(sums, best, j + 1, end, before, points[at.AHEAD + worst])
        lower, _ = _least(keys)
        row_key[row] = min(row_key[row], lower)
    return total, found, back


@helper
def _least(values):
    """Return the least of some values, and the first that it is."""
    least, first = math.inf, np.int64(0)
    for k in range(len(values)):
        first = k if values[k] < least else first
        least = min(values[k], least)
    return least, first


@helper
def _is_runner(points, j, least):
    """Whether a candidate is less than the worst of the runners, and which that is."""
    worst = 0
    for r in range(1, RUNNERS):
        worst = r if points[at.AHEAD + r, j] > points[at.AHEAD + worst, j] else worst
    return least < points[at.AHEAD + worst, j], worst


@helper
def _bound_blocks(blocks, sums, first, last):
    """Sum the χ² of the blocks before each block of measurements.

    A line over some blocks costs at least as much as each has with a line for itself.
    """
    total, b = 0.0, 0
    for low in range(first, last + 1, BLOCK):
        blocks[b], own = total, 0.0
        if low + BLOCK <= last:
            own = cost(sums, low, low + BLOCK)
        total, b = total + (own if own < math.inf else 0.0), b + 1
    blocks[b] = total
