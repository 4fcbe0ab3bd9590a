"""Bags that are cut off, damaged, hostile, packed or growing: what is whole is read."""

import bz2
import gzip
import os
import random
import re
import sqlite3
import struct
import zipfile

import lz4.frame
import numpy as np
import pytest
import ros_bags
import zstandard
from crafted import field, mcap_record, record
from mcap.writer import Writer
from ros_bags import every_kind, ranges_of, read
from text_logs import at_most, zipped

from lineament import LogError
from lineament.limits import Limits
from lineament.logs import find_logs, open_log, ros_bag

N = 60
STAMPS = [float(i) for i in range(N)]


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    """A bag of scans of each kind, as a file: of a folder its database."""
    found = {}
    for kind in ros_bags.KINDS:
        make = ros_bags.Messages(ros_bags.ros_of(kind))
        items = (("/scan", i, make.scan(i, ranges_of(i))) for i in range(N))
        path = ros_bags.write(tmp_path_factory.mktemp("bags"), kind, items, kind)
        found[kind] = next(path.glob("*.db3")) if path.is_dir() else path
    return found


@pytest.fixture
def altered(bags, tmp_path):
    """Writes what a function makes of the bytes of a bag, under its name."""

    def alter(kind, change):
        path = tmp_path / bags[kind].name
        path.write_bytes(change(bytearray(bags[kind].read_bytes())))
        return path

    return alter


def stamps_of(scans):
    return [scan.stamp for scan in scans]


def is_whole(scan):
    return np.array_equal(scan.ranges, ranges_of(scan.stamp))


def changed(data, at, form, value):
    struct.pack_into(form, data, at, value)
    return data


# --- cut off, flipped, overwritten


@pytest.mark.parametrize("kind", ["mcap", "mcap-lz4", "mcap-zstd", "mcap-ros1"])
def test_a_scan_from_a_chunk_with_a_checksum_is_the_one_that_was_written(altered, kind):
    chance, harmed = random.Random(5), 0
    for _ in range(100):

        def damaged(data):
            words = 0, 1, 2, 2**31, 2**32 - 1, chance.randrange(2**32)
            return changed(data, chance.randrange(len(data) - 4), "<I", chance.choice(words))

        scans, problem = read(altered(kind, damaged), keep_going=True)
        assert all(map(is_whole, scans))
        harmed += problem is not None or len(scans) < N
    assert 10 < harmed < 100


def test_a_damaged_chunk_is_left_out_and_the_next_one_read(altered):
    def flipped(data):
        at = len(data) // 3
        return changed(data, at, "B", data[at] ^ 1)

    path = altered("mcap", flipped)
    scans, problem = read(path)
    assert "chunk has another checksum than it says" in problem
    assert 0 < len(scans) < N / 2
    log = open_log(path, keep_going=True)
    kept = stamps_of(log)
    assert (kept[0], kept[-1], len(log), log.skipped) == (0.0, N - 1, N, 1)
    assert N / 2 < len(kept) < N


def test_names_are_read_where_the_rest_of_a_description_is_broken(altered):
    """A definition of no sensible length, and letters of a topic that are none."""

    def overlong(data):
        return changed(data, data.index(b"ros2msg") + 7, "<I", 2**31)

    assert len(read(altered("mcap-bare", overlong))[0]) == N

    def renamed(data):
        at = data.index(b"\5\0\0\0/scan") + 4
        return changed(data, at, "5s", b"/s\xff\x07n")

    log = open_log(altered("mcap-bare", renamed))
    assert (log.topics, len(list(log))) == (["/s\ufffdn"], N)


# --- indices that are wrong


@pytest.mark.parametrize("kind", ["mcap", "rosbag1"])
@pytest.mark.parametrize("start", [0, 1, 8, 13, 100, 5000, 0.5, -10, -1, 2**63, 2**64 - 1])
def test_an_index_that_points_anywhere(altered, kind, start):
    def moved(data):
        at = len(data) - 28 if kind == "mcap" else data.index(b"index_pos=") + len(b"index_pos=")
        to = int(0.5 * len(data)) if start == 0.5 else start % len(data) if start < 0 else start
        return changed(data, at, "<Q", to)

    log = open_log(altered(kind, moved))
    assert len(log) == len(list(log)) == N


@pytest.mark.parametrize(
    ("count", "each"), [(2**63, 2**63), (2**64 - 1, 2**64 - 1), (N, 7), (7, N)]
)
def test_statistics_that_are_wrong(altered, count, each):
    def miscounted(data):
        (start,) = struct.unpack_from("<Q", data, len(data) - 28)
        at = data.index(struct.pack("<Q", N), start)
        data = changed(data, at, "<Q", count)
        return changed(data, data.index(struct.pack("<IH", 10, 1), at) + 6, "<Q", each)

    log = open_log(altered("mcap", miscounted))
    assert len(log) == len(list(log)) == N


def test_counts_come_from_the_index(altered, monkeypatch):
    """Nothing else is read: where that is forbidden the length is still known."""
    monkeypatch.setattr(ros_bag.RecordBag, "messages", None)
    for kind in ("mcap", "mcap-plain", "rosbag1", "rosbag1-lz4"):
        assert len(open_log(altered(kind, bytes))) == N
    with pytest.raises(TypeError):
        open_log(altered("mcap-bare", bytes))


def test_a_ros_1_bag_that_was_not_closed(altered):
    """Its index is missing, its chunks are whole."""

    def unclosed(data):
        at = data.index(b"index_pos=") + len(b"index_pos=")
        (end,) = struct.unpack_from("<Q", data, at)
        return changed(data, at, "<Q", 0)[:end]

    path = altered("rosbag1", unclosed)
    scans, problem = read(path)
    assert len(scans) == len(open_log(path)) == N
    assert "ends without an index: it is cut off, or still recorded" in problem


def test_the_index_records_of_early_recorders(altered):
    """They have the length that those of the version before would have, or lack their count."""

    def early(data):
        at, made = 13, data[:13]
        while at < len(data):
            start = at + 8 + struct.unpack_from("<I", data, at)[0]
            header = data[at + 4 : start - 4]
            (size,) = struct.unpack_from("<I", data, start - 4)
            is_index = b"op=\4" in header
            piece = data[start : start + size]
            made += record(header, piece, size // 12 * 20 if is_index else None)
            at = start + size
        assert made != data
        return made

    assert stamps_of(open_log(altered("rosbag1", early))) == STAMPS
    uncounted = altered("rosbag1", lambda data: data.replace(b"\0count=", b"\0conut="))
    assert stamps_of(open_log(uncounted)) == STAMPS


# --- bombs


def rosbag1_bomb(path, codec, data, size):
    start = field(b"op", b"\3") + field(b"index_pos", bytes(8))
    header = field(b"op", b"\5") + field(b"compression", codec)
    chunk = record(header + field(b"size", struct.pack("<I", size)), data)
    path.write_bytes(b"#ROSBAG V2.0\n" + record(start, b"") + chunk)


def mcap_bomb(path, codec, data, size, shorter=0):
    """A chunk that says how large it becomes, in a file without index."""
    with path.open("wb") as file:
        Writer(file, use_chunking=False).start("ros2")
        name = struct.pack("<I", len(codec)) + codec
        body = struct.pack("<QQQI", 0, 0, size, 0) + name + struct.pack("<Q", len(data) - shorter)
        file.write(mcap_record(6, body + data))


PACK = {b"bz2": bz2.compress, b"lz4": lz4.frame.compress, b"zstd": zstandard.compress}


@pytest.mark.parametrize(
    ("bomb", "codec"),
    [(rosbag1_bomb, b"bz2"), (rosbag1_bomb, b"lz4"), (mcap_bomb, b"lz4"), (mcap_bomb, b"zstd")],
)
def test_bombs(tmp_path, bomb, codec):
    limits = {"piece": 1 << 20, "ratio": 1 << 40}
    path, data = tmp_path / "bomb", PACK[codec](bytes(1 << 25))
    with at_most(8):
        for size, problem in (
            (1 << 31, "has 2147483648 bytes in a record, chunk or message, more than"),
            (1 << 19, "chunk holds other than 524288 bytes|Frame requires too much memory"),
        ):
            bomb(path, codec, data, size)
            assert re.search(problem, read(path, limits=limits)[1])


@pytest.mark.parametrize("bomb", [rosbag1_bomb, mcap_bomb])
def test_chunks_that_cannot_be_read(tmp_path, bomb):
    for codec, data, size, problem in (
        (b"lzma", b"", 0, "chunk compressed by lzma, expected none, bz2, lz4, zstd"),
        *((codec, b"nonsense", 100, f"{codec.decode()} data is broken") for codec in PACK),
        (b"none", b"12345", 4, "chunk holds other than 4 bytes"),
        (b"none", b"1234", 4, "chunk has a record|reaches past|unpack"),
    ):
        bomb(tmp_path / "bag", codec, data, size)
        assert re.search(problem, read(tmp_path / "bag")[1])


def test_a_chunk_that_is_shorter_than_its_record(tmp_path):
    mcap_bomb(tmp_path / "bag", b"none", b"12345", 5, shorter=1)
    assert "chunk of 4 bytes in a record with 5 left for it" in read(tmp_path / "bag")[1]


@pytest.mark.parametrize("kind", ["rosbag1", "mcap-plain"])
def test_the_largest_record(bags, kind, monkeypatch):
    """A larger one is refused before memory is taken for it."""
    limits = {"piece": 100}
    assert "limit of 100 (raise it by --limit piece=N" in read(bags[kind], limits=limits)[1]
    assert ros_bag.decompress("", bytes(100), 100) == bytes(100)
    reader = ros_bag.RecordReader
    monkeypatch.setattr(reader, "__abstractmethods__", frozenset())
    with reader(bags[kind], None, Limits.of(limits)) as source:
        assert len(source.take(100, "piece")) == source.at == 100
        with pytest.raises(LogError, match=r"byte 100: has 101 bytes in a record"):
            source.take(101, "piece")
        source.skip(source.left, "rest")
        with pytest.raises(LogError, match=r"is cut off: end has 1 bytes, 0 are left"):
            source.skip(1, "end")


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"#ROSBAG V3.1\n", "begins with b'#ROSBAG V3.1.n', expected a bag: #ROSBAG V2.0"),
        (b"#ROSBAG V2.0\n", "ends without an index: it is cut off, or still recorded"),
        (b"#ROSBAG V", "begins with b'#ROSBAG V', expected a bag"),
        (b"#ROSBAG V2.0\n\4\0\0\0nono", "header of a record has a broken field"),
        (b"#ROSBAG V2.0\n\6\0\0\0\3\0\0\0a=", "header of a record has a broken field"),
        (b"#ROSBAG V2.0\n\2\0\0\0no", "header of a record ends within the length of a field"),
        (b"#ROSBAG V2.0\n\0\0\0\0\0\0\0\0", "record without a right field op"),
        (b"\x89MCAP0\r\n", "ends without a footer: it is cut off, or still recorded"),
        (b"\x89MCAP0\r\n" + bytes(9), "record has the code 0"),
        (b"SQLite format 3\0", r"cannot be read as a ROS 2 bag \(sqlite3: |has: none"),
    ],
)
def test_files_that_end_at_once(tmp_path, data, problem):
    path = tmp_path / "thing"
    path.write_bytes(data)
    assert re.search(problem, read(path)[1])


# --- packed


@every_kind
@pytest.mark.usefixtures("temporary")
def test_whole_bags_in_archives(bags, tmp_path, kind):
    data = bags[kind].read_bytes()
    inside = f"day/{bags[kind].name}"
    (tmp_path / "a.gz").write_bytes(gzip.compress(data))
    (tmp_path / "a.zip").write_bytes(zipped(**{inside: data, "readme.txt": b"hello"}))
    (tmp_path / "b.zip").write_bytes(zipped(**{f"{inside}.gz": gzip.compress(data)}))
    for name in ("a.gz", "a.zip", "b.zip"):
        scans, problem = read(tmp_path / name)
        assert (stamps_of(scans), problem) == (STAMPS, None)
    assert open_log(tmp_path / "a.zip").name == f"{tmp_path / 'a.zip'}/{inside}"
    # What a cut gzip file held before the cut is read only where that is asked for.
    packed, most = gzip.compress(data), 0
    for share in np.linspace(0.01, 0.9999, 20):
        (tmp_path / "a.gz").write_bytes(packed[: int(share * len(packed))])
        scans, problem = read(tmp_path / "a.gz")
        assert problem
        assert not scans
        kept, _ = read(tmp_path / "a.gz", keep_going=True)
        assert stamps_of(kept) == STAMPS[: len(kept)]
        most = max(most, len(kept))
    assert most > 0.5 * N


def test_a_recorded_bag_in_a_zip(data_dir, tmp_path):
    """A folder with its metadata, and with what sqlite keeps beside a database."""
    folder = data_dir / "rosbag2" / "ld19"
    with zipfile.ZipFile(tmp_path / "ld19.zip", "w") as archive:
        for path in folder.iterdir():
            archive.write(path, f"ld19/{path.name}")
    assert find_logs(tmp_path) == [str(tmp_path / "ld19.zip")]
    log, plain = open_log(tmp_path / "ld19.zip"), open_log(folder)
    assert len(log) == len(plain) == 436
    for scan, other in zip(log, plain, strict=True):
        assert scan.stamp == other.stamp
        np.testing.assert_array_equal(scan.ranges, other.ranges)


# --- growing


@pytest.mark.parametrize("kind", ["rosbag1", "mcap", "mcap-plain", "mcap-zstd"])
def test_a_cut_off_bag_that_grows_while_it_is_read(bags, altered, kind):
    """Its length is that of what is whole; what is appended is left, else this would not end."""
    whole = bags[kind].read_bytes()
    path = altered(kind, lambda data: data[: len(data) // 2])
    log = open_log(path, keep_going=True)
    expected, stamps = len(log), []
    assert 0 < expected < N
    for scan in log:
        with path.open("ab") as file:
            file.write(whole[len(whole) // 4 : len(whole) // 2])
        stamps.append(scan.stamp)
    assert stamps == STAMPS[:expected]
    assert log.skipped == 1


def test_a_database_that_becomes_shorter_within_a_page(altered):
    """Sqlite would go on, and read what is missing as zeros."""
    path = altered("sqlite3", bytes)
    scans = iter(open_log(path))
    assert next(scans).stamp == 0.0
    os.truncate(path, path.stat().st_size - 1)
    with pytest.raises(LogError, match=r"\.db3: has become shorter while it was read"):
        list(scans)


@pytest.mark.parametrize("journal", ["WAL", "MEMORY"])
def test_a_database_that_grows_while_it_is_read(altered, journal):
    """In both ways in which recorders write."""
    path = altered("sqlite3", bytes)
    recorder = sqlite3.connect(path)
    recorder.execute(f"PRAGMA journal_mode = {journal}")
    recorder.execute("UPDATE topics SET type = type")
    recorder.commit()
    add = (
        "INSERT INTO messages (topic_id, timestamp, data) SELECT topic_id, timestamp + 1000, data "
        "FROM messages LIMIT 2"
    )
    log, stamps, problem = open_log(path), [], "sqlite3"
    try:
        for scan in log:
            recorder.execute(add)
            recorder.commit()
            stamps.append(scan.stamp)
            assert len(stamps) < 4 * N
    except LogError as error:
        problem = error.problem
    recorder.close()
    assert "sqlite3" in problem
    assert stamps[:N] == STAMPS[: len(stamps)]
    assert len(list(open_log(path))) > N
    assert not path.with_name(f"{path.name}-wal").exists()
