"""Columns of Arrow by their buffers: `pyarrow.array` imports pandas, where that is installed."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import ArrayLike, NDArray


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
