"""Streams of bytes and lines from plain or gzip files, with every failure as a LogError."""

import os
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import compress
from operator import methodcaller
from pathlib import Path

from ..errors import LogError
from ..limits import LIMITS, Limits
from .base import SHRUNK

#: How a gzip file begins.
GZIP = b"\x1f\x8b"
#: Mark that some programs put before the first line.
BOM = b"\xef\xbb\xbf"
_PROBLEMS: dict[type[OSError], str] = {
    FileNotFoundError: "there is no such file, expected a log",
    PermissionError: "no permission to read it",
    IsADirectoryError: "is a directory, expected a log file",
}
_COMPRESSED = 1 << 16
_PLAIN = 1 << 20


@contextmanager
def reading(path: object) -> Iterator[None]:
    """Turn what the operating system reports into a LogError of one line."""
    try:
        yield
    except OSError as error:
        problem = _PROBLEMS.get(type(error), f"cannot be read: {error.strerror or error}")
        raise LogError(path, problem) from None
    except ValueError as error:  # A path with a null byte.
        raise LogError(path, f"is no path of a file: {error}") from None


def chunks(path: str | os.PathLike[str], limits: Limits = LIMITS) -> Iterator[bytes]:
    """Yield the content of a file, decompressed where it is gzip, in pieces of up to 1 MiB.

    LogError if it is broken or ends early: after all that could be decompressed.
    """
    with opened(path) as read:
        yield from decompressed(path, read, read(_COMPRESSED), limits)


@contextmanager
def opened(path: str | os.PathLike[str]) -> Iterator[Callable[[int], bytes]]:
    """Give what reads pieces of a file, as long as it is now: what is appended is left.

    LogError if it becomes shorter meanwhile.
    """
    # Only what the file does is guarded: what is done with its content is not.
    with reading(path):
        binary = Path(path).open("rb")  # noqa: SIM115
    with binary as file:
        left = os.fstat(file.fileno()).st_size

        def read(size: int) -> bytes:
            nonlocal left
            with reading(path):
                data = file.read(min(size, left))
            if left and not data:
                raise LogError(path, SHRUNK)
            left -= len(data)
            return data

        yield read


def decompressed(
    path: object, read: Callable[[int], bytes], first: bytes, limits: Limits = LIMITS
) -> Iterator[bytes]:
    """Yield a first piece and what is read behind it, decompressed; LogError as from `chunks`."""
    if first.startswith(GZIP):
        yield from _gunzip(path, read, first, limits)
        return
    while first:
        yield first
        first = read(_PLAIN)


def _gunzip(
    path: object, read: Callable[[int], bytes], data: bytes, limits: Limits
) -> Iterator[bytes]:
    """Decompress member after member, as gzip does; zeros may pad the end."""
    stream = zlib.decompressobj(wbits=31)
    packed = size = 0
    while True:
        if not data:
            data = read(_COMPRESSED)
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
            yield _up_to_fault(before, data)
            reason = str(error).rpartition(": ")[2]
            raise LogError(path, f"gzip data is broken: {reason}") from None
        left = stream.unused_data if stream.eof else stream.unconsumed_tail
        packed, size, data = packed + len(data) - len(left), size + len(plain), left
        limits.check_growth(size, packed, partial(LogError, path))
        if plain:
            yield plain
    if not stream.eof:
        raise LogError(path, "gzip data ends early, expected its end mark: the file is cut off")


def _up_to_fault(stream: "zlib._Decompress", data: bytes) -> bytes:
    """Return what zlib drops when it finds a fault late in a piece: byte by byte up to it."""
    plain = bytearray()
    try:
        for i in range(len(data)):
            plain += stream.decompress(data[i : i + 1])
    except zlib.error:
        pass
    return bytes(plain)


def numbered_lines(
    path: str | os.PathLike[str], limits: Limits = LIMITS, begins: tuple[bytes, ...] = ()
) -> Iterator[tuple[int, bytes]]:
    """Yield each line of a file that is not empty, with its number, from 1, as LogErrors have.

    If `begins` are given, those alone that begin so, and maybe the last one. A last line without an
    end is delivered, unless the stream broke within it.
    """
    number, rest = 1, b""
    try:
        for chunk in chunks(path, limits):
            lines = (rest + chunk).split(b"\n")
            if number == 1:
                lines[0] = lines[0].removeprefix(BOM)
            rest = lines.pop()
            # A file may be full of lines that nobody wants: these cost next to nothing.
            wanted = map(methodcaller("startswith", begins), lines) if begins else lines
            yield from compress(enumerate(lines, number), wanted)
            number += len(lines)
            limits.check("line", len(rest), partial(LogError, path))
    except LogError as error:
        raise LogError(path, error.problem, line=number) from None
    if rest:
        yield number, rest
