"""Runs of consecutive points near a line: what consensus and votes come down to."""

import numpy as np

from .. import helper
from .stretches import stretch_line


@helper
def longest_run(x, y, free, slack, slope, first, last, nx, ny, d, margin, max_misses):
    """Find the run of free points near a line n · p = d that has the most of them.

    A run ends at a point that is not free, or where more than `max_misses` points in a row are
    farther from the line than their tolerance and `margin` allow.

    Returns
    -------
    near, begin, end : int
        Number of near points, and the first and last of them (0, -1, -1 where there is none).
    """
    best, best_begin, best_end = np.int64(0), np.int64(-1), np.int64(-1)
    near, begin, end, distance = np.int64(0), first, first, abs(d)
    for i in range(first, last + 1):
        if not free[i] or (near > 0 and i - end > max_misses + 1):
            near = np.int64(0)
        if free[i] and abs(nx * x[i] + ny * y[i] - d) <= slack[i] + slope[i] * distance + margin:
            begin = i if near == 0 else begin
            near, end = near + 1, i
            if near > best:
                best, best_begin, best_end = near, begin, end
    return best, best_begin, best_end


@helper
def refined_run(
    x, y, moments, free, slack, slope, first, last, nx, ny, d, margin, max_misses, passes
):
    """Find the longest run near a line; fit a line to it, and find that line's, again and again.

    `margin` is for the first line only, that may be a coarse one. Returns as `longest_run`.
    """
    near, a, b = longest_run(x, y, free, slack, slope, first, last, nx, ny, d, margin, max_misses)
    for _ in range(passes):
        if near < 3:
            break
        nx, ny, d, _ = stretch_line(x, y, moments, a, b)
        near, a, b = longest_run(x, y, free, slack, slope, first, last, nx, ny, d, 0.0, max_misses)
    return near, a, b


@helper
def take_run(free, begin, end, first, last, n):
    """Add a run to the pieces of a row, which stay in beam order, and take its points."""
    for i in range(begin, end + 1):
        free[i] = 0
    k = n
    while k > 0 and first[k - 1] > begin:
        first[k], last[k] = first[k - 1], last[k - 1]
        k -= 1
    first[k], last[k] = begin, end
