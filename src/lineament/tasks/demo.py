"""A demonstration: a simulated drive, or a log, into a table and a page."""

import os
from collections.abc import Iterator
from pathlib import Path

from ..errors import LineamentError
from ..extractor import Extractor, load_kernels
from ..files import made_folder
from ..logs import open_log
from ..progress import Track, untracked
from .extract import extract_log

#: Methods in the pictures; the first makes the table.
DEMO_METHODS = ("optimal", "liu:scale_free", "liu:paper")


def run_demo(
    folder: str | os.PathLike[str],
    log: str | os.PathLike[str] | None = None,
    *,
    track: Track = untracked,
) -> list[tuple[str, str]]:
    """Simulate a drive (or take a log), extract its features, and make a page of pictures.

    Returns names and values: files and figures. The page is ``index.html``, the table
    ``features.parquet``. ``track(items, about, total)`` yields the items and shows the progress.

    Raises
    ------
    LineamentError
        If the log cannot be read or the folder cannot be written.
    """
    target = made_folder(folder)
    load_kernels(map(Extractor, DEMO_METHODS))
    if log is None:
        from ..simulation import SENSORS, simulate_log

        log = target / "drive.npz"
        simulate_log(log, "building", SENSORS["utm30lx"], rate=4.0, seed=1, track=track)
    extractor = Extractor(DEMO_METHODS[0])
    summary = extract_log(log, target / "features.parquet", extractor, track=track)
    if summary.scans == 0:
        raise LineamentError(f"{log}: has no scans")
    figures = list(track(_draw(target, log, extractor, summary.scans // 2), "drawing", 3))
    counts = [(name, str(count)) for name, count in summary.features.items()]
    facts = [
        ("log", str(log)),
        ("table", summary.output),
        ("method", DEMO_METHODS[0]),
        ("scans", str(summary.scans)),
        *counts,
        ("beams invalid", f"{100 * summary.invalid:.1f} %"),
        ("speed", f"{summary.scans / summary.seconds:.0f} scans/s, from file to table"),
    ]
    from ..output.page import image_part, list_part, text_parts, write_parts

    page = target / "index.html"
    images = [image_part(caption, image.read_bytes()) for caption, image in figures]
    parts = [list_part(facts), *images, *text_parts([_NOTE])]
    write_parts(page, "lineament: lines and corners of a drive", parts)
    return [*facts, ("page", str(page))]


_NOTE = (
    "The last panel has the parameters of the paper: with the response in metres, the threshold "
    "0.66 finds only the corners of distant walls, and one line is fitted to a cluster without "
    "corners."
)


def _draw(
    target: Path, log: str | os.PathLike[str], extractor: Extractor, index: int
) -> Iterator[tuple[str, Path]]:
    """Draw a scan, its stages and, if the log has poses, a map; yield captions and files."""
    from ..output.figures import plot_map, plot_scan, plot_trace

    scan, path = open_log(log).scan(index), target / "scan.png"
    plot_scan(scan, {name: Extractor(name)(scan) for name in DEMO_METHODS}, path)
    yield f"Scan {index}: clusters, segments and corners.", path
    path = target / "trace.png"
    plot_trace(extractor.trace(scan), path)
    yield f"The stages of {DEMO_METHODS[0]} on that scan.", path
    posed = [(s.pose, extractor(s)) for s in open_log(log) if s.pose is not None]
    if posed:
        path = target / "map.png"
        plot_map(posed, path, title="What was found on the whole drive")
        yield "All scans, at the poses of the log.", path
