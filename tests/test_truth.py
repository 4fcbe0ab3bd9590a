"""The truth of simulated scans: cases worked by hand, and what must hold in every scene."""

import math
from dataclasses import replace

import numpy as np
import pytest

from lineament.bounds import arc_bound, corner_bound, line_bound
from lineament.features import TABLES
from lineament.scan import RangeNoise
from lineament.simulation import SCENES, SENSORS, Sensor, World, building, scene, truth

NOISE = RangeNoise(sigma=0.01, bearing=0.001)
ORIGIN = (0.0, 0.0, 0.0)
STEP = math.radians(1)


def fan(half_width, step=STEP, **settings):
    """Make a scanner whose beams lie at ±step/2, ±3/2 step ...: none straight ahead."""
    n = 2 * round(math.radians(half_width) / step)
    return Sensor("fan", n, -(n - 1) * step / 2, step, noise=NOISE, **settings)


def ring(n=360, first=-math.pi, **settings):
    return Sensor("ring", n, first, 2 * math.pi / n, noise=NOISE, **settings)


def box(x1, y1, x2, y2):
    return [(x1, y1), (x2, y1), (x2, y2), (x1, y2), (x1, y1)]


def counts(features):
    return tuple(len(getattr(features, name)) for name in TABLES)


def ends(features):
    return [(*s["start"].round(9).tolist(), *s["end"].round(9).tolist()) for s in features.segments]


def kinds(features):
    return [(*b["beam"].tolist(), str(b["kind"]), int(b["occluder"])) for b in features.breakpoints]


# By hand


def test_nothing():
    features = truth(World([]), ORIGIN, fan(45))
    assert counts(features) == (0, 0, 0, 0)
    assert (features.clusters == -1).all()
    assert features.noise == NOISE


def test_a_wall_that_ends_before_the_next_beams():
    features = truth(World([[2, 1, 2, -1]]), ORIGIN, fan(45))
    half = math.degrees(math.atan(0.5))  # 26.6°: 27 beams at 0.5°, 1.5°, ... on each side
    assert counts(features) == (1, 0, 0, 2)
    segment = features.segments[0]
    assert ends(features) == [(2, -1, 2, 1)]
    assert segment["angle"] == pytest.approx(math.pi / 2)
    first, last = 45 - math.ceil(half - 0.5), 44 + math.ceil(half - 0.5)
    assert (segment["first_beam"], segment["last_beam"]) == (first, last)
    assert segment["n_points"] == last - first + 1
    assert (segment["rms"], segment["cluster"]) == (0, 0)
    bearings = fan(45).angles[first : last + 1]
    bound = line_bound(bearings, (2, 0), math.pi / 2, NOISE)
    np.testing.assert_allclose(segment["covariance"], bound.covariance)
    np.testing.assert_allclose(segment["centroid"], (2, 0), atol=1e-12)
    assert kinds(features) == [(-1, first, "scan_end", -1), (last, -1, "scan_end", -1)]
    np.testing.assert_allclose(features.breakpoints["position"][0], (2, 2 * np.tan(bearings[0])))


def test_a_wall_beyond_both_ends_of_the_scan_ends_at_its_beams():
    features = truth(World([[2, 9, 2, -9]]), ORIGIN, fan(10))
    edge = 2 * math.tan(math.radians(9.5))
    np.testing.assert_allclose(features.segments["start"], [(2, -edge)])
    np.testing.assert_allclose(features.segments["end"], [(2, edge)])


def test_a_concave_corner_between_beams():
    world = World.of_polygons([[(2, -2), (2, 2), (-2, 2)]])
    features = truth(world, (0, 0, math.pi / 4), fan(30))
    assert counts(features) == (2, 1, 0, 2)
    corner, (before, after) = features.corners[0], features.segments
    np.testing.assert_allclose(corner["position"], (math.sqrt(8), 0), atol=1e-12)
    np.testing.assert_allclose(before["end"], corner["position"], atol=1e-12)
    np.testing.assert_allclose(after["start"], corner["position"], atol=1e-12)
    assert corner["opening"] == pytest.approx(math.pi / 2)
    assert not corner["convex"]
    assert corner["segments"].tolist() == [0, 1]
    assert corner["beam"] in (29, 30)
    assert (before["last_beam"], after["first_beam"]) == (29, 30)
    bearings = fan(30).angles
    sides = [
        line_bound(bearings[:30], corner["position"], math.radians(45), NOISE),
        line_bound(bearings[30:], corner["position"], math.radians(135), NOISE),
    ]
    np.testing.assert_allclose(corner["covariance"], corner_bound(*sides), atol=1e-12)
    assert (features.clusters == 0).all()


def test_a_convex_corner():
    world = World.of_polygons([box(1, 1, 3, 3)])
    features = truth(world, (0, 0, math.pi / 4), fan(30))
    assert counts(features) == (2, 1, 0, 2)
    corner = features.corners[0]
    np.testing.assert_allclose(corner["position"], (math.sqrt(2), 0), atol=1e-12)
    assert corner["convex"]
    assert corner["opening"] == pytest.approx(math.pi / 2)


@pytest.mark.parametrize("through_vertices", [False, True])
@pytest.mark.parametrize("order", [1, -1])
def test_a_box_whose_other_sides_are_hidden_has_no_corner(through_vertices, order):
    sensor = fan(40)
    if through_vertices:  # beams straight through (2, ±0.5)
        step = math.atan(0.25) / 8
        sensor = Sensor("through", 41, -20 * step, step)
    world = World.of_polygons([box(2, -0.5, 3, 0.5)[::order]])
    features = truth(world, ORIGIN, sensor)
    assert counts(features) == (1, 0, 0, 2)
    assert ends(features) == [(2, -0.5, 2, 0.5)]
    if through_vertices:
        assert features.segments["n_points"].tolist() == [17]


def test_beams_through_the_vertices_of_a_room():
    world = World.of_polygons([box(-2, -2, 2, 2)])
    features = truth(world, ORIGIN, ring(16))  # at -180°, -157.5°, -135°
    assert counts(features) == (4, 4, 0, 0)
    assert features.segments["n_points"].sum() == 16
    openings = features.corners["opening"]
    np.testing.assert_allclose(openings, math.pi / 2)


@pytest.mark.parametrize("first", [-math.pi, 0.0, 1.0])
def test_a_wall_over_the_seam_is_in_one_piece(first):
    sensor = ring(first=first)
    features = truth(World.of_polygons([box(-2, -1, 3, 1)]), ORIGIN, sensor)
    assert counts(features) == (4, 4, 0, 0)
    assert features.segments["n_points"].sum() == 360
    over = features.segments["first_beam"] > features.segments["last_beam"]
    assert over.sum() == 1
    assert features.corners["segments"].tolist() == [[0, 1], [1, 2], [2, 3], [3, 0]]
    for corner in features.corners:
        before, after = features.segments[corner["segments"]]
        np.testing.assert_allclose(before["end"], corner["position"])
        np.testing.assert_allclose(after["start"], corner["position"])
    assert (features.clusters == 0).all()


def test_a_seam_at_a_corner():
    # A corner at -180° ± half a step.
    sensor = ring(first=-math.pi + STEP / 2)
    world = World.of_polygons([[(-2, 0), (0, -2), (2, 0), (0, 2), (-2, 0)]])
    features = truth(world, ORIGIN, sensor)
    assert counts(features) == (4, 4, 0, 0)
    assert (features.segments["first_beam"] <= features.segments["last_beam"]).all()
    assert features.corners["segments"].tolist() == [[0, 1], [1, 2], [2, 3], [3, 0]]


def test_a_column_in_front_of_a_wall():
    sensor = fan(30)
    world = World([[4, -9, 4, 9]], [[2, 0, 0.3]])
    features = truth(world, ORIGIN, sensor)
    assert counts(features) == (2, 0, 1, 4)
    # The column covers asin(0.15) = 8.63°: 8 beams on each side; the next are at 8.5° and 9.5°.
    arc = features.arcs[0]
    assert (arc["first_beam"], arc["last_beam"], arc["n_points"]) == (21, 38, 18)
    np.testing.assert_allclose(arc["center"], (2, 0), atol=1e-12)
    assert arc["radius"] == 0.3
    expected = arc_bound(sensor.angles[21:39], (2, 0), 0.3, NOISE)
    np.testing.assert_allclose(arc["covariance"], expected)
    # The wall is seen half-way to the beams that the column took.
    edge = 4 * math.tan(math.radians(9.0))
    np.testing.assert_allclose(features.segments["end"][0], (4, -edge))
    np.testing.assert_allclose(features.segments["start"][1], (4, edge))
    assert features.segments["cluster"].tolist() == [0, 2]
    assert kinds(features) == [
        (20, 21, "jump", 21),
        (38, 39, "jump", 38),
        (-1, 0, "scan_end", -1),
        (59, -1, "scan_end", -1),
    ]
    near = features.breakpoints["position"][0]
    assert math.dist(near, (2, 0)) == pytest.approx(0.3)


def test_the_end_of_a_thin_wall():
    world = World([[5, -9, 5, 9], [1, 0.01, 3, 0.01]])
    features = truth(world, ORIGIN, fan(30, step=math.radians(0.1)))
    # Its beams lie between atan(0.01/3) = 0.19° and 0.57°: 0.25°, 0.35°, 0.45° and 0.55°.
    assert features.segments["n_points"].tolist() == [302, 4, 294]
    assert ends(features)[1] == (3, 0.01, 1, 0.01)
    assert counts(features) == (3, 0, 0, 4)
    assert [b[3] for b in kinds(features)[:2]] == [302, 305]


def test_a_wall_of_one_beam_is_not_listed():
    # A pilaster 1.2 cm wide and 5 cm deep, whose front is met by the beam at 0.5°.
    y = 2 * math.tan(STEP / 2)
    front = [(1.95, y - 0.006), (1.95, y + 0.006)]
    world = World.of_polygons([[(2, -1), (2, y - 0.006), *front, (2, y + 0.006), (2, 1)]])
    features = truth(world, ORIGIN, fan(15))
    assert features.segments["n_points"].tolist() == [15, 14]
    assert len(features.corners) == 0
    assert features.clusters[14:17].tolist() == [0, -1, 1]
    assert kinds(features)[0] == (14, 16, "jump", 14)


def test_a_corner_with_a_side_of_one_beam_has_no_bound():
    # The side from (2, 0) towards the scanner is met at 0.5° and ends at 0.9°.
    features = truth(World.of_polygons([[(2, -1), (2, 0), (1.9, 0.03)]]), ORIGIN, fan(10))
    (corner,) = features.corners
    assert corner["segments"].tolist() == [0, -1]
    assert np.isnan(corner["covariance"]).all()
    moved = features.transform(1, 2, 3)
    assert np.isnan(moved.corners["covariance"]).all()


def test_a_column_of_two_beams_has_no_bound():
    features = truth(World([], [[3, 0, 0.04]]), ORIGIN, fan(10))
    assert features.arcs["n_points"].tolist() == [2]
    assert np.isnan(features.arcs["covariance"]).all()
    assert (features.clusters == -1).all()
    assert len(features.breakpoints) == 0


def test_walls_end_to_end_are_one_and_a_doorway_parts_them():
    pieces = [[2, -3, 2, -1], [2, 1, 2, -1.0005], [2, 3, 2, 1]]
    features = truth(World(pieces), ORIGIN, fan(40))
    assert counts(features) == (1, 0, 0, 2)
    door = [[2, -3, 2, -1], [2, 0, 2, 3], [4, -9, 4, 9]]
    features = truth(World(door), ORIGIN, fan(40))
    assert len(features.segments) == 3
    assert len(features.corners) == 0
    assert ends(features)[0][2:] == (2, -1)
    assert ends(features)[2][:2] == (2, 0)


def test_a_wall_against_the_middle_of_another():
    # Two walls in line, and one that stands on the vertex between them.
    world = World([[3, -2, 3, 0], [3, 0, 3, 2], [3, 0, 2, 0.2]])
    features = truth(world, ORIGIN, fan(30, step=math.radians(0.25)))
    (corner,) = features.corners
    np.testing.assert_allclose(corner["position"], (3, 0), atol=1e-12)
    assert not corner["convex"]
    assert corner["opening"] == pytest.approx(math.pi / 2 + math.atan(0.2))
    assert ends(features)[0][2:] == (3, 0)
    assert ends(features)[1] == (3, 0, 2, 0.2)
    assert len(features.segments) == 3


def test_range_limits_end_a_wall_half_way_to_the_next_beam():
    features = truth(World([[2, -9, 2, 9]]), ORIGIN, fan(60, range_max=2.2))
    # acos(2/2.2) = 24.6°: the last beam is at 24.5°, the next one at 25.5°.
    (segment,) = features.segments
    np.testing.assert_allclose(segment["end"], (2, 2 * math.tan(math.radians(25))))
    assert segment["n_points"] == 50


@pytest.mark.parametrize(("width", "kind"), [(3.0, "jump"), (4.0, "gap")])
def test_a_hole_is_a_gap_over_many_beams(width, kind):
    # 6 beams at most from one side to the other are a jump.
    half = 2 * math.tan(math.radians(width - 0.75))
    features = truth(World([[2, -1, 2, -half], [2, half, 2, 1]]), ORIGIN, fan(30))
    (before, after, found, occluder), *_ = kinds(features)
    assert found == kind
    assert after - before == 2 * (width - 1) + 1
    assert occluder == (-1 if kind == "gap" else before)


def test_a_round_room_is_one_arc_around():
    features = truth(World([], [[0.3, 0.2, 2]]), ORIGIN, ring(90))
    assert counts(features) == (0, 0, 1, 0)
    assert features.arcs["n_points"].tolist() == [90]
    assert (features.clusters == 0).all()


def test_an_open_ring_has_a_break_between_its_ends():
    # One cluster of a full turn that does not close, as the methods have it.
    features = truth(World([[2, -1, 2, 1]]), ORIGIN, ring(first=0.0))
    assert features.segments["first_beam"][0] > features.segments["last_beam"][0]
    last, first = features.segments[0][["last_beam", "first_beam"]].tolist()
    assert kinds(features) == [(last, first, "gap", -1)]


# In every scene


EVERY_SCENE = [
    pytest.param(kind, seed, SENSORS[name], id=f"{kind}-{name}")
    for kind in SCENES
    for seed, name in enumerate(("paper", "utm30lx", "ld19", "lms181", "rplidar"))
]


def beams_of(record, n):
    return (record["first_beam"] + np.arange(record["n_points"])) % n


@pytest.mark.parametrize(("kind", "seed", "sensor"), EVERY_SCENE)
def test_what_holds_in_every_scene(kind, seed, sensor):
    world, pose = scene(kind, seed)
    features = truth(world, pose, sensor)
    ranges, _ = sensor.ideal(world, pose)
    n, bearings = sensor.n_beams, sensor.angles
    valid = (ranges >= sensor.range_min) & (ranges < sensor.range_max)
    points = np.column_stack((ranges * np.cos(bearings), ranges * np.sin(bearings)))
    used = np.zeros(n, dtype=int)
    for segment in features.segments:
        beams = beams_of(segment, n)
        assert beams[-1] == segment["last_beam"]
        used[beams] += 1
        length = math.dist(segment["start"], segment["end"])
        u = (segment["end"] - segment["start"]) / length
        assert segment["angle"] == pytest.approx(math.atan2(u[1], u[0]), abs=1e-9)
        along = (points[beams] - segment["start"]) @ u
        across = (points[beams] - segment["start"]) @ (-u[1], u[0])
        np.testing.assert_allclose(across, 0, atol=1e-9)
        assert (np.diff(along) > 0).all()
        assert along[0] >= -1e-9
        assert along[-1] <= length + 1e-9
        assert (features.clusters[beams] == segment["cluster"]).all()
        assert (np.linalg.eigvalsh(segment["covariance"]) > 0).all()
    for arc in features.arcs:
        beams = beams_of(arc, n)
        used[beams] += 1
        off = np.hypot(*(points[beams] - arc["center"]).T) - arc["radius"]
        np.testing.assert_allclose(off, 0, atol=1e-9)
    assert used.max() == 1
    assert not used[~valid].any()
    assert used[valid].mean() > 0.95
    vertices = world.segments.reshape(-1, 2)
    for corner in features.transform(*pose).corners:
        assert np.hypot(*(vertices - corner["position"]).T).min() < 1e-9
        if -1 not in corner["segments"]:
            assert (np.linalg.eigvalsh(corner["covariance"]) > 0).all()
    for corner in features.corners:
        b = bearings[corner["beam"]]
        x, y = corner["position"]
        turn = math.remainder(math.atan2(y, x) - b, 2 * math.pi)
        assert abs(turn) <= sensor.angle_increment / 2 + 1e-9
    check_breakpoints(features, ranges)


def check_breakpoints(features, ranges):
    label = features.clusters
    assert sorted(set(label.tolist()) - {-1}) == list(range(label.max(initial=-1) + 1))
    for b in features.breakpoints:
        before, after = b["beam"]
        if b["kind"] == "scan_end":
            assert min(before, after) == -1
            continue
        between = np.arange(before + 1, after if after > before else after + len(label))
        assert (label[between % len(label)] == -1).all()
        near = before if ranges[before] <= ranges[after] else after
        assert b["occluder"] == (near if b["kind"] == "jump" else -1)
        assert math.hypot(*b["position"]) == pytest.approx(ranges[near])


def same(features, others):
    assert counts(features) == counts(others)
    np.testing.assert_array_equal(features.clusters, others.clusters)
    for name in TABLES:
        table, other = getattr(features, name), getattr(others, name)
        for field in table.dtype.names:
            if field == "kind":
                assert table[field].tolist() == other[field].tolist()
            else:
                np.testing.assert_allclose(table[field], other[field], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("kind", SCENES)
def test_the_order_direction_and_number_of_walls_do_not_matter(kind):
    world, pose = scene(kind, 1)
    rng = np.random.default_rng(0)
    features = truth(world, pose, SENSORS["ld19"])
    share = rng.uniform(0.2, 0.8, (len(world.segments), 1))
    middle = (1 - share) * world.segments[:, :2] + share * world.segments[:, 2:]
    halves = np.vstack(
        (np.hstack((middle, world.segments[:, :2])), np.hstack((middle, world.segments[:, 2:])))
    )
    for walls in (world.segments[::-1], world.segments[:, [2, 3, 0, 1]], rng.permutation(halves)):
        same(features, truth(World(walls, world.circles), pose, SENSORS["ld19"]))


def test_the_frame_of_the_world_does_not_matter():
    world, (x, y, theta) = scene("hall", 2)
    features = truth(world, (x, y, theta), SENSORS["utm30lx"])
    turn, shift = 1.1, np.array([3.0, -7.0])
    c, s = math.cos(turn), math.sin(turn)
    rotation = np.array([[c, -s], [s, c]])
    walls = (world.segments.reshape(-1, 2) @ rotation.T + shift).reshape(-1, 4)
    circles = world.circles.copy()
    circles[:, :2] = circles[:, :2] @ rotation.T + shift
    pose = (*(rotation @ (x, y) + shift).tolist(), theta + turn)
    same(features, truth(World(walls, circles), pose, SENSORS["utm30lx"]))


def test_the_noise_of_a_sensor_changes_its_bounds_alone():
    world, pose = scene("room", 4)
    sensor = SENSORS["paper"]
    fine, coarse = (truth(world, pose, replace(sensor, noise=RangeNoise(s))) for s in (0.01, 0.02))
    np.testing.assert_array_equal(fine.segments["start"], coarse.segments["start"])
    np.testing.assert_allclose(4 * fine.segments["covariance"], coarse.segments["covariance"])
    np.testing.assert_allclose(4 * fine.corners["covariance"], coarse.corners["covariance"])


def test_what_is_true_is_read_only_and_can_be_written_out():
    world, waypoints = building()
    features = truth(world, (*waypoints[2], 0.0), SENSORS["utm30lx"])
    with pytest.raises(ValueError, match="read-only"):
        features.segments["rms"] = 1
    assert features.to_arrow().num_rows > 10
    assert len(features.to_dict()["corners"]) == len(features.corners)
