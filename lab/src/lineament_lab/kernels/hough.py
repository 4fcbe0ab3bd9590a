"""Hough transform: lines by the votes of points for direction and distance.

R. O. Duda, P. E. Hart, *Use of the Hough transformation to detect lines and curves in pictures*,
Communications of the ACM 15 (1972).
"""

import math
from typing import NamedTuple

import numpy as np

from lineament.kernels import helper
from lineament.kernels import layout as at
from lineament.kernels.arrays import Floats1, Floats2, Ints2, Shorts2
from lineament.kernels.line_fit import range_variance

from . import kernel
from .stretches import is_piece, prepare, refined_run, take_run


class Parameters(NamedTuple):
    """Those of the method."""

    resolution: float
    min_points: int
    min_length: float
    max_misses: int
    epsilon: float
    sigmas: float


@kernel
def find_by_votes(
    floats: Floats2,
    ints: Ints2,
    noise: Floats1,
    parameters: Parameters,
    votes: Shorts2,
    normals: Floats2,
):
    """Find the lines of a scan: from points and clusters, the ends of pieces.

    `parameters` are a tuple, see `Parameters`, and `methods.hough.Hough`; `votes` is the
    accumulator, an int32 array of shape (A, D); `normals`, shape (A, 2), are the unit normals of
    the lines that are voted for, over half a turn from the direction of a cluster.
    """
    work, p = at.extended(floats, ints), Parameters(*parameters)
    prepare(work, noise, p.epsilon, p.sigmas)
    work.counts[at.PIECES] = 0
    for c in range(work.counts[at.CLUSTERS]):
        first, last = work.clusters[at.FIRST, c], work.clusters[at.LAST, c]
        sigma = math.sqrt(range_variance(work.points[at.RHO, first], noise))
        _find_in_cluster(work, first, last, max(p.resolution, 2.0 * sigma), p, votes, normals)


@helper
def _find_in_cluster(work, start, stop, width, p, votes, normals):
    """Find the lines of one cluster, from `start` to `stop`."""
    x, y, free = work.points[at.X], work.points[at.Y], work.marks[at.FREE]
    disc = _disc(x, y, start, stop)
    ox, oy, ux, uy, radius = disc
    width = max(width, 2.0 * radius / (votes.shape[1] - 1))
    if width == math.inf:
        return
    used = np.int64(2.0 * radius / width) + 1
    _clear(votes, used)
    _vote(x, y, start, stop, disc, width, np.int32(1), votes, normals)
    while True:
        a, k, most = _peak(votes, used)
        if most < p.min_points:
            return
        nx, ny = _normal(normals, a, ux, uy)
        line = nx, ny, nx * ox + ny * oy + (k + 0.5) * width - radius
        near, i, j = refined_run(work, start, stop, line, 0.5 * width, p.max_misses, 4)
        if near == 0:
            votes[a, k] = 0
            continue
        _vote(x, y, i, j, disc, width, np.int32(-1), votes, normals)
        if is_piece(work.points, near, i, j, p.min_points, p.min_length):
            take_run(work, i, j)
        else:
            for q in range(i, j + 1):
                free[q] = 0


@helper
def _disc(x, y, start, stop):
    """Centre of the box of some points along their chord; its direction; their greatest distance.

    Where the chord has no length, as of a ring, the direction is that of the first beam. So the
    same lines are found in whatever direction the scanner looks.
    """
    ux, uy = x[stop] - x[start], y[stop] - y[start]
    if not math.hypot(ux, uy) > 0.0:
        ux, uy = x[start], y[start]
    norm = math.hypot(ux, uy)
    ux, uy = ux / norm, uy / norm
    left, right, low, high = 0.0, 0.0, 0.0, 0.0
    for i in range(start, stop + 1):
        dx, dy = x[i] - x[start], y[i] - y[start]
        along, across = ux * dx + uy * dy, ux * dy - uy * dx
        left, right = min(left, along), max(right, along)
        low, high = min(low, across), max(high, across)
    along, across = 0.5 * (left + right), 0.5 * (low + high)
    ox, oy = x[start] + along * ux - across * uy, y[start] + along * uy + across * ux
    radius = 0.0
    for i in range(start, stop + 1):
        radius = max(radius, math.hypot(x[i] - ox, y[i] - oy))
    return ox, oy, ux, uy, radius


@helper
def _normal(normals, a, ux, uy):
    """Return a normal that is voted for, counted from the direction of a cluster."""
    return normals[a, 0] * ux - normals[a, 1] * uy, normals[a, 0] * uy + normals[a, 1] * ux


@helper
def _clear(votes, used):
    for a in range(votes.shape[0]):
        for k in range(used):
            votes[a, k] = 0


@helper
def _vote(x, y, first, last, disc, width, vote, votes, normals):
    """Add a vote of each point for each line through it."""
    ox, oy, ux, uy, radius = disc
    offset = radius / width
    for a in range(votes.shape[0]):
        nx, ny = _normal(normals, a, ux, uy)
        c, s, cells = nx / width, ny / width, votes[a]
        for i in range(first, last + 1):
            cells[np.int64(c * (x[i] - ox) + s * (y[i] - oy) + offset)] += vote


@helper
def _peak(votes, used):
    """First of the cells with the most votes: its direction, distance, and votes."""
    best, most = np.int64(0), np.int32(0)
    for a in range(votes.shape[0]):
        cells, top = votes[a], np.int32(0)
        for k in range(used):
            top = max(top, cells[k])
        if top > most:
            best, most = a, top
    cells, k = votes[best], np.int64(0)
    while cells[k] < most:
        k += 1
    return best, k, most
