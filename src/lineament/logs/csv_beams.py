"""One scan as CSV: a row a beam."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from ..errors import LogError
from ..scan import LaserScan
from .base import Head, Log
from .bearings import bearing_fields
from .columns import Columns
from .turn import one_turn
from .words import floats

__all__ = ["CsvBeamsLog"]

_TOPIC = "scan"
#: Rows from which they are no beams of a scan any more.
MAX_BEAMS = 1 << 20
_BEARING = ("angle", "bearing", "theta", "azimuth")
#: Names of the column of bearings, and whether they are degrees; None where the numbers tell.
_BEARINGS: dict[str, bool | None] = {
    **dict.fromkeys(_BEARING),
    **{f"{name}_rad": False for name in _BEARING},
    **{f"{name}_deg": True for name in _BEARING},
}
_RANGES = ("range", "distance", "radius", "r")
_INTENSITIES = ("intensity",)


class CsvBeamsLog(Log):
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

    format = "csv"
    description = "CSV (angle,range)"
    endings = (".csv", ".tsv")

    def _open(self) -> None:
        if self.topic not in (None, _TOPIC):
            raise self._no_such_topic(self.topics)
        columns = Columns.of_file(self.source)
        if columns is None or not _has_beams(columns):
            raise LogError(
                self.source,
                "is no CSV of scans, expected rows of angle,range, or a header with angle and "
                "range, or with angle_min, angle_increment and r0, r1, …",
            )
        self._columns = columns

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether the first row is two numbers, or a header with a bearing and a range."""
        columns = Columns.of_head(head)
        return columns is not None and _has_beams(columns)

    @property
    def topics(self) -> list[str]:
        """The one kind of scans there is: ``scan``."""
        return [_TOPIC]

    def __len__(self) -> int:
        return 1

    def _items(self) -> Iterator[tuple[str, LaserScan]]:
        beams = np.array(list(self._beams()), np.float64).reshape(-1, 3)
        name = next((name for name in self._columns.names if name in _BEARINGS), _BEARING[0])
        try:
            order, angles = one_turn(beams[:, 0], degrees=_BEARINGS[name])
            ranges, intensities = beams[order, 1], beams[order, 2]
            unknown = np.isnan(intensities).all()
            scan = LaserScan(
                ranges, **bearing_fields(angles), intensities=None if unknown else intensities
            )
        except ValueError as error:
            self._fault(LogError(self.name, str(error)))
        else:
            yield _TOPIC, scan

    def _beams(self) -> Iterator[list[float]]:
        """Read bearing, range and intensity of each row."""
        columns, places = self._columns, _places(self._columns)
        rows = self._until_broken(columns.rows(self.source))
        for count, (number, line) in enumerate(rows):
            if count >= MAX_BEAMS:
                self._fault(LogError(self.name, f"more than {MAX_BEAMS} beams", line=number))
                return
            try:
                yield _beam(columns.cells(line), places)
            except ValueError as error:
                self._fault(LogError(self.name, str(error), line=number))


def _has_beams(columns: Columns) -> bool:
    if not columns.names:
        return columns.width == 2
    return None not in _places(columns)[:2]


def _places(columns: Columns) -> tuple[int | None, int | None, int | None]:
    """Tell in which columns bearing, range and intensity stand."""
    if not columns.names:
        return 0, 1, None
    return _place(columns, _BEARINGS), _place(columns, _RANGES), _place(columns, _INTENSITIES)


def _place(columns: Columns, names: Iterable[str]) -> int | None:
    return next((columns.names.index(name) for name in names if name in columns.names), None)


def _beam(cells: list[bytes], places: tuple[int | None, ...]) -> list[float]:
    largest = max(place for place in places if place is not None)
    if len(cells) <= largest:
        raise ValueError(f"has {len(cells)} columns, expected {largest + 1}")
    return floats(
        "angle, range, intensity: value",
        [b"nan" if place is None else cells[place] or b"nan" for place in places],
    )
