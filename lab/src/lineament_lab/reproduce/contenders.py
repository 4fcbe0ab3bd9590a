"""The methods that experiments compare, by their names in tables."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from lineament.extractor import Extractor
from lineament.features import SEGMENT, Features
from lineament.methods import METHODS, get_method
from lineament.methods.stages import fit_line
from lineament.scan import LaserScan

from .controls import BlindCut, OperatorCut
from .findings import Progress, Setting
from .grid import best_parameters

LITERAL, LITERAL_BEST = "liu:paper, paper’s numbers", "liu:paper, best of Figure 9"
LIU_PAPER, LIU_BEST = "liu, paper’s numbers", "liu, best of Figure 9"
LIU_TUNED, LIU_SHARED = "liu:tuned", "liu’s operator, shared steps"
BLIND = "blind cut, shared steps"
PDBS_LINES = "pdbs, fitted"
#: The method that returns clusters and breakpoints only.
PARTITION_ONLY = "pdbs"

LIU_NOTE = (
    "liu:paper has the paper’s last steps: y = kx + b through filtered ranges, corners on "
    "measured points; the response is the reading of equation 22 by which Figure 9 reproduces "
    "best. liu fits lines to the raw ranges, and corners are where they meet. Both run with the "
    "paper’s numbers and with those that its experiment, Figure 9, finds best here; liu:tuned has "
    "numbers chosen as those of its rivals were: by F1 of corners, in simulated scenes of which "
    "nothing is reported."
)
RIVALS_NOTE = (
    "Each rival has two rows: name:paper is the method as published, with its own clusters or none "
    "and nothing shared; the plain name has clusters and last steps in common with the others "
    "(merging, borders, intersections). ‘Blind cut’ is the control: those shared steps after cuts "
    "at every eighth point, with no detector at all. What does not beat it says nothing of "
    "detection. ‘liu’s operator’ has the shared steps, too. A dash: the method has no corners."
)

Extract = Callable[[LaserScan], Features]


def liu_methods(setting: Setting, progress: Progress) -> dict[str, Extractor]:
    """Make `liu` and its preset `paper`, with the paper's numbers, the best of Figure 9, tuned."""
    best = best_parameters(setting, progress)
    return {
        LITERAL: Extractor("liu:paper"),
        LITERAL_BEST: best.extractor("liu:paper"),
        LIU_PAPER: Extractor("liu"),
        LIU_BEST: best.extractor("liu"),
        LIU_TUNED: Extractor("liu:tuned"),
    }


def every_method(setting: Setting, progress: Progress) -> dict[str, Extractor]:
    """Make all methods; rivals as published, then with the shared steps; at the end the control."""
    methods = liu_methods(setting, progress) | {LIU_SHARED: Extractor(OperatorCut())}
    for name in METHODS:
        published = hasattr(get_method(name), "published")
        names = (f"{name}:paper", name) if published else (name,)
        methods |= {one: Extractor(one) for one in names if name != "liu"}
    return methods | {BLIND: Extractor(BlindCut())}


def feature_methods(setting: Setting, progress: Progress) -> dict[str, Extractor]:
    """Make all methods that return segments."""
    methods = every_method(setting, progress)
    del methods[PARTITION_ONLY]
    return methods


def fitted_methods(setting: Setting, progress: Progress) -> dict[str, Extract]:
    """Make all methods; `pdbs` with a line for each cluster, as in the paper's Figure 11."""
    methods: dict[str, Extract] = {}
    for name, extractor in every_method(setting, progress).items():
        if name == PARTITION_ONLY:
            methods[PDBS_LINES] = partial(_with_lines, extractor)
        else:
            methods[name] = extractor
    return methods


def is_drawn(name: str) -> bool:
    """Whether pictures show a method: of the rivals as published the paper's IEPF alone.

    Tables have all of them.
    """
    left_out = (LITERAL, LITERAL_BEST, LIU_SHARED, BLIND)
    return name == "iepf:paper" or not (name in left_out or name.endswith(":paper"))


def _with_lines(extract: Extractor, scan: LaserScan) -> Features:
    return region_lines(scan, extract(scan))


def region_lines(scan: LaserScan, features: Features) -> Features:
    """Fit one line to each cluster, by orthogonal least squares."""
    lines = []
    ends = np.flatnonzero(scan.valid)[[0, -1]] if scan.valid.any() else None
    for cluster in range(int(features.clusters.max(initial=-1)) + 1):
        beams = np.flatnonzero(features.clusters == cluster)
        if len(beams) < 2:
            continue
        gaps = np.diff(beams)
        if scan.is_full_circle and (beams[[0, -1]] == ends).all() and gaps.max() > 1:
            # It continues over the seam: it begins behind the gap.
            beams = np.roll(beams, -1 - int(np.argmax(gaps)))
        line = fit_line(scan.points[beams], noise=features.noise).copy()
        line["first_beam"], line["last_beam"], line["cluster"] = beams[0], beams[-1], cluster
        lines.append(line)
    return replace(features, segments=np.array(lines, SEGMENT))
