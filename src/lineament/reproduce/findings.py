"""What an experiment gets and returns: a setting; text, tables, figures and numbers."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeVar

from ..evaluation.counts import plain
from ..output import canvas

T = TypeVar("T")

#: Called every second or two with a few words on what is being done.
Progress = Callable[[str], None]
#: Numbers of an experiment: by log, sensor or group of scans, then by method, then by name.
Numbers = Mapping[str, Mapping[str, Mapping[str, Any]]]
#: Columns of a table or panels of a chart: label to the name of a number, and its factor.
Columns = Mapping[str, tuple[str, float]]

NO_RECORDINGS = "The recordings are missing: nothing is measured."


@dataclass(frozen=True, slots=True)
class Table:
    """A table of a report.

    Attributes
    ----------
    title : str
    columns : tuple of str
        Names of the columns, with units.
    rows : tuple of tuples
        A cell for each column: text, a number, or None where there is no value.
    note : str
        A sentence below the table.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[object, ...], ...]
    note: str = ""

    @classmethod
    def of_records(
        cls, title: str, records: Iterable[Mapping[str, object]], note: str = ""
    ) -> Self:
        """Make a table of at least one row; each row names its cells, all the same way.

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

    @classmethod
    def of_numbers(
        cls,
        title: str,
        numbers: Mapping[str, Mapping[str, Any]],
        columns: Columns,
        note: str = "",
        first: str = "method",
    ) -> Self:
        """Make a table of named numbers: a row for each name, empty where a number is missing.

        Examples
        --------
        >>> found = {"liu": {"rmse": 0.004}, "pdbs": {}}
        >>> Table.of_numbers("Errors", found, {"RMSE [mm]": ("rmse", 1e3)}).rows
        (('liu', 4.0), ('pdbs', None))
        """
        rows = ((name, *cells(of, columns).values()) for name, of in numbers.items())
        return cls(title, (first, *columns), tuple(rows), note)

    def __str__(self) -> str:
        """Write the table as plain text, in columns."""
        lines = [self.columns, *(tuple(map(cell_text, row)) for row in self.rows)]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        return "\n".join(
            "  ".join([cells[0].ljust(widths[0]), *map(str.rjust, cells[1:], widths[1:])])
            for cells in lines
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the table for JSON; what is not finite is null."""
        return {
            "title": self.title,
            "columns": list(self.columns),
            "rows": plain(self.rows),
            "note": self.note,
        }


def cells(numbers: Mapping[str, Any], columns: Columns) -> dict[str, object]:
    """Return the cells of a row by their columns, None where a number is missing."""
    return {
        label: factor * numbers[key] if key in numbers else None
        for label, (key, factor) in columns.items()
    }


class Figure(NamedTuple):
    """A picture of a report: its short name ("fig9a"), its caption, and the PNG."""

    name: str
    caption: str
    png: bytes


class Findings(NamedTuple):
    """What an experiment returns: title, paragraphs, tables, figures, and all numbers by name."""

    title: str
    text: tuple[str, ...]
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()
    numbers: Mapping[str, object] = {}

    def to_dict(self) -> dict[str, Any]:
        """Return all but the pictures, for JSON."""
        return {
            "title": self.title,
            "text": list(self.text),
            "tables": [table.to_dict() for table in self.tables],
            "figures": {figure.name: figure.caption for figure in self.figures},
            "numbers": plain(self.numbers),
        }


@dataclass(frozen=True, slots=True)
class Setting:
    """How much an experiment measures. The same setting gives the same numbers, but for times.

    Attributes
    ----------
    frames : int
        Scans of each kind; all other counts follow from it.
    seed : int
        Seed of all worlds and all noise, not negative.
    data : Path or None
        Folder of the recordings; without it the experiments only simulate.
    """

    frames: int = 10
    seed: int = 0
    data: Path | None = None

    def __post_init__(self) -> None:
        if self.frames < 1:
            raise ValueError(f"frames is {self.frames}, expected at least 1")
        if self.seed < 0:
            raise ValueError(f"seed is {self.seed}, expected a number ≥ 0")

    def recordings(self, files: Mapping[str, str]) -> dict[str, Path]:
        """Return the paths of those recordings that exist, by their names."""
        paths = {} if self.data is None else {name: self.data / f for name, f in files.items()}
        return {name: path for name, path in paths.items() if path.exists()}


def each(items: Mapping[str, T], progress: Progress, what: str) -> Iterator[tuple[str, T]]:
    """Iterate over methods or logs by name, and report each: "what: name"."""
    for name, item in items.items():
        progress(f"{what}: {name}")
        yield name, item


def cell_text(cell: object) -> str:
    """Write a cell of a table: fractions with three digits."""
    value = plain(cell)
    if not isinstance(value, float):
        return "–" if value is None else str(value)
    if abs(value) >= 1000:
        return f"{value:.0f}"
    return f"{value:.3g}" if value == 0 or abs(value) >= 1e-4 else f"{value:.2e}"


def dot_chart(numbers: Numbers, panels: Columns, log_axes: Iterable[str] = ()) -> bytes:
    """Draw numbers as dots, as PNG: rows are methods, colours are sensors or logs.

    Only finite ones are drawn; `log_axes` are the labels of the logarithmic axes.
    """
    rows = list(next(iter(numbers.values())))[::-1]
    figure = canvas.new_figure(1.8 + 3.4 * len(panels), 1.1 + 0.32 * len(rows))
    all_axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axes, (label, (key, factor)) in zip(all_axes, panels.items(), strict=True):
        canvas.style(axes, "")
        for color, (name, methods) in zip(canvas.PALETTE, numbers.items(), strict=False):
            values = [factor * methods.get(row, {}).get(key, math.nan) for row in rows]
            dots = {"color": color, "markersize": 6, "alpha": 0.85, "label": name}
            axes.plot(values, range(len(rows)), "o", **dots)
        if label in log_axes:
            axes.set_xscale("log")
        axes.set_xlabel(label, fontsize=9)
        axes.set_yticks(range(len(rows)), rows, fontsize=9)
    legend_below(figure, axes)
    return canvas.figure_bytes(figure)


def legend_below(figure: Any, *panels: Any) -> None:
    """Write one legend of all panels below a figure."""
    handles: dict[str, Any] = {}
    for axes in panels:
        of_axes, labels = axes.get_legend_handles_labels()
        handles |= dict(zip(labels, of_axes, strict=True))
    given = {"loc": "outside lower center", "ncols": 8, "fontsize": 9, "frameon": False}
    figure.legend(list(handles.values()), list(handles), **given)
