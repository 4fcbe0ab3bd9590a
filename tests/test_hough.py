"""Method hough: equal to its slow twin; its accumulator by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from naive_regions import assert_same_pieces, vote
from worlds import NOISE, degenerate_scans, fan, random_scan, scan_of, wall

from lineament import Extractor, LaserScan, RangeNoise
from lineament.methods.hough import Hough

DEGENERATE = degenerate_scans()
METHODS = {
    "default": (Hough(), None),
    "coarse": (Hough(angles=30, distances=16, min_length=0.3, max_misses=0), None),
    "bearing noise": (Hough(angles=60, min_points=8), RangeNoise(0.01, 0.002, 0.001, 0.01)),
}


@pytest.mark.parametrize("scan", DEGENERATE.values(), ids=DEGENERATE)
def test_degenerate_scans_equal_the_slow_twin(scan):
    assert_same_pieces(Hough(angles=36, distances=64), scan, vote)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "noise"), METHODS.values(), ids=METHODS)
def test_random_scans_equal_the_slow_twin(method, noise):
    pieces = sum(assert_same_pieces(method, random_scan(s), vote, noise) for s in range(10))
    assert pieces > 20  # Else nothing was compared.


@pytest.mark.parametrize("angles", [4, 45, 180])
@pytest.mark.parametrize("normal", [0.0, 7.3, -33.0])
def test_line_does_not_depend_on_the_directions_voted_for(angles, normal):
    """The peak is only where the search begins; with four directions, up to 22° off."""
    bearings = fan(30)
    scan = scan_of(wall(bearings, 2.0, normal), bearings)
    (line,) = Extractor(Hough(angles=angles, min_points=6), noise=NOISE)(scan).segments
    assert line["n_points"] == len(bearings)
    assert math.degrees(line["angle"]) == pytest.approx(90 + normal, abs=1e-6)


def test_votes_that_are_too_few_make_no_line():
    bearings = fan(3)
    scan = scan_of(wall(bearings, 2.0, 0.0), bearings)
    for least, expected in ((19, 1), (20, 0)):
        assert len(Extractor(Hough(min_points=least), noise=NOISE)(scan).segments) == expected


@pytest.mark.slow
@pytest.mark.parametrize("size", [1e-6, 1e9, 1e60, 1e150, 1e200, 1.7e308])
def test_clusters_of_any_size_stay_within_the_accumulator(size):
    bearings = fan(30)
    for ranges in (np.full(len(bearings), size), size * np.cos(bearings)):
        features = Extractor(Hough(angles=36), noise=NOISE)(scan_of(ranges, bearings))
        assert len(features.clusters) == len(bearings)


def test_accumulator_keeps_nothing_from_scan_to_scan():
    bearings = fan(40)
    extractor = Extractor(Hough())
    scans = [random_scan(s, len(bearings)) for s in range(3)]
    scans = [LaserScan(s.ranges, float(bearings[0]), 0.006, range_max=30.0) for s in scans]
    first = [extractor(scan).segments.tobytes() for scan in scans]
    again = [extractor(scan).segments.tobytes() for scan in scans[::-1]][::-1]
    assert first == again


@pytest.mark.parametrize(
    ("name", "refused"),
    [
        ("angles", [3, 180.0]),
        ("distances", [3, None]),
        ("resolution", [0.0, -1, math.nan]),
        ("min_points", [2, 4.0]),
        ("min_length", [-0.1]),
        ("max_misses", [-1, 1.0]),
        ("epsilon", [-0.1]),
        ("sigmas", [-1, math.inf]),
        ("reach", [-1.0]),
        ("fit", ["huber"]),
        ("max_vertices", [-1]),
    ],
)
def test_bounds(name, refused):
    for value in refused:
        with pytest.raises(ValueError, match=f"{name} is ") as error:
            Hough(**{name: value})
        assert str(value) in str(error.value)
