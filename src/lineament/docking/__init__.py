"""Where a thing of a known shape is, that a robot docks to: a V, a recess, a pallet's feet.

Examples
--------
>>> import numpy as np
>>> import lineament as ln
>>> from lineament.docking import Shape, find_shape
>>> from lineament.simulation import SENSORS, World
>>> v = Shape([[(-0.2, 0.3), (0.0, 0.0), (-0.2, -0.3)]])
>>> placed = v.placed((2.0, 0.1, 0.2))
>>> world = World([*placed.reshape(-1, 4), (3.0, -2.0, 3.0, 2.0)])
>>> scan = SENSORS["lms361"].scan(world, (0.0, 0.0, 0.0), np.random.default_rng(0))
>>> found = find_shape(ln.extract(scan), v, (2.1, 0.0, 0.0))
>>> [round(value, 2) for value in found.pose]
[2.0, 0.1, 0.2]
"""

from .following import ShapeDock
from .search import find_shape
from .shape import Shape, ShapePose

__all__ = ["Shape", "ShapeDock", "ShapePose", "find_shape"]
