"""MCAP: other readers find in it what was written, in both kinds of messages."""

import math
import re
from dataclasses import asdict, is_dataclass, replace

import numpy as np
import pytest
from approved import assert_approved, numbers_of
from handmade import arc, corner, edge, features, segment
from mcap.reader import make_reader
from protobuf import decode, messages_of
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lineament import LaserScan, LineamentError
from lineament.output import open_writer

RANGES = [1.0, 2.5, math.nan, 9.0, 0.05, 1.25]
POSE = (1.5, -2.0, 0.5)
FOUND = features(
    6,
    segments=[segment((1, 0), (1, 2), 0, 1), segment((0, 3), (-1, 3), 1, 3)],
    corners=[corner(1, 2), corner(np.nan, 0)],
    edges=[edge(-1, 3)],
    arcs=[arc(2, 1, 0.25, 0, 1)],
)
EMPTY = features(6)


def scan_of(**fields):
    fields = {"stamp": 12.25, "frame_id": "laser_link", "pose": POSE} | fields
    if "angles" not in fields:
        fields |= {"angle_min": -0.5, "angle_increment": 0.125}
    return LaserScan(RANGES, range_min=0.1, range_max=8.0, **fields)


def write(path, *written):
    with open_writer(path) as writer:
        for found, scan, *topic in written:
            writer.write(found, scan, *topic)
    return path


def read_foxglove(path):
    """Read the messages (topic, time, dict) of a file by the schemas in it."""
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().library.startswith("lineament ")
        return [
            (channel.topic, m.log_time, decode(m.data, f".{schema.name}", messages_of(schema.data)))
            for schema, channel, m in reader.iter_messages(log_time_order=False)
        ]


def read_ros2(path):
    """Read the messages (topic, time, message) of a file by the definitions in it."""
    reader = McapReader(path)  # by rosbags: nothing of it wrote the file
    reader.open()
    store = get_typestore(Stores.EMPTY)
    for connection in reader.connections:
        assert connection.msgdef.format.name == "MSG"
        types = get_types_from_msg(connection.msgdef.data, connection.msgtype)
        store.register({name: fields for name, fields in types.items() if name not in store.types})
    found = [
        (connection.topic, time, store.deserialize_cdr(data, connection.msgtype))
        for connection, time, data in reader.messages(reader.connections)
    ]
    reader.close()
    return found


both = pytest.mark.parametrize(
    ("name", "read"), [("a.mcap", read_foxglove), ("a.ros2.mcap", read_ros2)]
)
#: What was found is where the live node has messages of that kind.
DRAWN = {read_foxglove: "features", read_ros2: "markers"}


@both
def test_irregular_bearings_become_points(tmp_path, name, read):
    scan = scan_of(angles=np.cumsum([0.1, 0.2, 0.1, 0.3, 0.1, 0.1]), intensities=np.arange(6.0))
    messages = {topic: m for topic, _, m in read(write(tmp_path / name, (FOUND, scan)))}
    assert set(messages) == {"/tf", "/scan/points", f"/scan/{DRAWN[read]}"}
    cloud = messages["/scan/points"]
    if read is read_foxglove:
        data, stride = cloud["data"], cloud["point_stride"]
        names = [(field["name"], field.get("offset", 0)) for field in cloud["fields"]]
    else:
        data, stride = cloud.data.tobytes(), cloud.point_step
        names = [(field.name, field.offset) for field in cloud.fields]
    assert (names, stride) == ([("x", 0), ("y", 4), ("z", 8), ("intensity", 12)], 16)
    expected = np.column_stack((scan.points, np.zeros(6), np.arange(6)))[scan.valid]
    np.testing.assert_array_equal(np.frombuffer(data, "<f4").reshape(-1, 4), np.float32(expected))


@both
def test_topics_keep_their_names(tmp_path, name, read):
    topics = ["/front", "/rear"]
    scans = [(FOUND, scan_of(stamp=float(i)), topics[i % 2]) for i in range(4)]
    found = [topic for topic, _, _ in read(write(tmp_path / name, *scans))]
    below = [f"{topic}/{DRAWN[read]}" for topic in topics]
    assert found == ["/tf", "/front", below[0], "/tf", "/rear", below[1]] * 2
    with (tmp_path / name).open("rb") as file:
        summary = make_reader(file).get_summary()
    assert (len(summary.schemas), len(summary.channels)) == (3, 5)


@pytest.mark.parametrize(
    ("frame", "parent", "child"), [("", "map", "laser"), ("map", "world", "map")]
)
def test_frames_of_logs_that_name_none_or_the_world(tmp_path, frame, parent, child):
    path = write(tmp_path / "a.mcap", (FOUND, scan_of(frame_id=frame)))
    transform = read_foxglove(path)[0][2]
    assert (transform["parent_frame_id"], transform["child_frame_id"]) == (parent, child)


@pytest.mark.parametrize("stamp", [-0.5, 2.0**31, 1e300])
def test_stamps_that_messages_do_not_hold(tmp_path, stamp):
    path = tmp_path / "a.ros2.mcap"
    with pytest.raises(LineamentError, match=r"^.*scan 1 has the stamp .* expected 0 to .*$"):
        write(path, (FOUND, scan_of()), (FOUND, scan_of(stamp=stamp)))
    assert not list(tmp_path.iterdir())
    write(path, *((FOUND, scan_of(stamp=stamp)) for stamp in (0.0, 2.0**31 - 1)))


@both
def test_odd_scans_are_written(tmp_path, name, read):
    nothing = LaserScan([], angle_min=0.0, angle_increment=0.1)
    huge = LaserScan([1e300, 1.0], angle_min=0.0, angle_increment=0.1, intensities=[1e300, 0])
    far = replace(FOUND, segments=np.array([segment((1e300, 0), (1, 1), 0, 1)]))
    assert len(read(write(tmp_path / name, (features(0), nothing), (far, huge)))) == 4


def test_many_scans_are_in_chunks_with_an_index(tmp_path):
    long = LaserScan(np.full(2000, 2.0), angle_min=0.0, angle_increment=0.003)
    with write(tmp_path / "a.mcap", *[(EMPTY, long)] * 200).open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        sequences = [message.sequence for _, _, message in reader.iter_messages()]
    assert sorted(sequences) == [k // 2 for k in range(400)]
    assert len(summary.chunk_indexes) > 2  # memory does not grow: about 1 MB each
    assert summary.statistics.message_count == 400


def plain(value):
    """Turn messages and arrays into dicts, lists, numbers and texts."""
    if is_dataclass(value):
        value = asdict(value)
    if isinstance(value, dict):  # without constants and names of types
        return {name: plain(part) for name, part in value.items() if re.match("[a-z]", name)}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    if isinstance(value, bytes):
        return value.hex()
    return plain(value.tolist()) if isinstance(value, np.ndarray) else value


@both
def test_recordings_hold_what_was_approved(tmp_path, name, read):
    """A scan of each kind: with a pose and without, regular or not, with what it shows of each."""
    scan = scan_of(intensities=[1.0, 2.0, 3.0, 4.0, 5.0, 6.5])
    uneven = scan_of(pose=None, stamp=13.0, angles=[-0.5, -0.4, -0.1, 0.0, 0.2, 0.7])
    path = write(tmp_path / name, (FOUND, scan), (EMPTY, uneven))
    lines = []
    for topic, time, message in read(path):
        lines += [f"{topic} at {time}", *numbers_of(plain(message))]
    assert_approved(f"messages{name[1:]}", lines)
