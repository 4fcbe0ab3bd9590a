"""A demonstration: a simulated drive, or a log, into a table and a page."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import LineamentError
from ..extractor import Extractor, load_kernels
from ..features import Features
from ..files import check_outputs, made_folder
from ..logs import open_log
from ..output import canvas
from ..progress import Track, untracked
from ..scan import LaserScan, Pose
from .extract import extract_log

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Methods in the pictures; the first makes the table.
DEMO_METHODS = ("optimal", "liu:scale_free", "liu:paper")
#: Names of the pictures; of the last two a log has one.
_PICTURES = ("scan", "corner", "trace", "methods", "map", "scans")
#: The simulated log; and how the title of a page begins.
_DRIVE, _TITLE = "drive.npz", "lineament: lines and corners of "
#: How many scans one picture shows.
_MOMENTS = 6


def run_demo(
    folder: str | os.PathLike[str],
    log: str | os.PathLike[str] | None = None,
    *,
    limits: Mapping[str, int] | None = None,
    track: Track = untracked,
) -> list[tuple[str, str]]:
    """Simulate a drive (or take a log), extract its features, and make a page of pictures.

    Returns names and values: files and figures. The page is ``index.html``, the table
    ``features.parquet``. ``track(items, about, whole)`` yields the items and shows the progress;
    `limits` are as for `lineament.open_log`.

    Raises
    ------
    LineamentError
        If the log cannot be read, or the folder cannot be written, or has files of such names that
        no demo made.
    """
    if log is not None:
        open_log(log, limits=limits)  # before a folder is made for it
    target = made_folder(folder)
    page, table = target / "index.html", target / "features.parquet"
    drawn = [target / f"{name}.png" for name in _PICTURES]
    written = [page, table, *drawn, *([target / _DRIVE] if log is None else [])]
    check_outputs(written, () if log is None else (log,))
    _spare_others(page, written)
    load_kernels(map(Extractor, DEMO_METHODS))
    if log is None:
        from ..simulation import SENSORS, simulate_log

        log = target / _DRIVE
        simulate_log(log, "building", SENSORS["utm30lx"], rate=4.0, seed=1, track=track)
    extractor = Extractor(DEMO_METHODS[0])
    summary = extract_log(log, table, extractor, track=track, limits=limits)
    if summary.scans == 0:
        raise LineamentError(f"{log}: has no scans")
    for path in drawn:  # of another log
        path.unlink(missing_ok=True)
    pictures = list(
        track(_draw(target, log, extractor, summary.scans, limits), "drawing", _PICTURES[:-1])
    )
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
    from ..output.page import image_part, list_part, write_parts

    images = [image_part(caption, path.read_bytes(), dark=dark) for caption, path, dark in pictures]
    write_parts(page, f"{_TITLE}{Path(log).name}", [*images[:1], list_part(facts), *images[1:]])
    return [*facts, ("page", str(page))]


def _spare_others(page: Path, written: list[Path]) -> None:
    """Raise a LineamentError where files that no demo made would be replaced."""
    there = [path for path in written if path.exists()]
    if there and not (page.exists() and _TITLE in page.read_text("utf-8", "replace")):
        raise LineamentError(
            f"{there[0]}: is of no demo and would be replaced: name another folder"
        )


def _draw(
    target: Path,
    log: str | os.PathLike[str],
    extractor: Extractor,
    total: int,
    limits: Mapping[str, int] | None,
) -> Iterator[tuple[str, Path, bytes]]:
    """Draw one scan, a corner of it, how they were found, other methods, and the drive.

    Yields captions, files, and the same pictures on black.
    """
    from ..output import figures
    from ..output.stages import trace_figure

    posed, moments, (index, scan, features) = _drive(log, extractor, total, limits)
    method, drive = extractor.method.name, Path(log).name
    title = figures.scan_title(log, index, scan)

    def drawn(name: str, caption: str, draw: Callable[..., Figure]) -> tuple[str, Path, bytes]:
        path = target / f"{name}.png"
        canvas.save(draw(), path)
        return caption, path, canvas.figure_bytes(draw(dark=True), canvas.DPI)

    yield drawn(
        "scan",
        "What the scanner saw, and what was found in it: points have the colour of their cluster, "
        "lines are segments, diamonds are corners; nothing came back from shaded sectors.",
        partial(figures.scan_figure, scan, {method: features}, title=title),
    )
    corners = features.corners
    quality = np.where(corners["kind"] == "corner", corners["quality"], 0.0)
    if quality.any():
        k = int(quality.argmax())
        caption = "How sure it is: the corner of the highest quality, close up."
        if features.noise is not None:
            caption += f" Ranges scatter by {1e3 * features.noise.sigma:.1f} mm."
        close_up = partial(figures.corner_figure, scan, features, k, title=f"{title} · {method}")
        yield drawn("corner", caption, close_up)
    yield drawn(
        "trace",
        "How it was found: beams farther apart than the threshold begin a new cluster, and each "
        "corner explains the measurements better, by more than a threshold, than a line would.",
        partial(trace_figure, extractor.trace(scan), title=f"{title} · {method}"),
    )
    found = {name: Extractor(name)(scan) for name in DEMO_METHODS}
    yield drawn(
        "methods",
        "Other methods on that scan. The last panel has the parameters of the paper: with the "
        "response in metres, the threshold 0.66 finds only the corners of distant walls, and one "
        "line is fitted to a cluster without corners.",
        partial(figures.scan_figure, scan, found, title=title),
    )
    if posed:
        caption = "The whole drive: all scans, at the poses of the log."
        yield drawn("map", caption, partial(figures.map_figure, posed, title=drive))
    else:
        caption = "Scans from the first to the last; the log has no poses for a map."
        yield drawn("scans", caption, partial(figures.scans_figure, moments, title=drive))


def _drive(
    log: str | os.PathLike[str],
    extractor: Extractor,
    total: int,
    limits: Mapping[str, int] | None,
) -> tuple[
    list[tuple[Pose, Features]], list[tuple[str, LaserScan, Features]], tuple[int, LaserScan, Any]
]:
    """Return what was found at each pose, some scans, and the scan to show.

    That is one with many corners of high quality, and few measurements in no segment.
    """
    posed, moments, most = [], [], -1.0
    kept = set(np.linspace(0, total - 1, _MOMENTS).round().astype(int).tolist())
    for index, scan in enumerate(open_log(log, limits=limits)):
        features = extractor(scan)
        explained = features.segments["n_points"].sum()
        quality = float(np.nansum(features.corners["quality"] ** 2))
        quality *= (explained / max(int(scan.valid.sum()), 1)) ** 2  # not one full of clutter
        if quality > most:
            most, best = quality, (index, scan, features)
        if index in kept:
            moments.append((f"scan {index}", scan, features))
        if scan.pose is not None:
            posed.append((scan.pose, features))
    return posed, moments, best
