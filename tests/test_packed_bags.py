"""Bags in gzip and zip, whole and cut off, and bags that grow while they are read."""

from __future__ import annotations

import gzip
import sqlite3
import zipfile
from pathlib import Path

import numpy as np
import pytest
import ros_bags
from text_logs import zipped

from lineament import LogError
from lineament.logs import find_logs, open_log

N = 40
every_kind = pytest.mark.parametrize("kind", ros_bags.KINDS)


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    """A whole bag of each kind, as a file: of a folder its database."""
    folder = tmp_path_factory.mktemp("bags")
    found = {}
    for kind in ros_bags.KINDS:
        messages = ros_bags.Messages(ros_bags.ros_of(kind))
        items = [("/scan", i, messages.scan(i, 1.0 + i + 0.01 * np.arange(40))) for i in range(N)]
        path = ros_bags.write_bag(folder / f"{kind}{ros_bags.ending(kind)}", kind, items)
        found[kind] = next(path.glob("*.db3")) if path.is_dir() else path
    return found


def read(path, **options):
    """Read scans up to the first error: their stamps, and its text."""
    stamps = []
    try:
        stamps.extend(scan.stamp for scan in open_log(path, **options))
    except LogError as error:
        assert str(error).startswith(str(path))  # noqa: PT017
        assert str(error).isprintable()  # noqa: PT017
        return stamps, error.problem
    return stamps, None


@every_kind
def test_whole_bags(bags, tmp_path, temporary, kind):
    data = bags[kind].read_bytes()
    inside = f"day/{bags[kind].name}"
    (tmp_path / "a.gz").write_bytes(gzip.compress(data))
    (tmp_path / "a.zip").write_bytes(zipped(**{inside: data, "readme.txt": b"hello"}))
    packed_twice = zipped(**{f"{inside}.gz": gzip.compress(data)})
    (tmp_path / "b.zip").write_bytes(packed_twice)
    for name in ("a.gz", "a.zip", "b.zip"):
        assert read(tmp_path / name) == ([float(i) for i in range(N)], None)
    assert open_log(tmp_path / "a.zip").name == f"{tmp_path / 'a.zip'}/{inside}"
    assert list(temporary.iterdir()) == []


@every_kind
def test_gzip_that_is_cut_off(bags, tmp_path, temporary, kind):
    """What was unpacked before the cut is read, and only where that is asked for."""
    data = gzip.compress(bags[kind].read_bytes())
    path = tmp_path / "cut.gz"
    most = 0
    for cut in np.linspace(20, len(data) - 1, 25).astype(int):
        path.write_bytes(data[:cut])
        stamps, problem = read(path)
        assert stamps == []
        assert problem
        stamps, problem = read(path, keep_going=True)
        assert stamps == list(range(len(stamps)))
        assert problem is None or not stamps
        most = max(most, len(stamps))
    assert most > 0.5 * N
    assert list(temporary.iterdir()) == []


@every_kind
def test_a_cut_off_bag_in_a_zip(bags, tmp_path, temporary, kind):
    data = bags[kind].read_bytes()
    path = tmp_path / "a.zip"
    for cut in np.linspace(20, len(data) - 1, 15).astype(int):
        path.write_bytes(zipped(bag=data[:cut]))
        stamps, problem = read(path)
        assert stamps == list(range(len(stamps)))
        assert problem or len(stamps) == N
        kept, _ = read(path, keep_going=True)
        assert len(kept) >= len(stamps)
    assert list(temporary.iterdir()) == []


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


@pytest.mark.parametrize("kind", ["rosbag1", "mcap", "mcap-plain"])
def test_a_bag_that_grows_while_it_is_read(bags, tmp_path, kind):
    """What is appended is left for the next time; else this would not end."""
    path = tmp_path / bags[kind].name
    whole = bags[kind].read_bytes()
    more = whole[len(whole) // 4 : len(whole) // 2]
    path.write_bytes(whole[: len(whole) // 2])
    log = open_log(path, keep_going=True)
    expected = len(log)
    stamps = []
    for scan in log:
        with path.open("ab") as file:
            file.write(more)
        stamps.append(scan.stamp)
    assert stamps == list(range(expected))
    assert log.skipped == 1


@pytest.mark.parametrize("journal", ["WAL", "MEMORY"])
def test_a_database_that_grows_while_it_is_read(bags, tmp_path, journal):
    """In both ways in which recorders write."""
    path = tmp_path / "growing.db3"
    path.write_bytes(bags["sqlite3"].read_bytes())
    recorder = sqlite3.connect(path)
    recorder.execute(f"PRAGMA journal_mode = {journal}")
    recorder.execute("UPDATE topics SET type = type")
    recorder.commit()
    add = (
        "INSERT INTO messages (topic_id, timestamp, data) SELECT topic_id, timestamp + 1000, data "
        "FROM messages LIMIT 2"
    )
    log = open_log(path)
    stamps = []
    try:
        for scan in log:
            recorder.execute(add)
            recorder.commit()
            stamps.append(scan.stamp)
            assert len(stamps) < 4 * N
    except LogError as error:
        assert "cannot be read as a ROS 2 bag (sqlite3)" in error.problem  # noqa: PT017
    finally:
        recorder.close()
    assert stamps[:N] == list(range(len(stamps[:N])))
    assert len(list(open_log(path))) > N
    assert Path(f"{path}-wal").exists() is False
