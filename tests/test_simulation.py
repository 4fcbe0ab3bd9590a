"""Worlds, ray casting, sensors: against hand-worked cases, a slow twin, statistics."""

import math
from dataclasses import replace

import numpy as np
import pytest
from worlds import drum, ring_sensor

from lineament.logs import open_log
from lineament.scan import RangeNoise
from lineament.simulation import (
    SENSORS,
    Sensor,
    World,
    building,
    cast_rays,
    drive,
    drive_poses,
    room,
    scene,
    simulate_log,
)

#: Statistics are held to this many standard deviations of their own: a chance of 7e-6 each.
SIGMAS = 4.5
INF = math.inf


# Worlds


def test_world_keeps_read_only_copies():
    walls = np.array([[0.0, 0, 1, 0]])
    world = World(walls)
    walls[:] = 9
    assert world.segments.tolist() == [[0, 0, 1, 0]]
    assert world.circles.shape == (0, 3)
    assert not world.segments.flags.writeable
    with pytest.raises(AttributeError):
        world.segments = walls


def test_polygons_are_open_or_closed():
    triangle = [(0, 0), (1, 0), (0, 1), (0, 0)]
    world = World.of_polygons([triangle, [(5, 5), (6, 5)]], circles=[[9, 9, 1]])
    assert world.segments.tolist() == [[0, 0, 1, 0], [1, 0, 0, 1], [0, 1, 0, 0], [5, 5, 6, 5]]
    assert (world.n_surfaces, World.of_polygons([]).n_surfaces) == (5, 0)


def test_a_drive_ends_with_a_scan_in_spite_of_rounding():
    """0.3/0.1 · 10 is below 30 by rounding."""
    stamps, poses = drive_poses([(0, 0), (0.3, 0)], speed=0.1, rate=10.0)
    assert (len(stamps), stamps[-1], poses[-1].tolist()) == (31, 3.0, [0.3, 0.0, 0.0])


# Ray casting


WALL = World([[2, -1, 2, 1]])
CIRCLE = World([], [[3, 0, 1]])
CORNER = World.of_polygons([[(2, -2), (2, 2), (-2, 2)]])
TWO = World([[4, -1, 4, 1], [2, -1, 2, 1]], [[6, 0, 1]])


@pytest.mark.parametrize(
    ("world", "pose", "angle", "distance", "surface"),
    [
        pytest.param(WALL, (0, 0, 0), math.atan(0.5), math.sqrt(5), 0, id="its end"),
        pytest.param(WALL, (0, 0, 0), math.atan(0.5) + 1e-9, INF, -1, id="past its end"),
        pytest.param(World([[0, 1, 5, 1]]), (0, 0, 0), 0, INF, -1, id="parallel"),
        pytest.param(World([[1, 0, 5, 0]]), (0, 0, 0), 0, INF, -1, id="edge-on"),
        pytest.param(World([[0, 0, 0, 1]]), (0, 0.5, 0), 0, INF, -1, id="on a wall"),
        pytest.param(World([[0, 0, 1, 1], [2, 0, 2, 1]]), (0.5, 0.5, 0), 0, 1.5, 1,
                     id="on a wall, the next is met"),
        pytest.param(CORNER, (0, 0, 0), math.pi / 4, math.sqrt(8), 0, id="corner"),
        pytest.param(CIRCLE, (0, 1, 0), 0, 3, 0, id="tangent"),
        pytest.param(CIRCLE, (0, 1 + 1e-12, 0), 0, INF, -1, id="past the tangent"),
        pytest.param(CIRCLE, (3, 0, 0), 1.2, 1, 0, id="within a circle"),
        pytest.param(CIRCLE, (2, 0, 0), 0, 2, 0, id="on a circle, inwards"),
        pytest.param(CIRCLE, (2, 0, 0), math.pi, INF, -1, id="on a circle, outwards"),
        pytest.param(TWO, (4.5, 0, 0), 0, 0.5, 2, id="circle after two walls"),
        pytest.param(World([]), (0, 0, 0), 0, INF, -1, id="empty world"),
    ],
)  # fmt: skip
def test_hand_worked(world, pose, angle, distance, surface):
    ranges, surfaces = cast_rays(world, pose, [angle])
    assert ranges[0] == pytest.approx(distance, rel=1e-12)
    assert surfaces[0] == surface
    assert surfaces.dtype == np.int32


def naive_cast(world, pose, angle):
    """Cast one ray: every wall by a linear system, every circle by the roots of its quadratic."""
    x, y, theta = pose
    u = np.array([math.cos(theta + angle), math.sin(theta + angle)])
    met = [(INF, -1)]
    for i, (x1, y1, x2, y2) in enumerate(world.segments):
        distance, share = np.linalg.solve(
            np.column_stack((u, [x1 - x2, y1 - y2])), [x1 - x, y1 - y]
        )
        met += [(distance, i)] if 0 <= share <= 1 else []
    for i, (cx, cy, r) in enumerate(world.circles, len(world.segments)):
        to = np.array([x - cx, y - cy])
        roots = np.roots([1, 2 * u @ to, to @ to - r**2])
        met += [(root, i) for root in roots[np.isreal(roots)].real]
    return min(found for found in met if found[0] > 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_as_naive_on_random_worlds_from_one_pose_or_one_a_beam(seed):
    rng = np.random.default_rng(seed)
    circles = np.column_stack((rng.uniform(-5, 5, (5, 2)), rng.uniform(0.1, 2, 5)))
    world = World(rng.uniform(-5, 5, (12, 4)), circles[: seed % 3 * 2])
    # More than one block of beams, and not a multiple of it.
    angles = rng.uniform(-math.pi, math.pi, 1100)
    poses = rng.uniform(-4, 4, (1100 if seed % 2 else 1, 3))
    ranges, surface = cast_rays(world, poses, angles)
    poses = np.broadcast_to(poses, (1100, 3))
    expected = [naive_cast(world, *seen) for seen in zip(poses, angles, strict=True)]
    assert surface.tolist() == [s for _, s in expected]
    np.testing.assert_allclose(ranges, [r for r, _ in expected], rtol=1e-9)


def test_nothing_slips_through_a_corner():
    polygon = [(0, 0), (7, 0.3), (8.1, 3.3), (7.7, 6.1), (0.3, 5.9), (0, 0)]  # convex
    world = World.of_polygons([polygon])
    vertices = np.array(polygon[:-1])
    for x, y in np.random.default_rng(3).uniform((1, 1), (5.5, 5), (300, 2)):
        bearings = np.arctan2(vertices[:, 1] - y, vertices[:, 0] - x)
        ranges, _ = cast_rays(world, (x, y, 0), bearings)
        distances = np.hypot(*(vertices - (x, y)).T)
        np.testing.assert_allclose(ranges, distances, rtol=1e-12)


def test_no_beam_meets_nothing():
    assert [len(of_none) for of_none in cast_rays(WALL, (0, 0, 0), [])] == [0, 0]


# Sensors


def ranges_in_drum(radius, **settings):
    """Twenty scans of a round room."""
    sensor, rng = ring_sensor(**settings), np.random.default_rng(11)
    return np.concatenate([sensor.scan(drum(radius), (0, 0, 0), rng).ranges for _ in range(20)])


@pytest.mark.parametrize(
    ("noise", "radius"),
    [
        (RangeNoise(sigma=0.02), 4.0),
        (RangeNoise(proportional=0.01), 7.0),
        (RangeNoise(sigma=0.01, proportional=0.005, quantum=0.02), 3.0),
        (RangeNoise(bearing=0.1), 5.0),  # no effect: the room is round
    ],
)
def test_noise_is_as_stated(noise, radius):
    ranges = ranges_in_drum(radius, noise=noise)
    expected = math.sqrt(noise.range_variance(radius))
    n = len(ranges)
    assert abs(ranges.mean() - radius) <= SIGMAS * expected / math.sqrt(n) + 1e-12
    assert abs(ranges.std() - expected) <= SIGMAS * expected / math.sqrt(2 * n) + 1e-12


def test_bearing_noise_shows_on_an_oblique_wall():
    sensor = Sensor("oblique", 101, 0.7, 0.001, noise=RangeNoise(bearing=0.002))
    wall = World([[2, -50, 2, 50]])
    truth, _ = sensor.ideal(wall, (0, 0, 0))
    rng = np.random.default_rng(5)
    scans = np.array([sensor.scan(wall, (0, 0, 0), rng).ranges for _ in range(300)])
    # dρ/dφ = ρ tan φ on the wall ρ cos φ = 2.
    errors = (scans - truth) / (truth * np.tan(sensor.angles))
    # The second order adds about σ² (1 + 2 tan² φ) / 2, far below the interval.
    assert errors.std() == pytest.approx(0.002, rel=SIGMAS / math.sqrt(2 * errors.size))


@pytest.mark.parametrize("quantum", [0.001, 0.01, 0.25])
def test_quantised_ranges_lie_on_the_lattice(quantum):
    sensor = ring_sensor(noise=RangeNoise(sigma=0.03, quantum=quantum))
    steps = sensor.scan(room(), (0, 0, 0.2), np.random.default_rng(1)).ranges / quantum
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)


def test_dropouts_and_outliers_which_are_short_and_uniform():
    lost = ~np.isfinite(ranges_in_drum(2, dropout=0.03))
    assert abs(lost.mean() - 0.03) < SIGMAS * math.sqrt(0.03 * 0.97 / len(lost))
    ranges = ranges_in_drum(3, outlier=0.1, range_min=1.0)
    false = ranges[ranges < 3 - 1e-9]
    assert abs(len(false) / len(ranges) - 0.1) < SIGMAS * math.sqrt(0.1 * 0.9 / len(ranges))
    assert false.min() >= 1.0
    assert abs(false.mean() - 2.0) < SIGMAS * 2 / math.sqrt(12 * len(false))


def test_outliers_where_nothing_is_met():
    rng = np.random.default_rng(2)
    near = ring_sensor(outlier=0.5, range_max=10.0).scan(World([]), (0, 0, 0), rng)
    assert near.valid.mean() == pytest.approx(0.5, abs=0.06)
    assert not ring_sensor(outlier=0.5).scan(World([]), (0, 0, 0), rng).valid.any()


@pytest.mark.parametrize(("range_min", "range_max"), [(0.0, 2.5), (2.5, 30.0)])
def test_limits(range_min, range_max):
    sensor = ring_sensor(range_min=range_min, range_max=range_max)
    truth, _ = sensor.ideal(room(), (0, 0, 0))
    ranges = sensor.scan(room(), (0, 0, 0), np.random.default_rng(0)).ranges
    within = (truth >= range_min) & (truth < range_max)
    assert within.any()
    assert not within.all()
    np.testing.assert_array_equal(ranges, np.where(within, truth, INF))
    # A range at the upper limit is not reported, one at the lower limit is.
    assert np.isinf(ranges_in_drum(2, range_max=2)).all()
    assert (ranges_in_drum(2, range_min=2, range_max=3) == 2).all()


def test_mixed_pixels_only_across_occlusion_edges():
    divergence = 0.01
    sensor, pose = ring_sensor(mixed_pixel=divergence), (0.3, 0.2, 0.1)
    plain = replace(sensor, mixed_pixel=0.0)
    truth, _ = plain.ideal(room(), pose)
    rng = np.random.default_rng(4)
    scans = np.array([sensor.scan(room(), pose, rng).ranges for _ in range(40)])
    moved = np.abs(scans - truth) > 1e-12

    # The silhouette of the box, whose walls are the last four.
    corners = room().segments[4:, :2] - pose[:2]
    bearings = np.arctan2(corners[:, 1], corners[:, 0]) - pose[2]
    off_edge = np.abs(sensor.angles[:, None] - (bearings.min(), bearings.max()))
    across = (off_edge < divergence / 2).any(axis=1)
    assert across.sum() >= 4
    assert moved.any(axis=0)[across].all()
    assert not moved[:, ~across].any()
    # About half of the ranges across an edge are blends, and they lie between its depths.
    n = 40 * across.sum()
    assert abs(moved[:, across].mean() - 0.5) < SIGMAS * 0.5 / math.sqrt(n)
    for edge in off_edge.T:
        blends = scans[:, edge < divergence / 2]
        depths = truth[edge < divergence]
        assert np.ptp(depths) > 0.5
        assert (blends > depths.min() - 0.05).all()
        assert (blends < depths.max() + 0.05).all()
    np.testing.assert_array_equal(plain.scan(room(), pose, rng).ranges, truth)


def test_nothing_blends_with_no_return():
    sensor = ring_sensor(mixed_pixel=0.02)
    truth, _ = sensor.ideal(CIRCLE, (0, 0, 0))
    scan = sensor.scan(CIRCLE, (0, 0, 0), np.random.default_rng(0))
    np.testing.assert_array_equal(scan.ranges, truth)


def test_scan_has_the_sensor_s_fields():
    sensor = SENSORS["utm30lx"]
    scan = sensor.scan(room(), (0.5, -0.2, 1.0), np.random.default_rng(0), stamp=12.5)
    assert (scan.stamp, scan.pose, scan.frame_id) == (12.5, (0.5, -0.2, 1.0), "laser")
    assert (scan.range_min, scan.range_max, scan.scan_time) == (0.1, 30.0, 0.0)
    swept = sensor.scan(room(), (0.5, -0.2, 1.0), np.random.default_rng(0), 12.5, (0.0, 0.0, 0.0))
    assert (swept.scan_time, swept.time_increment) == (1 / 40, sensor.time_increment)
    np.testing.assert_array_equal(swept.ranges, scan.ranges)
    np.testing.assert_array_equal(scan.angles, sensor.angles)


def test_same_seed_same_scan():
    def ranges(sensor, seed):
        return sensor.scan(room(), (0, 0, 0), np.random.default_rng(seed)).ranges

    sensor = SENSORS["rplidar"]
    np.testing.assert_array_equal(ranges(sensor, 3), ranges(sensor, 3))
    assert (ranges(sensor, 3) != ranges(sensor, 4)).mean() > 0.8
    # The draws of one effect do not shift those of another.
    all_return = ranges(replace(sensor, dropout=0.0), 3)
    some = ranges(sensor, 3)
    np.testing.assert_array_equal(some[some < INF], all_return[some < INF])
    assert (some == INF).any()


@pytest.mark.parametrize(
    ("make", "arguments", "message"),
    [
        (World, ([[0, 0, 1, 0], [1, 2, 1, 2]],), r"segments\[1\] .* no length"),
        (World, ([[0, 0, 1]],), r"segments has shape \(1, 3\)"),
        (World, ([0, 0, 1, 1],), r"segments has shape \(4,\)"),
        (World, ([[0, 0, 1, math.nan]],), "segments holds a value that is not finite"),
        (World, ([["a", 0, 1, 1]],), "segments is no table"),
        (World, ([], [[0, 0, 0]]), r"circles\[0\] has radius 0"),
        (World, ([], [[0, 0, -1]]), r"circles\[0\] has radius -1"),
        (World.of_polygons, ([[(0, 0)]],), r"polygons\[0\] has 1 vert"),
        (World.of_polygons, ([[(0, 0)] * 2],), "no length"),
        (World.of_polygons, ([[(0,) * 3]],), r"polygons\[0\] has shape"),
        *((cast_rays, (WALL, pose, [0]), "pose is ") for pose in ((0, 0), (0, 0, INF))),
        *((cast_rays, (WALL, np.zeros((2, 3)), [0] * n), "pose is array") for n in (1, 3)),
        *((cast_rays, (WALL, (0, 0, 0), angles), "angles have shape") for angles in ([[0]], [INF])),
        (scene, ("cave", 0), "kind is 'cave', expected one of room, star"),
        (scene, ("room", -1), "seed is -1"),
    ],
)
def test_refused(make, arguments, message):
    with pytest.raises(ValueError, match=message):
        make(*arguments)


@pytest.mark.parametrize(
    ("name", "refused", "accepted"),
    [
        *(("n_beams", 0, 1), ("n_beams", 1081, 1080), ("angle_min", math.nan, -9.0)),
        *(("angle_increment", 0.0, 1e-9), ("range_min", -1e-9, 0.0), ("range_max", 0.0, 1e-9)),
        *(("dropout", 1.1, 1.0), ("dropout", -0.1, 0.0), ("outlier", 1.1, 1.0)),
        *(("outlier", -0.1, 0.0), ("mixed_pixel", -1e-3, 0.0), ("mixed_pixel", math.pi, 3.14)),
        *(("range_min", INF, 29.9), ("rate", 0.0, 1e-9), ("rate", INF, 1e9)),
    ],
)
def test_sensor_refuses(name, refused, accepted):
    assert getattr(replace(SENSORS["paper"], **{name: accepted}), name) == accepted
    with pytest.raises(ValueError, match=rf"Sensor\.{name} is "):
        replace(SENSORS["paper"], **{name: refused})


#: Of the data sheets: beams, field of view [°], range limits [m], sweeps a second; then the noise
#: (σ and quantum [m]), and the divergence [rad] and shares of lost and false returns assumed.
SHEETS = {
    "paper": (481, 160, 0, 30, 10, 0.01, 0, 0, 0, 0),
    "noisy": (481, 160, 0, 30, 10, 0.03, 0, 0, 0.02, 0),
    "utm30lx": (1081, 270, 0.1, 30, 40, 0.01, 0.001, 0.004, 0.002, 0.0005),
    "lms361": (361, 180, 0, 80, 37.5, 0.01, 0.01, 0.0044, 0.001, 0.0002),
    "lms181": (181, 180, 0, 80, 75, 0.01, 0.01, 0.0044, 0.001, 0.0002),
    "rplidar": (720, 360, 0.15, 12, 10, 0.002, 0.00025, 0.003, 0.02, 0.002),
    "ld19": (455, 360, 0.02, 12, 10, 0.01, 0.001, 0.006, 0.01, 0.001),
}


def test_scanners_are_those_of_their_data_sheets():
    assert list(SENSORS) == list(SHEETS)
    for name, (beams, field, low, high, rate, sigma, quantum, *shares) in SHEETS.items():
        s = SENSORS[name]
        scan = s.scan(room(), (0, 0, 0), np.random.default_rng(0))
        assert scan.valid.mean() > 0.95
        assert scan.is_full_circle == (field == 360)
        steps = beams if field == 360 else beams - 1
        assert [s.name, len(scan), s.range_min, s.range_max] == [name, beams, low, high]
        assert s.rate == rate
        assert scan.angles[0] == pytest.approx(-np.radians(field) / 2)
        assert s.angle_increment * steps == pytest.approx(np.radians(field))
        assert (s.noise.sigma, s.noise.quantum) == (sigma, quantum)
        assert s.noise.proportional == (0.007 if name == "rplidar" else 0)
        assert [s.mixed_pixel, s.dropout, s.outlier] == shares


#: Sums of products of x, y (and r) over the walls' starts, the columns and the way.
MOMENTS = (
    [[8243.197127212, 3951.313331328], [3951.313331328, 3353.172872788]],
    [[645.995, 297.915, 12.91], [297.915, 256.18, 7.145], [12.91, 7.145, 0.33]],
    [[1293.2675, 621.165], [621.165, 443.29]],
)


def test_the_building_and_the_drive_through_it_are_what_they_were(tmp_path):
    """Every coordinate and angle has a part in these sums."""
    world, way = building()
    moments = [table.T @ table for table in (world.segments[:, :2], world.circles, way)]
    for found, expected in zip(moments, MOMENTS, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9)
    stamps, _ = drive_poses(way)
    assert (len(stamps), stamps[-1]) == (896, 89.5)
    sensor = Sensor("one beam", 1, 0.0, 0.1, noise=RangeNoise(0.01))
    simulate_log(tmp_path / "a.npz", "building", sensor)
    for scans in (list(drive(world, way, sensor)), list(open_log(tmp_path / "a.npz"))):
        assert len(scans) == 896
        first = sensor.scan(world, (*way[0], 0.0), np.random.default_rng([0, 0]))
        np.testing.assert_array_equal(scans[0].ranges, first.ranges)
