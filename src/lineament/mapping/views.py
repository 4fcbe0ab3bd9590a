"""How far scans have looked, by bearing: of what lies beyond, nobody knows what is there."""

import math
from collections.abc import Sequence

import numpy as np

from ..scan import Array, LaserScan

#: Bearings of a view; each has the nearest of the beams in it and beside it.
BEARINGS = 360
#: Octants in the order in which the kernel numbers them: by whether a place is to the right, is
#: behind, and is more beside than ahead or behind.
_OCTANTS = [0, 1, 3, 2, 7, 6, 4, 5]
#: Of a plan that is known all over.
NO_VIEWS = np.empty((0, 4 + BEARINGS + len(_OCTANTS)))


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
    """Return the views from poses (n, 3) as the kernels take them, shape (n, 372)."""
    c, s, by = np.cos(poses[:, 2]), np.sin(poses[:, 2]), np.stack(far)
    # Bearings beside an octant are of it, too: those at its border are rounded to either.
    wide = np.max((by, np.roll(by, 1, axis=1), np.roll(by, -1, axis=1)), axis=0)
    farthest = wide.reshape(len(by), len(_OCTANTS), -1).max(axis=2)[:, _OCTANTS]
    return np.ascontiguousarray(np.column_stack((poses[:, :2], c, s, by, farthest)))
