"""Bags that are cut off, damaged or hostile: what is whole is read, then one clear line."""

from __future__ import annotations

import random
import re
import shutil
import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import ros_bags
from mcap.writer import Writer

from lineament import LogError
from lineament.logs import open_log, ros_bag

every_kind = pytest.mark.parametrize("kind", ros_bags.KINDS)
N = 60


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    """A whole bag of each kind, as a file: of a folder its database."""
    folder = tmp_path_factory.mktemp("bags")
    found: dict[str, Path] = {}
    for kind in ros_bags.KINDS:
        messages = ros_bags.Messages(ros_bags.ros_of(kind))
        items = [("/scan", i, messages.scan(i, ranges_of(i))) for i in range(N)]
        path = ros_bags.write_bag(folder / f"{kind}{ros_bags.ending(kind)}", kind, items)
        found[kind] = next(path.glob("*.db3")) if path.is_dir() else path
    return found


def ranges_of(i):
    return (1.0 + i + 0.01 * np.arange(40)).astype(np.float32)


def is_whole(scan):
    """Whether a scan is the one that its stamp tells."""
    return np.array_equal(scan.ranges, ranges_of(scan.stamp))


def read(path, **options):
    """Read scans up to the first error: them, and its text."""
    scans = []
    try:
        scans.extend(open_log(path, **options))
    except LogError as error:
        assert "\n" not in str(error)  # noqa: PT017
        assert str(path) in str(error)  # noqa: PT017
        return scans, error.problem
    return scans, None


@every_kind
def test_cut_off_anywhere(bags, tmp_path, kind):
    """What comes before the cut is read; nothing else is made up."""
    data = bags[kind].read_bytes()
    path = tmp_path / bags[kind].name
    most = 0
    for cut in np.linspace(1, len(data) - 1, 100).astype(int):
        path.write_bytes(data[:cut])
        scans, problem = read(path)
        assert all(is_whole(scan) for scan in scans)
        assert [scan.stamp for scan in scans] == list(range(len(scans)))
        # A part of the index may go without any loss.
        assert problem or len(scans) == N
        kept, problem = read(path, keep_going=True)
        assert problem is None or not kept
        assert len(kept) >= len(scans)
        most = max(most, len(scans))
    assert most > 0.8 * N


@every_kind
@pytest.mark.parametrize("damage", ["bit", "word"])
def test_bits_that_flip_and_words_that_are_wrong(bags, tmp_path, kind, damage):
    data = bags[kind].read_bytes()
    path = tmp_path / bags[kind].name
    chance = random.Random(5)
    damaged = 0
    for _ in range(100):
        changed = bytearray(data)
        at = chance.randrange(len(data) - 4)
        if damage == "bit":
            changed[at] ^= 1 << chance.randrange(8)
        else:
            word = chance.choice((0, 1, 2, 2**31, 2**32 - 1, chance.randrange(2**32)))
            struct.pack_into("<I", changed, at, word)
        path.write_bytes(changed)
        scans, problem = read(path, keep_going=True)
        assert len(scans) <= N
        damaged += problem is not None or not all(is_whole(scan) for scan in scans)
        if kind in ("mcap", "mcap-lz4", "mcap-zstd", "mcap-ros1"):
            # Chunks have checksums: a scan that comes is the one that was written.
            assert all(is_whole(scan) for scan in scans)
    assert damaged < 100


@pytest.mark.parametrize(
    ("kind", "begin"),
    [
        ("rosbag1", b"compression="),
        ("mcap", b"sensor_msgs"),
        ("mcap-plain", b"sensor_msgs"),
        ("mcap-plain", b"/scan"),
    ],
)
def test_any_byte_of_the_structure_may_be_wrong(bags, tmp_path, kind, begin):
    """Those around the first chunk, schema, channel or message: lengths, codes and names."""
    data = bags[kind].read_bytes()
    first = max(data.index(begin) - 60, 0)
    path = tmp_path / bags[kind].name
    for at in range(first, first + 150):
        for value in (0, 1, 255):
            path.write_bytes(data[:at] + bytes((value,)) + data[at + 1 :])
            read(path)


def test_a_damaged_chunk_is_left_and_the_next_one_read(bags, tmp_path):
    data = bytearray(bags["mcap"].read_bytes())
    data[len(data) // 3] ^= 1
    path = tmp_path / "flipped.mcap"
    path.write_bytes(data)
    scans, problem = read(path)
    assert "chunk has another checksum than it says" in problem
    assert 0 < len(scans) < N / 2
    log = open_log(path, keep_going=True)
    kept = [scan.stamp for scan in log]
    assert (kept[0], kept[-1], len(log), log.skipped) == (0.0, N - 1, N, 1)
    assert N / 2 < len(kept) < N


def test_a_cut_off_bag_has_the_length_of_what_is_whole(bags, tmp_path):
    for kind in ("rosbag1", "mcap-zstd", "mcap-plain"):
        path = tmp_path / bags[kind].name
        path.write_bytes(bags[kind].read_bytes()[: bags[kind].stat().st_size // 2])
        log = open_log(path, keep_going=True)
        assert 0 < len(log) == len(list(log)) < N
        assert log.skipped == 1


# --- indices that are wrong


def test_an_index_of_an_mcap_file_that_points_anywhere(bags, tmp_path):
    path = tmp_path / "log.mcap"
    data = bytearray(bags["mcap"].read_bytes())
    for start in (0, 1, 8, 100, len(data) // 2, len(data) - 10, len(data), 2**63, 2**64 - 1):
        struct.pack_into("<Q", data, len(data) - 8 - 20, start)
        path.write_bytes(data)
        log = open_log(path)
        assert len(log) == len(list(log)) == N


def test_an_index_of_a_ros_1_bag_that_points_anywhere(bags, tmp_path):
    path = tmp_path / "log.bag"
    data = bytearray(bags["rosbag1"].read_bytes())
    at = data.index(b"index_pos=") + len(b"index_pos=")
    for start in (0, 1, 13, 5000, len(data) // 2, len(data) - 10, len(data), 2**63, 2**64 - 1):
        struct.pack_into("<Q", data, at, start)
        path.write_bytes(data)
        log = open_log(path)
        assert len(log) == len(list(log)) == N


def test_a_ros_1_bag_that_was_not_closed(bags, tmp_path):
    """Its index is missing, its chunks are whole."""
    data = bytearray(bags["rosbag1"].read_bytes())
    at = data.index(b"index_pos=") + len(b"index_pos=")
    (end,) = struct.unpack_from("<Q", data, at)
    data[at : at + 8] = bytes(8)
    path = tmp_path / "log.bag.active"
    path.write_bytes(data[:end])
    scans, problem = read(path)
    assert len(scans) == len(open_log(path)) == N
    assert "ends without an index: it is cut off, or still recorded" in problem


def field(name, value):
    return struct.pack("<I", len(name) + 1 + len(value)) + name + b"=" + value


def record(header, data, length=None):
    size = len(data) if length is None else length
    return struct.pack("<I", len(header)) + header + struct.pack("<I", size) + data


def test_the_index_records_of_early_recorders(bags, tmp_path):
    """They have the length that those of the version before would have."""
    data = bags["rosbag1"].read_bytes()
    at, changed = 13, bytearray(data[:13])
    while at < len(data):
        sizes = struct.unpack_from("<I", data, at)[0]
        header = data[at + 4 : at + 4 + sizes]
        start = at + 8 + sizes
        size = struct.unpack_from("<I", data, start - 4)[0]
        is_index = b"op=\4" in header
        changed += record(header, data[start : start + size], size // 12 * 20 if is_index else None)
        at = start + size
    path = tmp_path / "early.bag"
    path.write_bytes(changed)
    assert changed != data
    assert read(path)[1] is None
    assert len(read(path)[0]) == N


# --- bombs


def chunk(codec, data, size):
    header = (
        field(b"op", b"\5") + field(b"compression", codec) + field(b"size", struct.pack("<I", size))
    )
    return record(header, data)


def rosbag1_bomb(path, codec, data, size):
    start = field(b"op", b"\3") + field(b"index_pos", bytes(8))
    path.write_bytes(b"#ROSBAG V2.0\n" + record(start, b"") + chunk(codec, data, size))


def mcap_bomb(path, codec, data, size):
    """A chunk that says how large it becomes, in a file without index."""
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=False)
        writer.start("ros2")
        name = struct.pack("<I", len(codec)) + codec
        body = struct.pack("<QQQI", 0, 0, size, 0) + name + struct.pack("<Q", len(data)) + data
        file.write(b"\6" + struct.pack("<Q", len(body)) + body)


def packed(codec, plain):
    import bz2

    import lz4.frame
    import zstandard

    pack = {"bz2": bz2.compress, "lz4": lz4.frame.compress, "zstd": zstandard.compress}
    return pack[codec](plain)


@pytest.mark.parametrize(
    ("write", "codec"),
    [(rosbag1_bomb, "bz2"), (rosbag1_bomb, "lz4"), (mcap_bomb, "lz4"), (mcap_bomb, "zstd")],
)
def test_bombs(tmp_path, monkeypatch, write, codec):
    monkeypatch.setattr(ros_bag, "MAX_PIECE", 1 << 20)
    path = tmp_path / "bomb"
    data = packed(codec, bytes(1 << 25))
    tracemalloc.start()
    try:
        for size, problem in (
            (1 << 31, "chunk of 2147483648 bytes, expected at most 1 MiB"),
            (1 << 19, "chunk holds other than 524288 bytes|Frame requires too much memory"),
        ):
            write(path, codec.encode(), data, size)
            assert re.search(problem, read(path)[1])
        assert tracemalloc.get_traced_memory()[1] < 1 << 23
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("write", [rosbag1_bomb, mcap_bomb])
def test_chunks_that_cannot_be_read(tmp_path, write):
    path = tmp_path / "bag"
    for codec, data, size, problem in (
        (b"lzma", b"", 0, "chunk compressed by lzma, expected none, bz2, lz4, zstd"),
        (b"lz4", b"nonsense", 100, "lz4 data is broken"),
        (b"zstd", b"nonsense", 100, "zstd data is broken"),
        (b"bz2", b"nonsense", 100, "bz2 data is broken"),
        (b"none", b"12345", 4, "chunk holds other than 4 bytes"),
    ):
        write(path, codec, data, size)
        assert problem in read(path)[1]


@pytest.mark.parametrize("kind", ["rosbag1", "mcap-plain"])
def test_a_record_that_says_it_is_huge(bags, tmp_path, kind, monkeypatch):
    """It is told before memory is taken for it."""
    monkeypatch.setattr(ros_bag, "MAX_PIECE", 100)
    path = tmp_path / bags[kind].name
    shutil.copy(bags[kind], path)
    assert "expected at most 0 MiB" in read(path)[1]


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"#ROSBAG V3.1\n", "begins with b'#ROSBAG V3.1.n', expected a bag: #ROSBAG V2.0"),
        (b"#ROSBAG V2.0\n", "ends without an index: it is cut off, or still recorded"),
        (b"#ROSBAG V", "begins with b'#ROSBAG V', expected a bag"),
        (b"#ROSBAG V2.0\n\4\0\0\0nono", "header of a record has a broken field"),
        (b"#ROSBAG V2.0\n\2\0\0\0no", "header of a record ends within the length of a field"),
        (b"#ROSBAG V2.0\n\0\0\0\0\0\0\0\0", "record without a right field op"),
        (b"\x89MCAP0\r\n", "ends without a footer: it is cut off, or still recorded"),
        (b"\x89MCAP0\r\n" + bytes(9), "record has the code 0"),
        (b"SQLite format 3\0", r"cannot be read as a ROS 2 bag \(sqlite3\)|has: none"),
    ],
)
def test_files_that_end_at_once(tmp_path, data, problem):
    path = tmp_path / "thing"
    path.write_bytes(data)
    with pytest.raises(LogError, match=problem):
        list(open_log(path))
