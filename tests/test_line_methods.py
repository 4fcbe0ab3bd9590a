"""What every method of lines must do, whatever its way: scenes whose features are known."""

import math

import numpy as np
import pytest
from worlds import BOX, BOX_CORNERS, NOISE, STEP, fan, full_circle, room, scan_of, vertex, wall

from lineament import Extractor, LaserScan
from lineament.methods import get_method

NAMES = ["iepf", "split_and_merge", "line_tracking", "hough", "ransac", "region_growing", "ple"]
#: Also the methods that have another way to part and to join.
and_others = pytest.mark.parametrize(
    "extractor", [*NAMES, "liu", "liu:paper", "optimal"], indirect=True
)


@pytest.fixture(params=NAMES, scope="module")
def extractor(request):
    return Extractor(request.param, noise=NOISE)


def noisy(ranges, seed=0):
    return ranges + NOISE.sigma * np.random.default_rng(seed).normal(size=len(ranges))


@and_others
@pytest.mark.parametrize("normal", [0, 90, 180, 270, 30])
def test_wall_ends_at_its_last_measurements_along_an_axis_too(extractor, normal):
    angles = math.radians(normal) + fan(30)
    # On filtered ranges, whose ends are drawn inwards, a wall is not quite straight.
    atol = 0.02 if extractor.method == get_method("liu:paper") else 1e-9
    ideal = wall(angles, 2.0, normal)
    for ranges, off in ((ideal, atol), (noisy(ideal), 4 * NOISE.sigma)):
        scan = scan_of(ranges, angles)
        (line,) = extractor(scan).segments
        direction = [math.cos(line["angle"]), math.sin(line["angle"])]
        for end, point in ((line["start"], scan.points[0]), (line["end"], scan.points[-1])):
            assert (end - point) @ direction == pytest.approx(0.0, abs=atol)
            assert np.hypot(*(end - point)) < off
        assert np.isfinite(line["covariance"]).all()
        assert (line["first_beam"], line["last_beam"]) == (0, len(angles) - 1)
        assert line["n_points"] == len(angles)


@pytest.mark.parametrize("sigma", [0.0, 0.01])
@pytest.mark.parametrize("opening", [80, 90, 120])
@pytest.mark.parametrize("convex", [True, False])
def test_vertex_is_found_and_no_beam_lost(extractor, opening, convex, sigma):
    angles = fan(20, STEP / 2)
    ranges = vertex(angles, 3.0, opening, convex=convex)
    ranges += sigma * np.random.default_rng(0).normal(size=len(angles))
    features = extractor(scan_of(ranges, angles))
    (corner,) = features.corners
    exact = sigma == 0.0
    np.testing.assert_allclose(corner["position"], (3.0, 0.0), atol=1e-7 if exact else 0.02)
    assert corner["opening"] == pytest.approx(math.radians(opening), abs=1e-6 if exact else 0.05)
    sine = math.sin(math.radians(opening))
    if extractor.method.name not in ("iepf", "split_and_merge", "ple"):
        assert corner["response"] == pytest.approx(sine, abs=1e-6 if exact else 0.05)
    assert corner["convex"] == convex
    assert corner["segments"].tolist() == [0, 1]
    first, second = features.segments
    assert first["end"].tolist() == second["start"].tolist() == corner["position"].tolist()
    assert (first["first_beam"], second["last_beam"]) == (0, len(angles) - 1)
    assert second["first_beam"] - first["last_beam"] == 1
    assert first["n_points"] + second["n_points"] == len(angles)
    assert abs(corner["beam"] - len(angles) // 2) <= (1 if exact else 4)


@pytest.mark.parametrize("name", ["iepf", "split_and_merge", "line_tracking"])
def test_measurements_next_to_a_corner_are_left_out(name):
    angles = fan(20)
    ranges = vertex(angles, 3.0, 90, convex=False)
    ranges[len(angles) // 2] += 0.02  # The vertex itself is a little off.
    off = []
    for trim in (0, 3):
        extractor = Extractor(name, noise=NOISE, corner_trim=trim)
        (corner,) = extractor(scan_of(ranges, angles)).corners
        off.append(math.dist(corner["position"], (3.0, 0.0)))
    assert off[1] < 1e-9 < 1e-4 < off[0]


@pytest.mark.parametrize("arm", [6, 12, 24])
def test_an_unequal_l_is_split(extractor, arm):
    """The point farthest from one line through all is the end of the shorter arm."""
    angles = fan(30)
    angles = angles[: len(angles) // 2 + 1 + arm]
    features = extractor(scan_of(vertex(angles, 3.0, 90, convex=False), angles))
    assert len(features.segments) == 2
    np.testing.assert_allclose(features.corners["position"], [(3.0, 0.0)], atol=1e-6)


@pytest.mark.parametrize("false", [np.nan, np.inf, 0.0, 2.1])
def test_one_missing_or_false_beam_does_not_end_a_segment(extractor, false):
    angles = fan(30)
    ranges = noisy(wall(angles, 2.0, 10.0))
    ranges[60] = false
    features = extractor(scan_of(ranges, angles))
    (line,) = features.segments
    assert (line["first_beam"], line["last_beam"]) == (0, len(angles) - 1)
    assert features.breakpoints["kind"].tolist() == ["scan_end", "scan_end"]
    assert len(features.corners) == 0


@pytest.mark.parametrize("name", [*NAMES, "optimal"])
@pytest.mark.parametrize("max_missing", [0, 3, 6])
def test_a_segment_goes_over_as_many_missing_beams_as_it_may(name, max_missing):
    extractor, angles = Extractor(name, max_missing=max_missing), fan(30)
    for missing, lines in ((max_missing, 1), (max_missing + 1, 2)):
        ranges = noisy(wall(angles, 2.0, 10.0))
        ranges[60 : 60 + missing] = np.nan
        segments = extractor(scan_of(ranges, angles)).segments
        assert len(segments) == lines
        assert segments["n_points"].sum() == len(angles) - missing


@pytest.mark.parametrize("name", [*NAMES, "liu", "pdbs", "optimal"])
def test_gap_over_many_missing_beams_has_no_occluder(name):
    """From six missing beams on, as in the truth of simulated scans."""
    extractor = Extractor(name, noise=NOISE)
    for missing, kind in ((5, "jump"), (6, "gap"), (20, "gap")):
        ranges = np.array([2.0] * 20 + [np.nan] * missing + [9.0] * 20)
        (point, *_) = extractor(LaserScan(ranges, 0.0, 0.01)).breakpoints
        assert point["kind"] == kind
        assert point["beam"].tolist() == [19, 20 + missing]
        assert point["occluder"] == (19 if kind == "jump" else -1)


@and_others
@pytest.mark.parametrize(("behind", "lines"), [(np.nan, 2), (np.inf, 2), (5.0, 3)])
def test_walls_on_either_side_of_a_doorway_are_not_bridged(extractor, behind, lines):
    angles = fan(40)
    door = abs(angles) < math.radians(12)
    ranges = noisy(np.where(door, wall(angles, behind, 0.0), wall(angles, 2.0, 0.0)))
    features = extractor(scan_of(ranges, angles))
    assert len(features.segments) == lines
    is_optimal = extractor.method.name == "optimal"
    assert (len(features.corners), len(features.edges)) == (0, 2 * (is_optimal and lines == 3))
    kinds = ["jump", "jump"] if lines == 3 else ["gap"]
    assert features.breakpoints["kind"].tolist() == [*kinds, "scan_end", "scan_end"]
    for line in features.segments:
        assert len(set(door[line["first_beam"] : line["last_beam"] + 1])) == 1


def test_parallel_walls_of_a_step_have_no_corner(extractor):
    """A step of 6 cm, within a cluster: two walls that never meet."""
    if extractor.method.name == "iepf":
        extractor = Extractor("iepf", noise=NOISE, noise_factor=2.0)  # Else it is one wall.
    angles = fan(30)
    ranges = np.where(angles < 0, wall(angles, 2.0, 0.0), wall(angles, 2.06, 0.0))
    features = extractor(scan_of(ranges, angles))
    assert features.clusters.max() == 0
    assert len(features.segments) == 2
    assert len(features.corners) == 0


@pytest.mark.parametrize("turn", [0.0, 0.4, 2.5])
@pytest.mark.parametrize("n", [360, 361])
def test_room_all_around_has_four_walls_and_four_corners(extractor, turn, n):
    """Wherever the seam lies; with one beam more the first direction is not seen twice."""
    ring = full_circle(n) + turn
    features = extractor(scan_of(room(ring, BOX), ring))
    segments, corners = features.segments, features.corners
    assert len(segments) == len(corners) == 4
    assert len(features.breakpoints) == 0
    assert sorted(map(tuple, corners["position"].round(6).tolist())) == sorted(BOX_CORNERS)
    # Each corner is the end of one wall and the start of the next.
    assert sorted(corners["segments"].ravel().tolist()) == [0, 0, 1, 1, 2, 2, 3, 3]
    for corner in corners:
        before, after = segments[corner["segments"]]
        assert before["end"].tolist() == after["start"].tolist() == corner["position"].tolist()


@and_others
def test_wall_over_the_seam_is_one(extractor):
    angles = full_circle()
    ranges = np.where(abs(angles) > 2.6, wall(angles, 2.0, 180.0), np.inf)
    (line,) = extractor(scan_of(noisy(ranges), angles)).segments
    assert line["first_beam"] > line["last_beam"]
    assert line["n_points"] == (abs(angles) > 2.6).sum()


@pytest.mark.parametrize("sigma", [0.003, 0.01, 0.03])
def test_nothing_needs_tuning_when_the_noise_grows(extractor, sigma):
    """Estimated from each scan: no wall falls apart, and hardly a corner is missed or false."""
    unaware = Extractor(extractor.method)
    rng = np.random.default_rng(2)
    angles = fan(40)
    rows = wall(angles, 3.0, 10.0) + sigma * rng.normal(size=(20, len(angles)))
    walls = unaware.batch(rows, angle_min=angles[0], angle_increment=STEP)
    assert np.diff(walls.offsets["segments"]).max() <= 1 + (extractor.method.name == "iepf")
    ring = full_circle(720)
    rows = room(ring, BOX) + sigma * rng.normal(size=(20, 720))
    rows[rng.random(rows.shape) < 0.02] = np.inf
    rooms = unaware.batch(rows, angle_min=ring[0], angle_increment=ring[1] - ring[0])
    missed = false = 0
    for features in rooms:
        apart = np.linalg.norm(features.corners["position"][:, np.newaxis] - BOX_CORNERS, axis=2)
        missed += int((apart.min(axis=0, initial=9.0) > 0.1).sum())
        false += int((apart.min(axis=1, initial=9.0) > 0.1).sum())
    assert max(missed, false) <= 4


def test_nothing_is_found_in_nothing_and_in_clutter_of_single_points(extractor):
    angles = fan(20)
    for ranges in (np.full(len(angles), np.nan), 2.0 + np.arange(len(angles)) % 2):
        features = extractor(scan_of(ranges, angles))
        assert len(features.segments) == len(features.corners) == 0


@pytest.mark.parametrize("turn", [1, -1])
def test_a_line_along_its_beams_is_no_segment(turn):
    """Whose first and last measurement are at one place along it; the others are numbered on."""
    bearings = 0.01 * np.arange(60)
    walls = 4.0 * np.minimum(1.0 / np.cos(bearings), math.tan(0.3) / np.sin(bearings + 1e-9))
    ranges = np.r_[2.0, 1.0, 2.0, np.full(3, np.nan), walls][::turn]
    extractor = Extractor("iepf:paper", clusters="fixed", distance=1.5)
    features = extractor(LaserScan(ranges, -0.3, 0.01))
    assert features.segments["n_points"].tolist() == [31, 30][::turn]
    (label,) = set(features.clusters[ranges > 2.0].tolist())
    assert features.segments["cluster"].tolist() == [label, label]
    (corner,) = features.corners
    assert corner["segments"].tolist() == [0, 1]
    assert ranges[corner["beam"]] == np.nanmax(ranges)
    alone = extractor(LaserScan(np.where(ranges > 2.0, ranges, np.nan), -0.3, 0.01))
    for name in ("covariance", "response"):
        np.testing.assert_array_equal(features.corners[name], alone.corners[name])
