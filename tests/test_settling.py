"""What region_growing, ransac and hough have in common: pieces settled, corners between them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from worlds import BOX, NOISE, STEP, fan, full_circle, room, scan_of, vertex, wall

from lineament import Extractor

NAMES = ["region_growing", "ransac", "hough"]
BOX_CORNERS = [(2.0, 1.3), (-2.4, 1.3), (-2.4, -1.7), (2.0, -1.7)]


@pytest.fixture(params=NAMES, scope="module")
def extractor(request):
    return Extractor(request.param, noise=NOISE)


@pytest.mark.parametrize("opening", [80, 90, 140])
@pytest.mark.parametrize("convex", [True, False])
def test_both_sides_of_a_vertex_have_all_their_beams(extractor, opening, convex):
    angles = fan(25, STEP / 2)
    features = extractor(scan_of(vertex(angles, 3.0, opening, convex=convex), angles))
    (corner,) = features.corners
    np.testing.assert_allclose(corner["position"], (3.0, 0.0), atol=1e-9)
    assert corner["opening"] == pytest.approx(math.radians(opening), abs=1e-9)
    assert corner["convex"] == convex
    assert corner["segments"].tolist() == [0, 1]
    assert corner["response"] == pytest.approx(math.sin(math.radians(opening)), abs=1e-9)
    first, second = features.segments
    assert (first["first_beam"], second["last_beam"]) == (0, len(angles) - 1)
    assert second["first_beam"] == first["last_beam"] + 1
    assert first["n_points"] + second["n_points"] == len(angles)
    assert abs(corner["beam"] - len(angles) // 2) <= 1
    assert first["end"].tolist() == second["start"].tolist() == corner["position"].tolist()


@pytest.mark.parametrize("arm", [6, 8, 12])
def test_short_arm_at_the_end_of_an_l_is_a_wall_of_its_own(extractor, arm):
    """The point farthest from one line through all is the end of the L."""
    angles = fan(20)
    ranges = vertex(angles, 2.0, 90, convex=False)[: len(angles) // 2 + 1 + arm]
    scan = scan_of(ranges, angles[: len(ranges)])
    features = extractor(scan)
    assert len(features.segments) == 2
    assert features.corners["position"].shape == (1, 2)
    np.testing.assert_allclose(features.corners["position"][0], (2.0, 0.0), atol=1e-6)


@pytest.mark.parametrize("normal", [0, 90, 180, 270, 30])
def test_wall_has_its_ends_and_no_nan(extractor, normal):
    angles = math.radians(normal) + fan(30)
    (line,) = extractor(scan_of(wall(angles, 2.0, normal), angles)).segments
    assert (line["first_beam"], line["last_beam"]) == (0, len(angles) - 1)
    assert line["n_points"] == len(angles)
    half = 2.0 * math.tan(math.radians(30))
    length = np.linalg.norm(line["end"] - line["start"])
    assert length == pytest.approx(2 * half, abs=1e-9)
    assert np.isfinite(line["covariance"]).all()


@pytest.mark.parametrize("missing", [1, 5])
def test_missing_beams_do_not_end_a_segment(extractor, missing):
    angles = fan(30)
    ranges = wall(angles, 2.0, 10.0)
    ranges[60 : 60 + missing] = np.nan
    (line,) = extractor(scan_of(ranges, angles)).segments
    assert line["n_points"] == len(angles) - missing


def test_one_reading_off_the_wall_does_not_part_it(extractor):
    angles = fan(30)
    ranges = wall(angles, 2.0, 0.0)
    ranges[70] += 0.12  # Near enough to stay in its cluster, twelve sigmas off.
    (line,) = extractor(scan_of(ranges, angles)).segments
    assert (line["first_beam"], line["last_beam"]) == (0, len(angles) - 1)
    assert len(extractor(scan_of(ranges, angles)).corners) == 0


@pytest.mark.parametrize("behind", [np.nan, np.inf, 5.0])
def test_walls_on_either_side_of_a_doorway_are_not_bridged(extractor, behind):
    angles = fan(40)
    ranges = wall(angles, 2.0, 0.0)
    door = abs(angles) < math.radians(12)
    ranges[door] = behind
    segments = extractor(scan_of(ranges, angles)).segments
    on_wall = segments[abs(segments["centroid"][:, 0] - 2.0) < 0.1]
    assert on_wall["last_beam"][0] < np.flatnonzero(door)[0]
    assert on_wall["first_beam"][1] > np.flatnonzero(door)[-1]
    assert len(on_wall) == 2


def test_parallel_walls_of_a_step_have_no_corner(extractor):
    """A step of 6 cm, within a cluster: two walls that never meet."""
    angles = fan(30)
    ranges = np.where(angles < 0, wall(angles, 2.0, 0.0), wall(angles, 2.06, 0.0))
    features = extractor(scan_of(ranges, angles))
    assert features.clusters.max() == 0
    assert len(features.segments) == 2
    assert len(features.corners) == 0


@pytest.mark.parametrize("turn", [0.0, 0.4, 2.0])
@pytest.mark.parametrize("n", [360, 361])
def test_room_all_around_has_four_walls_and_four_corners(extractor, turn, n):
    """Wherever the seam lies; with one beam more the first direction is not seen twice."""
    ring = full_circle(n) + turn
    features = extractor(scan_of(room(ring, BOX), ring))
    assert len(features.segments) == 4
    assert len(features.corners) == 4
    assert sorted(map(tuple, features.corners["position"].round(6).tolist())) == sorted(BOX_CORNERS)
    # Each corner is the end of one wall and the start of the next.
    assert sorted(features.corners["segments"].ravel().tolist()) == [0, 0, 1, 1, 2, 2, 3, 3]
    for corner in features.corners:
        before, after = features.segments[corner["segments"]]
        assert before["end"].tolist() == after["start"].tolist() == corner["position"].tolist()


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("sigma", [0.005, 0.03])
def test_noisy_rooms_have_their_corners_and_no_others(name, sigma):
    ring = full_circle(720)
    rows = room(ring, BOX) + sigma * np.random.default_rng(2).normal(size=(30, 720))
    rows[np.random.default_rng(3).random(rows.shape) < 0.02] = np.inf
    batch = Extractor(name).batch(rows, angle_min=ring[0], angle_increment=ring[1] - ring[0])
    missed = false = 0
    for i in range(30):
        found = batch[i].corners["position"]
        apart = np.linalg.norm(found[:, np.newaxis] - BOX_CORNERS, axis=2)
        missed += int((apart.min(axis=0, initial=9.0) > 0.1).sum())
        false += int((apart.min(axis=1, initial=9.0) > 0.1).sum())
    assert missed <= 4
    assert false <= 4


def test_nothing_is_found_in_nothing_and_in_clutter_of_single_points(extractor):
    angles = fan(20)
    for ranges in (np.full(len(angles), np.nan), 2.0 + np.arange(len(angles)) % 2):
        features = extractor(scan_of(ranges, angles))
        assert len(features.segments) == len(features.corners) == 0
