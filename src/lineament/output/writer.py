"""What all writers of features share: a whole file or none, and memory that does not grow."""

import os
from abc import ABC, abstractmethod
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Self

from .._copies import InTurn
from ..features import Features
from ..files import naming_errors, written_beside
from ..scan import LaserScan, Pose


class Found(NamedTuple):
    """What was found in one scan, the scan, the topic of its log, and the pose of the scan.

    The scan is None where the writer does not need it, the topic "" and the pose None where they
    are not known.
    """

    features: Features
    scan: LaserScan | None
    topic: str
    pose: Pose | None = None


class Writer(InTurn, ABC):
    """Writes the features of one scan after the other to one file.

    The file appears under its name when the block ends; if it ends by an exception, a file that
    was there before stays as it was. Nothing is ever added to a file. Scans are numbered from 0
    in the order in which they come.

    A format is a subclass with `_open`, `_write` and `_close`.

    Parameters
    ----------
    path : path-like
        The file.
    """

    #: Scans that are kept before they are written.
    chunk: ClassVar[int] = 1
    #: Whether the format draws the scans, and not only what is found in them.
    needs_scan: ClassVar[bool] = False

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = path
        self._stack, self._files = ExitStack(), ExitStack()
        self._is_open = False

    def __getstate__(self) -> dict[str, Any]:
        raise TypeError(f"the writer of {self.path} cannot be copied: it has an open file")

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            temporary = stack.enter_context(written_beside(self.path))
            stack.callback(self._abandon)
            with naming_errors(self.path):
                self._open(temporary, self._files)
            self._stack = stack.pop_all()
        self._waiting: list[Found] = []
        self._written, self._is_open = 0, True
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: Any) -> None:
        self._is_open = False
        if kind is not None:
            self._stack.__exit__(kind, *error)
            return
        with self._stack, naming_errors(self.path):
            self._flush()
            self._close()
            self._files.close()  # here, so that a disk that is full at the last byte is named

    def _abandon(self) -> None:
        """Close what an error has left open; a full disk, which says so again here, is known."""
        with suppress(OSError):
            self._files.close()

    def write(self, features: Features, scan: LaserScan | None = None, topic: str = "") -> None:
        """Take the features of the next scan.

        They must not change until the block ends. The scan is what they were found in: formats that
        draw it need it, tables have its pose. The topic is that of the scan in its log.

        Raises
        ------
        LineamentError
            If the file cannot be written, or cannot hold this scan.
        ValueError
            If the writer is not open or needs the scan.
        """
        if not self._is_open:
            raise ValueError(f"the writer of {self.path} is not open: use it as a context manager")
        if self.needs_scan and scan is None:
            raise ValueError(f"the writer of {self.path} needs the scan: write(features, scan)")
        # Tables keep no ranges until they are written.
        pose = None if scan is None else scan.pose
        found = Found(features, scan if self.needs_scan else None, topic, pose)
        with self._turn:
            self._waiting.append(found)
            if len(self._waiting) >= self.chunk:
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
    def _write(self, found: list[Found], first_scan: int) -> None:
        """Write what was found in some scans, the first of which has this index."""

    def _close(self) -> None:  # Most formats have no end.
        """Write what comes after the last scan."""
