"""Temporary copies of logs that cannot be read where they are."""

from __future__ import annotations

import os
import shutil
import tempfile
import weakref
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO

from ..errors import LogError
from .lines import chunks, reading

__all__ = ["LocalCopy", "check_growth", "pieces", "unpacked"]

#: Largest temporary copy [bytes].
MAX_COPY = 1 << 34
#: What grows by more than so, and beyond `SMALL_COPY` bytes, when it is unpacked is no log.
MAX_RATIO = 300
SMALL_COPY = 1 << 28

_PIECE = 1 << 20


class LocalCopy(os.PathLike[str]):
    """A temporary file under the name that a person knows it by; it goes when this object does.

    Parameters
    ----------
    name : str
        What errors call it: ``str`` gives this, ``os.fspath`` the path of the file.
    pieces : iterator of bytes
        What is written to it.
    packed : int, optional
        How many bytes this was before it was decompressed.

    Raises
    ------
    LogError
        If it grows too large, or cannot be written.
    """

    def __init__(self, name: str, pieces: Iterator[bytes], packed: int | None = None) -> None:
        self._name = name
        # A folder of its own: what a reader looks for beside its log is not there.
        folder = tempfile.mkdtemp(prefix="lineament-")
        self._path = str(Path(folder, "log"))
        self.remove = weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        try:
            self._write(pieces, packed)
        except BaseException:
            self.remove()
            raise

    def __fspath__(self) -> str:
        return self._path

    def __str__(self) -> str:
        return self._name

    def _write(self, pieces: Iterator[bytes], packed: int | None) -> None:
        size = 0
        with Path(self._path).open("wb") as file:
            for piece in pieces:
                size += len(piece)
                if size > MAX_COPY:
                    raise LogError(self._name, f"is larger than {MAX_COPY >> 30} GiB unpacked")
                if packed is not None:
                    check_growth(self._name, size, packed)
                try:
                    file.write(piece)
                except OSError as error:
                    raise LogError(
                        self._name, f"cannot be copied to {self._path}: {error.strerror or error}"
                    ) from None


def check_growth(name: object, size: int, packed: int) -> None:
    """Refuse what grows too much when it is unpacked.

    Parameters
    ----------
    name : object
        What is unpacked, for the error.
    size, packed : int
        Bytes after and before.

    Raises
    ------
    LogError
        If it is no log but a bomb.

    Examples
    --------
    >>> check_growth("a.zip", 1 << 40, 1 << 20)
    Traceback (most recent call last):
    lineament.errors.LogError: a.zip: unpacks to more than 300 times its size, expected a log
    """
    if size > max(SMALL_COPY, MAX_RATIO * packed):
        raise LogError(name, f"unpacks to more than {MAX_RATIO} times its size, expected a log")


def unpacked(path: str | os.PathLike[str], *, keep_going: bool = False) -> LocalCopy:
    """Copy what a gzip file holds.

    Parameters
    ----------
    path : path-like
        The file.
    keep_going : bool
        Whether to take what comes before a break in it.

    Raises
    ------
    LogError
        If it is broken or cut off, or too large.
    """
    with reading(path):
        packed = Path(path).stat().st_size
    return LocalCopy(str(path), _up_to_break(path) if keep_going else chunks(path), packed)


def _up_to_break(path: str | os.PathLike[str]) -> Iterator[bytes]:
    # The reader of the copy reports that it ends early.
    with suppress(LogError):
        yield from chunks(path)


def pieces(file: IO[bytes]) -> Iterator[bytes]:
    """Yield what an open file holds, in pieces of 1 MiB."""
    while piece := file.read(_PIECE):
        yield piece
