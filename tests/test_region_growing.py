"""Method region_growing: equal to its slow twin; seeds and growth by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from naive_regions import assert_same_pieces, grow
from worlds import NOISE, degenerate_scans, fan, random_scan, scan_of, wall

from lineament import Extractor, LaserScan, RangeNoise
from lineament.methods.region_growing import RegionGrowing

DEGENERATE = degenerate_scans()
METHODS = {
    "default": (RegionGrowing(), None),
    "metres alone": (RegionGrowing(sigmas=0.0, epsilon=0.03, p_min=10, l_min=0.3), None),
    "bearing noise": (RegionGrowing(s_num=4, p_min=5), RangeNoise(0.01, 0.002, 0.001, 0.01)),
}


@pytest.mark.parametrize("scan", DEGENERATE.values(), ids=DEGENERATE)
def test_degenerate_scans_equal_the_slow_twin(scan):
    assert_same_pieces(RegionGrowing(), scan, grow)


@pytest.mark.parametrize(("method", "noise"), METHODS.values(), ids=METHODS)
def test_random_scans_equal_the_slow_twin(method, noise):
    pieces = sum(assert_same_pieces(method, random_scan(s), grow, noise) for s in range(20))
    assert pieces > 40  # Else nothing was compared.


def test_seed_takes_consecutive_points_near_their_line():
    angles = fan(20)
    ranges = wall(angles, 2.0, 0.0)
    ranges[::5] += 0.2  # No six in a row are straight.
    scan = scan_of(ranges, angles)
    assert len(Extractor(RegionGrowing(), noise=NOISE)(scan).segments) == 0
    assert len(Extractor(RegionGrowing(s_num=3, p_min=3), noise=NOISE)(scan).segments) > 0


def test_predicted_point_stops_what_the_distance_lets_pass():
    """On a wall at 70° incidence a point 2 cm off the line is 5 cm off along its beam."""
    angles = math.radians(70) + fan(4)
    ranges = wall(angles, 0.5, 0.0)
    ranges[-1] += 0.05
    scan = scan_of(ranges, angles)
    noise = RangeNoise(sigma=0.001)
    wide = Extractor(RegionGrowing(epsilon=0.03, delta=0.5), noise=noise)(scan).segments
    tight = Extractor(RegionGrowing(epsilon=0.03, delta=0.02), noise=noise)(scan).segments
    assert wide["n_points"].tolist() == [len(angles)]
    assert tight["n_points"].tolist() == [len(angles) - 1]


def test_small_and_short_regions_are_left_out():
    angles = fan(3)  # 19 beams over 0.21 m.
    scan = scan_of(wall(angles, 2.0, 0.0), angles)
    for parameters, expected in (
        ({"p_min": 19}, 1),
        ({"p_min": 20}, 0),
        ({"l_min": 0.2}, 1),
        ({"l_min": 0.22}, 0),
    ):
        assert len(Extractor(RegionGrowing(**parameters), noise=NOISE)(scan).segments) == expected


def test_nothing_needs_tuning_when_the_noise_grows():
    angles = fan(40)
    for sigma in (0.003, 0.01, 0.03):
        noise = sigma * np.random.default_rng(3).normal(size=(20, len(angles)))
        for row in noise:
            scan = scan_of(wall(angles, 3.0, 10.0) + row, angles)
            assert len(Extractor(RegionGrowing())(scan).segments) == 1


@pytest.mark.parametrize(
    ("name", "refused"),
    [
        ("s_num", [2, 6.0, "6", None, True]),
        ("p_min", [2, -1, 6.0]),
        ("l_min", [-0.1, math.nan, math.inf]),
        ("epsilon", [-0.1, math.nan]),
        ("delta", [-0.1, "1"]),
        ("sigmas", [-1, math.inf]),
        ("reach", [-1.0]),
        ("fit", ["huber"]),
        ("grazing_angle", [0.0, math.pi / 2]),
        ("noise_factor", [-1.0]),
        ("max_missing", [-1, 1.5]),
        ("max_vertices", [-1, 2.5]),
    ],
)
def test_bounds(name, refused):
    for value in refused:
        with pytest.raises(ValueError, match=f"{name} is ") as error:
            RegionGrowing(**{name: value})
        assert str(value) in str(error.value)


def test_whole_numbers_are_taken_for_numbers():
    method = RegionGrowing(sigmas=3, epsilon=0, s_num=np.int64(5))
    assert [type(v) for v in (method.sigmas, method.epsilon, method.s_num)] == [float, float, int]
    assert isinstance(hash(method), int)
    assert len(Extractor(method)(LaserScan([2.0] * 20, 0.0, 0.01)).clusters) == 20
