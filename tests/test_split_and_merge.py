"""Method split_and_merge: its splitting equals its slow twin. See also test_line_methods."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive_fit import range_variance
from naive_partition import clusters_of, noise_of, parted, split, untied
from worlds import NOISE, degenerate_scans, fan, random_scan, scan_of, wall

from lineament import Extractor, RangeNoise

DEGENERATE = degenerate_scans()
SENSOR = RangeNoise(0.01, 0.01, 0.002, 0.01)
EXTRACTORS = {
    "default": Extractor("split_and_merge"),
    "changed": Extractor("split_and_merge", min_piece=2, threshold=0.02, noise=SENSOR),
}


def assert_same_split(scan, extractor):
    """Hold the candidates equal to the twin's. Returns the number of those that were taken."""
    method, noise = extractor.method, noise_of(scan, extractor)

    def tolerance(rho):
        return method.threshold + method.noise_factor * np.sqrt(range_variance(rho, noise))

    found = parted(scan, clusters_of(method), noise)
    candidates, _ = split(
        scan, found, noise, tolerance=tolerance, min_piece=method.min_piece, by_line=True
    )
    trace = extractor.trace(scan)
    assert trace.candidates["beam"].tolist() == [beam for beam, _, _ in candidates]
    for name, k in (("chord_distance", 1), ("response", 2)):
        expected = [candidate[k] for candidate in candidates]
        np.testing.assert_allclose(trace.candidates[name], expected, rtol=1e-6, atol=1e-7)
    assert len(trace.cuts) == sum(excess > 1 for _, _, excess in candidates)
    return len(trace.cuts)


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


def test_one_point_off_its_line_splits_nothing_and_two_do():
    angles = fan(20)
    for off, pieces in (([60], 1), ([60, 61], 2), ([60, 62], 1)):
        ranges = wall(angles, 2.0, 0.0)
        ranges[off] += 0.07
        extractor = Extractor("split_and_merge", noise=NOISE, noise_factor=5.0)
        trace = extractor.trace(scan_of(ranges, angles))
        assert set(trace.clusters) == {0}
        assert (len(trace.cuts) > 0) == (pieces > 1)


def test_two_points_on_different_sides_split_nothing():
    angles = fan(20)
    ranges = wall(angles, 2.0, 0.0)
    ranges[[60, 61]] += [0.045, -0.045]
    trace = Extractor("split_and_merge", noise=NOISE, noise_factor=4.0).trace(
        scan_of(ranges, angles)
    )
    assert set(trace.clusters) == {0}
    assert len(trace.cuts) == 0


@pytest.mark.parametrize(
    ("name", "refused"),
    [
        ("threshold", [-0.1, math.nan, "1"]),
        ("noise_factor", [-1.0, None]),
        ("min_piece", [1, 2.0]),
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
            Extractor("split_and_merge", **{name: value})
        assert str(value) in str(error.value)


def test_a_tolerance_of_nothing_is_refused():
    with pytest.raises(ValueError, match="threshold and noise_factor are both 0"):
        Extractor("split_and_merge", noise_factor=0)
