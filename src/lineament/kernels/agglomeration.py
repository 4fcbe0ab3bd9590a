"""Pieces of classes merged, the cheapest pair first, while one line explains both."""

import math

from . import helper
from .inverse_range import line_through
from .layout import COST, FIRST, JOINT_COST, LAST

#: χ² of a point that is still on a line.
_GOOD = 4.0
#: Points of either part of a piece.
_LEAST = 3


@helper
def list_stretches(ints, first, last, size, n):
    """Part a class into stretches of `size` points or a little more, as pieces from the n-th on.

    Returns the number of pieces.
    """
    points = last - first + 1
    parts = max(points // size, 1)
    for j in range(parts):
        ints[FIRST, n] = first + points * j // parts
        ints[LAST, n] = first + points * (j + 1) // parts - 1
        n += 1
    return n


@helper
def agglomerate(floats, ints, sums, c, low, high, evidence):
    """Merge the pieces `low`..`high` - 1, all of class c.

    Merging two raises χ² by that of one line through both, less those of their own lines. Pairs
    that cost less than their neighbours, and at most `evidence`, are merged, and again until
    there are none.

    Returns
    -------
    int
        One more than the last piece that is left.
    """
    first, last, own, joint = ints[FIRST], ints[LAST], floats[COST], floats[JOINT_COST]
    for k in range(low, high):
        # A stretch around a corner is a piece of no line: it does not get better by merging.
        most = _GOOD * (last[k] - first[k] + 1)
        _, _, chi_square = line_through(sums, c, first[k], last[k])
        own[k], joint[k] = min(chi_square, most), math.nan
    while high - low > 1:
        for k in range(low + 1, high):
            if math.isnan(joint[k]):
                _, _, joint[k] = line_through(sums, c, first[k - 1], last[k])
        left = _merge_cheapest(first, last, own, joint, low, high, evidence)
        if left == high:
            break
        high = left
    return high


@helper
def _merge_cheapest(first, last, own, joint, low, high, evidence):
    """Merge each pair that costs less than the pairs beside it. Joint costs to be found are NaN."""
    kept, stale = low, False
    before, here = math.inf, _rise(own, joint, low + 1, high)
    for k in range(low + 1, high):
        after = _rise(own, joint, k + 1, high)
        if here <= evidence and here <= before and here < after:
            last[kept], own[kept] = last[k], joint[k]
            joint[kept], stale = math.nan, True
        else:
            kept += 1
            first[kept], last[kept], own[kept] = first[k], last[k], own[k]
            joint[kept] = math.nan if stale else joint[k]
            stale = False
        before, here = here, after
    return kept + 1


@helper
def _rise(own, joint, k, high):
    """Tell what merging a piece with the one before raises χ² by."""
    return joint[k] - own[k - 1] - own[k] if k < high else math.inf


@helper
def part_again(ints, sums, c, low, high, evidence):
    """Part pieces of class c where two lines explain them better, by more than `evidence`.

    Merging begins with stretches: a step within one is in both its pairs, and raises neither.
    Returns one more than the last piece.
    """
    first, last = ints[FIRST], ints[LAST]
    k = low
    while k < high:
        i, j = first[k], last[k]
        _, _, whole = line_through(sums, c, i, j)
        # Most pieces are no more off than by noise, and need no closer look.
        if whole - (j - i + 1) > evidence and j - i + 1 >= 2 * _LEAST:
            border, parts = _best_border(sums, c, i, j)
            if whole - parts > evidence:
                for m in range(high, k + 1, -1):
                    first[m], last[m] = first[m - 1], last[m - 1]
                last[k], first[k + 1], last[k + 1] = border - 1, border, j
                high += 1
                continue  # Either part may be two.
        k += 1
    return high


@helper
def _best_border(sums, c, i, j):
    """First point of the second of the two lines that explain points i..j best, and their χ²."""
    border, least = i + _LEAST, math.inf
    for k in range(i + _LEAST, j - _LEAST + 2):
        _, _, before = line_through(sums, c, i, k - 1)
        if before >= least:
            break  # More points do not lessen it.
        _, _, after = line_through(sums, c, k, j)
        if before + after < least:
            border, least = k, before + after
    return border, least
