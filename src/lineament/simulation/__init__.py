"""Simulated scans: worlds of walls and columns, ray casting, noisy sensors, drives.

Every random draw comes from a seed that is given, so that a simulated log can be made again.

Examples
--------
>>> world, waypoints = building()
>>> scan = next(drive(world, waypoints, SENSORS["utm30lx"], seed=1))
>>> len(scan), scan.pose
(1081, (0.7, 5.0, 0.0))
"""

from .drive import drive, drive_poses
from .raycast import cast_rays
from .sensor import SENSORS, Sensor
from .worlds import World, building, room

__all__ = [
    "SENSORS",
    "Sensor",
    "World",
    "building",
    "cast_rays",
    "drive",
    "drive_poses",
    "room",
]
