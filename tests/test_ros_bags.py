"""Bags of every kind: what is in them comes back; topics, order, folders, databases, recordings."""

import math
import os
import shutil
import sqlite3

import numpy as np
import pytest
import ros_bags
from mcap.writer import Writer
from ros_bags import every_kind, ranges_of, write
from text_logs import check_refused

from lineament import LogError
from lineament.cli import run
from lineament.logs import open_log
from lineament.logs.base import Head
from lineament.logs.rosbag2 import Rosbag2Log
from lineament.mapping import LineMap

FORMATS = {"rosbag1": "rosbag1", "sqlite3": "rosbag2", "mcap": "mcap"}
STAMPS = [i / 4 for i in range(30)]


def two_scanners(kind, n=30):
    """Scans of two topics in turn, another topic between them."""
    messages = ros_bags.Messages(ros_bags.ros_of(kind))
    for i in range(n):
        topic = ("/front", "/rear")[i % 2]
        yield topic, 1000 * i, messages.scan(i / 4, ranges_of(i), frame=topic[1:])
        if i % 10 == 0:
            yield "/odom", 1000 * i + 1, messages.odometry(i / 4, 0.0, 0.0, 0.0)


def stamps_of(log):
    return [scan.stamp for scan in log]


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
    for i, (topic, scan) in enumerate(log.items()):
        assert (topic, scan.stamp, scan.frame_id) == (("/front", "/rear")[i % 2], i / 4, topic[1:])
        np.testing.assert_array_equal(scan.ranges, ranges_of(i))
    assert i == 29
    rear = open_log(path, "/rear")
    assert (len(rear), stamps_of(rear)) == (15, STAMPS[1::2])
    assert rear.scan(2).stamp == 1.25


COMMANDS = pytest.mark.parametrize(
    "command", ["map LOG -o m.svg", "locate LOG --map P.dxf -o a.csv", "calibrate LOG"]
)


@COMMANDS
def test_what_follows_a_scanner_refuses_the_scans_of_two(tmp_path, monkeypatch, refused, command):
    path = write(tmp_path, "mcap", two_scanners("mcap"))
    monkeypatch.chdir(tmp_path)
    LineMap.from_lines(np.array([(0.0, 0.0, 5.0, 0.0)])).write("P.dxf")
    said = refused(command.replace("LOG", path.name))
    assert "has scans of /front, /rear, expected those of one: choose it" in said


@COMMANDS
@pytest.mark.parametrize("frames", ["front rear", "front  front", "front front rear"])
def test_what_follows_a_scanner_refuses_two_on_one_topic(
    tmp_path, monkeypatch, capsys, command, frames
):
    # A scanner without a name in some scans, or renamed once, is one.
    names = frames.split(" ")
    messages = ros_bags.Messages(2)
    scans = [
        ("/scan", 1000 * i, messages.scan(i / 4, ranges_of(i), frame=names[i % len(names)]))
        for i in range(3)
    ]
    path = write(tmp_path, "mcap", scans)
    monkeypatch.chdir(tmp_path)
    LineMap.from_lines(np.array([(0.0, 0.0, 5.0, 0.0)])).write("P.dxf")
    run(command.replace("LOG", path.name).split())
    line = "has scans of frames front and rear by turns on /scan, expected those of one scanner"
    assert (line in capsys.readouterr().err) == (frames == "front rear")


@every_kind
def test_no_scans(tmp_path, kind):
    items = [item for item in two_scanners(kind, 3) if item[0] == "/odom"]
    path = write(tmp_path, kind, items)
    listing = r"topics there are: /odom \(nav_msgs/Odometry, 1\)$"
    check_refused(f"has no LaserScan or MultiEchoLaserScan; {listing}", path)
    check_refused(f"on '/odom'; {listing}", path, "/odom")


def test_a_picture_names_the_topic_where_a_log_has_several(tmp_path, capsys):
    path = write(tmp_path, "mcap", two_scanners("mcap", 3))
    for given, topic in (["--scan", "1"], "/rear"), (["--topic", "/front"], "/front"):
        assert run(["plot", str(path), *given, "-o", str(tmp_path / "a.png")]) == 0
        assert f" · {topic}" in capsys.readouterr().out


@pytest.mark.parametrize("kind", ["mcap", "mcap-bare", "sqlite3", "rosbag1"])
def test_a_bag_of_nothing(tmp_path, kind):
    _, problem = ros_bags.read(write(tmp_path, kind, []))
    assert problem.endswith("topics there are: none")


def test_an_error_lists_twenty_topics(tmp_path):
    odometry = ros_bags.Messages(2).odometry(1.0, 0.0, 0.0, 0.0)
    path = write(tmp_path, "mcap", [(f"/odom{i:02}", i, odometry) for i in range(21)])
    check_refused(r"/odom19 \(nav_msgs/Odometry, 1\), 1 more$", path)


@every_kind
def test_faulty_messages_are_reported_by_number(tmp_path, kind):
    messages = ros_bags.Messages(ros_bags.ros_of(kind))
    items = [("/scan", i, messages.scan(i, [1.0, 2.0])) for i in range(4)]
    items[1] = ("/scan", 1, messages.scan(1.0, []))
    items[3] = ("/scan", 3, ("sensor_msgs/msg/LaserScan", b"\0\1\0\0nonsense"))
    path = write(tmp_path, kind, items)
    scans, problem = ros_bags.read(path)
    assert problem.endswith("/scan message 1: ranges is empty, expected at least one beam")
    assert stamps_of(scans) == [0.0]
    log = open_log(path, keep_going=True)
    assert stamps_of(log) == [0.0, 2.0]
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
    check_refused(r"on '/points'; .*; choose a ring to read a PointCloud2", path, "/points")
    log = open_log(path, ring=1)
    assert (log.topics, len(log)) == (["/echoes", "/points"], 2)
    assert log.scan(1).ranges.tolist() == [2.0, math.sqrt(5.0)]


def test_two_publishers_of_a_ros_1_topic(tmp_path):
    """Each has a connection, with the name of its node; the topic is one."""
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
    assert stamps_of(log) == [0.0, 1.0]
    (topic,) = log.contents()
    assert (topic.count, topic.publishers) == (2, 2)


def test_a_channel_without_a_schema(tmp_path):
    path = tmp_path / "log.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.add_message(writer.register_channel("/notes", "json", 0), 0, b"{}", 0)
        schema = writer.register_schema("sensor_msgs/msg/LaserScan", "ros2msg", b"")
        channel = writer.register_channel("/scan", "cdr", schema)
        scan = ros_bags.serialized(ros_bags.Messages(2).scan(1.0, [1.0]), 2)
        writer.add_message(channel, 0, scan, 0)
        writer.finish()
    log = open_log(path)
    assert [topic.type for topic in log.contents()] == ["", "sensor_msgs/LaserScan"]
    assert stamps_of(log) == [1.0]


def test_a_topic_of_two_types(tmp_path):
    """Only the messages that are scans are read."""
    messages, folder = ros_bags.Messages(2), tmp_path / "bag"
    folder.mkdir()
    write(folder, "mcap", [("/scan", 0, messages.scan(1.0, [1.0]))], "a_0")
    write(folder, "mcap", [("/scan", 0, messages.odometry(1.0, 0.0, 0.0, 0.0))], "a_1")
    (folder / "metadata.yaml").write_text("")
    log = open_log(folder)
    assert (len(log), len(list(log))) == (1, 1)


@pytest.mark.parametrize("kind", ["rosbag1", "mcap", "sqlite3"])
def test_order(tmp_path, kind):
    """That of the file, or of the times of receipt in a database, whatever the stamps are."""
    messages = ros_bags.Messages(ros_bags.ros_of(kind))
    items = [("/scan", t, messages.scan(10.0 * i, [1.0])) for i, t in enumerate([3, 1, 2, 2])]
    expected = [10.0, 20.0, 30.0, 0.0] if kind == "sqlite3" else [0.0, 10.0, 20.0, 30.0]
    assert stamps_of(open_log(write(tmp_path, kind, items))) == expected


# --- folders of ROS 2


def split_bag(tmp_path, kind="sqlite3"):
    """A folder with three parts, numbered in their order."""
    folder = tmp_path / "split"
    folder.mkdir()
    items = list(two_scanners(kind))
    for i, number in enumerate((0, 9, 10)):
        part = write(tmp_path, kind, items[11 * i : 11 * (i + 1)], f"part{i}")
        (data,) = part.glob("*.db3") if part.is_dir() else (part,)
        shutil.move(data, folder / f"split_{number}{data.suffix}")
    return folder


def metadata(folder, *names, more=""):
    lines = "".join(f"    - {name}\n" for name in names)
    text = f"rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths:\n{lines}{more}"
    (folder / "metadata.yaml").write_text(text)


@pytest.mark.parametrize("kind", ["sqlite3", "mcap"])
def test_parts_in_the_order_of_the_metadata_or_of_their_numbers(tmp_path, kind):
    folder = split_bag(tmp_path, kind)
    ending = ".db3" if kind == "sqlite3" else ".mcap"
    if kind == "sqlite3":
        assert stamps_of(open_log(folder)) == STAMPS
    # Early metadata name parts with their folder; newer ones have a second list.
    names = [f"split/split_{number}{ending}" for number in (10, 0, 9)]
    files = "".join(f"  - path: split_{n}{ending}\n    message_count: 1\n" for n in (0, 9, 10))
    metadata(folder, *names, more=f"  files:\n{files}")
    assert stamps_of(open_log(folder)) == STAMPS[20:] + STAMPS[:20]
    (folder / "metadata.yaml").write_text("nonsense: [")
    log = open_log(folder)
    assert (stamps_of(log), len(log), log.format) == (STAMPS, 30, "rosbag2")


def test_parts_that_are_missing_or_compressed(tmp_path):
    folder = split_bag(tmp_path)
    metadata(folder, "split_0.db3", "split_1.db3", "../outside_9.db3", "split_9.db3")
    check_refused(r"has no split_1.db3, which metadata\.yaml lists", folder)
    log = open_log(folder, keep_going=True)
    assert (len(list(log)), log.skipped) == (20, 2)
    assert "has no outside_9.db3" in log.faults[1]
    metadata(folder, "split_0.db3.zstd")
    (folder / "split_0.db3.zstd").touch()
    check_refused("decompress it first", folder)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_among_the_parts_is_not_waited_for(tmp_path):
    folder = split_bag(tmp_path)
    os.mkfifo(folder / "more.db3")
    metadata(folder, "split_0.db3", "more.db3")
    check_refused(r"has no more\.db3, which metadata\.yaml lists", folder)


@pytest.mark.parametrize(
    "text", ["\n" * 300_000, "- " + " " * 300_000 + "x", "- a.db3 " * 40_000 + "x"]
)
def test_metadata_of_blanks_take_no_time(tmp_path, text):
    """Where a search goes back over what it has seen, these take hours."""
    folder = split_bag(tmp_path)
    (folder / "metadata.yaml").write_text(text)
    assert len(open_log(folder)) == 30


def test_which_folders_are_bags(tmp_path):
    folder = split_bag(tmp_path)
    assert Rosbag2Log.recognises(Head(folder, b"", is_directory=True))
    (folder / "notes.txt").write_text("what is this?")
    assert not Rosbag2Log.recognises(Head(folder, b"", is_directory=True))
    metadata(folder)
    assert Rosbag2Log.recognises(Head(folder, b"", is_directory=True))
    metadata(tmp_path)
    check_refused(r"holds no part of a ROS 2 bag, expected \.db3 or \.mcap", tmp_path)


# --- databases


@pytest.fixture
def database(tmp_path):
    (path,) = write(tmp_path, "sqlite3", two_scanners("sqlite3")).glob("*.db3")
    return path


def changed(database, script):
    with sqlite3.connect(database) as writer:
        writer.executescript(script)
    writer.close()


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_database_alone_is_read_and_left_as_it_is(database):
    before = contents(database.parent)
    assert stamps_of(open_log(database)) == STAMPS
    assert contents(database.parent) == before
    changed(database, "DROP INDEX timestamp_idx")
    assert stamps_of(open_log(database)) == STAMPS


def test_what_a_stopped_recorder_left_beside_a_database(database, tmp_path):
    """It is read, in place or in a copy, and nothing is created beside it."""
    writer = sqlite3.connect(database)
    writer.execute("PRAGMA journal_mode = WAL")
    writer.execute("DELETE FROM messages WHERE timestamp > 5000")
    writer.commit()
    assert len(list(open_log(database))) == 6
    folder = tmp_path / "copy"
    folder.mkdir()
    for path in (database, database.with_name(f"{database.name}-wal")):
        shutil.copy(path, folder)
    writer.close()
    before = contents(folder)
    log = open_log(folder)
    assert len(log) == len(list(log)) == 6
    assert contents(folder) == before


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ("DROP TABLE messages", "expected the tables topics and messages; it has: .*topics"),
        ("ALTER TABLE messages RENAME COLUMN data TO x", "no such column: m.data"),
        (
            "DROP TABLE messages; CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION "
            "ALL SELECT id FROM n) SELECT id, 1 AS topic_id, 2 AS timestamp, x'00' AS data FROM n",
            "expected the tables topics and messages",
        ),
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
        ("UPDATE messages SET data = 'text' WHERE id = 1", "/front: message is 'text', expected"),
        ("UPDATE messages SET data = x'28b52ffd00'", "/front: zstd data is broken"),
        ("UPDATE topics SET serialization_format = 'json'", "encoding is 'json', expected ros1"),
        ("DELETE FROM topics", "topics there are: none"),
    ],
)
def test_databases_that_are_strange(database, change, problem):
    changed(database, change)
    with pytest.raises(LogError, match=problem):
        list(open_log(database))


def test_a_database_whose_damage_is_no_text(database):
    data = database.read_bytes()
    database.write_bytes(data.replace(b"CREATE TABLE messages", b"CREATE TABLE (\xdf ssages"))
    check_refused(r"cannot be read as a ROS 2 bag \(sqlite3: ", database)


def test_a_database_that_is_cut_off_says_so(database):
    whole = database.read_bytes()
    database.write_bytes(whole[:-4096])
    check_refused(rf"is cut off: ends at byte {len(whole) - 4096}", database)


# --- recordings


def test_the_same_recording_in_two_containers(data_dir):
    names = "rosbag1/scans_demo.bag", "mcap/scans_demo.mcap"
    bag, mcap = (open_log(data_dir / name).items() for name in names)
    for (topic, scan), (other_topic, other) in zip(bag, mcap, strict=True):
        assert (topic, scan.stamp, scan.frame_id) == (other_topic, other.stamp, other.frame_id)
        np.testing.assert_array_equal(scan.ranges, other.ranges)


def test_oddities_of_recordings(data_dir):
    # Codes below range_min are invalid.
    log = open_log(data_dir / "rosbag1" / "demo_stationary_simple_environment.bag")
    assert 0.3 < np.mean([scan.valid.mean() for scan in log]) < 0.4
    # The increment changes with the number of beams.
    for scan in open_log(data_dir / "rosbag2" / "ld19"):
        assert scan.angle_increment == pytest.approx(2 * math.pi / len(scan), rel=0.01)
    # Two publishers on a topic, of which one sees nothing.
    scans = list(open_log(data_dir / "rosbag2" / "two_publishers"))
    assert (np.diff(stamps_of(scans)) < 0).sum() > 100
    blind = sum(not scan.valid.any() for scan in scans)
    assert 200 < blind < len(scans) - 200
