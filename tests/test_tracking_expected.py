"""What a tracker expects of the next frame: by odometry, by going on as it did, after a pause."""

import math
from dataclasses import replace

import numpy as np
import pytest
from handmade import corner, features, segment

from lineament import LaserScan, Tracker
from lineament.motion.deskew import beam_times

#: An L of two walls and their corner, and a wall far from them.
KNOWN = {"sigma": (1e-4, 1e-4)}
WALLS = [segment((-2, -1), (3, -1), 0, 9, **KNOWN), segment((3, -1), (3, 4), 10, 19, **KNOWN)]
WALLS += [segment((-4, 5), (-4, -3), 30, 39, **KNOWN)]


def frame(stamp, pose=(0.0, 0.0, 0.0)):
    seen = features(60, WALLS, [corner(3, -1, segments=(0, 1))])
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y = -c * pose[0] - s * pose[1], s * pose[0] - c * pose[1]
    return replace(seen.transform(x, y, -pose[2]), stamp=stamp)


def moving(step, pace, count=4, odometry=None):
    tracker = Tracker(roughness=0.0)
    for k in range(count):
        tracks = tracker(frame(pace * k, k * np.array(step)), odometry)
    np.testing.assert_allclose(tracks.motion.pose, step, atol=1e-4)
    return tracker


@pytest.mark.parametrize(
    ("duration", "way", "turn"),
    [
        (0.1, 0.1 + 0.5 * 0.05, 0.1),
        (0.2, 0.1 + 0.5 * 0.1, 0.1),
        (1.0, 0.1 + 0.5 * 0.5, 0.1),
        # It may stand or go on at 0.5 m/s and 0.5 rad/s, after a second.
        (3.0, 0.1 + 0.5 * 0.5 + 0.5 * 2, 0.1 + 0.5 * 2),
        (9.0, 0.1 + 0.5 * 0.5 + 0.5 * 8, math.pi),
        # A clock that goes back says nothing of the motion.
        (-3.0, 0.1 + 0.5 * 2, 0.1 + 0.5 * 2),
        (-0.5, 0.1, 0.1),
    ],
)
def test_a_motion_goes_on_for_a_second(duration, way, turn):
    """By 0.05 m each 0.1 s, to 10 cm, 0.1 rad, and half of it."""
    tracker = moving((0.05, 0.0, 0.0), 0.1)
    pose, deviations = tracker._expected(None, duration)
    step = 0.5 * min(duration, 1.0) if duration > 0 else 0.0
    np.testing.assert_allclose(pose, (step, 0.0, 0.0), atol=1e-3)
    np.testing.assert_allclose(deviations, (way, way, turn), atol=1e-3)


def test_a_turn_goes_on_too():
    pose, deviations = moving((0.0, 0.0, 0.04), 0.1)._expected(None, 0.2)
    np.testing.assert_allclose(pose, (0.0, 0.0, 0.08), atol=1e-3)
    np.testing.assert_allclose(deviations, (0.1, 0.1, 0.1 + 0.5 * 0.08), atol=1e-3)


def test_odometry_is_expected_to_3_cm_10_mrad_and_a_tenth():
    tracker = moving((0.0, 0.0, 0.0), 0.1, odometry=(7.0, 1.0, math.pi / 2))
    pose, deviations = tracker._expected((7.0, 1.4, math.pi / 2 - 0.3), 5.0)
    np.testing.assert_allclose(pose, (0.4, 0.0, -0.3), atol=1e-9)
    np.testing.assert_allclose(deviations, (0.03 + 0.04, 0.03 + 0.04, 0.01 + 0.03), atol=1e-9)


@pytest.mark.parametrize(
    ("duration", "way", "turn"),
    [(0.1, 0.1 + 0.5 * 0.05, 0.1), (9.0, 0.1 + 0.25 + 0.5 * 8, math.pi)],
)
def test_where_nothing_is_seen_the_motion_is_known_as_it_was_expected(duration, way, turn):
    tracker = moving((0.05, 0.0, 0.0), 0.1)
    motion = tracker(replace(features(60), stamp=0.3 + duration)).motion
    assert len(motion.unobserved) == 3
    np.testing.assert_allclose(motion.pose, (0.5 * min(duration, 1.0), 0.0, 0.0), atol=1e-3)
    spread = np.diag((way, way, turn)) ** 2
    np.testing.assert_allclose(motion.covariance, spread, rtol=1e-2, atol=1e-9)


def test_the_twist_is_the_mean_of_the_last_two_motions():
    tracker = Tracker()
    assert tracker.twist is None
    for stamp, x in ((0.0, 0.0), (0.1, 0.02), (0.2, 0.06), (0.3, 0.14)):
        tracker(frame(stamp, (x, 0.0, 0.0)))
    assert tracker.twist == pytest.approx(((0.4 + 0.8) / 2, 0.0, 0.0), abs=1e-3)


@pytest.mark.parametrize(("duration", "is_known"), [(0.0021, True), (0.0019, False)])
def test_a_speed_of_more_than_50_metres_a_second_is_of_a_wrong_stamp(duration, is_known):
    """10 cm in 2.1 ms and in 1.9 ms: 48 and 53 m/s. The way is known all the same."""
    tracker = Tracker(roughness=0.0)
    tracker(frame(0.0))
    tracks = tracker(frame(duration, (0.1, 0.0, 0.0)))
    np.testing.assert_allclose(tracks.motion.pose, (0.1, 0.0, 0.0), atol=1e-3)
    assert (tracker.twist is not None) == is_known


def test_beams_are_timed_from_the_one_whose_time_the_stamp_is():
    """Between beams, and outside of them; of regular bearings and others."""
    regular = LaserScan([1.0] * 5, -0.2, 0.1, scan_time=2 * math.pi)
    for beam in (0, 2, 2.5, 4, -1, 6):
        times = beam_times(regular.stamped(beam))
        np.testing.assert_allclose(times, 0.1 * (np.arange(5) - beam), atol=1e-12)
    others = LaserScan([1.0] * 3, angles=[0.0, 0.3, 0.4], scan_time=2 * math.pi)
    for beam, bearing in ((0, 0.0), (1, 0.3), (1.5, 0.35), (2, 0.4)):
        times = beam_times(others.stamped(beam))
        np.testing.assert_allclose(times, np.array((0.0, 0.3, 0.4)) - bearing, atol=1e-12)
    for beam in (-1, 3):  # outside, by the mean step
        times = beam_times(others.stamped(beam))
        np.testing.assert_allclose(times, np.array((0.0, 0.3, 0.4)) - 0.2 * beam, atol=1e-12)
    each = LaserScan([1.0] * 3, 0.0, 0.1, time_increment=0.01, scan_time=9.0)
    np.testing.assert_allclose(beam_times(each), (0.0, 0.01, 0.02), atol=1e-12)
    np.testing.assert_allclose(beam_times(each.stamped("last")), (-0.02, -0.01, 0.0), atol=1e-12)
