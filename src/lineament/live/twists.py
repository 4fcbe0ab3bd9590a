"""The motion of a scanner on a body that moves."""

import math

from ..scan import Pose
from ..scan.poses import Twist


def twist_of_laser(twist: Twist, laser_pose: Pose) -> Twist:
    """Twist of a scanner in its own frame [m/s, m/s, rad/s], by that of the body that carries it.

    A point at p of a rigid body moves with v + ω × p. `laser_pose` is in the frame of the body.
    """
    forward, left, turn_rate = twist
    x, y, theta = laser_pose
    vx, vy = forward - turn_rate * y, left + turn_rate * x
    c, s = math.cos(theta), math.sin(theta)
    return c * vx + s * vy, c * vy - s * vx, turn_rate


def turned_over(twist: Twist) -> Twist:
    """Twist of a scanner that is mounted upside down: turned about its x axis."""
    forward, left, turn_rate = twist
    return forward, -left, -turn_rate
