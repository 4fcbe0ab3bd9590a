"""ROS 1 bags: ``#ROSBAG V2.0`` and its forerunner ``#ROSRECORD V1.2``.

Read from the start, record by record; the index at the end is used for counts alone, so that a
bag without one (cut off, or ``.active``), or with a wrong one, is read like any other.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Collection, Iterator

from ..errors import LogError
from .base import Head
from .ros import RosLog
from .ros_bag import Bag, Buffer, Connection, Fault, Source, decompress

__all__ = ["Rosbag1", "Rosbag1Log"]

_MAGICS = (b"#ROSBAG V2.0\n", b"#ROSRECORD V1.2\n", b"#ROSRECORD V1.1\n")
_WORD = struct.Struct("<I")

# Operation codes; that of definitions is of version 1 alone.
_DEFINITION, _MESSAGE, _BAG, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = range(1, 8)
#: Codes of the records whose data is read; that of others is gone over.
_READ = {_MESSAGE, _CHUNK, _CONNECTION, _CHUNK_INFO}

_Header = dict[bytes, bytes]


class Rosbag1Log(RosLog):
    """Scans of a ROS 1 bag: LaserScan, MultiEchoLaserScan, a ring of PointCloud2.

    Versions 2.0 (chunks plain, bz2 or lz4), 1.2 and 1.1. See
    :class:`~lineament.logs.ros.RosLog` for parameters and errors.
    """

    format = "rosbag1"
    description = "ROS 1 bag (sensor_msgs)"
    endings = (".bag", ".bag.active", ".bag.orig.active")
    needs_seek = True

    def _open_bags(self) -> list[Bag]:
        return [Rosbag1(self.source)]

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether it begins as a bag of any version."""
        return head.data.startswith((b"#ROSBAG V", b"#ROSRECORD V"))


class Rosbag1(Bag):
    """One ROS 1 bag."""

    def messages(
        self, topics: Collection[str] | None, fault: Fault
    ) -> Iterator[tuple[Connection, Buffer]]:
        """Read the messages in the order of the file; see `Bag`."""
        connections = _Connections(topics)
        with Source(self.path) as source:
            try:
                # Only that of version 2 is made of records of its own.
                has_index = _read_magic(source) != _MAGICS[0]
                while source.left:
                    at = source.at
                    header, data = _record(source)
                    has_index = has_index or _code(header) in (_CONNECTION, _CHUNK_INFO)
                    try:
                        yield from connections.messages(header, data)
                    except (ValueError, struct.error) as error:
                        # The length of the record still tells where the next one begins.
                        fault(LogError(self.path, f"byte {at}: {error}"))
                if not has_index:
                    raise source.wrong("ends without an index: it is cut off, or still recorded")
            except LogError as error:
                fault(error)

    def _indexed_counts(self) -> Counter[Connection] | None:
        connections = _Connections(None)
        counts: Counter[Connection] = Counter()
        with Source(self.path) as source:
            try:
                version = _read_magic(source)
                header, _ = _record(source)
                (start,) = struct.unpack("<Q", _field(header, b"index_pos"))
                if version != _MAGICS[0] or not start:
                    return None
                source.go(start)
                while source.left:
                    header, data = _record(source)
                    if _code(header) == _CONNECTION:
                        connections.read(header, data)
                    elif _code(header) == _CHUNK_INFO:
                        for number, count in struct.iter_unpack("<II", data):
                            counts[connections.by_number[number]] += count
            except (LogError, ValueError, struct.error, KeyError):
                return None
        return counts or None


def _read_magic(source: Source) -> bytes:
    """Read the first line, which tells the version."""
    line = source.take(min(source.left, len(_MAGICS[0])), "first line")
    if not line.endswith(b"\n"):
        line += source.take(min(source.left, len(_MAGICS[1]) - len(line)), "first line")
    if line not in _MAGICS:
        known = ", ".join(magic.decode().strip() for magic in _MAGICS)
        raise LogError(source.path, f"begins with {line!r:.40}, expected a bag: {known}")
    return line


def _record(source: Source) -> tuple[_Header, bytes]:
    """Read one record; its data is empty where it is of no interest."""
    (size,) = _WORD.unpack(source.take(4, "length of a header"))
    try:
        header = _fields(source.take(size, "header of a record"))
        code = _code(header)
    except ValueError as error:
        raise source.wrong(str(error)) from None
    (size,) = _WORD.unpack(source.take(4, "length of a record"))
    what = "chunk" if code == _CHUNK else f"record of code {code}"
    if code in _READ:
        return header, source.take(size, what)
    if code == _INDEX and header.get(b"ver") == _WORD.pack(1):
        # Early recorders wrote the length that the index of version 0 would have.
        count = header.get(b"count", b"")
        if len(count) == _WORD.size:
            size = 12 * _WORD.unpack(count)[0]
    source.skip(size, what)
    return header, b""


def _fields(data: Buffer) -> _Header:
    """Split the header of a record into its fields ``name=value``."""
    fields: _Header = {}
    raw, at = bytes(data), 0
    while at < len(raw):
        if at + 4 > len(raw):
            raise ValueError("header of a record ends within the length of a field")
        end = at + 4 + _WORD.unpack_from(raw, at)[0]
        name, equals, value = raw[at + 4 : end].partition(b"=")
        if end > len(raw) or not equals:
            raise ValueError("header of a record has a broken field, expected name=value")
        fields[name] = value
        at = end
    return fields


def _field(header: _Header, name: bytes, size: int | None = None) -> bytes:
    value = header.get(name)
    if value is None or size not in (None, len(value)):
        raise ValueError(f"record without a right field {name.decode()}")
    return value


def _code(header: _Header) -> int:
    return _field(header, b"op", 1)[0]


def _text(header: _Header, name: bytes) -> str:
    return _field(header, name).decode("utf-8", "replace")


def _in_chunk(header: _Header, data: bytes) -> Iterator[tuple[_Header, Buffer]]:
    """Read the records in a chunk: their headers and data."""
    (size,) = _WORD.unpack(_field(header, b"size", 4))
    plain = memoryview(decompress(_text(header, b"compression"), data, size))
    at = 0
    while at < size:
        fields, at = _piece(plain, at)
        message, at = _piece(plain, at)
        inner = _fields(fields)
        if _code(inner) not in (_MESSAGE, _CONNECTION):
            raise ValueError(f"chunk has a record of code {_code(inner)} in it")
        yield inner, message


def _piece(data: Buffer, at: int) -> tuple[Buffer, int]:
    """Read bytes with their length before them, and where they end."""
    end = at + 4 + _WORD.unpack_from(data, at)[0]
    if end > len(data):
        raise ValueError(f"record of {end - at - 4} bytes reaches past the end of its chunk")
    return data[at + 4 : end], end


class _Connections:
    """Connections met so far, by their numbers; version 1 has none."""

    def __init__(self, topics: Collection[str] | None) -> None:
        self._topics = topics
        self.by_number: dict[int, Connection] = {}

    def messages(self, header: _Header, data: bytes) -> Iterator[tuple[Connection, Buffer]]:
        """Take a record, or all in a chunk, and give the messages of wanted topics."""
        is_chunk = _code(header) == _CHUNK
        for record in _in_chunk(header, data) if is_chunk else ((header, data),):
            message = self.read(*record)
            if message is not None:
                yield message

    def read(self, header: _Header, data: Buffer) -> tuple[Connection, Buffer] | None:
        """Take one record: note a connection, return a message of a wanted topic."""
        code = _code(header)
        if code == _MESSAGE:
            connection = self._sender(header)
            if self._topics is None or connection.topic in self._topics:
                return connection, data
        elif code == _CONNECTION:
            (number,) = _WORD.unpack(_field(header, b"conn", 4))
            fields = _fields(data)
            publisher = fields.get(b"callerid", b"").decode("utf-8", "replace")
            self.by_number[number] = Connection.named(
                _text(header, b"topic"), _text(fields, b"type"), "ros1", publisher
            )
        return None

    def _sender(self, header: _Header) -> Connection:
        if b"conn" not in header:  # Version 1: each message says all about itself.
            return Connection.named(_text(header, b"topic"), _text(header, b"type"), "ros1")
        (number,) = _WORD.unpack(_field(header, b"conn", 4))
        if number not in self.by_number:
            raise ValueError(f"message of connection {number}, which is not described before it")
        return self.by_number[number]
