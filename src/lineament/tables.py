"""Features as an Arrow table, one row a feature. The schema is described in docs/formats.md."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from .features import TABLES, FeatureBatch, Features

__all__ = ["SCHEMA", "batch_table", "features_table"]

Columns = dict[str, NDArray[Any]]


def _field(name: str, kind: pa.DataType, unit: str, about: str) -> pa.Field:
    return pa.field(name, kind, metadata={"unit": unit, "description": about})


_F, _I = pa.float64(), pa.int32()

SCHEMA = pa.schema(
    [
        _field("kind", pa.string(), "", "segment, corner, arc, breakpoint or cluster"),
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
        _field("cov_00", _F, "m²", "covariance of segment: (offset, angle), corner: (x, y), arc: (x, y, radius)"),
        _field("cov_01", _F, "m² or m·rad", "as cov_00"),
        _field("cov_11", _F, "m² or rad²", "as cov_00"),
        _field("cov_02", _F, "m²", "arc"),
        _field("cov_12", _F, "m²", "arc"),
        _field("cov_22", _F, "m²", "arc"),
        _field("radius", _F, "m", "arc"),
        _field("opening", _F, "rad", "corner: angle between its arms"),
        _field("convex", pa.bool_(), "", "corner: points towards the sensor"),
        _field("response", _F, "", "corner: strength, in the unit of the method"),
        _field("beam", _I, "", "corner: its beam"),
        _field("segment_before", _I, "", "corner: index of the segment before it, or -1"),
        _field("segment_after", _I, "", "corner: index of the segment after it, or -1"),
        _field("first_beam", _I, "", "segment, arc, cluster: first beam; breakpoint: the one before"),
        _field("last_beam", _I, "", "segment, arc, cluster: last beam; breakpoint: the one after"),
        _field("n_points", _I, "", "segment, arc, cluster: number of valid beams"),
        _field("rms", _F, "m", "segment, arc: rms distance of its points"),
        _field("cluster", _I, "", "segment: its cluster"),
        _field("breakpoint", pa.string(), "", "breakpoint: jump, gap or scan_end"),
        _field("occluder", _I, "", "breakpoint: beam of the nearer side of a jump, or -1"),
    ],
    metadata={"lineament.schema": "1"},
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
        Of schema `SCHEMA`, ordered by scan, then kind.

    Examples
    --------
    >>> features_table([]).num_rows
    0
    """
    if not scans:
        return SCHEMA.empty_table()
    parts = {
        name: (
            np.concatenate([getattr(f, name) for f in scans]),
            np.array([len(getattr(f, name)) for f in scans]),
        )
        for name in TABLES
    }
    labels = np.concatenate([f.clusters for f in scans])
    beams = np.array([len(f.clusters) for f in scans])
    return _table(parts, labels, beams, np.array([f.stamp for f in scans]), first_scan)


def batch_table(batch: FeatureBatch, first_scan: int = 0) -> pa.Table:
    """Make the table of a batch, without a loop over its scans; see `features_table`."""
    parts = {name: (getattr(batch, name), np.diff(batch.offsets[name])) for name in TABLES}
    m, n = batch.clusters.shape
    return _table(parts, batch.clusters.ravel(), np.full(m, n), batch.stamps, first_scan)


def _table(
    parts: dict[str, tuple[NDArray[np.void], NDArray[np.int64]]],
    labels: NDArray[np.int32],
    beams: NDArray[np.int64],
    stamps: NDArray[np.float64],
    first_scan: int,
) -> pa.Table:
    clusters = _cluster_columns(labels, beams)
    scans_of_clusters = clusters.pop("scan")
    blocks: list[tuple[str, Columns, NDArray[np.int64]]] = [
        (kind, columns(parts[name][0]), np.repeat(np.arange(len(beams)), parts[name][1]))
        for name, (kind, columns) in _COLUMNS.items()
    ]
    blocks.append(("cluster", clusters, scans_of_clusters))
    tables = [_block(*block, stamps, first_scan) for block in blocks]
    table = pa.concat_tables(tables)
    order = np.argsort(np.concatenate([scan for _, _, scan in blocks]), kind="stable")
    return table.take(order).combine_chunks()


def _block(
    kind: str,
    columns: Columns,
    scan: NDArray[np.int64],
    stamps: NDArray[np.float64],
    first_scan: int,
) -> pa.Table:
    """Rows of one kind; the columns that it does not have are null."""
    rows = len(scan)
    columns = {
        "kind": np.full(rows, kind, dtype=object),
        "scan": scan + first_scan,
        "stamp": stamps[scan],
        "index": _index_within(scan),
        **columns,
    }
    return pa.table(
        [
            pa.array(columns[f.name], f.type) if f.name in columns else pa.nulls(rows, f.type)
            for f in SCHEMA
        ],
        schema=SCHEMA,
    )


def _index_within(scan: NDArray[np.int64]) -> NDArray[np.int32]:
    """Count the rows of each scan from 0; `scan` does not decrease."""
    first_row = np.searchsorted(scan, scan, side="left")
    return (np.arange(len(scan)) - first_row).astype(np.int32)


def _segment_columns(s: NDArray[np.void]) -> Columns:
    return {
        **_xy(s["centroid"]),
        **_xy(s["start"], "start_"),
        **_xy(s["end"], "end_"),
        **_covariance(s["covariance"]),
        **{name: s[name] for name in ("angle", "rms", "cluster")},
        **_span(s),
    }


def _corner_columns(c: NDArray[np.void]) -> Columns:
    return {
        **_xy(c["position"]),
        **_covariance(c["covariance"]),
        **{name: c[name] for name in ("opening", "convex", "response", "beam")},
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
        "breakpoint": b["kind"].astype(object),
        "occluder": b["occluder"],
    }


def _cluster_columns(labels: NDArray[np.int32], beams: NDArray[np.int64]) -> Columns:
    """First and last beam and size of every cluster."""
    scan_of_beam = np.repeat(np.arange(len(beams)), beams)
    beam_of_row = np.arange(len(labels)) - np.repeat(np.cumsum(beams) - beams, beams)
    used = labels >= 0
    order = np.lexsort((beam_of_row[used], labels[used], scan_of_beam[used]))
    scan, label, beam = (v[used][order] for v in (scan_of_beam, labels, beam_of_row))
    starts = np.flatnonzero((np.diff(scan, prepend=-1) != 0) | (np.diff(label, prepend=-1) != 0))
    ends = np.append(starts[1:], len(scan))[: len(starts)] - 1
    first, last = beam[starts], beam[ends]
    # A cluster does not reach over the largest hole in its beams. If that is not the one over
    # the seam, the cluster itself lies over the seam, and begins behind the hole.
    hole = np.diff(beam, append=0)
    hole[ends] = beams[scan[ends]] - last + first
    for row in np.flatnonzero(np.maximum.reduceat(hole, starts) > hole[ends] if len(starts) else []):
        behind = starts[row] + int(np.argmax(hole[starts[row] : ends[row]]))
        first[row], last[row] = beam[behind + 1], beam[behind]
    return {
        "scan": scan[starts],
        "first_beam": first,
        "last_beam": last,
        "n_points": ends - starts + 1,
    }


def _xy(points: NDArray[np.float64], prefix: str = "") -> Columns:
    return {f"{prefix}x": points[:, 0], f"{prefix}y": points[:, 1]}


def _span(records: NDArray[np.void]) -> Columns:
    return {name: records[name] for name in ("first_beam", "last_beam", "n_points")}


def _covariance(covariance: NDArray[np.float64]) -> Columns:
    size = covariance.shape[1]
    return {f"cov_{i}{j}": covariance[:, i, j] for i in range(size) for j in range(i, size)}


_COLUMNS = {
    "segments": ("segment", _segment_columns),
    "corners": ("corner", _corner_columns),
    "arcs": ("arc", _arc_columns),
    "breakpoints": ("breakpoint", _breakpoint_columns),
}
