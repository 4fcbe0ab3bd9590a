"""Logs of text lines, CARMEN, graphs, DP-SLAM, tinySLAM and CSV: known values and faults."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from text_logs import (
    check_fault,
    check_refused,
    flaser,
    player_line,
    player_scan,
    robotlaser,
    tinyslam_line,
)

from lineament import LineamentWarning, LogError
from lineament.logs import open_log

# CARMEN


def test_flaser_fields(write):
    (scan,) = open_log(write(flaser([1.5, 50, 2.25, 49.99])))
    assert scan.ranges.tolist() == [1.5, 50, 2.25, 49.99]
    assert scan.valid.tolist() == [True, False, True, True]
    assert scan.angles[[0, 3]].tolist() == pytest.approx([-math.pi / 2, math.pi / 2])
    assert (scan.stamp, scan.pose, scan.frame_id) == (7.5, (1.0, 2.0, 0.5), "laser")
    assert scan.intensities is None


@pytest.mark.parametrize(
    ("n", "step"), [(180, 1), (181, 1), (360, 0.5), (361, 0.5), (541, 1 / 3), (1, 180), (0, 180)]
)
def test_flaser_steps(write, n, step):
    (scan,) = open_log(write(flaser([1.0] * n)))
    assert (len(scan), scan.angle_min) == (n, -math.pi / 2)
    assert scan.angle_increment == pytest.approx(math.radians(step), rel=1e-15)


def test_param_gives_the_largest_range(write):
    path = write(
        flaser([9.0])
        + "PARAM robot_front_laser_max 8 0 host 0\n"
        + flaser([9.0])
        + "PARAM laser_front_laser_max 20.5 0 host 0\nPARAM laser_rear_laser_max 4 0 host 0\n"
        + "".join(f"PARAM robot_front_laser_max {word} 0 h 0\n" for word in ("off", "0", "1_0"))
        + "PARAM simulator_front_laser_max 3 0 host 0\nPARAM robot_front_laser_max inf 0 h 0\n"
        + flaser([9.0])
        + flaser([9.0], "RLASER")
    )
    assert [scan.range_max for scan in open_log(path)] == [50.0, 8.0, 20.5]
    assert [scan.range_max for scan in open_log(path, "RLASER")] == [4.0]
    assert open_log(path).topics == ["FLASER", "RLASER"]


def test_robotlaser_fields(write):
    whole, plain, partly = open_log(
        write(
            robotlaser([1.0, 2.0], [7, 8], step=0.017453, largest=30)
            + robotlaser([1, 2], largest=0)
            + robotlaser([1, 2], [5])
        )
    )
    assert (whole.angle_min, whole.angle_increment) == (-math.pi / 2, math.pi / 180)
    assert (whole.stamp, whole.pose, whole.range_max) == (12.5, (4.0, 5.0, 0.25), 30.0)
    assert (whole.frame_id, whole.intensities.tolist()) == ("laser", [7, 8])
    assert (plain.range_max, plain.intensities, partly.intensities) == (50.0, None, None)


@pytest.mark.parametrize(
    ("printed", "step"),
    [
        ("0.017453", math.radians(1)),
        ("0.008727", math.radians(0.5)),
        ("0.004363", math.radians(0.25)),
        ("0.005818", math.radians(1 / 3)),
        ("0.006136", 0.006136),
        ("0.0174", 0.0174),
    ],
)
def test_steps_that_were_rounded_are_made_exact(write, printed, step):
    (scan,) = open_log(write(robotlaser(step=printed)))
    assert scan.angle_increment == step


def test_other_messages_and_order(write):
    path = write(
        b"#comment FLASER 3\nPARAM x y\nODOM 0 0 0 0 0 0 1 h 1\nNEFF 1\nVERTEX2 0 1 2 3\n"
        b"\xff\xfe\x00 garbage\n\n"
        + (flaser([1.0]) + robotlaser([2.0]) + "  " + flaser([3.0])).encode().strip(b"\n")
        + b"\r\n"
        + flaser([4.0], "RLASER").encode()
    )
    log = open_log(path)
    for _ in range(2):
        assert [scan.ranges[0] for scan in log] == [1.0, 2.0, 3.0]
    assert (len(log), log.skipped, log.faults) == (3, 0, [])
    assert log.topics == ["FLASER", "ROBOTLASER1", "RLASER"]
    assert {topic.name: topic.count for topic in log.contents()}["FLASER"] == 2
    assert [scan.ranges[0] for scan in open_log(path, "ROBOTLASER1")] == [2.0]


def test_topics_that_are_not_there(write):
    path = write("ODOM 1 2\n" + flaser([1.0], "RLASER"))
    for topic in ("FLASER", "scan"):
        check_refused(rf"'{topic}'; topics there are: RLASER", path, topic)
    check_refused(r"expected FLASER or ROBOTLASER1; choose topic RLASER", path)
    with pytest.raises(LogError, match=r"holds ODOM \(2\), PARAM \(1\), expected FLASER or"):
        open_log(write("PARAM a b\nODOM 1\nODOM 2\n"))


def faulty(good, *cases):
    return [(good, line, problem) for line, problem in cases]


@pytest.mark.parametrize(
    ("good", "line", "problem"),
    faulty(
        "# 1\n" + flaser([1.0]),
        ("FLASER 180 " + "1 " * 172 + "0 0 0 0 0 0 1 h 1", "says 180 ranges and has 172 of them"),
        ("FLASER 1 1 2 0 0 0 0 0 0 1 h 1", "says 1 ranges and has 2 of them before its last 9"),
        ("FLASER", "FLASER has 0 values, expected 10 or more"),
        ("FLASER 0 1 2 3 4 5 6 7 8", "has 9 values, expected 10 or more"),
        ("FLASER 1.5 1 2 0 0 0 0 0 0 1 h 1", "the number of ranges is '1.5', expected a whole"),
        ("FLASER -1 1 2 0 0 0 0 0 0 1 h 1", "the number of ranges is '-1'"),
        ("FLASER 1000000000 1 2 0 0 0 0 0 0 1 h 1", "the number of ranges is '1000000000'"),
        ("FLASER 2 1 a 0 0 0 0 0 0 1 h 1", "range 2 of 2 is 'a', expected a number"),
        ("FLASER 2 1 1_0 0 0 0 0 0 0 1 h 1", "range 2 of 2 is '1_0'"),
        (b"FLASER 2 1 \xff 0 0 0 0 0 0 1 h 1", r"range 2 of 2 is '\\xff'"),
        ("FLASER 1 1 0 nan 0 0 0 0 1 h 1", "expected three finite numbers"),
        ("FLASER 1 1 0 0 0 0 0 0 x h 1", "FLASER stamp is 'x', expected a number"),
        ("ROBOTLASER1 0 1", "has 2 values, expected 23 or more"),
        (robotlaser([1, 2], step=0), "angle_increment is 0"),
        (robotlaser([1, 2], step="inf"), "angle_increment is inf"),
        (robotlaser([1, 2]).replace(" 2 1 2", " 9 1 2"), "says 9 ranges and has 2 of them before"),
        (robotlaser([1, 2], [3, 4]).replace(" 2 3 4", " 3 3 4"), "says 3 remissions and has 2"),
    )
    + faulty(
        "Laser 1 1\n",
        ("Laser 3 1 2", "Laser says 3 ranges and has 2"),
        ("Laser 1 1 2", "Laser says 1 ranges and has 2"),
        ("Laser x 1 2", "Laser: the number of ranges is 'x'"),
        ("Laser 1 y", "range 1 of 1 is 'y'"),
    )
    + faulty(
        "angle_min,angle_increment,stamp,r0,r1\n0,0.1,1,1,2\n",
        ("0,0.1,1,1,2,3", "has 6 columns, expected 5"),
        ("0,0.1,x,1,2", "stamp is 'x'"),
        (",0.1,1,1,2", "angle_min and angle_increment, or angles, must be given"),
        ("0,0.1,1,1,two", "range 2 of 2 is 'two'"),
        ("0,0.1,1,1,1_0", "range 2 of 2 is '1_0'"),
        ("0,0,1,1,2", "angle_increment is 0"),
    )
    + faulty(tinyslam_line(1, [1000] * 682), ("1 2 3", "has 3 columns, expected 707")),
)
def test_faulty_lines(write, good, line, problem):
    line = line if isinstance(line, bytes) else line.strip().encode()
    row = good.splitlines()[-1].encode()
    path = write(good.encode() + line + b"\n" + row + b"\n")
    number = good.count("\n") + 1
    scans = check_fault(path, f":{number}: .*{problem}", 2)
    assert [scan.ranges[0] for scan in scans] == [1.0, 1.0]
    assert len(open_log(path)) == 3


def test_names_with_underscores_are_no_numbers_to_refuse(write):
    (scan,) = open_log(write(flaser([1.5]).replace("robot", "robot_1")))
    assert scan.ranges.tolist() == [1.5]


def test_faults_are_counted_but_not_all_kept(write):
    log = open_log(write("FLASER 1\n" * 50), keep_going=True)
    assert (list(log), log.skipped, len(log.faults)) == ([], 50, 10)


@settings(max_examples=60, suppress_health_check=list(HealthCheck))
@given(st.lists(st.floats(0, 100, allow_nan=False), max_size=40))
def test_ranges_are_read_to_the_last_bit(write, ranges):
    path = write(flaser(ranges) + robotlaser(ranges, step=0.01))
    assert [scan.ranges.tolist() for scan in open_log(path)] == [ranges, ranges]


# Graphs


def test_a_vertex_corrects_the_scan_behind_it(write):
    text = (
        "VERTEX_SE2 0 10 20 1\n"
        + robotlaser(laser=(1.5, 1.2, 0.25), robot=(1, 1, 0), stamp=5)
        + "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\nVERTEX_SE2 1 7 8 0\n"
        + robotlaser(laser=(3, 3, 1), robot=(3, 3, 1), stamp=6)
        + robotlaser(laser=(4, 3, 1), robot=(3, 3, 0), stamp=7)
    )
    scans = list(open_log(write(text)))
    # The laser is 0.5 m ahead and 0.2 m left of the robot, which was turned by 1 rad.
    place = 10 + 20j + (0.5 + 0.2j) * np.exp(1j)
    assert scans[0].pose == pytest.approx((place.real, place.imag, 1.25))
    # Both scans hang on the second vertex.
    assert [scan.pose for scan in scans[1:]] == [pytest.approx((7, 8, 0)), pytest.approx((8, 8, 1))]
    assert [scan.stamp for scan in scans] == [5, 6, 7]
    assert scans[0].angle_increment == math.pi / 2


def test_vertices_that_all_come_first_go_by_order(write):
    vertices = [f"VERTEX2 {i} {10 + i} 0 0\n" for i in range(3)]
    scans = [robotlaser(laser=(i, 5, 0), robot=(i, 5, 0)) for i in range(4)]
    log = open_log(write("".join(vertices + scans)))
    assert [scan.pose[0] for scan in log] == [10, 11, 12, 3]  # The last has its own.
    # A vertex that cannot be read leaves its scan to its pose, and moves no other.
    vertices[1] = "VERTEX2 1 x 0 0\n"
    path = write("".join(vertices + scans))
    scans = check_fault(path, ":2: .*VERTEX2 x is 'x', expected a number", 4)
    assert [scan.pose[0] for scan in scans] == [10, 1, 12, 3]


def test_one_vertex_before_several_scans_is_that_of_all(write):
    scans = [robotlaser(laser=(i, 5, 0), robot=(i, 5, 0)) for i in range(2)]
    log = open_log(write("VERTEX2 0 10 0 0\n" + "".join(scans)))
    assert [scan.pose for scan in log] == [(10, 0, 0)] * 2


def test_a_graph_without_scans(write):
    with pytest.raises(LogError, match=r"holds VERTEX2 \(1\), EDGE2 \(1\), expected ROBOTLASER1"):
        open_log(write("VERTEX2 0 1 2 3\nEDGE2 0 1 1 0 0 1 0 1 1 0 0\n"))


# Player


def test_player_fields(write):
    text = (
        player_scan(1, [(1.5, 0), (8, 0)])
        + player_line(2, "position2d", "001 +10.000 +20.000 +1.000 0 0 0 0")
        + player_line(2, "sonar", "001 2 1.0 2.0")
        + player_scan(1262304000.125, [(1.5, 7), (7.999, 9)])
        + player_scan(4, [(1, 0), (2, 0)], pose="+1.000 +2.000 +0.500")
    )
    first, second, third = log = open_log(write(text, "a.log"))
    assert (first.angle_min, first.angle_increment) == (-1.5708, math.radians(0.5))
    assert (first.valid.tolist(), first.intensities, first.frame_id) == ([1, 0], None, "laser:0")
    assert (second.ranges.tolist(), second.intensities.tolist()) == ([1.5, 7.999], [7, 9])
    assert [scan.pose for scan in (first, second, third)] == [None, (10, 20, 1), (1, 2, 0.5)]
    assert (second.stamp, log.topics) == (1262304000.125, ["laser 1:1", "laser 1:2"])


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        (" 2.000  0", " 2.000", "says 2 ranges,intensities and has 1.5 of them"),
        ("laser 00 001 001", "position2d 00 001 001 x", "position2d x is 'x'"),
    ],
)
def test_faulty_player_lines(write, old, new, problem):
    scan = player_scan(2, [(1, 0), (2, 0)])
    path = write(player_line(1, "position2d", "001 8 0 0") + scan + scan.replace(old, new) + scan)
    poses = [scan.pose for scan in check_fault(path, f":3: .*{problem}", 2)]
    assert poses == [(8, 0, 0), None]  # Behind a fault it is not known.


# DP-SLAM


def test_dpslam_fields(write):
    scans = list(
        open_log(
            write(
                "Odometry 1 2 0.5\nLaser 3 1 2 8.191\nLaser 2 8.182 8\n"
                "Odometry 3 4 0\nLaser 3 1 2 9\nLaser 1 8.183\n"
            )
        )
    )
    assert scans[0].ranges.tolist() == [1, 2, 8.191]
    assert scans[0].valid.tolist() == [True, True, False]
    assert (scans[0].angle_min, scans[0].angle_increment) == (-math.pi / 2, math.pi / 2)
    assert [scan.pose for scan in scans] == [(1, 2, 0.5)] * 2 + [(3, 4, 0)] * 2
    assert [scan.range_max for scan in scans] == [8.183, 50, 50, 8.183]
    assert {scan.stamp for scan in scans} == {0}


@pytest.mark.parametrize("line", ["Odometry 1 2", "Laser 1 5 6"])
def test_whose_pose_is_whose_is_not_known_behind_a_fault(write, line):
    path = write(f"Odometry 1 2 0\nLaser 1 5\n{line}\nLaser 1 6\n")
    scans = check_fault(path, r":3: .*has 2 (of them|values, expected 3 or more)", 2)
    assert [(scan.ranges[0], scan.pose) for scan in scans] == [(5, (1, 2, 0)), (6, None)]


# tinySLAM


def test_tinyslam_fields(write):
    (scan,) = open_log(write(tinyslam_line(212387282, [0, 7, 20, 2229, 5601, *[1000] * 677])))
    assert scan.ranges[:6].tolist() == [0, 0.007, 0.02, 2.229, 5.601, 1]
    assert scan.valid[:6].tolist() == [False, False, True, True, False, True]
    assert (scan.stamp, scan.scan_time) == (pytest.approx(212.387282), 0.1)
    assert math.degrees(scan.angle_min) == pytest.approx(-119.53125)
    assert math.degrees(scan.angles[340]) == 0  # Step 384 looks ahead.


def test_lines_that_begin_with_no_stamp_are_no_faults(write):
    log = open_log(write(tinyslam_line(1) + tinyslam_line("x1") + tinyslam_line(2)))
    assert [scan.stamp for scan in log] == [1e-6, 2e-6]


# CSV


@pytest.mark.parametrize(
    ("text", "ranges", "degrees"),
    [
        ("0.5,1.25\n0.25,2\n", [2, 1.25], [math.degrees(0.25), math.degrees(0.5)]),
        ("10;1\n355;2\n", [1, 2], [10, 355]),
        ("6.3,1\n0,2\n", [2, 1], [0, math.degrees(6.3)]),
        ("angle_deg,range\n2,5\n1,4\n", [4, 5], [1, 2]),
        ("angle_deg,angle,range\n2,0.5,5\n", [5], [math.degrees(0.5)]),
        ("angle_rad\trange\tintensity\n1\t5\t7\n", [5], [math.degrees(1)]),
        ("# made by hand\n\n'x',range,theta\n9,5,0\n9,,1\n", [5, math.nan], [0, math.degrees(1)]),
        ("Bearing,Distance\n0,1\n0,2\n", [1], [0]),
    ],
)
def test_csv_of_beams(write, text, ranges, degrees):
    (scan,) = open_log(write(text))
    np.testing.assert_array_equal(scan.ranges, ranges)
    np.testing.assert_allclose(np.degrees(scan.angles), degrees)
    assert (scan.intensities is not None) == ("intensity" in text)


def test_csv_of_even_beams_is_regular(write):
    (scan,) = open_log(write("".join(f"{math.radians(i / 2):.6f},2\n" for i in range(541))))
    assert (scan.is_regular, scan.angle_increment) == (True, math.radians(0.5))


def test_csv_of_scans(write):
    text = (
        "frame_id,stamp,x,y,theta,angle_min,angle_increment,range_max,note,r0,r1,r2\r\n"
        "front,7.5,1,2,0.5,-0.1,0.1,30,hello,1.5,,2.5\r\n"
        '"rear",8,,,,-0.1,0.1,,,1.5,2\r\n'
    )
    with pytest.warns(LineamentWarning, match="columns note are not read: expected stamp, "):
        log = open_log(write(text))
    first, second = log
    np.testing.assert_array_equal(first.ranges, [1.5, np.nan, 2.5])
    assert (first.stamp, first.frame_id, first.pose) == (7.5, "front", (1, 2, 0.5))
    assert (first.angle_min, first.angle_increment, first.range_max) == (-0.1, 0.1, 30)
    assert (second.ranges.tolist(), second.frame_id, second.pose) == ([1.5, 2], "rear", None)
    assert (second.range_max, len(log)) == (math.inf, 2)


def test_columns_of_other_names_are_a_warning(write):
    text = "time,x,y,yaw,angle_min,angle_increment,r0,r1,\n7,1,2,0.5,-0.1,0.1,1.5,2,\n"
    said = r"columns time, yaw are not read: expected stamp, range_min, .*, y, theta, frame_id, or"
    with pytest.warns(LineamentWarning, match=said) as caught:
        (scan,) = open_log(write(text))
    assert len(caught) == 1
    assert (scan.stamp, scan.pose) == (0.0, None)
    (scan,) = open_log(write(text.replace("time", "stamp").replace("yaw", "theta")))
    assert (scan.stamp, scan.pose) == (7.0, (1.0, 2.0, 0.5))


def test_faulty_csv_beams(write):
    path = write("0.1,1\n0.2\n0.3,x\nnan,2\n0.4,4\n")
    with pytest.raises(LogError, match=":2: has 1 columns, expected 2"):
        list(open_log(path))
    log = open_log(path, keep_going=True)
    assert (list(log), log.skipped) == ([], 3)  # The last is the bearing of which the scan is made.
    assert "range: value 2 of 2 is 'x', expected a number" in log.faults[1]
    assert "bearing 2 is nan" in log.faults[2]


@pytest.mark.parametrize("text", ["name,age\nx,7\n", "1,2,3\n", "# nothing\n", "angle,x\n1,2\n"])
def test_a_csv_of_something_else(write, text):
    check_refused(r"is no CSV of scans, expected rows of angle,range", write(text, "a.csv"))
    check_refused("is no log of CSV", write("angle_min,angle_increment,r0\n", "a.csv"))
