"""Messages of ROS as bytes: rosbags reads in them what was told, and writes the same bytes."""

from __future__ import annotations

import io
import math
import subprocess
import sys
import textwrap

import numpy as np
import pytest
import ros_bags
from handmade import arc, corner, features, random_features, segment
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import lineament as ln
from lineament import LaserScan
from lineament.motion import Tracker
from lineament.output.feature_points import FEATURE_POINT, feature_points
from lineament.output.markers import markers_of
from lineament.output.mcap import McapWriter
from lineament.output.ros_messages import RosMessages
from lineament.output.scene import Moment, layers_of
from lineament.rosmsg.scans import laser_scan
from lineament.simulation import SENSORS, drive, room

both = pytest.mark.parametrize("encoding", ["cdr", "ros1"])

MOMENT = Moment(1_700_000_012, 123_456_789, "laser_link", "map")
SCAN = LaserScan(
    [1.0, 2.5, math.nan, 9.0, 0.05, math.inf],
    *(-0.5, 0.125),
    range_min=0.1,
    range_max=8.0,
    scan_time=0.1,
    time_increment=0.01,
    intensities=np.arange(6.0),
)
FOUND = features(
    6,
    segments=[segment((1, 0), (1, 2), 0, 1), segment((0, 3), (-1, 3), 1, 3)],
    corners=[corner(1, 2), corner(np.nan, 0), corner(-1, 3), corner(0, 3, kind="edge")],
    arcs=[arc(2, 1, 0.25, 0, 1)],
)


def read(message, encoding):
    """Read a message with rosbags, which makes the same bytes of it again."""
    ros = {"ros1": 1, "cdr": 2}[encoding]
    store, kind = ros_bags.store(ros), message.kind
    assert ("/msg/" in kind) == (ros == 2)
    if ros == 1:
        back = store.deserialize_ros1(message.data, kind.replace("/", "/msg/"))
    else:
        back = store.deserialize_cdr(message.data, kind)
    again = ros_bags.serialized(back, ros)
    padding = again[len(message.data) :]
    assert again == message.data + bytes(len(padding))
    assert len(padding) < 4
    return back


def check_header(header, frame="laser_link"):
    stamp = header.stamp
    assert (stamp.sec, stamp.nanosec, header.frame_id) == (1_700_000_012, 123_456_789, frame)


def columns_of(cloud):
    """Read a cloud by its fields, as any client does."""
    kinds = {5: "<i4", 6: "<u4", 7: "<f4"}
    assert all(field.count == 1 for field in cloud.fields)
    dtype = np.dtype(
        {
            "names": [field.name for field in cloud.fields],
            "formats": [kinds[field.datatype] for field in cloud.fields],
            "offsets": [field.offset for field in cloud.fields],
            "itemsize": cloud.point_step,
        }
    )
    assert (cloud.height, cloud.row_step, cloud.is_bigendian) == (1, len(cloud.data), False)
    points = np.frombuffer(cloud.data.tobytes(), dtype)
    assert len(points) == cloud.width
    return points


@both
def test_scan(encoding):
    message = RosMessages(encoding).scan("/scan", MOMENT, SCAN)
    assert message.topic == "/scan"
    back = read(message, encoding)
    check_header(back.header)
    np.testing.assert_array_equal(back.ranges, SCAN.ranges.astype("f4"))  # invalid ones too
    np.testing.assert_array_equal(back.intensities, np.arange(6))
    assert back.angle_max == np.float32(-0.5 + 5 * 0.125)
    for name in ("angle_min", "angle_increment", "range_min", "range_max", "scan_time"):
        assert getattr(back, name) == np.float32(getattr(SCAN, name)), name
    assert back.time_increment == np.float32(0.01)


@both
@given(
    st.lists(st.floats(width=32), min_size=1, max_size=9),
    st.text(st.characters(exclude_characters="\0", exclude_categories=("Cs",)), max_size=9),
    st.integers(0, 2**31 - 2),
)
def test_scan_is_read_back(encoding, ranges, frame, stamp):
    scan = LaserScan(ranges, 0.5, 0.25, range_max=20.0, stamp=stamp + 0.5, frame_id=frame)
    moment = Moment.of(scan)
    back = laser_scan(RosMessages(encoding).scan("/scan", moment, scan).data, encoding)
    np.testing.assert_array_equal(back.ranges, scan.ranges)
    assert (back.stamp, back.frame_id) == (scan.stamp, frame or "laser")
    assert (back.angle_min, back.angle_increment, back.range_max) == (0.5, 0.25, 20.0)


@both
def test_numbers_that_single_precision_does_not_hold_become_infinite(encoding):
    scan = LaserScan([1e300, 1.0], 0.0, 0.1, range_max=1e300, intensities=[1e300, 0])
    back = read(RosMessages(encoding).scan("/scan", MOMENT, scan), encoding)
    assert (back.range_max, *back.ranges) == (math.inf, math.inf, 1.0)
    assert back.intensities.tolist() == [math.inf, 0]


@both
def test_points(encoding):
    scan = LaserScan(SCAN.ranges, angles=[0, 1, 2, 3, 4, 5], intensities=SCAN.intensities)
    message = RosMessages(encoding).points("/scan/points", MOMENT, scan)
    cloud = read(message, encoding)
    check_header(cloud.header)
    points = columns_of(cloud)
    assert points.dtype.names == ("x", "y", "z", "intensity")
    assert points["intensity"].tolist() == [0, 1, 3, 4]
    np.testing.assert_array_equal(points["x"], scan.points[scan.valid, 0].astype("f4"))
    without = LaserScan([1.0, math.nan], angles=[0, 1])
    assert len(columns_of(read(RosMessages(encoding).points("/p", MOMENT, without), encoding))) == 1
    nothing = LaserScan([], angles=[])
    assert len(columns_of(read(RosMessages(encoding).points("/p", MOMENT, nothing), encoding))) == 0


@both
def test_transform(encoding):
    message = RosMessages(encoding).transform("/tf", MOMENT, (1.5, -2.0, 0.5))
    (transform,) = read(message, encoding).transforms
    check_header(transform.header, "map")
    assert transform.child_frame_id == "laser_link"
    moved, turned = transform.transform.translation, transform.transform.rotation
    assert (moved.x, moved.y, moved.z) == (1.5, -2.0, 0.0)
    assert (turned.x, turned.y) == (0.0, 0.0)
    assert 2 * math.atan2(turned.z, turned.w) == pytest.approx(0.5)


@both
def test_markers(encoding):
    layers = layers_of(markers_of(FOUND, SCAN))
    message = RosMessages(encoding).features("/scan/features", MOMENT, layers)
    markers = read(message, encoding).markers
    assert [marker.ns for marker in markers] == [
        *("segments", "arcs", "corners", "edges", "ellipses")
    ]
    for marker, layer in zip(markers, layers, strict=True):
        is_spheres = layer.name in {"corners", "edges"}
        check_header(marker.header)
        assert marker.type == (marker.SPHERE_LIST if is_spheres else marker.LINE_LIST)
        assert (marker.id, marker.action) == (0, marker.ADD)
        expected = layer.points if is_spheres else layer.pairs
        np.testing.assert_array_equal([(p.x, p.y) for p in marker.points], expected)
        assert {p.z for p in marker.points} == {0.0}
        assert (marker.scale.x, marker.scale.y, marker.scale.z) == (layer.size,) * 3
        color = marker.color
        assert np.float32(layer.color).tolist() == [color.r, color.g, color.b, color.a]
        pose = marker.pose
        assert (pose.position.x, pose.position.y, pose.position.z) == (0, 0, 0)
        assert (pose.orientation.x, pose.orientation.w) == (0, 1)
        assert (marker.lifetime.sec, marker.frame_locked, len(marker.colors)) == (0, False, 0)


@both
def test_markers_of_nothing_are_deleted(encoding):
    layers = layers_of(markers_of(features(6), SCAN))
    markers = read(RosMessages(encoding).features("/f", MOMENT, layers), encoding).markers
    assert [(marker.action, len(marker.points)) for marker in markers] == [(2, 0)] * 5


def yaws_of(encoding, found):
    message = RosMessages(encoding).corners("/scan/corners", MOMENT, found)
    array = read(message, encoding)
    check_header(array.header)
    assert all(pose.orientation.x == pose.orientation.y == 0 for pose in array.poses)
    return [
        (pose.position.x, pose.position.y, 2 * math.atan2(pose.orientation.z, pose.orientation.w))
        for pose in array.poses
    ]


@both
def test_corners_point_to_where_they_open(encoding):
    sides = [segment((1, 1), (7, 1), 0, 1), segment((1, 1.5), (1, 1), 1, 3)]
    sides.append(segment((5, 5), (5, 5), 3, 5))
    corners = [
        corner(1, 1, segments=(1, 0)),  # arms to the right and upwards, of different lengths
        corner(1, 1, segments=(0, -1)),  # one side is not known
        corner(1, 1.5, segments=(-1, 1), kind="edge"),  # along its only segment, downwards
        corner(1, 1, segments=(-1, 1), kind="edge"),  # at its other end, upwards
        corner(2, 1, segments=(-1, -1)),  # no side is known
        corner(np.nan, 1, segments=(0, 1)),  # nowhere
        corner(1e300, 1, segments=(0, 1)),  # where nothing is drawn
        corner(5, 5, segments=(1, 2)),  # in the middle of its own side
        corner(1, 1.25, segments=(1, 1)),  # likewise
    ]
    found = yaws_of(encoding, features(6, sides, corners))
    assert [pose[:2] for pose in found] == [
        *[(1, 1), (1, 1), (1, 1.5), (1, 1), (2, 1), (5, 5), (1, 1.25)]
    ]
    quarter = math.pi / 2
    assert [pose[2] for pose in found] == pytest.approx(
        [quarter / 2, 0, -quarter, quarter, 0, 0, 0]
    )
    assert yaws_of(encoding, features(6)) == []


def test_corner_beside_impossible_sides_is_not_turned():
    for x in (math.nan, 1e300, math.inf):
        sides = [segment((1, 1), (7, 1), 0, 1), segment((0, 0), (0, 1), 1, 3)]
        sides[1]["centroid"] = -x, x
        ((*_, yaw),) = yaws_of("cdr", features(6, sides, [corner(1, 1, segments=(0, 1))]))
        assert math.isfinite(yaw)


def test_corners_of_a_room_open_towards_the_scanner_between_their_sides():
    (scan, *_) = drive(room(), [(-2, 0), (-1.8, 0)], SENSORS["paper"], speed=1, rate=10)
    found = ln.extract(scan, method="liu:scale_free")
    poses = yaws_of("cdr", found)
    known = (found.corners["segments"] >= 0).all(axis=1)
    assert known.sum() >= 3
    for (x, y, yaw), record in zip(poses, found.corners, strict=True):
        if min(record["segments"]) < 0:
            continue
        is_towards = math.cos(yaw) * x + math.sin(yaw) * y < 0
        assert is_towards != record["convex"]
        for angle in found.segments["angle"][record["segments"]]:
            apart = abs(math.remainder(2 * (angle - yaw), 2 * math.pi)) / 2  # of a line
            half = abs(math.remainder(record["opening"], 2 * math.pi)) / 2
            assert apart == pytest.approx(half, abs=0.02)


@both
def test_feature_cloud(encoding):
    cloud = read(RosMessages(encoding).cloud("/scan/features", MOMENT, FOUND), encoding)
    check_header(cloud.header)
    points = columns_of(cloud)
    assert points.dtype == FEATURE_POINT
    assert points.tobytes() == feature_points(FOUND).tobytes()
    assert not cloud.is_dense  # one corner is nowhere
    fine = columns_of(read(RosMessages(encoding).cloud("/f", MOMENT, features(6)), encoding))
    assert len(fine) == 0


def test_feature_cloud_has_the_tracks():
    tracker, extract = Tracker(), ln.Extractor("liu:scale_free")
    for scan in drive(room(), [(-2, 0), (-1.8, 0)], SENSORS["paper"], speed=1, rate=10):
        found = extract(scan)
        tracks = tracker(found)
    cloud = read(RosMessages().cloud("/f", MOMENT, found, tracks), "cdr")
    assert cloud.is_dense
    points = columns_of(cloud)
    for kind, numbers in enumerate((tracks.segments, tracks.corners, tracks.arcs)):
        assert points["track"][points["kind"] == kind].tolist() == numbers.tolist()


@both
def test_diagnostics(encoding):
    values = {"rate [Hz]": "40.0", "": "", "größe": "1 µs"}
    message = RosMessages(encoding).diagnostics(
        "/diagnostics", MOMENT, "lineament: /scan", "laser", 1, "2 scans dropped", values
    )
    array = read(message, encoding)
    check_header(array.header)
    (status,) = array.status
    assert (status.level, status.name) == (1, "lineament: /scan")
    assert (status.message, status.hardware_id) == ("2 scans dropped", "laser")
    assert {pair.key: pair.value for pair in status.values} == values


@pytest.mark.parametrize("level", [-1, 4, 256])
def test_levels_that_there_are_not(level):
    with pytest.raises(ValueError, match=rf"level is {level}, expected 0 \(OK\), 1"):
        RosMessages().diagnostics("/diagnostics", MOMENT, "n", "h", level, "", {})


@both
@pytest.mark.parametrize("length", range(9))
def test_frames_of_all_lengths_leave_numbers_aligned(encoding, length):
    found = random_features(length)
    scan = LaserScan(np.full(200, 2.0), 0.0, 2 * math.pi / 200)
    moment, ros = MOMENT._replace(frame="f" * length, world="w" * length), RosMessages(encoding)
    layers = layers_of(markers_of(found, scan))
    assert len(read(ros.features("/f", moment, layers), encoding).markers) == 5
    assert len(read(ros.corners("/f", moment, found), encoding).poses) == len(found.corners)
    n = len(found.segments) + len(found.corners) + len(found.arcs)
    assert read(ros.cloud("/f", moment, found), encoding).width == n
    assert len(read(ros.transform("/f", moment, (0.0, 0.0, 0.0)), encoding).transforms) == 1
    (status,) = read(
        ros.diagnostics("/f", moment, "n" * length, "", 0, "", {"a": "b"}), encoding
    ).status
    assert status.name == "n" * length


def test_features_of_recordings_are_what_was_found(recorded_scans):
    extract = ln.Extractor("optimal")
    for scan in recorded_scans[::40]:
        found = extract(scan)
        layers = layers_of(markers_of(found, scan))
        for encoding in ("cdr", "ros1"):
            ros = RosMessages(encoding)
            markers = read(ros.features("/f", MOMENT, layers), encoding).markers
            assert len(markers[0].points) == 2 * len(found.segments)
            points = columns_of(read(ros.cloud("/f", MOMENT, found), encoding))
            assert np.bincount(points["kind"], minlength=3).tolist() == [
                *(len(found.segments), len(found.corners), len(found.arcs))
            ]
            assert len(read(ros.corners("/f", MOMENT, found), encoding).poses) == len(found.corners)


def test_messages_of_ros1_in_a_file_are_read_by_the_definitions_in_it(tmp_path):
    path = tmp_path / "a.mcap"
    with McapWriter(path, (), RosMessages("ros1")) as writer:
        writer.write(FOUND, LaserScan(np.full(6, 2.0), 0.0, 0.1, stamp=7.5, pose=(1, 2, 0.5)))
    (scan,) = ln.open_log(path)
    assert (scan.stamp, scan.ranges.tolist()) == (7.5, [2.0] * 6)
    reader = make_reader(io.BytesIO(path.read_bytes()), validate_crcs=True)
    assert reader.get_header().profile == "ros1"
    store, kinds = get_typestore(Stores.EMPTY), []
    for schema, channel, message in reader.iter_messages():
        assert (schema.encoding, channel.message_encoding) == ("ros1msg", "ros1")
        full = schema.name.replace("/", "/msg/")
        types = get_types_from_msg(schema.data.decode(), full)
        store.register({name: kind for name, kind in types.items() if name not in store.types})
        assert store.deserialize_ros1(message.data, full).__msgtype__ == full
        kinds.append(schema.name)
    assert kinds == [
        *("tf2_msgs/TFMessage", "sensor_msgs/LaserScan", "visualization_msgs/MarkerArray")
    ]


@both
def test_definitions_of_all_messages(encoding):
    ros = RosMessages(encoding)
    made = [
        ros.corners("/c", MOMENT, FOUND),
        ros.cloud("/f", MOMENT, FOUND),
        ros.diagnostics("/d", MOMENT, "n", "h", 0, "", {}),
    ]
    for message in made:
        name, form, text = ros.schema(message.kind)
        assert (name, form) == (message.kind, {"cdr": "ros2msg", "ros1": "ros1msg"}[encoding])
        assert b"std_msgs/Header header" in text


def test_unknown_encoding_is_told():
    with pytest.raises(ValueError, match="encoding is 'xml', expected ros1 or cdr"):
        RosMessages("xml")


def test_messages_and_definitions_need_no_packages():
    script = """
        import sys
        from lineament.output.ros_messages import RosMessages
        RosMessages().schema("tf2_msgs/msg/TFMessage")
        assert not {"rosbags", "mcap", "numba", "pyarrow"} & set(sys.modules)
    """
    subprocess.run([sys.executable, "-c", textwrap.dedent(script)], check=True)
