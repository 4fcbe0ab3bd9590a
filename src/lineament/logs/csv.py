"""Scans as CSV: a row a scan below a header, or a row a beam of one scan."""

import re
from abc import abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import LogError
from ..scan import LaserScan
from .base import Head, Log
from .bearings import bearing_fields, by_bearing
from .linelog import LineLog, Parser, number_parser, numbers, scalar
from .lines import numbered_lines

#: Most rows of one scan.
MAX_BEAMS = 1 << 20

_DELIMITERS = (b",", b";", b"\t")
# A row a scan.
_BEARINGS = ("angle_min", "angle_increment")
_SCALARS = (*_BEARINGS, "stamp", "range_min", "range_max", "scan_time", "time_increment")
_POSE = ("x", "y", "theta")
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


@dataclass(frozen=True)
class _Columns:
    """How the rows of a table are cut, and the names of its columns; none without a header."""

    delimiter: bytes
    names: tuple[str, ...]
    width: int

    def cells(self, row: bytes) -> list[bytes]:
        return _cut(row, self.delimiter)

    def place(self, names: Iterable[str]) -> int:
        """Return the first column that has one of the names; -1 if there is none."""
        return next((self.names.index(name) for name in names if name in self.names), -1)

    @property
    def beam_places(self) -> tuple[int, int, int]:
        """Columns of bearing, range and intensity; -1 where there is none."""
        if not self.names:
            return (0, 1, -1) if self.width == 2 else (-1, -1, -1)
        return self.place(_DEGREES), self.place(_DISTANCES), self.place(_INTENSITIES)


def _columns(lines: Iterable[bytes]) -> _Columns:
    """Return the columns of a table by its first row, a header unless it is all numbers."""
    row = next(filter(_is_row, lines), b"")
    delimiter = next((sign for sign in _DELIMITERS if sign in row), b",")
    cells = _cut(row, delimiter)
    try:
        numbers("column", cells)
    except ValueError:
        names = tuple(cell.decode("utf-8", "replace").lower() for cell in cells)
        return _Columns(delimiter, names, len(cells))
    return _Columns(delimiter, (), len(cells))


def _cut(row: bytes, delimiter: bytes) -> list[bytes]:
    return [cell.strip(b' \t\r"') for cell in row.split(delimiter)]


def _is_row(line: bytes) -> bool:
    return not (line.isspace() or not line or line.lstrip().startswith(b"#"))


class _Csv(Log):
    """Rows of cells, below a header or not."""

    format = "csv"
    endings = (".csv", ".tsv")

    @staticmethod
    @abstractmethod
    def _fits(columns: _Columns) -> bool:
        """Whether the columns are those of this kind of table."""

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether the first row fits."""
        return cls._fits(_columns(head.data.split(b"\n")))

    def _open(self) -> None:
        self._columns = _columns(line for _, line in numbered_lines(self.source))
        if not self._fits(self._columns):
            raise LogError(
                self.source,
                "is no CSV of scans, expected rows of angle,range, or a header with angle and "
                "range, or with angle_min, angle_increment and r0, r1, …",
            )
        super()._open()

    def _lines(self) -> Iterator[tuple[int, bytes]]:
        """Yield each row below the header with the number of its line."""
        below = not self._columns.names
        for number, line in numbered_lines(self.source):
            if _is_row(line):
                if below:
                    yield number, line
                below = True


class CsvLog(_Csv, LineLog):
    """One scan a row, below a header that names the columns.

    Columns: ``angle_min`` and ``angle_increment`` [rad], the ranges ``r0``, ``r1``, … [m], and any
    of ``stamp``, ``range_min``, ``range_max``, ``scan_time``, ``time_increment``, ``frame_id`` and
    the pose ``x``, ``y``, ``theta``; others are left out. An empty range is a beam that returned
    nothing, any other empty cell a value that is not known. A row with fewer beams than the
    header has names ends after its last one.
    """

    description = "CSV (angle_min, angle_increment, r0, r1, … under a header)"
    scan_kinds = read_kinds = ("scan",)

    @staticmethod
    def _fits(columns: _Columns) -> bool:
        return {*_BEARINGS, "r0"} <= set(columns.names)

    def _kind(self, line: bytes) -> str:  # noqa: ARG002 (each row is a scan)
        return self.only_topic

    def _parser(self) -> Parser:
        names = self._columns.names
        ranges = [i for i, name in enumerate(names) if _RANGE.match(name)]
        others = {name: i for i, name in enumerate(names) if not _RANGE.match(name)}
        return lambda _, row: _scan(self._columns.cells(row), ranges, others, number_parser(row))


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
    """Rows ``angle,range`` of one scan, under a header or none.

    Without a header there are two columns, bearing and range [m]. A header names them: ``angle``,
    ``bearing``, ``theta`` or ``azimuth``, perhaps with ``_deg`` or ``_rad`` behind; ``range``,
    ``distance``, ``radius`` or ``r``; perhaps ``intensity``; others are left out. Bearings are
    degrees where the header says so or, if it says nothing, where one is beyond ±2π. Rows may
    come in any order; of several with one bearing the first is kept. An empty range is a beam
    that returned nothing.

    Raises
    ------
    LogError
        If the topic is another than ``scan``, or the first row is neither.
    """

    description = "CSV (angle,range)"

    @staticmethod
    def _fits(columns: _Columns) -> bool:
        bearing, distance, _ = columns.beam_places
        return bearing >= 0 and distance >= 0

    def _open(self) -> None:
        super()._open()
        self._check_topic()

    def __len__(self) -> int:
        return 1

    def _items(self) -> Iterator[tuple[str, LaserScan]]:
        beams = np.array(list(self._beams()), np.float64).reshape(-1, 3)
        names, place = self._columns.names, self._columns.beam_places[0]
        try:
            degrees = _DEGREES[names[place]] if names else None
            order, angles = by_bearing(beams[:, 0], degrees=degrees)
            ranges, intensities = beams[order, 1], beams[order, 2]
            known = None if np.isnan(intensities).all() else intensities
            scan = LaserScan(ranges, **bearing_fields(angles), intensities=known)
        except ValueError as error:
            self._fault(LogError(self.name, str(error)))
        else:
            yield self.only_topic, scan

    def _beams(self) -> Iterator[Iterable[float]]:
        """Yield bearing, range and intensity of each row."""
        places = self._columns.beam_places
        expected = max(places) + 1
        for count, (number, row) in enumerate(self._until_broken(self._lines())):
            cells = self._columns.cells(row)
            try:
                if count >= MAX_BEAMS:
                    raise ValueError(f"more than {MAX_BEAMS} beams")
                if len(cells) < expected:
                    raise ValueError(f"has {len(cells)} columns, expected {expected}")
                words = [b"nan" if i < 0 else cells[i] or b"nan" for i in places]
                yield numbers("angle, range, intensity: value", words)
            except ValueError as error:
                self._fault(LogError(self.name, str(error), line=number))
                if count >= MAX_BEAMS:
                    return
