"""The noise that method optimal estimates from a scan."""

from __future__ import annotations

import math

import numpy as np
import pytest
from worlds import BOX, fan, full_circle, room, scan_of, wall

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
        assert math.sqrt(features.noise.range_variance(distance)) == pytest.approx(
            expected, rel=0.35
        )
        assert len(features.segments) == 1


def test_noise_that_is_given_is_used():
    noise = RangeNoise(0.02, 0.001, 0.0005, 0.001)
    angles = fan(30)
    features = Extractor("optimal", noise=noise)(
        scan_of(noisy(wall(angles, 2.0, 0.0), 0.02), angles)
    )
    assert features.noise == noise
    assert UNAWARE(LaserScan(np.full(9, np.nan), 0.0, 0.1)).noise is None


@pytest.mark.parametrize("digits", [np.float64, np.float32])
@pytest.mark.parametrize("quantum", [0.001, 0.01, 0.05])
def test_the_lattice_of_the_ranges_is_found(quantum, digits):
    ring = full_circle(720)
    for seed in range(5):
        ranges = noisy(room(ring, BOX), 0.6 * quantum, seed)
        rounded = (np.round(ranges / quantum) * quantum).astype(digits).astype(float)
        noise = UNAWARE(scan_of(rounded, ring)).noise
        assert noise.quantum == pytest.approx(quantum, rel=1e-3)
        assert noise.sigma == pytest.approx(0.6 * quantum, rel=0.25)


@pytest.mark.parametrize("sigma", [0.0, 1e-3, 0.01])
def test_without_a_lattice_none_is_found(sigma):
    ring = full_circle(720)
    for seed in range(5):
        assert UNAWARE(scan_of(noisy(room(ring, BOX), sigma, seed), ring)).noise.quantum == 0.0


def test_ranges_that_hardly_change_or_jump_tell_no_lattice():
    rng, n = np.random.default_rng(0), 200
    few = np.full(n, 2.0)
    few[100:] += 0.01
    hostile = np.full(n, 2.0)
    hostile[::3] = rng.choice([np.nan, np.inf, 0.0, -1.0, -0.99, 60.0], len(hostile[::3]))
    for ranges in (
        np.full(n, 2.0),
        few,
        hostile,
        np.where(np.arange(n) % 2, 1.0, 4.0),
        rng.uniform(1, 9, n),
        rng.integers(1, 9, n).astype(float),
    ):
        found = UNAWARE(LaserScan(ranges, 0.0, 0.01, range_max=30.0)).noise
        assert found.quantum == 0.0
        assert found.sigma > 0.0


def test_lines_through_clutter_are_no_noise():
    """A room at 1 cm, and a heap of 200 beams in it, whose readings are 5 cm off any line."""
    ring, heap = full_circle(720), slice(250, 450)
    true = room(ring, BOX)
    found = []
    for seed in range(10):
        ranges = noisy(true, 0.01, seed)
        ranges[heap] = noisy(true[heap], 0.05, seed + 100)
        noise = UNAWARE(scan_of(ranges, ring)).noise
        found.append(math.sqrt(noise.range_variance(2.0)))
    assert np.mean(found) == pytest.approx(0.01, rel=0.1)


def test_an_oblique_wall_is_not_taken_for_noise():
    """At 80° the range bends so much from beam to beam that second differences are no noise."""
    angles = fan(80, math.radians(1.0))
    found = []
    for seed in range(20):
        # Seen to where the beams meet it at 2°.
        ranges = noisy(wall(angles, 1.0, -80.0), 0.01, seed)
        ranges[ranges > 30.0] = np.inf
        found.append(UNAWARE(scan_of(ranges, angles)).noise)
    at_three = [math.sqrt(noise.range_variance(3.0)) for noise in found]
    assert np.mean(at_three) == pytest.approx(0.01, rel=0.15)
