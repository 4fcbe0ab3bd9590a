import math

import numpy as np
import pytest

import lineament as ln
from lineament.live import LiveConfig, Odometry, Pipeline
from lineament.live.motion import OdometryMotion, PoseMotion, twist_of_laser
from lineament.scan.poses import compose, poses_along, twist_between
from lineament.simulation import SENSORS, drive, room


def odometry(stamp, twist):
    return Odometry(stamp, twist, (0.0, 0.0, 0.0), "odom", "base_link")


@pytest.mark.parametrize(
    ("twist", "laser_pose", "expected"),
    [
        ((1.0, 0.0, 0.0), (0.3, 0.1, 0.0), (1.0, 0.0, 0.0)),
        ((0.0, 0.0, 1.0), (0.5, 0.0, 0.0), (0.0, 0.5, 1.0)),
        ((0.0, 0.0, 1.0), (0.0, 0.5, 0.0), (-0.5, 0.0, 1.0)),
        ((1.0, 0.0, 0.0), (0.0, 0.0, math.pi), (-1.0, 0.0, 0.0)),
        ((1.0, 0.0, 2.0), (0.5, 0.0, math.pi / 2), (1.0, -1.0, 2.0)),
    ],
)
def test_twist_of_a_mounted_scanner_worked_by_hand(twist, laser_pose, expected):
    assert twist_of_laser(twist, laser_pose) == pytest.approx(expected, abs=1e-12)


def test_twist_of_a_mounted_scanner_is_the_motion_of_its_pose():
    rng = np.random.default_rng(3)
    for _ in range(50):
        twist = tuple(rng.normal(size=3))
        laser = (*rng.normal(size=2), rng.uniform(-3, 3))
        start, later = (compose(tuple(p), laser) for p in poses_along(twist, [0.0, 0.1]))
        assert twist_of_laser(twist, laser) == pytest.approx(twist_between(start, later, 0.1))


def test_odometry_that_is_old_says_nothing():
    motion = OdometryMotion((0.0, 0.0, 0.0))
    scan = ln.LaserScan([1.0], 0.0, 0.1, stamp=10.0)
    assert motion.twist(scan) is None
    motion.hear(odometry(9.8, (1.0, 0.0, 0.0)))
    assert motion.twist(scan) == (1.0, 0.0, 0.0)
    motion.hear(odometry(9.0, (1.0, 0.0, 0.0)))
    assert motion.twist(scan) is None


def test_poses_tell_the_motion_between_scans():
    motion = PoseMotion()

    def seen(stamp, pose):
        return motion.twist(ln.LaserScan([1.0], 0.0, 0.1, stamp=stamp, pose=pose))

    assert seen(1.0, (0.0, 0.0, 0.0)) is None
    assert seen(1.5, (0.5, 0.0, 0.0)) == pytest.approx((1.0, 0.0, 0.0))
    assert seen(9.0, (0.5, 0.0, 0.0)) is None  # too long ago
    assert seen(8.0, (0.5, 0.0, 0.0)) is None  # time runs backwards
    assert seen(8.1, None) is None
    assert seen(8.2, (0.5, 0.0, 0.0)) is None


@pytest.mark.parametrize("numbers", [(math.nan, 0.0, 0.0), (0.0, math.inf, 0.0)])
def test_odometry_that_is_not_finite_is_refused(numbers):
    pipeline = Pipeline(LiveConfig(deskew="/odom"))
    with pytest.raises(ValueError, match="expected finite numbers"):
        pipeline.hear(odometry(1.0, numbers))


@pytest.mark.parametrize(("deskew", "most"), [("scans", 0.02), ("poses", 1e-6), ("/odom", 1e-9)])
def test_moving_scans_are_made_straight(deskew, most):
    walk = [(-2.0, 0.0), (-1.0, 0.0)]
    scans = list(drive(room(), walk, SENSORS["lms361"], speed=1.0, rate=10))
    log = "a.log" if deskew == "poses" else None
    pipeline = Pipeline(LiveConfig(deskew=deskew, log=log))
    for scan in scans[:6]:
        pipeline.hear(odometry(scan.stamp, (1.0, 0.0, 0.0)))
        frame = pipeline("one", scan)
        assert frame.scan is scan
        assert frame.tracks is None
    np.testing.assert_allclose(
        frame.straight.ranges, ln.deskew(scan, (1.0, 0.0, 0.0)).ranges, atol=most
    )
    assert np.nanmax(np.abs(frame.straight.ranges - scan.ranges)) > 0.005
