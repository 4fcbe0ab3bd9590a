"""One sweep of a 2-D laser scanner: its beams, what is valid, its noise."""

from .fields import Array, Pose
from .laser_scan import LaserScan
from .noise import NoiseLike, RangeNoise

__all__ = ["Array", "LaserScan", "NoiseLike", "Pose", "RangeNoise"]
