"""Neighbouring lines that are one wall: how much worse one line is for both, how far they part."""

import math

import numpy as np

from .. import inlined
from . import layout as at
from .constants import BEND, RARE, SIGMAS
from .costs import joint_cost, solve
from .geometry import gap, surface_variance


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
def merge_lines(work, lines, evidence):
    """Merge neighbours that are one wall that bends, first those whose χ² rises the least.

    Returns how many lines are left.
    """
    first, last, rises = work.spans[at.FIRST], work.spans[at.LAST], work.points[at.RISE]
    for k in range(1, lines):
        rises[k] = rise_if_one(work, k)
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
            rises[m] = rise_if_one(work, m)
    return lines


@inlined
def rise_if_one(work, k):
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
