"""Logs of text lines: each format with known values and faults, and recordings of all."""

from __future__ import annotations

import gzip
import math

import numpy as np
import pytest
from text_logs import robotlaser, scan_texts, tinyslam_line

from lineament import LogError
from lineament.logs import open_log

UNITS = "rplidar_kitchenette"


@pytest.mark.parametrize("pack", [bytes, gzip.compress, b"\xef\xbb\xbf".__add__])
@pytest.mark.parametrize(
    ("name", "n", "topics"),
    [
        ("carmen", 12, ["FLASER"]),
        ("graph", 9, ["ROBOTLASER1"]),
        ("dpslam", 12, ["Laser"]),
        ("csm", 9, ["scan"]),
        ("rplidar", 4, ["dev0", "dev1", "dev2", "dev3"]),
        ("tinyslam", 3, ["scan"]),
        ("csv", 15, ["scan"]),
        ("csv_beams", 1, ["scan"]),
    ],
)
def test_each_format_is_found_by_content(write, name, n, topics, pack):
    log = open_log(write(scan_texts()[name], "without-ending", pack))
    assert log.format == name.removesuffix("_beams")
    assert (len(log), log.topics) == (n, topics)
    items = list(log.items())
    assert {topic for topic, _ in items} == set(topics)
    assert len(items) == n
    for topic in topics:
        assert len(list(open_log(log.path, topic))) == n // len(topics)
    with pytest.raises(LogError, match=rf"no topic 'x'; topics there are: {', '.join(topics)}"):
        open_log(log.path, "x")


# Graphs


def test_a_vertex_corrects_the_scan_behind_it(write):
    text = (
        "VERTEX_SE2 0 10 20 1.5707963267948966\n"
        + robotlaser((1.5, 1, 0.25), (1, 1, 0), 5)
        + "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\nVERTEX_SE2 1 7 8 0\n"
        + robotlaser((3, 3, 1), (3, 3, 1), 6)
        + robotlaser((4, 3, 1), (3, 3, 0), 7)
    )
    scans = list(open_log(write(text)))
    # The laser is 0.5 m ahead of the robot, which was turned to look along y.
    assert scans[0].pose == pytest.approx((10, 20.5, math.pi / 2 + 0.25))
    # Both scans hang on the second vertex.
    assert [scan.pose for scan in scans[1:]] == [pytest.approx((7, 8, 0)), pytest.approx((8, 8, 1))]
    assert [scan.stamp for scan in scans] == [5, 6, 7]
    assert scans[0].angle_increment == math.pi / 2


def test_vertices_that_all_come_first_go_by_order(write):
    vertices = [f"VERTEX2 {i} {10 + i} 0 0\n" for i in range(3)]
    scans = [robotlaser((i, 5, 0), (i, 5, 0), i) for i in range(4)]
    log = open_log(write("".join(vertices + scans)))
    assert [scan.pose[0] for scan in log] == [10, 11, 12, 3]  # The last has its own.
    # A vertex that cannot be read leaves its scan to its own pose, and moves no other.
    vertices[1] = "VERTEX2 1 x 0 0\n"
    log = open_log(write("".join(vertices + scans)), keep_going=True)
    assert [scan.pose[0] for scan in log] == [10, 1, 12, 3]
    assert (log.skipped, len(log)) == (1, 4)
    with pytest.raises(LogError, match=":2: VERTEX2 x is 'x', expected a number"):
        list(open_log(log.path))


def test_a_graph_without_scans(write):
    with pytest.raises(LogError, match=r"holds VERTEX2 \(1\), EDGE2 \(1\), expected ROBOTLASER1"):
        open_log(write("VERTEX2 0 1 2 3\nEDGE2 0 1 1 0 0 1 0 1 1 0 0\n"))


# DP-SLAM


def test_dpslam_fields(write):
    first, second = open_log(
        write("Odometry 1 2 0.5\nLaser 3 1 2 8.191\nOdometry 3 4 0\nLaser 3 1 2 9\n")
    )
    assert first.ranges.tolist() == [1, 2, 8.191]
    assert (first.pose, first.range_max, first.stamp) == ((1, 2, 0.5), 8.183, 0)
    assert first.valid.tolist() == [True, True, False]
    assert (first.angle_min, first.angle_increment) == (-math.pi / 2, math.pi / 2)
    assert (second.pose, second.range_max) == ((3, 4, 0), 50)


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("Laser 3 1 2", "Laser says 3 ranges and has 2"),
        ("Laser x 1 2", "Laser: the number of ranges is 'x'"),
        ("Laser 1 y", "range 1 of 1 is 'y'"),
        ("Odometry 1 2", "Odometry has 2 values, expected 3 or more"),
    ],
)
def test_faulty_dpslam_lines(write, line, problem):
    path = write(f"Odometry 1 2 0\nLaser 1 5\n{line}\nLaser 1 6\n")
    with pytest.raises(LogError, match=f":3: {problem}"):
        list(open_log(path))
    log = open_log(path, keep_going=True)
    # Whose pose is whose is not known behind a fault.
    assert [(scan.ranges[0], scan.pose) for scan in log] == [(5, (1, 2, 0)), (6, None)]
    assert log.skipped == 1


# tinySLAM


def test_tinyslam_fields(write):
    (scan,) = open_log(write(tinyslam_line(212387282, [0, 7, 2229, 5601, *[1000] * 678])))
    assert scan.ranges[:5].tolist() == [0, 0.007, 2.229, 5.601, 1]
    assert scan.valid[:5].tolist() == [False, False, True, False, True]
    assert scan.stamp == pytest.approx(212.387282)
    assert math.degrees(scan.angle_min) == pytest.approx(-119.53125)
    assert math.degrees(scan.angles[340]) == 0  # Step 384 looks ahead.


def test_faulty_tinyslam_lines(write):
    path = write(tinyslam_line(1) + "1 2 3\n" + tinyslam_line("x1") + tinyslam_line(2))
    with pytest.raises(LogError, match=":2: has 3 columns, expected 707"):
        list(open_log(path))
    log = open_log(path, keep_going=True)
    assert [scan.stamp for scan in log] == [1e-6, 2e-6]


# CSV


@pytest.mark.parametrize(
    ("text", "ranges", "degrees"),
    [
        ("0.5,1.25\n0.25,2\n", [2, 1.25], [math.degrees(0.25), math.degrees(0.5)]),
        ("10;1\n355;2\n", [1, 2], [10, 355]),
        ("angle_deg,range\n2,5\n1,4\n", [4, 5], [1, 2]),
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
    text = "".join(f"{math.radians(i / 2):.6f},{2 + i}\n" for i in range(541))
    (scan,) = open_log(write(text))
    assert scan.is_regular
    assert scan.angle_increment == math.radians(0.5)


def test_csv_of_scans(write):
    text = (
        "frame_id,stamp,x,y,theta,angle_min,angle_increment,range_max,note,r0,r1,r2\r\n"
        "front,7.5,1,2,0.5,-0.1,0.1,30,hello,1.5,,2.5\r\n"
        '"rear",8,,,,-0.1,0.1,,,1.5,2\r\n'
    )
    log = open_log(write(text))
    first, second = log
    np.testing.assert_array_equal(first.ranges, [1.5, np.nan, 2.5])
    assert (first.stamp, first.frame_id, first.pose) == (7.5, "front", (1, 2, 0.5))
    assert (first.angle_min, first.angle_increment, first.range_max) == (-0.1, 0.1, 30)
    assert (second.ranges.tolist(), second.frame_id, second.pose) == ([1.5, 2], "rear", None)
    assert second.range_max == math.inf
    assert len(log) == 2


@pytest.mark.parametrize(
    ("row", "problem"),
    [
        ("1,0,0.1,1,2,3", "has 6 columns, expected 5"),
        ("x,0,0.1,1,2", "stamp is 'x'"),
        ("1,,0.1,1,2", "angle_min and angle_increment, or angles, must be given"),
        ("1,0,0.1,1,two", "range 2 of 2 is 'two'"),
        ("1,0,-0.1,1,2", "angle_increment is -0.1"),
    ],
)
def test_faulty_csv_rows(write, row, problem):
    path = write(f"stamp,angle_min,angle_increment,r0,r1\n1,0,0.1,1,2\n{row}\n2,0,0.1,1,2\n")
    with pytest.raises(LogError, match=f":3: {problem}"):
        list(open_log(path))
    log = open_log(path, keep_going=True)
    assert [scan.stamp for scan in log] == [1, 2]
    assert (log.skipped, len(log)) == (1, 3)


def test_faulty_csv_beams(write):
    path = write("0.1,1\n0.2\n0.3,x\nnan,2\n0.4,4\n")
    with pytest.raises(LogError, match=":2: has 1 columns, expected 2"):
        list(open_log(path))
    log = open_log(path, keep_going=True)
    assert list(log) == []
    assert log.skipped == 3  # The last of them is the bearing, of which the scan is made.
    assert "bearing 2 is nan" in log.faults[2]


def test_a_csv_of_something_else(write):
    with pytest.raises(LogError, match=r"is no CSV .*a\.csv|a\.csv: is no CSV"):
        open_log(write("name,age\nx,7\n", "a.csv"))


# Recordings


@pytest.mark.parametrize(
    ("name", "kind", "count", "beams", "valid", "seen"),
    [
        ("csm_scans.json", "csm", 1, 181, 181, 5.000762),
        ("dpslam_loop5.log.gz", "dpslam", 551, 181, 170, 0.642),
        ("lidar01.csv", "csv", 1, 154, 154, 0.5335),
        ("tinyslam_exp1.dat.gz", "tinyslam", 756, 682, 214, 2.229),
        (f"{UNITS}/scans_2025-09-04-16-43-09.json", "rplidar", 5, 603, 603, 6.095749855041504),
        (f"{UNITS}/scans_2025-09-04-16-51-11.json", "rplidar", 5, 598, 598, 6.096749782562256),
    ],
)
def test_recordings(data_dir, name, kind, count, beams, valid, seen):
    log = open_log(data_dir / "text" / name)
    scans = list(log)
    assert (log.format, len(scans), len(log), len(scans[0])) == (kind, count, count, beams)
    # The first range of the file, among as many as its codes leave.
    assert scans[0].valid.sum() == valid
    assert np.abs(scans[0].ranges[scans[0].valid] - seen).min() < 1e-12
