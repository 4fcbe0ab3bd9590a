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
from .constants import BEND, CLUTTER, LEAST, RARE, SIGMAS, TAU

#: Measurements of the blocks that bound χ² from below, candidates of a group, groups of a row, and
#: candidates that run along. They change the time, not the result.
BLOCK, GROUP, ROW, RUNNERS = 8, 16, 16, 3


@contracted
def fill_sums(points, count, constant, growth, sums):
    """Sum w (xx, xy, yy, x, y, 1), w = ρ² / (σ² + τ²), of all measurements before each one.

    A line is a x + b y = 1, and 1 - a x - b y the error of ρ over ρ: linear whatever the direction
    of the line (inverse-range regression).
    """
    x, y, rho = points[at.X], points[at.Y], points[at.RHO]
    constant += TAU * TAU
    xx, xy, yy, sx, sy, s = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for column in range(at.SUMS):
        sums[0, column] = 0.0
    for i in range(count):
        square = rho[i] * rho[i]
        w = square / (constant + growth * square)
        wx, wy = w * x[i], w * y[i]
        xx, xy, yy = xx + wx * x[i], xy + wx * y[i], yy + wy * y[i]
        sx, sy, s = sx + wx, sy + wy, s + w
        sums[i + 1, 0], sums[i + 1, 1], sums[i + 1, 2] = xx, xy, yy
        sums[i + 1, 3], sums[i + 1, 4], sums[i + 1, 5] = sx, sy, s


@contracted
def solve(sums, i, j):
    """Return the line a x + b y = 1 of least squares of measurements i … j - 1; 0, 0 if none."""
    xx, xy, yy = sums[j, 0] - sums[i, 0], sums[j, 1] - sums[i, 1], sums[j, 2] - sums[i, 2]
    x, y, determinant = sums[j, 3] - sums[i, 3], sums[j, 4] - sums[i, 4], xx * yy - xy * xy
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
    p, q = sums[i], sums[j]
    return chi_square(q[0] - p[0], q[1] - p[1], q[2] - p[2], q[3] - p[3], q[4] - p[4], q[5] - p[5])


@helper
def joint_cost(sums, i, j, k, m):
    """Rise of χ² if the measurements i … j - 1 and k … m - 1 are on one line, not on two."""
    p, q, r, s = sums[i], sums[j], sums[k], sums[m]
    joint = chi_square(
        q[0] - p[0] + s[0] - r[0], q[1] - p[1] + s[1] - r[1], q[2] - p[2] + s[2] - r[2],
        q[3] - p[3] + s[3] - r[3], q[4] - p[4] + s[4] - r[4], q[5] - p[5] + s[5] - r[5],
    )  # fmt: skip
    return joint - cost(sums, i, j) - cost(sums, k, m)


@inlined
def clearest_border(work, lines):
    """Return the line that χ² rises the most by if it and the one before become one; 0 if none."""
    first, last, found, largest = work.spans[at.FIRST], work.spans[at.LAST], np.int64(0), -1.0
    for k in range(1, lines):
        rise = joint_cost(work.sums, first[k - 1], last[k - 1] + 1, first[k], last[k] + 1)
        if rise > largest:
            found, largest = k, rise
    return found


@inlined
def partition(work, count, evidence):
    """List the lines of the partition of the least energy, in order. Returns how many there are.

    No line goes on over a break, so that the stretches between breaks follow one another.
    """
    origin, first, last = work.beams[at.ORIGIN], work.spans[at.FIRST], work.spans[at.LAST]
    work.points[at.ENERGY, 0], begin = 0.0, np.int64(0)
    for i in range(1, count + 1):
        if i == count or work.beams[at.BROKEN, i]:
            _part_stretch(work, begin, i, evidence)
            begin = i
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
    energy, key, row_key = points[at.ENERGY], points[at.KEY], points[at.ROW_KEY]
    lowest, anchor = points[at.LOWEST], beams[at.ANCHOR]
    origin, runner, value = beams[at.ORIGIN], beams[at.RUNNER], points[at.VALUE]
    running, ends, begins = points[at.RUNNING], points[at.ENDS], points[at.BEGINS]
    price, most = CLUTTER * evidence, max(1.0, (LEAST - 1) * CLUTTER) * evidence
    for j in range(first + 1, min(first + LEAST, last + 1)):
        energy[j], origin[j] = energy[j - 1] + price, -1
    if last - first < LEAST:
        return
    _bound_blocks(ends, begins, sums, first, last)
    oldest, bound = np.int64(0), math.inf
    for r in range(RUNNERS):
        runner[r] = first
    total = energy[first + LEAST - 1]
    for j in range(first + LEAST, last + 1):
        i, leader, least = j - LEAST, np.int64(-1), math.inf
        for r in range(RUNNERS):
            c = runner[r]
            value[r] = energy[c] + evidence + cost(sums, c, j)
            leader = c if value[r] < least else leader
            least = min(value[r], least)
        found = leader if least < total + price else np.int64(-1)
        total = min(least, total + price)
        q, place = (i - first) // GROUP, (i - first) % GROUP
        running[i] = math.inf if i == first else 0.0
        new = energy[i] + evidence - begins[i] + running[i]
        key[q] = min(key[q], new) if place else new
        row_key[q // ROW] = min(row_key[q // ROW], new) if place or q % ROW else new
        lowest[q] = min(lowest[q], energy[i] + evidence) if place else energy[i] + evidence
        anchor[q] = i
        bound = min(bound, new)
        if bound + ends[j] < total:
            total, found, oldest = _open_groups(
                points, beams, sums, first, j, oldest, evidence, total, found
            )
            # What is so far above can never be the least again.
            while oldest < q and key[oldest] + ends[j] > total + most:
                oldest += 1
            bound = math.inf
            for k in range(oldest // ROW, q // ROW + 1):
                bound = min(bound, row_key[k])
        energy[j], origin[j] = total, found


@contracted
def _open_groups(points, beams, sums, first, j, oldest, evidence, total, found):
    """Open the groups whose key is less than the least energy before measurement j.

    The least candidate of a group that is now less than a runner takes its place, and the runner
    goes back to its own group. Returns the least energy, the candidate that it is of, and the first
    group that may still be opened.
    """
    ended, began = points[at.ENDS, j], points[at.BEGINS, j]
    energy, key, row_key = points[at.ENERGY], points[at.KEY], points[at.ROW_KEY]
    lowest, anchor = points[at.LOWEST], beams[at.ANCHOR]
    running, runner, value = points[at.RUNNING], beams[at.RUNNER], points[at.VALUE]
    last, back = j - LEAST + 1, oldest
    groups = (last - 1 - first) // GROUP + 1
    for row in range(oldest // ROW, (groups - 1) // ROW + 1):
        if row_key[row] + ended >= total:
            continue
        row_key[row], lower = math.inf, math.inf
        for q in range(max(row * ROW, oldest), min((row + 1) * ROW, groups)):
            if key[q] + ended >= total:
                lower = min(lower, key[q])
                continue
            low = first + q * GROUP
            # Each line is at least as bad as one up to the anchor and one from there on. Of few
            # measurements, the differences of the running sums have lost too many digits.
            rest = cost(sums, anchor[q], j) if j - anchor[q] >= BLOCK else 0.0
            key[q] = lowest[q] - began + (rest if rest < math.inf else 0.0)
            if key[q] + began >= total:
                lower = min(lower, key[q])
                continue
            least, second, best = math.inf, math.inf, low
            for c in range(low, min(low + GROUP, last)):
                now = energy[c] + evidence + cost(sums, c, j) + running[c]
                second = min(second, max(least, now))
                best = c if now < least else best
                least = min(least, now)
            found = best if least < total else found
            total = min(least, total)
            worst = 0
            for r in range(1, RUNNERS):
                worst = r if value[r] > value[worst] else worst
            runs = least < value[worst]
            key[q] = (second if runs else least) - began
            lower = min(lower, key[q])
            if low + GROUP <= last:
                anchor[q], lowest[q] = j, key[q] + began
            if runs:
                out, group = runner[worst], (runner[worst] - first) // GROUP
                running[out], running[best] = 0.0, math.inf
                key[group] = min(key[group], value[worst] - began)
                row_key[group // ROW] = min(row_key[group // ROW], key[group])
                rest = cost(sums, out, anchor[group])
                rest = energy[out] + evidence + (rest if rest < math.inf else 0.0)
                lowest[group] = min(lowest[group], rest)
                back = min(back, group)
                runner[worst], value[worst] = best, least
        row_key[row] = min(row_key[row], lower)
    return total, found, back


@helper
def _bound_blocks(ends, begins, sums, first, last):
    """Sum the χ² of the blocks of measurements that end by each one, and that begin before it.

    A line over some blocks costs at least as much as each has with a line for itself.
    """
    total, begins[first] = 0.0, 0.0
    for low in range(first, last + 1, BLOCK):
        high, own = low + BLOCK, 0.0
        if high <= last:
            own = cost(sums, low, high)
            own = own if own < math.inf else 0.0
        for i in range(low, min(high, last + 1)):
            ends[i] = total
        total += own
        for i in range(low + 1, min(high, last) + 1):
            begins[i] = total


@inlined
def merge_lines(work, lines, evidence):
    """Merge neighbours that are one wall that bends, first those whose χ² rises the least.

    Returns how many lines are left.
    """
    first, last, rises = work.spans[at.FIRST], work.spans[at.LAST], work.points[at.KEY]
    for k in range(1, lines):
        rises[k] = _rise(work, k)
    while lines > 1:
        k = 1
        for m in range(2, lines):
            k = m if rises[m] < rises[k] else k
        if not rises[k] < RARE * evidence:
            break
        last[k - 1] = last[k]
        lines -= 1
        for m in range(k, lines):
            first[m], last[m], rises[m] = first[m + 1], last[m + 1], rises[m + 1]
        for m in range(max(k - 1, 1), min(k + 1, lines)):
            rises[m] = _rise(work, m)
    return lines


@inlined
def _rise(work, k):
    """Rise of χ² if a line and the one before become one; inf where these are no wall that bends.

    They then turn by little, and are no farther apart at their border than by chance.
    """
    spans, sums, points = work.spans, work.sums, work.points
    start, border, end = spans[at.FIRST, k - 1], spans[at.FIRST, k], spans[at.LAST, k] + 1
    if border > spans[at.LAST, k - 1] + 1 or work.beams[at.BROKEN, border]:
        return math.inf
    a, b = solve(sums, start, border)
    c, d = solve(sums, border, end)
    if not a * c + b * d > BEND * math.sqrt((a * a + b * b) * (c * c + d * d)):
        return math.inf
    step = gap(points, border - 1, border, a - c, b - d)
    if step * step > SIGMAS * SIGMAS * surface_variance(points, border, work.noise):
        return math.inf
    return joint_cost(sums, start, border, border, end)


@helper
def surface_variance(points, i, noise):
    """Variance of a measurement about the line of its surface."""
    return TAU * TAU + noise[0] + noise[1] * points[at.RHO, i] * points[at.RHO, i]


@helper
def gap(points, i, j, a, b):
    """Range by which one line is before another at the beams of i and j, the lesser of both [m].

    The lines differ by a x + b y in ρ over their ranges; 0 where they cross between those beams,
    less than 0 where the first is behind.
    """
    here = (a * points[at.X, i] + b * points[at.Y, i]) * points[at.RHO, i]
    there = (a * points[at.X, j] + b * points[at.Y, j]) * points[at.RHO, j]
    if here * there <= 0.0:
        return 0.0
    return here if abs(here) < abs(there) else there
