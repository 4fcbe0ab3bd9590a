"""What the containers of ROS messages have in common: connections, bounded reads, compression."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

from ..errors import LogError
from ..rosmsg.wire import Buffer
from .lines import reading

__all__ = ["MAX_PIECE", "Bag", "Buffer", "Connection", "Fault", "Source", "decompress"]

#: Largest chunk, record or message that is held in memory [bytes].
MAX_PIECE = 1 << 28

#: What a bag calls with each fault that it finds: it raises, or counts and returns.
Fault = Callable[[LogError], None]


class Connection(NamedTuple):
    """Who wrote a message: its topic, its type and how it is serialised.

    Parameters
    ----------
    topic : str
        Name of the topic.
    type : str
        Type of the messages in the manner of ROS 1, ``sensor_msgs/LaserScan``.
    encoding : str
        ``ros1``, ``cdr``, or another one that cannot be read here.
    publisher : str
        Name of the node; empty where the bag does not tell.
    """

    topic: str
    type: str
    encoding: str
    publisher: str = ""

    @classmethod
    def named(cls, topic: str, kind: str, encoding: str, publisher: str = "") -> Connection:
        """Make a connection of what a bag says; a type of ROS 2, ``sensor_msgs/msg/LaserScan`` too.

        Letters that cannot be printed come of damage, and go: errors are one line.
        """
        names = topic, kind.replace("/msg/", "/"), encoding, publisher
        return cls(*(name if name.isprintable() else _printable(name) for name in names))


def _printable(name: str) -> str:
    return "".join(letter for letter in name if letter.isprintable())


class Bag(ABC):
    """One file of messages.

    Parameters
    ----------
    path : path-like
        The file; its ``str`` is what errors call it.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = path

    @abstractmethod
    def messages(
        self, topics: Collection[str] | None, fault: Fault
    ) -> Iterator[tuple[Connection, Buffer]]:
        """Read the messages on `topics`, or all if None, from the start in the bag's order.

        What is broken goes through `fault`; reading goes on behind it where that is possible.
        """

    def counts(self) -> Counter[Connection]:
        """Count the messages of each connection: by the index where there is one.

        Raises
        ------
        LogError
            If the file is broken before its first message.
        """
        counts = self._indexed_counts()
        if counts is not None:
            return counts
        # What is broken is told when the messages are read: here it only ends the count.
        faults: list[LogError] = []

        def note(error: LogError) -> None:
            faults.append(error.fresh())

        counted = Counter(connection for connection, _ in self.messages(None, note))
        if faults and not counted:
            raise faults[0].fresh()
        return counted

    @abstractmethod
    def _indexed_counts(self) -> Counter[Connection] | None:
        """Count by the index alone; None where there is none or it makes no sense."""


class Source:
    """A file that is read piece by piece, each checked against what is left before it is taken.

    Parameters
    ----------
    path : path-like
        The file; its ``str`` is what errors call it.

    Attributes
    ----------
    at : int
        Where it stands [bytes].
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path, self.at = path, 0
        with reading(path):
            self._file = Path(path).open("rb")  # noqa: SIM115 (closed by __exit__)
            self._size = os.fstat(self._file.fileno()).st_size

    def __enter__(self) -> Source:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._file.close()

    @property
    def left(self) -> int:
        """Number of bytes from here to the end of the file."""
        return self._size - self.at

    def take(self, n: int, what: str) -> bytes:
        """Read the next `n` bytes; LogError if they are not all there, or too many."""
        if n > self.left or n > MAX_PIECE:
            raise self._refused(n, what)
        try:
            data = self._file.read(n)
        except OSError as error:
            raise self.wrong(f"cannot be read: {error.strerror or error}") from None
        if len(data) < n:
            raise self.wrong(f"{what} has {n} bytes but only {len(data)} could be read")
        self.at += n
        return data

    def skip(self, n: int, what: str) -> None:
        """Go over the next `n` bytes; LogError if they are not all there."""
        if n > self.left:
            raise self._refused(n, what)
        self.go(self.at + n)

    def go(self, at: int) -> None:
        """Go to byte `at`."""
        with reading(self.path):
            self._file.seek(at)
        self.at = at

    def wrong(self, problem: str) -> LogError:
        """Make an error that says where in the file it is."""
        return LogError(self.path, f"byte {self.at}: {problem}")

    def _refused(self, n: int, what: str) -> LogError:
        if n > self.left:
            return self.wrong(f"is cut off: {what} has {n} bytes, {self.left} are left")
        return self.wrong(f"{what} has {n} bytes, expected at most {MAX_PIECE >> 20} MiB")


def decompress(codec: str, data: Buffer, size: int) -> Buffer:
    """Decompress a chunk that says how large it becomes, and never more than that.

    Parameters
    ----------
    codec : str
        ``none`` or empty, ``bz2``, ``lz4`` or ``zstd``.
    data : bytes-like
        The compressed chunk.
    size : int
        Its size once decompressed [bytes].

    Raises
    ------
    ValueError
        If the codec is not known, the data is broken, or its size is another one or more than
        `MAX_PIECE`.

    Examples
    --------
    >>> import bz2
    >>> bytes(decompress("bz2", bz2.compress(b"scan"), 4))
    b'scan'
    """
    if size > MAX_PIECE:
        raise ValueError(f"chunk of {size} bytes, expected at most {MAX_PIECE >> 20} MiB")
    if codec in ("", "none"):
        plain = data
    elif codec in _DECOMPRESSORS:
        try:
            plain = _DECOMPRESSORS[codec](data, size)
        # The libraries have errors of their own: RuntimeError, OSError, ZstdError, EOFError.
        except Exception as error:
            raise ValueError(f"{codec} data is broken: {error}") from None
    else:
        known = ", ".join(_DECOMPRESSORS)
        raise ValueError(f"chunk compressed by {codec:.20}, expected none, {known}")
    if len(plain) != size:
        raise ValueError(f"chunk holds other than {size} bytes once decompressed")
    return plain


# One byte more than expected is asked for, so that a chunk that is longer shows.


def _bz2(data: Buffer, size: int) -> bytes:
    import bz2

    return bz2.BZ2Decompressor().decompress(data, size + 1)


def _lz4(data: Buffer, size: int) -> bytes:
    from lz4.frame import LZ4FrameDecompressor

    plain: bytes = LZ4FrameDecompressor().decompress(data, max_length=size + 1)
    return plain


def _zstd(data: Buffer, size: int) -> bytes:
    from zstandard import ZstdDecompressor

    # Its one-shot function trusts the size in the frame's own header; a stream does not.
    return ZstdDecompressor(max_window_size=MAX_PIECE).stream_reader(data).read(size + 1)


_DECOMPRESSORS: dict[str, Callable[[Buffer, int], bytes]] = {
    "bz2": _bz2,
    "lz4": _lz4,
    "zstd": _zstd,
}
