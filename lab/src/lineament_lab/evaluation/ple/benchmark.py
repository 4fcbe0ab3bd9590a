"""The benchmark: its scans and budgets, its authors' scores, and those of a method beside them."""

import json
import math
import os
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lineament.errors import LogError
from lineament.logs.lines import reading
from lineament.progress import Track, untracked
from lineament.scan import Array, LaserScan

from ..counts import plain
from .maps import MapMaker, method_map, score_map

#: Scores that the authors give; the last of the simulated set alone.
_GIVEN = ("rmse", "f", "fnr", "area_error")
#: Scores of one scan and budget, as of `MapScore`.
_NAMES = ("vertices", "rmse", "f", "fnr", "area_error", "iou")
_SCORE = np.dtype([(name, "i8" if name == "vertices" else "f8") for name in _NAMES])
#: Shapes of the keys of a file, N scans, M beams, K methods, J budgets; and of a simulated one.
_KEYS = {"azimuth": "NM", "radius": "NM", "beams": "N", "radius_limits": "N2", "max_vertices": "J"}
_KEYS |= {"methods": "K", **dict.fromkeys(_GIVEN[:3], "NKJ")}
_SIMULATED_KEYS = {"polygon": "NV2", "pose": "N3", "area_error": "NKJ"}
#: Kinds of their types, as of NumPy; of all others numbers.
_TYPES = {"methods": "U", "beams": "iu", "max_vertices": "iu"}


@dataclass(frozen=True, slots=True, eq=False)
class Benchmark:
    """Scans of the benchmark, and what its authors' methods reach on them."""

    #: Name of the file.
    name: str
    #: Ranges outside of the sensor's limits are NaN: beams that returned nothing.
    scans: tuple[LaserScan, ...]
    #: The budgets.
    max_vertices: tuple[int, ...]
    #: The authors' methods.
    methods: tuple[str, ...]
    #: Their "rmse" [m], "f", "fnr", and of the simulated set "area_error": scan, method, budget.
    scores: dict[str, Array]
    #: Vertices of the true polygon in the frame of each scan, (m, 2) [m], of the simulated set.
    outlines: tuple[Array, ...] | None = None

    def means(self) -> dict[str, dict[str, list[float]]]:
        """Mean of each of the authors' scores over the scans, by method and budget."""
        return {
            score: {method: _means(values[:, k]) for k, method in enumerate(self.methods)}
            for score, values in self.scores.items()
        }


@dataclass(frozen=True, slots=True, eq=False)
class BenchmarkResult:
    """What a method reaches on a benchmark."""

    benchmark: Benchmark
    method: str
    #: Structured array with the fields of `MapScore`, (scans, budgets).
    scores: NDArray[np.void]

    def means(self) -> dict[str, list[float]]:
        """Mean of each score over the scans, by budget; without scores that no scan has."""
        means = {score: _means(self.scores[score]) for score in _NAMES}
        return {score: mean for score, mean in means.items() if not all(map(math.isnan, mean))}

    def to_json(self) -> str:
        """Write everything as JSON: means, the authors' means, and the scores of each scan.

        ``mean[score]`` and ``authors[score][method]`` list the means by budget; ``scans[i]``
        lists, by budget, ``max_vertices`` and the scores. An undefined value is null.
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
                    {"max_vertices": budget, **dict(zip(_NAMES, row.item(), strict=True))}
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

    The method is the name of one (see `method_map`), or a function of a scan and a number of
    vertices that makes polylines; the result has its name, or the one given.
    ``track(scans, name, whole)`` yields the scans, and shows the progress. Raises ValueError if
    there is no such method, or a map has more vertices than allowed.

    Examples
    --------
    >>> scan = LaserScan([2.0, 2.0, 2.0], angle_min=-0.01, angle_increment=0.01)
    >>> run_benchmark(Benchmark("wall", (scan,), (2,), (), {}), "iepf").means()["vertices"]
    [2.0]
    """
    make = method_map(method) if isinstance(method, str) else method
    if name is None:
        name = method if isinstance(method, str) else getattr(method, "__name__", repr(method))
    scores = np.zeros((len(benchmark.scans), len(benchmark.max_vertices)), _SCORE)
    for i, scan in enumerate(track(benchmark.scans, name, benchmark.scans)):
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


def _means(values: Array) -> list[float]:
    """Mean over the scans (rows) that have a value, for each budget (column); NaN of none."""
    known = (column[~np.isnan(column)] for column in values.T)
    return [float(np.mean(column)) if len(column) else math.nan for column in known]


def load_benchmark(path: str | os.PathLike[str]) -> Benchmark:
    """Read one of the two files of the benchmark.

    It is a NumPy archive with the keys ``azimuth`` rad and ``radius`` m (N, M), the first ``beams``
    (N,) of each row in use, ``radius_limits`` (N, 2) m, ``max_vertices`` (J,), ``methods`` (K,),
    ``rmse``, ``f``, ``fnr`` (N, K, J); for the simulated set ``polygon`` (N, V, 2), padded with
    NaN, ``pose`` (N, 3) and ``area_error`` (N, K, J). LogError names the file and the key that is
    missing or wrong.
    """
    path = Path(path)
    with reading(path), path.open("rb") as file:
        try:
            with np.load(file, allow_pickle=False) as archive:
                arrays = {key: archive[key] for key in archive.files}
        # A damaged archive fails in a dozen ways, in zipfile, zlib, struct and numpy's parser.
        except Exception as error:
            problem = " ".join(f"is no whole npz archive: {type(error).__name__}: {error}".split())
            raise LogError(path, problem) from None
    try:
        _check(arrays)
        return Benchmark(
            name=path.name,
            scans=tuple(_scan(arrays, i) for i in range(len(arrays["beams"]))),
            max_vertices=tuple(arrays["max_vertices"].tolist()),
            methods=tuple(arrays["methods"].tolist()),
            scores={key: arrays[key] for key in _GIVEN if key in arrays},
            outlines=_outlines(arrays) if "polygon" in arrays else None,
        )
    except ValueError as error:
        raise LogError(path, str(error)) from None


def _check(arrays: dict[str, NDArray[Any]]) -> None:
    """Check that the keys are there and fit each other; ValueError if not."""
    sizes = {"2": 2, "3": 3}
    for key, letters in (_KEYS | (_SIMULATED_KEYS if "polygon" in arrays else {})).items():
        if key not in arrays:
            found = ", ".join(arrays) or "none"
            raise ValueError(f"has no key {key}, which a benchmark has; found {found}")
        array = arrays[key]
        names = ", ".join(str(sizes.get(letter, letter)) for letter in letters)
        if array.ndim != len(letters) or any(
            sizes.setdefault(letter, n) != n for letter, n in zip(letters, array.shape, strict=True)
        ):
            raise ValueError(f"{key} has shape {array.shape}, expected ({names})")
        if array.dtype.kind not in _TYPES.get(key, "fiu"):
            raise ValueError(f"{key} has type {array.dtype}")
    bad = np.flatnonzero((arrays["beams"] < 0) | (arrays["beams"] > sizes["M"]))
    if len(bad):
        raise ValueError(f"beams[{bad[0]}] is {arrays['beams'][bad[0]]}, expected 0 … {sizes['M']}")


def _scan(arrays: dict[str, NDArray[Any]], i: int) -> LaserScan:
    """Make a scan of a row. A range is a return from one limit to the other, both included."""
    radius, (low, high) = arrays["radius"][i, : arrays["beams"][i]], arrays["radius_limits"][i]
    # Not by range_max, at which a range would be invalid.
    returned = np.isfinite(radius) & (radius >= low) & (radius <= high)
    ranges, angles = np.where(returned, radius, np.nan), arrays["azimuth"][i, : len(radius)]
    try:
        return LaserScan(ranges, angles=angles)
    except ValueError as error:
        raise ValueError(f"scan {i}: {error}") from None


def _outlines(arrays: dict[str, NDArray[Any]]) -> tuple[Array, ...]:
    """Bring the true polygon of each scan into the frame of its sensor."""
    outlines = []
    for polygon, (x, y, theta) in zip(arrays["polygon"], arrays["pose"], strict=True):
        c, s = math.cos(theta), math.sin(theta)
        vertices = polygon[np.isfinite(polygon).all(axis=1)] - (x, y)
        outlines.append(vertices @ np.array([[c, -s], [s, c]]))
    return tuple(outlines)
