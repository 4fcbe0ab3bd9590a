"""The methods that experiments put side by side, by the names that tables give them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..extractor import Extractor
from ..features import SEGMENT, Features
from ..methods import METHODS
from ..methods.stages import fit_line
from ..scan import LaserScan
from .findings import Progress, Setting
from .repetition_grid import best_parameters

__all__ = [
    "LITERAL",
    "LITERAL_BEST",
    "LIU_BEST",
    "LIU_NOTE",
    "LIU_PAPER",
    "PARTITION_ONLY",
    "PDBS_LINES",
    "Extract",
    "drawn_methods",
    "every_method",
    "feature_methods",
    "liu_methods",
    "region_lines",
]

LITERAL, LITERAL_BEST = "liu:paper, paper’s numbers", "liu:paper, best of Figure 9"
LIU_PAPER, LIU_BEST = "liu, paper’s numbers", "liu, best of Figure 9"
PDBS_LINES = "pdbs, fitted"
#: Methods that give clusters and breakpoints alone.
PARTITION_ONLY = ("pdbs",)

#: What the rows of `liu` are.
LIU_NOTE = (
    "liu:paper is the paper’s literal pipeline: y = kx + b through filtered ranges, corners on "
    "readings. liu fits lines to the raw ranges, and puts corners where they meet. Both stand with "
    "the paper’s own numbers and with those that its own experiment, Figure 9, finds best."
)

Extract = Callable[[LaserScan], Features]


def liu_methods(setting: Setting, progress: Progress) -> dict[str, Extractor]:
    """Make `liu` and its literal preset, with the paper's numbers and the best of Figure 9."""
    best = best_parameters(setting, progress)
    return {
        LITERAL: Extractor("liu:paper"),
        LITERAL_BEST: best.extractor("liu:paper"),
        LIU_PAPER: Extractor("liu"),
        LIU_BEST: best.extractor("liu"),
    }


def every_method(setting: Setting, progress: Progress) -> dict[str, Extractor]:
    """Make all methods, those other than `liu` with their defaults."""
    others = {name: Extractor(name) for name in METHODS if name != "liu"}
    return liu_methods(setting, progress) | others


def feature_methods(setting: Setting, progress: Progress) -> dict[str, Extractor]:
    """Make all methods that give segments and corners."""
    methods = every_method(setting, progress)
    return {name: m for name, m in methods.items() if name not in PARTITION_ONLY}


def drawn_methods(setting: Setting, progress: Progress) -> dict[str, Extract]:
    """Make the methods of pictures: without the literal preset, and `pdbs` with lines.

    The paper's Figure 11 fits one line to each region of PDBS.
    """
    methods: dict[str, Extract] = {}
    for name, extractor in every_method(setting, progress).items():
        if name == "pdbs":
            methods[PDBS_LINES] = _fitted(extractor)
        elif name not in (LITERAL, LITERAL_BEST):
            methods[name] = extractor
    return methods


def _fitted(extractor: Extractor) -> Extract:
    return lambda scan: region_lines(scan, extractor(scan))


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
        if _wraps(beams, scan):
            # It begins behind the gap.
            beams = np.roll(beams, -1 - int(np.argmax(np.diff(beams))))
        line = fit_line(scan.points[beams], noise=features.noise).copy()
        line["first_beam"], line["last_beam"], line["cluster"] = beams[0], beams[-1], cluster
        lines.append(line)
    return replace(features, segments=np.array(lines, SEGMENT))


def _wraps(beams: np.ndarray, scan: LaserScan) -> bool:
    """Whether a cluster goes on over the seam of a full circle."""
    ends = np.flatnonzero(scan.valid)[[0, -1]]
    return bool(scan.is_full_circle and (beams[[0, -1]] == ends).all() and np.diff(beams).max() > 1)
