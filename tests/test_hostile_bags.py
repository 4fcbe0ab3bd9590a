"""Faults that damaged and hostile bags once brought to light, the smallest input of each."""

from __future__ import annotations

import math
import os
import shutil
import sqlite3
import struct

import numpy as np
import pytest
import ros_bags

from lineament import LogError
from lineament.logs import open_log

N = 30


def bag(folder, kind, items=None):
    messages = ros_bags.Messages(ros_bags.ros_of(kind))
    items = items or (("/scan", i, messages.scan(i, 1.0 + np.arange(40.0))) for i in range(N))
    return ros_bags.write_bag(folder / f"log{ros_bags.ending(kind)}", kind, items)


def test_statistics_that_are_wrong(tmp_path):
    path = bag(tmp_path, "mcap")
    data = bytearray(path.read_bytes())
    (start,) = struct.unpack_from("<Q", data, len(data) - 28)
    at = data.index(struct.pack("<Q", N), start)
    for told, each in ((2**63, 2**63), (2**64 - 1, 2**64 - 1), (N, 7), (7, N)):
        struct.pack_into("<Q", data, at, told)
        struct.pack_into("<Q", data, data.index(struct.pack("<IH", 10, 1), at) + 6, each)
        path.write_bytes(data)
        log = open_log(path)
        assert len(log) == len(list(log)) == N


def test_an_index_without_a_count(tmp_path):
    path = bag(tmp_path, "rosbag1")
    path.write_bytes(path.read_bytes().replace(b"\0count=", b"\0conut="))
    assert len(list(open_log(path))) == N


def test_a_cloud_of_signalling_nans(tmp_path):
    points = np.zeros((1, 4), [("x", "f4"), ("y", "f4"), ("ring", "f4")])
    points["x"], points["y"] = 1.0, np.arange(4)
    for name, i in (("x", 0), ("y", 1), ("ring", 2)):
        points[name].view("u4")[0, i] = 0x7F800001
    cloud = ros_bags.Messages(2).cloud(1.0, points)
    (scan,) = open_log(bag(tmp_path, "mcap", [("/cloud", 0, cloud)]), ring=0)
    assert scan.ranges.tolist() == [math.hypot(1, 3)]


def test_poses_without_measure(tmp_path):
    messages = ros_bags.Messages(2)
    items = [("/pose", i, messages.pose_stamped(i, x, 0, 0)) for i, x in ((0, -1e308), (2, 1e308))]
    items.insert(1, ("/scan", 1, messages.scan(1.0, [1.0, 2.0])))
    path = bag(tmp_path, "mcap", items)
    with pytest.raises(
        LogError, match=r"/pose message 0: pose is \(-1e\+308, 0.0, 0.0\), expected"
    ):
        list(open_log(path, pose_topic="/pose"))
    (scan,) = open_log(path, pose_topic="/pose", keep_going=True)
    assert scan.pose is None


def test_metadata_of_newer_recorders_name_each_part_twice(tmp_path):
    folder = bag(tmp_path, "sqlite3")
    (folder / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths:\n    - log.db3\n"
        "  files:\n    - path: log.db3\n      message_count: 30\n"
    )
    assert len(list(open_log(folder))) == N


@pytest.mark.parametrize(
    "text", ["\n" * 300_000, "- " + " " * 300_000 + "x", "- a.db3 " * 40_000 + "x"]
)
def test_metadata_of_blanks_take_no_time(tmp_path, text):
    """Where a search goes back over what it has seen, these take hours."""
    folder = bag(tmp_path, "sqlite3")
    (folder / "metadata.yaml").write_text(text)
    assert len(open_log(folder)) == N


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_among_the_parts_is_not_waited_for(tmp_path):
    folder = bag(tmp_path, "sqlite3")
    os.mkfifo(folder / "more.db3")
    with (folder / "metadata.yaml").open("a") as file:
        file.write("\n    - more.db3\n")
    with pytest.raises(LogError, match=r"has no more\.db3, which metadata\.yaml lists"):
        open_log(folder)


@pytest.fixture
def database(tmp_path):
    (path,) = bag(tmp_path, "sqlite3").glob("*.db3")
    return path


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (
            "ALTER TABLE messages RENAME COLUMN data TO x; ALTER TABLE messages ADD COLUMN "
            "data AS (zeroblob(250000000))",
            "column data of its table messages is computed",
        ),
        (
            "ALTER TABLE messages RENAME TO old; "
            "CREATE VIRTUAL TABLE messages USING fts4(topic_id, timestamp, data)",
            "expected the tables topics and messages",
        ),
    ],
)
def test_databases_that_compute(database, change, problem):
    with sqlite3.connect(database) as writer:
        writer.executescript(change)
    writer.close()
    with pytest.raises(LogError, match=problem):
        open_log(database)


def test_a_database_whose_damage_is_no_text(database):
    data = database.read_bytes()
    database.write_bytes(data.replace(b"CREATE TABLE messages", b"CREATE TABLE (\xdf ssages"))
    with pytest.raises(LogError, match=r"cannot be read as a ROS 2 bag \(sqlite3\)"):
        open_log(database)


def test_nothing_is_created_beside_a_database(database, tmp_path):
    """One that was copied from a recorder that still ran, or was killed."""
    writer = sqlite3.connect(database)
    writer.execute("PRAGMA journal_mode = WAL")
    writer.execute("DELETE FROM messages WHERE timestamp >= 20")
    writer.commit()
    folder = tmp_path / "copy"
    folder.mkdir()
    for path in (database, database.with_name(f"{database.name}-wal")):
        shutil.copy(path, folder)
    writer.close()
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    log = open_log(folder)
    assert len(log) == len(list(log)) == 20
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
