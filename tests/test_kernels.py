"""Each kernel equals its slow twin: on real, random and degenerate scans, and by hand."""

from __future__ import annotations

import math

import naive
import numpy as np
import pytest
from equality import assert_same_filtered
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds import BOX, degenerate_scans, fan, full_circle, random_scan, room, scan_of, wall

from lineament import LaserScan, RangeNoise
from lineament.methods import stages

DEGENERATE = degenerate_scans()
seeds = st.integers(0, 2**32 - 1)
READINGS = ("tangent", "product", "relative")


# Filter


def assert_same_filter(scan, **parameters):
    found = stages.bilateral_filter(scan, **parameters)
    expected = naive.bilateral(scan, **parameters)
    assert_same_filtered(found, expected, **parameters)
    assert (np.isnan(found) == ~scan.valid).all()


@pytest.mark.parametrize("name", DEGENERATE)
def test_filter_of_degenerate_scans(name):
    assert_same_filter(DEGENERATE[name])
    assert_same_filter(DEGENERATE[name], half_width=2, sigma_d=1.0)


@settings(max_examples=15)
@given(seeds, st.floats(0.3, 20), st.floats(0.01, 2), st.integers(0, 20))
def test_filter_of_random_scans(seed, sigma_d, sigma_r, half_width):
    scan = random_scan(seed, 90)
    assert_same_filter(scan, sigma_d=sigma_d, sigma_r=sigma_r, half_width=half_width)


def test_filter_by_hand():
    scan = LaserScan([2.0, 2.3, np.nan, 2.0], 0.0, 0.01)
    # Neighbours of the first within 1 beam: itself (1) and the second (e^-1/2 e^-1/2).
    w = math.exp(-1 / 2) * math.exp(-0.5)
    expected = [(2 + 2.3 * w) / (1 + w), (2.3 + 2 * w) / (1 + w), np.nan, 2.0]
    found = stages.bilateral_filter(scan, sigma_d=1.0, sigma_r=0.3, half_width=1)
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    assert stages.bilateral_filter(scan, half_width=0).tolist()[:2] == [2.0, 2.3]


def test_filter_goes_over_the_seam_of_a_full_circle_only():
    ranges = np.full(360, 2.0)
    ranges[-1] = 2.2
    open_scan = LaserScan(ranges, 0.0, 0.01)
    ring = LaserScan(ranges, 0.0, 2 * math.pi / 360)
    assert stages.bilateral_filter(open_scan)[0] == pytest.approx(2.0, abs=1e-9)
    assert stages.bilateral_filter(ring)[0] > 2.01
    np.testing.assert_allclose(*stages.bilateral_filter(ring)[[0, -2]], rtol=1e-7)


# Noise


@pytest.mark.parametrize("name", DEGENERATE)
def test_noise_of_degenerate_scans(name):
    assert_same_noise(DEGENERATE[name])


@settings(max_examples=40)
@given(seeds)
def test_noise_of_random_scans(seed):
    assert_same_noise(random_scan(seed))


def assert_same_noise(scan):
    found, expected = stages.estimate_noise(scan), naive.sigma(scan)
    assert (found is None) == (expected is None) == (not scan.valid.any())
    if found is not None:
        assert found.sigma == pytest.approx(expected, rel=1e-12)
        assert found == RangeNoise(sigma=found.sigma)


@pytest.mark.parametrize("sigma", [0.003, 0.01, 0.05])
def test_noise_is_estimated_in_spite_of_structure(sigma):
    angles = full_circle(1800)
    ranges = room(angles, BOX)
    ranges[200:300] += 1.5
    ranges += sigma * np.random.default_rng(2).normal(size=len(angles))
    assert stages.estimate_noise(scan_of(ranges, angles)).sigma == pytest.approx(sigma, rel=0.12)


def test_noise_of_a_lattice_is_that_of_rounding():
    ranges = np.tile([2.0] * 7 + [2.1] * 8, 20)
    scan = LaserScan(ranges, 0.0, 0.001)
    assert stages.estimate_noise(scan).sigma == pytest.approx(0.1 / math.sqrt(12))


# Clusters


def assert_same_clusters(scan, **changes):
    parameters = {"spacing_scale": 6.0, "noise_floor": 3.0, "density_k": 3.0, "min_points": 3}
    parameters |= changes
    sigma = naive.sigma(scan)
    twin = naive.clusters(
        scan,
        np.where(naive.valid(scan), scan.ranges, np.nan),
        math.nan if sigma is None else sigma,
        scale=parameters["spacing_scale"],
        floor=parameters["noise_floor"],
        density_k=parameters["density_k"],
        min_points=parameters["min_points"],
    )
    found = stages.adaptive_clusters(scan, **parameters)
    assert found.tolist() == twin.labels(len(scan)).tolist()
    assert found.dtype == np.int32


@pytest.mark.parametrize("name", DEGENERATE)
def test_clusters_of_degenerate_scans(name):
    assert_same_clusters(DEGENERATE[name])
    assert_same_clusters(DEGENERATE[name], min_points=1, noise_floor=0.0)


@settings(max_examples=40)
@given(seeds, st.floats(1, 10), st.floats(0, 5), st.floats(0, 6), st.integers(1, 9))
def test_clusters_of_random_scans(seed, scale, floor, k, least):
    changes = {"spacing_scale": scale, "noise_floor": floor, "density_k": k, "min_points": least}
    assert_same_clusters(random_scan(seed), **changes)


def test_distance_threshold_by_hand():
    # 0.02 between equal ranges of 2; T_d = 3 · 2.05 · 0.01 = 0.0615 for a step of 0.05 in range.
    def labels(step, scale):
        ranges = [2.0, 2.0, 2.0, 2.0 + step, 2.0 + step, 2.0 + step]
        scan = LaserScan(ranges, 0.0, 0.01)
        found = stages.adaptive_clusters(
            scan, spacing_scale=scale, noise_floor=0.0, density_k=0.0, noise=RangeNoise()
        )
        return found.tolist()

    # The spacing over the step: by the law of cosines.
    d = math.sqrt(2**2 + 2.05**2 - 2 * 2 * 2.05 * math.cos(0.01))
    scale = d / (2.05 * 0.01)
    assert labels(0.05, scale * (1 + 1e-9)) == [0] * 6
    assert labels(0.05, scale * (1 - 1e-9)) == [0, 0, 0, 1, 1, 1]


def test_noise_floor_by_hand():
    scan = LaserScan([2.0] * 3 + [2.1] * 3, 0.0, 0.001)
    d = math.sqrt(2**2 + 2.1**2 - 2 * 2 * 2.1 * math.cos(0.001))
    border = (d - 6 * 2.1 * 0.001) / (3 * math.sqrt(2))  # T_d = λρΔφ + 3 √2 σ
    for factor, expected in ((1 + 1e-9, 0), (1 - 1e-9, 1)):
        noise = RangeNoise(sigma=border * factor)
        assert stages.adaptive_clusters(scan, noise=noise)[-1] == expected


def test_density_threshold_by_hand():
    # Spacings 0.1, 0.1, 0.4 along a beam's direction nearly: μ = 0.2, σ = 0.1414; T_d is tiny.
    angles = 1e-9 * np.arange(6)
    ranges = np.cumsum([1.0, 0.1, 0.1, 0.4, 0.0, 0.0])
    for last, k, joined in ((0.5, 2.2, True), (0.5, 2.1, False)):
        ranges[4] = ranges[3] + last
        ranges[5] = ranges[4] + 1e-10
        scan = LaserScan(ranges, angles=angles)
        noise = RangeNoise(sigma=0.4 / (3 * math.sqrt(2)) * (1 + 1e-6))
        found = stages.adaptive_clusters(scan, noise=noise, density_k=k, min_points=2)
        assert found.tolist() == ([0] * 6 if joined else [0] * 4 + [1, 1])


def test_density_is_skipped_below_three_spacings():
    angles = 1e-9 * np.arange(6)
    ranges = np.cumsum([1.0, 0.1, 0.1, 0.11, 1e-10, 1e-10])
    noise = RangeNoise(sigma=0.105 / (3 * math.sqrt(2)))
    scan = LaserScan(ranges, angles=angles)
    found = stages.adaptive_clusters(scan, noise=noise, density_k=100.0)
    assert found.tolist() == [0, 0, 0, 1, 1, 1]


def test_class_of_two_is_noise_and_numbers_have_no_holes():
    ranges = [2.0] * 3 + [3.0] * 2 + [2.0] * 3
    found = stages.adaptive_clusters(LaserScan(ranges, 0.0, 0.01), noise=RangeNoise(sigma=0.001))
    assert found.tolist() == [0, 0, 0, -1, -1, 1, 1, 1]


def test_classes_merge_over_the_seam_of_a_full_circle_only():
    ranges = np.full(90, 2.0)
    ranges[30:60] = 5.0
    noise = RangeNoise(sigma=0.001)
    ring = stages.adaptive_clusters(LaserScan(ranges, 0.0, 2 * math.pi / 90), noise=noise)
    assert ring.tolist() == [0] * 30 + [1] * 30 + [0] * 30
    part = stages.adaptive_clusters(LaserScan(ranges, 0.0, 6.0 / 90), noise=noise)
    assert part.tolist() == [0] * 30 + [1] * 30 + [2] * 30


def test_ring_counts_its_first_point_once():
    for n, expected in ((4, -1), (5, 0)):
        scan = LaserScan(np.full(n, 2.0), 0.0, 2 * math.pi / n)
        found = stages.adaptive_clusters(scan, min_points=5)
        assert set(found.tolist()) == {expected}


def test_one_missing_beam_does_not_end_a_class():
    angles = fan()
    ranges = wall(angles, 2.0, 20.0)
    ranges[50] = np.nan
    found = stages.adaptive_clusters(scan_of(ranges, angles), noise=RangeNoise(sigma=0.01))
    assert found[50] == -1
    assert (np.delete(found, 50) == 0).all()


# The corner operator


def class_of(seed):
    rng = np.random.default_rng(seed)
    m = int(rng.integers(0, 60))
    if rng.random() < 0.5:
        return np.cumsum(rng.normal(size=(m, 2)), axis=0)
    turns = np.cumsum(rng.choice([0, 0, 0, 1.2], m) * rng.normal(size=m))
    path = np.cumsum(0.02 * np.column_stack((np.cos(turns), np.sin(turns))), axis=0)
    return path + [2, 1] + 1e-4 * rng.normal(size=(m, 2))  # No two at one distance of a chord.


@settings(max_examples=30)
@given(seeds, st.integers(1, 9), st.sampled_from(READINGS))
def test_response_of_random_classes(seed, radius, reading):
    points = class_of(seed)
    found = stages.corner_response(points, support_radius=radius, response=reading)
    expected = [naive.response(points, i, radius, reading) for i in range(len(points))]
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-10)
    if reading == "relative":
        assert ((found >= 0) & (found <= 1 + 1e-12)).all()


@settings(max_examples=30)
@given(seeds, st.sampled_from(READINGS), st.integers(2, 6), st.floats(0.05, 0.5))
def test_primary_corners_of_random_classes(seed, reading, least, threshold):
    points = class_of(seed)
    found = stages.primary_corners(
        points, support_radius=4, threshold=threshold, response=reading, min_points=least
    )
    own = {"radius": 4, "threshold": threshold, "reading": reading, "min_points": least}
    expected = naive.primary_corners(points, False, **own) if len(points) else []
    assert found["beam"].tolist() == [i for i, _, _ in expected]
    for name, k in (("chord_distance", 1), ("response", 2)):
        np.testing.assert_allclose(found[name], [e[k] for e in expected], rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize(
    "points",
    [[], [(1, 1)], [(1, 1)] * 2, [(1, 1)] * 9, [(1, 0), (2, 0), (1, 0)], [(1, 0), (1, 0), (2, 0)]],
)
@pytest.mark.parametrize("reading", READINGS)
def test_response_of_degenerate_classes(points, reading):
    found = stages.corner_response(points, response=reading)
    assert len(found) == len(points)
    expected = [naive.response(np.array(points), i, 6, reading) for i in range(len(points))]
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert len(stages.primary_corners(points, response=reading)) <= len(points)
