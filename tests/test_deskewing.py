"""Deskewing: by hand, against a standing sensor, and what must hold of any scan."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from worlds import ring_sensor

import lineament as ln
from lineament.motion.deskew import _bearing
from lineament.scan import RangeNoise
from lineament.simulation import SENSORS, cast_rays, room
from lineament.simulation.placing import clearance

NAN, MOVING = math.nan, (1.0, 2.0, 3.0)
QUIET = replace(SENSORS["utm30lx"], noise=RangeNoise(), mixed_pixel=0.0, outlier=0.0, rate=10.0)


@pytest.mark.parametrize(
    ("ranges", "increment", "twist"),
    [
        *(([1.0, 2.0], 0.1, still) for still in (None, (0.0, 0.0, 0.0))),
        *(([1.0, 2.0], 0.0, MOVING), ([NAN, 0.0], 0.1, MOVING), ([], 0.1, MOVING)),
    ],
)
def test_without_motion_times_or_measurements_the_scan_is_itself(ranges, increment, twist):
    scan = ln.LaserScan(ranges, 0.0, 0.1, time_increment=increment)
    assert ln.deskew(scan, twist) is scan


def test_a_turn_by_hand():
    # Turning left at 0.5 rad/s, a beam each 0.1 s: each is 0.05 rad farther to the left.
    scan = ln.LaserScan(
        [1.0, NAN, 3.0], 0.0, 0.1, time_increment=0.1, stamp=7.0, frame_id="laser",
        intensities=[5, 6, 7], range_max=9.0, pose=(1, 2, 3),
    )  # fmt: skip
    still = ln.deskew(scan, (0.0, 0.0, 0.5))
    np.testing.assert_allclose(still.angles, [0.0, 0.15, 0.3])
    np.testing.assert_array_equal(still.ranges, scan.ranges)
    assert (still.stamp, still.frame_id, still.pose) == (7.0, "laser", (1, 2, 3))
    assert (still.range_max, still.scan_time, still.time_increment) == (9.0, 0.0, 0.0)
    assert (still.stamp_beam, ln.deskew(scan.stamped("last"), (0, 0, 0.5)).stamp_beam) == (0, 0)
    assert still.intensities.tolist() == [5, 6, 7]
    assert ln.deskew(still, (0.0, 0.0, 0.5)) is still
    # More than half a turn, at 2 rad/s with a beam each second: the bearings go on.
    turned = ln.deskew(ln.LaserScan([1.0] * 3, 0.0, 0.1, time_increment=1.0), (0.0, 0.0, 2.0))
    np.testing.assert_allclose(turned.angles, [0.0, 2.1, 4.2], atol=1e-8)
    # As fast to the right as the beams go to the left: all are straight ahead, one after the other.
    ahead = ln.deskew(ln.LaserScan([1.0, 2.0, 3.0], 0.0, 0.1, time_increment=0.1), (0, 0, -1.0))
    np.testing.assert_allclose(ahead.angles, 0.0, atol=1e-8)
    assert (np.diff(ahead.angles) > 1e-10).all()


def test_points_are_where_they_were_at_the_stamp():
    for twist in ((2.0, 0.0, 3.0), (1.0, -0.5, -1.5), (0.0, 0.0, -4.0)):
        pose = (0.0, 1.0, 0.0)
        scan = QUIET.scan(room(), pose, np.random.default_rng(0), twist=twist)
        still = ln.deskew(scan, twist)
        points = still.points[still.valid] + pose[:2]
        np.testing.assert_allclose(clearance(room(), points), 0, atol=1e-9)
        assert scan.valid.sum() - still.valid.sum() <= 40
        # They are what a sensor at rest can see: nothing is in front of any of them.
        seen, _ = cast_rays(room(), pose, still.angles[still.valid])
        behind = still.ranges[still.valid] > seen + 0.02
        assert behind.mean() < 0.01


def test_what_has_come_behind_two_neighbours_is_hidden():
    """Driving on at 0.2 m/s: near beams to the left fall back past a far one."""
    bearings = math.pi / 2 + np.array([-0.2, -0.11, 0.0, 0.02, 0.04])
    scan = ln.LaserScan(
        [9.0, 9.0, 9.0, 0.5, 0.5], angles=bearings, time_increment=0.1, intensities=range(5)
    )
    still = ln.deskew(scan, (0.2, 0.0, 0.0))
    assert still.intensities.tolist() == [0, 4, 1, 3, 2]
    assert np.isnan(still.ranges).tolist() == [False, False, True, False, False]
    left = np.array([0, math.atan(0.06 / 0.5), 0, math.atan(0.05 / 0.5), math.atan(0.04 / 9)])
    np.testing.assert_allclose(still.angles[[1, 3, 4]], math.pi / 2 - left[[1, 3, 4]], atol=2e-4)


def test_an_edge_hides_nothing_of_the_wall_behind_it():
    """The wall goes on, a little farther off, where a near beam has come across it."""
    bearings = math.pi / 2 + np.array([-0.04, -0.02, 0.0, 0.02])
    scan = ln.LaserScan([9.2, 9.1, 9.0, 0.5], angles=bearings, time_increment=0.1)
    still = ln.deskew(scan, (0.2, 0.0, 0.0))
    assert still.valid.all()
    assert still.ranges.argmin() == 0


def test_a_full_circle_that_turns_stays_within_one_turn():
    ring = ring_sensor(360, rate=10.0)
    for turn_rate in (2.0, -2.0):
        twist = (0.5, 0.2, turn_rate)
        scan = ring.scan(room(), (0, 1, 0), np.random.default_rng(0), twist=twist)
        still = ln.deskew(scan, twist)
        assert still.is_full_circle == (turn_rate > 0)
        assert still.angles[-1] - still.angles[0] < 2 * math.pi
        points = still.points[still.valid] + (0.0, 1.0)
        np.testing.assert_allclose(clearance(room(), points), 0, atol=1e-6)


@given(
    st.lists(st.sampled_from([NAN, math.inf, 0.0, 0.01, 0.3, 2.0, 2.0, 30.0]), max_size=40),
    st.tuples(*[st.floats(-20, 20)] * 3),
    st.floats(-0.05, 0.05),
)
def test_any_scan_stays_a_scan(ranges, twist, increment):
    scan = ln.LaserScan(ranges, -3.0, 0.15, time_increment=increment, range_max=20.0)
    still = ln.deskew(scan, twist)
    assert len(still) == len(scan)
    assert (np.diff(still.angles) > 0).all()
    assert still.valid.sum() <= scan.valid.sum()


def test_a_twist_must_be_finite():
    for times in ({"time_increment": 0.1}, {}):  # also where nothing is to be undone
        with pytest.raises(ValueError, match=r"twist is .*, expected three finite"):
            ln.deskew(ln.LaserScan([1.0], 0.0, 0.1, **times), (NAN, 0.0, 0.0))
    with pytest.raises(TypeError, match="scan is of type list, expected a LaserScan"):
        ln.deskew([1.0], (1.0, 0.0, 0.0))


@pytest.mark.parametrize("twist", [(-1e6, 0.0, 0.0), (0.0, 1e6, 0.0), (0.0, 0.0, 1e6)])
def test_a_sweep_that_leads_farther_than_any_world_is_refused(twist):
    """The last of three beams is a second after the stamp."""
    scan = ln.LaserScan([1.0] * 3, 0.0, 0.1, time_increment=0.5)
    for much in (1.01, 1e200):
        with pytest.raises(ValueError, match="leads out of any world"):
            ln.deskew(scan, tuple(much * np.array(twist)))
    assert len(ln.deskew(scan, tuple(0.99 * np.array(twist)))) == 3


@pytest.mark.parametrize(
    ("beam", "expected"),
    [(0.0, 0.0), (0.5, 0.05), (1.5, 0.25), (2.0, 0.4), (-1.0, -0.2), (3.0, 0.6)],
)
def test_bearings_between_irregular_beams(beam, expected):
    """Outside, beams go on by the median step from the first bearing."""
    scan = ln.LaserScan([1.0, 1.0, 1.0], angles=[0.0, 0.1, 0.4])
    assert _bearing(scan, beam) == pytest.approx(expected)
