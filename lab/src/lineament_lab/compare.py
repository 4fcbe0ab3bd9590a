"""Methods side by side on a scan of a log: what they find, how well it fits, and their times."""

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import matplotlib.figure
import numpy as np

from lineament.extractor import Extractor
from lineament.features import Features
from lineament.logs import open_log
from lineament.methods import method_names
from lineament.output import canvas
from lineament.output.figures import scan_figure
from lineament.output.page import write_parts
from lineament.progress import Track, untracked
from lineament.scan import Array, LaserScan

from .evaluation.similarity import similarity_errors
from .reproduce.findings import Figure, Findings, Table
from .reproduce.machine import machine
from .reproduce.report import findings_parts
from .reproduce.scans import interleaved_times, time_ratio
from .reproduce.similarity import COUNTS, SIMILARITY_NOTE, counts_of

#: The endings that `write_comparison` knows.
ENDINGS = (".html", *canvas.PICTURE_ENDINGS)
#: Scans of a log that methods are timed on.
_TIMED = 50


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """Methods side by side on one scan: by method its features, and its times [s].

    Times are those of calls in turns, shape (rounds, scans): see `interleaved_times`.
    """

    title: str
    scan: LaserScan
    features: dict[str, Features]
    seconds: dict[str, Array]

    def table(self) -> Table:
        """List counts, similarity errors and times: a row for each method."""
        first, rows = next(iter(self.features)), {}
        rounds, scans = self.seconds[first].shape
        for name, features in self.features.items():
            ratios = time_ratio(self.seconds[name], self.seconds[first])
            rows[name] = counts_of(self.scan, features) | {
                "time": float(np.median(self.seconds[name])),
                "ratio": "{:.2f} ({:.2f}–{:.2f})".format(*ratios),
            }
        columns = {**COUNTS, "time [µs]": "time", f"÷ {first}": "ratio"}
        note = (
            f"{SIMILARITY_NOTE} Time: median of {scans} scans, {rounds} rounds of all methods in "
            f"turns, with the range of the ratio over the rounds; {machine()}."
        )
        return Table.of_numbers(self.title, rows, columns, note)

    def figure(self) -> matplotlib.figure.Figure:
        """Draw what each method finds, and the similarity error of each beam below it."""
        errors = {name: similarity_errors(self.scan, f) for name, f in self.features.items()}
        return scan_figure(self.scan, self.features, errors)


def compare_scan(
    scan: LaserScan,
    extractors: Mapping[str, Callable[[LaserScan], Features]],
    timed: Iterable[LaserScan] = (),
    title: str = "Methods side by side",
    track: Track = untracked,
) -> Comparison:
    """Compare methods on a scan: extractors, or any functions from a scan to features, by name.

    They are timed on the scans `timed`, or on the scan itself; ``track(methods, about, whole)``
    iterates over the methods and shows the progress.
    """
    names = track(list(extractors), "comparing", extractors)
    features = {name: extractors[name](scan) for name in names}
    seconds = interleaved_times(extractors, list(timed) or [scan], kernels=False)
    return Comparison(title, scan, features, seconds)


def compare_log(
    path: str | os.PathLike[str],
    index: int = 0,
    methods: Iterable[str] = (),
    *,
    track: Track = untracked,
    **reading: Any,
) -> Comparison:
    """Compare methods, all by default, on a scan of a log, with times over its first 50 scans.

    `reading` is as for `open_log`. Raises LogError if the log cannot be read or has no such scan,
    ValueError for an unknown method.
    """
    log = open_log(path, **reading)
    extractors = {name: Extractor(name) for name in methods or method_names(presets=False)}
    scan, timed = log.scan(index), list(islice(log, _TIMED))
    return compare_scan(scan, extractors, timed, f"{Path(path).name}, scan {index}", track)


def write_comparison(comparison: Comparison, path: str | os.PathLike[str]) -> None:
    """Write a comparison as a page or a picture, by the ending of the file: see `ENDINGS`."""
    if Path(path).suffix.lower() != ".html":
        canvas.save(comparison.figure(), path)
        return
    title, png = comparison.title, canvas.figure_bytes(comparison.figure())
    caption = f"{title}: what each method finds, and the similarity error of each beam."
    found = Findings(title, (), (comparison.table(),), (Figure("compare", caption, png),))
    write_parts(path, title, findings_parts(found))
