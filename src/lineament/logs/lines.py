"""Streams of bytes and lines from plain or gzip files, with every failure as a LogError."""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from ..errors import LogError

__all__ = ["BOM", "GZIP", "MAX_LINE", "chunks", "numbered_lines", "reading"]

#: How a gzip file begins.
GZIP = b"\x1f\x8b"
#: Length of a line from which it is no line any more but something else [bytes].
MAX_LINE = 1 << 24

_COMPRESSED = 1 << 16
_PLAIN = 1 << 20
#: Mark that some programs put before the first line.
BOM = b"\xef\xbb\xbf"


@contextmanager
def reading(path: object) -> Iterator[None]:
    """Turn what the operating system objects to into one clear LogError."""
    try:
        yield
    except FileNotFoundError:
        raise LogError(path, "there is no such file, expected a log") from None
    except PermissionError:
        raise LogError(path, "no permission to read it") from None
    except IsADirectoryError:
        raise LogError(path, "is a directory, expected a log file") from None
    except OSError as error:
        raise LogError(path, f"cannot be read: {error.strerror or error}") from None
    except ValueError as error:  # A path with a null byte.
        raise LogError(path, f"is no path of a file: {error}") from None


def chunks(path: str | os.PathLike[str]) -> Iterator[bytes]:
    """Yield the content of `path`, decompressed where it is gzip, in pieces of up to 1 MiB.

    What is appended while the file is read is left for the next time.

    Raises
    ------
    LogError
        If the file cannot be read, or its gzip data is broken or ends early: after all that
        could be decompressed has been delivered.
    """
    with _opened(path) as opened:
        file = _Source(path, opened)
        first = file.read(_COMPRESSED)
        if first.startswith(GZIP):
            yield from _gunzip(path, file, first)
            return
        while first:
            yield first
            first = file.read(_PLAIN)


@contextmanager
def _opened(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    # Only what the file does is guarded: what the consumer of a generator does is not.
    with reading(path):
        file = Path(path).open("rb")  # noqa: SIM115
    with file:
        yield file


class _Source:
    """A file as long as it is now: what is written to it while it is read is left for later."""

    def __init__(self, path: object, file: BinaryIO) -> None:
        self._path, self._file = path, file
        with reading(path):
            self._left = os.fstat(file.fileno()).st_size

    def read(self, size: int) -> bytes:
        with reading(self._path):
            data = self._file.read(min(size, self._left))
        self._left -= len(data)
        return data


def _gunzip(path: object, file: _Source, data: bytes) -> Iterator[bytes]:
    """Decompress member after member, as gzip does; zeros may pad the end."""
    stream = zlib.decompressobj(wbits=31)
    while True:
        if not data:
            data = file.read(_COMPRESSED)
            if not data:
                yield stream.flush()
                break
        if stream.eof:
            data = data.lstrip(b"\0")
            if not data:
                continue
            stream = zlib.decompressobj(wbits=31)
        before = stream.copy()
        try:
            plain = stream.decompress(data, _PLAIN)
        except zlib.error as error:
            yield from _up_to_fault(before, data)
            raise LogError(path, f"gzip data is broken: {_reason(error)}") from None
        if plain:
            yield plain
        data = stream.unused_data if stream.eof else stream.unconsumed_tail
    if not stream.eof:
        raise LogError(path, "gzip data ends early, expected its end mark: the file is cut off")


def _up_to_fault(stream: zlib._Decompress, data: bytes) -> Iterator[bytes]:
    """Deliver what zlib drops when it finds a fault late in a piece: byte by byte up to it."""
    plain = bytearray()
    try:
        for i in range(len(data)):
            plain += stream.decompress(data[i : i + 1])
    except zlib.error:
        pass
    if plain:
        yield bytes(plain)


def _reason(error: zlib.error) -> str:
    return str(error).rpartition(": ")[2]


def numbered_lines(path: str | os.PathLike[str]) -> Iterator[tuple[int, bytes]]:
    """Yield each line of `path` with its number, from 1; memory holds one line and one piece.

    A last line without an end is delivered, unless the stream broke within it.

    Raises
    ------
    LogError
        As from :func:`chunks`, with the number of the line that was reached; and at a line of
        more than ``MAX_LINE`` bytes, which no text file has.
    """
    number, rest = 1, b""
    try:
        for chunk in chunks(path):
            lines = (rest + chunk).split(b"\n")
            if number == 1:
                lines[0] = lines[0].removeprefix(BOM)
            rest = lines.pop()
            yield from enumerate(lines, number)
            number += len(lines)
            if len(rest) > MAX_LINE:
                raise LogError(path, f"line longer than {MAX_LINE >> 20} MiB, expected text")
    except LogError as error:
        raise LogError(path, error.problem, line=number) from None
    if rest:
        yield number, rest
