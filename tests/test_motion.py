"""Poses and twists, sensors that move while they sweep, drives: by hand, by what must hold."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from worlds import drum, ring_sensor

from lineament.scan.poses import compose, inverse, poses_along, relative, twist_between
from lineament.simulation import SENSORS, building, cast_rays, drive, drive_poses, room
from lineament.simulation.placing import clearance

INF = math.inf
lengths = st.floats(-20, 20)
poses = st.tuples(lengths, lengths, st.floats(-3, 3))


def matrix(pose):
    """Homogeneous matrix of a pose."""
    x, y, theta = pose
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s, x], [s, c, y], [0, 0, 1]])


@given(poses, poses)
def test_poses_are_composed_as_their_matrices(pose, motion):
    composed = compose(pose, motion)
    assert abs(composed[2]) <= math.pi
    np.testing.assert_allclose(matrix(composed), matrix(pose) @ matrix(motion), atol=1e-9)
    np.testing.assert_allclose(matrix(inverse(pose)) @ matrix(pose), np.eye(3), atol=1e-9)
    np.testing.assert_allclose(relative(pose, composed), motion, atol=1e-9)


@given(poses, st.floats(-2, 2).filter(lambda t: abs(t) > 0.01))
def test_a_twist_leads_to_the_other_pose(motion, duration):
    start = (1.0, -2.0, 0.7)
    twist = twist_between(start, compose(start, motion), duration)
    np.testing.assert_allclose(poses_along(twist, [duration])[0], motion, atol=1e-6)


def test_poses_refused():
    for pose, duration, message in (
        ((1, 0, 0), 0, "duration is 0, expected"),
        ((math.nan, 0, 0), 1.0, r"poses are .*, expected finite"),
    ):
        with pytest.raises(ValueError, match=message):
            twist_between((0, 0, 0), pose, duration)
    for twist in ((1.0, 2.0), (1.0, INF, 0.0)):
        with pytest.raises(ValueError, match=r"twist is .*, expected three finite numbers"):
            SENSORS["paper"].sweep((0, 0, 0), twist)


# Sweeps


def test_a_sweep_is_the_sum_of_small_steps():
    sensor, twist = ring_sensor(200, rate=1.0), np.array([0.7, -0.4, 1.9])
    assert sensor.time_increment == pytest.approx(0.005)
    x, y, theta = 0.3, -0.2, 2.0
    n = 400
    for _ in range(199 * n):
        dt = sensor.time_increment / n
        middle = theta + twist[2] * dt / 2
        x += dt * (twist[0] * math.cos(middle) - twist[1] * math.sin(middle))
        y += dt * (twist[0] * math.sin(middle) + twist[1] * math.cos(middle))
        theta += twist[2] * dt
    last = sensor.sweep((0.3, -0.2, 2.0), tuple(twist))[-1]
    np.testing.assert_allclose(last, (x, y, theta), atol=1e-8)


def test_ranges_are_those_from_where_each_beam_was_taken():
    sensor, twist = ring_sensor(300, rate=5.0), (1.5, 0.3, -2.0)
    pose = (-1.0, 0.5, 0.7)
    scan = sensor.scan(room(), pose, np.random.default_rng(0), stamp=3.0, twist=twist)
    expected, _ = cast_rays(room(), sensor.sweep(pose, twist), sensor.angles)
    np.testing.assert_array_equal(scan.ranges, expected)
    assert (scan.pose, scan.stamp) == (pose, 3.0)
    assert scan.scan_time == pytest.approx(300 * scan.time_increment)
    still = sensor.scan(room(), pose, np.random.default_rng(0))
    assert scan.ranges[0] == still.ranges[0]
    assert np.abs(scan.ranges - still.ranges).max() > 0.1


def test_a_sensor_at_rest_draws_the_same_numbers():
    sensor = SENSORS["rplidar"]
    still, creeping = (
        sensor.scan(room(), (0, 0, 0), np.random.default_rng(3), twist=(v, 0.0, 0.0)).ranges
        for v in (0.0, 1e-15)
    )
    np.testing.assert_allclose(still, creeping, atol=1e-9)


# Drives


def test_building_drive_is_free_of_collisions_and_passes_the_waypoints():
    world, waypoints = building()
    stamps, poses = drive_poses(waypoints, speed=0.6, rate=20)
    assert clearance(world, poses[:, :2]).min() > 0.25
    step = 0.6 / 20
    for waypoint in waypoints:
        assert np.hypot(*(poses[:, :2] - waypoint).T).min() <= step / 2 + 1e-9
    assert np.hypot(*np.diff(poses[:, :2], axis=0).T).max() <= step + 1e-9
    turns = np.abs(np.angle(np.exp(1j * np.diff(poses[:, 2]))))
    assert turns.max() <= 1.0 / 20 + 1e-9
    np.testing.assert_allclose(np.diff(stamps), 1 / 20)


def test_poses_by_hand():
    # 2 m at 0.5 m/s, a right turn of 90° at 45°/s, 1 m.
    waypoints = [(0, 0), (0, 2), (0, 2), (1, 2)]
    stamps, poses = drive_poses(waypoints, speed=0.5, turn_rate=math.pi / 4, rate=1)
    assert stamps.tolist() == list(range(9))
    north, half = math.pi / 2, math.pi / 4
    expected = [(0, 0, north), (0, 0.5, north), (0, 1, north), (0, 1.5, north), (0, 2, north),
                (0, 2, half), (0, 2, 0), (0.5, 2, 0), (1, 2, 0)]  # fmt: skip
    np.testing.assert_allclose(poses, expected, atol=1e-12)


def test_turns_go_the_short_way_and_headings_are_wrapped():
    # From heading 153° to -153°: 53° through west, not 306° through east.
    stamps, poses = drive_poses([(0, 0), (-2, 1), (-4, 0)], speed=100, turn_rate=0.1, rate=10)
    assert stamps[-1] == pytest.approx(2 * math.atan(0.5) / 0.1, abs=0.2)
    assert (np.abs(poses[:, 2]) >= math.pi - math.atan(0.5) - 1e-9).all()
    assert (poses[:, 2] <= math.pi).all()
    assert (poses[:, 2] < 0).any()


@pytest.mark.parametrize(
    ("waypoints", "settings"),
    [
        *((way, {}) for way in ([(0, 0)], [(1, 1)] * 2, [(0,) * 3, (1,) * 3], [(0, 0), (1, INF)])),
        *(([(0, 0), (1, 0)], {"speed": 0}), ([(0, 0), (1, 0)], {"turn_rate": -1})),
        *(([(0, 0), (1, 0)], {"rate": math.nan}), ([(0, 0), (1, 0)], {"seed": -1})),
    ],
)
def test_drive_refuses_at_once(waypoints, settings):
    with pytest.raises(ValueError, match=r"waypoints|expected"):
        drive(room(), waypoints, SENSORS["paper"], **settings)


def test_drive_has_the_stamps_and_poses_that_were_promised_and_stands_still_for_its_scans():
    way, sensor = [(-2, 0), (0, 0), (0, 1)], ring_sensor(60)
    scans = list(drive(room(), way, sensor, speed=0.5, rate=2))
    stamps, poses = drive_poses(way, speed=0.5, rate=2)
    assert [scan.stamp for scan in scans] == stamps.tolist()
    assert [scan.pose for scan in scans] == [tuple(pose) for pose in poses.tolist()]
    for scan in scans:
        np.testing.assert_array_equal(scan.ranges, sensor.ideal(room(), scan.pose)[0])
    n_default = sum(1 for _ in drive(room(), way, SENSORS["lms361"], speed=2))
    assert n_default == len(drive_poses(way, speed=2, rate=37.5)[0])


def test_drive_is_determined_by_its_seed():
    def ranges(seed, way):
        scans = drive(room(), way, SENSORS["ld19"], seed=seed, rate=2)
        return np.array([scan.ranges for scan in scans])

    way = [(-2, 0), (0, 0)]
    first = ranges(1, way)
    np.testing.assert_array_equal(first, ranges(1, way))
    assert (first != ranges(2, way)).any(axis=1).all()
    # The same start gives the same scans, whatever follows.
    longer = ranges(1, [*way, (0, 1)])
    np.testing.assert_array_equal(longer[: len(first)], first)


def test_a_drive_moves_with_its_own_velocity():
    # 2 m at 0.5 m/s, a right turn of 90° at 45°/s, 1 m: as in test_poses_by_hand.
    way, quarter = [(0, 0), (0, 2), (1, 2)], math.pi / 4
    sensor = ring_sensor(60)
    scans = list(drive(drum(9), way, sensor, speed=0.5, turn_rate=quarter, rate=1, moving=True))
    twists = [(0.5, 0, 0)] * 4 + [(0, 0, -quarter)] * 2 + [(0.5, 0, 0)] * 2 + [(0, 0, 0)]
    for scan, twist in zip(scans, twists, strict=True):
        expected, _ = cast_rays(drum(9), sensor.sweep(scan.pose, twist), sensor.angles)
        np.testing.assert_allclose(scan.ranges, expected)
