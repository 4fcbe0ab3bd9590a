"""Scans as CSV: a row a scan, below a header."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from ..errors import LogError
from ..scan import LaserScan
from .base import Head, Log
from .columns import Columns
from .words import Numbers, floats

__all__ = ["CsvLog"]

_TOPIC = "scan"
_BEARINGS = ("angle_min", "angle_increment")
_SCALARS = (*_BEARINGS, "stamp", "range_min", "range_max", "scan_time", "time_increment")
_POSE = ("x", "y", "theta")
_RANGE = re.compile(r"r\d+$")


class CsvLog(Log):
    """One scan a row, below a header that names the columns.

    Columns: ``angle_min`` and ``angle_increment`` [rad], the ranges ``r0``, ``r1``, … [m], and any
    of ``stamp``, ``range_min``, ``range_max``, ``scan_time``, ``time_increment``, ``frame_id`` and
    the pose ``x``, ``y``, ``theta``; others are left out. An empty range is a beam that returned
    nothing, any other empty cell a value that is not known. A row with fewer beams than the
    header has names ends after its last one.

    Raises
    ------
    LogError
        If the topic is another than ``scan``, or there is no such header.
    """

    format = "csv"
    description = "CSV (angle_min, angle_increment, r0, r1, … under a header)"
    endings = (".csv", ".tsv")

    def _open(self) -> None:
        if self.topic not in (None, _TOPIC):
            raise self._no_such_topic(self.topics)
        columns = Columns.of_file(self.source)
        if columns is None or not _has_scans(columns):
            raise LogError(self.source, f"is no {self.description}")
        self._columns = columns
        self._count: int | None = None

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether the first row is a header with bearings and ranges."""
        columns = Columns.of_head(head)
        return columns is not None and _has_scans(columns)

    @property
    def topics(self) -> list[str]:
        """The one kind of scans there is: ``scan``."""
        return [_TOPIC]

    def __len__(self) -> int:
        if self._count is None:
            count = 0
            try:
                for _ in self._columns.rows(self.source):
                    count += 1
            except LogError:
                if not self.keep_going:
                    raise
            self._count = count
        return self._count

    def _items(self) -> Iterator[tuple[str, LaserScan]]:
        numbers, columns = Numbers(), self._columns
        places = {name: i for i, name in enumerate(columns.names) if not _RANGE.match(name)}
        ranges = [i for i, name in enumerate(columns.names) if _RANGE.match(name)]
        for number, line in self._until_broken(columns.rows(self.source)):
            try:
                scan = _scan(columns.cells(line), places, ranges, numbers)
            except (ValueError, OverflowError) as error:
                self._fault(LogError(self.name, str(error), line=number))
            else:
                yield _TOPIC, scan


def _has_scans(columns: Columns) -> bool:
    return {*_BEARINGS, "r0"} <= set(columns.names)


def _scan(
    cells: list[bytes], places: dict[str, int], ranges: list[int], numbers: Numbers
) -> LaserScan:
    if len(cells) > len(places) + len(ranges):
        raise ValueError(f"has {len(cells)} columns, expected {len(places) + len(ranges)}")
    given = {name: cells[i] for name, i in places.items() if i < len(cells) and cells[i]}
    fields: dict[str, Any] = {
        name: floats(f"{name}: value", [given[name]])[0] for name in _SCALARS if name in given
    }
    if "frame_id" in given:
        fields["frame_id"] = given["frame_id"].decode("utf-8", "replace")
    if all(name in given for name in _POSE):
        fields["pose"] = tuple(floats("x, y, theta: value", [given[name] for name in _POSE]))
    words = [cells[i] or b"nan" for i in ranges if i < len(cells)]
    return LaserScan(numbers.vector("range", words), **fields)
