"""Bags of every kind: what is in them comes back; topics, faults, indices."""

from __future__ import annotations

import math
import shutil
import sqlite3

import numpy as np
import pytest
import ros_bags

from lineament import LogError
from lineament.logs import open_log
from lineament.logs.base import Head
from lineament.logs.rosbag2 import Rosbag2Log

every_kind = pytest.mark.parametrize("kind", ros_bags.KINDS)
FORMATS = {"rosbag1": "rosbag1", "sqlite3": "rosbag2", "mcap": "mcap"}


def write(folder, kind, items, name="log"):
    return ros_bags.write_bag(folder / f"{name}{ros_bags.ending(kind)}", kind, items)


def ranges_of(i):
    return (1.0 + i + 0.01 * np.arange(40)).astype(np.float32)


def two_scanners(kind, n=30):
    """Scans of two topics in turn, another topic between them."""
    messages = ros_bags.Messages(ros_bags.ros_of(kind))
    for i in range(n):
        topic = ("/front", "/rear")[i % 2]
        yield topic, 1000 * i, messages.scan(i / 4, ranges_of(i), frame=topic[1:])
        if i % 10 == 0:
            yield "/odom", 1000 * i + 1, messages.odometry(i / 4, 0.0, 0.0, 0.0)


@every_kind
def test_what_is_written_comes_back(tmp_path, kind):
    path = write(tmp_path, kind, two_scanners(kind))
    log = open_log(path)
    assert log.format == FORMATS[kind.partition("-")[0]]
    assert (log.topics, len(log)) == (["/front", "/rear"], 30)
    contents = [(topic.name, topic.type, topic.count) for topic in log.contents()]
    assert contents == [
        ("/front", "sensor_msgs/LaserScan", 15),
        ("/odom", "nav_msgs/Odometry", 3),
        ("/rear", "sensor_msgs/LaserScan", 15),
    ]
    items = list(log.items())
    assert [topic for topic, _ in items] == ["/front", "/rear"] * 15
    for i, (topic, scan) in enumerate(items):
        assert (scan.stamp, scan.frame_id) == (i / 4, topic[1:])
        np.testing.assert_array_equal(scan.ranges, ranges_of(i))
    rear = open_log(path, "/rear")
    assert len(rear) == 15
    assert [scan.stamp for scan in rear] == [i / 4 for i in range(1, 30, 2)]
    assert rear.scan(2).stamp == 1.25


@every_kind
def test_no_scans(tmp_path, kind):
    items = [item for item in two_scanners(kind, 3) if item[0] == "/odom"]
    path = write(tmp_path, kind, items)
    listing = r"topics there are: /odom \(nav_msgs/Odometry, 1\)$"
    with pytest.raises(LogError, match=f"has no LaserScan or MultiEchoLaserScan; {listing}"):
        open_log(path)
    with pytest.raises(LogError, match=f"on '/odom'; {listing}"):
        open_log(path, "/odom")


@every_kind
def test_faulty_messages_are_told_by_number(tmp_path, kind):
    messages = ros_bags.Messages(ros_bags.ros_of(kind))
    items = [("/scan", i, messages.scan(i, [1.0, 2.0])) for i in range(4)]
    items[1] = ("/scan", 1, messages.scan(1.0, []))
    items[3] = ("/scan", 3, ("sensor_msgs/msg/LaserScan", b"\0\1\0\0nonsense"))
    path = write(tmp_path, kind, items)
    read = []
    with pytest.raises(LogError, match="/scan message 1: ranges is empty"):
        read.extend(open_log(path))
    assert [scan.stamp for scan in read] == [0.0]
    log = open_log(path, keep_going=True)
    assert [scan.stamp for scan in log] == [0.0, 2.0]
    assert (len(log), log.skipped) == (4, 2)
    assert "/scan message 3: ends early" in log.faults[1]


def test_echo_and_ring_are_chosen(tmp_path):
    messages = ros_bags.Messages(2)
    points = np.zeros((2, 2), dtype=[("x", "f4"), ("y", "f4")])
    points["x"], points["y"] = [[1.0, 1.0], [2.0, 2.0]], [[0.0, 1.0], [0.0, 1.0]]
    items = [
        ("/echoes", 0, messages.echoes(1.0, [[1.0, 2.0], [3.0]])),
        ("/points", 1, messages.cloud(2.0, points)),
    ]
    path = write(tmp_path, "mcap", items)
    assert [scan.ranges.tolist() for scan in open_log(path)] == [[1.0, 3.0]]
    assert open_log(path, echo="last").scan(0).ranges.tolist() == [2.0, 3.0]
    with pytest.raises(LogError, match=r"on '/points'; .*; choose a ring to read a PointCloud2"):
        open_log(path, "/points")
    log = open_log(path, ring=1)
    assert (log.topics, len(log)) == (["/echoes", "/points"], 2)
    assert log.scan(1).ranges.tolist() == [2.0, math.sqrt(5.0)]


def test_two_publishers_of_a_ros_1_topic(tmp_path):
    """Each has a connection, of which the bag tells the node; the topic is one."""
    from rosbags import rosbag1

    messages, path = ros_bags.Messages(1), tmp_path / "log.bag"
    with rosbag1.Writer(path) as writer:
        for i, node in enumerate(("/left", "/right")):
            message = messages.scan(float(i), [1.0, 2.0])
            connection = writer.add_connection(
                "/scan", message.__msgtype__, typestore=ros_bags.store(1), callerid=node
            )
            writer.write(connection, i, ros_bags.serialized(message, 1))
    log = open_log(path)
    assert [scan.stamp for scan in log] == [0.0, 1.0]
    (topic,) = log.contents()
    assert (topic.count, topic.publishers) == (2, 2)


def test_a_topic_of_two_types(tmp_path):
    """Only the messages that are scans are read."""
    messages = ros_bags.Messages(2)
    first = write(tmp_path, "mcap", [("/scan", 0, messages.scan(1.0, [1.0]))], "a_0")
    second = write(tmp_path, "mcap", [("/scan", 0, messages.odometry(1.0, 0.0, 0.0, 0.0))], "a_1")
    folder = tmp_path / "bag"
    folder.mkdir()
    for part in (first, second):
        part.rename(folder / part.name)
    (folder / "metadata.yaml").write_text("")
    log = open_log(folder)
    assert (len(log), len(list(log))) == (1, 1)


# --- order


@pytest.mark.parametrize("kind", ["rosbag1", "mcap", "sqlite3"])
def test_order(tmp_path, kind):
    """That of the file, or of the times of receipt in a database; stamps run as they like."""
    messages = ros_bags.Messages(ros_bags.ros_of(kind))
    times = [3, 1, 2, 2]
    items = [("/scan", time, messages.scan(10.0 * i, [1.0])) for i, time in enumerate(times)]
    path = write(tmp_path, kind, items)
    expected = [10.0, 20.0, 30.0, 0.0] if kind == "sqlite3" else [0.0, 10.0, 20.0, 30.0]
    assert [scan.stamp for scan in open_log(path)] == expected


# --- folders of ROS 2


def split_bag(tmp_path, kind="sqlite3"):
    """A folder with three parts, numbered in their order."""
    folder = tmp_path / "split"
    folder.mkdir()
    items = list(two_scanners(kind))
    ending = {"sqlite3": ".db3", "mcap": ".mcap"}[kind]
    for i, number in enumerate((0, 9, 10)):
        part = write(tmp_path, kind, items[11 * i : 11 * (i + 1)], f"part{i}")
        (data,) = part.glob("*.db3") if part.is_dir() else (part,)
        shutil.move(data, folder / f"split_{number}{ending}")
    return folder


def metadata(folder, names):
    lines = "".join(f"    - {name}\n" for name in names)
    text = f"rosbag2_bagfile_information:\n  version: 4\n  relative_file_paths:\n{lines}"
    (folder / "metadata.yaml").write_text(text)


@pytest.mark.parametrize("kind", ["sqlite3", "mcap"])
def test_parts_in_the_order_of_the_metadata_or_of_their_numbers(tmp_path, kind):
    folder = split_bag(tmp_path, kind)
    stamps = [i / 4 for i in range(30)]
    ending = ".db3" if kind == "sqlite3" else ".mcap"
    if kind == "sqlite3":
        assert [scan.stamp for scan in open_log(folder)] == stamps
    names = [f"split/split_{number}{ending}" for number in (10, 0, 9)]
    metadata(folder, names)
    # In its beginning, metadata named parts with their folder.
    assert [scan.stamp for scan in open_log(folder)] == stamps[20:] + stamps[:20]
    (folder / "metadata.yaml").write_text("nonsense: [")
    log = open_log(folder)
    assert [scan.stamp for scan in log] == stamps
    assert (len(log), log.format) == (30, "rosbag2")


def test_parts_that_are_missing_or_compressed(tmp_path):
    folder = split_bag(tmp_path)
    metadata(folder, ["split_0.db3", "split_1.db3", "../outside_9.db3", "split_9.db3"])
    with pytest.raises(LogError, match=r"has no split_1.db3, which metadata\.yaml lists"):
        open_log(folder)
    log = open_log(folder, keep_going=True)
    assert (len(list(log)), log.skipped) == (20, 2)
    assert "has no outside_9.db3" in log.faults[1]
    metadata(folder, ["split_0.db3.zstd"])
    (folder / "split_0.db3.zstd").touch()
    with pytest.raises(LogError, match="decompress it first"):
        open_log(folder)


def test_a_folder_with_other_files_is_no_bag_without_metadata(tmp_path):
    folder = split_bag(tmp_path)
    (folder / "notes.txt").write_text("what is this?")
    assert not Rosbag2Log.recognises(Head(folder, b"", is_directory=True))
    metadata(folder, [])
    assert Rosbag2Log.recognises(Head(folder, b"", is_directory=True))


def test_a_folder_with_metadata_alone(tmp_path):
    metadata(tmp_path, [])
    with pytest.raises(LogError, match=r"holds no part of a ROS 2 bag, expected \.db3 or \.mcap"):
        open_log(tmp_path)


# --- databases


@pytest.fixture
def database(tmp_path):
    folder = write(tmp_path, "sqlite3", two_scanners("sqlite3"))
    (path,) = folder.glob("*.db3")
    return path


def test_a_database_alone_is_read_and_left_as_it_is(database):
    before = database.read_bytes(), sorted(database.parent.iterdir())
    assert len(list(open_log(database))) == 30
    assert (database.read_bytes(), sorted(database.parent.iterdir())) == before


def test_what_a_stopped_recorder_left_beside_a_database(database):
    writer = sqlite3.connect(database)
    writer.execute("PRAGMA journal_mode = WAL")
    writer.execute("DELETE FROM messages WHERE timestamp > 5000")
    writer.commit()
    assert len(list(open_log(database))) == 6
    writer.close()


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ("DROP TABLE messages", "expected the tables topics and messages; it has: .*topics"),
        ("ALTER TABLE messages RENAME COLUMN data TO x", "no such column: data"),
        (
            "DROP TABLE messages; CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION "
            "ALL SELECT id FROM n) SELECT id, 1 AS topic_id, 2 AS timestamp, x'00' AS data FROM n",
            "expected the tables topics and messages",
        ),
        ("UPDATE messages SET data = 'text' WHERE id = 1", "/front: message is 'text', expected"),
        ("UPDATE messages SET data = x'28b52ffd00'", "/front: zstd data is broken"),
        ("UPDATE topics SET serialization_format = 'json'", "encoding is 'json', expected ros1"),
        ("DELETE FROM topics", "topics there are: none"),
    ],
)
def test_databases_that_are_strange(database, change, problem):
    with sqlite3.connect(database) as writer:
        writer.executescript(change)
    writer.close()
    with pytest.raises(LogError, match=problem):
        list(open_log(database))


def test_a_database_without_an_index_of_time(database):
    with sqlite3.connect(database) as writer:
        writer.execute("DROP INDEX timestamp_idx")
    writer.close()
    assert [scan.stamp for scan in open_log(database)] == [i / 4 for i in range(30)]
