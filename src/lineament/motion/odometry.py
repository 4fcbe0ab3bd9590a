"""`Odometer`: where the sensor has come to, and how fast it goes, from the motions of a tracker."""

import math
from typing import NamedTuple

import numpy as np

from .._copies import InTurn, in_turn
from ..scan import Array, Pose
from ..scan.fields import finite
from ..scan.poses import Twist, compose
from .estimate import Motion
from .tracker import FASTEST, Tracks


class Travel(NamedTuple):
    """Where the sensor is in the frame of its first scan, and how fast it goes in its own.

    Attributes
    ----------
    pose : (x, y, theta)
        [m, m, rad]; theta in [-π, π].
    covariance : ndarray, shape (3, 3)
        Of the pose [m, m, rad], along the axes of the first scan.
    twist : (vx, vy, omega)
        Velocity since the last scan [m/s, m/s, rad/s], forward and to the left.
    twist_covariance : ndarray, shape (3, 3)
        Of the twist. Where stamps give no velocity, the twist is 0, with deviations of 50.
    """

    pose: Pose
    covariance: Array
    twist: Twist
    twist_covariance: Array


class Odometer(InTurn):
    """Adds up the motions of one sensor: odometry by its scans.

    The covariance of each `Motion` is propagated to first order. Two motions that follow each other
    share the scan between them, whose errors they have with opposite signs: taken as independent,
    as they are here, they give more than the error of the pose, not less.

    Where a sensor turns at ω while it sweeps a circle in T, and scans are not deskewed, all motions
    are off by their ωT/2π, always to the side to which the mirror turns. This adds up, a turn to
    the left and one to the right alike, and is a part of the covariance.

    Examples
    --------
    >>> import lineament as ln
    >>> from lineament.simulation import SENSORS, drive, room
    >>> tracker, odometer, extract = ln.Tracker(), Odometer(), ln.Extractor("liu:scale_free")
    >>> for scan in drive(room(), [(-2, 0), (-1, 0)], SENSORS["paper"], speed=1, rate=10):
    ...     travel = odometer(tracker(extract(scan)), scan.stamp)
    >>> round(travel.pose[0], 2), [round(speed, 1) for speed in travel.twist]
    (1.0, [1.0, 0.0, 0.0])
    """

    def __init__(self) -> None:
        self._pose: Pose = (0.0, 0.0, 0.0)
        self._covariance = np.zeros((3, 3))
        #: What the pose is off by if scans are not deskewed, and the mirror turns to the left.
        self._skew = np.zeros(3)
        self._stamp = math.nan

    @in_turn
    def __call__(self, tracks: Tracks, stamp: float, sweep: float = 0.0) -> Travel:
        """Go on by the motion to the next scan, which was taken at `stamp` [s].

        `sweep` is how long the mirror takes for a circle, of a scan that is not deskewed [s]: inf
        where that is not known, and is taken to be the time from scan to scan; 0 if it is deskewed.
        ValueError if the stamp is not finite.
        """
        stamp, last = finite("stamp", stamp), self._stamp
        motion, duration, self._stamp = tracks.motion, stamp - last, stamp
        twist, twist_covariance = (0.0, 0.0, 0.0), np.eye(3) * FASTEST**2
        if motion is not None:
            before = self._pose, self._covariance
            self._covariance = compose_covariances(*before, motion.pose, motion.covariance)
            of_pose, of_motion = compose_jacobians(self._pose, motion.pose)
            turns = min(sweep / duration, 1.0) / (2 * math.pi) if duration > 0 else 0.0
            skew = np.array(motion.pose) * motion.theta * turns
            self._skew = of_pose @ self._skew + of_motion @ skew
            self._pose = compose(self._pose, motion.pose)
            if duration > 0:
                found = motion.twist(duration)
                if all(abs(speed) <= FASTEST for speed in found):
                    twist, twist_covariance = found, covariance_of_twist(motion, duration)
                    twist_covariance += np.outer(skew / duration, skew / duration)
        covariance = self._covariance + np.outer(self._skew, self._skew)
        return Travel(self._pose, covariance, twist, twist_covariance)


def compose_jacobians(pose: Pose, motion: Pose) -> tuple[Array, Array]:
    """Return the derivatives, (3, 3) each, of `compose` by its pose and by its motion."""
    dx, dy, _ = motion
    c, s = math.cos(pose[2]), math.sin(pose[2])
    of_pose = np.array([[1.0, 0.0, -s * dx - c * dy], [0.0, 1.0, c * dx - s * dy], [0, 0, 1.0]])
    return of_pose, np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def compose_covariances(pose: Pose, known: Array, motion: Pose, spread: Array) -> Array:
    """Covariance of a pose after a motion, to first order, by those of both."""
    of_pose, of_motion = compose_jacobians(pose, motion)
    return np.asarray(of_pose @ known @ of_pose.T + of_motion @ spread @ of_motion.T)


def covariance_grown(
    motion: Pose, least: tuple[float, float], growth: tuple[float, float]
) -> Array:
    """Covariance of a motion whose deviations [m, rad] grow with its way and its turn."""
    way = least[0] + growth[0] * math.hypot(motion[0], motion[1])
    turn = least[1] + growth[1] * abs(motion[2])
    return np.diag((way, way, turn)) ** 2


def covariance_of_twist(motion: Motion, duration: float) -> Array:
    """Covariance of the twist of a motion, by the derivative of `twist_between`.

    With h half the turn, v = (k x + h y, k y - h x) / duration and k = h cot h.
    """
    x, y, turn = motion.pose
    h = turn / 2
    k, slope = 1.0 - h * h / 3, -h / 3
    if abs(h) > 1e-4:  # below, the series is closer than the differences
        k, slope = h / math.tan(h), (1 / math.tan(h) - h / math.sin(h) ** 2) / 2
    jacobian = np.array([[k, h, slope * x + y / 2], [-h, k, slope * y - x / 2], [0.0, 0.0, 1.0]])
    jacobian /= duration
    covariance: Array = jacobian @ motion.covariance @ jacobian.T
    return covariance
