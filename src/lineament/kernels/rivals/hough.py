"""Hough transform: lines by the votes of points for direction and distance."""

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
from ..line_fit import range_variance
from .runs import refined_run, take_run
from .stretches import fill_moments, fill_tolerances


@kernel
def find_by_votes(
    floats,
    ints,
    counts,
    noise,
    resolution,
    min_points,
    min_length,
    max_misses,
    epsilon,
    sigmas,
    moments,
    slack,
    slope,
    free,
    votes,
    normals,
):
    """Find the lines of a scan.

    Parameters
    ----------
    floats, ints, counts
        See `layout`. The lines by point are read; FIRST, LAST and PIECES are written.
    noise : float64 array, shape (4,)
    resolution, min_points, min_length, max_misses, epsilon, sigmas
        As in `methods.hough.Hough`.
    moments : float64 array, shape (n + 1, MOMENTS)
    slack, slope : float64 arrays, shape (n + 1,)
    free : int64 array, shape (n + 1,)
        Scratch.
    votes : int32 array, shape (A, D)
        The accumulator; scratch.
    normals : float64 array, shape (A, 2)
        Unit normals of the lines that are voted for, over half a turn.
    """
    x, y, rho = floats[X], floats[Y], floats[RHO]
    count = counts[POINTS]
    fill_moments(x, y, ints[LABEL], count, moments)
    fill_tolerances(rho, count, noise, epsilon, sigmas, slack, slope)
    for i in range(count):
        free[i] = 1
    n = np.int64(0)
    for c in range(counts[CLASSES]):
        start = ints[CLASS_FIRST, c]
        n = _vote_class(
            x,
            y,
            moments,
            slack,
            slope,
            free,
            start,
            ints[CLASS_LAST, c],
            max(resolution, 2.0 * math.sqrt(range_variance(rho[start], noise))),
            min_points,
            min_length,
            max_misses,
            votes,
            normals,
            ints[FIRST],
            ints[LAST],
            n,
        )
    counts[PIECES], counts[CANDIDATES] = n, 0


@helper
def _vote_class(
    x,
    y,
    moments,
    slack,
    slope,
    free,
    start,
    stop,
    width,
    min_points,
    min_length,
    max_misses,
    votes,
    normals,
    first,
    last,
    n,
):
    """Find the lines of one class, from `start` to `stop`. Returns the number of pieces."""
    ox, oy, radius = _circle(x, y, start, stop)
    width = max(width, 2.0 * radius / (votes.shape[1] - 1))
    if width == math.inf:
        return n
    used = np.int64(2.0 * radius / width) + 1
    _clear(votes, used)
    _vote(x, y, start, stop, ox, oy, radius, width, np.int32(1), votes, normals)
    while True:
        a, k, most = _peak(votes, used)
        if most < min_points:
            return n
        nx, ny = normals[a, 0], normals[a, 1]
        d = nx * ox + ny * oy + (k + 0.5) * width - radius
        near, i, j = refined_run(
            x, y, moments, free, slack, slope, start, stop, nx, ny, d, 0.5 * width, max_misses, 4
        )
        if near == 0:
            votes[a, k] = 0
            continue
        _vote(x, y, i, j, ox, oy, radius, width, np.int32(-1), votes, normals)
        if near >= min_points and math.hypot(x[j] - x[i], y[j] - y[i]) >= min_length:
            take_run(free, i, j, first, last, n)
            n += 1
        else:
            for p in range(i, j + 1):
                free[p] = 0


@helper
def _circle(x, y, start, stop):
    """Centre of the bounding box of some points, and their greatest distance from it."""
    left, right, low, high = x[start], x[start], y[start], y[start]
    for i in range(start, stop + 1):
        left, right = min(left, x[i]), max(right, x[i])
        low, high = min(low, y[i]), max(high, y[i])
    ox, oy, radius = 0.5 * (left + right), 0.5 * (low + high), 0.0
    for i in range(start, stop + 1):
        radius = max(radius, math.hypot(x[i] - ox, y[i] - oy))
    return ox, oy, radius


@helper
def _clear(votes, used):
    for a in range(votes.shape[0]):
        for k in range(used):
            votes[a, k] = 0


@helper
def _vote(x, y, first, last, ox, oy, radius, width, vote, votes, normals):
    """Add a vote of each point for each line through it."""
    offset = radius / width
    for a in range(votes.shape[0]):
        c, s, line = normals[a, 0] / width, normals[a, 1] / width, votes[a]
        for i in range(first, last + 1):
            line[np.int64(c * (x[i] - ox) + s * (y[i] - oy) + offset)] += vote


@helper
def _peak(votes, used):
    """First of the cells with the most votes: its direction, distance, and votes."""
    best, most = np.int64(0), np.int32(0)
    for a in range(votes.shape[0]):
        line, top = votes[a], np.int32(0)
        for k in range(used):
            top = max(top, line[k])
        if top > most:
            best, most = a, top
    line, k = votes[best], np.int64(0)
    while line[k] < most:
        k += 1
    return best, k, most
