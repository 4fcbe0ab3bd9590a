"""How the sensor moves while it sweeps, from whatever tells it: odometry, poses, its own scans."""

from __future__ import annotations

import math

from ..motion import Tracker
from ..scan import LaserScan, Pose
from ..scan.poses import Twist, twist_between
from .received import Odometry

__all__ = ["OdometryMotion", "PoseMotion", "ScanMotion", "StandingMotion", "twist_of_laser"]

#: Odometry older than this says nothing of a scan [s].
_OLDEST = 0.5
#: Poses that are farther apart in time tell no velocity [s].
_LONGEST = 1.0


class StandingMotion:
    """Knows nothing: scans stay as they are."""

    def twist(self, scan: LaserScan) -> Twist | None:  # noqa: ARG002
        """Twist of the sensor while it takes `scan`, in its own frame; None where unknown."""
        return None

    def hear(self, odometry: Odometry) -> None:
        """Take in what the odometry tells."""


class ScanMotion(StandingMotion):
    """The twist of the last scans, by their features."""

    def __init__(self, tracker: Tracker) -> None:
        self._tracker = tracker

    def twist(self, scan: LaserScan) -> Twist | None:  # noqa: ARG002
        """See `StandingMotion`."""
        return self._tracker.twist


class PoseMotion(StandingMotion):
    """The twist between the poses that two successive scans of a log have."""

    def __init__(self) -> None:
        self._last: tuple[float, Pose] | None = None

    def twist(self, scan: LaserScan) -> Twist | None:
        """See `StandingMotion`."""
        last, self._last = self._last, None
        if scan.pose is None:
            return None
        self._last = scan.stamp, scan.pose
        if last is None or not 0 < scan.stamp - last[0] < _LONGEST:
            return None
        return twist_between(last[1], scan.pose, scan.stamp - last[0])


class OdometryMotion(StandingMotion):
    """The twist of the newest odometry.

    Parameters
    ----------
    laser_pose : (x, y, theta)
        Pose of the scanner in the frame whose twist it is [m, m, rad].
    """

    def __init__(self, laser_pose: Pose) -> None:
        self._laser_pose = laser_pose
        self._newest: Odometry | None = None

    def hear(self, odometry: Odometry) -> None:
        """See `StandingMotion`."""
        self._newest = odometry

    def twist(self, scan: LaserScan) -> Twist | None:
        """See `StandingMotion`."""
        newest = self._newest
        if newest is None or abs(scan.stamp - newest.stamp) > _OLDEST:
            return None
        return twist_of_laser(newest.twist, self._laser_pose)


def twist_of_laser(twist: Twist, laser_pose: Pose) -> Twist:
    """Twist of a scanner that is mounted on what moves, in the scanner's frame.

    A point at p of a rigid body goes at v + ω × p.

    Parameters
    ----------
    twist : (v_x, v_y, omega)
        Of the body, in its frame [m/s, m/s, rad/s].
    laser_pose : (x, y, theta)
        Pose of the scanner in the frame of the body [m, m, rad].

    Examples
    --------
    A scanner half a metre in front of the axle, turned to the left, on a robot that turns:

    >>> forward, left, turn_rate = twist_of_laser((1.0, 0.0, 2.0), (0.5, 0.0, math.pi / 2))
    >>> round(forward, 3), round(left, 3), turn_rate
    (1.0, -1.0, 2.0)
    """
    forward, left, turn_rate = twist
    x, y, theta = laser_pose
    vx, vy = forward - turn_rate * y, left + turn_rate * x
    c, s = math.cos(theta), math.sin(theta)
    return c * vx + s * vy, c * vy - s * vx, turn_rate
