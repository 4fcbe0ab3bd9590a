"""Logs that are small on disk and huge, endless or deep to whoever believes them."""

import bz2
import gzip
import os
import sqlite3
import struct
import zipfile
from collections.abc import Callable
from itertools import repeat
from pathlib import Path

import zstandard
from text_logs import FLASER

MANY = 60_000_000
_ZEROS = bytes(1 << 20)
_HEADER = b"\0\1\0\0" + struct.pack("<iII", 7, 0, 6) + b"laser\0\0\0"
_GEOMETRY = struct.pack("<7f", -3.0, 3.0, 1e-7, 0, 0.1, 0.1, 30.0)
_ROS1_HEADER = struct.pack("<IIII", 0, 7, 0, 5) + b"laser"
_TYPES = {
    kind: f"sensor_msgs/msg/{kind}".encode()
    for kind in ("LaserScan", "MultiEchoLaserScan", "PointCloud2")
}


def laser_scan(says: int, has: int | None = None, ros: int = 2) -> bytes:
    """Serialise a scan that says how many beams it has, and has as many, all 0 m."""
    start = (_HEADER if ros == 2 else _ROS1_HEADER) + _GEOMETRY
    return start + struct.pack("<I", says) + bytes(4 * (says if has is None else has) + 4)


def multi_echo_scan(n: int) -> bytes:
    """Serialise a beam with as many echoes."""
    echoes = struct.pack("<II", 1, n) + bytes(4 * n)
    return _HEADER + _GEOMETRY + echoes + struct.pack("<I", 0)


def cloud(points: int) -> bytes:
    """Serialise a cloud of a ring, in which each point is 12 bytes."""
    fields = struct.pack("<I", 3)
    for i, name in enumerate((b"x\0\0\0", b"y\0\0\0", b"ring\0\0\0\0")):
        length = len(name.rstrip(b"\0")) + 1
        fields += struct.pack("<I", length) + name + struct.pack("<IB3xI", 4 * i, (7, 7, 6)[i], 1)
    size = struct.pack("<II", 1, points)
    layout = struct.pack("<B3xIII", 0, 12, 12 * points, 12 * points)
    return _HEADER + size + fields + layout + bytes(12 * points) + b"\1"


# --- bags


def _text(text: bytes) -> bytes:
    return struct.pack("<I", len(text)) + text


def mcap_record(code: int, data: bytes) -> bytes:
    return struct.pack("<BQ", code, len(data)) + data


def mcap(
    path: Path,
    message: bytes,
    many: int = 1,
    *,
    kind: str = "LaserScan",
    topic: bytes = b"/scan",
    packed: bool = True,
    chunks: int = 1,
) -> None:
    """Write a message many times, in chunks packed by zstd or as it is; without an end."""
    schema = struct.pack("<H", 1) + _text(_TYPES[kind]) + _text(b"ros2msg") + _text(b"")
    channel = struct.pack("<HH", 1, 1) + _text(topic) + _text(b"cdr") + _text(b"")
    begin = mcap_record(3, schema) + mcap_record(4, channel)
    record = mcap_record(5, bytes([1]) + bytes(21) + message)
    with path.open("wb") as file:
        file.write(b"\x89MCAP0\r\n")
        if not packed:
            file.writelines((begin, record * many))
            return
        packer = zstandard.ZstdCompressor(level=1).compressobj()
        data = b"".join(map(packer.compress, (begin, *repeat(record, many)))) + packer.flush()
        size = len(begin) + len(record) * many
        head = struct.pack("<QQQI", 0, 0, size, 0) + _text(b"zstd") + struct.pack("<Q", len(data))
        file.write(mcap_record(6, head + data) * chunks)


def field(name: bytes, value: bytes) -> bytes:
    return struct.pack("<I", len(name) + 1 + len(value)) + name + b"=" + value


def record(header: bytes, data: bytes, says: int | None = None) -> bytes:
    """Make a record of a bag of ROS 1, which may say that it has another length than it has."""
    size = len(data) if says is None else says
    return struct.pack("<I", len(header)) + header + struct.pack("<I", size) + data


def rosbag1(path: Path, message: bytes, pack: str = "none") -> None:
    """Write a message in a chunk."""
    number, time = field(b"conn", bytes(4)), field(b"time", bytes(8))
    names = field(b"topic", b"/scan") + field(b"type", b"sensor_msgs/LaserScan")
    chunk = record(field(b"op", b"\7") + number + field(b"topic", b"/scan"), names)
    chunk += record(field(b"op", b"\2") + number + time, message)
    size = field(b"size", struct.pack("<I", len(chunk)))
    head = field(b"op", b"\5") + field(b"compression", pack.encode()) + size
    start = field(b"op", b"\3") + field(b"index_pos", bytes(8))
    data = bz2.compress(chunk) if pack == "bz2" else chunk
    path.write_bytes(b"#ROSBAG V2.0\n" + record(start, b"") + record(head, data))


def database(path: Path, rows: int = 40, size: int = 1000, message: bytes | None = None) -> None:
    """Write messages into a ROS 2 bag of sqlite3."""
    connection = sqlite3.connect(path)
    connection.execute("PRAGMA page_size = 4096")
    connection.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, "
                       "serialization_format, offered_qos_profiles)")  # fmt: skip
    connection.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data)")
    topic = 1, "/scan", _TYPES["LaserScan"].decode(), "cdr", ""
    connection.execute("INSERT INTO topics VALUES (?, ?, ?, ?, ?)", topic)
    data = laser_scan(size) if message is None else message
    connection.executemany(
        "INSERT INTO messages(topic_id, timestamp, data) VALUES (1, ?, ?)",
        ((i, data) for i in range(rows)),
    )
    connection.commit()
    connection.close()


def looping_database(path: Path, levels: int = 16, beams: int = 1000) -> None:
    """A database whose inner pages all lead to the next one, many times over."""
    database(path, size=beams)
    connection = sqlite3.connect(path)
    (root,) = connection.execute(
        "SELECT rootpage FROM sqlite_master WHERE name = 'messages'"
    ).fetchone()
    connection.close()
    data = bytearray(path.read_bytes())
    size, pages = 4096, len(data) // 4096
    begin = (root - 1) * size
    assert data[begin] == 5, "the root of the table is an inner page"
    at = struct.unpack_from(">H", data, begin + 12)[0]
    (leaf,) = struct.unpack_from(">I", data, begin + at)  # the first child of the root
    for level in range(levels):
        following = leaf if level == levels - 1 else pages + level + 2
        page = bytearray(size)
        cells, where = 600, size - 8
        struct.pack_into(">BHHHBI", page, 0, 5, 0, cells, where, 0, following)
        struct.pack_into(">IB", page, where, following, 1)
        struct.pack_into(f">{cells}H", page, 12, *[where] * cells)
        data += page
    data[begin : begin + size] = data[pages * size : (pages + 1) * size]
    struct.pack_into(">I", data, 28, len(data) // size)
    path.write_bytes(data)


# --- text and archives


def _gzip(path: Path, *pieces: bytes, many: int = 512) -> None:
    """Write a piece and then another, many times, each as a member of its own."""
    *first, last = map(gzip.compress, pieces)
    path.write_bytes(b"".join(first) + last * many)


def _npz(path: Path, beams: int, kind: str, method: int, scans: int = 1) -> None:
    import numpy as np

    with zipfile.ZipFile(path, "w", method) as archive:
        for name, shape in (("ranges", (scans, beams)), ("angle_min", ()), ("angle_increment", ())):
            own, kind_is_number = (kind, False) if name == "ranges" else ("<f8", True)
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                head = {"descr": own, "fortran_order": False, "shape": shape}
                np.lib.format.write_array_header_1_0(file, head)
                left = int(np.prod(shape, dtype=int)) * np.dtype(own).itemsize
                for _ in range(left >> 20):
                    file.write(_ZEROS)
                last = np.full(1, 1e-7).tobytes() if kind_is_number else bytes(left % len(_ZEROS))
                file.write(last)


def _zip(path: Path, *pieces: bytes, name: str = "a.log") -> None:
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open(name, "w", force_zip64=True) as file,
    ):
        for piece in pieces:
            file.write(piece)


def _write(path: Path, *pieces: bytes) -> None:
    path.write_bytes(b"".join(pieces))


def _csm(readings: str, more: str = "") -> bytes:
    return f'{{"min_theta": -1, "max_theta": 1{more}, "readings": {readings}}}\n'.encode()


def _many_members(path: Path, n: int) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        for i in range(n):
            archive.writestr(f"{i}", b"")


def _sparse(path: Path) -> None:
    """A record of 2 GiB that is there, and takes no room on disk."""
    rosbag1(path, laser_scan(3, ros=1))
    data = path.read_bytes()
    head = field(b"op", b"\5") + field(b"compression", b"none") + field(b"size", bytes(4))
    start = data + struct.pack("<I", len(head)) + head + struct.pack("<I", 1 << 31)
    path.write_bytes(start)
    os.truncate(path, len(start) + (1 << 31))


#: By the name of the file: which limit it is beyond, how it is written, how it is read.
CRAFTED: dict[str, tuple[str, Callable[[Path], None], dict[str, object]]] = {
    "scan.mcap": ("ratio", lambda path: mcap(path, laser_scan(MANY)), {}),
    "scans.mcap": ("ratio", lambda path: mcap(path, laser_scan(3), 1_000_000), {}),
    "chunks.mcap": ("ratio", lambda path: mcap(path, laser_scan(1 << 16), 40, chunks=3), {}),
    "beams.mcap": ("beams", lambda path: mcap(path, laser_scan(1 << 24), packed=False), {}),
    "echoes.mcap": (
        "points",
        lambda path: mcap(path, multi_echo_scan(1 << 24), kind="MultiEchoLaserScan", packed=False),
        {},
    ),
    "cloud.mcap": (
        "points",
        lambda path: mcap(path, cloud(5_000_000), kind="PointCloud2", packed=False),
        {"ring": 0},
    ),
    "ring.mcap": (
        "beams",
        lambda path: mcap(path, cloud(3_000_000), kind="PointCloud2", packed=False),
        {"ring": 0},
    ),
    "name.mcap": ("name", lambda path: mcap(path, laser_scan(3), topic=b"/a" * 5_000_000), {}),
    "packed.bag": ("ratio", lambda path: rosbag1(path, laser_scan(1 << 24, ros=1), "bz2"), {}),
    "array.bag": ("", lambda path: rosbag1(path, laser_scan(2**32 - 1, 3, ros=1)), {}),
    "sparse.bag": ("piece", _sparse, {}),
    "loop.db3": ("", looping_database, {}),
    "again.db3": ("", lambda path: looping_database(path, 1, 25_000), {}),
    "rows.db3": ("rows", lambda path: database(path, 1000, 3), {"limits": {"rows": 999}}),
    "message.db3": (
        "ratio",
        lambda path: database(path, 3, message=zstandard.compress(laser_scan(1 << 24))),
        {},
    ),
    "packed.npz": ("ratio", lambda path: _npz(path, MANY, "<f4", zipfile.ZIP_DEFLATED), {}),
    "beams.npz": ("beams", lambda path: _npz(path, 1 << 25, "|u1", zipfile.ZIP_STORED), {}),
    "scans.npz": ("scans", lambda path: _npz(path, 2, "|u1", zipfile.ZIP_STORED, 1 << 24), {}),
    "lines.log.gz": ("ratio", lambda path: _gzip(path, b"ODOM 1 2\n", b"\n" * (1 << 20)), {}),
    "comments.csv.gz": ("ratio", lambda path: _gzip(path, b"#\n" * (1 << 19)), {}),
    "bag.gz": ("ratio", lambda path: _gzip(path, b"#ROSBAG V2.0\n", _ZEROS), {}),
    "copy.gz": (
        "copy",
        lambda path: _gzip(path, b"#ROSBAG V2.0\n", _ZEROS, many=8),
        {"limits": {"copy": 1 << 20}},
    ),
    "beams.log": ("beams", lambda path: _write(path, b"FLASER 70000 ", b"1 " * 70_009), {}),
    "line.log": ("line", lambda path: _write(path, FLASER[:7], b"1 " * (1 << 23)), {}),
    "object.json": ("line", lambda path: _write(path, _csm("[" + "1," * (1 << 22) + "1]")), {}),
    "deep.json": ("depth", lambda path: _write(path, _csm("[" * 1_000_000)), {}),
    "nested.json": (
        "depth",
        lambda path: _write(path, _csm("[1, 1]", ', "x": ' + "[" * 100 + "]" * 100)),
        {},
    ),
    "units.json": (
        "beams",
        lambda path: _write(
            path, b'{"a": [[1, 0]', *(b",[1,%.5f]" % (i / 1e5) for i in range(1, 70_000)), b"]}"
        ),
        {},
    ),
    "beams.csv": (
        "beams",
        lambda path: _write(path, b"\n".join(b"%d,1" % i for i in range(200_000))),
        {},
    ),
    "bomb.zip": ("ratio", lambda path: _zip(path, FLASER, *repeat(_ZEROS, 300)), {}),
    "members.zip": ("members", lambda path: _many_members(path, 20_000), {}),
}
