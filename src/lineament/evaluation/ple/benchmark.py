"""The public benchmark of polyline extraction, with its authors' scores beside one's own.

A. Schaefer, D. Büscher, L. Luft, W. Burgard, *A maximum likelihood approach to extract polylines
from 2-D laser range scans*, IROS 2018: real scans of seven buildings and simulated ones of random
polygons, each mapped by polylines with at most 10, 20, … 50 vertices in all.
"""

from __future__ import annotations

import json
import math
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from ...progress import Track, untracked
from ..counts import plain
from .data import Benchmark, load_benchmark, scan_means
from .maps import (
    MapMaker,
    benchmark_iepf,
    iepf_map,
    method_map,
    polylines_of,
    sparing_map,
)
from .scores import MapScore, cast_map, score_map

__all__ = [
    "Benchmark",
    "BenchmarkResult",
    "MapMaker",
    "MapScore",
    "benchmark_iepf",
    "cast_map",
    "iepf_map",
    "load_benchmark",
    "method_map",
    "polylines_of",
    "run_benchmark",
    "score_map",
    "sparing_map",
]

#: Scores of one scan and budget, as of `MapScore`.
_SCORE = np.dtype(
    [("vertices", "i8"), *((name, "f8") for name in ("rmse", "f", "fnr", "area_error", "iou"))]
)


@dataclass(frozen=True, slots=True, eq=False)
class BenchmarkResult:
    """What a method reaches on a benchmark.

    Attributes
    ----------
    benchmark : Benchmark
    method : str
    scores : structured array, shape (scans, budgets)
        ``vertices`` used, ``rmse`` [m], ``f``, ``fnr``, ``area_error``, ``iou``; see `MapScore`.
    """

    benchmark: Benchmark
    method: str
    scores: NDArray[np.void]

    def means(self) -> dict[str, list[float]]:
        """Mean of each score over the scans, by budget; without scores that no scan has."""
        means = {score: scan_means(self.scores[score]) for score in _SCORE.names or ()}
        return {score: mean for score, mean in means.items() if not all(map(math.isnan, mean))}

    def to_json(self) -> str:
        """Write everything as JSON: means, the authors' means, and the scores of each scan.

        ``mean[score]`` and ``authors[score][method]`` list the means by budget; ``scans[i]``
        lists, by budget, ``max_vertices`` and the scores. What there is no value for is null.
        """
        budgets = self.benchmark.max_vertices
        everything = {
            "benchmark": self.benchmark.name,
            "method": self.method,
            "max_vertices": budgets,
            "mean": self.means(),
            "authors": self.benchmark.means(),
            "scans": [
                [
                    {"max_vertices": budget}
                    | dict(zip(_SCORE.names or (), row.item(), strict=True))
                    for budget, row in zip(budgets, rows, strict=True)
                ]
                for rows in self.scores
            ],
        }
        return json.dumps(plain(everything), indent=1, allow_nan=False)


def run_benchmark(
    benchmark: Benchmark,
    method: str | MapMaker,
    *,
    name: str | None = None,
    track: Track = untracked,
) -> BenchmarkResult:
    """Map all scans with all budgets, and score the maps.

    Parameters
    ----------
    benchmark : Benchmark
    method : str or MapMaker
        Name of a method (see `method_map`), or a function of a scan and a number of vertices that
        makes polylines, such as `iepf_map`.
    name : str, optional
        How the result is called; by default the name of the method or function.
    track : callable
        ``track(scans, name, total)`` gives the scans, and shows how far they are.

    Raises
    ------
    ValueError
        If there is no such method, or a map has more vertices than allowed.

    Examples
    --------
    >>> from lineament import LaserScan
    >>> scan = LaserScan([2.0, 2.0, 2.0], angle_min=-0.01, angle_increment=0.01)
    >>> none = np.empty((1, 0, 1))
    >>> benchmark = Benchmark("wall", (scan,), (2,), (), {"rmse": none, "f": none, "fnr": none})
    >>> run_benchmark(benchmark, iepf_map).scores["vertices"].tolist()
    [[2]]
    """
    make = method_map(method) if isinstance(method, str) else method
    if name is None:
        name = method if isinstance(method, str) else getattr(method, "__name__", repr(method))
    scores = np.zeros((len(benchmark.scans), len(benchmark.max_vertices)), _SCORE)
    for i, scan in enumerate(track(benchmark.scans, name, len(benchmark.scans))):
        outline = None if benchmark.outlines is None else benchmark.outlines[i]
        for j, budget in enumerate(benchmark.max_vertices):
            score = score_map(make(scan, budget), scan, outline)
            if score.vertices > budget:
                raise ValueError(
                    f"{name} made a map of {score.vertices} vertices of scan {i}, "
                    f"expected at most {budget}"
                )
            scores[i, j] = astuple(score)
    scores.flags.writeable = False
    return BenchmarkResult(benchmark, name, scores)
