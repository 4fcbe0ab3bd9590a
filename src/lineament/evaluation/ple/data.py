"""The public benchmark as files: its scans, its true outlines, and its authors' scores."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import LogError
from ...logs.lines import reading
from ...scan import Array, LaserScan

__all__ = ["Benchmark", "load_benchmark", "scan_means"]

#: Scores that the authors give; the last of the simulated set alone.
_GIVEN = ("rmse", "f", "fnr", "area_error")


@dataclass(frozen=True, slots=True, eq=False)
class Benchmark:
    """Scans of the benchmark, and what its authors' methods reach on them.

    Attributes
    ----------
    name : str
        Name of the file.
    scans : tuple of LaserScan
        Ranges outside of the sensor's limits are NaN: beams that returned nothing.
    max_vertices : tuple of int
        The budgets.
    methods : tuple of str
        The authors' methods.
    scores : dict of str to array, shape (scans, methods, budgets)
        Their "rmse" [m], "f", "fnr", and of the simulated set "area_error".
    outlines : tuple of arrays, shape (m, 2), or None
        Vertices of the true polygon in the frame of each scan [m], of the simulated set.
    """

    name: str
    scans: tuple[LaserScan, ...]
    max_vertices: tuple[int, ...]
    methods: tuple[str, ...]
    scores: dict[str, Array]
    outlines: tuple[Array, ...] | None = None

    def means(self) -> dict[str, dict[str, list[float]]]:
        """Mean of each of the authors' scores over the scans, by method and budget."""
        return {
            score: {method: scan_means(values[:, k]) for k, method in enumerate(self.methods)}
            for score, values in self.scores.items()
        }


def scan_means(values: Array) -> list[float]:
    """Mean over the scans (rows) that have a value, for each budget (column); NaN of none.

    Examples
    --------
    >>> scan_means(np.array([[1.0, np.nan, np.nan], [2.0, 4.0, np.nan]]))
    [1.5, 4.0, nan]
    """
    return [
        float(np.mean(known)) if len(known) else math.nan
        for known in (column[~np.isnan(column)] for column in values.T)
    ]


def load_benchmark(path: str | os.PathLike[str]) -> Benchmark:
    """Read half a benchmark.

    Parameters
    ----------
    path : path-like
        A NumPy archive with the keys ``azimuth`` rad and ``radius`` m (N, M), the first ``beams``
        (N,) of each row in use, ``radius_limits`` (N, 2) m, ``max_vertices`` (J,), ``methods``
        (K,), ``rmse``, ``f``, ``fnr`` (N, K, J); for the simulated set ``polygon`` (N, V, 2),
        padded with NaN, ``pose`` (N, 3) and ``area_error`` (N, K, J).

    Raises
    ------
    LogError
        If the file cannot be read, a key is missing, or its shape or a scan is wrong. The message
        names the file and the key.
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
        scans = tuple(_scan(arrays, i) for i in range(len(arrays["beams"])))
    except ValueError as error:
        raise LogError(path, str(error)) from None
    return Benchmark(
        name=path.name,
        scans=scans,
        max_vertices=tuple(arrays["max_vertices"].tolist()),
        methods=tuple(arrays["methods"].tolist()),
        scores={key: arrays[key] for key in _GIVEN if key in arrays},
        outlines=_outlines(arrays) if "polygon" in arrays else None,
    )


def _check(arrays: dict[str, NDArray[Any]]) -> None:
    """Check that the keys are there and fit each other; ValueError if not."""
    expected = {
        "azimuth": "NM",
        "radius": "NM",
        "beams": "N",
        "radius_limits": "N2",
        "max_vertices": "J",
        "methods": "K",
        **dict.fromkeys(_GIVEN[:3], "NKJ"),
    }
    if "polygon" in arrays:
        expected |= {"polygon": "NV2", "pose": "N3", "area_error": "NKJ"}
    sizes = {"2": 2, "3": 3}
    for key, letters in expected.items():
        if key not in arrays:
            found = ", ".join(arrays) or "none"
            raise ValueError(f"has no key {key}, which a benchmark has; found {found}")
        array = arrays[key]
        names = [str(sizes.get(letter, letter)) for letter in letters]
        agrees = array.ndim == len(letters) and all(
            sizes.setdefault(letter, n) == n for letter, n in zip(letters, array.shape, strict=True)
        )
        if not agrees:
            raise ValueError(f"{key} has shape {array.shape}, expected ({', '.join(names)})")
        wanted = {"methods": "U", "beams": "iu", "max_vertices": "iu"}.get(key, "fiu")
        if array.dtype.kind not in wanted:
            raise ValueError(f"{key} has type {array.dtype}")
    bad = np.flatnonzero((arrays["beams"] < 0) | (arrays["beams"] > sizes["M"]))
    if len(bad):
        raise ValueError(f"beams[{bad[0]}] is {arrays['beams'][bad[0]]}, expected 0 … {sizes['M']}")


def _scan(arrays: dict[str, NDArray[Any]], i: int) -> LaserScan:
    """Make a scan of a row. A range is a return from one limit to the other, both included."""
    radius, (low, high) = arrays["radius"][i, : arrays["beams"][i]], arrays["radius_limits"][i]
    # Not by range_max, at which a range would be none.
    returned = np.isfinite(radius) & (radius >= low) & (radius <= high)
    try:
        return LaserScan(
            np.where(returned, radius, np.nan), angles=arrays["azimuth"][i, : len(radius)]
        )
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
