"""Scans as CSV: a row a scan below a header, or a row a beam of one scan."""

import math
import re
from abc import abstractmethod
from collections.abc import Collection, Iterable, Iterator
from itertools import islice
from operator import itemgetter
from typing import Any

import numpy as np

from ..errors import LogError, one_line, shortened, warn
from ..scan import LaserScan
from .base import Head, Log
from .bearings import bearing_fields, by_bearing
from .linelog import LineLog, Parser, number_parser, numbers, scalar
from .lines import numbered_lines

# Neither a comment nor blank.
_ROW = re.compile(rb"\s*[^#\s]").match
# A row a scan.
_BEARINGS = ("angle_min", "angle_increment")
_SCALARS = (*_BEARINGS, "stamp", "range_min", "range_max", "scan_time", "time_increment")
_POSE = ("x", "y", "theta")
_OTHERS = (*(name for name in _SCALARS if name not in _BEARINGS), *_POSE, "frame_id")
_RANGE = re.compile(r"r\d+$")
# A row a beam. Names of the bearings, and whether they are degrees; None where the numbers show.
_BEARING = ("angle", "bearing", "theta", "azimuth")
_DEGREES: dict[str, bool | None] = {
    **dict.fromkeys(_BEARING),
    **{f"{name}_rad": False for name in _BEARING},
    **{f"{name}_deg": True for name in _BEARING},
}
_DISTANCES = ("range", "distance", "radius", "r")
_INTENSITIES = ("intensity",)


class _Csv(Log):
    """Rows of cells, below a header or not."""

    format = "csv"
    endings = (".csv", ".tsv")

    @staticmethod
    @abstractmethod
    def _fits(names: list[str], width: int) -> bool:
        """Whether these columns, whose names may be missing, are of this kind of table."""

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether the first row fits."""
        return cls._fits(*_columns(head.data.split(b"\n"))[1:])

    def _open(self) -> None:
        rows = map(itemgetter(1), numbered_lines(self.source, self.limits))
        self._delimiter, self._names, width = _columns(rows)
        if not self._fits(self._names, width):
            raise LogError(
                self.source,
                "is no CSV of scans, expected rows of angle,range, or a header with angle and "
                "range, or with angle_min, angle_increment and r0, r1, …",
            )
        super()._open()

    def _lines(self, _: Collection[str] = ()) -> Iterator[tuple[int, bytes]]:
        """Yield each row below the header with the number of its line; no row names its kind."""
        lines = numbered_lines(self.source, self.limits)
        rows = ((number, line) for number, line in lines if _ROW(line))
        return islice(rows, 1 if self._names else 0, None)


def _columns(lines: Iterable[bytes]) -> tuple[bytes, list[str], int]:
    """Return what the first row shows: the delimiter, names unless it is numbers, the width."""
    row = next(filter(_ROW, lines), b"")
    delimiter = next((sign for sign in (b",", b";", b"\t") if sign in row), b",")
    cells = _cells(row, delimiter)
    try:
        numbers("column", cells)
    except ValueError:
        return delimiter, [cell.decode("utf-8", "replace").lower() for cell in cells], len(cells)
    return delimiter, [], len(cells)


def _cells(row: bytes, delimiter: bytes) -> list[bytes]:
    return [cell.strip(b' \t\r"') for cell in row.split(delimiter)]


class CsvLog(_Csv, LineLog):
    """One scan a row, below a header that names the columns."""

    description = "CSV (angle_min, angle_increment, r0, r1, … under a header)"
    scan_kinds = read_kinds = ("scan",)

    @staticmethod
    def _fits(names: list[str], _: int) -> bool:
        return {*_BEARINGS, "r0"} <= set(names)

    def _open(self) -> None:
        super()._open()
        known = {*_BEARINGS, *_OTHERS, ""}
        if unread := [n for n in self._names if n not in known and not _RANGE.match(n)]:
            names = shortened(f"columns {', '.join(unread)}")
            expected = f"expected {', '.join(_OTHERS)}, or r0, r1, …"
            warn(one_line(f"{self.name}: {names} are not read: {expected}"))

    def _kind(self, line: bytes) -> str:  # noqa: ARG002 (each row is a scan)
        return self.only_topic

    def _parser(self) -> Parser:
        ranges = [i for i, name in enumerate(self._names) if _RANGE.match(name)]
        others = {name: i for i, name in enumerate(self._names) if not _RANGE.match(name)}
        return lambda _, row: _scan(
            _cells(row, self._delimiter), ranges, others, number_parser(row)
        )


def _scan(cells: list[bytes], ranges: list[int], others: dict[str, int], number: Any) -> LaserScan:
    if len(cells) > len(ranges) + len(others):
        raise ValueError(f"has {len(cells)} columns, expected {len(ranges) + len(others)}")
    given = {name: cells[i] for name, i in others.items() if i < len(cells) and cells[i]}
    fields: dict[str, Any] = {
        name: scalar(name, given[name], number) for name in _SCALARS if name in given
    }
    if "frame_id" in given:
        fields["frame_id"] = given["frame_id"].decode("utf-8", "replace")
    if all(name in given for name in _POSE):
        fields["pose"] = tuple(numbers("x, y, theta", [given[name] for name in _POSE], number))
    words = [cells[i] or b"nan" for i in ranges if i < len(cells)]
    return LaserScan(numbers("range", words, number), **fields)


class CsvBeamsLog(_Csv):
    """Rows ``angle,range`` of one scan, under a header or none."""

    description = "CSV (angle,range)"

    @staticmethod
    def _fits(names: list[str], width: int) -> bool:
        return min(_beam_places(names)[:2]) >= 0 if names else width == 2

    def _open(self) -> None:
        super()._open()
        self._check_topic()

    def __len__(self) -> int:
        return 1

    def _items(self) -> Iterator[tuple[str, LaserScan]]:
        yield from self._made(self.only_topic, "", self._scan, self._beams())

    def _scan(self, rows: Iterable[Iterable[float]]) -> LaserScan:
        beams = np.array([*rows], np.float64).reshape(-1, 3)
        degrees = _DEGREES[self._names[_beam_places(self._names)[0]]] if self._names else None
        order, angles = by_bearing(beams[:, 0], degrees=degrees)
        ranges, intensities = beams[order, 1], beams[order, 2]
        known = None if np.isnan(intensities).all() else intensities
        return LaserScan(ranges, **bearing_fields(angles), intensities=known)

    def _beams(self) -> Iterator[Iterable[float]]:
        """Yield bearing, range and intensity of each row; ValueError if there are too many."""
        places = _beam_places(self._names)
        what = "angle, range" if places[2] < 0 else "angle, range, intensity"
        expected = max(places) + 1
        for count, (number, row) in enumerate(self._until_broken(self._lines())):
            self.limits.check("beams", count + 1)
            cells = _cells(row, self._delimiter)
            try:
                if len(cells) < expected:
                    raise ValueError(f"has {len(cells)} columns, expected {expected}")
                words = [cells[i] or b"nan" for i in places if i >= 0]
                yield [*numbers(f"{what}: value", words), math.nan][:3]
            except ValueError as error:
                self._fault(LogError(self.name, str(error), line=number))


def _beam_places(names: list[str]) -> list[int]:
    """Return the columns of bearing, range and intensity; -1 where there is none."""
    if not names:
        return [0, 1, -1]
    return [
        next((names.index(name) for name in known if name in names), -1)
        for known in (_DEGREES, _DISTANCES, _INTENSITIES)
    ]
