"""MCAP files with messages of ROS 2 (cdr) or ROS 1, chunked or not, whole or cut off.

The mcap library decodes the statistics. Other records are read here, since the library is slower,
and trusts the lengths in damaged ones: see docs/logs.md.
"""

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from io import BytesIO
from typing import Any

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Statistics

from ..errors import LogError
from ..limits import Limits
from ..rosmsg.wire import Buffer
from .base import Head
from .ros import RosLog
from .ros_bag import Bag, Connection, RecordBag, RecordReader

_MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")  # Code and length of a record.
_NUMBER = struct.Struct("<H")  # Of a channel or schema.
#: Channel, number, and times of log and of publishing, before the message itself [bytes].
_MESSAGE_HEAD = 22
_CHUNK_TIMES_SIZE, _FOOTER_SIZE = 16, 20
# As plain numbers, which compare faster.
_SCHEMA, _CHANNEL, _MESSAGE = int(Opcode.SCHEMA), int(Opcode.CHANNEL), int(Opcode.MESSAGE)
_CHUNK, _STATISTICS, _FOOTER = int(Opcode.CHUNK), int(Opcode.STATISTICS), int(Opcode.FOOTER)
_IN_CHUNKS = {_SCHEMA, _CHANNEL, _MESSAGE}
#: Records that are read; the others are skipped.
_READ = {*_IN_CHUNKS, _CHUNK, _STATISTICS}
#: No file has as many messages: statistics that say so are wrong.
_MANY = 1 << 40


class McapLog(RosLog):
    """Scans of an MCAP file."""

    format = "mcap"
    description = "MCAP (sensor_msgs)"
    endings = (".mcap",)

    def _open_bags(self) -> list[Bag]:
        return [RecordBag(self.source, McapReader, self.limits)]

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether it begins with the magic of MCAP."""
        return head.data.startswith(_MAGIC)


class McapReader(RecordReader):
    """Reads an MCAP file."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._types = {0: ""}  # by schema; a channel may have none

    def records(self) -> Iterator[tuple[int, int, bytes]]:
        """Read all records up to the footer: their places, codes and data."""
        if self.take(len(_MAGIC), "magic") != _MAGIC:
            raise LogError(self.path, "is no MCAP file, expected its magic at the start")
        return self._up_to_footer()

    def unpacked(self, head: int, data: Buffer) -> Iterator[tuple[int, Buffer]]:
        """Read the records in a chunk; of another record itself."""
        if head != _CHUNK:
            yield head, data
            return
        size, checksum = struct.unpack_from("<QI", data, _CHUNK_TIMES_SIZE)
        codec, at = _text(data, _CHUNK_TIMES_SIZE + 12, self.limits)
        (length,) = struct.unpack_from("<Q", data, at)
        packed = memoryview(data)[at + 8 :]
        if length != len(packed):
            raise ValueError(f"chunk of {length} bytes in a record with {len(packed)} left for it")
        plain = memoryview(self.unpack(codec, packed, size))
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

    def message(self, head: int, data: Buffer) -> tuple[Connection, Buffer] | None:
        """Take one record: note a schema or channel, return a message that is wanted."""
        if head == _MESSAGE:
            (number,) = _NUMBER.unpack_from(data)
            connection = self.sender(number)
            return connection and (connection, data[_MESSAGE_HEAD:])
        # Only the names are read: what else these records hold may be broken.
        if head == _SCHEMA:
            (number,) = _NUMBER.unpack_from(data)
            self._types[number], _ = _text(data, 2, self.limits)
        elif head == _CHANNEL:
            number, schema = struct.unpack_from("<HH", data)
            topic, at = _text(data, 4, self.limits)
            encoding, _ = _text(data, at, self.limits)
            if schema not in self._types:
                raise ValueError(f"channel of schema {schema}, which is not described before it")
            names = topic, self._types[schema], encoding
            self.note(number, Connection.named(self.limits, *names))
        return None

    def indexed_counts(self) -> Counter[Connection]:
        """Count by the statistics, if they agree with themselves."""
        size = _HEAD.size + _FOOTER_SIZE + len(_MAGIC)
        self.go(max(self.left - size, 0))
        tail = self.take(size, "footer")
        (start,) = struct.unpack_from("<Q", tail, _HEAD.size)
        if tail.endswith(_MAGIC) and tail[0] == _FOOTER and start:
            self.go(start)
            for _, code, data in self._up_to_footer():
                if code == _STATISTICS:
                    return self._agreed(data)
                self.message(code, data)
        return Counter()

    def _agreed(self, data: bytes) -> Counter[Connection]:
        try:
            found = Statistics.read(ReadDataStream(BytesIO(data)))
        except McapError:
            return Counter()
        counts = self.counted(found.channel_message_counts.items())
        return counts if counts.total() == found.message_count < _MANY else Counter()

    def _up_to_footer(self) -> Iterator[tuple[int, int, bytes]]:
        while True:
            at = self.at
            if not self.left:
                raise self.wrong("ends without a footer: it is cut off, or still recorded")
            code, length = _HEAD.unpack(self.take(_HEAD.size, "head of a record"))
            what = "chunk" if code == _CHUNK else f"record of code {code}"
            if code == _FOOTER:
                return
            if code == 0:
                raise self.wrong("record has the code 0, expected one of MCAP")
            if code in _READ:
                yield at, code, self.take(length, what)
            else:
                self.skip(length, what)


def _text(data: Buffer, at: int, limits: Limits) -> tuple[str, int]:
    """Read a string with its length before it, and where it ends."""
    (length,) = struct.unpack_from("<I", data, at)
    end = at + 4 + length
    if end > len(data):
        raise ValueError(f"text of {length} bytes in a record with {len(data) - at - 4} left")
    limits.check("name", length)
    return str(data[at + 4 : end], "utf-8", "replace"), end
