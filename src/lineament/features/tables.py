"""Features as an Arrow table, one row a feature. The schema is described in docs/formats.md."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from numpy.typing import ArrayLike, NDArray

from .._version import __version__
from .records import COLUMNS, FIELDS, SHARED_COLUMNS, TABLES, TEXTS, Field, numbers, text_codes

if TYPE_CHECKING:
    from .written import LazyFields

# Columns by their buffers: `pyarrow.array` imports pandas, where that is installed.


def array_of(values: ArrayLike, is_null: ArrayLike | None = None) -> pa.Array:
    """Return numbers or booleans as an array of Arrow, null where `is_null`.

    Contiguous numbers are not copied: they must not change later.

    Examples
    --------
    >>> array_of([1.5, 2.5, 3.5], [False, True, False]).to_pylist()
    [1.5, None, 3.5]
    """
    numbers = np.ascontiguousarray(values)
    valid = None if is_null is None else _bits(~np.asarray(is_null, np.bool_))
    data = _bits(numbers) if numbers.dtype == np.bool_ else pa.py_buffer(numbers)
    return pa.Array.from_buffers(pa.from_numpy_dtype(numbers.dtype), len(numbers), [valid, data])


def texts(words: Sequence[str]) -> pa.Array:
    """Return words as an array of Arrow.

    Examples
    --------
    >>> texts(["wall", "", "Säule"]).to_pylist()
    ['wall', '', 'Säule']
    """
    raw = [word.encode() for word in words]
    ends = np.cumsum([0, *map(len, raw)], dtype=np.int32)
    buffers = [None, pa.py_buffer(ends), pa.py_buffer(b"".join(raw))]
    return pa.Array.from_buffers(pa.string(), len(raw), buffers)


def numbers_of(array: pa.ChunkedArray) -> NDArray[Any]:
    """Return the numbers of a column that has no nulls.

    Examples
    --------
    >>> numbers_of(pa.chunked_array([array_of([1, 2, 3])])).tolist()
    [1, 2, 3]
    """
    whole, dtype = array.combine_chunks(), np.dtype(array.type.to_pandas_dtype())
    if isinstance(whole, pa.ChunkedArray):  # as older versions of pyarrow return it
        whole = whole.chunk(0) if whole.num_chunks else array_of(np.empty(0, dtype))
    if not len(whole):
        return np.empty(0, dtype)
    return np.frombuffer(whole.buffers()[1], dtype, len(whole), whole.offset * dtype.itemsize)


def _bits(values: NDArray[np.bool_]) -> pa.Buffer:
    return pa.py_buffer(np.packbits(values, bitorder="little"))


# The table.

#: Values of the column `kind`, in the order in which the rows of a scan come.
_ROWS = texts([*(table[:-1] for table in TABLES), "cluster"])
#: Values of the columns of text.
_TEXTS = {f.columns: texts(TEXTS[f.table]) for f in FIELDS if f.form[0] == "U"}

Columns = dict[str, NDArray[Any]]


def _schema() -> pa.Schema:
    """List the columns, with units and meanings; those of fields without a place come last."""
    text = pa.dictionary(pa.int32(), pa.string())
    forms = {"kind": text, "scan": pa.int64(), "stamp": pa.float64(), "index": pa.int32()}
    about = {**SHARED_COLUMNS, "stamp_ns": ("ns", "stamp of the scan, exactly")}
    for field in FIELDS:
        base = TABLES[field.table][field.name].base
        for column in field.columns.split():
            forms[column] = text if base.kind == "U" else pa.from_numpy_dtype(base)
            meaning = ": ".join(filter(None, (field.table[:-1], field.about)))
            about.setdefault(column, (field.unit, meaning))
    forms["stamp_ns"] = pa.int64()
    fields = []
    for name in dict.fromkeys((*COLUMNS.split(), *forms)):
        unit, meaning = about[name]
        fields.append(pa.field(name, forms[name], metadata={"unit": unit, "description": meaning}))
    return pa.schema(fields, metadata={"lineament.schema": "3", "lineament.version": __version__})


SCHEMA = _schema()


def features_table(scans: Sequence[LazyFields], first_scan: int = 0) -> pa.Table:
    """Make the table of some scans, numbered from `first_scan`; their beam counts may differ.

    Its schema is `SCHEMA`, its metadata name the frames of the scans, and its rows are ordered by
    scan, then kind. Raises ValueError for a kind or a side that is not known.

    Examples
    --------
    >>> features_table([]).num_rows
    0
    """
    parts = {}
    for name, dtype in TABLES.items():
        raw = [f.raw(name) for f in scans]
        # Joined as bytes: numpy joins records field by field, 10 × slower.
        parts[name] = np.frombuffer(b"".join(raw), dtype), _lengths(raw, dtype)
    raw = [f.raw("clusters") for f in scans]
    beams = _lengths(raw, np.dtype(np.int32))
    labels = np.frombuffer(b"".join(raw), np.int32)
    stamps = np.array([f.stamp for f in scans], dtype=np.float64), [f.stamp_ns for f in scans]
    frames = list(dict.fromkeys(f.frame_id for f in scans))
    return table_of(parts, labels, beams, stamps, first_scan, frames)


def _lengths(raw: list[bytes], dtype: np.dtype[Any]) -> NDArray[np.int64]:
    """Return how many records there are in each of some bytes."""
    return np.array([*map(len, raw)], np.int64) // dtype.itemsize


def table_of(
    parts: dict[str, tuple[NDArray[np.void], NDArray[np.int64]]],
    labels: NDArray[np.int32],
    beams: NDArray[np.int64],
    stamps: tuple[NDArray[np.float64], list[int]],
    first_scan: int,
    frames: list[str],
) -> pa.Table:
    """Make the table of records (and how many of them each scan has), labels, and beams by scan.

    The rows of each kind go straight to where they belong: by scan, then by kind.
    """
    # A scan that ends somewhere is no circle: nothing in it lies over a seam.
    breakpoints, n_breakpoints = parts["breakpoints"]
    ended = np.repeat(np.arange(len(beams)), n_breakpoints)[breakpoints["kind"] == "scan_end"]
    has_ends = np.isin(np.arange(len(beams)), ended)
    clusters, n_clusters = _cluster_columns(labels, beams, has_ends)
    columns = [*(_columns(name, parts[name][0]) for name in TABLES), clusters]
    # Rows of each kind in each scan, shape (scans, kinds): they begin at its running sum.
    counts = np.column_stack([*(parts[name][1] for name in TABLES), n_clusters])
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

    # What 64 bits do not hold is no time.
    too_large = np.array([abs(ns) >= 2**63 for ns in stamps[1]], np.bool_)
    exact = np.array([0 if abs(ns) >= 2**63 else ns for ns in stamps[1]], np.int64)
    arrays = {
        "kind": pa.DictionaryArray.from_arrays(array_of(kind), _ROWS),
        "scan": array_of(scan + first_scan),
        "stamp": array_of(stamps[0][scan]),
        "stamp_ns": array_of(exact[scan], too_large[scan]),
        "index": array_of(index),
    }
    for field in SCHEMA:
        if field.name not in arrays:
            arrays[field.name] = _scatter(field, columns, rows, kind)
    metadata = {**SCHEMA.metadata, b"lineament.frame_ids": json.dumps(frames)}
    columns_of = [arrays[field.name] for field in SCHEMA]
    return pa.table(columns_of, schema=SCHEMA.with_metadata(metadata))


def _scatter(
    field: pa.Field, columns: list[Columns], rows: list[NDArray[np.int64]], kind: NDArray[np.int32]
) -> pa.Array:
    """One column of all kinds; null in the rows of the kinds that do not have it."""
    is_text = pa.types.is_dictionary(field.type)
    values = np.zeros(len(kind), dtype=np.int32 if is_text else field.type.to_pandas_dtype())
    is_null = np.array([field.name not in of_kind for of_kind in columns])
    for k in np.flatnonzero(~is_null):
        values[rows[k]] = columns[k][field.name]
    array = array_of(values, is_null[kind])
    return pa.DictionaryArray.from_arrays(array, _TEXTS[field.name]) if is_text else array


def _columns(table: str, records: NDArray[np.void]) -> Columns:
    """Split the fields of records into columns of numbers; text becomes its index."""
    columns = {}
    for field in FIELDS:
        if field.table == table:
            values = records[field.name]
            if field.form[0] == "U":
                values = _codes(field, values)
            shape = values.shape[1:]
            values = values.reshape(len(values), math.prod(shape))
            for column, i in zip(field.columns.split(), numbers(shape), strict=True):
                columns[column] = values[:, i]
    return columns


def _codes(field: Field, texts: NDArray[np.str_]) -> NDArray[np.int32]:
    """Return the index of each text among those of its table."""
    codes = text_codes(field.table, texts)
    if codes.min(initial=0) < 0:
        raise ValueError(
            f"{field.table[:-1]} {field.name} is {str(texts[codes.argmin()])!r}, "
            f"expected one of {', '.join(TEXTS[field.table])}"
        )
    return codes


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
