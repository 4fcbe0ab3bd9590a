"""What the containers of ROS messages have in common: connections, bounded reads, compression."""

import os
import struct
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple, Self

from ..errors import LogError
from ..limits import LIMITS, Limits
from ..rosmsg.wire import Buffer
from .lines import reading

#: Compressions of chunks.
_CODECS = ("bz2", "lz4", "zstd")

#: What a bag calls with each fault that it finds: it raises, or counts and returns.
Fault = Callable[[LogError], None]


class Connection(NamedTuple):
    """Who wrote a message: topic, type as ROS 1 writes it, serialisation, node ("" if unknown)."""

    topic: str
    type: str
    encoding: str
    publisher: str = ""

    @classmethod
    def named(
        cls, limits: Limits, topic: str, kind: str, encoding: str, publisher: str = ""
    ) -> Self:
        """Make a connection from the names in a bag; ``sensor_msgs/msg/LaserScan`` of ROS 2 too.

        Letters that cannot be printed come from damage, and go: errors are one line. ValueError if
        a name is longer than the limit.
        """
        names = topic, kind.replace("/msg/", "/"), encoding, publisher
        limits.check("name", max(map(len, names)))
        return cls(*("".join(filter(str.isprintable, name)) for name in names))


class Bag(ABC):
    """One file of messages; its ``str`` is what errors call it."""

    def __init__(self, path: str | os.PathLike[str], limits: Limits = LIMITS) -> None:
        self.path, self.limits = path, limits

    @abstractmethod
    def messages(
        self, topics: Collection[str] | None, fault: Fault
    ) -> Iterator[tuple[Connection, Buffer]]:
        """Read the messages on `topics`, or all if None, from the start in the bag's order.

        Faults go through `fault`; reading goes on behind them where that is possible.
        """

    @abstractmethod
    def counts(self) -> Counter[Connection]:
        """Count the messages of each connection; LogError if the bag is broken at its start."""


class RecordReader(ABC):
    """Reads a file of records once, those on `topics` or all; it has reached byte `at`."""

    def __init__(
        self,
        path: str | os.PathLike[str],
        topics: Collection[str] | None = None,
        limits: Limits = LIMITS,
    ) -> None:
        self.path, self.at, self._topics, self.limits = path, 0, topics, limits
        self._unpacked = 0
        self._connections: dict[int, Connection | None] = {}
        with reading(path):
            self._file = Path(path).open("rb")  # noqa: SIM115 (closed by __exit__)
            self._size = os.fstat(self._file.fileno()).st_size

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    @abstractmethod
    def records(self) -> Iterator[tuple[int, Any, Buffer]]:
        """Read all records from the start: their places, heads and data."""

    @abstractmethod
    def unpacked(self, head: Any, data: Buffer) -> Iterator[tuple[Any, Buffer]]:
        """Read the records in a chunk; of another record itself."""

    @abstractmethod
    def message(self, head: Any, data: Buffer) -> tuple[Connection, Buffer] | None:
        """Take one record: note a connection, return a message that is wanted."""

    @abstractmethod
    def indexed_counts(self) -> Counter[Connection]:
        """Count by the index alone; empty, or an error, where it is missing or makes no sense."""

    def wanted(self, connection: Connection) -> Connection | None:
        """Return a connection if its topic is wanted."""
        return connection if self._topics is None or connection.topic in self._topics else None

    def note(self, number: int, connection: Connection) -> None:
        """Remember a connection by its number."""
        self._connections[number] = self.wanted(connection)

    def sender(self, number: int) -> Connection | None:
        """Return the connection of a number if it is wanted; ValueError if it is not known."""
        if number not in self._connections:
            raise ValueError(f"message of connection {number}, which is not described before it")
        return self._connections[number]

    def counted(self, counts: Iterable[tuple[int, int]]) -> Counter[Connection]:
        """Add up counts of messages, by the numbers of their connections."""
        total: Counter[Connection] = Counter()
        for number, count in counts:
            connection = self.sender(number)
            if connection is not None:
                total[connection] += count
        return total

    @property
    def left(self) -> int:
        """Number of bytes from here to the end of the file."""
        return self._size - self.at

    def take(self, n: int, what: str) -> bytes:
        """Read the next `n` bytes; LogError if they are not all there, or too many."""
        self._check(n, what)
        self.limits.check("piece", n, self.wrong)
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
        self._check(n, what)
        self.go(self.at + n)

    def go(self, at: int) -> None:
        """Go to byte `at`."""
        with reading(self.path):
            self._file.seek(at)
        self.at = at

    def wrong(self, problem: str) -> LogError:
        """Make an error that says where in the file it is."""
        return LogError(self.path, f"byte {self.at}: {problem}")

    def unpack(self, codec: str, data: Buffer, size: int) -> Buffer:
        """Decompress a chunk, see `decompress`; all of them may grow by so much, and no more."""
        self.limits.check_growth(self._unpacked + size, self.at)
        self._unpacked += size
        return decompress(codec, data, size, self.limits)

    def _check(self, n: int, what: str) -> None:
        if n > self.left:
            raise self.wrong(f"is cut off: {what} has {n} bytes, {self.left} are left")


class RecordBag(Bag):
    """A bag that is a chain of records, some of them chunks; its index is used for counts alone."""

    def __init__(
        self, path: str | os.PathLike[str], reader: type[RecordReader], limits: Limits = LIMITS
    ) -> None:
        super().__init__(path, limits)
        self._reader = reader

    def messages(
        self, topics: Collection[str] | None, fault: Fault
    ) -> Iterator[tuple[Connection, Buffer]]:
        """Read the messages in the order of the file; see `Bag`."""
        with self._reader(self.path, topics, self.limits) as reader:
            try:
                for at, head, data in reader.records():
                    try:
                        for record in reader.unpacked(head, data):
                            message = reader.message(*record)
                            if message is not None:
                                yield message
                    except (ValueError, struct.error) as error:
                        # The length of the record still leads to the next one.
                        fault(LogError(self.path, f"byte {at}: {error}"))
            except LogError as error:
                fault(error)

    def counts(self) -> Counter[Connection]:
        """Count the messages of each connection: by the index where there is one; see `Bag`."""
        with (
            self._reader(self.path, None, self.limits) as reader,
            suppress(LogError, ValueError, struct.error),
        ):
            counts = reader.indexed_counts()
            if counts:
                return counts
        # Faults are reported when the messages are read: here they only end the count.
        faults: list[LogError] = []
        messages = self.messages(None, lambda error: faults.append(error.fresh()))
        counted = Counter(connection for connection, _ in messages)
        if faults and not counted:
            raise faults[0].fresh()
        return counted


def decompress(codec: str, data: Buffer, size: int, limits: Limits = LIMITS) -> Buffer:
    """Decompress a chunk that says how large it becomes [bytes], and never more than that.

    ValueError if the codec is not known, the data is broken, or its size is another or too large.
    """
    limits.check("piece", size)
    if codec in ("", "none"):
        plain = data
    elif codec in _CODECS:
        try:
            # One byte more than expected is asked for, so that a chunk that is longer shows.
            plain = _decompressed(codec, data, size + 1, limits)
        # The libraries have their own errors: RuntimeError, OSError, ZstdError, EOFError.
        except Exception as error:
            raise ValueError(f"{codec} data is broken: {error}") from None
    else:
        raise ValueError(f"chunk compressed by {codec:.20}, expected none, {', '.join(_CODECS)}")
    if len(plain) != size:
        raise ValueError(f"chunk holds other than {size} bytes once decompressed")
    return plain


def _decompressed(codec: str, data: Buffer, most: int, limits: Limits) -> bytes:
    if codec == "bz2":
        from bz2 import BZ2Decompressor

        return BZ2Decompressor().decompress(data, most)
    if codec == "lz4":
        from lz4.frame import LZ4FrameDecompressor

        return bytes(LZ4FrameDecompressor().decompress(data, max_length=most))
    from zstandard import ZstdDecompressor

    # Its one-shot function trusts the size in the frame's own header; a stream does not.
    return ZstdDecompressor(max_window_size=limits.piece).stream_reader(data).read(most)
