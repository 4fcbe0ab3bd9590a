"""MCAP files with messages of ROS 2 (cdr) or ROS 1, chunked or not, whole or cut off.

The mcap library decodes the index. Records are read here, since it is slower, and trusts the
lengths in damaged ones: see docs/logs.md.
"""

import struct
import zlib
from collections import Counter
from collections.abc import Collection, Iterator
from io import BytesIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Footer, Statistics

from ..errors import LogError
from ..rosmsg.wire import Buffer
from .base import Head
from .ros import RosLog
from .ros_bag import Bag, Connection, Connections, RecordBag, Source, decompress

_MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")  # Code and length of a record.
_NUMBER = struct.Struct("<H")  # Of a channel or schema.
#: Channel, number, and times of log and of publishing, before the message itself [bytes].
_MESSAGE_HEAD = 22
_CHUNK_TIMES_SIZE, _FOOTER_SIZE = 16, 20
# As plain numbers, which compare faster.
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = map(
    int, (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK)
)
_IN_CHUNKS = {_SCHEMA, _CHANNEL, _MESSAGE}
#: Records that are read; the others are skipped.
_READ = {*_IN_CHUNKS, _CHUNK, int(Opcode.STATISTICS)}
#: No file has as many messages: statistics that say so are wrong.
_MANY = 1 << 40


class McapLog(RosLog):
    """Scans of an MCAP file: LaserScan, MultiEchoLaserScan, a ring of PointCloud2.

    Encodings ``cdr`` (ROS 2) and ``ros1``; chunks plain, lz4 or zstd, checked by their CRC. See
    :class:`~lineament.logs.ros.RosLog` for parameters and errors.
    """

    format = "mcap"
    description = "MCAP (sensor_msgs)"
    endings = (".mcap",)

    def _open_bags(self) -> list[Bag]:
        return [McapBag(self.source)]

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether it begins with the magic of MCAP."""
        return head.data.startswith(_MAGIC)


class _Channels(Connections):
    """Channels and schemas met so far."""

    def __init__(self, topics: Collection[str] | None) -> None:
        super().__init__(topics)
        self._types = {0: ""}

    def read(self, head: int, data: Buffer) -> tuple[Connection, Buffer] | None:
        if head == _MESSAGE:
            (number,) = _NUMBER.unpack_from(data)
            connection = self.sender(number)
            return connection and (connection, data[_MESSAGE_HEAD:])
        # Only the names: what else these records hold may be broken.
        if head == _SCHEMA:
            (number,) = _NUMBER.unpack_from(data)
            self._types[number], _ = _text(data, 2)
        elif head == _CHANNEL:
            number, schema = struct.unpack_from("<HH", data)
            topic, at = _text(data, 4)
            encoding, _ = _text(data, at)
            if schema not in self._types:
                raise ValueError(f"channel of schema {schema}, which is not described before it")
            self.note(number, Connection.named(topic, self._types[schema], encoding))
        return None


class McapBag(RecordBag):
    """One MCAP file."""

    connections = _Channels

    def _records(self, source: Source) -> Iterator[tuple[int, int, Buffer]]:
        if source.take(len(_MAGIC), "magic") != _MAGIC:
            raise LogError(self.path, "is no MCAP file, expected its magic at the start")
        return _records(source)

    def _unpacked(self, head: int, data: Buffer) -> Iterator[tuple[int, Buffer]]:
        if head != _CHUNK:
            yield head, data
            return
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

    def _indexed_counts(self, source: Source) -> Counter[Connection] | None:
        channels = _Channels(None)
        size = _HEAD.size + _FOOTER_SIZE + len(_MAGIC)
        source.go(max(source.left - size, 0))
        tail = source.take(size, "footer")
        start = Footer.read(ReadDataStream(BytesIO(tail[_HEAD.size :]))).summary_start
        if not tail.endswith(_MAGIC) or tail[0] != Opcode.FOOTER or not start:
            return None
        source.go(start)
        for _, code, data in _records(source):
            if code == Opcode.STATISTICS:
                try:
                    found = Statistics.read(ReadDataStream(BytesIO(data)))
                except McapError:
                    return None
                counts = channels.counted(found.channel_message_counts.items())
                return counts if counts.total() == found.message_count < _MANY else None
            channels.read(code, data)
        return None


def _records(source: Source) -> Iterator[tuple[int, int, bytes]]:
    """Read records, with their places and codes, up to the footer."""
    while True:
        at = source.at
        if not source.left:
            raise source.wrong("ends without a footer: it is cut off, or still recorded")
        code, length = _HEAD.unpack(source.take(_HEAD.size, "head of a record"))
        what = "chunk" if code == _CHUNK else f"record of code {code}"
        if code == Opcode.FOOTER:
            return
        if code == 0:
            raise source.wrong("record has the code 0, expected one of MCAP")
        if code in _READ:
            yield at, code, source.take(length, what)
        else:
            source.skip(length, what)


def _text(data: Buffer, at: int) -> tuple[str, int]:
    """Read a string with its length before it, and where it ends."""
    (length,) = struct.unpack_from("<I", data, at)
    end = at + 4 + length
    if end > len(data):
        raise ValueError(f"text of {length} bytes in a record with {len(data) - at - 4} left")
    return str(data[at + 4 : end], "utf-8", "replace"), end
