"""Simulated scans: worlds of walls and columns, ray casting, noisy sensors, drives.

Every random draw comes from a seed that is given, so that a simulated log can be made again.
The features of a scan that a perfect method would find are those of `truth`.

Examples
--------
>>> world, waypoints = building()
>>> scan = next(drive(world, waypoints, SENSORS["utm30lx"], seed=1))
>>> len(scan), scan.pose
(1081, (0.7, 5.0, 0.0))
"""

from .buildings import Building, office
from .drive import drive, drive_poses
from .raycast import cast_rays
from .recording import WORLDS, sensor_like, simulate_log
from .scenes import SCENES, scene
from .sensor import SENSORS, Sensor
from .truth import truth
from .wheels import Wheels
from .worlds import World, building, room

__all__ = [
    "SCENES",
    "SENSORS",
    "WORLDS",
    "Building",
    "Sensor",
    "Wheels",
    "World",
    "building",
    "cast_rays",
    "drive",
    "drive_poses",
    "office",
    "room",
    "scene",
    "sensor_like",
    "simulate_log",
    "truth",
]
