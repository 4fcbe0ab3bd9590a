"""What every log offers, and what a reader must tell about its format."""

from __future__ import annotations

import os
import stat
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import ClassVar

from ..errors import LogError
from ..scan import LaserScan
from .lines import GZIP, chunks, reading

__all__ = ["Head", "Log"]

#: How much of a file is looked at to find its format [bytes].
HEAD_SIZE = 1 << 16
#: How many messages about faults are kept.
MAX_FAULTS = 10


@dataclass(frozen=True)
class Head:
    """The beginning of a file, from which readers recognise their format.

    Parameters
    ----------
    path : pathlib.Path
        The file or folder.
    data : bytes
        Its first bytes, decompressed where it is gzip; empty for a folder.
    is_directory : bool
        Whether it is a folder.
    """

    path: Path
    data: bytes
    is_directory: bool = False

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Head:
        """Read the head of `path`; LogError if there is no such file, or nothing in it."""
        try:
            where = Path(path)
        except TypeError:
            raise LogError(path, "is no path, expected the path of a log") from None
        with reading(path):
            mode = where.stat().st_mode
            if stat.S_ISDIR(mode):
                return cls(where, b"", is_directory=True)
            # Pipes and devices cannot be read twice, and may never answer.
            if not stat.S_ISREG(mode):
                raise LogError(path, "is no regular file, expected a log")
            with where.open("rb") as file:
                first = file.read(HEAD_SIZE)
        if not first:
            raise LogError(path, "is empty, expected a log")
        return cls(where, _decompressed_head(where) if first.startswith(GZIP) else first)


def _decompressed_head(path: Path) -> bytes:
    data = b""
    try:
        for chunk in chunks(path):
            data += chunk
            if len(data) >= HEAD_SIZE:
                break
    except LogError:
        # A broken stream is reported when the log is read, with how far that went.
        if not data:
            raise
    if not data:
        raise LogError(path, "is empty once decompressed, expected a log")
    return data[:HEAD_SIZE]


class Log(ABC):
    """An iterable of :class:`~lineament.LaserScan`; each iteration reads from the start.

    Parameters
    ----------
    path : path-like
        The file.
    topic : str, optional
        Which scans to read; the reader's own choice if None.
    keep_going : bool
        Skip and count what is faulty instead of raising an error at it.

    Attributes
    ----------
    path : pathlib.Path
        The file.
    topic : str or None
        The topic that was asked for.
    skipped : int
        How many faults the last iteration went over; 0 unless `keep_going`.
    faults : list of str
        What the first of these faults were.
    """

    #: Name of the format.
    format: ClassVar[str]
    #: The format as an error names it, with what it holds.
    description: ClassVar[str]
    #: Usual endings, lower case, of files in this format.
    endings: ClassVar[tuple[str, ...]]

    def __init__(
        self,
        path: str | os.PathLike[str],
        topic: str | None = None,
        *,
        keep_going: bool = False,
    ) -> None:
        self.path = Path(path)
        self.topic = topic
        self.keep_going = keep_going
        self.skipped = 0
        self.faults: list[str] = []

    @classmethod
    @abstractmethod
    def recognises(cls, head: Head) -> bool:
        """Whether a file that begins so is in this format."""

    @property
    @abstractmethod
    def topics(self) -> list[str]:
        """The topics of the log that carry scans."""

    @abstractmethod
    def __len__(self) -> int:
        """Return the number of scans, faulty ones included."""

    @abstractmethod
    def _scans(self) -> Iterator[LaserScan]:
        """Read the scans from the start; faults go through `_fault`."""

    def __iter__(self) -> Iterator[LaserScan]:
        self.skipped, self.faults = 0, []
        yield from self._scans()

    def scan(self, index: int) -> LaserScan:
        """Read one scan by its index, from 0; those before it are read and left.

        Raises
        ------
        LogError
            If there is no such scan.
        """
        if index >= 0:
            for scan in islice(self, index, None):
                return scan
        raise LogError(self.path, f"has no scan {index}, expected 0 to {len(self) - 1}")

    def __repr__(self) -> str:
        return f"{type(self).__name__}({str(self.path)!r}, topic={self.topic!r})"

    def _fault(self, error: LogError) -> None:
        """Raise `error`, or count it when the log keeps going."""
        if not self.keep_going:
            raise error
        self.skipped += 1
        if len(self.faults) < MAX_FAULTS:
            self.faults.append(str(error))

    def _no_such_topic(self, topics: list[str]) -> LogError:
        known = ", ".join(topics) if topics else "none that carries scans"
        return LogError(self.path, f"has no topic {self.topic!r}; topics there are: {known}")
