"""The methods that experiments compare, by their names in tables, and claims about them."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from lineament.extractor import Extractor
from lineament.features import SEGMENT, Features
from lineament.methods import METHODS, get_method
from lineament.methods.stages import fit_line
from lineament.scan import LaserScan

from ..methods import RIVALS
from ..methods.controls import BlindCut, OperatorCut
from .experiment import Judged, Margins

#: The paper by its letter; by the reading that brings Figure 9 nearest; with better last steps.
PAPER, FIGURE_9, LIU = "liu:paper", "liu:figure9", "liu"
TUNED, LIU_SHARED = "liu:tuned", "liu’s operator, shared steps"
BLIND = "blind cut, shared steps"
#: The rival of the paper, as published.
IEPF = "iepf:paper"
PDBS_LINES = "pdbs, fitted"
#: The method that returns clusters and breakpoints only.
PARTITION_ONLY = "pdbs"
#: Methods that return corners only, and are compared by how many are found again.
KEYPOINTS = ("falko:paper", "falko", "flirt")


Extract = Callable[[LaserScan], Features]


def liu_methods() -> dict[str, Extractor]:
    """Make `liu`, and its presets that experiments compare."""
    return {name: Extractor(name) for name in (PAPER, FIGURE_9, LIU, TUNED)}


def every_method(more: Iterable[str] = ()) -> dict[str, Extractor]:
    """Make all methods of lines: rivals as published, then with the shared steps; the control."""
    methods = liu_methods() | {LIU_SHARED: Extractor(OperatorCut())}
    of_keypoints = {name.partition(":")[0] for name in KEYPOINTS}
    for name in (*METHODS, *(rival for rival in RIVALS if rival not in of_keypoints)):
        published = hasattr(get_method(name), "published")
        names = (f"{name}:paper", name) if published else (name,)
        methods |= {one: Extractor(one) for one in names if name != LIU}
    methods |= {name: Extractor(name) for name in more}
    return methods | {BLIND: Extractor(BlindCut())}


def feature_methods(more: Iterable[str] = ()) -> dict[str, Extractor]:
    """Make all methods that return segments."""
    methods = every_method(more)
    del methods[PARTITION_ONLY]
    return methods


def corner_methods(more: Iterable[str] = ()) -> dict[str, Extractor]:
    """Make all methods that return segments, and those that return corners only."""
    return feature_methods(more) | {name: Extractor(name) for name in KEYPOINTS}


def fitted_methods(more: Iterable[str] = ()) -> dict[str, Extract]:
    """Make all methods; `pdbs` with a line for each cluster, as in the paper's Figure 11."""
    methods: dict[str, Extract] = {}
    for name, extractor in every_method(more).items():
        if name == PARTITION_ONLY:
            methods[PDBS_LINES] = partial(_with_lines, extractor)
        else:
            methods[name] = extractor
    return methods


def is_drawn(name: str) -> bool:
    """Whether pictures show a method: as published the paper's own and its IEPF alone.

    Tables have all of them.
    """
    published = name.endswith(":paper") and name not in (PAPER, IEPF)
    return not (published or name in (LIU_SHARED, BLIND))


def by_letter(about: str, measure: Callable[[Any, str], tuple[str, Margins]], *more: str) -> Any:
    """Judge a measure of methods by the paper's letter; what others have stands beside it."""

    def judge(n: Any) -> Judged:
        here, margins = measure(n, PAPER)
        beside = (f"{name} {measure(n, name)[0]}" for name in (FIGURE_9, LIU, *more))
        here = f"{about}: {here} (beside it: {', '.join(beside)})"
        return Judged(here, margins, measure(n, BLIND)[1])

    return judge


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
