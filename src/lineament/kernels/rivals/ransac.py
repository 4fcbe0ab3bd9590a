"""RANSAC: lines through random pairs, and the longest run of points that agree."""

import math

import numpy as np

from .. import helper, kernel
from ..layout import (
    CANDIDATES,
    CLASS_FIRST,
    CLASS_LAST,
    CLASSES,
    FIRST,
    LABEL,
    LAST,
    PIECES,
    POINTS,
    RHO,
    X,
    Y,
)
from .runs import longest_run, refined_run, take_run
from .stretches import fill_moments, fill_tolerances

#: Of the generator: a prime, so that it runs through all numbers below but 0.
PERIOD = 2147483647


@kernel
def find_by_consensus(
    floats,
    ints,
    counts,
    noise,
    trials,
    window,
    min_points,
    min_length,
    max_misses,
    epsilon,
    sigmas,
    seed,
    moments,
    slack,
    slope,
    free,
    left,
):
    """Find the lines of a scan.

    Parameters
    ----------
    floats, ints, counts
        See `layout`. The lines by point are read; FIRST, LAST and PIECES are written.
    noise : float64 array, shape (4,)
    trials, window, min_points, min_length, max_misses, epsilon, sigmas, seed
        As in `methods.ransac.Ransac`.
    moments : float64 array, shape (n + 1, MOMENTS)
    slack, slope : float64 arrays, shape (n + 1,)
    free, left : int64 arrays, shape (n + 1,)
        Scratch.
    """
    x, y, count, first, last = floats[X], floats[Y], counts[POINTS], ints[FIRST], ints[LAST]
    fill_moments(x, y, ints[LABEL], count, moments)
    fill_tolerances(floats[RHO], count, noise, epsilon, sigmas, slack, slope)
    n, state = np.int64(0), seed
    for i in range(count):
        free[i] = 1
    for c in range(counts[CLASSES]):
        while True:
            near, a, b, state = _consensus(
                x,
                y,
                moments,
                free,
                left,
                slack,
                slope,
                ints[CLASS_FIRST, c],
                ints[CLASS_LAST, c],
                trials,
                window,
                max_misses,
                state,
            )
            if near < min_points or math.hypot(x[b] - x[a], y[b] - y[a]) < min_length:
                break
            take_run(free, a, b, first, last, n)
            n += 1
    counts[PIECES], counts[CANDIDATES] = n, 0


@helper
def _consensus(
    x, y, moments, free, left, slack, slope, first, last, trials, window, max_misses, state
):
    """Find the longest run of free points of one class that agree with a line through two.

    Pairs are drawn from the free points and are `window` points apart at most. The best of their
    lines is fitted to its run, three times over, as points at random lie anywhere in the noise.
    Returns as `runs.longest_run`, and the state of the generator.
    """
    best, bx, by, bd = np.int64(0), 0.0, 0.0, 0.0
    m = np.int64(0)
    for i in range(first, last + 1):
        left[m] = i
        m += free[i]
    if m < 2:
        return best, first, first, state
    for _ in range(trials):
        state = draw(state)
        k = state % (m - 1)
        state = draw(state)
        i, j = left[k], left[k + 1 + state % min(window, m - 1 - k)]
        if j - i > window:
            continue
        nx, ny = y[j] - y[i], x[i] - x[j]
        norm = math.hypot(nx, ny)
        if norm == 0.0:
            continue
        nx, ny = nx / norm, ny / norm
        d = nx * x[i] + ny * y[i]
        near, _, _ = longest_run(x, y, free, slack, slope, first, last, nx, ny, d, 0.0, max_misses)
        if near > best:
            best, bx, by, bd = near, nx, ny, d
    if best == 0:
        return best, first, first, state
    near, a, b = refined_run(
        x, y, moments, free, slack, slope, first, last, bx, by, bd, 0.0, max_misses, 3
    )
    return near, a, b, state


@helper
def draw(state):
    """Next number of the least standard generator (Park and Miller), 1 … 2³¹ - 2."""
    return state * 48271 % PERIOD
