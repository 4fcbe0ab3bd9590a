"""What a scanner sees of the robot itself: it stays in place while all else moves."""

import numpy as np
from numpy.typing import NDArray

from ..scan import LaserScan
from ..scan.changes import Mask
from ..scan.units import FAR

#: A robot is no larger [m], and no part of it is seen to move by more than scanners err [m].
_SIZE, _STILL = 1.0, 0.03
#: Half of the beams see their ranges change by so much where the scanner moves [m].
_MOVES = 0.3
#: Scans, and neighbouring beams, that show it at least; beams in between that may miss it.
_SCANS, _BEAMS, _MISSING = 16, 3, 2
#: Ranges that are kept.
_MOST = 1 << 20


class OwnParts:
    """Finds the robot's own parts in a sample of the scans, which it thins as they become many.

    Parameters
    ----------
    scan : LaserScan
        The first one. Others with another number of beams are left out.
    """

    def __init__(self, scan: LaserScan) -> None:
        self.first = scan
        self._most = max(2 * _SCANS, min(_MOST // max(len(scan), 1), 512))
        self._kept: list[NDArray[np.float32]] = []
        self._count, self._stride = 0, 1

    def add(self, scan: LaserScan) -> None:
        """Add a scan."""
        if len(scan) != len(self.first):
            return
        if self._count % self._stride == 0:
            near = scan.valid & (scan.ranges < FAR)
            self._kept.append(np.where(near, scan.ranges, np.inf).astype(np.float32))
        self._count += 1
        if len(self._kept) >= self._most:
            self._kept, self._stride = self._kept[::2], 2 * self._stride

    def sectors(self) -> Mask:
        """Return the sectors [rad] in which nearly all scans see the same near thing."""
        if len(self._kept) < _SCANS or len(self.first) < _BEAMS:
            return ()
        ranges = np.array(self._kept)
        ranges.sort(axis=0)  # What is no measurement comes last.
        m = len(ranges)
        low, middle, high = ranges[m // 10], ranges[m // 2], ranges[m - 1 - m // 10]
        seen = np.isfinite(middle)
        with np.errstate(invalid="ignore"):
            spread = np.where(np.isfinite(high), high - low, np.inf)
        if not seen.any() or np.median(spread[seen]) < _MOVES:
            return ()
        return self._runs((spread <= _STILL) & (middle <= _SIZE))

    def _runs(self, own: NDArray[np.bool_]) -> Mask:
        """Return the runs of beams, with a beam more on each side, which may see half of it."""
        n, angles, beams = len(own), self.first.angles, np.flatnonzero(own)
        if not len(beams):
            return ()
        parts = np.split(beams, np.flatnonzero(np.diff(beams) > _MISSING + 1) + 1)
        around = parts[0][0] + n - parts[-1][-1] <= _MISSING + 1
        if self.first.is_full_circle and len(parts) > 1 and around:
            parts[0] = np.concatenate([parts.pop(), parts[0]])
        found = []
        for part in parts:
            if len(part) >= _BEAMS:
                step = self.first.angle_increment
                found.append((float(angles[part[0]]) - step, float(angles[part[-1]]) + step))
        return tuple((round(low, 4), round(high, 4)) for low, high in found)
