"""Occupancy grids from serialised ROS messages: ``nav_msgs/OccupancyGrid``."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..limits import LIMITS, Limits
from ..scan import Pose
from .poses import turn_of
from .wire import Buffer, WireReader


class OccupancyGrid(NamedTuple):
    """A grid of cells: -1 is unknown, 0 free, 100 occupied.

    The frame of the map, the cells by rows from the lowest, the size of a cell [m], and the pose of
    the lower left corner of the first cell [m, m, rad].
    """

    frame: str
    cells: NDArray[np.int8]
    resolution: float
    origin: Pose


def occupancy_grid(data: Buffer, encoding: str, limits: Limits = LIMITS) -> OccupancyGrid:
    """Decode a ``nav_msgs/OccupancyGrid``; ValueError if it is malformed or makes no sense."""
    reader = WireReader(data, encoding, limits)
    _, frame = reader.header()
    reader.numbers("2I")  # when it was loaded
    (resolution,), (width, height) = reader.numbers("f"), reader.numbers("2I")
    x, y, _, *turned = reader.numbers("7d")
    n = reader.count()
    if not (0 < resolution < math.inf and all(map(math.isfinite, (x, y, *turned)))):
        raise ValueError(f"has cells of {resolution:g} m at {x:g} m, {y:g} m, expected more than 0")
    if n != width * height or not n:
        raise ValueError(f"has {n} cells, expected {width} x {height}, and one at least")
    if n > limits.cells:
        limits.check("cells", n)
    if math.hypot(*turned[:2]) > 1e-3 * math.hypot(*turned):
        raise ValueError("its origin is not level, expected a turn about z alone")
    cells = np.frombuffer(reader.raw(n), np.int8).reshape(height, width)
    reader.end()
    return OccupancyGrid(frame, cells, float(resolution), (x, y, turn_of(*turned)[0]))
