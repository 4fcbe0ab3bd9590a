"""MCAP: other readers find in it what was written, in both kinds of messages."""

from __future__ import annotations

import math
import sys
from dataclasses import replace

import numpy as np
import pytest
from handmade import arc, corner, features, segment
from mcap.reader import make_reader
from protobuf import decode, messages_of
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lineament import LaserScan, LineamentError
from lineament.output import open_writer
from lineament.output.markers import markers_of
from lineament.output.scene import layers_of

RANGES = [1.0, 2.5, math.nan, 9.0, 0.05, 1.25]
POSE = (1.5, -2.0, 0.5)


def scan_of(**fields):
    fields = {"stamp": 12.25, "frame_id": "laser_link", "pose": POSE} | fields
    if "angles" not in fields:
        fields |= {"angle_min": -0.5, "angle_increment": 0.125}
    return LaserScan(RANGES, range_min=0.1, range_max=8.0, **fields)


FOUND = features(
    6,
    segments=[segment((1, 0), (1, 2), 0, 1), segment((0, 3), (-1, 3), 1, 3)],
    corners=[corner(1, 2), corner(np.nan, 0), corner(-1, 3, kind="edge")],
    arcs=[arc(2, 1, 0.25, 0, 1)],
)
EMPTY = features(6)


def write(path, *written, topics=()):
    with open_writer(path, topics) as writer:
        for found, scan, *topic in written:
            writer.write(found, scan, *topic)


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


def single(values):
    return np.asarray(values, dtype=np.float32)


def points_of(points):
    return np.array([(p.get("x", 0.0), p.get("y", 0.0)) for p in points])


def test_foxglove_has_scan_transform_and_scene(tmp_path):
    path, scan = tmp_path / "a.mcap", scan_of(intensities=np.arange(6.0))
    write(path, (FOUND, scan))
    (tf, scanned, scene) = read_foxglove(path)
    assert [m[0] for m in (tf, scanned, scene)] == ["/tf", "/scan", "/scan/features"]
    assert {m[1] for m in (tf, scanned, scene)} == {12_250_000_000}
    stamp = {"seconds": 12, "nanos": 250_000_000}

    assert tf[2]["timestamp"] == stamp
    assert (tf[2]["parent_frame_id"], tf[2]["child_frame_id"]) == ("map", "laser_link")
    assert tf[2]["translation"] == {"x": 1.5, "y": -2.0}
    turn = tf[2]["rotation"]
    assert 2 * math.atan2(turn["z"], turn["w"]) == pytest.approx(0.5)

    assert (scanned[2]["timestamp"], scanned[2]["frame_id"]) == (stamp, "laser_link")
    assert scanned[2]["start_angle"] == -0.5
    assert scanned[2]["end_angle"] == -0.5 + 5 * 0.125
    expected = np.where(scan.valid, RANGES, np.nan)
    np.testing.assert_array_equal(scanned[2]["ranges"], expected)
    assert scanned[2]["intensities"] == list(range(6))

    markers = markers_of(FOUND, scan)
    entities = {entity["id"]: entity for entity in scene[2]["entities"]}
    assert list(entities) == ["segments", "arcs", "corners", "edges", "ellipses"]
    assert all(e["frame_id"] == "laser_link" for e in entities.values())
    lines = [points_of(line["points"]) for line in entities["segments"]["lines"]]
    np.testing.assert_array_equal(lines, markers.segments)
    (strip,) = entities["arcs"]["lines"]
    np.testing.assert_array_equal(points_of(strip["points"]), markers.arc_strips()[0])
    for name, x, y in (("corners", 1.0, 2.0), ("edges", -1.0, 3.0)):
        (sphere,) = entities[name]["spheres"]
        assert sphere["pose"]["position"] == {"x": x, "y": y}
    assert len(entities["ellipses"]["lines"]) == 3
    assert all(line["color"]["a"] == 1 for line in entities["segments"]["lines"])


def test_ros2_has_scan_transform_and_markers(tmp_path):
    path = tmp_path / "a.ros2.mcap"
    scan = scan_of(intensities=np.arange(6.0), scan_time=0.1, time_increment=0.01)
    write(path, (FOUND, scan))
    messages = read_ros2(path)
    assert [m[0] for m in messages] == ["/tf", "/scan", "/scan/features"]
    assert {m[1] for m in messages} == {12_250_000_000}
    (transform,) = messages[0][2].transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("map", "laser_link")
    assert (transform.header.stamp.sec, transform.header.stamp.nanosec) == (12, 250_000_000)

    back = LaserScan.from_message(messages[1][2], pose=POSE)
    np.testing.assert_array_equal(back.ranges, single(RANGES))  # invalid ones too
    np.testing.assert_array_equal(back.valid, scan.valid)
    np.testing.assert_array_equal(back.intensities, np.arange(6.0))
    assert (back.stamp, back.frame_id) == (scan.stamp, scan.frame_id)
    assert messages[1][2].angle_max == single(scan.angles[-1])
    for name in ("angle_min", "angle_increment", "range_min", "scan_time", "time_increment"):
        assert getattr(back, name) == single(getattr(scan, name))

    markers = {marker.ns: marker for marker in messages[2][2].markers}
    layers = {layer.name: layer for layer in layers_of(markers_of(FOUND, scan))}
    assert list(markers) == list(layers)
    for name, marker in markers.items():
        is_spheres = name in {"corners", "edges"}
        expected = layers[name].points if is_spheres else layers[name].pairs
        np.testing.assert_array_equal([(p.x, p.y) for p in marker.points], expected)
        assert marker.type == (marker.SPHERE_LIST if is_spheres else marker.LINE_LIST)
        assert marker.action == marker.ADD
        assert marker.header.frame_id == "laser_link"
        assert marker.pose.orientation.w == 1
        assert marker.scale.x > 0
        assert marker.color.a == 1


def test_ros2_deletes_what_is_no_more(tmp_path):
    path = tmp_path / "a.ros2.mcap"
    write(path, (FOUND, scan_of(pose=None)), (EMPTY, scan_of(pose=None, stamp=13.0)))
    messages = read_ros2(path)
    assert [m[0] for m in messages] == ["/scan", "/scan/features"] * 2  # no pose, no transform
    assert {marker.action for marker in messages[-1][2].markers} == {2}
    assert all(marker.id == 0 and not marker.points for marker in messages[-1][2].markers)


def test_foxglove_replaces_what_is_no_more(tmp_path):
    path = tmp_path / "a.mcap"
    write(path, (FOUND, scan_of(pose=None)), (EMPTY, scan_of(pose=None, stamp=13.0)))
    messages = read_foxglove(path)
    assert [m[0] for m in messages] == ["/scan", "/scan/features"] * 2
    entities = messages[-1][2]["entities"]
    assert [e["id"] for e in entities] == ["segments", "arcs", "corners", "edges", "ellipses"]
    assert not any(e["lines"] or e["spheres"] for e in entities)


def test_irregular_bearings_become_points(tmp_path):
    scan = scan_of(angles=np.cumsum([0.1, 0.2, 0.1, 0.3, 0.1, 0.1]), intensities=np.arange(6.0))
    expected = np.column_stack((scan.points, np.zeros(6), np.arange(6)))[scan.valid]
    for name, read in (("a.mcap", read_foxglove), ("a.ros2.mcap", read_ros2)):
        write(tmp_path / name, (FOUND, scan))
        topics = {topic: message for topic, _, message in read(tmp_path / name)}
        assert set(topics) == {"/tf", "/scan/points", "/scan/features"}
        cloud = topics["/scan/points"]
        if name == "a.mcap":
            data, stride = cloud["data"], cloud["point_stride"]
            names = [field["name"] for field in cloud["fields"]]
        else:
            data, stride = cloud.data.tobytes(), cloud.point_step
            names = [field.name for field in cloud.fields]
            assert (cloud.width, cloud.row_step) == (3, 48)
        assert names == ["x", "y", "z", "intensity"]
        assert stride == 16
        np.testing.assert_array_equal(np.frombuffer(data, "<f4").reshape(-1, 4), single(expected))


@pytest.mark.parametrize(("name", "read"), [("a.mcap", read_foxglove), ("a.ros2.mcap", read_ros2)])
def test_topics_keep_their_names(tmp_path, name, read):
    topics = ["/front", "/rear"]
    scans = [(FOUND, scan_of(stamp=float(i)), topics[i % 2]) for i in range(4)]
    write(tmp_path / name, *scans, topics=topics)
    told = [topic for topic, _, _ in read(tmp_path / name)]
    assert told == ["/tf", "/front", "/front/features", "/tf", "/rear", "/rear/features"] * 2


@pytest.mark.parametrize(
    ("frame", "parent", "child"), [("", "map", "laser"), ("map", "world", "map")]
)
def test_frames_of_logs_that_name_none_or_the_world(tmp_path, frame, parent, child):
    write(tmp_path / "a.mcap", (FOUND, scan_of(frame_id=frame)))
    transform = read_foxglove(tmp_path / "a.mcap")[0][2]
    assert (transform["parent_frame_id"], transform["child_frame_id"]) == (parent, child)


@pytest.mark.parametrize("stamp", [-0.5, 2.0**31, 1e300])
@pytest.mark.parametrize("name", ["a.mcap", "a.ros2.mcap"])
def test_stamps_that_messages_do_not_hold(tmp_path, name, stamp):
    with pytest.raises(LineamentError, match=r"scan 1 has the stamp .* expected 0 to") as caught:
        write(tmp_path / name, (FOUND, scan_of()), (FOUND, scan_of(stamp=stamp)))
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["a.mcap", "a.ros2.mcap"])
def test_odd_scans_are_written(tmp_path, name):
    nothing = LaserScan([], angle_min=0.0, angle_increment=0.1)
    huge = LaserScan([1e300, 1.0], angle_min=0.0, angle_increment=0.1, intensities=[1e300, 0])
    far = replace(FOUND, segments=np.array([segment((1e300, 0), (1, 1), 0, 1)]))
    write(tmp_path / name, (features(0), nothing), (far, huge))
    read = read_foxglove if name == "a.mcap" else read_ros2
    assert len(read(tmp_path / name)) == 4


def test_many_scans_are_in_chunks_with_an_index(tmp_path):
    path = tmp_path / "a.mcap"
    long = LaserScan(np.full(2000, 2.0), angle_min=0.0, angle_increment=0.003)
    write(path, *[(EMPTY, long)] * 200)
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert len(summary.chunk_indexes) > 2  # memory does not grow: about 1 MB each
    assert summary.statistics.message_count == 400


def test_missing_package_is_told(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "foxglove", None)
    monkeypatch.delitem(sys.modules, "lineament.output.foxglove", raising=False)
    with pytest.raises(
        LineamentError,
        match=r"\.mcap: needs foxglove, .*: pip install 'lineament\[foxglove\]'",
    ):
        open_writer(tmp_path / "a.mcap")
    open_writer(tmp_path / "a.ros2.mcap")  # does without
