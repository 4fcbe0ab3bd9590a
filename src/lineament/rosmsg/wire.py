"""The two serialisations of ROS messages, read and written: that of ROS 1, and CDR (ROS 2)."""

import struct
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..limits import LIMITS, Limits

Buffer = bytes | memoryview

#: CDR pads the end of a message to full words.
_MAX_PADDING = 3
#: Zeros up to the next multiple of an alignment, by their number.
_PADDING = tuple(bytes(n) for n in range(8))
_NO_FLOATS = np.zeros(0, dtype=np.float32)

#: How numbers are unpacked and packed, their size in all, and their alignment.
_Numbers = tuple[Callable[..., tuple[Any, ...]], Callable[..., bytes], int, int]


class _Form(dict[str, _Numbers]):
    """A serialisation in one byte order: its numbers by the letters of `struct`."""

    def __init__(self, is_cdr: bool, order: str) -> None:
        self.is_cdr, self.order = is_cdr, order
        self.start = b"\0\1\0\0" if is_cdr else b""  # as it is written
        self.float32 = np.dtype(order + "f4")

    def __missing__(self, code: str) -> _Numbers:
        letters = code
        if code == "header":  # Up to its frame; that of ROS 1 begins with a sequence number.
            letters = "iII" if self.is_cdr else "4xIII"
        form = struct.Struct(self.order + letters)
        alignment = struct.calcsize("=" + letters[-1]) if self.is_cdr else 1
        self[code] = numbers = form.unpack_from, form.pack, form.size, alignment
        return numbers


_ROS1, _CDR = _Form(False, "<"), _Form(True, "<")
#: By the first two bytes of a message.
_CDR_READ = {(0, 0): _Form(True, ">"), (0, 1): _CDR}


class WireReader:
    """Takes the fields of one serialised message, one after the other.

    The encoding is ``ros1``, packed and little-endian, or ``cdr`` (XCDR1), whose first four bytes
    say the byte order, and whose numbers are aligned to their size, counted from behind these.

    ValueError if the encoding is another one or, from the methods, if the message ends too early,
    or a text is longer than the limit of names.
    """

    __slots__ = ("_at", "_data", "_form", "_limits", "_size")

    def __init__(self, data: Buffer, encoding: str, limits: Limits = LIMITS) -> None:
        self._data, self._size, self._limits = data, len(data), limits
        if encoding == "ros1":
            self._at, self._form = 0, _ROS1
        elif encoding == "cdr":
            form = _CDR_READ.get((data[0], data[1])) if self._size >= 4 else None
            if form is None:
                found = bytes(data[:4]).hex()
                raise ValueError(f"begins with {found!r}, expected plain CDR: 0000 or 0001")
            self._at, self._form = 4, form
        else:
            raise _unknown(encoding)

    def header(self) -> tuple[int, str]:
        """Take a ``std_msgs/Header``: its stamp [ns] and its frame."""
        seconds, nanoseconds, length = self.numbers("header")
        return seconds * 1_000_000_000 + nanoseconds, self._string(length)

    def numbers(self, code: str) -> tuple[Any, ...]:
        """Take numbers of one size, by the letters of `struct`: B, iI, 7d; or "header"."""
        unpack, _, size, alignment = self._form[code]
        at = self._at
        if alignment > 1:
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
        """View all whole words of 4 bytes from here to the end, and take none."""
        n = (self._size - self._at) // 4
        return np.frombuffer(self._data, self._form.order + "u4", n, self._at)

    def end(self) -> None:
        """Check that nothing but padding is left."""
        left = self._size - self._at
        if left > _MAX_PADDING:
            raise ValueError(f"has {left} bytes behind its last field, expected none")

    def _string(self, length: int) -> str:
        raw = self.raw(length)
        if length > self._limits.name:
            self._limits.check("name", length)
        # CDR ends a string with a null byte, and counts it.
        return str(raw[:-1] if self._form.is_cdr else raw, "utf-8", "replace")

    def _too_short(self, n: int, at: int) -> ValueError:
        left = max(self._size - at, 0)
        return ValueError(f"ends early: {n} bytes expected from byte {at}, {left} are left")


class WireWriter:
    """Puts the fields of one message one after the other, little-endian: twin of `WireReader`."""

    __slots__ = ("_form", "_out")

    def __init__(self, encoding: str) -> None:
        if encoding not in ("cdr", "ros1"):
            raise _unknown(encoding)
        self._form = _CDR if encoding == "cdr" else _ROS1
        self._out = bytearray(self._form.start)

    @property
    def data(self) -> bytes:
        """The message so far."""
        return bytes(self._out)

    @property
    def body(self) -> bytes:
        """The fields so far, without the beginning that says the byte order."""
        return bytes(self._out[len(self._form.start) :])

    def header(self, seconds: int, nanoseconds: int, frame: str) -> None:
        """Put a ``std_msgs/Header``; the transport fills in the sequence number of ROS 1."""
        raw = self._encoded(frame)
        self.numbers("header", seconds, nanoseconds, len(raw))
        self._out += raw

    def numbers(self, code: str, *values: float) -> None:
        """Put numbers of one size, by the letters of `struct`: B, iI, 7d."""
        _, pack, _, alignment = self._form[code]
        self._out += _PADDING[(4 - len(self._out)) % alignment]
        self._out += pack(*values)

    def count(self, n: int) -> None:
        """Put the length of a sequence; an empty sequence is nothing else."""
        self.numbers("I", n)

    def text(self, text: str) -> None:
        """Put a string."""
        raw = self._encoded(text)
        self.count(len(raw))
        self._out += raw

    def raw(self, data: Buffer, alignment: int = 1) -> None:
        """Put bytes as they are; in CDR they begin at a multiple of `alignment`."""
        if len(data):  # What has no elements is not aligned either.
            if self._form.is_cdr:
                self._out += _PADDING[(4 - len(self._out)) % alignment]
            self._out += data

    def array(self, values: NDArray[Any]) -> None:
        """Put the numbers of a little-endian array row by row, without their count."""
        self.raw(np.ascontiguousarray(values).data, values.itemsize)

    def sequence(self, values: NDArray[Any]) -> None:
        """Put the number of rows of an array, and the rows."""
        self.count(len(values))
        self.array(values)

    def _encoded(self, text: str) -> bytes:
        raw = text.encode("utf-8", "replace")
        return raw + b"\0" if self._form.is_cdr else raw


def _unknown(encoding: str) -> ValueError:
    return ValueError(f"encoding is {encoding!r}, expected ros1 or cdr")
