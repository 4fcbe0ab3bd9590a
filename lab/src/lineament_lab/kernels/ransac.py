"""RANSAC: lines through random pairs, and the longest run of points that agree.

M. A. Fischler, R. C. Bolles, *Random sample consensus*, Communications of the ACM 24 (1981).
"""

import math
from typing import NamedTuple

import numpy as np

from lineament.kernels import helper
from lineament.kernels import layout as at
from lineament.kernels.arrays import Floats1, Floats2, Ints2

from . import kernel
from .stretches import is_piece, longest_run, prepare, refined_run, take_run

#: Of the generator: a prime, so that it runs through all numbers below but 0.
PERIOD = 2147483647


class Parameters(NamedTuple):
    """Those of the method."""

    trials: int
    window: int
    min_points: int
    min_length: float
    max_misses: int
    epsilon: float
    sigmas: float
    seed: int


@kernel
def find_by_consensus(
    floats: Floats2,
    ints: Ints2,
    noise: Floats1,
    parameters: Parameters,
):
    """Find the lines of a scan: from points and clusters, the ends of pieces.

    `parameters` are a tuple, see `Parameters`, and `methods.ransac.Ransac`.
    """
    work, p = at.extended(floats, ints), Parameters(*parameters)
    prepare(work, noise, p.epsilon, p.sigmas)
    work.counts[at.PIECES] = 0
    state = p.seed
    for c in range(work.counts[at.CLUSTERS]):
        first, last = work.clusters[at.FIRST, c], work.clusters[at.LAST, c]
        while True:
            near, a, b, state = _consensus(work, first, last, p, state)
            if not is_piece(work.points, near, a, b, p.min_points, p.min_length):
                break
            take_run(work, a, b)


@helper
def _consensus(work, first, last, p, state):
    """Find the longest run of free points of one cluster that agree with a line through two.

    Pairs are drawn from the free points and are `window` points apart at most. The best of their
    lines is fitted to its run, three times over, as points at random lie anywhere in the noise.
    Returns as `longest_run`, and the state of the generator.
    """
    points, free, left = work.points, work.marks[at.FREE], work.marks[at.LEFT]
    x, y = points[at.X], points[at.Y]
    best, line = np.int64(0), (0.0, 0.0, 0.0)
    m = np.int64(0)
    for i in range(first, last + 1):
        left[m] = i
        m += free[i]
    if m < 2:
        return best, first, first, state
    for _ in range(p.trials):
        state = draw(state)
        k = state % (m - 1)
        state = draw(state)
        i, j = left[k], left[k + 1 + state % min(p.window, m - 1 - k)]
        if j - i > p.window:
            continue
        nx, ny = y[j] - y[i], x[i] - x[j]
        norm = math.hypot(nx, ny)
        if norm == 0.0:
            continue
        nx, ny = nx / norm, ny / norm
        through = nx, ny, nx * x[i] + ny * y[i]
        near, _, _ = longest_run(points, free, first, last, through, 0.0, p.max_misses)
        if near > best:
            best, line = near, through
    if best == 0:
        return best, first, first, state
    near, a, b = refined_run(work, first, last, line, 0.0, p.max_misses, 3)
    return near, a, b, state


@helper
def draw(state):
    """Return the next number of the generator of Park and Miller (1988), 1 … 2³¹ - 2."""
    return state * 48271 % PERIOD
