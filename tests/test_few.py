"""Noise of few measurements: weighed against what scanners have, and covariances that hold."""

import math
from itertools import product

import numpy as np
import pytest
from lineament_lab.evaluation import NormalisedErrors
from worlds import errors_of_lines, fan, scan_of, wall

import lineament as ln
from lineament import Extractor, LaserScan, RangeNoise
from lineament.methods.stages import estimate_noise

#: Root of the mean variance of scanners [m], and variance of its logarithm.
TYPICAL, SPREAD = 0.012, 4.5


def test_noise_that_nothing_is_known_of_is_that_of_scanners():
    """Every second beam has no range."""
    ranges = np.full(7, math.nan)
    ranges[::2] = 2.0
    for method in ("optimal", "liu", "iepf"):
        noise = ln.extract(ranges, angle_min=0.0, angle_increment=0.1, method=method).noise
        assert noise.sigma == pytest.approx(TYPICAL)
        assert noise.uncertainty == pytest.approx(math.sqrt(SPREAD) / 2)


@pytest.mark.parametrize("off", [1e-4, 0.003, 0.01, 0.03, 0.1])
def test_noise_of_one_triple_is_the_mean_of_its_posterior(off):
    """By the integral over the variance: prior, times χ² of 1/1.94 degrees of freedom."""
    scan = LaserScan(2.0 / np.cos([-0.01, 0.0, 0.01]) + [0.0, off, 0.0], -0.01, 0.01)
    square, degrees = 1.03 * (off * (1 + off / 2)) ** 2 / 1.5, 1 / 1.94
    log = np.linspace(-60.0, 20.0, 100_001)
    centre = math.log(TYPICAL**2) - SPREAD / 2
    density = -((log - centre) ** 2) / (2 * SPREAD) - degrees / 2 * (log + square * np.exp(-log))
    density = np.exp(density - density.max())
    mean = (density * np.exp(log)).sum() / density.sum()
    assert estimate_noise(scan).sigma == pytest.approx(math.sqrt(mean), rel=0.03)


@pytest.mark.parametrize("sigma", [0.001, 0.003, 0.01, 0.03])
def test_noise_of_many_is_what_they_say(sigma):
    """Off by less than half of the estimate's standard error, which it reports."""
    ranges = np.random.default_rng(3).normal(wall(fan(40), 2.0, 0.0), sigma)
    scan = scan_of(ranges, fan(40))
    noise = estimate_noise(scan)
    error = np.diff(ranges - wall(fan(40), 2.0, 0.0), 2)
    root = math.sqrt((error**2).mean() / 6)
    assert noise.sigma == pytest.approx(root, rel=0.5 * noise.uncertainty)
    assert noise.uncertainty == pytest.approx(math.sqrt(1.94 / 2 / len(error)), rel=0.1)


def test_noise_of_sixty_trunks_is_not_that_of_the_best_scanner():
    """Few are seen by three beams: up to 23 threes were 0.1 mm, more are what trunks are round."""
    rng, angles = np.random.default_rng(8), np.linspace(-math.pi / 2, math.pi / 2, 181)
    for nearest in [2.0] * 10 + [10.0] * 10:
        ranges, fars = np.full(181, math.inf), rng.uniform(nearest, 25.0, 60)
        for bearing, far in zip(rng.uniform(-1.5, 1.5, 60), fars, strict=True):
            square = 0.15**2 - (far * np.sin(angles - bearing)) ** 2
            near = far * np.cos(angles - bearing) - np.sqrt(np.maximum(square, 0.0))
            ranges = np.where((square > 0) & (near > 0), np.minimum(ranges, near), ranges)
        noise = ln.extract(scan_of(ranges + rng.normal(0, 0.01, 181), angles)).noise
        assert noise.range_variance(float(np.median(ranges[ranges < 99]))) > 0.007**2


@pytest.mark.parametrize("name", ["optimal", "iepf", "liu:scale_free"])
@pytest.mark.parametrize("n", [4, 6, 8, 12, 16, 23, 24, 40, 80, 200])
def test_covariance_of_a_lone_wall_is_that_of_its_errors(name, n):
    """Of any number of measurements: up to 22 it was ten thousand times too small."""
    rng, angles = np.random.default_rng((4, n)), (np.arange(n) - (n - 1) / 2) * 0.006
    far = 5.0 / np.cos(angles)
    batch = Extractor(name).batch(rng.normal(far, 0.01, (400, n)), angles=angles)
    lines = np.concatenate([f.segments for f in batch if len(f.segments) == 1])
    assert len(lines) > 350
    errors = errors_of_lines(lines, 5.0, 0.0)
    assert 0.7 < NormalisedErrors.of(errors, lines["covariance"]).mean_ratio < 1.4


@pytest.mark.parametrize("noise", [None, 0.01], ids=["estimated", "given"])
@pytest.mark.parametrize("name", ["optimal", "iepf", "ransac"])
@pytest.mark.parametrize(("n", "incidence"), [(4, 0), (5, 0), (4, 60), (5, 60), (8, 0)])
def test_covariance_of_a_wall_as_short_as_its_errors(name, n, incidence, noise):
    """Four beams at 2 m are 3.5 cm, with errors of 1 cm: not linear in these, up to 2.2 to 4.5."""
    rng, angles = np.random.default_rng((5, n)), (np.arange(n) - (n - 1) / 2) * math.radians(1 / 3)
    distance = 2.0 * math.cos(math.radians(incidence))
    far = wall(angles, distance, incidence)
    batch = Extractor(name, noise=noise).batch(rng.normal(far, 0.01, (1500, n)), angles=angles)
    lines = batch.segments
    assert len(lines) > 1400
    errors = errors_of_lines(lines, distance, incidence)
    assert 0.7 < NormalisedErrors.of(errors, lines["covariance"]).mean_ratio < 1.4


def test_short_walls_do_not_turn_to_their_beams():
    """As orthogonal distances do, which are less then. The slope across the beams is unbiased."""
    n, rng = 5, np.random.default_rng(6)
    angles = (np.arange(n) - (n - 1) / 2) * math.radians(1 / 3)
    far, sigma = wall(angles, math.sqrt(2.0), 45.0), 0.005
    for name in ("optimal", "iepf"):
        batch = Extractor(name, noise=sigma).batch(rng.normal(far, sigma, (4000, n)), angles=angles)
        slopes = np.tan(batch.segments["angle"] - math.pi / 2)
        mean, error = slopes.mean(), slopes.std() / math.sqrt(len(slopes))
        assert len(slopes) > 3900
        assert mean == pytest.approx(1.0, abs=4 * error)


@pytest.mark.parametrize(
    ("name", "n"),
    [
        # A measurement next to it may be of either wall: of ten a wall the NEES was 1.4 to 1.5.
        *product(["optimal"], [9, 10, 12]),
        # With borders of lines that wrong borders gave, it was up to 2.5 and 2.2 of 8 and 10.
        *product(["iepf", "line_tracking", "hough", "ransac", "region_growing"], [8, 10, 16]),
        *product(["split_and_merge"], [16, 32]),
    ],
)
def test_covariance_of_a_corner_whose_border_may_lie_elsewhere(name, n):
    rng = np.random.default_rng((7 if name == "optimal" else 8, n))
    angles = (np.arange(2 * n) - (2 * n - 1) / 2) * math.radians(1 / 3)
    far = 2.0 / (np.cos(angles) + abs(np.sin(angles)))
    batch = Extractor(name, noise=0.01).batch(rng.normal(far, 0.01, (2000, 2 * n)), angles=angles)
    corners = batch.corners
    assert len(corners) > (1400 if name == "optimal" else 800)
    errors = corners["position"] - (2.0, 0.0)
    assert 0.8 < NormalisedErrors.of(errors, corners["covariance"]).mean_ratio < 1.3


def test_noise_that_is_given_is_used_as_it_is():
    """With the uncertainty that it has, which changes nothing."""
    scan = scan_of(np.random.default_rng(1).normal(wall(fan(3), 2.0, 0.0), 0.01), fan(3))
    known, vague = (Extractor(noise=RangeNoise(0.01, uncertainty=u))(scan) for u in (0.0, 0.5))
    assert known.noise.uncertainty == 0.0
    assert vague.noise.uncertainty == 0.5
    np.testing.assert_array_equal(known.segments, vague.segments)
    batch = Extractor(noise=vague.noise).batch(scan.ranges[None], angles=scan.angles)
    assert batch[0].noise == vague.noise
