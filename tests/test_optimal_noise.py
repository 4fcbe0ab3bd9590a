"""The noise that method optimal estimates from a scan."""

from __future__ import annotations

import math

import numpy as np
import pytest
from worlds import fan, full_circle, room, scan_of, wall

from lineament import Extractor, LaserScan, RangeNoise

UNAWARE = Extractor("optimal")


def noisy(ranges, sigma, seed=0):
    return ranges + sigma * np.random.default_rng(seed).normal(size=len(ranges))


NOISES = [(0.002, 0.0), (0.01, 0.0), (0.05, 0.0), (0.0, 0.01), (0.002, 0.007), (0.01, 0.01)]


@pytest.mark.parametrize(("sigma", "proportional"), NOISES)
def test_noise_is_estimated_with_its_growth(sigma, proportional):
    """From a room of 24 m, seen from near a corner: ranges of 1 m to 23 m."""
    ring = full_circle(1440)
    true = room(ring, [(20.0, 0.0), (12.0, 90.0), (1.0, 180.0), (1.0, 270.0)])
    deviation = np.hypot(sigma, proportional * true)
    found = []
    for seed in range(5):
        ranges = true + deviation * np.random.default_rng(seed).normal(size=len(ring))
        noise = UNAWARE(scan_of(ranges, ring)).noise
        found.append(
            [math.hypot(noise.sigma, noise.proportional * rho) for rho in (1.5, 5.0, 15.0)]
        )
    expected = [math.hypot(sigma, proportional * rho) for rho in (1.5, 5.0, 15.0)]
    np.testing.assert_allclose(np.mean(found, axis=0), expected, rtol=0.2, atol=1e-3)


@pytest.mark.parametrize("sigma", [0.0, 0.001, 0.003])
def test_noise_of_ranges_on_a_lattice_is_that_of_the_rounding(sigma):
    """Half of the second differences are zero where the readings hardly differ."""
    angles = fan(45)
    for distance in (1.5, 3.0):
        true = wall(angles, distance, 10.0)
        ranges = np.round(noisy(true, sigma), 2)
        features = UNAWARE(scan_of(ranges, angles))
        expected = math.hypot(sigma, 0.01 / math.sqrt(12))
        assert features.noise.sigma == pytest.approx(expected, rel=0.35)
        assert len(features.segments) == 1


def test_noise_that_is_given_is_used():
    noise = RangeNoise(0.02, 0.001, 0.0005, 0.001)
    angles = fan(30)
    features = Extractor("optimal", noise=noise)(
        scan_of(noisy(wall(angles, 2.0, 0.0), 0.02), angles)
    )
    assert features.noise == noise
    assert UNAWARE(LaserScan(np.full(9, np.nan), 0.0, 0.1)).noise is None
