"""Odometry by scans: exact without noise, with covariances that hold, and its derivatives."""

import math
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

import lineament as ln
from lineament.motion import Motion, Odometer, Tracker
from lineament.motion.odometry import compose_jacobians, covariance_of_twist
from lineament.scan.poses import compose, relative, twist_between
from lineament.simulation import SENSORS, drive, room
from lineament.simulation.raycast import cast_rays

SPREAD = np.array([[4.0, 1.0, -0.5], [1.0, 2.0, 0.3], [-0.5, 0.3, 1.0]]) * 1e-4
MOTIONS = [(0.3, -0.1, 0.2), (0.2, 0.1, 0.0), (0.5, 0.4, -3.0), (0.0, 0.0, 1e-5), (3, 0.5, 1.6e-4)]


def derivative(function, at):
    columns = [
        (np.array(function(at + offset)) - function(at - offset)) / 2e-6
        for offset in np.eye(len(at)) * 1e-6
    ]
    return np.transpose(columns)


def tracks(motion):
    return SimpleNamespace(motion=motion)


@pytest.mark.parametrize("motion", MOTIONS)
def test_derivatives_are_those_of_differences(motion):
    pose = (1.0, -2.0, 0.7)
    of_pose, of_motion = compose_jacobians(pose, motion)
    found = derivative(lambda at: compose(tuple(at), motion), np.array(pose))
    np.testing.assert_allclose(of_pose, found, atol=1e-8)
    found = derivative(lambda at: compose(pose, tuple(at)), np.array(motion))
    np.testing.assert_allclose(of_motion, found, atol=1e-8)
    by = derivative(lambda at: twist_between((0, 0, 0), tuple(at), 0.1), np.array(motion))
    expected = by @ SPREAD @ by.T
    np.testing.assert_allclose(
        covariance_of_twist(Motion(*motion, SPREAD), 0.1), expected, rtol=1e-6
    )


def test_the_pose_adds_up():
    odometer, truth = Odometer(), (0.0, 0.0, 0.0)
    first = odometer(tracks(None), 5.0)
    assert (first.pose, first.twist) == ((0, 0, 0), (0, 0, 0))
    assert not first.covariance.any()
    np.testing.assert_array_equal(first.twist_covariance, np.eye(3) * 2500)
    for k, motion in enumerate(MOTIONS[:3]):
        travel = odometer(tracks(Motion(*motion, SPREAD)), 5.1 + k / 10)
        truth = compose(truth, motion)
        assert travel.pose == pytest.approx(truth)
        assert travel.twist == pytest.approx(twist_between((0, 0, 0), motion, 0.1))


@pytest.mark.parametrize(("stamp", "moves"), [(5.1, True), (5.0, False), (4.9, False), (5.001, 0)])
def test_stamps_that_give_no_velocity(stamp, moves):
    odometer = Odometer()
    odometer(tracks(None), 5.0)
    travel = odometer(tracks(Motion(0.3, 0.0, 0.0, SPREAD)), stamp)
    assert travel.pose == (0.3, 0.0, 0.0)  # the way is known all the same
    assert (travel.twist != (0, 0, 0)) == bool(moves)
    assert (travel.twist_covariance[0, 0] == 2500) != bool(moves)


def test_a_drive_ends_within_its_covariance():
    """Over 12 drives the errors in units of their covariance are those of χ², or less.

    Less, since two motions share a scan whose errors have opposite signs in them.
    """
    extract, walk = ln.Extractor("optimal"), [(-1.5, -0.5), (0.5, -0.5), (0.5, 0.5)]
    errors, of_twists = [], []
    for seed in range(12):
        scans = list(drive(room(), walk, SENSORS["utm30lx"], speed=1.0, rate=5, seed=seed))
        tracker, odometer = Tracker(roughness=0.0), Odometer()
        for before, scan in zip([None, *scans], scans, strict=False):
            travel = odometer(tracker(extract(scan)), scan.stamp)
            if before is not None:
                off = np.subtract(travel.twist, twist_between(before.pose, scan.pose, 0.2))
                of_twists.append(off @ np.linalg.solve(travel.twist_covariance, off))
        off = np.subtract(travel.pose, relative(scans[0].pose, scan.pose))
        off[2] = math.remainder(off[2], 2 * math.pi)
        errors.append(off @ np.linalg.solve(travel.covariance, off))
    assert np.mean(errors) < 3 + 4 * math.sqrt(6 / len(errors))
    assert 2 < np.mean(of_twists) < 4


@pytest.mark.slow
@pytest.mark.parametrize("sweep", [0.1, math.inf])
def test_the_skew_of_a_sweep_adds_up_and_is_in_the_covariance(sweep):
    """Turning to and fro: what is lost to the left is not won back to the right."""
    sensor, extract = replace(SENSORS["rplidar"], rate=10.0), ln.Extractor()
    walk = [(-1, 0), (0.5, 0), (0.5, 0.7), (-0.5, 0.7), (-0.5, 0), (1, 0), (1, 0.8), (0, 0.8)]
    tracker, (plain, honest) = Tracker(roughness=0.0), (Odometer(), Odometer())
    scans = list(drive(room(), [*walk, *walk[::-1]], sensor, speed=1.0, moving=True, seed=2))
    for scan in scans:
        tracks = tracker(extract(scan))
        known, travel = plain(tracks, scan.stamp), honest(tracks, scan.stamp, sweep)
    off = np.subtract(travel.pose, relative(scans[0].pose, scan.pose))[2]
    off = abs(math.remainder(off, 2 * math.pi))
    turns = [math.remainder(b.pose[2] - a.pose[2], 2 * math.pi) for a, b in pairwise(scans)]
    lost = sum(turn**2 for turn in turns) / (2 * math.pi)
    assert off == pytest.approx(lost, rel=0.3)
    deviation, honestly = (math.sqrt(of.covariance[2, 2]) for of in (known, travel))
    assert off > 4 * deviation
    assert honestly == pytest.approx(math.hypot(deviation, lost), rel=0.2)
    assert travel.pose == known.pose


@pytest.mark.parametrize("deskewed", [False, True])
@pytest.mark.parametrize("sweep", [0.0, 0.5])
def test_covariances_and_what_scans_are_off_by_add_up(sweep, deskewed):
    """Half a circle takes half of the time from scan to scan: each motion is off by its share.

    And by half a sweep at what the twist has changed since the last one, or the change itself has,
    if the scan is deskewed by the twist before.
    """
    odometer, pose = Odometer(), (0.0, 0.0, 0.0)
    odometer(tracks(None), 5.0)
    spread, skews = np.zeros((3, 3)), np.zeros((2, 3))
    twists = [np.array(twist_between((0, 0, 0), motion, 1.0)) for motion in MOTIONS[:3]]
    if deskewed:
        twists = np.diff([np.zeros(3), *twists], axis=0)
    changes = np.diff([np.zeros(3) if deskewed else twists[0], *twists], axis=0)
    for k, (motion, change) in enumerate(zip(MOTIONS[:3], changes, strict=True), 1):
        travel = odometer(tracks(Motion(*motion, SPREAD)), 5.0 + k, sweep=sweep, deskewed=deskewed)
        of_pose, of_motion = compose_jacobians(pose, motion)
        spread = of_pose @ spread @ of_pose.T + of_motion @ SPREAD @ of_motion.T
        new = np.array((change * sweep / 2, np.array(motion) * motion[2] * sweep / (2 * math.pi)))
        new[1] *= not deskewed
        skews = skews @ of_pose.T + new @ of_motion.T
        pose = compose(pose, motion)
        np.testing.assert_allclose(travel.covariance, spread + skews.T @ skews, rtol=1e-9)
        by_walls = covariance_of_twist(Motion(*motion, SPREAD), 1.0)
        np.testing.assert_allclose(travel.twist_covariance, by_walls + new.T @ new, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("deskewed", [False, True])
def test_the_twist_is_as_well_known_as_it_says_where_it_changes(deskewed):
    """A sensor that turns to and fro, 0.8 rad/s within a second, with scans of a tenth of one."""
    tracker, odometer, extract = Tracker(), Odometer(), ln.Extractor()
    angles, errors, before = np.linspace(-math.pi, math.pi, 360, endpoint=False), [], None
    rng = np.random.default_rng(4)
    for k in range(60):
        at = 0.1 * k
        times = at + (angles + math.pi) / (20 * math.pi)
        turns = (1 - np.cos(math.pi / 2 * times)) * 1.6 / math.pi
        poses = np.column_stack((-1.0 + 0.2 * times, np.full(360, 0.3), turns))
        ranges, _ = cast_rays(room(), poses, angles)
        ranges += 0.005 * rng.standard_normal(360)
        scan = ln.LaserScan(ranges, angles=angles, stamp=at, scan_time=0.1)
        straight = ln.deskew(scan, tracker.twist) if deskewed else scan
        travel = odometer(tracker(extract(straight)), at, 0.1, deskewed=deskewed)
        if k > 3:
            off = np.subtract(travel.twist, twist_between(before, tuple(poses[0]), 0.1))
            errors.append(off @ np.linalg.solve(travel.twist_covariance, off) / 3)
        before = tuple(poses[0])
    assert 0.5 < np.mean(errors) < 1.0


def test_a_sweep_that_is_no_time_is_refused():
    for sweep in (math.nan, -0.1):
        with pytest.raises(ValueError, match=f"sweep is {sweep}, expected a time ≥ 0"):
            Odometer()(tracks(None), 0.0, sweep)


def test_stamps_that_are_no_time_are_refused_and_far_ones_are_not():
    odometer, moving = Odometer(), tracks(Motion(0.1, 0.0, 0.1, SPREAD))
    odometer(moving, 0.0)
    with pytest.raises(ValueError, match="stamp is nan, expected a finite number"):
        odometer(moving, math.nan)
    travel = odometer(moving, 1e300, math.inf)
    assert travel.pose[2] == pytest.approx(0.2)
    assert np.isfinite(travel.twist_covariance).all()
