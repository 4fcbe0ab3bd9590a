"""What all writers of features share: a whole file or none, and memory that does not grow."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

from ..atomic import naming_errors, written_beside
from ..features import Features

__all__ = ["Writer"]

#: Scans that are kept before they are written: a row group of a table.
CHUNK = 1000


class Writer(ABC):
    """Writes the features of one scan after the other to one file.

    The file appears under its name when the block ends; if it ends by an exception, a file that
    was there before stays as it was. Scans are numbered from 0 in the order in which they come.

    A format is a subclass with `_open`, `_write` and `_close`.

    Parameters
    ----------
    path : path-like
        The file.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = path
        self._stack, self._files = ExitStack(), ExitStack()
        self._waiting: list[Features] = []
        self._written = 0
        self._is_open = False

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            temporary = stack.enter_context(written_beside(self.path))
            self._files = stack.enter_context(ExitStack())
            with naming_errors(self.path):
                self._open(temporary, self._files)
            self._stack = stack.pop_all()
        self._is_open = True
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._is_open = False
        if kind is not None:
            self._stack.__exit__(kind, error, traceback)
            return
        with self._stack, naming_errors(self.path):
            self._flush()
            self._close()
            self._files.close()  # here, so that a disk that is full at the last byte is named

    def write(self, features: Features) -> None:
        """Take the features of the next scan.

        Parameters
        ----------
        features : Features
            They must not change until the block ends.

        Raises
        ------
        LineamentError
            If the file cannot be written.
        ValueError
            If the writer is not open.
        """
        if not self._is_open:
            raise ValueError(f"the writer of {self.path} is not open: use it as a context manager")
        self._waiting.append(features)
        if len(self._waiting) >= CHUNK:
            with naming_errors(self.path):
                self._flush()

    def _flush(self) -> None:
        if self._waiting:
            self._write(self._waiting, self._written)
            self._written += len(self._waiting)
            self._waiting = []

    @abstractmethod
    def _open(self, temporary: Path, files: ExitStack) -> None:
        """Open the temporary file; what must be closed is entered into `files`."""

    @abstractmethod
    def _write(self, scans: list[Features], first_scan: int) -> None:
        """Write some scans, the first of which has this index."""

    def _close(self) -> None:  # noqa: B027  (most formats have no end)
        """Write what comes after the last scan."""
