"""What is true of the features of any scan, whoever found them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..features import TABLES, Features
from ..scan import LaserScan

#: Ten deviations of the noise of plain scans [m].
_NOISE = 0.1
#: Not known of each corner: NaN then.
_MAY_BE_UNKNOWN = ("opening", "quality", "response")


def first_problem(features: Features, scan: LaserScan) -> str:
    """Return what cannot be of the features of a scan, "" if all can be."""
    return next(_problems(features, scan), "")


def difference(one: Features, other: Features) -> str:
    """Return where features are not the same in every bit, "" if they are."""
    for table, dtype in TABLES.items():
        mine, others = one[table], other[table]
        if len(mine) != len(others):
            return f"{len(mine)} {table} in place of {len(others)}"
        for field in dtype.names or ():
            if mine[field].tobytes() != others[field].tobytes():
                return f"{table} differ in {field}"
    return "" if one.clusters.tobytes() == other.clusters.tobytes() else "clusters differ"


def ends_of(features: Features) -> NDArray[np.float64]:
    """Return the ends of all segments, shape (n, 4)."""
    return np.hstack((features["segments"]["start"], features["segments"]["end"]))


def _problems(features: Features, scan: LaserScan) -> Iterator[str]:
    n, clusters = len(scan), features.clusters
    if clusters.shape != (n,):
        yield f"clusters have shape {clusters.shape}, expected ({n},)"
        return
    for table in TABLES:
        yield from _numbers(table, features[table])
    for table, names in (
        ("segments", ("first_beam", "last_beam")),
        ("arcs", ("first_beam", "last_beam")),
        ("corners", ("beam",)),
        ("edges", ("beam",)),
    ):
        for name in names:
            beams = features[table][name]
            yield from _outside(table, f"{name} is", beams, 0, n)
            yield from _first(table, ~scan.valid[beams], f"{name} is not a valid beam")
    yield from _ends_of_surfaces(features["breakpoints"], scan)
    yield from _clusters(clusters, scan)
    own = clusters[features["segments"]["first_beam"]]
    wrong = own != features["segments"]["cluster"]
    yield from _first("segments", wrong, "cluster is not that of its first beam")
    n_segments = len(features["segments"])
    yield from _outside("corners", "segments has", features["corners"]["segments"], -1, n_segments)
    yield from _outside("edges", "segment is", features["edges"]["segment"], -1, n_segments)
    for table in ("segments", "arcs"):
        rows = features[table]
        most = (rows["last_beam"] - rows["first_beam"]) % max(n, 1) + 1
        wrong = (rows["n_points"] < 2) | (rows["n_points"] > most)
        yield from _first(table, wrong, "has fewer than 2 points, or more than beams")
    for name in ("rms", "misfit"):
        yield from _first("segments", features["segments"][name] < 0, f"{name} is negative")
    yield from directions(features["segments"])


def _numbers(table: str, rows: NDArray[np.void]) -> Iterator[str]:
    for name in rows.dtype.names or ():
        values = rows[name]
        if values.dtype.kind != "f" or name in _MAY_BE_UNKNOWN:
            continue
        flat = values.reshape(len(values), values[:1].size or 1)
        yield from _first(table, ~np.isfinite(flat).all(axis=1), f"{name} is not finite")
        if name == "covariance":
            transposed = np.swapaxes(values, 1, 2)
            is_symmetric = (values == transposed).all(axis=(1, 2))
            yield from _first(table, ~is_symmetric, "covariance is not symmetric")
            yield from _first(table, ~positive(values), "covariance is not positive definite")


def positive(covariances: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return whether each is positive definite, in units of its deviations: Gm, or nrad."""
    variances = np.diagonal(covariances, axis1=1, axis2=2)
    good: NDArray[np.bool_] = np.all(variances > 0, axis=1)
    scale = np.sqrt(np.where(good[:, None], variances, 1.0))
    units = np.where(good[:, None, None], covariances, np.eye(covariances.shape[-1]))
    least = np.linalg.eigvalsh(units / (scale[:, :, None] * scale[:, None])).min(axis=1, initial=1)
    positive: NDArray[np.bool_] = good & (least > 0)
    return positive


def directions(segments: NDArray[np.void]) -> Iterator[str]:
    """Yield which segments do not lead from their start to their end, as long as they say."""
    way = segments["end"] - segments["start"]
    lengths = np.hypot(*way.T)
    wrong = np.abs(lengths - segments["length"]) > 1e-9 * lengths
    yield from _first("segments", wrong, "length is not the distance from start to end")
    u = np.column_stack((np.cos(segments["angle"]), np.sin(segments["angle"])))
    along, across = (way * u).sum(axis=1), way[:, 1] * u[:, 0] - way[:, 0] * u[:, 1]
    digits = 1e-9 * np.abs(segments["centroid"]).max(axis=1, initial=0.0)
    wrong = (along <= 0) | (np.abs(across) > 1e-6 * along + digits)
    yield from _first("segments", wrong, "angle is not the direction from start to end")


def _ends_of_surfaces(breakpoints: NDArray[np.void], scan: LaserScan) -> Iterator[str]:
    beams = breakpoints["beam"]
    yield from _outside("breakpoints", "beam is", beams, -1, len(scan))
    known = beams >= 0
    yield from _first("breakpoints", (known & ~scan.valid[beams]).any(axis=1), "has no valid beam")
    wrong = known.sum(axis=1) != np.where(breakpoints["kind"] == "scan_end", 1, 2)
    yield from _first("breakpoints", wrong, "has not two beams, or one where the scan ends")


def _clusters(clusters: NDArray[np.int32], scan: LaserScan) -> Iterator[str]:
    yield from _outside("beams", "cluster is", clusters, -1, len(scan))
    yield from _first("beams", (clusters >= 0) & ~scan.valid, "is not valid, and in a cluster")
    used = np.unique(clusters[clusters >= 0])
    if not np.array_equal(used, np.arange(len(used))):
        yield f"clusters have the numbers {used.tolist()}, expected 0 to {len(used) - 1}"


def led_backwards(features: Features, scan: LaserScan) -> str:
    """Return which segment does not lead from its first to its last beam, "" if all do.

    Those of measurements that are as near to each other as noise puts them have no order.
    """
    rows = features["segments"]
    ends = scan.points[rows["last_beam"]] - scan.points[rows["first_beam"]]
    along = ((rows["end"] - rows["start"]) * ends).sum(axis=1)
    wrong = (along <= 0) & (np.hypot(*ends.T) > _NOISE)
    return next(_first("segments", wrong, "leads from its last beam to its first"), "")


def _outside(table: str, what: str, values: NDArray[Any], low: int, below: int) -> Iterator[str]:
    wrong = (values < low) | (values >= below)
    if wrong.any():
        where = int(np.argwhere(wrong)[0][0])
        yield f"{table}[{where}] {what} {values[wrong][0]}, expected {low} to {below - 1}"


def _first(table: str, wrong: NDArray[np.bool_], problem: str) -> Iterator[str]:
    if wrong.any():
        yield f"{table}[{int(np.argmax(wrong))}] {problem}"
