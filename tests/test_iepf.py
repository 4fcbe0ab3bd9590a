"""Method iepf: its splitting equals its slow twin; scenes by hand. See also test_line_methods."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive_fit import range_variance
from naive_partition import clusters_of, noise_of, parted, split, untied
from worlds import NOISE, degenerate_scans, fan, random_scan, scan_of, vertex

from lineament import Extractor, RangeNoise

DEGENERATE = degenerate_scans()
SENSOR = RangeNoise(0.01, 0.01, 0.002, 0.01)
EXTRACTORS = {
    "default": Extractor("iepf", merge=False),
    "paper": Extractor("iepf:paper"),
    "changed": Extractor("iepf", merge=False, min_piece=2, threshold=0.02, noise=SENSOR),
}


def assert_same_split(scan, extractor):
    """Hold candidates and pieces equal to the twin's. Returns the number of corners."""
    method, noise = extractor.method, noise_of(scan, extractor)

    def tolerance(rho):
        sigma = np.sqrt(range_variance(rho, noise))
        return method.threshold + method.proportion * rho + method.noise_factor * sigma

    found = parted(scan, clusters_of(method), noise)
    candidates, pieces = split(
        scan, found, noise, tolerance=tolerance, min_piece=method.min_piece, by_line=False
    )
    trace = extractor.trace(scan)
    assert trace.candidates["beam"].tolist() == [beam for beam, _, _ in candidates]
    for name, k in (("chord_distance", 1), ("response", 2)):
        expected = [candidate[k] for candidate in candidates]
        np.testing.assert_allclose(trace.candidates[name], expected, rtol=1e-7, atol=1e-9)
    segments, corners = trace.features.segments, trace.features.corners
    assert list(zip(segments["first_beam"], segments["last_beam"], strict=True)) == [
        (first, last) for first, last, _ in pieces
    ]
    assert corners["segments"].tolist() == [
        [before, k] for k, (_, _, before) in enumerate(pieces) if before >= 0
    ]
    return len(corners)


@pytest.mark.parametrize("scan", DEGENERATE.values(), ids=DEGENERATE)
@pytest.mark.parametrize("extractor", EXTRACTORS.values(), ids=EXTRACTORS)
def test_degenerate_scans_equal_the_slow_twin(extractor, scan):
    assert_same_split(untied(scan), extractor)


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from(sorted(EXTRACTORS)))
def test_random_scans_equal_the_slow_twin(seed, name):
    assert_same_split(random_scan(seed), EXTRACTORS[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", EXTRACTORS)
def test_recorded_scans_equal_the_slow_twin(recorded_scans, name):
    assert sum(assert_same_split(scan, EXTRACTORS[name]) for scan in recorded_scans) > 50


def test_tolerance_by_hand():
    """A right angle 3 m ahead whose arms end 0.2 m off: split at a tolerance below its height."""
    angles = fan(3, math.radians(0.25))
    scan = scan_of(vertex(angles, 3.0, 90, convex=False), angles)
    ends = scan.points[[0, -1]]
    height = 3.0 - ends[:, 0].mean()
    plain = {"proportion": 0.0, "noise_factor": 0.0}
    for parts in ({"threshold": 1.0}, {"proportion": 1 / 3.0}, {"noise_factor": 100.0}):
        for scale, corners in ((height * 0.999, 1), (height * 1.001, 0)):
            own = plain | {name: value * scale for name, value in parts.items()}
            extractor = Extractor("iepf", merge=False, noise=NOISE, **own)
            assert len(extractor(scan).corners) == corners
            trace = extractor.trace(scan)
            assert trace.candidates["chord_distance"][0] == pytest.approx(height)
            assert trace.candidates["accepted"][0] == bool(corners)


def test_paper_puts_corners_on_readings():
    angles = fan(25)
    scan = scan_of(vertex(angles, 3.0, 100, convex=True), angles)
    (corner,) = Extractor("iepf:paper", noise=NOISE)(scan).corners
    np.testing.assert_allclose(corner["position"], scan.points[corner["beam"]], rtol=1e-12)
    assert corner["beam"] == len(angles) // 2


def test_merging_joins_what_was_split_by_noise():
    """A tolerance of one σ splits a wall many times; the joint fit makes one of it again."""
    angles = fan(40)
    ranges = 2.0 / np.cos(angles) + 0.01 * np.random.default_rng(3).normal(size=len(angles))
    scan = scan_of(ranges, angles)
    parameters = {"noise_factor": 1.0, "proportion": 0.0, "noise": NOISE}
    assert len(Extractor("iepf", merge=False, **parameters)(scan).segments) > 10
    assert len(Extractor("iepf", noise_factor=3.0, noise=NOISE)(scan).segments) == 1


@pytest.mark.parametrize(
    ("name", "refused"),
    [
        ("threshold", [-0.1, math.nan, "1"]),
        ("proportion", [-0.1]),
        ("noise_factor", [-1.0, None]),
        ("min_piece", [1, 2.0]),
        ("merge", [1, None, "yes"]),
        ("corner", ["vertex", None]),
        ("unevenness", [-1.0]),
        ("reach", [-1.0, math.inf]),
        ("corner_trim", [-1]),
        ("grazing_angle", [0, 10, math.pi / 2]),
        ("max_missing", [-1]),
        ("min_points", [1]),
        ("max_vertices", [-1, 1.5]),
    ],
)
def test_bounds(name, refused):
    for value in refused:
        with pytest.raises(ValueError, match=f"{name} is ") as error:
            Extractor("iepf", **{name: value})
        assert str(value) in str(error.value)


def test_a_tolerance_of_nothing_is_refused():
    with pytest.raises(ValueError, match="threshold, proportion and noise_factor are all 0"):
        Extractor("iepf", proportion=0, noise_factor=0)
