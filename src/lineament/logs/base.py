"""What every log offers, and what a reader must tell about its format."""

from __future__ import annotations

import os
import stat
import zlib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from operator import itemgetter
from pathlib import Path
from typing import ClassVar, TypeVar

from ..errors import LogError
from ..scan import LaserScan
from .lines import GZIP, chunks, reading

__all__ = ["ECHOES", "Head", "Log", "ReadOptions", "Topic"]

T = TypeVar("T")

#: How much of a file is looked at to find its format [bytes].
HEAD_SIZE = 1 << 16
#: How many messages about faults are kept.
MAX_FAULTS = 10
#: Which return of a beam that has several can be asked for.
ECHOES = ("first", "last", "strongest")


@dataclass(frozen=True)
class ReadOptions:
    """How to make scans of messages that hold more than one; formats without them pass it over.

    Parameters
    ----------
    echo : str
        Which return of a beam that has several: ``first``, ``last`` or ``strongest``.
    ring : int, optional
        Which ring of a point cloud is the scan.
    pose_topic : str, optional
        Which topic gives the poses.

    Raises
    ------
    ValueError
        If a value is none of these.

    Examples
    --------
    >>> ReadOptions(echo="last").ring is None
    True
    """

    echo: str = "first"
    ring: int | None = None
    pose_topic: str | None = None

    def __post_init__(self) -> None:
        if self.echo not in ECHOES:
            raise ValueError(f"echo is {self.echo!r}, expected {' or '.join(ECHOES)}")
        if self.ring is not None and (type(self.ring) is not int or self.ring < 0):
            raise ValueError(f"ring is {self.ring!r}, expected a whole number ≥ 0")
        if self.pose_topic is not None and not (
            isinstance(self.pose_topic, str) and self.pose_topic
        ):
            raise ValueError(f"pose_topic is {self.pose_topic!r}, expected the name of a topic")


@dataclass(frozen=True)
class Topic:
    """One kind of messages in a log, of scans or of anything else.

    Parameters
    ----------
    name : str
        As it is asked for.
    type : str
        Type of its messages; empty where the name says it all.
    count : int
        How many there are.
    publishers : int
        How many senders the log knows of.
    """

    name: str
    type: str
    count: int
    publishers: int = 1


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
    is_gzip : bool
        Whether the file is compressed.
    """

    path: Path
    data: bytes
    is_directory: bool = False
    is_gzip: bool = False

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
        if not first.startswith(GZIP):
            return cls(where, first)
        return cls(where, _decompressed_head(path), is_gzip=True)

    @classmethod
    def of(cls, path: Path, first: bytes) -> Head:
        """Make the head of a file that is not at hand, from its first bytes as they are stored."""
        if not first.startswith(GZIP):
            return cls(path, first)
        plain = b""
        with suppress(zlib.error):
            plain = zlib.decompressobj(wbits=31).decompress(first, HEAD_SIZE)
        return cls(path, plain, is_gzip=True)


def _decompressed_head(path: str | os.PathLike[str]) -> bytes:
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
        The file. Its ``str`` is what errors call it, which is not the path itself where the log
        is a temporary copy of what an archive or an address holds.
    topic : str, optional
        Which scans to read; all, or the reader's own choice, if None.
    keep_going : bool
        Skip and count what is faulty instead of raising an error at it.
    options : ReadOptions
        How to make scans of messages that hold more than one.

    Attributes
    ----------
    source : path-like
        The file as it was given: what is opened, and what errors are made of.
    path : pathlib.Path
        The file that is read.
    name : str
        What a person calls it, for messages.
    topic : str or None
        The topic that was asked for.
    options : ReadOptions
        The options.
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
    #: Whether the reader jumps about in the file, which must then not be compressed as a whole.
    needs_seek: ClassVar[bool] = False

    def __init__(
        self,
        path: str | os.PathLike[str],
        topic: str | None = None,
        *,
        keep_going: bool = False,
        options: ReadOptions = ReadOptions(),
    ) -> None:
        # A temporary copy lives as long as this.
        self.source = path
        self.path = Path(path)
        self.name = str(path)
        self.topic = topic
        self.keep_going = keep_going
        self.options = options
        self.skipped = 0
        self.faults: list[str] = []
        self._open()

    def _open(self) -> None:  # noqa: B027 (nothing to do is a way to open)
        """Look into the file as far as it takes to know that it is a log, and has the topic."""

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
    def _items(self) -> Iterator[tuple[str, LaserScan]]:
        """Read each scan, with its topic, from the start; faults go through `_fault`."""

    def contents(self) -> list[Topic]:
        """Tell all that the log holds, scans and other messages, in the log's own words."""
        return []

    def items(self) -> Iterator[tuple[str, LaserScan]]:
        """Read each scan with its topic, from the start.

        Yields
        ------
        topic : str
            The topic, one of `topics`.
        scan : LaserScan
            The scan.
        """
        self.skipped, self.faults = 0, []
        yield from self._items()

    def __iter__(self) -> Iterator[LaserScan]:
        return map(itemgetter(1), self.items())

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
        raise LogError(self.name, f"has no scan {index}, expected 0 to {len(self) - 1}")

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, topic={self.topic!r})"

    def _fault(self, error: LogError) -> None:
        """Raise `error`, or count it when the log keeps going."""
        if not self.keep_going:
            raise error.fresh() from None
        self.skipped += 1
        if len(self.faults) < MAX_FAULTS:
            self.faults.append(str(error))

    def _until_broken(self, items: Iterable[T]) -> Iterator[T]:
        """Pass on what is read from a file; a break in it is a fault, and the end."""
        try:
            yield from items
        except LogError as error:
            self._fault(error)

    def _no_such_topic(self, topics: list[str]) -> LogError:
        known = ", ".join(topics) if topics else "none that carries scans"
        return LogError(self.name, f"has no topic {self.topic!r}; topics there are: {known}")
