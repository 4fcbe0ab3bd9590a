"""Mounting and wheels by motions: by hand, what a drive does not show, slips, whole logs."""

import json
import math
import re

import numpy as np
import pytest
import ros_bags

from lineament.cli import run
from lineament.errors import LineamentError
from lineament.logs import save_npz
from lineament.motion import Motion, calibrate
from lineament.motion.mounting import Model
from lineament.scan.poses import compose, inverse, poses_along, twist_between
from lineament.simulation import SENSORS, drive, drive_poses, room
from lineament.tasks import calibrate as task
from lineament.tasks.calibrate import calibrate_log

SPREAD = np.diag((2e-3, 2e-3, 1e-3)) ** 2
MOUNTING = (0.25, -0.08, 0.3)
#: Way and turn of steps: ahead, turns on the spot to either side, an arc.
AHEAD, LEFT, RIGHT, ARC = (0.3, 0.0), (0.0, 0.35), (0.0, -0.35), (0.3, 0.2)
SHAPES = [AHEAD, AHEAD, LEFT, ARC, RIGHT, LEFT] * 6


def seen(step, mounting=MOUNTING):
    """Motion of a scanner on a robot that makes a step."""
    return compose(inverse(mounting), compose(tuple(step), mounting))


def drive_of(shapes, counts=(1.0, 1.0), track=0.4, noise=(0, 0, 0), seed=0):
    """Odometry, of a track of 0.4 m, and motions of steps, by wheels that count so much."""
    rng, odometry, motions = np.random.default_rng(seed), [], []
    for way, turn in shapes:
        left = (way - track / 2 * turn) * counts[0]
        right = (way + track / 2 * turn) * counts[1]
        size = max(abs(way), track / 2 * abs(turn))
        twist = np.array([(left + right) / 2, 0.0, (right - left) / 0.4])
        twist += rng.standard_normal(3) * np.sqrt(size) * noise
        odometry.append(poses_along(tuple(twist.tolist()), [0.0, 1.0]))
        step = seen(poses_along((way, 0.0, turn), [1.0])[0].tolist())
        off = rng.standard_normal(3) * np.sqrt(np.diag(SPREAD)) * (max(noise) > 0)
        motions.append(Motion(*(np.array(step) + off).tolist(), SPREAD))
    return odometry, motions


def test_mounting_radii_and_track_are_exact_without_noise():
    odometry, motions = drive_of(SHAPES, (1.01, 0.98), track=0.42)
    found = calibrate(odometry, motions, track=0.4)
    assert found.names == ("x", "y", "theta", "left", "right", "track")
    expected = (*MOUNTING, 1 / 1.01, 1 / 0.98, 0.42)
    np.testing.assert_allclose(list(found.values.values()), expected, atol=1e-5)
    assert not found.is_slip.any()
    assert not found.unknown
    np.testing.assert_allclose(found.mounting, MOUNTING, atol=1e-5)


def test_without_a_track_ways_and_turns_have_scales():
    odometry, motions = drive_of(SHAPES, (1.02, 1.02), track=0.42)
    found = calibrate(odometry, motions)
    scales = [found.values[name] for name in ("way", "turn", "drift")]
    # Ticks of 1.02 of the way; turns by a track that is too small.
    np.testing.assert_allclose(scales, (1 / 1.02, 0.4 / 0.42 / 1.02, 0.0), atol=1e-5)


def test_a_mounting_that_looks_back_is_found():
    shapes, mounting = SHAPES, (-0.3, 0.1, 3.0)
    odometry, _ = drive_of(shapes)
    motions = [Motion(*seen(way[1].tolist(), mounting), SPREAD) for way in odometry]
    found = calibrate(odometry, motions, wheels=False)
    assert found.names == ("x", "y", "theta")
    np.testing.assert_allclose(found.mounting, mounting, atol=1e-5)


@pytest.mark.slow
def test_errors_are_as_large_as_the_deviations_say():
    squares = []
    for seed in range(30):
        given = drive_of(SHAPES * 2, noise=(4e-3, 1e-3, 0.02), seed=seed)
        found = calibrate(*given, track=0.4)
        error = np.array(list(found.values.values())) - (*MOUNTING, 1.0, 1.0, 0.4)
        squares.append(error @ np.linalg.solve(found.covariance, error) / 6)
    assert 0.75 < np.mean(squares) < 1.3


def test_a_robot_that_slides_to_one_side_for_a_while_is_not_surer_for_it():
    """Pieces of the drive disagree about theta, not about ways and turns, which stay as sure."""
    squares, widened = [], []
    for seed in range(30):
        odometry, motions = drive_of(SHAPES * 10, noise=(4e-3, 1e-3, 0.02), seed=seed)
        even = calibrate(odometry, motions).deviations
        slides = np.random.default_rng([seed, 1]).normal(0.0, 0.03, 36)
        for k, way in enumerate(odometry):
            way[1][1] += slides[k // 10] * way[1][0]
        found = calibrate(odometry, motions)
        squares.append(((found.values["theta"] - MOUNTING[2]) / found.deviations["theta"]) ** 2)
        widened.append([found.deviations[name] / even[name] for name in found.names])
    assert 0.5 < np.mean(squares) < 1.8
    by_name = np.median(widened, axis=0)
    assert by_name[2] > 5
    assert (by_name[3:] < 1.1).all()


@pytest.mark.parametrize(
    ("shapes", "unknown"),
    [
        ([AHEAD] * 40, {"x", "y", "turn"}),
        ([LEFT, RIGHT] * 20, {"theta", "way", "drift"}),
        # On one circle, a wheel that is larger is a turn that counts more.
        ([ARC] * 40, {"turn", "drift"}),
    ],
)
def test_what_a_drive_does_not_show_has_no_number(shapes, unknown):
    found = calibrate(*drive_of(shapes, noise=(2e-3, 5e-4, 5e-3)))
    assert unknown <= set(found.unknown)
    assert not set(found.unknown) & set(found.values)
    assert len(found.covariance) == len(found.values) == 6 - len(found.unknown)
    assert all("hardly" in why or "only" in why for why in found.unknown.values())


def test_deviations_have_units():
    units = {"x": " m", "y": " m", "theta": " rad", "way": "", "turn": "", "drift": " rad/m"}
    found = calibrate(*drive_of([ARC] * 40, noise=(2e-3, 5e-4, 5e-3)))
    assert set(found.unknown) == set(units)
    for name, why in found.unknown.items():
        assert re.fullmatch(rf"the drive shows it to ± [\d.]+{units[name]} only", why)


def test_without_turns_the_radii_are_known_and_the_track_is_not():
    found = calibrate(*drive_of([AHEAD] * 60, noise=(2e-3, 5e-4, 5e-3)), track=0.4)
    assert set(found.unknown) == {"x", "y", "track"}
    assert found.mounting is None
    assert found.values["left"] == pytest.approx(1.0, abs=0.005)


def test_slips_are_left_out():
    odometry, motions = drive_of(SHAPES, noise=(1e-3, 5e-4, 3e-3))
    for k in (3, 9, 17, 30):
        odometry[k][1] += (0.04, 0.0, 0.2)
    found = calibrate(odometry, motions, track=0.4)
    assert set(np.flatnonzero(found.is_slip)) >= {3, 9, 17, 30}
    assert found.is_slip.sum() <= 6
    np.testing.assert_allclose(found.mounting, MOUNTING, atol=0.004)
    assert found.values["track"] == pytest.approx(0.4, rel=0.01)


def test_odometry_that_does_not_belong_is_refused():
    odometry, motions = drive_of(SHAPES, noise=(1e-3, 5e-4, 3e-3))
    rng = np.random.default_rng(3)
    for given, count, problem in (
        ([odometry[k] for k in rng.permutation(len(odometry))], 36, "another robot"),
        ([way * (1000, 1000, 1) for way in odometry], 36, "in other units"),
        ([0 * way for way in odometry], 36, "stands still while"),
        (odometry[:7], 7, "7 motions, expected at least 8"),
        (odometry[:3], 36, "odometry has 3 steps, expected 36"),
        ([odometry[0] * math.nan, *odometry[1:]], 36, r"a step of .*nan"),
    ):
        with pytest.raises(ValueError, match=problem):
            calibrate(given, motions[:count])
    with pytest.raises(ValueError, match="track is -1"):
        calibrate(odometry, motions, track=-1.0)


def test_slopes_of_the_prediction_are_its_differences():
    odometry, motions = drive_of([AHEAD, ARC, LEFT])
    model = Model.of(odometry, motions, track=0.4)
    model.values[:] = 0.3, -0.1, 0.4, 1.02, 0.97, 0.03
    _, slopes, by_sensor = model.predicted()
    for k in range(6):
        model.values[k] += 1e-6
        more = model.predicted()[0]
        model.values[k] -= 2e-6
        less = model.predicted()[0]
        model.values[k] += 1e-6
        np.testing.assert_allclose((more - less) / 2e-6, slopes[:, :, k], atol=1e-7)
    before = model.predicted()[0]
    for k in range(3):
        model.sensor[:, k] += 1e-6
        np.testing.assert_allclose(
            (model.predicted()[0] - before)[0] / 1e-6, by_sensor[:, k], atol=1e-7
        )
        model.sensor[:, k] -= 1e-6


def test_noise_of_a_step_is_that_of_many_like_it():
    """A turn, and then a way: what the turn is off by leads aside, as noise drawn by hand does."""
    rng, n = np.random.default_rng(5), 20
    turns, ways = np.repeat((0.35, 0.0), n) / n, np.repeat((0.0, 0.3), n) / n
    size = np.maximum(ways, 0.2 * turns)
    drawn = []
    for _ in range(1000):
        pose, noise = (0.0, 0.0, 0.0), rng.standard_normal((2, 2 * n)) * np.sqrt(size) * 0.02
        for way, turn in zip(ways + noise[0], turns + noise[1], strict=True):
            pose = compose(pose, tuple(poses_along((way, 0.0, turn), [1.0])[0].tolist()))
        drawn.append(twist_between((0.0, 0.0, 0.0), pose, 1.0))
    poses = [(0.0, 0.0, 0.0), (0.0, 0.0, 0.35), (0.3 * math.cos(0.35), 0.3 * math.sin(0.35), 0.35)]
    model = Model.of([np.array(poses)], [Motion(0.0, 0.0, 0.0, SPREAD)], track=0.4)
    expected = 0.02**2 * (model.walks[0, 0] + model.walks[2, 0])
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(np.cov(np.transpose(drawn)) / scale, expected / scale, atol=0.16)


# Logs


WAY = [(-2, -1), (2, -1), (2, 1), (-2, 1), (-2, -0.5), (1.5, -0.5)]


@pytest.fixture(scope="module")
def scans():
    """Scans with the poses of a robot that carries the scanner 0.3 m behind its axle."""
    taken = drive(room(), WAY, SENSORS["lms181"], speed=1.0, rate=8)
    return [scan.with_pose(compose(scan.pose, (0.3, 0.0, 0.0))) for scan in taken]


def test_a_log_gives_the_option_to_paste(scans, tmp_path, capsys, monkeypatch):
    log, picture, done = str(tmp_path / "log.npz"), tmp_path / "left.png", []
    save_npz(log, scans)

    def once(*given, **options):
        done.append(done[0] if done else calibrate_log(*given, **options))
        return done[-1]

    monkeypatch.setattr(task, "calibrate_log", once)
    assert run(["calibrate", log, "--no-deskew", "--track", "0.5", "-o", str(picture)]) == 0
    text = capsys.readouterr().out
    assert "--laser-pose -0." in text
    assert "left wheel, times" in text
    assert picture.stat().st_size > 10_000
    assert run(["calibrate", log, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    np.testing.assert_allclose(found["laser_pose"], (-0.3, 0.0, 0.0), atol=0.01)
    assert found["values"].keys() == found["deviations"].keys()


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda scan: scan.with_pose(None), "has no poses, expected odometry"),
        (lambda scan: scan.stamped("first", 5 * 10**9), "all stamps are 5.0, expected stamps that"),
        (lambda scan: scan.with_pose((1.0, 2.0, 0.0)), "stands still while the"),
    ],
)
def test_logs_that_cannot_be_used_are_one_line(scans, tmp_path, change, problem):
    save_npz(tmp_path / "log.npz", map(change, scans))
    with pytest.raises(LineamentError, match=problem):
        calibrate_log(tmp_path / "log.npz", deskewed=False)


def test_a_clock_that_is_set_back_changes_no_way(scans, tmp_path):
    ways = []
    for back in (0, 5 * 10**9):
        set_back = (scan.stamped("first", scan.stamp_ns - back) for scan in scans[60:])
        save_npz(tmp_path / "log.npz", [*scans[:60], *set_back])
        ways.append(calibrate_log(tmp_path / "log.npz", deskewed=False).way)
    assert ways[1] == pytest.approx(ways[0])


def test_a_scanner_that_stands_is_one_line(scans, tmp_path, refused):
    stands = [scans[0].stamped("first", k * 10**8) for k in range(10)]
    save_npz(tmp_path / "log.npz", stands)
    command = f"calibrate {tmp_path / 'log.npz'}"
    assert "moves too little: 0 steps" in refused(command)
    assert "is what calibrate finds" in refused(f"{command} --laser-pose 0 0 0", 2)
    assert "--track" in refused(f"{command} --track 400", 2)  # That of 40 cm in millimetres.


@pytest.mark.parametrize(("mounting", "same"), [((-0.4, 0.2, 2.0), False), ((0.1, 0.2, 0.4), True)])
def test_one_scanner_against_another_by_motions_and_shared_walls(
    tmp_path, capsys, refused, mounting, same
):
    messages, sensor, items = ros_bags.Messages(2), SENSORS["lms181"], []
    stamps, poses = drive_poses(WAY, 1.0, 1.0, 8.0)
    for i, (stamp, pose) in enumerate(zip(stamps.tolist(), poses.tolist(), strict=True)):
        for topic, at in (("/front", tuple(pose)), ("/rear", compose(tuple(pose), mounting))):
            rng = np.random.default_rng([i, topic == "/rear"])
            ranges = sensor.scan(room(), at, rng).ranges
            fields = {"angle_min": sensor.angle_min, "angle_increment": sensor.angle_increment}
            scan = messages.scan(stamp, ranges, frame=topic[1:], scan_time=0.0, **fields)
            items.append((topic, int(stamp * 1e9), scan))
    log = str(ros_bags.write(tmp_path, "mcap", items))
    given = ["calibrate", log, "--against", "/front"]
    assert run([*given, "--topic", "/rear", "--json", "-q"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["values"].keys() == {"x", "y", "theta"}
    error = np.array(found["laser_pose"]) - mounting
    near = (0.004, 0.004, 0.002) if same else (0.02, 0.02, 0.01)

    assert (abs(error) < near).all(), error
    assert error @ np.linalg.solve(found["covariance"], error) < 16
    assert found["shared"] > 20 * same
    assert "expected --topic, too" in refused(given, 2)
    assert "is the scanner itself" in refused([*given, "--topic", "/front"])
