"""What is special to each method of lines, by hand."""

import math

import numpy as np
import pytest
from lineament_lab.methods.hough import Hough
from lineament_lab.methods.ransac import Ransac
from lineament_lab.methods.region_growing import RegionGrowing
from naive_partition import tracked
from naive_regions import assert_same_pieces, grow
from worlds import BOX, NOISE, fan, full_circle, random_scan, room, scan_of, vertex, wall

from lineament import Extractor, LaserScan, RangeNoise
from lineament.kernels import layout as at

# The iterative end point fit, split-and-merge


def test_tolerance_by_hand():
    """A right angle 3 m ahead whose arms end 0.2 m off: split at a tolerance below its height."""
    angles = fan(3, math.radians(0.25))
    scan = scan_of(vertex(angles, 3.0, 90, convex=False), angles)
    height = 3.0 - scan.points[[0, -1], 0].mean()
    plain = {"proportion": 0.0, "noise_factor": 0.0}
    for parts in ({"threshold": 1.0}, {"proportion": 1 / 3.0}, {"noise_factor": 100.0}):
        for scale, corners in ((height * 0.999, 1), (height * 1.001, 0)):
            own = plain | {name: value * scale for name, value in parts.items()}
            extractor = Extractor("iepf", settling=False, noise=NOISE, **own)
            assert len(extractor(scan).corners) == corners
            candidate = extractor.trace(scan).candidates[0]
            assert candidate["chord_distance"] == pytest.approx(height)
            assert candidate["accepted"] == bool(corners)


def test_paper_puts_corners_on_measurements():
    angles = fan(25)
    scan = scan_of(vertex(angles, 3.0, 100, convex=True), angles)
    (corner,) = Extractor("iepf:paper", noise=NOISE)(scan).corners
    np.testing.assert_allclose(corner["position"], scan.points[corner["beam"]], rtol=1e-12)
    assert corner["beam"] == len(angles) // 2


def test_merging_joins_what_was_split_by_noise():
    """A tolerance of one σ splits a wall many times; the joint fit makes one of it again."""
    angles = fan(40)
    ranges = 2.0 / np.cos(angles) + 0.01 * np.random.default_rng(3).normal(size=len(angles))
    scan, parameters = scan_of(ranges, angles), {"noise_factor": 1.0, "proportion": 0.0}
    assert len(Extractor("iepf", settling=False, noise=NOISE, **parameters)(scan).segments) > 10
    assert len(Extractor("iepf", noise_factor=3.0, noise=NOISE)(scan).segments) == 1


@pytest.mark.parametrize(("opening", "corners"), [(120, 1), (179, 0)])
def test_published_merging_leaves_corners_where_pieces_touch(opening, corners):
    """Two pieces of what is one wall but for the noise become one again."""
    angles = fan(25)
    ranges = vertex(angles, 2.0, opening, convex=False)
    ranges += 0.01 * np.random.default_rng(3).normal(size=len(angles))
    published = Extractor("split_and_merge:paper", threshold=0.01, noise=NOISE)
    trace = published.trace(scan_of(ranges, angles))
    assert len(trace.cuts) > corners
    assert len(trace.features.corners) == len(trace.features.segments) - 1 == corners
    for corner in trace.features.corners:
        first, second = trace.features.segments[corner["segments"]]
        assert math.dist(corner["position"], (2.0, 0.0)) < 0.03
        assert first["last_beam"] == second["first_beam"]


@pytest.mark.parametrize(
    ("off", "by", "factor", "is_cut"),
    [
        ([60], 0.07, 5.0, False),
        ([60, 61], 0.07, 5.0, True),
        ([60, 62], 0.07, 5.0, False),
        ([60, 61], [0.045, -0.045], 4.0, False),
    ],
)
def test_two_neighbours_off_one_side_of_their_line_split_it(off, by, factor, is_cut):
    angles = fan(20)
    ranges = wall(angles, 2.0, 0.0)
    ranges[off] += by
    extractor = Extractor("split_and_merge", noise=NOISE, noise_factor=factor)
    trace = extractor.trace(scan_of(ranges, angles))
    assert set(trace.clusters) == {0}
    assert (len(trace.cuts) > 0) == is_cut


# Settling


@pytest.mark.parametrize(("off", "corners"), [(0, 4), (6, 4), (4, 3)])
def test_a_ring_is_joined_over_a_few_points_without_a_piece(off, corners):
    """Points off the walls where it was opened, at its farthest: from 4 points on it stays open."""
    ring = full_circle(360)
    ranges = room(ring, BOX)
    opened = int(np.argmax(ranges)) - off // 2 + np.arange(off)
    ranges[opened] += np.where(np.arange(off) % 2, 0.05, 0.11)
    extractor = Extractor("hough", noise=NOISE)
    assert len(extractor(scan_of(ranges, ring)).corners) == corners
    (block,) = extractor._blocks
    first, last = block.work.pieces[[at.FIRST, at.LAST], : block.counts[at.PIECES]]
    apart = first[0] + block.counts[at.POINTS] - 1 - last[-1]
    assert apart == {0: 1, 6: 4, 4: 5}[off]


# Line tracking


@pytest.mark.parametrize("missed", [1, 2, 3])
def test_a_line_passes_over_as_many_misses_as_it_may(missed):
    angles = fan(20)
    ranges = wall(angles, 2.0, 0.0)
    ranges[60 : 60 + missed] += 0.06
    for max_misses in range(4):
        extractor = Extractor("line_tracking", max_misses=max_misses, noise=NOISE)
        whole = tracked(scan_of(ranges, angles), extractor)[0] == (0, len(angles) - 1)
        assert whole == (missed <= max_misses)


def test_a_line_ends_about_the_vertex_and_the_next_begins_there():
    angles = fan(20)
    scan = scan_of(vertex(angles, 3.0, 90, convex=False), angles)
    (_, end), (begin, last) = tracked(scan, Extractor("line_tracking", noise=NOISE))
    assert begin == end + 1
    assert last == len(angles) - 1
    assert 0 <= end - len(angles) // 2 <= 4  # It runs past, where both walls are near.
    # Merging moves the border to where it belongs.
    (corner,) = Extractor("line_tracking", noise=NOISE)(scan).corners
    assert abs(corner["beam"] - len(angles) // 2) <= 1


# Hough transform


@pytest.mark.parametrize("angles", [4, 45, 180])
@pytest.mark.parametrize("normal", [0.0, 7.3, -33.0])
def test_line_does_not_depend_on_the_directions_voted_for(angles, normal):
    """The peak is only where the search begins; with four directions, up to 22° off."""
    bearings = fan(30)
    scan = scan_of(wall(bearings, 2.0, normal), bearings)
    (line,) = Extractor(Hough(angles=angles, min_points=6), noise=NOISE)(scan).segments
    assert line["n_points"] == len(bearings)
    assert math.degrees(line["angle"]) == pytest.approx(90 + normal, abs=1e-6)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:all ranges are")
@pytest.mark.parametrize("size", [1e-6, 1e9, 1e60, 1e150, 1e200, 1.7e308])
def test_clusters_of_any_size_stay_within_the_accumulator(size):
    bearings = fan(30)
    for ranges in (np.full(len(bearings), size), size * np.cos(bearings)):
        features = Extractor(Hough(angles=36), noise=NOISE)(scan_of(ranges, bearings))
        assert len(features.clusters) == len(bearings)


# RANSAC


def test_seed_is_all_that_changes_the_draws():
    angles = fan(60)
    ranges = np.minimum(wall(angles, 2.0, 0.0), wall(angles, 2.5, 60.0))
    scan = scan_of(ranges + 0.03 * np.random.default_rng(1).normal(size=len(angles)), angles)
    cuts = {
        Extractor(Ransac(trials=1, seed=s, settling=False), noise=NOISE)(scan).segments.tobytes()
        for s in (1, 1, 7, 7, 99)
    }
    assert 1 < len(cuts) <= 3


# Region growing, and what is too small


def test_seed_takes_consecutive_points_near_their_line():
    angles = fan(20)
    ranges = wall(angles, 2.0, 0.0)
    ranges[::5] += 0.2  # No six in a row are straight.
    scan = scan_of(ranges, angles)
    assert len(Extractor(RegionGrowing(), noise=NOISE)(scan).segments) == 0
    assert len(Extractor(RegionGrowing(s_num=3, p_min=3), noise=NOISE)(scan).segments) > 0


@pytest.mark.parametrize("seed", [24, 129, 192])
def test_a_region_grows_back_into_the_one_before_but_not_over_it(seed):
    """Scenes in which the smallest regions would swallow those before them."""
    method = RegionGrowing(s_num=3, p_min=3, sigmas=1.0, epsilon=0.003)
    assert assert_same_pieces(method, random_scan(seed, 120), grow) > 0


@pytest.mark.parametrize(("delta", "lost"), [(0.5, 0), (0.02, 1)])
def test_predicted_point_stops_what_the_distance_lets_pass(delta, lost):
    """On a wall at 70° incidence a point 2 cm off the line is 5 cm off along its beam."""
    angles = math.radians(70) + fan(4)
    ranges = wall(angles, 0.5, 0.0)
    ranges[-1] += 0.05
    method = RegionGrowing(epsilon=0.03, delta=delta)
    found = Extractor(method, noise=RangeNoise(sigma=0.001))(scan_of(ranges, angles))
    assert found.segments["n_points"].tolist() == [len(angles) - lost]


@pytest.mark.parametrize(
    ("name", "points", "length"),
    [
        ("region_growing", "p_min", "l_min"),
        ("hough", "min_points", "min_length"),
        ("ransac", "min_points", "min_length"),
    ],
)
def test_pieces_of_few_points_and_short_ones_are_left_out(name, points, length):
    angles = fan(3)  # 19 beams over 0.21 m.
    scan = LaserScan(wall(angles, 2.0, 0.0), angles=angles)
    for parameters, expected in (
        ({points: 19}, 1),
        ({points: 20}, 0),
        ({length: 0.2}, 1),
        ({length: 0.22}, 0),
    ):
        assert len(Extractor(name, noise=NOISE, **parameters)(scan).segments) == expected
