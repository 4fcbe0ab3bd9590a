"""What an experiment gets and gives: a setting; text, tables, figures and numbers."""

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple, Self, TypeVar

from lineament.output import canvas

from ..evaluation.counts import plain
from ..evaluation.pooling import Interval
from .prose import prose
from .seeds import Spread

T = TypeVar("T")

#: Called every second or two with a few words on what is being done.
Progress = Callable[[str], None]
#: Numbers of an experiment: by log, sensor or group of scans, then by method, then by name.
Numbers = Mapping[str, Mapping[str, Mapping[Any, Any]]]
#: Columns of a table or panels of a chart: label to the name of a number. Numbers are in metres,
#: radians, seconds and shares; a unit in the label, as in "error [mm]", is what they are shown in,
#: unless the name comes with a factor.
Columns = Mapping[str, Any]
UNITS = {"mm": 1e3, "%": 100, "µs": 1e6, "mrad": 1e3, "°": math.degrees(1)}


class Table(NamedTuple):
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
    def of_numbers(
        cls,
        title: str,
        numbers: Mapping[Any, Mapping[Any, Any]],
        columns: Columns,
        note: str = "",
        first: str | tuple[str, ...] = "method",
    ) -> Self:
        """Make a table of named numbers: a row for each name, empty where a number is missing.

        The parts of a name that is a tuple are in so many first columns.

        Examples
        --------
        >>> found = {"liu": {"rmse": 0.004}, "pdbs": {}}
        >>> Table.of_numbers("Errors", found, {"RMSE [mm]": "rmse"}).rows
        (('liu', 4.0), ('pdbs', None))
        """
        rows = ((*_parts(name), *cells(of, columns)) for name, of in numbers.items())
        return cls(title, (*_parts(first), *columns), tuple(rows), note)

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
        return {name: plain(value) for name, value in self._asdict().items()}


def _parts(name: Any) -> tuple[Any, ...]:
    return name if isinstance(name, tuple) else (name,)


def cells(numbers: Mapping[Any, Any], columns: Columns) -> Iterator[object]:
    """Yield the cells of a row by its columns: numbers by the factor, texts, None if missing."""
    for label in columns:
        key, factor = column(columns, label)
        value = numbers.get(key)
        yield value if value is None or isinstance(value, str) else factor * value


def column(columns: Columns, label: str) -> tuple[Any, float]:
    """Return the name of the number of a column, and the factor to the unit in its label.

    Examples
    --------
    >>> column({"error [mm]": "rmse", "of two [%]": ("both", 1)}, "error [mm]")
    ('rmse', 1000.0)
    """
    unit = re.search(r"\[(.+?)\]", label)
    key = columns[label]
    return key if isinstance(key, tuple) else (key, UNITS.get(unit[1], 1) if unit else 1)


class Figure(NamedTuple):
    """A picture of a report: its short name ("fig9a"), its caption, and the PNG."""

    name: str
    caption: str
    png: bytes

    @classmethod
    def of(cls, name: str, figure: Any, section: str = "", **values: object) -> Self:
        """Draw a figure; its caption is a section of ``text.md``, by default that of its name."""
        return cls(name, prose(section or name, **values)[0], canvas.figure_bytes(figure))


class Findings(NamedTuple):
    """What an experiment gives: title, paragraphs, tables, figures, and all numbers by name."""

    title: str
    text: tuple[str, ...]
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()
    numbers: Mapping[str, object] = {}

    def to_dict(self) -> dict[str, Any]:
        """Return all but the pictures, for JSON."""
        return self._asdict() | {
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
    """Return the item with the median score, of an even number the lower one: to be drawn.

    A score that is NaN is the largest.
    """

    def order(item: T) -> float:
        value = score(item)
        return math.inf if math.isnan(value) else value

    in_order = sorted(items, key=order)
    return in_order[(len(in_order) - 1) // 2]


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


def dot_chart(numbers: Numbers, panels: Columns, log_axes: Iterable[str] = ()) -> Any:
    """Draw numbers as dots: rows are methods, colours are sensors or logs.

    Only finite ones are drawn; `log_axes` are the labels of the logarithmic axes.
    """
    rows = list(next(iter(numbers.values())))[::-1]
    figure = canvas.new_figure(canvas.PAGE_WIDTH, 1.2 + 0.24 * len(rows))
    all_axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axes, label in zip(all_axes, panels, strict=True):
        key, factor = column(panels, label)
        canvas.style(axes, "", xlabel=fill(label, 22))
        for color, (name, methods) in zip(canvas.PALETTE, numbers.items(), strict=False):
            values = [factor * methods.get(row, {}).get(key, math.nan) for row in rows]
            dots = {"color": color, "label": name}
            axes.plot(values, range(len(rows)), "o", **dots)
        if label in log_axes:
            log_axis(axes.xaxis)
        axes.set_yticks(range(len(rows)), rows)
    canvas.add_legend(figure)
    return figure


def log_axis(axis: Any) -> None:
    """Make an axis logarithmic, with a number at each 1, 2 and 5 while these are few."""
    from matplotlib.ticker import LogLocator, NullLocator

    getattr(axis.axes, f"set_{axis.axis_name}scale")("log")
    low, high = axis.get_view_interval()
    digits = (1, 2, 5) if high < 100 * low else (1,)
    axis.set_major_locator(LogLocator(10, digits))
    axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_locator(NullLocator())
