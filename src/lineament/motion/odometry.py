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

    A scan shows where the sensor was in the middle of its sweep, T/2 after its stamp, or how far it
    was from where the twist by which it is deskewed would have it. As the twist changes, motions
    are off by T/2 times the change.

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
        #: What the pose is off by as scans are not of their stamps, and as the mirror turns.
        self._skews = np.zeros((2, 3))
        self._stamp = math.nan
        #: The last twist, and how far the scan was from where it was at its stamp.
        self._twist = np.zeros(3)
        self._late: Array | None = None

    @in_turn
    def __call__(
        self, tracks: Tracks, stamp: float, sweep: float = 0.0, *, deskewed: bool = False
    ) -> Travel:
        """Go on by the motion to the next scan, which was taken at `stamp` [s].

        `sweep` is how long the mirror takes for a circle [s]: inf where that is not known, and is
        taken to be the time from scan to scan; 0 for scans that are taken at once, or deskewed by
        another odometry. `deskewed` is whether they are deskewed by the twist of the scans before.
        ValueError if the stamp is not finite, or the sweep is not ≥ 0.
        """
        stamp, last = finite("stamp", stamp), self._stamp
        if not sweep >= 0:
            raise ValueError(f"sweep is {sweep!r}, expected a time ≥ 0")
        motion, duration, self._stamp = tracks.motion, stamp - last, stamp
        twist, twist_covariance = (0.0, 0.0, 0.0), np.eye(3) * FASTEST**2
        if motion is not None:
            before = self._pose, self._covariance
            self._covariance = compose_covariances(*before, motion.pose, motion.covariance)
            of_pose, of_motion = compose_jacobians(self._pose, motion.pose)
            found = motion.twist(duration) if duration > 0 else (math.inf,) * 3
            skews = np.zeros((2, 3))
            if all(abs(speed) <= FASTEST for speed in found):
                share = min(sweep / duration, 1.0)
                skews[0] = self._late_by(np.array(found), share * duration, deskewed=deskewed)
                if not deskewed:
                    skews[1] = np.array(motion.pose) * motion.theta * share / (2 * math.pi)
                twist, twist_covariance = found, covariance_of_twist(motion, duration)
                of_twist = skews / duration
                twist_covariance += of_twist.T @ of_twist
            self._skews = self._skews @ of_pose.T + skews @ of_motion.T
            self._pose = compose(self._pose, motion.pose)
        covariance = self._covariance + self._skews.T @ self._skews
        return Travel(self._pose, covariance, twist, twist_covariance)

    def _late_by(self, twist: Array, sweep: float, *, deskewed: bool) -> Array:
        """Return what a motion is off by, as its two scans are not of their stamps, shape (3,)."""
        late = (twist - self._twist if deskewed else twist) * sweep / 2
        before = late if self._late is None and not deskewed else self._late
        self._twist, self._late = twist, late
        return late if before is None else np.asarray(late - before)


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
