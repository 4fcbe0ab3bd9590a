"""Methods side by side on a scan of a log: what they find, how well it fits, what it takes."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

from ..evaluation.similarity import SimilarityScores, similarity_errors, similarity_scores
from ..extractor import Extractor
from ..features import Features
from ..logs import open_log
from ..methods import METHODS
from ..output import canvas
from ..output.figures import scan_figure
from ..output.page import write_parts
from ..progress import Track, untracked
from ..scan import Array, LaserScan
from .findings import Figure, Findings, Table
from .report import findings_parts, machine

if TYPE_CHECKING:
    import matplotlib.figure

__all__ = [
    "ENDINGS",
    "Comparison",
    "MethodResult",
    "compare_log",
    "compare_scan",
    "write_comparison",
]

#: The endings that `write_comparison` knows.
ENDINGS = (".html", *canvas.PICTURE_ENDINGS)

#: Scans of a log that methods are timed on.
_TIMED = 50


@dataclass(frozen=True, slots=True, eq=False)
class MethodResult:
    """What a method makes of a scan.

    Attributes
    ----------
    features : Features
    errors : ndarray, shape (n,)
        Similarity error of each beam [m], NaN where the method has no line.
    similarity : SimilarityScores
        The same errors, summed up.
    seconds : float
        Time of a call of the extractor, median over the scans that it was timed on.
    """

    features: Features
    errors: Array
    similarity: SimilarityScores
    seconds: float

    def figures(self) -> tuple[float, ...]:
        """List counts of features and clusters, share explained, mean and largest error [mm]."""
        tables = self.features.segments, self.features.corners, self.features.arcs
        return (
            *map(len, tables),
            int(self.features.clusters.max(initial=-1)) + 1,
            self.similarity.explained,
            1e3 * self.similarity.mean,
            1e3 * self.similarity.maximum,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """Methods side by side on one scan.

    Attributes
    ----------
    title : str
        What scan it is.
    scan : LaserScan
    results : dict of str to MethodResult
        By the name of the method.
    timed : int
        Scans that the times are of.
    """

    title: str
    scan: LaserScan
    results: dict[str, MethodResult]
    timed: int

    def table(self, times: bool = True) -> Table:
        """List counts, similarity errors and, if asked for, times, a row a method."""
        columns: tuple[str, ...] = (
            *("method", "segments", "corners", "arcs", "clusters", "explained"),
            *("mean error [mm]", "largest [mm]"),
        )
        note = (
            "Error: distance of a point from its own line. Explained: share of the valid beams "
            "that have one."
        )
        rows: list[tuple[object, ...]] = [
            (method, *result.figures()) for method, result in self.results.items()
        ]
        if times:
            columns += ("time [µs]",)
            note += f" Time: median of {self.timed} calls, {machine()}."
            seconds = (result.seconds for result in self.results.values())
            rows = [(*row, 1e6 * s) for row, s in zip(rows, seconds, strict=True)]
        return Table(self.title, columns, tuple(rows), note)

    def figure(self, errors: bool = True) -> matplotlib.figure.Figure:
        """Draw what each method finds and, if asked for, the error of each beam below it."""
        return scan_figure(
            self.scan,
            {method: result.features for method, result in self.results.items()},
            {m: result.errors for m, result in self.results.items()} if errors else None,
        )

    def findings(self) -> Findings:
        """Give table and figure as a part of a report."""
        png = canvas.figure_bytes(self.figure())
        caption = f"{self.title}: what each method finds, and the similarity error of each beam."
        return Findings(self.title, (), (self.table(),), (Figure("compare", caption, png),))


def compare_scan(
    scan: LaserScan,
    extractors: Mapping[str, Callable[[LaserScan], Features]],
    timed: Iterable[LaserScan] = (),
    title: str = "Methods side by side",
) -> Comparison:
    """Compare methods on a scan.

    Parameters
    ----------
    scan : LaserScan
    extractors : mapping of str to callable
        What to compare, by name: `Extractor`, or any function of a scan that gives features.
    timed : iterable of LaserScan
        Scans to time them on; the scan itself where there are none.
    title : str

    Returns
    -------
    Comparison

    Examples
    --------
    >>> import lineament as ln
    >>> scan = ln.LaserScan([2.0] * 9, angle_min=-0.04, angle_increment=0.01)
    >>> comparison = compare_scan(scan, {"liu": ln.Extractor("liu")})
    >>> len(comparison.results["liu"].features.segments)
    1
    """
    scans = list(timed) or [scan]
    results = {}
    for name, extract in extractors.items():
        extract(scan)  # What is made at the first call is not timed.
        seconds = median(_seconds(extract, one) for one in scans)
        features = extract(scan)
        errors, similarity = similarity_errors(scan, features), similarity_scores(scan, features)
        results[name] = MethodResult(features, errors, similarity, seconds)
    return Comparison(title, scan, results, len(scans))


def compare_log(
    path: str | os.PathLike[str],
    index: int = 0,
    methods: Iterable[str] = (),
    *,
    topic: str | None = None,
    keep_going: bool = False,
    track: Track = untracked,
) -> Comparison:
    """Compare methods on a scan of a log.

    Parameters
    ----------
    path : path-like
        The log.
    index : int
        Index of the scan, from 0.
    methods : iterable of str
        Names of methods; none asks for all.
    topic, keep_going
        As for `open_log`.
    track : callable
        ``track(methods, about, total)`` gives the methods, and shows how far they are.

    Returns
    -------
    Comparison
        Times are medians over the first 50 scans of the log.

    Raises
    ------
    LogError
        If the log cannot be read or has no such scan.
    ValueError
        If there is no such method.
    """
    log = open_log(path, topic=topic, keep_going=keep_going)
    extractors = {name: Extractor(name) for name in methods or METHODS}
    scan, timed = log.scan(index), list(islice(log, _TIMED))
    title = f"{Path(path).name}, scan {index}"
    results: dict[str, MethodResult] = {}
    for name in track(list(extractors), "comparing", len(extractors)):
        results |= compare_scan(scan, {name: extractors[name]}, timed).results
    return Comparison(title, scan, results, len(timed))


def write_comparison(comparison: Comparison, path: str | os.PathLike[str]) -> None:
    """Write a comparison as a page or a picture, by the ending of the file: see `ENDINGS`.

    Raises
    ------
    LineamentError
        If the ending is not known or the file cannot be written.
    """
    if Path(path).suffix.lower() == ".html":
        write_parts(path, comparison.title, findings_parts(comparison.findings()))
    else:
        canvas.save(comparison.figure(), path)


def _seconds(extract: Callable[[LaserScan], Features], scan: LaserScan) -> float:
    started = time.perf_counter()
    extract(scan)
    return time.perf_counter() - started
