"""Features that are followed from frame to frame, and the motion that they tell.

>>> import lineament as ln
>>> from lineament.tracking import Tracker
>>> tracker = Tracker()
>>> features = ln.extract(ln.LaserScan([2.0] * 5, angle_min=-0.02, angle_increment=0.01))
>>> tracker(features).segments.tolist(), tracker(features).segments.tolist()
([0], [0])

The world is taken to stand still, and corners of kind "edge" are ignored. The velocity of the
sensor, `Tracker.twist`, is what :func:`lineament.deskew` needs for the next scan.
"""

from .association import Matches, associate
from .motion import Motion, estimate_motion
from .tracker import Tracker, Tracks

__all__ = ["Matches", "Motion", "Tracker", "Tracks", "associate", "estimate_motion"]
