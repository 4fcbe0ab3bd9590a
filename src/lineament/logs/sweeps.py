"""How long the beams of a scan take, and how often scans come."""

import math
from collections import deque
from itertools import pairwise
from statistics import median

import numpy as np

from ..scan import LaserScan

#: The last scans, by which it is judged: stamps jitter, and come in bursts.
JUDGED = 20
#: No scanner takes more times as long for its beams as from scan to scan.
_MOST = 2.0


class Sweeps:
    """Compares how long the beams of the last scans take with the time from scan to scan.

    Where the former is far longer, `time_increment` or `scan_time` are wrong, in milliseconds say,
    and scans that are deskewed by them become nonsense. Scans without stamps are not judged.

    Examples
    --------
    >>> sweeps = Sweeps()
    >>> for k in range(3):
    ...     sweeps.add(LaserScan([2.0] * 101, 0.0, 0.01, stamp=k / 10, time_increment=0.5))
    >>> sweeps.is_too_long, sweeps.beams, round(sweeps.step, 9)
    (True, 50.0, 0.1)
    """

    def __init__(self) -> None:
        self._beams: deque[float] = deque(maxlen=JUDGED)
        self._stamps: deque[float] = deque(maxlen=JUDGED)

    def add(self, scan: LaserScan) -> None:
        """Take the next scan."""
        if not len(scan):
            return
        turn = float(np.ptp(scan.angles)) / (2 * math.pi)
        increment = abs(scan.time_increment)
        self._beams.append(increment * (len(scan) - 1) if increment else abs(scan.scan_time) * turn)
        self._stamps.append(scan.stamp)

    @property
    def beams(self) -> float:
        """How long the beams of a scan take, in the median [s]."""
        return median(self._beams)

    @property
    def step(self) -> float:
        """Mean time from scan to scan, of stamps that go forward [s]; inf if none does."""
        steps = [after - before for before, after in pairwise(self._stamps) if after > before]
        return sum(steps) / len(steps) if steps else math.inf

    @property
    def is_too_long(self) -> bool:
        """Whether the beams take longer than they can."""
        return bool(self._beams) and self.beams > _MOST * self.step
