"""What is counted over the scans of a log, in constant memory."""

from __future__ import annotations

import math
import statistics

import numpy as np
from numpy.typing import NDArray

from ..scan import LaserScan, Pose

__all__ = ["Clock", "Geometry", "Ranges", "Way"]

#: Stamps make a rate when at least this share of them goes forward.
_FORWARD = 0.5
#: … and at most this share backwards: two clocks have no common rate.
_BACKWARD = 0.1
#: Ranges are counted in steps of 1 mm up to here [m], for a median in constant memory.
_LONGEST = 1e3
_BUFFER = 1 << 16


class Geometry:
    """Beams and bearings; the field of view is that of the first scan with most beams."""

    def __init__(self) -> None:
        self.least = self.most = self.total = 0
        self.field_of_view = self.resolution = 0.0
        self.full_circle = False
        self._seen = False

    def add(self, scan: LaserScan) -> None:
        """Count a scan."""
        n = len(scan)
        self.total += n
        self.least = min(self.least, n) if self._seen else n
        if n > self.most:
            self.most = n
            self.field_of_view = float(scan.angles[-1] - scan.angles[0])
            self.resolution = scan.angle_increment
            self.full_circle = scan.is_full_circle
        self._seen = True


class Clock:
    """Stamps, and their steps thinned to a bounded number: every second one goes when full."""

    def __init__(self) -> None:
        self._low, self._high = math.inf, -math.inf
        self._last: float | None = None
        self._steps: list[float] = []
        self._stride = 1
        self._n = self._n_forward = self.backwards = 0

    def add(self, stamp: float) -> None:
        """Count a stamp [s]."""
        self._low, self._high = min(self._low, stamp), max(self._high, stamp)
        last, self._last = self._last, stamp
        if last is None:
            return
        self._n += 1
        self.backwards += stamp < last
        if stamp <= last:
            return
        if self._n_forward % self._stride == 0:
            self._steps.append(stamp - last)
        self._n_forward += 1
        if len(self._steps) >= _BUFFER:
            self._steps, self._stride = self._steps[::2], 2 * self._stride

    def span(self) -> tuple[float | None, float | None]:
        """Return the earliest stamp, and the time to the latest [s]; None where there are none."""
        # A log without stamps has zeros.
        if self._low > self._high or self._low == self._high == 0:
            return None, None
        return self._low, self._high - self._low

    def rate(self) -> float | None:
        """Return scans per second; None where most stamps do not go forward."""
        if not self._steps or self._n_forward < _FORWARD * self._n:
            return None
        if self.backwards > _BACKWARD * self._n:
            return None
        return 1 / statistics.median(self._steps)


class Ranges:
    """Histogram of valid ranges in millimetres, filled by the buffer."""

    def __init__(self) -> None:
        self.count = 0
        self.limits = math.inf, -math.inf
        self._low, self._high = math.inf, -math.inf
        self._histogram = np.zeros(0, dtype=np.int64)
        self._buffer: list[NDArray[np.float64]] = []
        self._buffered = 0

    def add(self, scan: LaserScan) -> None:
        """Count the valid ranges of a scan."""
        low, high = self.limits
        self.limits = min(low, scan.range_min), max(high, scan.range_max)
        ranges = scan.ranges[scan.valid]
        if not len(ranges):
            return
        self.count += len(ranges)
        self._buffer.append(ranges)
        self._buffered += len(ranges)
        if self._buffered >= _BUFFER:
            self._fold()

    def _fold(self) -> None:
        values = np.concatenate(self._buffer)
        self._buffer, self._buffered = [], 0
        self._low = min(self._low, float(values.min()))
        self._high = max(self._high, float(values.max()))
        bins = np.rint(1000 * np.minimum(values, _LONGEST)).astype(np.int64)
        counts = np.bincount(bins, minlength=len(self._histogram))
        counts[: len(self._histogram)] += self._histogram
        self._histogram = counts

    def quantiles(self) -> tuple[float, float, float] | None:
        """Return the least, median and largest range [m]; None where there are none."""
        if self._buffered:
            self._fold()
        if not self.count:
            return None
        below = np.cumsum(self._histogram)
        ranks = ((self.count - 1) // 2 + 1, self.count // 2 + 1)
        median = float(np.mean(np.searchsorted(below, ranks))) / 1000
        # Half a millimetre of rounding must not carry it past the extremes.
        return self._low, min(max(median, self._low), self._high), self._high


class Way:
    """Poses, and how far it is from each to the next."""

    def __init__(self) -> None:
        self.count, self.length = 0, 0.0
        self._last: Pose | None = None

    def add(self, pose: Pose | None) -> None:
        """Count the pose of a scan, where it has one."""
        if pose is None:
            return
        self.count += 1
        if self._last is not None:
            self.length += math.dist(pose[:2], self._last[:2])
        self._last = pose
