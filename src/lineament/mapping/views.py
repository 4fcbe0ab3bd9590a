"""How far scans have looked, by bearing: of what lies beyond, nobody knows what is there."""

import math
from collections.abc import Sequence

import numpy as np

from ..scan import Array, LaserScan

#: Bearings of a view; each has the nearest of the beams in it and beside it.
BEARINGS = 360
#: Of a plan that is known all over.
NO_VIEWS = np.empty((0, 4 + BEARINGS))


def looked(scan: LaserScan) -> Array:
    """Return how far a scan looks by bearing [m], shape (BEARINGS,): 0 where nothing returns.

    Examples
    --------
    >>> far = looked(LaserScan([2.0, 3.0], 0.001, math.pi / 180))
    >>> far[:4].tolist(), far[-2:].tolist()
    ([2.0, 2.0, 3.0, 0.0], [0.0, 2.0])
    """
    far, turns = np.full(BEARINGS, np.inf), scan.angles[scan.valid] / (2 * math.pi)
    np.minimum.at(far, (turns % 1.0 * BEARINGS).astype(int) % BEARINGS, scan.ranges[scan.valid])
    nearest = np.min((far, np.roll(far, 1), np.roll(far, -1)), axis=0)
    return np.where(nearest < np.inf, nearest, 0.0)


def views_of(poses: Array, far: Sequence[Array]) -> Array:
    """Return the views from poses (n, 3) as the kernels take them."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return np.ascontiguousarray(np.column_stack((poses[:, :2], c, s, np.stack(far))))
