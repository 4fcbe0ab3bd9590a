"""Features as an Arrow table, one row a feature. The schema is described in docs/formats.md."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from .._version import __version__
from . import TABLES, FeatureBatch, Features

__all__ = ["SCHEMA", "batch_table", "features_table"]

#: Values of the column `kind`, in the order in which the rows of a scan come.
KINDS = ("segment", "corner", "arc", "breakpoint", "cluster")
#: Values of the columns that tell the kind of a corner, and of a breakpoint.
TEXTS = {"corner": ("corner", "slit", "edge"), "breakpoint": ("jump", "gap", "scan_end")}
LABEL = np.dtype(np.int32)

Columns = dict[str, NDArray[Any]]


def _field(name: str, kind: pa.DataType, unit: str, about: str) -> pa.Field:
    return pa.field(name, kind, metadata={"unit": unit, "description": about})


_F, _I, _TEXT = pa.float64(), pa.int32(), pa.dictionary(pa.int32(), pa.string())

SCHEMA = pa.schema(
    [
        _field("kind", _TEXT, "", "segment, corner, arc, breakpoint or cluster"),
        _field("scan", pa.int64(), "", "index of the scan in its log, from 0"),
        _field("stamp", _F, "s", "stamp of the scan"),
        _field("index", _I, "", "index among the features of its kind in its scan"),
        _field("x", _F, "m", "segment: centroid; corner, breakpoint: position; arc: center"),
        _field("y", _F, "m", "as x"),
        _field("angle", _F, "rad", "segment: direction from start to end"),
        _field("start_x", _F, "m", "segment: start"),
        _field("start_y", _F, "m", "segment: start"),
        _field("end_x", _F, "m", "segment: end"),
        _field("end_y", _F, "m", "segment: end"),
        _field("cov_00", _F, "m²", "of segment (offset, angle), corner (x, y), arc (x, y, radius)"),
        _field("cov_01", _F, "m² or m·rad", "as cov_00; of a segment m·rad"),
        _field("cov_11", _F, "m² or rad²", "as cov_00; of a segment rad²"),
        _field("cov_02", _F, "m²", "of arc (x, y, radius)"),
        _field("cov_12", _F, "m²", "as cov_02"),
        _field("cov_22", _F, "m²", "as cov_02"),
        _field("radius", _F, "m", "arc"),
        _field("opening", _F, "rad", "corner: interior angle between its arms"),
        _field("convex", pa.bool_(), "", "corner: points towards the sensor"),
        _field("response", _F, "", "corner: strength, in the unit of the method"),
        _field("quality", _F, "", "corner: share found again from another place, 0 to 1"),
        _field("corner", _TEXT, "", "corner: corner, slit or edge"),
        _field("beam", _I, "", "corner: its beam"),
        _field("segment_before", _I, "", "corner: index of the segment before it, or -1"),
        _field("segment_after", _I, "", "corner: index of the segment after it, or -1"),
        _field("first_beam", _I, "", "segment, arc, cluster: first beam; breakpoint: beam before"),
        _field("last_beam", _I, "", "segment, arc, cluster: last beam; breakpoint: beam after"),
        _field("n_points", _I, "", "segment, arc, cluster: number of valid beams"),
        _field("rms", _F, "m", "segment, arc: rms distance of its points"),
        _field("misfit", _F, "m", "segment: rms distance of its surface from a straight line"),
        _field("cluster", _I, "", "segment: index of its cluster"),
        _field("breakpoint", _TEXT, "", "breakpoint: jump, gap or scan_end"),
        _field("occluder", _I, "", "breakpoint: beam of the nearer side of a jump, or -1"),
    ],
    metadata={"lineament.schema": "2", "lineament.version": __version__},
)


def features_table(scans: Sequence[Features], first_scan: int = 0) -> pa.Table:
    """Make the table of some scans, numbered from `first_scan`; their beam counts may differ.

    Parameters
    ----------
    scans : sequence of Features
        In the order of their log.
    first_scan : int
        Index of the first of them.

    Returns
    -------
    pyarrow.Table
        Of schema `SCHEMA`, ordered by scan, then kind. Its metadata name the frames of the scans.

    Raises
    ------
    ValueError
        If a corner or a breakpoint is of a kind that the schema does not have.

    Examples
    --------
    >>> features_table([]).num_rows
    0
    """
    parts = {
        # Joining bytes is 10 × quicker than np.concatenate of many small structured arrays.
        name: (
            np.frombuffer(b"".join([_bytes(getattr(f, name), dtype) for f in scans]), dtype),
            np.array([len(getattr(f, name)) for f in scans], dtype=np.int64),
        )
        for name, dtype in TABLES.items()
    }
    labels = np.frombuffer(b"".join([_bytes(f.clusters, LABEL) for f in scans]), LABEL)
    beams = np.array([len(f.clusters) for f in scans], dtype=np.int64)
    stamps = np.array([f.stamp for f in scans], dtype=np.float64)
    frames = list(dict.fromkeys(f.frame_id for f in scans))
    return _table(parts, labels, beams, stamps, first_scan, frames)


def batch_table(batch: FeatureBatch, first_scan: int = 0) -> pa.Table:
    """Make the table of a batch, without a loop over its scans; see `features_table`."""
    parts = {name: (getattr(batch, name), np.diff(batch.offsets[name])) for name in TABLES}
    m, n = batch.clusters.shape
    frames = [batch.frame_id] if m else []
    return _table(parts, batch.clusters.ravel(), np.full(m, n), batch.stamps, first_scan, frames)


def _bytes(records: NDArray[Any], dtype: np.dtype[Any]) -> bytes:
    return np.asarray(records, dtype=dtype).tobytes()


def _table(
    parts: dict[str, tuple[NDArray[np.void], NDArray[np.int64]]],
    labels: NDArray[np.int32],
    beams: NDArray[np.int64],
    stamps: NDArray[np.float64],
    first_scan: int,
    frames: list[str],
) -> pa.Table:
    """Put the rows of each kind straight to where they belong: by scan, then by kind."""
    clusters, n_clusters = _cluster_columns(labels, beams, _has_ends(*parts["breakpoints"]))
    columns = [to_columns(parts[name][0]) for name, to_columns in _COLUMNS.items()] + [clusters]
    # Rows of each kind in each scan, shape (scans, kinds): its running sum tells where they begin.
    counts = np.column_stack([*(parts[name][1] for name in _COLUMNS), n_clusters])
    begins = (np.cumsum(counts) - counts.ravel()).reshape(counts.shape)

    n_rows = int(counts.sum())
    kind = np.empty(n_rows, dtype=np.int32)
    index = np.empty(n_rows, dtype=np.int32)
    rows = []
    for k, (count, begin) in enumerate(zip(counts.T, begins.T, strict=True)):
        within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        rows.append(np.repeat(begin, count) + within)
        kind[rows[k]] = k
        index[rows[k]] = columns[k].get("index", within)  # a cluster's index is its label
    scan = np.repeat(np.arange(len(counts)), counts.sum(axis=1))

    arrays = {
        "kind": pa.DictionaryArray.from_arrays(kind, KINDS),
        "scan": pa.array(scan + first_scan),
        "stamp": pa.array(stamps[scan]),
        "index": pa.array(index),
    }
    for field in SCHEMA:
        if field.name not in arrays:
            arrays[field.name] = _scatter(field, columns, rows, kind)
    metadata = {**SCHEMA.metadata, b"lineament.frame_ids": json.dumps(frames)}
    return pa.table(list(arrays.values()), schema=SCHEMA.with_metadata(metadata))


def _scatter(
    field: pa.Field, columns: list[Columns], rows: list[NDArray[np.int64]], kind: NDArray[np.int32]
) -> pa.Array:
    """One column of all kinds; null in the rows of the kinds that do not have it."""
    is_text = pa.types.is_dictionary(field.type)
    values = np.zeros(len(kind), dtype=np.int32 if is_text else field.type.to_pandas_dtype())
    is_null = np.array([field.name not in of_kind for of_kind in columns])
    for k in np.flatnonzero(~is_null):
        values[rows[k]] = columns[k][field.name]
    array = pa.array(values, mask=is_null[kind])
    return pa.DictionaryArray.from_arrays(array, TEXTS[field.name]) if is_text else array


def _segment_columns(s: NDArray[np.void]) -> Columns:
    return {
        **_xy(s["centroid"]),
        **_xy(s["start"], "start_"),
        **_xy(s["end"], "end_"),
        **_covariance(s["covariance"]),
        **{name: s[name] for name in ("angle", "rms", "misfit", "cluster")},
        **_span(s),
    }


def _corner_columns(c: NDArray[np.void]) -> Columns:
    return {
        **_xy(c["position"]),
        **_covariance(c["covariance"]),
        **{name: c[name] for name in ("opening", "convex", "response", "quality", "beam")},
        "corner": _codes(c["kind"], "corner"),
        "segment_before": c["segments"][:, 0],
        "segment_after": c["segments"][:, 1],
    }


def _arc_columns(a: NDArray[np.void]) -> Columns:
    return {
        **_xy(a["center"]),
        **_covariance(a["covariance"]),
        **{name: a[name] for name in ("radius", "rms")},
        **_span(a),
    }


def _breakpoint_columns(b: NDArray[np.void]) -> Columns:
    return {
        **_xy(b["position"]),
        "first_beam": b["beam"][:, 0],
        "last_beam": b["beam"][:, 1],
        "breakpoint": _codes(b["kind"], "breakpoint"),
        "occluder": b["occluder"],
    }


def _codes(kinds: NDArray[np.str_], column: str) -> NDArray[np.int32]:
    """Return the index of each kind among the texts of its column."""
    codes = np.full(len(kinds), -1, dtype=np.int32)
    for code, name in enumerate(TEXTS[column]):
        codes[kinds == name] = code
    if len(kinds) and codes.min() < 0:
        raise ValueError(
            f"{column} kind is {str(kinds[codes.argmin()])!r}, "
            f"expected one of {', '.join(TEXTS[column])}"
        )
    return codes


def _has_ends(breakpoints: NDArray[np.void], counts: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether each scan ends somewhere, so that nothing in it lies over the seam of a circle."""
    scan = np.repeat(np.arange(len(counts)), counts)
    has_ends = np.zeros(len(counts), dtype=np.bool_)
    has_ends[scan[breakpoints["kind"] == "scan_end"]] = True
    return has_ends


def _cluster_columns(
    labels: NDArray[np.int32], beams: NDArray[np.int64], has_ends: NDArray[np.bool_]
) -> tuple[Columns, NDArray[np.int64]]:
    """First and last beam and size of every cluster; the number of clusters of each scan."""
    begin, end, scan = _runs(labels, beams)
    # One number for each cluster of each scan. Most come in this order already.
    n_labels = int(labels.max(initial=-1)) + 1
    key = labels[begin] + n_labels * scan
    if np.any(key[1:] < key[:-1]):
        order = np.argsort(key, kind="stable")
        key, begin, end, scan = key[order], begin[order], end[order], scan[order]
    starts = np.flatnonzero(np.diff(key, prepend=-1))
    ends = np.append(starts[1:], len(key))[: len(starts)] - 1
    scan = scan[starts]
    first_of_scan = (np.cumsum(beams) - beams)[scan]
    first, last = begin[starts] - first_of_scan, end[ends] - first_of_scan
    # A cluster does not reach over the largest hole between its runs. If that is not the one over
    # the seam, the cluster itself lies over the seam, and begins behind the hole.
    hole = np.append(begin[1:], 0)[: len(end)] - end
    hole[ends] = beams[scan] - last + first
    largest = np.maximum.reduceat(hole, starts) if len(starts) else hole
    for row in np.flatnonzero((largest > hole[ends]) & ~has_ends[scan]):
        before = starts[row] + int(np.argmax(hole[starts[row] : ends[row]]))
        first[row] = begin[before + 1] - first_of_scan[row]
        last[row] = end[before] - first_of_scan[row]
    columns = {
        "index": labels[begin[starts]],
        "first_beam": first,
        "last_beam": last,
        "n_points": np.add.reduceat(end - begin + 1, starts) if len(starts) else hole,
    }
    return columns, np.bincount(scan, minlength=len(beams))


def _runs(
    labels: NDArray[np.int32], beams: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """First and last place and scan of each run of one label, without that of no cluster."""
    behind_scan = np.cumsum(beams)
    is_begin = np.ones(len(labels), dtype=np.bool_)
    is_begin[1:] = labels[1:] != labels[:-1]
    is_begin[(behind_scan - beams)[beams > 0]] = True
    begin = np.flatnonzero(is_begin)
    end = np.append(begin[1:], len(labels))[: len(begin)] - 1
    used = labels[begin] >= 0
    begin, end = begin[used], end[used]
    return begin, end, np.searchsorted(behind_scan, begin, side="right")


def _xy(points: NDArray[np.float64], prefix: str = "") -> Columns:
    return {f"{prefix}x": points[:, 0], f"{prefix}y": points[:, 1]}


def _span(records: NDArray[np.void]) -> Columns:
    return {name: records[name] for name in ("first_beam", "last_beam", "n_points")}


def _covariance(covariance: NDArray[np.float64]) -> Columns:
    size = covariance.shape[1]
    return {f"cov_{i}{j}": covariance[:, i, j] for i in range(size) for j in range(i, size)}


_COLUMNS = {
    "segments": _segment_columns,
    "corners": _corner_columns,
    "arcs": _arc_columns,
    "breakpoints": _breakpoint_columns,
}
