"""The two ways in which ROS messages are written as bytes: that of ROS 1, and CDR (ROS 2)."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Buffer", "Wire"]

Buffer = bytes | memoryview

#: CDR pads the end of a message to full words.
_MAX_PADDING = 3


class Wire:
    r"""Takes the fields of one serialised message, one after the other.

    Parameters
    ----------
    data : bytes-like
        The message.
    encoding : str
        ``ros1`` (packed, little-endian) or ``cdr`` (XCDR1, whose first four bytes tell the byte
        order; numbers are aligned to their size).

    Raises
    ------
    ValueError
        If the encoding is another one; from the methods: if the message ends too early.

    Examples
    --------
    >>> wire = Wire(b"\x02\0\0\0hi\0\0\x80\x3f", "ros1")
    >>> wire.text(), wire.floats(1).tolist()
    ('hi', [1.0])
    """

    __slots__ = ("_at", "_data", "_form", "_size")

    def __init__(self, data: Buffer, encoding: str) -> None:
        self._data, self._size = data, len(data)
        if encoding == "ros1":
            self._at, self._form = 0, _ROS1
        elif encoding == "cdr":
            form = _CDR.get((data[0], data[1])) if self._size >= 4 else None
            if form is None:
                found = bytes(data[:4]).hex()
                raise ValueError(f"begins with {found!r}, expected plain CDR: 0000 or 0001")
            self._at, self._form = 4, form
        else:
            raise ValueError(f"encoding is {encoding!r}, expected ros1 or cdr")

    def header(self) -> tuple[float, str]:
        """Take a ``std_msgs/Header``: its stamp [s] and its frame."""
        seconds, nanoseconds, length = self.numbers("header")
        return seconds + 1e-9 * nanoseconds, self._string(length)

    def numbers(self, code: str) -> tuple[Any, ...]:
        """Take numbers of one size, by the letters of `struct`: B, I, II, 7fI, 6d or 7d."""
        unpack, size, alignment = self._form.numbers[code]
        at = self._at
        if alignment:  # Counted from behind the first four bytes.
            at += (4 - at) % alignment
        self._at = at + size
        if self._at > self._size:
            raise self._too_short(size, at)
        return unpack(self._data, at)

    def count(self) -> int:
        """Take the length of a sequence."""
        length: int = self.numbers("I")[0]
        return length

    def text(self) -> str:
        """Take a string."""
        return self._string(self.count())

    def raw(self, n: int) -> Buffer:
        """Take `n` bytes."""
        at = self._at
        self._at = at + n
        if self._at > self._size:
            raise self._too_short(n, at)
        return self._data[at : at + n]

    def floats(self, n: int) -> NDArray[np.float32]:
        """Take `n` numbers ``float32`` as a view of the message."""
        at = self._at
        self._at = at + 4 * n
        if self._at > self._size:
            raise self._too_short(4 * n, at)
        return np.frombuffer(self._data, self._form.float32, n, at) if n else _NO_FLOATS

    def words(self) -> NDArray[np.uint32]:
        """View all whole words of 4 bytes from here to the end; none is taken."""
        n = (self._size - self._at) // 4
        return np.frombuffer(self._data, self._form.order + "u4", n, self._at)

    def end(self) -> None:
        """Check that nothing but padding is left."""
        left = self._size - self._at
        if left > _MAX_PADDING:
            raise ValueError(f"has {left} bytes behind its last field, expected none")

    def _string(self, length: int) -> str:
        raw = self.raw(length)
        # CDR ends a string with a null byte, and counts it.
        return str(raw[:-1] if self._form.is_cdr else raw, "utf-8", "replace")

    def _too_short(self, n: int, at: int) -> ValueError:
        left = max(self._size - at, 0)
        return ValueError(f"ends early: {n} bytes expected from byte {at}, {left} are left")


class _Form(NamedTuple):
    """One way of writing: byte order, and for each code its unpacking, size and alignment."""

    is_cdr: bool
    order: str
    float32: np.dtype[np.float32]
    numbers: dict[str, tuple[Callable[..., tuple[Any, ...]], int, int]]

    @classmethod
    def prepare(cls, is_cdr: bool, order: str) -> _Form:
        # The header up to its frame; that of ROS 1 begins with a number of its own.
        codes = {code: code for code in ("B", "I", "II", "7fI", "6d", "7d")}
        codes["header"] = "iII" if is_cdr else "4xIII"
        numbers = {}
        for name, code in codes.items():
            form = struct.Struct(order + code)
            alignment = struct.calcsize("=" + code[-1]) if is_cdr else 0
            numbers[name] = form.unpack_from, form.size, alignment
        return cls(is_cdr, order, np.dtype(order + "f4"), numbers)


_ROS1 = _Form.prepare(False, "<")
#: By the first two bytes of the message.
_CDR = {(0, 0): _Form.prepare(True, ">"), (0, 1): _Form.prepare(True, "<")}
_NO_FLOATS = np.zeros(0, dtype=np.float32)
