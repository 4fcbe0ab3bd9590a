"""Method optimal knows how noisy a scan is, and how much of it grows with range."""

from __future__ import annotations

import math

import numpy as np
import pytest
from test_optimal_scenes import UNAWARE, noisy
from worlds import BOX, fan, full_circle, room, scan_of, wall

from lineament import Extractor, RangeNoise


@pytest.mark.parametrize("sigma", [0.001, 0.01, 0.03])
def test_noise_is_estimated_whatever_else_is_there(sigma):
    """Corners, and clutter among 3 % of the measurements."""
    angles, found = full_circle(), []
    for seed in range(20):
        ranges, rng = noisy(room(angles, BOX), seed, sigma), np.random.default_rng(seed + 99)
        ranges[rng.random(len(ranges)) < 0.03] *= 0.7
        found.append(UNAWARE(scan_of(ranges, angles)).noise.sigma)
    assert np.mean(found) == pytest.approx(sigma, rel=0.03)
    assert np.std(found) < 0.06 * sigma


#: Walls whose ranges differ, and what is off them in proportion to range.
LONG, PROPORTIONAL = [(1.0, 0.0), (3.0, 90.0), (6.0, 180.0), (3.0, 270.0)], 0.01


def test_noise_that_grows_with_range_is_told():
    angles, found = full_circle(), []
    for seed in range(20):
        ranges = room(angles, LONG)
        noise = UNAWARE(scan_of(ranges * noisy(1.0 + 0.0 * ranges, seed), angles)).noise
        found.append(math.hypot(noise.sigma, 3.0 * noise.proportional))
        assert 0.008 < noise.proportional < 0.0105
    assert np.mean(found) == pytest.approx(3.0 * PROPORTIONAL, rel=0.1)


def test_a_room_in_noise_that_grows_with_range_is_closed_too():
    """Its seam is no border of a wall."""
    angles = full_circle()
    for seed in range(20):
        ranges = room(angles, LONG)
        features = UNAWARE(scan_of(ranges * noisy(1.0 + 0.0 * ranges, seed), angles))
        assert len(features.segments) == len(features.corners) == 4, seed


def test_noise_is_no_more_than_a_sensor_has():
    ranges = np.random.default_rng(1).uniform(1.0, 9.0, 500)
    noise = UNAWARE(scan_of(ranges, full_circle(500))).noise
    assert math.hypot(noise.sigma, noise.proportional * ranges.max()) <= 0.1 + 1e-9


def test_a_given_noise_is_that_of_the_covariances():
    angles = fan(20)
    scan = scan_of(noisy(wall(angles, 2.0, 0.0), sigma=0.001), angles)
    one, two = (
        Extractor("optimal", noise=RangeNoise(sigma=s))(scan).segments for s in (0.01, 0.02)
    )
    np.testing.assert_allclose(two["covariance"], 4 * one["covariance"], rtol=1e-6)
