"""Line fits equal their slow twins, in any direction, and so do their covariances."""

from __future__ import annotations

import math

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive_fit import fit_line, jacobian_covariance
from worlds import STEP, fan, wall

from lineament import RangeNoise
from lineament.methods import stages

seeds = st.integers(0, 2**32 - 1)


def seen_wall(seed, sigma):
    rng = np.random.default_rng(seed)
    normal = rng.uniform(-180, 180)
    angles = math.radians(normal) + rng.uniform(-1.1, 0.3) + STEP * np.arange(rng.integers(3, 120))
    rho = wall(angles, rng.uniform(0.5, 6), normal) + sigma * rng.normal(size=len(angles))
    noise = RangeNoise(*(rng.uniform(0, 1, 4) * [0.02, 0.005, 0.004, 0.02]))
    return angles, rho, noise, (noise.sigma, noise.proportional, noise.bearing, noise.quantum)


FITS = ("total", "y_of_x", "weighted")


@pytest.mark.parametrize("fit", FITS)
@settings(max_examples=25)
@given(seeds)
def test_fits_equal_their_twins(fit, seed):
    angles, rho, noise, row = seen_wall(seed, 0.01)
    points = naive.polar(rho, angles)
    found = stages.fit_line(points, noise=noise, fit=fit)
    expected = fit_line(points, angles, rho, row, fit)
    for name in ("start", "end", "centroid", "n_points"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-9)
    assert math.remainder(found["angle"] - expected["angle"], 2 * math.pi) == pytest.approx(
        0, abs=1e-9
    )
    assert found["rms"] == pytest.approx(expected["rms"], rel=1e-7, abs=1e-12)
    np.testing.assert_allclose(found["covariance"], expected["covariance"], rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("fit", FITS)
@pytest.mark.parametrize("seed", range(6))
def test_covariance_is_that_of_moved_readings(fit, seed):
    angles, rho, noise, row = seen_wall(seed, 1e-5)
    found = stages.fit_line(naive.polar(rho, angles), noise=noise, fit=fit)["covariance"]
    expected = jacobian_covariance(angles, rho, row, fit)
    scale = np.sqrt(np.outer(*[np.diag(expected)] * 2))
    np.testing.assert_allclose(found / scale, expected / scale, atol=2e-3)


@pytest.mark.parametrize("fit", FITS)
@pytest.mark.parametrize("normal", [0, 45, 90, 135, 180, 270])
def test_walls_of_any_direction_fit_exactly(fit, normal):
    angles = math.radians(normal) + fan(30)
    line = stages.fit_line(naive.polar(wall(angles, 2.0, normal), angles), fit=fit)
    across = np.array([math.cos(math.radians(normal)), math.sin(math.radians(normal))])
    for name in ("start", "end", "centroid"):
        assert line[name] @ across == pytest.approx(2.0, abs=1e-12)
    turn = line["angle"] - math.radians(normal) - math.pi / 2
    assert math.remainder(turn, 2 * math.pi) == pytest.approx(0, abs=1e-12)
    assert line["rms"] < 1e-12
