"""`Block`: some scans with the same bearings on their way through a method's kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .features import TABLES
from .kernels import layout
from .kernels.records import words
from .scan import LaserScan

__all__ = ["Block"]

Array = NDArray[np.float64]

_NONE = {name: np.frombuffer(b"", dtype) for name, dtype in TABLES.items()}


class Block:
    """What goes into the kernels and comes out of them, for up to `capacity` scans.

    A method's ``run`` reads the ranges, the bearings and `noise`; it fills `noises` and the lines
    of `floats`, `ints` and `counts` (see `kernels.layout`), and at last the tables. `own` is the
    method's own. All of it is kept from call to call: nothing is allocated for a scan.

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
        self.cosines, self.sines = np.cos(frame.angles), np.sin(frame.angles)
        self.step, self.circular = frame.angle_increment, frame.is_full_circle
        self.range_min, self.range_max = frame.range_min, frame.range_max
        self.noise, self.own = noise, own
        self.noises = np.empty((capacity, 4))
        self.floats = np.empty((capacity, layout.FLOATS, n + 1))
        self.ints = np.empty((capacity, layout.INTS, n + 1), np.int64)
        self.counts = np.empty((capacity, layout.COUNTS), np.int64)
        self.scratch = np.empty((layout.SCRATCH, n + 1))
        # Zeros, as the padding between fields is written out too. No scan has more than n + 1.
        self._records = {
            name: np.zeros(capacity * (n + 1), dtype) for name, dtype in TABLES.items()
        }
        self.segments, self.corners, self.arcs, self.breakpoints = (
            words(records) for records in self._records.values()
        )
        self.clusters = np.empty((capacity, n), np.int32)
        self.offsets = np.zeros((capacity + 1, len(TABLES)), np.int64)
        self._ranges = self.floats[:, layout.RANGE, :n]

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
        self._ranges[: self.rows] = ranges

    def raw(self) -> dict[str, bytes]:
        """Copy the records that the last run wrote, as bytes, by the name of their table."""
        counts = self.offsets[self.rows].tolist()
        # Numpy would copy records field by field, several times slower, and not their padding.
        return {
            name: records[:count].tobytes() if count else b""
            for (name, records), count in zip(self._records.items(), counts, strict=True)
        }

    def written(self) -> dict[str, NDArray[np.void]]:
        """Copy the records that the last run wrote, by the name of their table."""
        return {
            name: np.frombuffer(raw, TABLES[name]) if raw else _NONE[name]
            for name, raw in self.raw().items()
        }

    def by_beam(self, line: int) -> Array:
        """Spread a line of floats of the first row, by usable beam, over all beams; else NaN."""
        spread = np.full(self.beams, np.nan)
        usable = ~np.isnan(self.floats[0, layout.FILTERED, : self.beams])
        spread[usable] = self.floats[0, line, : int(usable.sum())]
        if not self.circular and usable.any():
            spread[np.argmax(usable)] = np.nan  # Nothing lies before the first.
        return spread
