"""MCAP files with messages of ROS 2 (cdr) or ROS 1, chunked or not, whole or cut off.

Read from the start, record by record; the index at the end is used for counts alone, so that a
file without one, or with a wrong one, is read like any other.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Collection, Iterator

from ..errors import LogError
from .base import Head
from .ros import RosLog
from .ros_bag import Bag, Buffer, Connection, Fault, Source, decompress

__all__ = ["McapBag", "McapLog"]

_MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")  # Code and length of a record.
_FOOTER = struct.Struct("<QQI")  # Where the summary begins, its offsets, its checksum.
_NUMBER = struct.Struct("<H")  # Of a channel or schema.
#: Channel, number, and times of log and of publishing, before the message itself [bytes].
_MESSAGE_HEAD = 22
_CHUNK_TIMES_SIZE = 16

_FOOTER_CODE, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _STATISTICS = 2, 3, 4, 5, 6, 11
#: No file has as many messages: statistics that say so are wrong.
_MANY = 1 << 40
_IN_CHUNKS = {_SCHEMA, _CHANNEL, _MESSAGE}
#: Records that are read; all others are gone over.
_READ = {*_IN_CHUNKS, _CHUNK, _STATISTICS}


class McapLog(RosLog):
    """Scans of an MCAP file: LaserScan, MultiEchoLaserScan, a ring of PointCloud2.

    Encodings ``cdr`` (ROS 2) and ``ros1``; chunks plain, lz4 or zstd, checked by their CRC. See
    :class:`~lineament.logs.ros.RosLog` for parameters and errors.
    """

    format = "mcap"
    description = "MCAP (sensor_msgs)"
    endings = (".mcap",)
    needs_seek = True

    def _open_bags(self) -> list[Bag]:
        return [McapBag(self.source)]

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether it begins with the magic of MCAP."""
        return head.data.startswith(_MAGIC)


class McapBag(Bag):
    """One MCAP file."""

    def messages(
        self, topics: Collection[str] | None, fault: Fault
    ) -> Iterator[tuple[Connection, Buffer]]:
        """Read the messages in the order of the file; see `Bag`."""
        channels = _Channels(topics)
        with Source(self.path) as source:
            try:
                if source.take(len(_MAGIC), "magic") != _MAGIC:
                    raise LogError(self.path, "is no MCAP file, expected its magic at the start")
                for at, code, data in _records(source):
                    try:
                        yield from channels.messages(code, data)
                    except (ValueError, struct.error) as error:
                        # The length of the record still tells where the next one begins.
                        fault(LogError(self.path, f"byte {at}: {error}"))
            except LogError as error:
                fault(error)

    def _indexed_counts(self) -> Counter[Connection] | None:
        channels = _Channels(None)
        size = _HEAD.size + _FOOTER.size + len(_MAGIC)
        with Source(self.path) as source:
            try:
                source.go(max(source.left - size, 0))
                tail = source.take(size, "footer")
                start = _FOOTER.unpack_from(tail, _HEAD.size)[0]
                if not tail.endswith(_MAGIC) or tail[0] != _FOOTER_CODE or not start:
                    return None
                source.go(start)
                for _, code, data in _records(source):
                    if code == _STATISTICS:
                        (total,) = struct.unpack_from("<Q", data)
                        counts = _counts(data, channels)
                        return counts if counts.total() == total < _MANY else None
                    channels.read(code, data)
            except (LogError, ValueError, struct.error, KeyError):
                pass
        return None


def _records(source: Source) -> Iterator[tuple[int, int, bytes]]:
    """Read records, with their places and codes, up to the footer."""
    while True:
        at = source.at
        if not source.left:
            raise source.wrong("ends without a footer: it is cut off, or still recorded")
        code, length = _HEAD.unpack(source.take(_HEAD.size, "head of a record"))
        what = "chunk" if code == _CHUNK else f"record of code {code}"
        if code == _FOOTER_CODE:
            return
        if code == 0:
            raise source.wrong("record has the code 0, expected one of MCAP")
        if code in _READ:
            yield at, code, source.take(length, what)
        else:
            source.skip(length, what)


def _in_chunk(data: bytes) -> Iterator[tuple[int, Buffer]]:
    """Read the records in a chunk, with their codes."""
    size, checksum = struct.unpack_from("<QI", data, _CHUNK_TIMES_SIZE)
    codec, at = _text(data, _CHUNK_TIMES_SIZE + 12)
    (length,) = struct.unpack_from("<Q", data, at)
    packed = memoryview(data)[at + 8 :]
    if length != len(packed):
        raise ValueError(f"chunk of {length} bytes in a record with {len(packed)} left for it")
    plain = memoryview(decompress(codec, packed, size))
    if checksum and zlib.crc32(plain) != checksum:
        raise ValueError("chunk has another checksum than it says: its data is broken")
    at = 0
    while at < size:
        code, length = _HEAD.unpack_from(plain, at)
        at, end = at + _HEAD.size, at + _HEAD.size + length
        if code not in _IN_CHUNKS or end > size:
            raise ValueError(f"chunk has a record of code {code} with {length} bytes in it")
        yield code, plain[at:end]
        at = end


class _Channels:
    """Channels and schemas met so far; those of other topics than the wanted are None."""

    def __init__(self, topics: Collection[str] | None) -> None:
        self._topics = topics
        self._types: dict[int, str] = {0: ""}
        self.by_number: dict[int, Connection | None] = {}

    def messages(self, code: int, data: bytes) -> Iterator[tuple[Connection, Buffer]]:
        """Take a record, or all in a chunk, and give the messages of wanted topics."""
        for record in _in_chunk(data) if code == _CHUNK else ((code, data),):
            message = self.read(*record)
            if message is not None:
                yield message

    def read(self, code: int, data: Buffer) -> tuple[Connection, Buffer] | None:
        """Take one record: note a schema or channel, return a message of a wanted topic."""
        if code == _MESSAGE:
            (number,) = _NUMBER.unpack_from(data)
            if number not in self.by_number:
                raise ValueError(f"message of channel {number}, which is not described before it")
            connection = self.by_number[number]
            return connection and (connection, data[_MESSAGE_HEAD:])
        if code == _SCHEMA:
            (number,) = _NUMBER.unpack_from(data)
            self._types[number] = _text(data, 2)[0]
        elif code == _CHANNEL:
            number, schema = struct.unpack_from("<HH", data)
            topic, at = _text(data, 4)
            encoding, _ = _text(data, at)
            if schema not in self._types:
                raise ValueError(f"channel of schema {schema}, which is not described before it")
            connection = Connection.named(topic, self._types[schema], encoding)
            is_wanted = self._topics is None or connection.topic in self._topics
            self.by_number[number] = connection if is_wanted else None
        return None


def _counts(data: bytes, channels: _Channels) -> Counter[Connection]:
    """Read the counts by channel from a record of statistics."""
    counts: Counter[Connection] = Counter()
    at = 46
    (length,) = struct.unpack_from("<I", data, at - 4)
    for number, count in struct.iter_unpack("<HQ", data[at : at + length]):
        connection = channels.by_number[number]
        if connection is not None:
            counts[connection] += count
    return counts


def _text(data: Buffer, at: int) -> tuple[str, int]:
    """Read a string with its length before it, and where it ends."""
    (length,) = struct.unpack_from("<I", data, at)
    end = at + 4 + length
    if end > len(data):
        raise ValueError(f"text of {length} bytes in a record with {len(data) - at - 4} left")
    return str(data[at + 4 : end], "utf-8", "replace"), end
