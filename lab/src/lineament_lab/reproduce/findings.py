"""What an experiment gets and returns: a setting; text, tables, figures and numbers."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple, Self, TypeVar

from lineament.output import canvas

from ..evaluation.counts import plain
from .seeds import Spread, merged, merged_text

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


def merged_findings(found: Sequence[Findings]) -> Findings:
    """Merge what an experiment found with several seeds; the figures are those of the first.

    Tables are the same if they have the same title. One that only the first seed has, such as that
    of a recording, stays as it is.
    """
    if len(found) == 1:
        return found[0]
    first = found[0]
    tables = []
    for table in first.tables:
        same = [other for each in found for other in each.tables if other.title == table.title]
        tables.append(_merged_table(same))
    numbers = merged([each.numbers for each in found])
    texts = (merged_text(texts) for texts in zip(*(each.text for each in found), strict=False))
    return first._replace(text=tuple(texts), tables=tuple(tables), numbers=numbers)


def _merged_table(tables: Sequence[Table]) -> Table:
    """Merge the cells of tables: rows are the same if they begin alike."""
    by_name = [_named(table.rows) for table in tables]
    rows = (
        tuple(merged(cells) for cells in zip(*(of.get(name, blank) for of in by_name), strict=True))
        for name, row in by_name[0].items()
        for blank in [(row[0], *[None] * (len(row) - 1))]
    )
    first = tables[0]
    return Table(
        first.title, first.columns, tuple(rows), merged_text([table.note for table in tables])
    )


def _named(rows: Iterable[tuple[object, ...]]) -> dict[tuple[object, int], tuple[object, ...]]:
    """Name each row by its first cell, and how many before it begin so."""
    seen: Counter[object] = Counter()
    named = {}
    for row in rows:
        named[row[0], seen[row[0]]] = row
        seen[row[0]] += 1
    return named


@dataclass(frozen=True, slots=True)
class Setting:
    """How much an experiment measures. The same setting gives the same numbers, but for times.

    Attributes
    ----------
    frames : int
        Scans of each kind; all other counts follow from it.
    seed : int
        Seed of all worlds and all noise, not negative; the first one.
    data : Path or None
        Folder of the recordings; without it the experiments only simulate.
    seeds : int
        How many seeds in a row the simulated experiments are run with.
    museum : Path or None
        Bag of the museum that the paper's recordings are from.
    methods : tuple of str
        Methods besides those that are compared, such as ``my.py:find``.
    """

    frames: int = 10
    seed: int = 0
    data: Path | None = None
    seeds: int = 5
    museum: Path | None = None
    methods: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name, least in (("frames", 1), ("seed", 0), ("seeds", 1)):
            value = getattr(self, name)
            if value < least:
                raise ValueError(f"{name} is {value}, expected a number ≥ {least}")

    def by_seed(self) -> list[Self]:
        """Return the setting of each seed; recordings, which are always the same, in the first."""
        others = (replace(self, seed=self.seed + k, data=None) for k in range(1, self.seeds))
        return [replace(one, seeds=1) for one in (self, *others)]

    def recordings(self, files: Mapping[str, str]) -> dict[str, Path]:
        """Return the paths of those recordings that exist, by their names."""
        paths = {} if self.data is None else {name: self.data / f for name, f in files.items()}
        return {name: path for name, path in paths.items() if path.exists()}


def each(items: Mapping[str, T], progress: Progress, what: str) -> Iterator[tuple[str, T]]:
    """Iterate over methods or logs by name, and report each: "what: name"."""
    for name, item in items.items():
        progress(f"{what}: {name}")
        yield name, item


def median_of(items: Iterable[T], score: Callable[[T], float]) -> T:
    """Return the item with the median score, of an even number the lower one: to be drawn."""
    in_order = sorted(items, key=score)
    return in_order[(len(in_order) - 1) // 2]


class Interval(NamedTuple):
    """A number and its 95 % interval, whose ends may be NaN: unknown."""

    value: float
    low: float
    high: float


def cell_text(cell: object) -> str:
    """Write a cell of a table: fractions with three digits, and their range over the seeds."""
    if isinstance(cell, Spread):
        return cell.written(cell_text)
    if isinstance(cell, Interval):
        value, low, high = map(cell_text, cell)
        return f"{value} ({low}–{high})" if math.isfinite(cell.low) else value
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
    figure = canvas.new_figure(canvas.PAGE_WIDTH, 1.2 + 0.24 * len(rows))
    all_axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axes, (label, (key, factor)) in zip(all_axes, panels.items(), strict=True):
        canvas.style(axes, "", xlabel=fill(label, 22))
        for color, (name, methods) in zip(canvas.PALETTE, numbers.items(), strict=False):
            values = [factor * methods.get(row, {}).get(key, math.nan) for row in rows]
            dots = {"color": color, "label": name}
            axes.plot(values, range(len(rows)), "o", **dots)
        if label in log_axes:
            log_axis(axes.xaxis)
        axes.set_yticks(range(len(rows)), rows)
    canvas.add_legend(figure)
    return canvas.figure_bytes(figure)


def log_axis(axis: Any) -> None:
    """Make an axis logarithmic, with a number at each 1, 2 and 5 while these are few."""
    from matplotlib.ticker import LogLocator, NullLocator

    getattr(axis.axes, f"set_{axis.axis_name}scale")("log")
    low, high = axis.get_view_interval()
    digits = (1, 2, 5) if high < 100 * low else (1,)
    axis.set_major_locator(LogLocator(10, digits))
    axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_locator(NullLocator())
