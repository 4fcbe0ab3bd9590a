"""Seeded region growing: straight regions that grow from a seed both ways."""

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
from .stretches import fill_moments, fill_tolerances, stretch_line


@kernel
def grow_regions(
    floats,
    ints,
    counts,
    noise,
    s_num,
    p_min,
    l_min,
    delta,
    epsilon,
    sigmas,
    moments,
    slack,
    slope,
):
    """Find the straight regions of a scan. They may overlap where walls meet.

    Parameters
    ----------
    floats, ints, counts
        See `layout`. The lines by point are read; FIRST, LAST and PIECES are written.
    noise : float64 array, shape (4,)
    s_num, p_min, l_min, delta, epsilon, sigmas
        As in `methods.region_growing.RegionGrowing`.
    moments : float64 array, shape (n + 1, MOMENTS)
    slack, slope : float64 arrays, shape (n + 1,)
        Scratch.
    """
    x, y, rho = floats[X], floats[Y], floats[RHO]
    fill_moments(x, y, ints[LABEL], counts[POINTS], moments)
    fill_tolerances(rho, counts[POINTS], noise, epsilon, sigmas, slack, slope)
    n = np.int64(0)
    for c in range(counts[CLASSES]):
        n = _grow_class(
            x,
            y,
            rho,
            moments,
            slack,
            slope,
            ints[CLASS_FIRST, c],
            ints[CLASS_LAST, c],
            s_num,
            p_min,
            l_min,
            delta,
            ints[FIRST],
            ints[LAST],
            n,
        )
    counts[PIECES], counts[CANDIDATES] = n, 0


@helper
def _grow_class(
    x, y, rho, moments, slack, slope, start, stop, s_num, p_min, l_min, delta, first, last, n
):
    """Find the regions of one class, from `start` to `stop`. Returns the number of pieces."""
    i, floor = start, start
    while i + s_num - 1 <= stop:
        a, b = i, i + s_num - 1
        nx, ny, d, _ = stretch_line(x, y, moments, a, b)
        if not _all_near(x, y, rho, slack, slope, a, b, nx, ny, d, delta):
            i += 1
            continue
        while b < stop and _is_near(x, y, rho, slack, slope, b + 1, nx, ny, d, delta):
            b += 1
            nx, ny, d, _ = stretch_line(x, y, moments, a, b)
        while a > floor and _is_near(x, y, rho, slack, slope, a - 1, nx, ny, d, delta):
            a -= 1
            nx, ny, d, _ = stretch_line(x, y, moments, a, b)
        if b - a + 1 >= p_min and math.hypot(x[b] - x[a], y[b] - y[a]) >= l_min:
            first[n], last[n] = a, b
            n += 1
            # The next may reach back into this one, but not over it.
            floor = a + 2
        # So does its seed, or a wall of few points would have no room for one.
        i = b + 1 - s_num // 2
    return n


@helper
def _all_near(x, y, rho, slack, slope, first, last, nx, ny, d, delta):
    for i in range(first, last + 1):
        if not _is_near(x, y, rho, slack, slope, i, nx, ny, d, delta):
            return False
    return True


@helper
def _is_near(x, y, rho, slack, slope, i, nx, ny, d, delta):
    """Whether a point is near a line, and near where its beam meets that line.

    Along the beam it is |n · p - d| / cos ψ away, with cos ψ = |n · p| / ρ.
    """
    across = nx * x[i] + ny * y[i]
    off = abs(across - d)
    return off <= slack[i] + slope[i] * abs(d) and off * rho[i] <= (
        delta + slope[i] * rho[i]
    ) * abs(across)
