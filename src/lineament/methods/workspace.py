"""`Block`: some scans with the same bearings on their way through a method's kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..features import TABLES
from ..features.records import words
from ..kernels import layout
from ..scan import LaserScan

__all__ = ["Block"]

Array = NDArray[np.float64]

#: The type of each table, and an empty one.
_TABLES = [(dtype, np.frombuffer(b"", dtype)) for dtype in TABLES.values()]


class Block:
    """What goes into the kernels and comes out of them, for up to `capacity` scans.

    A method's ``run`` reads the ranges, the bearings and `noise`, and fills `noises` and the tables
    scan after scan. `floats` and `ints` are the workspace of one scan, `work` its parts by name,
    see `kernels.layout`; `own` is what the method needs besides. All is kept from call to call.

    Parameters
    ----------
    frame : LaserScan
        Any scan with the bearings and range limits of those to come.
    noise : float64 array, shape (4,)
        Noise of the sensor as a row, NaN where it is to be estimated.
    capacity : int
        Scans that have room.
    own : object
        The method's own arrays.
    """

    def __init__(self, frame: LaserScan, noise: Array, capacity: int, own: Any = None) -> None:
        n = len(frame)
        self.frame, self.capacity = frame, capacity
        self.rows = 0
        self.beams = n
        self.bearings = np.stack((np.cos(frame.angles), np.sin(frame.angles)))
        self.step, self.circular = frame.angle_increment, frame.is_full_circle
        self.range_min, self.range_max = frame.range_min, frame.range_max
        self.sensor = self.range_min, self.range_max, self.step, self.circular
        self.noise, self.own = noise, own
        self.noises = np.empty((capacity, 4))
        self.ranges = np.empty((capacity, n))
        self.floats, self.ints = layout.workspace(n)
        self.work = layout.named(self.floats, self.ints)
        self.counts = self.work.counts
        # Zeros, as the padding between fields is written out too. No scan has more than n + 1.
        self._records = [np.zeros(capacity * (n + 1), dtype) for dtype in TABLES.values()]
        self.segments, self.corners, self.arcs, self.breakpoints = map(words, self._records)
        self.clusters = np.empty((capacity, n), np.int32)
        self.offsets = np.zeros((capacity + 1, len(TABLES)), np.int64)

    def fits(self, scan: LaserScan) -> bool:
        """Whether a scan has the bearings and range limits that the block was made for."""
        frame = self.frame
        if scan.range_min != frame.range_min or scan.range_max != frame.range_max:
            return False
        if scan.is_regular and frame.is_regular:
            return (
                len(scan) == self.beams
                and scan.angle_min == frame.angle_min
                and scan.angle_increment == frame.angle_increment
            )
        return np.array_equal(scan.angles, frame.angles)

    def load(self, ranges: Array) -> None:
        """Take in the ranges of some scans, shape (m, n), or of one, shape (n,)."""
        self.rows = 1 if ranges.ndim == 1 else len(ranges)
        self.ranges[: self.rows] = ranges

    def take(self, row: int) -> None:
        """Put a scan into the workspace, for kernels that are called one by one."""
        self.work.beams[layout.RANGE, : self.beams] = self.ranges[row]

    @property
    def tables(self) -> tuple[NDArray[Any], ...]:
        """Results of the kernels: segments, corners, breakpoints, clusters, offsets."""
        return self.segments, self.corners, self.breakpoints, self.clusters, self.offsets

    def raw(self) -> list[bytes]:
        """Copy the records that the last run wrote, as bytes, in the order of the tables."""
        counts = self.offsets[self.rows].tolist()
        # Numpy would copy records field by field, several times slower, and not their padding.
        return [
            records[:count].tobytes() if count else b""
            for records, count in zip(self._records, counts, strict=True)
        ]

    def written(self) -> list[NDArray[np.void]]:
        """Copy the records that the last run wrote, in the order of the tables."""
        return [
            np.frombuffer(raw, dtype) if raw else none
            for raw, (dtype, none) in zip(self.raw(), _TABLES, strict=True)
        ]

    def by_beam(self, row: int) -> Array:
        """Spread a row of the points, by usable beam, over all beams; NaN on the others."""
        spread = np.full(self.beams, np.nan)
        usable = ~np.isnan(self.work.beams[layout.FILTERED, : self.beams])
        spread[usable] = self.work.points[row, : int(usable.sum())]
        if not self.circular and usable.any():
            spread[np.argmax(usable)] = np.nan  # Nothing lies before the first.
        return spread
