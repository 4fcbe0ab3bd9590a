"""What a log holds, in a few lines: its scans, their geometry, time, ranges and poses."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..scan import LaserScan, Pose
from .base import Log

__all__ = ["LogInfo", "summarize"]

#: Stamps make a rate when at least this share of them goes forward.
_FORWARD = 0.5
#: Ranges are counted in steps of 1 mm up to 1 km, for a median in constant memory.
_MILLIMETRES = 1_000_000
_BUFFER = 1 << 16
_FRAMES = 16


@dataclass(frozen=True)
class LogInfo:
    """What a log holds; ``str(info)`` is a text block for a person to read.

    Parameters
    ----------
    path, format : str
        The file and its format.
    topic : str
        What was read, several topics separated by commas.
    scans, skipped : int
        Scans read, and faults gone over.
    beams : (int, int)
        Least and largest number of beams.
    field_of_view, resolution : float
        First to last bearing, and step between beams [rad], of the first scan with most beams.
    full_circle : bool
        Whether that scan goes all around.
    duration : float or None
        Latest minus earliest stamp [s]; None where stamps are missing.
    rate : float or None
        Scans per second, from the median of the stamp steps that go forward; None where most
        stamps stand still.
    valid : float
        Share of beams that are valid.
    ranges : (float, float, float) or None
        Least, median (to 1 mm) and largest valid range [m]; None where no beam is valid.
    poses : float
        Share of scans with a pose.
    travelled : float
        Length of the way from pose to pose [m].
    frame_ids : tuple of str
        Names of frames, in order of appearance, the first 16.
    """

    path: str
    format: str
    topic: str
    scans: int
    beams: tuple[int, int]
    field_of_view: float
    resolution: float
    full_circle: bool
    duration: float | None
    rate: float | None
    valid: float
    ranges: tuple[float, float, float] | None
    poses: float
    travelled: float
    frame_ids: tuple[str, ...]
    skipped: int = 0

    def lines(self) -> list[str]:
        """Aligned lines ``name  value``, angles in degrees."""
        rows = [
            ("log", f"{self.path} ({self.format}: {self.topic})"),
            ("scans", f"{self.scans}" + (f", {self.skipped} skipped" if self.skipped else "")),
            ("beams", self._beams()),
            ("time", self._time()),
            ("ranges", self._ranges()),
            ("poses", self._poses()),
            ("frames", ", ".join(self.frame_ids) or "not named"),
        ]
        return [f"{name:<8}{value}" for name, value in rows]

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def _beams(self) -> str:
        low, high = self.beams
        count = f"{low}" if low == high else f"{low} to {high}"
        span = "full circle" if self.full_circle else f"{math.degrees(self.field_of_view):.4g}°"
        return f"{count}, {span}, every {math.degrees(self.resolution):.4g}°"

    def _time(self) -> str:
        if self.duration is None:
            return "no stamps"
        rate = "no rate: most stamps stand still" if self.rate is None else f"{self.rate:.4g} Hz"
        return f"{self.duration:.1f} s, {rate}"

    def _ranges(self) -> str:
        valid = f"{100 * self.valid:.1f} % valid"
        if self.ranges is None:
            return valid
        low, median, high = self.ranges
        return f"{low:.2f} to {high:.2f} m, median {median:.2f} m, {valid}"

    def _poses(self) -> str:
        if not self.poses:
            return "none"
        return f"{100 * self.poses:.0f} % of scans, {self.travelled:.1f} m travelled"


def summarize(log: Log, scans: Iterable[LaserScan] | None = None) -> LogInfo:
    """Read a log once and tell what it holds, in constant memory.

    Parameters
    ----------
    log : Log
        The log.
    scans : iterable of LaserScan, optional
        Its scans, for instance wrapped by a progress bar; `log` itself if None.

    Returns
    -------
    LogInfo
        The summary.

    Raises
    ------
    LogError
        If a scan is faulty and the log does not keep going.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from lineament.logs import open_log, save_npz
    >>> path = pathlib.Path(tempfile.mkdtemp(), "two.npz")
    >>> save_npz(path, [LaserScan([1.0, 2.0], 0.0, 0.1, stamp=t) for t in (7.0, 7.5)])
    >>> info = summarize(open_log(path))
    >>> info.scans, info.beams, info.rate, info.ranges
    (2, (2, 2), 2.0, (1.0, 1.5, 2.0))
    """
    geometry, clock, ranges, way = _Geometry(), _Clock(), _Ranges(), _Way()
    frames: dict[str, None] = {}
    count = 0
    for scan in log if scans is None else scans:
        count += 1
        geometry.add(scan)
        clock.add(scan.stamp)
        ranges.add(scan.ranges[scan.valid])
        way.add(scan.pose)
        if scan.frame_id and len(frames) < _FRAMES:
            frames[scan.frame_id] = None
    return LogInfo(
        path=str(log.path),
        format=log.format,
        topic=log.topic or ", ".join(log.topics),
        scans=count,
        beams=(geometry.least, geometry.most),
        field_of_view=geometry.field_of_view,
        resolution=geometry.resolution,
        full_circle=geometry.full_circle,
        duration=clock.duration(),
        rate=clock.rate(),
        valid=ranges.count / max(geometry.total, 1),
        ranges=ranges.quantiles(),
        poses=way.count / max(count, 1),
        travelled=way.length,
        frame_ids=tuple(frames),
        skipped=log.skipped,
    )


class _Geometry:
    def __init__(self) -> None:
        self.least = self.most = self.total = 0
        self.field_of_view = self.resolution = 0.0
        self.full_circle = False
        self._seen = False

    def add(self, scan: LaserScan) -> None:
        n = len(scan)
        self.total += n
        self.least = min(self.least, n) if self._seen else n
        if n > self.most:
            self.most = n
            self.field_of_view = float(scan.angles[-1] - scan.angles[0])
            self.resolution = scan.angle_increment
            self.full_circle = scan.is_full_circle
        self._seen = True


class _Clock:
    """Stamps, and their steps thinned to a bounded number: every second one goes when full."""

    def __init__(self) -> None:
        self._low, self._high = math.inf, -math.inf
        self._last: float | None = None
        self._steps: list[float] = []
        self._stride = 1
        self._n = self._n_forward = 0

    def add(self, stamp: float) -> None:
        self._low, self._high = min(self._low, stamp), max(self._high, stamp)
        last, self._last = self._last, stamp
        if last is None:
            return
        self._n += 1
        if stamp <= last:
            return
        if self._n_forward % self._stride == 0:
            self._steps.append(stamp - last)
        self._n_forward += 1
        if len(self._steps) >= _BUFFER:
            self._steps, self._stride = self._steps[::2], 2 * self._stride

    def duration(self) -> float | None:
        # A log without stamps has zeros.
        no_stamps = self._low > self._high or self._low == self._high == 0
        return None if no_stamps else self._high - self._low

    def rate(self) -> float | None:
        if not self._steps or self._n_forward < _FORWARD * self._n:
            return None
        return 1 / float(np.median(self._steps))


class _Ranges:
    """Histogram of valid ranges in millimetres, filled by the buffer."""

    def __init__(self) -> None:
        self.count = 0
        self._low, self._high = math.inf, -math.inf
        self._histogram = np.zeros(0, dtype=np.int64)
        self._buffer: list[NDArray[np.float64]] = []
        self._buffered = 0

    def add(self, ranges: NDArray[np.float64]) -> None:
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
        bins = np.minimum(np.rint(values * 1000), _MILLIMETRES).astype(np.int64)
        counts = np.bincount(bins, minlength=len(self._histogram))
        counts[: len(self._histogram)] += self._histogram
        self._histogram = counts

    def quantiles(self) -> tuple[float, float, float] | None:
        if self._buffered:
            self._fold()
        if not self.count:
            return None
        below = np.cumsum(self._histogram)
        ranks = ((self.count - 1) // 2 + 1, self.count // 2 + 1)
        median = float(np.mean(np.searchsorted(below, ranks))) / 1000
        # Half a millimetre of rounding must not carry it past the extremes.
        return self._low, min(max(median, self._low), self._high), self._high


class _Way:
    def __init__(self) -> None:
        self.count, self.length = 0, 0.0
        self._last: Pose | None = None

    def add(self, pose: Pose | None) -> None:
        if pose is None:
            return
        self.count += 1
        if self._last is not None:
            self.length += math.dist(pose[:2], self._last[:2])
        self._last = pose
