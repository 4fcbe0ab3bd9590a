"""What an experiment is given, and what it hands back: text, tables, figures, numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from ..evaluation.counts import plain

__all__ = ["Figure", "Findings", "Progress", "Setting", "Table"]

#: Told every second or two, in a few words, what is being done.
Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Table:
    """A table of a report.

    Attributes
    ----------
    title : str
        What it shows, in a few words.
    columns : tuple of str
        Names of the columns, with units.
    rows : tuple of tuples
        A cell for each column: text, a number, or None where there is no value.
    note : str
        A sentence below the table.

    Raises
    ------
    ValueError
        If a row has another number of cells than there are columns.

    Examples
    --------
    >>> Table("Corners", ("method", "F1"), (("liu", 0.91234),)).to_dict()["rows"]
    [['liu', 0.91234]]
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[object, ...], ...]
    note: str = ""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(
                    f"table {self.title!r} has a row of {len(row)} cells, "
                    f"expected {len(self.columns)}: {row!r}"
                )

    @classmethod
    def of_records(
        cls, title: str, records: Iterable[Mapping[str, object]], note: str = ""
    ) -> Self:
        """Make a table of rows that name their cells, each with the same columns.

        Parameters
        ----------
        title : str
        records : iterable of mapping of str to object
            The cells of a row by the name of the column; at least one.
        note : str

        Raises
        ------
        ValueError
            If a row has other columns than the first.

        Examples
        --------
        >>> Table.of_records("Corners", [{"method": "liu", "F1": 0.9}]).columns
        ('method', 'F1')
        """
        rows = list(records)
        columns = tuple(rows[0])
        for row in rows:
            if tuple(row) != columns:
                raise ValueError(f"table {title!r} has columns {columns!r}, then {tuple(row)!r}")
        return cls(title, columns, tuple(tuple(row.values()) for row in rows), note)

    def __str__(self) -> str:
        """Write the table as plain text, in columns.

        Examples
        --------
        >>> print(Table("Corners", ("method", "F1"), (("liu", 0.91234),)))
        method     F1
        liu     0.912
        """
        lines = [self.columns, *(tuple(map(cell_text, row)) for row in self.rows)]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        return "\n".join(
            "  ".join(
                cell.rjust(width) if i else cell.ljust(width)
                for i, (cell, width) in enumerate(zip(line, widths, strict=True))
            )
            for line in lines
        )

    def to_dict(self) -> dict[str, Any]:
        """Give the table as JSON takes it: what is not a finite number is null."""
        return {
            "title": self.title,
            "columns": list(self.columns),
            "rows": [[plain(cell) for cell in row] for row in self.rows],
            "note": self.note,
        }


@dataclass(frozen=True, slots=True)
class Figure:
    """A picture of a report.

    Attributes
    ----------
    name : str
        Short name, as of a file: "fig9a".
    caption : str
        What is to be seen.
    png : bytes
        The picture, as of `lineament.output.canvas.figure_bytes`.
    """

    name: str
    caption: str
    png: bytes = field(repr=False)


@dataclass(frozen=True, slots=True)
class Findings:
    """What an experiment found.

    Attributes
    ----------
    title : str
        Title of its part of the report.
    text : tuple of str
        Paragraphs of plain sentences.
    tables : tuple of Table
    figures : tuple of Figure
    numbers : dict
        All figures by name, as JSON takes them or as NumPy's numbers and arrays.
    """

    title: str
    text: tuple[str, ...]
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()
    numbers: dict[str, object] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Give all but the pictures as JSON takes it."""
        return {
            "title": self.title,
            "text": list(self.text),
            "tables": [table.to_dict() for table in self.tables],
            "figures": {figure.name: figure.caption for figure in self.figures},
            "numbers": plain(self.numbers),
        }


@dataclass(frozen=True, slots=True)
class Setting:
    """What an experiment is made with. The same setting gives the same numbers, but for times.

    Attributes
    ----------
    frames : int
        Scans of each kind; all other counts follow from it.
    seed : int
        Seed of all worlds and all noise, not negative.
    data : Path or None
        Folder of the recordings; without it the experiments are simulated ones alone.

    Raises
    ------
    ValueError
        If there are no frames or the seed is negative.

    Examples
    --------
    >>> Setting(frames=2).seed
    0
    """

    frames: int = 10
    seed: int = 0
    data: Path | None = None

    def __post_init__(self) -> None:
        if self.frames < 1:
            raise ValueError(f"frames is {self.frames}, expected at least 1")
        if self.seed < 0:
            raise ValueError(f"seed is {self.seed}, expected a number ≥ 0")

    def recording(self, name: str) -> Path | None:
        """Tell the path of a recording; None where it is not there."""
        path = None if self.data is None else self.data / name
        return path if path is not None and path.exists() else None


def cell_text(cell: object) -> str:
    """Write a cell of a table: numbers that are not whole by three digits.

    Examples
    --------
    >>> cell_text(0.0123456), cell_text(1234.5), cell_text(12), cell_text(None)
    ('0.0123', '1234', '12', '–')
    """
    value = plain(cell)
    if value is None:
        return "–"
    if not isinstance(value, float):
        return str(value)
    if abs(value) >= 1000:
        return f"{value:.0f}"
    return f"{value:.3g}" if value == 0 or abs(value) >= 1e-4 else f"{value:.2e}"
