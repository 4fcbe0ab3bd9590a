"""Seeded region growing: straight regions that grow from a seed both ways.

H. Gao, X. Zhang, Y. Fang, J. Yuan, *A line segment extraction algorithm using laser data based on
seeded region growing*, International Journal of Advanced Robotic Systems 15 (2018).
"""

from typing import NamedTuple

from lineament.kernels import helper
from lineament.kernels import layout as at
from lineament.kernels.arrays import Floats1, Floats2, Ints2

from . import kernel
from .stretches import is_piece, prepare, stretch_line


class Parameters(NamedTuple):
    """Those of the method."""

    s_num: int
    p_min: int
    l_min: float
    delta: float
    epsilon: float
    sigmas: float


@kernel
def grow_regions(
    floats: Floats2,
    ints: Ints2,
    noise: Floats1,
    parameters: Parameters,
):
    """Find the straight regions of a scan, which may overlap where walls meet.

    From points and clusters, the ends of pieces. `parameters` are a tuple, see `Parameters`, and
    `methods.region_growing.RegionGrowing`.
    """
    work, p = at.extended(floats, ints), Parameters(*parameters)
    prepare(work, noise, p.epsilon, p.sigmas)
    work.counts[at.PIECES] = 0
    for c in range(work.counts[at.CLUSTERS]):
        _grow_in_cluster(work, work.clusters[at.FIRST, c], work.clusters[at.LAST, c], p)


@helper
def _grow_in_cluster(work, start, stop, p):
    """Find the regions of one cluster, from `start` to `stop`."""
    points, pieces, counts = work.points, work.pieces, work.counts
    i, floor, delta = start, start, p.delta
    while i + p.s_num - 1 <= stop:
        a, b = i, i + p.s_num - 1
        line = stretch_line(work, a, b)
        while a <= b and _is_near(points, a, line, delta):
            a += 1
        if a <= b:
            i += 1
            continue
        a = i
        while b < stop and _is_near(points, b + 1, line, delta):
            b += 1
            line = stretch_line(work, a, b)
        while a > floor and _is_near(points, a - 1, line, delta):
            a -= 1
            line = stretch_line(work, a, b)
        if is_piece(points, b - a + 1, a, b, p.p_min, p.l_min):
            n = counts[at.PIECES]
            pieces[at.FIRST, n], pieces[at.LAST, n] = a, b
            counts[at.PIECES] += 1
            # The next may reach back into this one, but not over it.
            floor = a + 2
        # So does its seed, or a wall of few points would have no room for one.
        i = b + 1 - p.s_num // 2


@helper
def _is_near(points, i, line, delta):
    """Whether a point is near a line, and near where its beam meets that line.

    Along the beam it is |n · p - d| / cos ψ away, with cos ψ = |n · p| / ρ.
    """
    nx, ny, d, _ = line
    rho, slope = points[at.RHO, i], points[at.SLOPE, i]
    across = nx * points[at.X, i] + ny * points[at.Y, i]
    off = abs(across - d)
    on_line = off <= points[at.SLACK, i] + slope * abs(d)
    return on_line and off * rho <= (delta + slope * rho) * abs(across)
