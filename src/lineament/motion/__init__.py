"""How the sensor moves: scans without its motion, features followed from scan to scan.

The world is taken to stand still, and edges are ignored. The velocity of the
sensor, `Tracker.twist`, is what `lineament.deskew` needs for the next scan.

Examples
--------
>>> import lineament as ln
>>> from lineament.motion import Tracker
>>> tracker = Tracker()
>>> features = ln.extract(ln.LaserScan([2.0] * 5, angle_min=-0.02, angle_increment=0.01))
>>> tracker(features).segments.tolist(), tracker(features).segments.tolist()
([0], [0])
"""

from ..scan.poses import Twist, compose, inverse, poses_along, relative, twist_between
from .association import Matches, associate
from .calibration import Calibration, calibrate
from .deskew import beam_times, deskew
from .docking import CornerPose, Dock, corner_pose
from .estimate import Motion, estimate_motion
from .odometry import Odometer, Travel
from .tracker import Tracker, Tracks

__all__ = [
    "Calibration",
    "CornerPose",
    "Dock",
    "Matches",
    "Motion",
    "Odometer",
    "Tracker",
    "Tracks",
    "Travel",
    "Twist",
    "associate",
    "beam_times",
    "calibrate",
    "compose",
    "corner_pose",
    "deskew",
    "estimate_motion",
    "inverse",
    "poses_along",
    "relative",
    "twist_between",
]
