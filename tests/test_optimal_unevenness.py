"""How uneven walls are found to be, by the kernel and by the slow twin."""

from __future__ import annotations

import math
from itertools import pairwise

import numba
import numpy as np
import pytest
from naive import polar
from naive_optimal_noise import wall_unevenness as naive_unevenness
from naive_optimal_pieces import Points
from worlds import STEP, fan, wall

from lineament.kernels import layout as at
from lineament.kernels.inverse_range import SUMS, fill_sums
from lineament.kernels.unevenness import MOST_UNEVEN, wall_unevenness

NOISE = (0.01, 0.0, 0.0, 0.0)
ANGLES = fan(40, STEP)


@numba.njit
def _unevenness(floats, ints, counts, noise, sums, ends):
    fill_sums(floats, ints, counts, noise, sums)
    return wall_unevenness(floats, ints, counts, noise, sums, ends)


def unevenness(ranges, parts=4):
    """Of one class, cut into so many pieces."""
    xy, n = polar(ranges, ANGLES[: len(ranges)]), len(ranges)
    floats, ints = np.zeros((at.FLOATS, n + 1)), np.zeros((at.INTS, n + 1), np.int64)
    counts, edges = np.zeros(at.COUNTS, np.int64), np.linspace(0, n, parts + 1).astype(int)
    floats[at.X, :n], floats[at.Y, :n] = xy.T
    floats[at.RHO, :n] = np.hypot(*xy.T)
    ints[at.FIRST, :parts], ints[at.LAST, :parts] = edges[:-1], edges[1:] - 1
    ints[at.CLASS_LAST, 0] = n - 1
    counts[at.POINTS], counts[at.CLASSES], counts[at.PIECES] = n, 1, parts
    sums, ends = np.zeros((2 * n + 4, SUMS)), np.array([parts])
    found = _unevenness(floats, ints, counts, np.array(NOISE), sums, ends)
    pieces = [(int(a), int(b) - 1) for a, b in pairwise(edges)]
    twin = naive_unevenness(Points(xy, list(range(n)), NOISE), [pieces])
    assert found == pytest.approx(twin, rel=1e-6, abs=1e-12)
    return found


def noisy(ranges, seed):
    return ranges + NOISE[0] * np.random.default_rng(seed).normal(size=len(ranges))


def bowed(distance, rms):
    """Ranges of a wall straight ahead, that is off a line by one wave."""
    along = distance * np.tan(ANGLES)
    off = math.sqrt(2) * rms * np.cos(2 * math.pi * along / np.ptp(along))
    return (distance - off) / np.cos(ANGLES)


@pytest.mark.parametrize("distance", [1.5, 3.0, 8.0])
@pytest.mark.parametrize("sigma", [0.7, 1.0, 1.03])
def test_straight_walls_are_even(distance, sigma):
    """Though the noise is 3 % larger than was told: it is white."""
    straight = wall(ANGLES, distance, 10.0)
    found = [
        unevenness(straight + sigma * (noisy(straight, seed) - straight)) for seed in range(40)
    ]
    assert np.count_nonzero(found) <= 2


def test_beams_of_two_sweeps_tell_of_one_wall():
    """Every other reading is off to the same side, so that neighbours are off to both."""
    straight, off = wall(ANGLES, 3.0, 10.0), 0.008 * (-1.0) ** np.arange(len(ANGLES))
    assert min(unevenness(noisy(straight + off, seed)) for seed in range(10)) > 0.0


@pytest.mark.parametrize("distance", [1.5, 3.0, 8.0])
def test_walls_that_bow_are_uneven(distance):
    found = [unevenness(noisy(bowed(distance, 0.015), seed)) for seed in range(10)]
    assert min(found) > 0.0
    assert max(found) <= MOST_UNEVEN**2


def test_short_walls_say_nothing():
    assert unevenness(noisy(bowed(3.0, 0.015), 0)[:7], parts=1) == 0.0


def test_unevenness_of_hostile_ranges_is_no_nan():
    rng, n = np.random.default_rng(0), len(ANGLES)
    for ranges in (
        np.full(n, 2.0),
        rng.uniform(0.1, 10, n),
        10.0 ** rng.uniform(-6, 6, n),
        np.where(np.arange(n) % 2, 1e-6, 1e6),
        np.abs(2 + np.cumsum(rng.normal(0, 0.05, n))),
    ):
        for parts in (1, 4, n // 4):
            assert 0.0 <= unevenness(ranges, parts) <= MOST_UNEVEN**2
