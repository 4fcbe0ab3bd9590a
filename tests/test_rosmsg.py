"""The codec of ROS messages: by hand, and as rosbags and LaserScan.from_message have them."""

import math
import struct
from functools import partial
from operator import itemgetter

import numpy as np
import pytest
import ros_bags
from hypothesis import given, settings
from hypothesis import strategies as st

from lineament import LaserScan
from lineament.output.ros_messages import RosMessages
from lineament.rosmsg import definitions
from lineament.rosmsg.poses import Odometry, odometry, turn_of
from lineament.rosmsg.scans import laser_scan, multi_echo_scan, ring_scan
from lineament.rosmsg.wire import WireReader, WireWriter

both = pytest.mark.parametrize(("ros", "encoding"), [(1, "ros1"), (2, "cdr")])
floats = st.floats(width=32)
texts = st.text(st.characters(exclude_characters="\0", exclude_categories=("Cs",)), max_size=9)


# --- the wire


def packed(encoding, *fields):
    """Bytes of calls (method, arguments ...), without the beginning of CDR."""
    writer = WireWriter(encoding)
    for name, *arguments in fields:
        getattr(writer, name)(*arguments)
    assert writer.data == {"cdr": b"\0\1\0\0", "ros1": b""}[encoding] + writer.body
    return writer.body


TABLE = np.arange(6, dtype="<f4").reshape(2, 3)
ONE, MINUS = b"\0\0\0\0\0\0\xf0\x3f", b"\xff\xff\xff\xff"
BYTE = ("numbers", "B", 7)


@pytest.mark.parametrize(
    ("fields", "cdr", "ros1"),
    [
        # Numbers are aligned to their size in CDR.
        ([BYTE, ("numbers", "d", 1.0)], b"\7" + bytes(7) + ONE, b"\7" + ONE),
        ([BYTE, ("numbers", "I", 2)], b"\7\0\0\0\2\0\0\0", b"\7\2\0\0\0"),
        ([("numbers", "iI", -1, 2), BYTE], MINUS + b"\2\0\0\0\7", MINUS + b"\2\0\0\0\7"),
        # Strings end with a null byte that counts in CDR; half of a pair is no character.
        ([("text", "hé")], b"\4\0\0\0h\xc3\xa9\0", b"\3\0\0\0h\xc3\xa9"),
        ([("text", "")], b"\1\0\0\0\0", bytes(4)),
        ([("text", "\ud800")], b"\2\0\0\0?\0", b"\1\0\0\0?"),
        (
            [("header", 7, 9, "ab")],
            b"\7\0\0\0\t\0\0\0\3\0\0\0ab\0",
            bytes(4) + b"\7\0\0\0\t\0\0\0\2\0\0\0ab",
        ),
        # Elements are aligned where there are some, and written row by row.
        ([("sequence", np.ones((1, 1)))], b"\1" + bytes(7) + ONE, b"\1\0\0\0" + ONE),
        ([("sequence", np.ones((0, 2)))], bytes(4), bytes(4)),
        ([BYTE, ("raw", b"ab", 4)], b"\7\0\0\0ab", b"\7ab"),
        ([BYTE, ("raw", b"", 4)], b"\7", b"\7"),
        ([("array", TABLE)], TABLE.tobytes(), TABLE.tobytes()),
        ([("array", TABLE[:, ::2])], TABLE[:, ::2].tobytes(), TABLE[:, ::2].tobytes()),
    ],
)
def test_bytes_by_hand(fields, cdr, ros1):
    assert packed("cdr", *fields) == cdr
    assert packed("ros1", *fields) == ros1


lists = st.lists(st.floats(width=32, allow_nan=False), max_size=9)
doubles = st.tuples(*[st.floats(allow_nan=False)] * 7)


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
@given(st.integers(0, 2**31 - 1), st.lists(st.one_of(texts, lists, doubles), max_size=12))
def test_what_is_written_is_read(encoding, stamp, fields):
    writer = WireWriter(encoding)
    writer.header(stamp, 5, "laser")
    write = {
        str: writer.text,
        list: lambda field: writer.sequence(np.array(field, "<f4")),
        tuple: lambda field: writer.numbers("7d", *field),
    }
    for field in fields:
        write[type(field)](field)
    reader = WireReader(writer.data, encoding)
    time, frame = reader.header()
    assert (time, frame) == (stamp * 10**9 + 5, "laser")
    read = {
        str: reader.text,
        list: lambda: reader.floats(reader.count()).tolist(),
        tuple: lambda: reader.numbers("7d"),
    }
    assert [read[type(field)]() for field in fields] == fields
    reader.end()


def test_unknown_encodings():
    for make in (WireWriter, partial(WireReader, b""), partial(laser_scan, b""), RosMessages):
        with pytest.raises(ValueError, match="encoding is 'xcdr2', expected ros1 or cdr"):
            make("xcdr2")
    for data in (b"\0\7\0\0", b"\0\1\0"):
        with pytest.raises(ValueError, match=f"begins with '{data.hex()}', expected plain CDR"):
            WireReader(data, "cdr")
    WireReader(b"\0\1\0\0", "cdr").end()


# --- definitions


@pytest.mark.parametrize("ros", [1, 2])
def test_definitions_are_those_of_rosbags(ros):
    kinds = definitions._types(ros)
    assert {"sensor_msgs/LaserScan", "visualization_msgs/MarkerArray"} < kinds.keys()
    for kind in kinds:
        name = kind.replace("/", "/msg/")
        text, _ = ros_bags.store(ros).generate_msgdef(name, ros_version=ros)
        assert definitions.definition(kind, ros) == text


# --- LaserScan


def assert_same(scan: LaserScan, expected: LaserScan) -> None:
    names = "angle_min angle_increment range_min range_max stamp frame_id scan_time time_increment"
    for name in (*names.split(), "is_regular", "pose"):
        assert getattr(scan, name) == getattr(expected, name), name
    np.testing.assert_array_equal(scan.ranges, expected.ranges)
    np.testing.assert_equal(scan.intensities, expected.intensities)


@both
@settings(max_examples=60)
@given(st.lists(floats, min_size=1, max_size=20), texts, st.integers(0, 2**31 - 1), st.booleans())
def test_laser_scan_is_what_rosbags_makes_of_it(
    ros, encoding, ranges, frame, stamp, has_intensities
):
    intensities = ranges[::-1] if has_intensities else ()
    fields = {"time_increment": 1e-5, "scan_time": 0.1}
    message = ros_bags.Messages(ros).scan(stamp + 0.25, ranges, intensities, frame, **fields)
    data, kind, types = ros_bags.serialized(message, ros), message.__msgtype__, ros_bags.store(ros)
    read = types.deserialize_ros1 if ros == 1 else types.deserialize_cdr
    expected = LaserScan.from_message(read(data, kind))
    assert_same(laser_scan(data, encoding), expected)
    assert_same(laser_scan(memoryview(data), encoding), expected)
    if ros == 2:
        big = bytes(types.serialize_cdr(message, kind, little_endian=False))
        assert big[:2] != data[:2]
        assert_same(laser_scan(big, encoding), expected)


def scan_bytes(ranges=(1.0, 2.0), **fields):
    return ros_bags.serialized(ros_bags.Messages(2).scan(1.0, ranges, **fields), 2)


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"ranges": []}, "ranges is empty, expected at least one beam"),
        ({"angle_increment": 0.0}, "angle_increment is 0, expected a step"),
        ({"intensities": [1.0]}, "intensities has 1 values, expected 2"),
    ],
)
def test_scans_that_make_no_sense(fields, problem):
    with pytest.raises(ValueError, match=problem):
        laser_scan(scan_bytes(**fields), "cdr")


def test_oddities_of_bytes():
    signalling = scan_bytes().replace(struct.pack("<f", 2.0), b"\x01\0\x80\x7f")
    np.testing.assert_array_equal(laser_scan(signalling, "cdr").ranges, [1.0, math.nan])
    assert len(laser_scan(scan_bytes() + b"\0\0\0", "cdr")) == 2
    with pytest.raises(ValueError, match="has 4 bytes behind its last field"):
        laser_scan(scan_bytes() + b"\0\0\0\0", "cdr")


# --- MultiEchoLaserScan


beams_of_echoes = st.lists(
    st.lists(st.tuples(st.integers(1, 99), st.integers(1, 5)), max_size=4), min_size=1, max_size=12
)


@both
@pytest.mark.parametrize("echo", ["first", "last", "strongest"])
@settings(max_examples=40)
@given(beams_of_echoes, st.booleans())
def test_echoes_are_those_of_a_loop(ros, encoding, echo, beams, is_strength_known):
    key = itemgetter(1) if is_strength_known else lambda _: 0
    choose = {"first": itemgetter(0), "last": itemgetter(-1), "strongest": partial(max, key=key)}
    chosen = [choose[echo](beam) if beam else (math.nan, math.nan) for beam in beams]
    ranges, strengths = ([[float(e[i]) for e in beam] for beam in beams] for i in (0, 1))
    given = ranges, strengths if is_strength_known else []
    data = ros_bags.serialized(ros_bags.Messages(ros).echoes(5.5, *given), ros)
    scan = multi_echo_scan(data, encoding, echo)
    assert scan.stamp == 5.5
    np.testing.assert_array_equal(scan.ranges, [each[0] for each in chosen])
    if is_strength_known:
        np.testing.assert_array_equal(scan.intensities, [each[1] for each in chosen])
    else:
        assert scan.intensities is None


def read_echoes(*beams, echo="strongest"):
    data = ros_bags.serialized(ros_bags.Messages(2).echoes(1.0, *beams), 2)
    return multi_echo_scan(data, "cdr", echo)


@both
def test_echoes_of_a_damaged_message(ros, encoding):
    """The number of beams, and that of the last beam's echoes, one too large; a signalling NaN."""
    data = ros_bags.serialized(ros_bags.Messages(ros).echoes(1.0, [[1.0]]), ros)
    at = len(data) - 16  # of the number of beams: echoes and its one, and no intensities
    assert struct.unpack_from("<IIfI", data, at) == (1, 1, 1.0, 0)
    signalling = bytes(data[: at + 8]) + b"\x01\0\x80\x7f" + bytes(data[at + 12 :])
    assert np.isnan(multi_echo_scan(signalling, encoding).ranges).all()
    for place, value, problem in (
        (at, 4, "4 beams expected in 12 bytes"),
        (at, 3, "beam 2 of 3 reaches past its end|ends early"),
        (at + 4, 3, "beam 0 of 1 reaches past its end"),
        (at + 4, 2, "ends early"),
    ):
        changed = bytearray(data)
        struct.pack_into("<I", changed, place, value)
        with pytest.raises(ValueError, match=problem):
            multi_echo_scan(bytes(changed), encoding)


def test_echoes_that_are_strange():
    assert np.isnan(read_echoes([[], []], echo="last").ranges).all()
    with pytest.raises(ValueError, match="ranges is empty"):
        read_echoes([])
    with pytest.raises(ValueError, match="other numbers of echoes than ranges"):
        read_echoes([[1.0], [2.0]], [[1.0, 2.0], []])
    for strengths, expected in (([math.nan], 1.0), ([math.nan, -5.0], 2.0)):
        beam = [1.0, 2.0][: len(strengths)]
        assert read_echoes([beam], [strengths]).ranges.tolist() == [expected]


# --- PointCloud2


def cloud(points, ros=2, big_endian=False):
    return ros_bags.serialized(ros_bags.Messages(ros).cloud(3.5, points, big_endian), ros)


@both
@pytest.mark.parametrize("order", ["<", ">"])
def test_ring_of_a_cloud(ros, encoding, order):
    points = np.array(
        [[
            (0.0, 2.0, 9.0, 50.0, 1),
            (1.0, 0.0, 9.0, 60.0, 1),
            (5.0, 5.0, 9.0, 70.0, 0),
            (0.0, 1.0, 9.0, 80.0, 1),  # nearer at the same bearing
            (math.nan, 1.0, 9.0, 90.0, 1),
            (-3.0, -3.0, 9.0, 40.0, 1),
        ]],
        dtype=[(n, order + "f4") for n in ("x", "y", "z", "intensity")] + [("ring", order + "u2")],
    )  # fmt: skip
    points["x"].view(order + "u4")[0, 4] = 0x7F800001  # a NaN that the processor signals
    data = cloud(points, ros, order == ">")
    scan = ring_scan(data, encoding, 1)
    np.testing.assert_allclose(scan.angles, [-0.75 * math.pi, 0.0, 0.5 * math.pi])
    np.testing.assert_allclose(scan.ranges, [math.hypot(3, 3), 1.0, 1.0])
    assert scan.intensities.tolist() == [40.0, 60.0, 80.0]
    assert (scan.stamp, scan.frame_id, scan.is_regular) == (3.5, "laser", False)
    with pytest.raises(ValueError, match="has no points in ring 7, its rings are 0 to 1"):
        ring_scan(data, encoding, 7)


def test_a_cloud_of_one_row_may_leave_the_length_of_rows_unset():
    points = np.ones((1, 2), dtype=[("x", "f4"), ("y", "f4"), ("ring", "u2")])
    message = ros_bags.Messages(2).cloud(3.5, points)
    object.__setattr__(message, "row_step", 0)
    assert len(ring_scan(ros_bags.serialized(message, 2), "cdr", 1)) == 1


def test_rows_of_an_organised_cloud_are_its_rings():
    points = np.zeros((2, 3), dtype=[("x", "f8"), ("y", "f8")])
    points["x"] = [[1, 2, 3], [4, 5, 6]]
    points["y"] = [[-1, 0, 1], [-1, 0, 1]]
    scan = ring_scan(cloud(points), "cdr", 1)
    np.testing.assert_allclose(scan.ranges, np.hypot([4, 5, 6], [-1, 0, 1]))
    with pytest.raises(ValueError, match="has no field ring and a single row"):
        ring_scan(cloud(points[:1]), "cdr", 0)
    with pytest.raises(ValueError, match=r"has no points in ring 2$"):
        ring_scan(cloud(points), "cdr", 2)


def test_clouds_without_what_is_needed():
    points = np.ones((1, 2), dtype=[("x", "f4"), ("ring", "u1"), ("y", "f4")])
    with pytest.raises(ValueError, match="has fields ring, expected x and y"):
        ring_scan(cloud(points[["ring"]]), "cdr", 1)
    with pytest.raises(ValueError, match="has 0 bytes in 1 rows"):
        ring_scan(cloud(points[:, :0]), "cdr", 1)
    for name, value, problem in (
        ("offset", 6, "field y reaches past the 9 bytes of a point"),
        ("datatype", 9, "field y has type 9, expected 1 to 8"),
        ("datatype", 0, "field y has type 0, expected 1 to 8"),
    ):
        message = ros_bags.Messages(2).cloud(3.5, points)
        object.__setattr__(message.fields[2], name, value)
        with pytest.raises(ValueError, match=problem):
            ring_scan(ros_bags.serialized(message, 2), "cdr", 1)


# --- poses


@both
def test_odometry(ros, encoding):
    def written(x):
        return ros_bags.serialized(ros_bags.Messages(ros).odometry(7.5, x, 2.0, 3.0), ros)

    pose = pytest.approx((1.0, 2.0, 3.0))
    found = odometry(written(1.0), encoding)
    assert found == Odometry(7.5, (1.5, -0.5, 0.25), pose, "odom", "base_link")
    with pytest.raises(ValueError, match="has 4 bytes behind its last field"):
        odometry(written(1.0) + bytes(4), encoding)
    for x in (math.nan, -math.inf):
        with pytest.raises(ValueError, match=r"has pose .* and twist .*, expected finite numbers"):
            odometry(written(x), encoding)


@pytest.mark.parametrize("length", [1.0, 1e-3, 2.0, 1e6])
def test_a_quaternion_of_any_length_is_a_turn(length):
    """One that is typed by hand, z: 1, w: 1 for a quarter turn, is longer than 1."""
    for turn in (-3.0, -math.pi / 2, 0.0, 0.4, 2.5):
        level = 0.0, 0.0, length * math.sin(turn / 2), length * math.cos(turn / 2)
        assert turn_of(*level) == (pytest.approx(turn), False)
        # Turned about x by half a circle before.
        over = level[3], level[2], 0.0, 0.0
        assert turn_of(*over) == (pytest.approx(turn), True)
    assert turn_of(0.0, 0.0, 0.0, 0.0) == (0.0, False)
