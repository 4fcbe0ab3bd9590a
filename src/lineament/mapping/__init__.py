"""Where a sensor is on a plan, how sure that is, and whether it is lost.

>>> import numpy as np
>>> import lineament as ln
>>> from lineament.mapping import LineMap, locate
>>> from lineament.simulation import SENSORS, room
>>> plan = LineMap.from_lines(room().segments)
>>> scan = SENSORS["utm30lx"].scan(room(), (-1.0, 0.5, 0.7), np.random.default_rng(0))
>>> locate(ln.extract(scan), plan).verdict
'located'
"""

from ..walls import COLUMN, WALL
from .evidence import Evidence
from .grids import Grid
from .line_map import LineMap
from .local_map import LocalMap, Query
from .locate import VERDICTS, Location, locate
from .scanners import merge_features

__all__ = [
    "COLUMN",
    "VERDICTS",
    "WALL",
    "Evidence",
    "Grid",
    "LineMap",
    "LocalMap",
    "Location",
    "Query",
    "locate",
    "merge_features",
]
