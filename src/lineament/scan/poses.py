"""Poses and motions in the plane: composed, inverted, and spread over time as twists."""

import math

import numpy as np
from numpy.typing import ArrayLike

from .fields import Array, Pose

#: Velocity in the sensor's own frame: forward, to the left [m/s], turn rate [rad/s].
Twist = tuple[float, float, float]


def compose(pose: Pose, motion: Pose) -> Pose:
    """Pose after a motion that is given in the frame of the pose.

    Both are (x, y, theta) [m, m, rad]; theta of the result is in [-π, π].

    Examples
    --------
    >>> x, y, theta = compose((1.0, 0.0, math.pi / 2), (2.0, 0.0, 0.0))
    >>> round(x, 9), round(y, 9)
    (1.0, 2.0)
    """
    x, y, theta = pose
    dx, dy, turn = motion
    c, s = math.cos(theta), math.sin(theta)
    return x + c * dx - s * dy, y + s * dx + c * dy, math.remainder(theta + turn, 2 * math.pi)


def carried(covariance: Array, pose: Pose, other: Pose) -> Array:
    """Covariance (3, 3) of the other pose, which moves with a pose of that covariance."""
    lever = np.eye(3)
    lever[:2, 2] = pose[1] - other[1], other[0] - pose[0]
    return np.asarray(lever @ covariance @ lever.T)


def inverse(pose: Pose) -> Pose:
    """Pose of the origin, seen from a pose.

    Examples
    --------
    >>> inverse((1.0, 2.0, 0.0))
    (-1.0, -2.0, -0.0)
    """
    x, y, theta = pose
    c, s = math.cos(theta), math.sin(theta)
    return -(c * x + s * y), s * x - c * y, -theta


def relative(pose: Pose, other: Pose) -> Pose:
    """Pose of the other in the frame of the first: the motion from the one to the other.

    Examples
    --------
    >>> relative((1.0, 1.0, 0.0), (3.0, 1.0, 0.5))
    (2.0, 0.0, 0.5)
    """
    return compose(inverse(pose), other)


def poses_along(twist: Twist, times: ArrayLike) -> Array:
    """Poses at some times on a way at constant velocity, in the frame of time 0.

    At constant velocities v = (v_x, v_y) and ω in its own frame, after the time t the sensor has
    turned by ωt and gone along an arc, whose chord is R(ωt/2) v t sinc(ωt/2).

    Parameters
    ----------
    twist : Twist
    times : array_like, shape (n,)
        [s], of any sign.

    Returns
    -------
    ndarray, shape (n, 3)
        x [m], y [m], and heading [rad], which is not wrapped.

    Raises
    ------
    ValueError
        If the twist is not three finite numbers.

    Examples
    --------
    Half a circle of radius 1 m:

    >>> poses_along((math.pi, 0.0, math.pi), [0.0, 1.0]).round(3).tolist()
    [[0.0, 0.0, 0.0], [0.0, 2.0, 3.142]]
    """
    if len(twist) != 3 or not all(map(math.isfinite, twist)):
        raise ValueError(f"twist is {twist!r}, expected three finite numbers")
    forward, left, turn_rate = twist
    time = np.asarray(times, dtype=np.float64)
    half = turn_rate * time / 2
    chord = time * np.sinc(half / math.pi)
    c, s = np.cos(half), np.sin(half)
    return np.column_stack(
        (chord * (c * forward - s * left), chord * (s * forward + c * left), 2 * half)
    )


def twist_between(pose: Pose, other: Pose, duration: float) -> Twist:
    """Twist that leads from one pose to the other at constant velocity.

    The poses are those of the *sensor*, in any one frame: odometry, motion capture, a log.

    Parameters
    ----------
    pose, other : (x, y, theta)
        [m, m, rad]; the turn between them goes the short way round.
    duration : float
        Time from the one to the other [s].

    Raises
    ------
    ValueError
        If the duration is 0 or a number is not finite.

    Examples
    --------
    >>> forward, left, turn_rate = twist_between((0, 0, 0), (0, 2, math.pi), 1.0)
    >>> round(forward, 3), abs(round(left, 3)), round(turn_rate, 3)
    (3.142, 0.0, 3.142)
    """
    if not math.isfinite(duration) or duration == 0:
        raise ValueError(f"duration is {duration}, expected a finite time that is not 0")
    x, y, turn = relative(pose, other)
    if not all(map(math.isfinite, (x, y, turn))):
        raise ValueError(f"poses are {pose} and {other}, expected finite numbers")
    c, s = math.cos(turn / 2), math.sin(turn / 2)
    stretch = 1.0 / (float(np.sinc(turn / (2 * math.pi))) * duration)
    return stretch * (c * x + s * y), stretch * (c * y - s * x), turn / duration
