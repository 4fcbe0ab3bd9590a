"""Each stage equals its slow twin: on random and degenerate scans, and by hand; what it refuses."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from liu_2023 import Paper, corner_response, polar
from naive_fit import fit_line, jacobian_covariance, second_order
from worlds import (
    BOX,
    NOISE,
    STEP,
    degenerate_scans,
    full_circle,
    random_scan,
    room,
    scan_of,
    wall,
)

from lineament import Extractor, LaserScan, RangeNoise
from lineament.methods import stages

DEGENERATE = degenerate_scans()
seeds = st.integers(0, 2**32 - 1)
RESPONSES = ("tangent", "product", "relative")
FITS = ("total", "y_of_x", "weighted")
SCAN = LaserScan([2.0] * 9, 0.0, 0.01)
POINTS = [(2.0, 0.1 * i) for i in range(9)]
NAN, INF = math.nan, math.inf
clusters = stages.adaptive_clusters


# Filter


def test_filter_by_hand():
    scan = LaserScan([2.0, 2.3, NAN, 2.0], 0.0, 0.01)
    # Neighbours of the first within 1 beam: itself (1) and the second (e^-1/2 e^-1/2).
    w = math.exp(-1 / 2) * math.exp(-0.5)
    expected = [(2 + 2.3 * w) / (1 + w), (2.3 + 2 * w) / (1 + w), NAN, 2.0]
    found = stages.bilateral_filter(scan, sigma_d=1.0, sigma_r=0.3, half_width=1)
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    assert stages.bilateral_filter(scan, half_width=0).tolist()[:2] == [2.0, 2.3]


# Noise


@pytest.mark.parametrize("sigma", [0.003, 0.01, 0.05])
def test_noise_is_estimated_in_spite_of_structure(sigma):
    angles = full_circle(1800)
    ranges = room(angles, BOX) + sigma * np.random.default_rng(2).normal(size=len(angles))
    ranges[200:300] += 1.5
    assert stages.estimate_noise(scan_of(ranges, angles)).sigma == pytest.approx(sigma, rel=0.12)


def test_noise_of_a_lattice_is_that_of_rounding():
    scan = LaserScan(np.tile([2.0] * 7 + [2.1] * 8, 20), 0.0, 0.001)
    assert stages.estimate_noise(scan).sigma == pytest.approx(0.1 / math.sqrt(12))


# Clusters


@pytest.mark.parametrize(("factor", "joined"), [(1 + 1e-9, True), (1 - 1e-9, False)])
def test_distance_threshold_and_noise_floor_by_hand(factor, joined):
    # T_d = λ ρ Δφ + 3 √2 σ; the spacing over a step in range by the law of cosines.
    expected = [0] * 6 if joined else [0] * 3 + [1] * 3
    d = math.sqrt(2**2 + 2.05**2 - 2 * 2 * 2.05 * math.cos(0.01))
    scan = LaserScan([2.0] * 3 + [2.05] * 3, 0.0, 0.01)
    plain = {"noise_floor": 0.0, "density_k": 0.0, "noise": RangeNoise()}
    found = clusters(scan, spacing_scale=d / (2.05 * 0.01) * factor, **plain)
    assert found.tolist() == expected
    d = math.sqrt(2**2 + 2.1**2 - 2 * 2 * 2.1 * math.cos(0.001))
    noise = RangeNoise(sigma=(d - 6 * 2.1 * 0.001) / (3 * math.sqrt(2)) * factor)
    scan = LaserScan([2.0] * 3 + [2.1] * 3, 0.0, 0.001)
    assert clusters(scan, noise=noise).tolist() == expected


@pytest.mark.parametrize(
    ("steps", "floor", "k", "expected"),
    [
        # Spacings 0.1, 0.1, 0.4 along a beam's direction nearly: μ = 0.2, σ = 0.1414; T_d is tiny.
        ([0.1, 0.1, 0.4, 0.5, 1e-10], 0.4 * (1 + 1e-6), 2.2, [0] * 6),
        ([0.1, 0.1, 0.4, 0.5, 1e-10], 0.4 * (1 + 1e-6), 2.1, [0] * 4 + [1, 1]),
        # Two spacings are too few to know their density.
        ([0.1, 0.1, 0.11, 1e-10, 1e-10], 0.105, 100.0, [0, 0, 0, 1, 1, 1]),
    ],
)
def test_density_threshold_by_hand(steps, floor, k, expected):
    scan = LaserScan(np.cumsum([1.0, *steps]), angles=1e-9 * np.arange(6))
    noise = RangeNoise(sigma=floor / (3 * math.sqrt(2)))
    assert clusters(scan, noise=noise, density_k=k, min_points=2).tolist() == expected


def test_cluster_of_two_is_noise_and_numbers_have_no_holes():
    scan = LaserScan([2.0] * 3 + [3.0] * 2 + [2.0] * 3, 0.0, 0.01)
    found = clusters(scan, noise=RangeNoise(sigma=0.001))
    assert found.tolist() == [0, 0, 0, -1, -1, 1, 1, 1]


@pytest.mark.parametrize(("n", "label"), [(4, -1), (5, 0)])
def test_ring_counts_its_first_point_once(n, label):
    scan = LaserScan(np.full(n, 2.0), 0.0, 2 * math.pi / n)
    assert set(clusters(scan, min_points=5).tolist()) == {label}


def test_clusters_of_other_ranges_leave_invalid_beams_out():
    scan = LaserScan([2.0, NAN, 2.0, 2.0, 2.0], 0.0, 0.01)
    assert clusters(scan, [9.0, 2.0, 2.0, 2.0, 2.0], noise=NOISE).tolist() == [-1, -1, 0, 0, 0]
    assert clusters(scan, noise=NOISE).tolist() == [0, -1, 0, 0, 0]


# The corner operator


def points_of(seed):
    rng = np.random.default_rng(seed)
    m = int(rng.integers(0, 60))
    if rng.random() < 0.5:
        return np.cumsum(rng.normal(size=(m, 2)), axis=0)
    turns = np.cumsum(rng.choice([0, 0, 0, 1.2], m) * rng.normal(size=m))
    path = np.cumsum(0.02 * np.column_stack((np.cos(turns), np.sin(turns))), axis=0)
    return path + [2, 1] + 1e-4 * rng.normal(size=(m, 2))  # No two at one distance of a chord.


@settings(max_examples=30)
@given(seeds, st.integers(1, 9), st.sampled_from(RESPONSES))
def test_response_of_random_clusters(seed, radius, response):
    points = points_of(seed)
    found = stages.corner_response(points, support_radius=radius, response=response)
    paper = Paper(support_radius=radius, response=response)
    expected = [corner_response(points, i, False, paper) for i in range(len(points))]
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-10)
    if response == "relative":
        assert ((found >= 0) & (found <= 1 + 1e-12)).all()


@pytest.mark.parametrize(
    "points",
    [[], [(1, 1)], [(1, 1)] * 2, [(1, 1)] * 9, [(1, 0), (2, 0), (1, 0)], [(1, 0), (1, 0), (2, 0)]],
)
@pytest.mark.parametrize("response", RESPONSES)
def test_response_of_degenerate_clusters(points, response):
    found = stages.corner_response(points, response=response)
    paper, own = Paper(response=response), np.array(points)
    expected = [corner_response(own, i, False, paper) for i in range(len(own))]
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert len(stages.primary_corners(points, response=response)) <= len(points)


# Lines


def seen_wall(seed, sigma):
    rng = np.random.default_rng(seed)
    normal = rng.uniform(-180, 180)
    angles = math.radians(normal) + rng.uniform(-1.1, 0.3) + STEP * np.arange(rng.integers(3, 120))
    rho = wall(angles, rng.uniform(0.5, 6), normal) + sigma * rng.normal(size=len(angles))
    return angles, rho, tuple(rng.uniform(0, 1, 4) * [0.02, 0.005, 0.004, 0.02])


@pytest.mark.parametrize("fit", FITS)
@settings(max_examples=25)
@given(seeds)
def test_fits_equal_their_twins(fit, seed):
    angles, rho, noise = seen_wall(seed, 0.01)
    points = polar(rho, angles)
    found = stages.fit_line(points, noise=RangeNoise(*noise), fit=fit)
    expected = fit_line(points, angles, rho, noise, fit)
    for name in ("start", "end", "centroid", "n_points"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-9)
    turn = math.remainder(found["angle"] - expected["angle"], 2 * math.pi)
    assert turn == pytest.approx(0, abs=1e-9)
    assert found["rms"] == pytest.approx(expected["rms"], rel=1e-7, abs=1e-12)
    np.testing.assert_allclose(found["covariance"], expected["covariance"], rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("fit", FITS)
@pytest.mark.parametrize("seed", range(6))
def test_covariance_is_that_of_moved_measurements(fit, seed):
    angles, rho, noise = seen_wall(seed, 1e-5)
    line = stages.fit_line(polar(rho, angles), noise=RangeNoise(*noise), fit=fit)
    first_order = jacobian_covariance(angles, rho, noise, fit)
    expected = second_order(first_order, line["centroid"], line["angle"])
    scale = np.sqrt(np.outer(*[np.diag(expected)] * 2))
    np.testing.assert_allclose(line["covariance"] / scale, expected / scale, atol=2e-3)


@pytest.mark.parametrize("fit", FITS)
def test_fit_of_coinciding_points_has_no_direction(fit):
    line = stages.fit_line([(1.0, 1.0)] * 3, noise=NOISE, fit=fit)
    assert line["covariance"][1, 1] == pytest.approx(np.pi**2 / 12)
    assert np.isfinite(line["covariance"]).all()
    assert line["centroid"].tolist() == [1.0, 1.0]


# What is refused, and what is not


@pytest.mark.parametrize(
    ("stage", "given", "changes", "message"),
    [
        ("bilateral_filter", SCAN, {"sigma_d": 0}, "sigma_d is 0"),
        ("bilateral_filter", SCAN, {"sigma_r": "1"}, "sigma_r is '1'"),
        ("bilateral_filter", SCAN, {"half_width": 1.5}, r"half_width is 1\.5"),
        ("adaptive_clusters", SCAN, {"spacing_scale": 0.0}, r"spacing_scale is 0\.0"),
        ("adaptive_clusters", SCAN, {"noise_floor": -0.1}, r"noise_floor is -0\.1"),
        ("adaptive_clusters", SCAN, {"density_k": INF}, "density_k is inf"),
        ("adaptive_clusters", SCAN, {"min_points": 0}, "min_points is 0"),
        ("adaptive_clusters", SCAN, {"ranges": [1.0]}, r"ranges has shape \(1,\), expected \(9,\)"),
        ("corner_response", POINTS, {"support_radius": 0}, "support_radius is 0"),
        ("corner_response", POINTS, {"response": "chord"}, "response is 'chord', expected one of"),
        ("primary_corners", POINTS, {"support_radius": 2.0}, r"support_radius is 2\.0"),
        ("primary_corners", POINTS, {"threshold": -1.0}, r"threshold is -1\.0"),
        ("primary_corners", POINTS, {"min_points": 1}, "min_points is 1"),
        ("primary_corners", POINTS, {"response": None}, "response is None"),
        ("fit_line", POINTS, {"fit": "huber"}, "fit is 'huber', expected one of: total, y_of_x"),
        ("fit_line", [], {}, "points has 0 points"),
        ("fit_line", POINTS[:1], {}, "points has 1 points"),
        ("fit_line", [(0.0, 0.0), (1.0, 1.0)], {}, "at the origin"),
        *(
            (stage, points, {}, message)
            for stage in ("corner_response", "primary_corners", "fit_line")
            for points, message in (
                ([1.0, 2.0], r"points has shape \(2,\)"),
                ([(1.0, 2.0, 3.0)], r"points has shape \(1, 3\)"),
                ([(1.0, NAN), (1.0, 2.0)], "not finite"),
                ([(1.0, INF), (1.0, 2.0)], "not finite"),
            )
        ),
    ],
)
def test_refusals_name_parameter_and_value(stage, given, changes, message):
    with pytest.raises(ValueError, match=message):
        getattr(stages, stage)(given, **changes)


def test_given_arrays_stay_as_they_are_and_may_be_empty():
    ranges, points = np.full(9, 2.0), np.array(POINTS)
    clusters(LaserScan([NAN] + [2.0] * 8, 0.0, 0.01), ranges)
    stages.primary_corners(points)
    stages.fit_line(points)
    assert ranges.tolist() == [2.0] * 9
    assert points.tolist() == [list(p) for p in POINTS]
    empty = LaserScan([], 0.0, 0.1)
    assert stages.bilateral_filter(empty).shape == clusters(empty).shape == (0,)


# A run is made of its stages

SCANS = {**DEGENERATE, **{f"random {k}": random_scan(k) for k in range(12)}}
FILTER = {"sigma_d": 3.0, "sigma_r": 0.2, "half_width": 5}
CLUSTERS = {"spacing_scale": 5.0, "noise_floor": 2.0, "density_k": 2.0}
CORNERS = {"support_radius": 5, "threshold": 0.15, "response": "relative", "recursion": "after"}
CORNERS |= {"ends": "excluded"}


@pytest.mark.parametrize("scan", SCANS.values(), ids=SCANS)
@pytest.mark.parametrize("noise", [None, RangeNoise(sigma=0.02)])
def test_trace_is_made_of_the_stages(scan, noise):
    extractor = Extractor("liu", **FILTER, **CLUSTERS, **CORNERS, min_points=4, noise=noise)
    trace, features = extractor.trace(scan), extractor(scan)
    assert (trace.scan, trace.method, trace.threshold) == (scan, "liu", 0.15)
    for name in ("segments", "corners", "breakpoints"):
        assert getattr(trace.features, name).tobytes() == getattr(features, name).tobytes()
    filtered = stages.bilateral_filter(scan, **FILTER)
    assert (np.isnan(filtered) == ~scan.valid).all()
    np.testing.assert_array_equal(trace.filtered, filtered)
    labels = clusters(scan, filtered, **CLUSTERS, min_points=4, noise=noise)
    assert labels.dtype == np.int32
    np.testing.assert_array_equal(trace.clusters, labels)
    np.testing.assert_array_equal(features.clusters, labels)
    assert trace.features.noise == (noise or stages.estimate_noise(scan))
    accepted = trace.candidates[trace.candidates["accepted"]]
    assert (trace.candidates["accepted"] == (trace.candidates["response"] > 0.15)).all()
    assert sorted(accepted["beam"]) == trace.cuts.tolist()
    points = polar(filtered, scan.angles)
    for label in range(0 if scan.is_full_circle else labels.max(initial=-1) + 1):
        beams = np.flatnonzero(labels == label)
        own = stages.primary_corners(points[beams], **CORNERS, min_points=4)
        own["beam"], own["cluster"] = beams[own["beam"]], label
        np.testing.assert_array_equal(own, trace.candidates[trace.candidates["cluster"] == label])
    for corner in features.corners:
        (own,) = accepted[accepted["beam"] == corner["beam"]]
        assert own["response"] == corner["response"]
    if len(features.segments):
        assert sorted(features.corners["beam"]) == trace.cuts.tolist()
