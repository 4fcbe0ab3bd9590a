"""A demonstration: a simulated drive, or a log, into a table and a page."""

import os
from pathlib import Path

from ..errors import LineamentError
from ..extractor import Extractor
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
    if log is None:
        from ..simulation import SENSORS, simulate_log

        log = target / "drive.npz"
        simulate_log(log, "building", SENSORS["utm30lx"], rate=4.0, seed=1, track=track)
    extractor = Extractor(DEMO_METHODS[0])
    summary = extract_log(log, target / "features.parquet", extractor, track=track)
    if summary.scans == 0:
        raise LineamentError(f"{log}: has no scans")
    figures = _draw(target, log, summary.scans, track)
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
    target: Path, log: str | os.PathLike[str], n_scans: int, track: Track
) -> list[tuple[str, Path]]:
    from ..output.figures import plot_map, plot_scan, plot_trace

    scan = open_log(log).scan(n_scans // 2)
    extractors = {name: Extractor(name) for name in DEMO_METHODS}
    figures = [
        (f"Scan {n_scans // 2}: clusters, segments and corners.", target / "scan.png"),
        (f"The stages of {DEMO_METHODS[0]} on that scan.", target / "trace.png"),
    ]
    steps = iter(track(range(3), "drawing", 3))
    next(steps)
    plot_scan(scan, {name: e(scan) for name, e in extractors.items()}, figures[0][1])
    next(steps)
    plot_trace(extractors[DEMO_METHODS[0]].trace(scan), figures[1][1])
    next(steps)
    extractor = extractors[DEMO_METHODS[0]]
    posed = [(s.pose, extractor(s)) for s in open_log(log) if s.pose is not None]
    if posed:
        figures.append(("All scans, at the poses of the log.", target / "map.png"))
        plot_map(posed, figures[-1][1], title="What was found on the whole drive")
    next(steps, None)
    return figures
