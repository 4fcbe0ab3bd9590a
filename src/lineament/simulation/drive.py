"""Drives: a scanner carried along waypoints, one scan after the other."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from ..scan import Array, LaserScan
from ..scan.poses import Twist
from .sensor import Sensor
from .worlds import World


def drive_poses(
    waypoints: ArrayLike, speed: float = 0.6, turn_rate: float = 1.0, rate: float = 10.0
) -> tuple[Array, Array]:
    """Poses at equal steps of time along straight legs, turning on the spot between them.

    Parameters
    ----------
    waypoints : array_like, shape (W, 2)
        Ends of the legs in the world frame [m]; the first leg gives the first heading.
    speed, turn_rate : float
        Speed along the legs [m/s], and of the turns, each the short way round [rad/s].
    rate : float
        Poses a second [Hz].

    Returns
    -------
    stamps : ndarray, shape (N,)
        Times 0, 1/rate, … until the last waypoint is reached [s].
    poses : ndarray, shape (N, 3)
        x [m], y [m] and heading in (-π, π] [rad], in the world frame.

    Raises
    ------
    ValueError
        If there are fewer than two different waypoints, or a speed or rate is not positive.

    Examples
    --------
    >>> stamps, poses = drive_poses([(0, 0), (1, 0), (1, 1)], speed=1, turn_rate=math.pi, rate=2)
    >>> stamps[-1], poses[3].round(3).tolist()
    (np.float64(2.5), [1.0, 0.0, 1.571])
    """
    stamps, poses, _ = course(waypoints, speed, turn_rate, rate)
    return stamps, poses


def drive(
    world: World,
    waypoints: ArrayLike,
    sensor: Sensor,
    *,
    speed: float = 0.6,
    turn_rate: float = 1.0,
    seed: int = 0,
    rate: float | None = None,
    moving: bool = False,
) -> Iterator[LaserScan]:
    """Simulate the scans of a sensor that is driven along waypoints.

    Parameters
    ----------
    world : World
    waypoints, speed, turn_rate
        As for `drive_poses`.
    sensor : Sensor
    seed : int
        Seed of all noise, not negative. Scan i depends on the seed and i alone.
    rate : float, optional
        Scans a second [Hz]; the sensor's own if None.
    moving : bool
        Whether the sensor moves while it sweeps, with the velocity that it has at the first beam;
        else all beams of a scan are taken at once.

    Returns
    -------
    iterator of LaserScan
        One scan for each pose of `drive_poses`, with its stamp and its true pose.

    Raises
    ------
    ValueError
        As `drive_poses`, or if the seed is negative; before the first scan.

    Examples
    --------
    >>> from lineament.simulation import SENSORS, room
    >>> scans = list(drive(room(), [(-2, 0), (1, 0)], SENSORS["paper"], speed=1, rate=2))
    >>> len(scans), scans[-1].stamp, scans[-1].pose
    (7, 3.0, (1.0, 0.0, 0.0))
    """
    if seed < 0:
        raise ValueError(f"seed is {seed}, expected a number ≥ 0")
    rate = sensor.rate if rate is None else rate
    stamps, poses, twists = course(waypoints, speed, turn_rate, rate)
    states = zip(stamps.tolist(), poses.tolist(), twists_of(twists, moving), strict=True)
    return (
        sensor.scan(world, tuple(pose), np.random.default_rng([seed, i]), stamp, twist)
        for i, (stamp, pose, twist) in enumerate(states)
    )


def twists_of(twists: Array, moving: bool) -> list[Twist | None]:
    """Return the twist of each scan, None for those that are taken at once."""
    return [(vx, vy, omega) if moving else None for vx, vy, omega in twists.tolist()]


def course(
    waypoints: ArrayLike, speed: float, turn_rate: float, rate: float
) -> tuple[Array, Array, Array]:
    """Stamps (N,), poses (N, 3) and twists (N, 3) at equal steps of time."""
    for name, value in (("speed", speed), ("turn_rate", turn_rate), ("rate", rate)):
        if not 0 < value < math.inf:
            raise ValueError(f"{name} is {value}, expected a finite number > 0")
    points = np.asarray(waypoints, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise ValueError(f"waypoints have shape {points.shape}, expected finite points (…, 2)")
    moves = (points[1:] != points[:-1]).any(axis=1)
    if not moves.any():
        raise ValueError("waypoints hold fewer than two different points")
    times, keys = _key_poses(points[np.concatenate(([True], moves))], speed, turn_rate)
    # A scan that is due at the very end is taken in spite of rounding.
    n = math.floor(times[-1] * rate + 1e-9) + 1
    stamps = np.arange(n) / rate
    poses = np.column_stack([np.interp(stamps, times, keys[:, k]) for k in range(3)])
    poses[:, 2] = math.pi - np.mod(math.pi - poses[:, 2], 2 * math.pi)
    # Legs begin at the even keys, turns at the odd ones; the last, when the drive is over, is by 0.
    key = np.searchsorted(times, stamps, side="right") - 1
    is_turn = key % 2 == 1
    twists = np.zeros((n, 3))
    twists[~is_turn, 0] = speed
    turns = np.sign(np.diff(keys[:, 2], append=keys[-1, 2]))
    twists[is_turn, 2] = turn_rate * turns[key[is_turn]]
    return stamps, poses, twists


def _key_poses(points: Array, speed: float, turn_rate: float) -> tuple[Array, Array]:
    """Find times (2L,) and poses (2L, 3) of the start and end of each of the L legs.

    Headings are unwrapped: the turns between them go the short way round.
    """
    legs = np.diff(points, axis=0)
    headings = np.unwrap(np.arctan2(legs[:, 1], legs[:, 0]))
    turning = np.concatenate(([0.0], np.abs(np.diff(headings)) / turn_rate))
    driving = np.hypot(legs[:, 0], legs[:, 1]) / speed
    times = np.cumsum(np.column_stack((turning, driving)).ravel())
    ends = np.repeat(points, 2, axis=0)[1:-1]
    return times, np.column_stack((ends, np.repeat(headings, 2)))
