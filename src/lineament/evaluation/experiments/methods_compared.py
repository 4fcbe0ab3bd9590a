"""What is compared: every method as it is, and `liu` with two sets of numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice

import numpy as np

from ...extractor import Extractor
from ...features import SEGMENT, Features
from ...logs import open_log
from ...methods import METHODS
from ...scan import LaserScan
from ...stages import fit_line
from .findings import Setting
from .repetition_grid import best_parameters

__all__ = [
    "LIU_BEST",
    "LIU_PAPER",
    "PDBS_LINES",
    "compared_methods",
    "recorded_scans",
    "region_lines",
]

LIU_PAPER, LIU_BEST, PDBS_LINES = "liu, paper’s numbers", "liu, best of Figure 9", "pdbs, fitted"

#: Recordings of which pictures and similarity errors are made.
LOGS = {
    "Intel lab": "carmen/intel-corrected.log.gz",
    "MIT CSAIL": "carmen/csail-corrected.log.gz",
    "ACES": "carmen/aces-corrected.log.gz",
}

Extract = Callable[[LaserScan], Features]


def compared_methods(setting: Setting, progress: Callable[[str], None]) -> dict[str, Extract]:
    """Make all methods, those of the paper first.

    `liu` comes with the paper's numbers and with those that its own experiment, Figure 9, finds
    best. `pdbs` gives regions alone: each is fitted by one line, as in the paper's Figure 11.
    """
    best = best_parameters(setting, progress).extractor("liu")
    pdbs = Extractor("pdbs")
    chosen: dict[str, Extract] = {
        LIU_PAPER: Extractor("liu"),
        LIU_BEST: best,
        PDBS_LINES: lambda scan: region_lines(scan, pdbs(scan)),
    }
    return chosen | {name: Extractor(name) for name in METHODS if name not in ("liu", "pdbs")}


def region_lines(scan: LaserScan, features: Features) -> Features:
    """Fit one line to each cluster, by orthogonal least squares.

    Examples
    --------
    >>> scan = LaserScan([2.0] * 5 + [4.0] * 5, angle_min=0.0, angle_increment=0.01)
    >>> len(region_lines(scan, Extractor("pdbs")(scan)).segments)
    2
    """
    lines = []
    for cluster in range(int(features.clusters.max(initial=-1)) + 1):
        beams = np.flatnonzero(features.clusters == cluster)
        if len(beams) < 2:
            continue
        # One that goes on over the seam begins behind the gap.
        beams = (
            np.roll(beams, -1 - int(np.argmax(np.diff(beams)))) if _wraps(beams, scan) else beams
        )
        line = fit_line(scan.points[beams], noise=features.noise).copy()
        line["first_beam"], line["last_beam"], line["cluster"] = beams[0], beams[-1], cluster
        lines.append(line)
    return replace(features, segments=np.array(lines, SEGMENT))


def recorded_scans(setting: Setting, count: int) -> Iterator[tuple[str, list[LaserScan]]]:
    """Give so many scans of each recording that is there, from equal parts of it."""
    for name, file in LOGS.items():
        path = setting.recording(file)
        if path is not None:
            log = open_log(path, keep_going=True)
            step = max(len(log) // count, 1)
            yield name, list(islice(log, step // 2, None, step))[:count]


def _wraps(beams: np.ndarray, scan: LaserScan) -> bool:
    ends = np.flatnonzero(scan.valid)[[0, -1]]
    return bool(scan.is_full_circle and (beams[[0, -1]] == ends).all() and np.diff(beams).max() > 1)
