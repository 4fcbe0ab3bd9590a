"""Methods side by side on a scan of a log: what they find, how well it fits, and their times."""

import os
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from statistics import median

import matplotlib.figure

from ..evaluation.similarity import similarity_errors, similarity_scores
from ..extractor import Extractor
from ..features import Features
from ..logs import open_log
from ..methods import METHODS
from ..output import canvas
from ..output.figures import scan_figure
from ..output.page import write_parts
from ..progress import Track, untracked
from ..scan import LaserScan
from .findings import Figure, Findings, Table
from .report import findings_parts, machine

#: The endings that `write_comparison` knows.
ENDINGS = (".html", *canvas.PICTURE_ENDINGS)
#: Scans of a log that methods are timed on.
_TIMED = 50


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """Methods side by side on one scan: features by method, and time of a call by method [s].

    Times are medians over `timed` scans.
    """

    title: str
    scan: LaserScan
    features: dict[str, Features]
    seconds: dict[str, float]
    timed: int

    def table(self, times: bool = True) -> Table:
        """List counts, similarity errors and, if asked for, times: a row for each method."""
        records = []
        for name, features in self.features.items():
            similarity = similarity_scores(self.scan, features)
            record: dict[str, object] = {
                "method": name,
                "segments": len(features.segments),
                "corners": len(features.corners),
                "arcs": len(features.arcs),
                "clusters": int(features.clusters.max(initial=-1)) + 1,
                "explained": similarity.explained,
                "mean error [mm]": 1e3 * similarity.mean,
                "largest [mm]": 1e3 * similarity.maximum,
            }
            if times:
                record["time [µs]"] = 1e6 * self.seconds[name]
            records.append(record)
        note = (
            "Error: distance of a point from its own line. Explained: share of the valid beams "
            "that have one."
        )
        if times:
            note += f" Time: median of {self.timed} calls, {machine()}."
        return Table.of_records(self.title, records, note)

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

    They are timed on the scans `timed`, or on the scan itself; ``track(methods, about, total)``
    iterates over the methods and shows the progress.
    """
    scans = list(timed) or [scan]
    features, seconds = {}, {}
    for name in track(list(extractors), "comparing", len(extractors)):
        extract = extractors[name]
        features[name] = extract(scan)  # What happens at the first call is not timed.
        seconds[name] = median(_seconds(extract, one) for one in scans)
    return Comparison(title, scan, features, seconds, len(scans))


def compare_log(
    path: str | os.PathLike[str],
    index: int = 0,
    methods: Iterable[str] = (),
    *,
    topic: str | None = None,
    keep_going: bool = False,
    track: Track = untracked,
) -> Comparison:
    """Compare methods, all by default, on a scan of a log, with times over its first 50 scans.

    Raises LogError if the log cannot be read or has no such scan, ValueError for an unknown method.
    """
    log = open_log(path, topic=topic, keep_going=keep_going)
    extractors = {name: Extractor(name) for name in methods or METHODS}
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


def _seconds(extract: Callable[[LaserScan], Features], scan: LaserScan) -> float:
    started = time.perf_counter()
    extract(scan)
    return time.perf_counter() - started
