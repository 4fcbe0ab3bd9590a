"""Any scan of a log at once: each is read once and kept, packed, in a temporary file."""

from __future__ import annotations

import json
import struct
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator
from itertools import islice

import numpy as np

from ..scan import LaserScan

__all__ = ["ScanStore", "pack", "unpack"]

#: A scan with its topic.
Item = tuple[str, LaserScan]

#: By scan: where its packed form begins (-1: it was not kept), how long that is, its stamp.
_ENTRY = struct.Struct("<qqd")
_NOT_KEPT = -1
_LENGTH = struct.Struct("<I")
#: What the packed form holds besides the arrays; intensities are left out.
_FIELDS = ("range_min", "range_max", "stamp", "scan_time", "time_increment", "frame_id", "pose")


class ScanStore:
    """The scans of a log with their topics, by index, while they are still being read.

    `fill` takes the items of a log, once. They go to a temporary file without a name, at most
    `capacity` bytes of it, and 24 bytes a scan to another one: memory does not grow with the log.
    Scans for which there is no room are read from the log again when they are asked for, which is
    quick forwards, and from the start of the log otherwise.

    Parameters
    ----------
    read_again : callable
        Gives the same items again, from the start.
    capacity : int
        Most bytes of packed scans that are kept.

    Examples
    --------
    >>> items = [("scan", LaserScan([1.0 + k], 0.0, 0.1, stamp=k)) for k in range(3)]
    >>> with ScanStore(lambda: items) as store:
    ...     store.fill(items)
    ...     topic, scan = store.item(2)
    ...     len(store), topic, scan.ranges.tolist(), store.stamps(1, 9)
    (3, 'scan', [3.0], [1.0, 2.0])
    """

    def __init__(
        self, read_again: Callable[[], Iterable[Item]], *, capacity: int = 1 << 30
    ) -> None:
        self._read_again, self._capacity = read_again, capacity
        self._entries = tempfile.TemporaryFile()  # noqa: SIM115  # open until `close`
        self._records = tempfile.TemporaryFile()  # noqa: SIM115
        self._count, self._end = 0, 0
        self._closed = False
        self._lock, self._rereading = threading.Lock(), threading.Lock()
        self._ahead: Iterator[Item] = iter(())
        self._at = 0  # which item `_ahead` gives next

    def __enter__(self) -> ScanStore:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __len__(self) -> int:
        """Return the number of scans that were read so far."""
        return self._count

    def fill(self, items: Iterable[Item]) -> None:
        """Take in items to their end, or until the store is closed."""
        for topic, scan in items:
            record = pack(topic, scan)
            with self._lock:
                if self._closed:
                    return
                self._append(record, scan.stamp)

    def item(self, index: int) -> Item:
        """Give the topic of a scan that was read, and the scan without its intensities.

        Raises
        ------
        IndexError
            If it was not read yet, or there is none.
        """
        with self._lock:
            start, length, _ = self._entry(index)
            if start != _NOT_KEPT:
                self._records.seek(start)
                return unpack(self._records.read(length))
        return self._found_again(index)

    def stamps(self, first: int, count: int) -> list[float]:
        """List the stamps [s] of scans that were read, at most `count` of them from `first` on."""
        with self._lock:
            last = min(first + count, self._count)
            return [self._entry(i)[2] for i in range(first, last)]

    def close(self) -> None:
        """End `fill`, and remove what was kept."""
        with self._lock:
            self._closed = True
            self._entries.close()
            self._records.close()

    def _append(self, record: bytes, stamp: float) -> None:
        start = self._end if self._end + len(record) <= self._capacity else _NOT_KEPT
        if start != _NOT_KEPT:
            try:
                self._records.seek(start)
                self._records.write(record)
                self._records.flush()
                self._end += len(record)
            except OSError:  # The disk is full: that is all the room there is.
                start, self._capacity = _NOT_KEPT, 0
        self._entries.seek(self._count * _ENTRY.size)
        self._entries.write(_ENTRY.pack(start, len(record), stamp))
        self._count += 1

    def _entry(self, index: int) -> tuple[int, int, float]:
        if self._closed or not 0 <= index < self._count:
            raise IndexError(f"scan {index} is not there")
        self._entries.seek(index * _ENTRY.size)
        start, length, stamp = _ENTRY.unpack(self._entries.read(_ENTRY.size))
        return start, length, stamp

    def _found_again(self, index: int) -> Item:
        with self._rereading:
            if index < self._at or self._at == 0:
                self._ahead, self._at = iter(self._read_again()), 0
            for item in islice(self._ahead, index - self._at, None):
                self._at = index + 1
                return item
        raise IndexError(f"scan {index} is not there any more")


def pack(topic: str, scan: LaserScan) -> bytes:
    """Pack a scan and its topic, but for its intensities; nothing of the rest is lost."""
    head = {"topic": topic, **{name: getattr(scan, name) for name in _FIELDS}}
    if scan.is_regular:
        head["angle_min"], head["angle_increment"] = scan.angle_min, scan.angle_increment
    # Most sensors report single precision.
    with np.errstate(over="ignore"):
        single = scan.ranges.astype(np.float32)
    head["single"] = bool(np.array_equal(single, scan.ranges, equal_nan=True))
    text = json.dumps(head).encode()
    ranges = single if head["single"] else scan.ranges
    angles = b"" if scan.is_regular else scan.angles.tobytes()
    return _LENGTH.pack(len(text)) + text + angles + ranges.tobytes()


def unpack(record: bytes) -> Item:
    """Give the topic and the scan of a record.

    Examples
    --------
    >>> scan = LaserScan([1.0, float("nan")], angles=[0.0, 0.3], frame_id="laser")
    >>> topic, same = unpack(pack("scan", scan))
    >>> topic, same.angles.tolist()
    ('scan', [0.0, 0.3])
    """
    (length,) = _LENGTH.unpack_from(record)
    start = _LENGTH.size + length
    head = json.loads(record[_LENGTH.size : start])
    topic: str = head.pop("topic")
    kind = np.dtype(np.float32 if head.pop("single") else np.float64)
    if "angle_min" not in head:
        n = (len(record) - start) // (8 + kind.itemsize)
        head["angles"] = np.frombuffer(record, np.float64, n, start)
        start += 8 * n
    return topic, LaserScan(np.frombuffer(record, kind, offset=start), **head)
