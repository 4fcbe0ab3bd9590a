"""Any scan of a log at once: each is read once and kept in a temporary file."""

from __future__ import annotations

import pickle
import tempfile
import threading
from array import array
from collections.abc import Callable, Iterable, Iterator
from itertools import islice

import numpy as np

from ..logs.saving import lossless
from ..scan import LaserScan

#: A scan with its topic.
Item = tuple[str, LaserScan]

_NOT_KEPT = -1
_NO_POSE = (float("nan"),) * 3
#: What is kept of a scan besides ranges, intensities and bearings.
_FIELDS = ("range_min", "range_max", "stamp", "scan_time", "time_increment", "frame_id", "pose")


class ScanStore:
    """The scans of a log with their topics, by index, while they are still being read.

    `fill` takes the items of a log, once. They go to a temporary file without a name, at most
    `capacity` bytes of it; 40 bytes a scan stay in memory. Scans for which there is no room are
    read from the log again, which is quick forwards, and from the start of the log otherwise.
    """

    def __init__(
        self, read_again: Callable[[], Iterable[Item]], *, capacity: int = 1 << 30
    ) -> None:
        self._read_again, self._capacity = read_again, capacity
        self._file = tempfile.TemporaryFile()  # noqa: SIM115  # open until `close`
        self._starts, self._stamps, self._end = array("q"), array("d"), 0
        self._poses = array("d")  # three numbers a scan
        self.posed = 0  # how many scans have one
        self._closed = False
        self._lock, self._rereading = threading.Lock(), threading.Lock()
        self._ahead: Iterator[Item] = iter(())
        self._at = 0  # index of the next item of `_ahead`

    def __len__(self) -> int:
        """Return the number of scans that were read so far."""
        return len(self._starts)

    def fill(self, items: Iterable[Item]) -> None:
        """Take items to their end, or until the store is closed."""
        for topic, scan in items:
            record = _pack(topic, scan)
            with self._lock:
                if self._closed:
                    return
                self._stamps.append(scan.stamp)
                self._poses.extend(scan.pose or _NO_POSE)
                self.posed += scan.pose is not None
                self._starts.append(self._write(record))

    def item(self, index: int) -> Item:
        """Return the topic of a scan and the scan; IndexError if it was not read."""
        with self._lock:
            if self._closed or not 0 <= index < len(self):
                raise IndexError(f"scan {index} is not there")
            if self._starts[index] != _NOT_KEPT:
                self._file.seek(self._starts[index])
                topic, fields, stamped = pickle.load(self._file)
                return topic, LaserScan(**fields).stamped(*stamped)
        return self._found_again(index)

    def stamps(self, first: int, count: int) -> list[float]:
        """Return the stamps [s] of scans that were read, at most `count` from `first` on."""
        return self._stamps[first : first + count].tolist()

    def nearest(self, stamp: float) -> int | None:
        """Return which of the scans that were read is nearest to a time [s]; None if none was."""
        stamps = np.array(self._stamps)
        return int(abs(stamps - stamp).argmin()) if len(stamps) else None

    def poses(self, first: int, count: int) -> list[list[float]]:
        """Return the poses of scans that were read, NaN without one, as `stamps` does."""
        poses = self._poses[3 * first : 3 * (first + count)].tolist()
        return [poses[k : k + 3] for k in range(0, len(poses), 3)]

    def close(self) -> None:
        """End `fill`, and remove what was kept."""
        with self._lock:
            self._closed = True
            self._file.close()

    def _write(self, record: bytes) -> int:
        """Write a record if there is room; return where."""
        start = self._end
        if start + len(record) > self._capacity:
            return _NOT_KEPT
        try:
            self._file.seek(start)
            self._file.write(record)
            self._file.flush()
        except OSError:  # The disk is full: that is all the room there is.
            self._capacity = 0
            return _NOT_KEPT
        self._end += len(record)
        return start

    def _found_again(self, index: int) -> Item:
        with self._rereading:
            if index < self._at or self._at == 0:
                self._ahead, self._at = iter(self._read_again()), 0
            for item in islice(self._ahead, index - self._at, None):
                self._at = index + 1
                return item
        raise IndexError(f"scan {index} is not there any more")


def _pack(topic: str, scan: LaserScan) -> bytes:
    """Serialise a scan and its topic; of what a log may hold, the pose's covariance is lost."""
    fields = {name: getattr(scan, name) for name in _FIELDS}
    fields["ranges"] = lossless(scan.ranges)
    if scan.intensities is not None:
        fields["intensities"] = lossless(scan.intensities)
    names = ("angle_min", "angle_increment") if scan.is_regular else ("angles",)
    fields.update((name, getattr(scan, name)) for name in names)
    return pickle.dumps((topic, fields, (scan.stamp_beam, scan.stamp_ns)))
