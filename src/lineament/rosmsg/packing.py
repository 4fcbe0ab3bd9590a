"""Writes ROS messages as bytes, in the two ways that `lineament.rosmsg.wire` reads."""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Packer"]

#: First bytes of a message, by its encoding: those of CDR tell its byte order.
_BEGINNINGS = {"cdr": b"\0\1\0\0", "ros1": b""}
#: Zeros up to the next multiple of an alignment, by their number.
_PADDING = tuple(bytes(n) for n in range(8))


class Packer:
    r"""Puts the fields of one serialised message one after the other; the twin of `Wire`.

    Parameters
    ----------
    encoding : str
        ``ros1`` (packed, little-endian) or ``cdr`` (little-endian XCDR1: numbers are aligned to
        their size, counted from behind the first four bytes).

    Raises
    ------
    ValueError
        If the encoding is another one.

    Examples
    --------
    >>> packer = Packer("ros1")
    >>> packer.text("hi")
    >>> packer.numbers("f", 1.0)
    >>> packer.data
    b'\x02\x00\x00\x00hi\x00\x00\x80?'
    """

    __slots__ = ("_is_cdr", "_out")

    def __init__(self, encoding: str) -> None:
        if encoding not in _BEGINNINGS:
            raise ValueError(f"encoding is {encoding!r}, expected ros1 or cdr")
        self._is_cdr = encoding == "cdr"
        self._out = bytearray(_BEGINNINGS[encoding])

    @property
    def data(self) -> bytes:
        """The message so far."""
        return bytes(self._out)

    def header(self, seconds: int, nanoseconds: int, frame: str) -> None:
        """Put a ``std_msgs/Header``; that of ROS 1 begins with a number, left to the transport."""
        if self._is_cdr:
            self.numbers("iI", seconds, nanoseconds)
        else:
            self.numbers("3I", 0, seconds, nanoseconds)
        self.text(frame)

    def numbers(self, code: str, *values: float) -> None:
        """Put numbers of one size, by the letters of `struct`: B, I, iI, 3i or 7d."""
        pack, alignment = _form(code)
        if self._is_cdr:
            self._out += _PADDING[(4 - len(self._out)) % alignment]
        self._out += pack(*values)

    def count(self, n: int) -> None:
        """Put the length of a sequence; without elements that is all of it."""
        self.numbers("I", n)

    def text(self, text: str) -> None:
        """Put a string. CDR ends it with a null byte, and counts it."""
        raw = text.encode("utf-8", "replace")
        if self._is_cdr:
            raw += b"\0"
        self.count(len(raw))
        self._out += raw

    def raw(self, data: bytes | memoryview, alignment: int = 1) -> None:
        """Put bytes as they are; in CDR they begin at a multiple of `alignment`."""
        if len(data):  # What has no elements is not aligned either.
            if self._is_cdr:
                self._out += _PADDING[(4 - len(self._out)) % alignment]
            self._out += data

    def array(self, values: NDArray[Any]) -> None:
        """Put numbers of an array without their count, row by row; they are little-endian."""
        self.raw(np.ascontiguousarray(values).data, values.itemsize)

    def sequence(self, values: NDArray[Any]) -> None:
        """Put the number of rows of an array, and the rows."""
        self.count(len(values))
        self.array(values)


@cache
def _form(code: str) -> tuple[Callable[..., bytes], int]:
    """How numbers of a code are packed, and the size of one."""
    return struct.Struct("<" + code).pack, struct.calcsize("=" + code[-1])
