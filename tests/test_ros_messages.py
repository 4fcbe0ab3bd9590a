"""Messages of ROS become scans: by hand, and as rosbags and LaserScan.from_message have them."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest
import ros_bags
from hypothesis import given, settings
from hypothesis import strategies as st

from lineament import LaserScan
from lineament.rosmsg.scans import laser_scan, multi_echo_scan, ring_scan

ENCODINGS = [(1, "ros1"), (2, "cdr")]
both = pytest.mark.parametrize(("ros", "encoding"), ENCODINGS)


def assert_same(scan: LaserScan, expected: LaserScan) -> None:
    for name in ("angle_min", "angle_increment", "range_min", "range_max", "stamp", "frame_id"):
        assert getattr(scan, name) == getattr(expected, name), name
    for name in ("scan_time", "time_increment", "is_regular", "pose"):
        assert getattr(scan, name) == getattr(expected, name), name
    np.testing.assert_array_equal(scan.ranges, expected.ranges)
    assert (scan.intensities is None) == (expected.intensities is None)
    if scan.intensities is not None:
        np.testing.assert_array_equal(scan.intensities, expected.intensities)


floats = st.floats(width=32, allow_nan=True, allow_infinity=True)


@both
@settings(max_examples=60, deadline=None)
@given(
    ranges=st.lists(floats, min_size=1, max_size=20),
    frame=st.text(max_size=9),
    stamp=st.integers(0, 2**31 - 1),
    has_intensities=st.booleans(),
)
def test_laser_scan_is_what_rosbags_makes_of_it(
    ros, encoding, ranges, frame, stamp, has_intensities
):
    frame = frame.replace("\0", "")
    intensities = ranges[::-1] if has_intensities else ()
    fields = {"time_increment": 1e-5, "scan_time": 0.1}
    message = ros_bags.Messages(ros).scan(stamp + 0.25, ranges, intensities, frame, **fields)
    data = ros_bags.serialized(message, ros)
    types = ros_bags.store(ros)
    read = types.deserialize_ros1 if ros == 1 else types.deserialize_cdr
    expected = LaserScan.from_message(read(data, message.__msgtype__))
    assert_same(laser_scan(data, encoding), expected)
    assert_same(laser_scan(memoryview(data), encoding), expected)


def test_cdr_of_the_other_byte_order():
    message = ros_bags.Messages(2).scan(7.5, [1.0, math.inf, 3.0], [9.0, 8.0, 7.0])
    little, big = (
        bytes(
            ros_bags.store(2).serialize_cdr(message, message.__msgtype__, little_endian=is_little)
        )
        for is_little in (True, False)
    )
    assert little[:2] != big[:2]
    assert_same(laser_scan(big, "cdr"), laser_scan(little, "cdr"))


@both
def test_a_scanner_that_turns_clockwise(ros, encoding):
    fields = {"angle_min": 1.0, "angle_increment": -0.5, "time_increment": 0.25}
    message = ros_bags.Messages(ros).scan(10.0, [1.0, 2.0, 4.0], [10.0, 20.0, 40.0], **fields)
    scan = laser_scan(ros_bags.serialized(message, ros), encoding)
    assert scan.ranges.tolist() == [4.0, 2.0, 1.0]
    assert scan.intensities.tolist() == [40.0, 20.0, 10.0]
    assert scan.angles.tolist() == [0.0, 0.5, 1.0]
    # The beam at bearing 1 is the first in time: 10 s.
    assert (scan.stamp, scan.time_increment) == (10.5, -0.25)


def scan_message(**fields):
    return ros_bags.Messages(2).scan(1.0, fields.pop("ranges", [1.0, 2.0]), **fields)


@pytest.mark.parametrize(
    ("message", "problem"),
    [
        (scan_message(ranges=[]), "ranges is empty, expected at least one beam"),
        (scan_message(angle_increment=math.nan), "angle_increment is nan"),
        (scan_message(angle_increment=0.0), "angle_increment is 0.0, expected > 0"),
        (scan_message(angle_min=math.inf), "angle_min is inf"),
        (scan_message(angle_increment=10.0), "more than once around"),
        (scan_message(range_min=-1.0), "range_min is -1.0"),
        (scan_message(range_max=math.nan), "range_max is nan"),
        (scan_message(intensities=[1.0]), "intensities has 1 values, expected 2"),
    ],
)
def test_scans_that_make_no_sense(message, problem):
    with pytest.raises(ValueError, match=problem):
        laser_scan(ros_bags.serialized(message, 2), "cdr")


@both
def test_every_cut_of_a_message_is_refused(ros, encoding):
    messages = ros_bags.Messages(ros)
    points = np.zeros((1, 2), dtype=[("x", "f4"), ("y", "f4"), ("ring", "u2")])
    points["x"] = 1, 2
    for message, read in (
        (messages.scan(1.0, [1.0, 2.0], [3.0, 4.0]), laser_scan),
        (messages.echoes(1.0, [[1.0], [2.0, 3.0]], [[1.0], [2.0, 3.0]]), multi_echo_scan),
        (messages.cloud(1.0, points), lambda data, encoding: ring_scan(data, encoding, 0)),
    ):
        data = ros_bags.serialized(message, ros)
        read(data, encoding)
        # A cloud ends with a flag that is not looked at.
        for end in range(len(data) - 4):
            with pytest.raises(ValueError, match=r"ends early|expected plain CDR"):
                read(data[:end], encoding)


@both
@settings(max_examples=150, deadline=None)
@given(place=st.integers(0, 10_000), word=st.integers(0, 2**32 - 1))
def test_any_word_may_be_wrong(ros, encoding, place, word):
    """Nothing but ValueError, and no memory beyond the message, whatever the lengths say."""
    messages = ros_bags.Messages(ros)
    points = np.ones((2, 2), dtype=[("x", "f4"), ("y", "f4"), ("ring", "u2")])
    for message, read in (
        (messages.scan(1.0, [1.0, 2.0], [3.0, 4.0]), laser_scan),
        (messages.echoes(1.0, [[1.0], [2.0, 3.0]], [[1.0], [2.0, 3.0]]), multi_echo_scan),
        (messages.cloud(1.0, points), lambda data, encoding: ring_scan(data, encoding, 0)),
    ):
        data = bytearray(ros_bags.serialized(message, ros))
        at = place % (len(data) - 4)
        data[at : at + 4] = struct.pack("<I", word)
        try:
            scan = read(bytes(data), encoding)
        except ValueError as error:
            assert "\n" not in str(error)  # noqa: PT017
        else:
            assert 1 <= len(scan) <= len(data)


def test_a_signalling_nan_is_a_nan():
    data = ros_bags.serialized(scan_message(), 2)
    scan = laser_scan(data.replace(struct.pack("<f", 2.0), b"\x01\0\x80\x7f"), "cdr")
    np.testing.assert_array_equal(scan.ranges, [1.0, math.nan])


def test_trailing_bytes_and_unknown_encodings():
    data = ros_bags.serialized(scan_message(), 2)
    assert len(laser_scan(data + b"\0\0\0", "cdr")) == 2
    with pytest.raises(ValueError, match="has 4 bytes behind its last field"):
        laser_scan(data + b"\0\0\0\0", "cdr")
    with pytest.raises(ValueError, match="encoding is 'json', expected ros1 or cdr"):
        laser_scan(data, "json")
    with pytest.raises(ValueError, match="begins with '00070000', expected plain CDR"):
        laser_scan(b"\0\7\0\0" + data[4:], "cdr")


ECHOES = [[1.0, 2.0, 3.0], [], [4.0], [6.0, 5.0]]
STRENGTHS = [[10.0, 30.0, 20.0], [], [1.0], [7.0, 7.0]]


@both
@pytest.mark.parametrize(
    ("echo", "ranges", "intensities"),
    [
        ("first", [1.0, math.nan, 4.0, 6.0], [10.0, math.nan, 1.0, 7.0]),
        ("last", [3.0, math.nan, 4.0, 5.0], [20.0, math.nan, 1.0, 7.0]),
        ("strongest", [2.0, math.nan, 4.0, 6.0], [30.0, math.nan, 1.0, 7.0]),
    ],
)
def test_echoes(ros, encoding, echo, ranges, intensities):
    messages = ros_bags.Messages(ros)
    data = ros_bags.serialized(messages.echoes(5.5, ECHOES, STRENGTHS), ros)
    scan = multi_echo_scan(data, encoding, echo)
    np.testing.assert_array_equal(scan.ranges, ranges)
    np.testing.assert_array_equal(scan.intensities, intensities)
    assert scan.stamp == 5.5
    bare = ros_bags.serialized(messages.echoes(5.5, ECHOES), ros)
    scan = multi_echo_scan(bare, encoding, echo)
    chosen = [1.0, math.nan, 4.0, 6.0] if echo == "strongest" else ranges
    np.testing.assert_array_equal(scan.ranges, chosen)
    assert scan.intensities is None


def test_echoes_that_are_strange():
    messages = ros_bags.Messages(2)

    def read(*beams):
        return multi_echo_scan(ros_bags.serialized(messages.echoes(1.0, *beams), 2), "cdr", "last")

    assert np.isnan(read([[], []]).ranges).all()
    with pytest.raises(ValueError, match="ranges is empty"):
        read([])
    with pytest.raises(ValueError, match="other numbers of echoes than ranges"):
        read([[1.0], [2.0]], [[1.0, 2.0], []])
    assert read([[1.0]], [[math.nan]]).ranges.tolist() == [1.0]


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.lists(st.tuples(st.integers(1, 99), st.integers(1, 5)), max_size=4),
        min_size=1,
        max_size=12,
    )
)
def test_strongest_echo_is_that_of_a_loop(beams):
    ranges, strengths = ([[float(e[i]) for e in beam] for beam in beams] for i in (0, 1))
    data = ros_bags.serialized(ros_bags.Messages(2).echoes(1.0, ranges, strengths), 2)
    expected = [max(beam, key=lambda echo: echo[1])[0] if beam else math.nan for beam in beams]
    np.testing.assert_array_equal(multi_echo_scan(data, "cdr", "strongest").ranges, expected)


def cloud(points, ros=2, big_endian=False):
    message = ros_bags.Messages(ros).cloud(3.5, points, big_endian)
    return ros_bags.serialized(message, ros)


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
    scan = ring_scan(cloud(points, ros, order == ">"), encoding, 1)
    np.testing.assert_allclose(scan.angles, [-0.75 * math.pi, 0.0, 0.5 * math.pi])
    np.testing.assert_allclose(scan.ranges, [math.hypot(3, 3), 1.0, 1.0])
    assert scan.intensities.tolist() == [40.0, 60.0, 80.0]
    assert (scan.stamp, scan.frame_id, scan.is_regular) == (3.5, "laser", False)
    with pytest.raises(ValueError, match="has no points in ring 7, its rings are 0 to 1"):
        ring_scan(cloud(points, ros, order == ">"), encoding, 7)


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
    with pytest.raises(ValueError, match="has fields ring, expected x and y"):
        ring_scan(cloud(np.zeros((1, 2), dtype=[("z", "f4"), ("ring", "u1")])), "cdr", 0)
    with pytest.raises(ValueError, match="has 0 bytes in 1 rows"):
        ring_scan(cloud(np.zeros((1, 0), dtype=[("x", "f4"), ("y", "f4")])), "cdr", 0)
