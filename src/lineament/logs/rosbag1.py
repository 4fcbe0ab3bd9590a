"""ROS 1 bags: ``#ROSBAG V2.0`` and its forerunner ``#ROSRECORD V1.2``."""

import struct
from collections import Counter
from collections.abc import Iterator

from ..errors import LogError
from ..limits import Limits
from ..rosmsg.wire import Buffer
from .base import Head
from .ros import RosLog
from .ros_bag import Bag, Connection, RecordBag, RecordReader

_MAGICS = (b"#ROSBAG V2.0\n", b"#ROSRECORD V1.2\n", b"#ROSRECORD V1.1\n")
_WORD = struct.Struct("<I")

# Operation codes; that of definitions is of version 1 alone.
_DEFINITION, _MESSAGE, _BAG, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = range(1, 8)
#: Codes of the records whose data is read; the others are skipped.
_READ = {_MESSAGE, _CHUNK, _CONNECTION, _CHUNK_INFO}

_Header = dict[bytes, bytes]


class Rosbag1Log(RosLog):
    """Scans of a ROS 1 bag of version 2.0, 1.2 or 1.1."""

    format = "rosbag1"
    description = "ROS 1 bag (sensor_msgs)"
    endings = (".bag", ".bag.active", ".bag.orig.active")

    def _open_bags(self) -> list[Bag]:
        return [RecordBag(self.source, _Reader, self.limits)]

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether it begins as a bag of any version."""
        return head.data.startswith((b"#ROSBAG V", b"#ROSRECORD V"))


class _Reader(RecordReader):
    """Reads a bag; version 1 has neither chunks nor connections."""

    def records(self) -> Iterator[tuple[int, _Header, Buffer]]:
        # Only the index of version 2 consists of separate records.
        has_index = self._magic() != _MAGICS[0]
        while self.left:
            at = self.at
            header, data = self._record()
            has_index = has_index or _code(header) in (_CONNECTION, _CHUNK_INFO)
            # That of an empty bag is empty, too.
            end = struct.pack("<Q", self.at)
            has_index = has_index or (_code(header) == _BAG and header.get(b"index_pos") == end)
            yield at, header, data
        if not has_index:
            raise self.wrong("ends without an index: it is cut off, or still recorded")

    def unpacked(self, head: _Header, data: Buffer) -> Iterator[tuple[_Header, Buffer]]:
        if _code(head) != _CHUNK:
            yield head, data
            return
        size = _word(head, b"size")
        plain = memoryview(self.unpack(_text(head, b"compression"), data, size))
        at = 0
        while at < size:
            fields, at = _piece(plain, at)
            message, at = _piece(plain, at)
            inner = _fields(fields, self.limits)
            if _code(inner) not in (_MESSAGE, _CONNECTION):
                raise ValueError(f"chunk has a record of code {_code(inner)} in it")
            yield inner, message

    def message(self, head: _Header, data: Buffer) -> tuple[Connection, Buffer] | None:
        code = _code(head)
        if code == _MESSAGE:
            if b"conn" in head:
                (number,) = _WORD.unpack(_field(head, b"conn", 4))
                connection = self.sender(number)
            else:  # Version 1: each message says all about itself.
                names = _text(head, b"topic"), _text(head, b"type"), "ros1"
                connection = self.wanted(Connection.named(self.limits, *names))
            return connection and (connection, data)
        if code == _CONNECTION:
            fields = {b"callerid": b""} | _fields(data, self.limits)
            names = _text(head, b"topic"), _text(fields, b"type"), "ros1"
            connection = Connection.named(self.limits, *names, _text(fields, b"callerid"))
            self.note(_word(head, b"conn"), connection)
        return None

    def indexed_counts(self) -> Counter[Connection]:
        counts: Counter[Connection] = Counter()
        version = self._magic()
        (start,) = struct.unpack("<Q", _field(self._record()[0], b"index_pos"))
        if version != _MAGICS[0] or not start:
            return counts
        self.go(start)
        while self.left:
            header, data = self._record()
            if _code(header) == _CONNECTION:
                self.message(header, data)
            elif _code(header) == _CHUNK_INFO:
                counts += self.counted(struct.iter_unpack("<II", data))
        return counts

    def _magic(self) -> bytes:
        """Read the first line, which says the version."""
        line = self.take(min(self.left, len(_MAGICS[1])), "first line")
        for magic in _MAGICS:
            if line.startswith(magic):
                self.go(len(magic))
                return magic
        known = ", ".join(magic.decode().strip() for magic in _MAGICS)
        raise LogError(self.path, f"begins with {line!r:.40}, expected a bag: {known}")

    def _record(self) -> tuple[_Header, bytes]:
        """Read one record; without its data where that is of no interest."""
        (size,) = _WORD.unpack(self.take(4, "length of a header"))
        try:
            header = _fields(self.take(size, "header of a record"), self.limits)
            code = _code(header)
        except ValueError as error:
            raise self.wrong(str(error)) from None
        (size,) = _WORD.unpack(self.take(4, "length of a record"))
        what = "chunk" if code == _CHUNK else f"record of code {code}"
        if code in _READ:
            return header, self.take(size, what)
        if code == _INDEX and header.get(b"ver") == _WORD.pack(1):
            # Early recorders wrote the length that the index of version 0 would have.
            count = header.get(b"count", b"")
            if len(count) == _WORD.size:
                size = 12 * _WORD.unpack(count)[0]
        self.skip(size, what)
        return header, b""


def _fields(data: Buffer, limits: Limits) -> _Header:
    """Split the header of a record into its fields ``name=value``."""
    limits.check("line", len(data))
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


def _word(header: _Header, name: bytes) -> int:
    return int.from_bytes(_field(header, name, 4), "little")


def _text(header: _Header, name: bytes) -> str:
    return _field(header, name).decode("utf-8", "replace")


def _piece(data: Buffer, at: int) -> tuple[Buffer, int]:
    """Read bytes with their length before them, and where they end."""
    end = at + 4 + _WORD.unpack_from(data, at)[0]
    if end > len(data):
        raise ValueError(f"record of {end - at - 4} bytes reaches past the end of its chunk")
    return data[at + 4 : end], end
