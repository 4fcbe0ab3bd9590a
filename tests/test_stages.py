"""Stages by themselves: what they refuse, their edges, and that a trace is made of them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from worlds import NOISE, degenerate_scans, random_scan

from lineament import Extractor, LaserScan, RangeNoise
from lineament.methods import stages

SCAN = LaserScan([2.0] * 9, 0.0, 0.01)
POINTS = [(2.0, 0.1 * i) for i in range(9)]
NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("stage", "changes", "message"),
    [
        ("bilateral_filter", {"sigma_d": 0}, "sigma_d is 0"),
        ("bilateral_filter", {"sigma_d": NAN}, "sigma_d is nan"),
        ("bilateral_filter", {"sigma_r": -1.0}, r"sigma_r is -1\.0"),
        ("bilateral_filter", {"sigma_r": "1"}, "sigma_r is '1'"),
        ("bilateral_filter", {"half_width": -1}, "half_width is -1"),
        ("bilateral_filter", {"half_width": 1.5}, r"half_width is 1\.5"),
        ("adaptive_clusters", {"spacing_scale": 0.0}, r"spacing_scale is 0\.0"),
        ("adaptive_clusters", {"noise_floor": -0.1}, r"noise_floor is -0\.1"),
        ("adaptive_clusters", {"density_k": INF}, "density_k is inf"),
        ("adaptive_clusters", {"min_points": 0}, "min_points is 0"),
        ("adaptive_clusters", {"min_points": True}, "min_points is True"),
        ("adaptive_clusters", {"ranges": [1.0, 2.0]}, r"ranges has shape \(2,\), expected \(9,\)"),
        ("corner_response", {"support_radius": 0}, "support_radius is 0"),
        ("corner_response", {"response": "chord"}, "response is 'chord', expected one of: "),
        ("primary_corners", {"threshold": -1.0}, r"threshold is -1\.0"),
        ("primary_corners", {"min_points": 1}, "min_points is 1"),
        ("primary_corners", {"support_radius": 2.0}, r"support_radius is 2\.0"),
        ("primary_corners", {"response": None}, "response is None"),
        ("fit_line", {"fit": "huber"}, "fit is 'huber', expected one of: total, y_of_x, weighted"),
    ],
)
def test_refusals_name_parameter_and_value(stage, changes, message):
    given = SCAN if stage in ("bilateral_filter", "adaptive_clusters") else POINTS
    with pytest.raises(ValueError, match=message):
        getattr(stages, stage)(given, **changes)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([1.0, 2.0], r"points has shape \(2,\)"),
        ([(1.0, 2.0, 3.0)], r"points has shape \(1, 3\)"),
        ([(1.0, NAN), (1.0, 2.0)], "not finite"),
        ([(1.0, INF), (1.0, 2.0)], "not finite"),
    ],
)
@pytest.mark.parametrize("stage", ["corner_response", "primary_corners", "fit_line"])
def test_refusals_of_points(stage, points, message):
    with pytest.raises(ValueError, match=message):
        getattr(stages, stage)(points)


def test_fit_needs_two_points_that_a_beam_can_meet():
    for points in ([], [(1.0, 2.0)]):
        with pytest.raises(ValueError, match=f"points has {len(points)} points"):
            stages.fit_line(points)
    with pytest.raises(ValueError, match="at the origin"):
        stages.fit_line([(0.0, 0.0), (1.0, 1.0)])


def test_fit_of_coinciding_points_has_no_direction():
    for fit in stages.FITS:
        line = stages.fit_line([(1.0, 1.0)] * 3, noise=NOISE, fit=fit)
        assert line["covariance"][1, 1] == pytest.approx(np.pi**2 / 12)
        assert np.isfinite(line["covariance"]).all()
        assert line["centroid"].tolist() == [1.0, 1.0]


def test_clusters_of_other_ranges_leave_invalid_beams_out():
    scan = LaserScan([2.0, NAN, 2.0, 2.0, 2.0], 0.0, 0.01)
    found = stages.adaptive_clusters(scan, [9.0, 2.0, 2.0, 2.0, 2.0], noise=NOISE)
    assert found.tolist() == [-1, -1, 0, 0, 0]


def test_given_arrays_stay_as_they_are():
    ranges = np.full(9, 2.0)
    scan = LaserScan([NAN] + [2.0] * 8, 0.0, 0.01)
    stages.adaptive_clusters(scan, ranges)
    assert ranges.tolist() == [2.0] * 9
    points = np.array(POINTS)
    stages.primary_corners(points)
    stages.fit_line(points)
    assert points.tolist() == [list(p) for p in POINTS]


def test_empty_inputs():
    scan = LaserScan([], 0.0, 0.1)
    assert stages.bilateral_filter(scan).shape == (0,)
    assert stages.adaptive_clusters(scan).shape == (0,)
    assert stages.estimate_noise(scan) is None
    assert stages.corner_response([]).shape == (0,)
    assert len(stages.primary_corners([])) == 0


SCANS = {**degenerate_scans(), **{f"random {k}": random_scan(k) for k in range(12)}}


@pytest.mark.parametrize("scan", SCANS.values(), ids=SCANS)
@pytest.mark.parametrize("noise", [None, RangeNoise(sigma=0.02)])
def test_trace_is_made_of_the_stages(scan, noise):
    extractor = Extractor("liu", response="relative", threshold=0.25, noise=noise)
    trace = extractor.trace(scan)
    method, features = extractor.method, extractor(scan)
    for name in ("segments", "corners", "breakpoints"):
        found, expected = getattr(trace.features, name), getattr(features, name)
        for field in found.dtype.names:
            np.testing.assert_array_equal(found[field], expected[field])
    np.testing.assert_array_equal(trace.filtered, stages.bilateral_filter(scan))
    clusters = stages.adaptive_clusters(scan, trace.filtered, noise=noise)
    np.testing.assert_array_equal(trace.clusters, clusters)
    np.testing.assert_array_equal(trace.clusters, features.clusters)
    assert trace.features.noise == (noise or stages.estimate_noise(scan))
    accepted = trace.candidates[trace.candidates["accepted"]]
    assert (accepted["response"] > method.threshold).all()
    rejected = trace.candidates[~trace.candidates["accepted"]]
    assert (rejected["response"] <= method.threshold).all()
    assert sorted(accepted["beam"]) == trace.cuts.tolist()
    for corner in features.corners:
        (own,) = accepted[accepted["beam"] == corner["beam"]]
        assert own["response"] == corner["response"]
        assert own["cluster"] == features.clusters[corner["beam"]]
    if len(features.segments):
        assert sorted(features.corners["beam"]) == trace.cuts.tolist()
    assert (trace.scan, trace.method, trace.threshold) == (scan, "liu", method.threshold)
    # A class begins where the spacing exceeds both thresholds, and only there.
    known = ~np.isnan(trace.spacing)
    limit = np.fmax(trace.distance_threshold, trace.density_threshold)
    asked = ~np.isnan(trace.density_threshold)
    assert (trace.spacing[asked] > trace.distance_threshold[asked]).all()
    beams = np.flatnonzero(~np.isnan(trace.filtered))
    for before, beam in pairwise(beams):
        together = clusters[before] == clusters[beam]
        if clusters[before] >= 0 and clusters[beam] >= 0 and known[beam]:
            within = trace.spacing[beam] <= limit[beam]
            assert together >= within
            if not scan.is_full_circle:
                assert together == within
