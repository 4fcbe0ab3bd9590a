"""Messages of ROS as bytes: rosbags reads in them what was meant, and writes the same bytes."""

import io
import math

import numpy as np
import pytest
import ros_bags
from handmade import arc, corner, edge, features, random_features, segment
from in_memory import Taken
from mcap.reader import make_reader

import lineament as ln
from lineament import LaserScan
from lineament.live import Counts, LiveConfig, Pipeline, Report, RosSink
from lineament.motion import CornerPose, Tracks, Travel
from lineament.output.feature_points import FEATURE_POINT, feature_points
from lineament.output.markers import markers_of
from lineament.output.mcap import McapWriter
from lineament.output.ros_messages import RosMessages
from lineament.output.scene import Moment, layers_of
from lineament.simulation import SENSORS, drive, room

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
    corners=[corner(1, 2), corner(np.nan, 0), corner(-1, 3)],
    edges=[edge(0, 3)],
    arcs=[arc(2, 1, 0.25, 0, 1)],
)


@pytest.fixture(params=["cdr", "ros1"])
def make(request):
    return RosMessages(request.param)


def read(make, message):
    """Read a message with rosbags, which makes the same bytes of it again."""
    ros = {"ros1": 1, "cdr": 2}[make.encoding]
    store, kind = ros_bags.store(ros), message.kind
    assert ("/msg/" in kind) == (ros == 2)
    definition, _ = store.generate_msgdef(kind.replace("/msg/", "/").replace("/", "/msg/"), ros)
    assert make.schema(kind) == (kind, f"ros{ros}msg", definition.encode())
    if ros == 1:
        back = store.deserialize_ros1(message.data, kind.replace("/", "/msg/"))
    else:
        back = store.deserialize_cdr(message.data, kind)
    again = ros_bags.serialized(back, ros)
    padding = again[len(message.data) :]
    assert again == message.data + bytes(len(padding))
    assert len(padding) < 4
    header = getattr(back, "header", None)
    if header:
        stamp = header.stamp
        assert (stamp.sec, stamp.nanosec) == (1_700_000_012, 123_456_789)
    return back


def columns_of(cloud):
    """Read a cloud by its fields, as any client does."""
    kinds = {5: "<i4", 6: "<u4", 7: "<f4"}
    assert all(field.count == 1 for field in cloud.fields)
    layout = {
        "names": [field.name for field in cloud.fields],
        "formats": [kinds[field.datatype] for field in cloud.fields],
        "offsets": [field.offset for field in cloud.fields],
        "itemsize": cloud.point_step,
    }
    assert (cloud.height, cloud.row_step, cloud.is_bigendian) == (1, len(cloud.data), False)
    points = np.frombuffer(cloud.data.tobytes(), np.dtype(layout))
    assert len(points) == cloud.width
    return points


def test_scan(make):
    message = make.scan("/scan", MOMENT, SCAN)
    assert (message.topic, message.kind) == ("/scan", make.kind("sensor_msgs/LaserScan"))
    back = read(make, message)
    assert back.header.frame_id == "laser_link"
    np.testing.assert_array_equal(back.ranges, SCAN.ranges.astype("f4"))  # invalid ones too
    np.testing.assert_array_equal(back.intensities, np.arange(6))
    assert back.angle_max == np.float32(-0.5 + 5 * 0.125)
    names = "angle_min", "angle_increment", "range_min", "range_max", "scan_time", "time_increment"
    for name in names:
        assert getattr(back, name) == np.float32(getattr(SCAN, name)), name
    # What single precision does not hold is infinite.
    huge = LaserScan([1e300, 1.0], 0.0, 0.1, range_max=1e300, intensities=[1e300, 0])
    back = read(make, make.scan("/scan", MOMENT, huge))
    assert back.ranges.tolist() == [math.inf, 1.0]
    assert (back.range_max, back.intensities.tolist()) == (math.inf, [math.inf, 0.0])


def test_points(make):
    scan = LaserScan(SCAN.ranges, angles=[0, 1, 2, 3, 4, 5], intensities=SCAN.intensities)
    cloud = read(make, make.points("/scan/points", MOMENT, scan))
    assert (cloud.header.frame_id, cloud.is_dense) == ("laser_link", True)
    points = columns_of(cloud)
    assert points.dtype.names == ("x", "y", "z", "intensity")
    assert points["intensity"].tolist() == [0, 1, 3, 4]
    for name, column in (("x", scan.points[:, 0]), ("y", scan.points[:, 1]), ("z", np.zeros(6))):
        np.testing.assert_array_equal(points[name], column[scan.valid].astype("f4"))
    without = LaserScan([1.0, math.nan], angles=[0, 1])
    assert columns_of(read(make, make.points("/p", MOMENT, without))).dtype.names == ("x", "y", "z")
    nothing = LaserScan([], angles=[])
    assert len(columns_of(read(make, make.points("/p", MOMENT, nothing)))) == 0


def covariance_of(values):
    """Read the plane of a covariance of six numbers, of which nothing else may be there."""
    six = np.reshape(values, (6, 6)).copy()
    plane = six[np.ix_((0, 1, 5), (0, 1, 5))].copy()
    six[np.ix_((0, 1, 5), (0, 1, 5))] = 0
    assert not six.any()
    return plane


def in_plane(pose):
    position, turned = pose.position, pose.orientation
    assert position.z == turned.x == turned.y == 0
    return position.x, position.y, 2 * math.atan2(turned.z, turned.w)


def test_odometry(make):
    of_pose, of_twist = np.arange(9.0).reshape(3, 3), np.eye(3) + 0.5
    travel = Travel((1.5, -2.0, -3.0), of_pose, (0.5, -0.25, 0.125), of_twist)
    back = read(make, make.odometry("/scan/odometry", MOMENT, travel))
    assert (back.header.frame_id, back.child_frame_id) == ("odom", "laser_link")
    assert in_plane(back.pose.pose) == pytest.approx((1.5, -2.0, -3.0))
    np.testing.assert_array_equal(covariance_of(back.pose.covariance), of_pose)
    np.testing.assert_array_equal(covariance_of(back.twist.covariance), of_twist)
    linear, angular = back.twist.twist.linear, back.twist.twist.angular
    assert (linear.x, linear.y, linear.z) == (0.5, -0.25, 0.0)
    assert (angular.x, angular.y, angular.z) == (0.0, 0.0, 0.125)


def test_corner_pose(make):
    found = CornerPose((1.5, -2.0, -3.0), np.arange(9.0).reshape(3, 3))
    back = read(make, make.placed("/scan/dock", MOMENT, found.pose, found.covariance))
    assert back.header.frame_id == "laser_link"
    assert in_plane(back.pose.pose) == pytest.approx(found.pose)
    np.testing.assert_array_equal(covariance_of(back.pose.covariance), found.covariance)


def yaws_of(make, found):
    array = read(make, make.corners("/scan/corners", MOMENT, found))
    assert array.header.frame_id == "laser_link"
    assert all(pose.orientation.x == pose.orientation.y == 0 for pose in array.poses)
    return [
        (pose.position.x, pose.position.y, 2 * math.atan2(pose.orientation.z, pose.orientation.w))
        for pose in array.poses
    ]


def test_corners_point_to_where_they_open(make):
    quarter = math.pi / 2
    sides = [segment((1, 1), (7, 1), 0, 1), segment((1, 1.5), (1, 1), 1, 3)]
    sides.append(segment((5, 5), (5, 5), 3, 5))
    cases = [
        ((1, 1), (1, 0), quarter / 2),  # arms to the right and upwards, of different lengths
        ((1, 1), (0, -1), 0),  # one side is not known
        ((1, 1.5), (-1, 1), -quarter),  # along its only segment, downwards
        ((1, 1), (-1, 1), quarter),  # at its other end, upwards
        ((2, 1), (-1, -1), 0),  # no side is known
        ((np.nan, 1), (0, 1), None),  # nowhere
        ((1e300, 1), (0, 1), None),  # where nothing is drawn
        ((5, 5), (1, 2), 0),  # in the middle of its own side
        ((1, 1.25), (1, 1), 0),  # likewise
    ]
    corners = [corner(*place, segments=known) for place, known, _ in cases]
    found = yaws_of(make, features(6, sides, corners))
    expected = [(*place, yaw) for place, _, yaw in cases if yaw is not None]
    assert found == [pytest.approx(pose) for pose in expected]
    assert yaws_of(make, features(6)) == []
    for x in (math.nan, 1e300, math.inf):  # beside impossible sides
        sides[1]["centroid"] = -x, x
        ((*_, yaw),) = yaws_of(make, features(6, sides, [corner(1, 1, segments=(0, 1))]))
        assert math.isfinite(yaw)
    sides[0]["centroid"] = 1e300, 1e300  # on the other side of one as far away
    sides[1]["centroid"] = -1e300, -1e300
    ((*_, yaw),) = yaws_of(make, features(6, sides, [corner(1, 1, segments=(0, 1))]))
    assert yaw == 0


def test_feature_cloud(make):
    numbered = Tracks(*(np.arange(n) for n in (2, 3, 1, 0, 0)), None)
    for tracks in (None, numbered):
        cloud = read(make, make.cloud("/scan/features", MOMENT, FOUND, tracks))
        points = columns_of(cloud)
        assert points.dtype == FEATURE_POINT
        assert points.tobytes() == feature_points(FOUND, tracks).tobytes()
        assert not cloud.is_dense  # one corner is nowhere
    nothing = read(make, make.cloud("/f", MOMENT, features(6)))
    assert (len(columns_of(nothing)), nothing.is_dense) == (0, True)


@pytest.mark.parametrize("level", range(4))
def test_diagnostics(make, level):
    values = {"rate [Hz]": "40.0", "": "", "größe": "1 µs"}
    texts = "lineament: /scan", "laser", level, "2 scans dropped"
    array = read(make, make.diagnostics("/diagnostics", MOMENT, *texts, values))
    (status,) = array.status
    assert (status.name, status.hardware_id, status.level, status.message) == texts
    assert {pair.key: pair.value for pair in status.values} == values


@pytest.mark.parametrize("level", [-1, 4, 256])
def test_levels_that_do_not_exist(level):
    with pytest.raises(ValueError, match=rf"level is {level}, expected 0 \(OK\), 1"):
        RosMessages().diagnostics("/diagnostics", MOMENT, "n", "h", level, "", {})


@pytest.mark.parametrize("length", range(9))
def test_frames_of_all_lengths_leave_numbers_aligned(make, length):
    found = random_features(length)
    scan = LaserScan(np.full(200, 2.0), 0.0, 2 * math.pi / 200)
    moment = MOMENT._replace(frame="f" * length, world="w" * length)
    layers = layers_of(markers_of(found, scan))
    assert len(read(make, make.features("/f", moment, layers)).markers) == 5
    assert len(read(make, make.corners("/f", moment, found)).poses) == len(found.corners)
    n = len(found.segments) + len(found.corners) + len(found.arcs)
    assert read(make, make.cloud("/f", moment, found)).width == n
    assert len(read(make, make.transform("/f", moment, (0.0, 0.0, 0.0))).transforms) == 1
    travel = Travel((1.0, 2.0, 0.0), np.eye(3), (0.0, 0.0, 0.0), np.eye(3))
    back = read(make, make.odometry("/f", moment, travel))
    np.testing.assert_array_equal(covariance_of(back.twist.covariance), np.eye(3))
    back = read(make, make.placed("/f", moment, travel.pose, np.eye(3)))
    np.testing.assert_array_equal(covariance_of(back.pose.covariance), np.eye(3))
    message = make.diagnostics("/f", moment, "n" * length, "", 0, "", {"a": "b"})
    (status,) = read(make, message).status
    assert status.name == "n" * length


def test_messages_of_ros1_in_a_file(tmp_path):
    path = tmp_path / "a.mcap"
    with McapWriter(path, RosMessages("ros1")) as writer:
        writer.write(FOUND, LaserScan(np.full(6, 2.0), 0.0, 0.1, stamp=7.5, pose=(1, 2, 0.5)))
    (scan,) = ln.open_log(path)
    assert (scan.stamp, scan.frame_id, scan.ranges.tolist()) == (7.5, "laser", [2.0] * 6)
    reader = make_reader(io.BytesIO(path.read_bytes()), validate_crcs=True)
    assert reader.get_header().profile == "ros1"
    found = [(s.name, s.encoding, c.message_encoding) for s, c, _ in reader.iter_messages()]
    names = "tf2_msgs/TFMessage", "sensor_msgs/LaserScan", "visualization_msgs/MarkerArray"
    assert found == [(name, "ros1msg", "ros1") for name in names]


def test_all_that_is_published_is_read_by_rosbags(make):
    """Of a log with poses, with odometry, a dock, diagnostics: each topic, by its type."""
    publisher, config = Taken(), LiveConfig(log="a.npz", dock=(5.0, 2.0))
    sink, pipeline = RosSink(publisher, make, config), Pipeline(config)
    walk = [(-2, 0), (-1.9, 0)]
    for scan in drive(room(), walk, SENSORS["lms181"], speed=1.0, rate=20):
        sink.publish(pipeline("a", scan.stamped("first", MOMENT.time)))
    irregular = LaserScan(scan.ranges, angles=scan.angles).stamped("first", MOMENT.time)
    sink.publish(pipeline("a", irregular))
    sink.diagnose(Report(1.0, Counts(), Counts(3, 2, 1), (0, 0), 0, {}, 0), MOMENT[:2])
    assert {message.topic for message in publisher.messages} == set(publisher.kinds)
    for message in publisher.messages:
        assert message.kind == publisher.kinds[message.topic]
        read(make, message)
