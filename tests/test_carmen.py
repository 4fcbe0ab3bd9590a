"""CARMEN logs: layouts with known values, faults, truncation, hostile lines, recordings."""

from __future__ import annotations

import gzip
import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lineament import LaserScan, LogError
from lineament.logs import open_log


def flaser(ranges, name="FLASER", pose=(1, 2, 0.5), stamp=7.5):
    words = [name, len(ranges), *ranges, *pose, 9, 9, 9, stamp, "robot", 0.1]
    return " ".join(map(str, words))


def robotlaser(ranges, remissions=(), start=-1.570796, step=0.017453, largest="50.000000"):
    header = ["ROBOTLASER1", 0, start, 3.141593, step, largest, 0.1, 0]
    tail = [4, 5, 0.25, 9, 9, 9, 0, 0, 0, 0, 0, 12.5, "robot", 0.1]
    words = [*header, len(ranges), *ranges, len(remissions), *remissions, *tail]
    return " ".join(map(str, words))


@pytest.fixture
def write(tmp_path):
    def write_log(*lines, pack=bytes):
        path = tmp_path / "test.log"
        data = b"".join((x if isinstance(x, bytes) else x.encode()) + b"\n" for x in lines)
        path.write_bytes(pack(data))
        return path

    return write_log


def same(a, b):
    return (
        np.array_equal(a.ranges, b.ranges, equal_nan=True)
        and np.array_equal(a.angles, b.angles)
        and (a.stamp, a.pose, a.range_max) == (b.stamp, b.pose, b.range_max)
    )


def test_flaser_fields(write):
    (scan,) = open_log(write(flaser([1.5, 81.83, 2.25])))
    assert scan.ranges.tolist() == [1.5, 81.83, 2.25]
    assert scan.valid.tolist() == [True, False, True]
    assert scan.angles.tolist() == pytest.approx([-math.pi / 2, 0, math.pi / 2])
    assert (scan.stamp, scan.pose, scan.frame_id) == (7.5, (1.0, 2.0, 0.5), "laser")
    assert scan.range_max == 50.0
    assert scan.intensities is None


@pytest.mark.parametrize(
    ("n", "step"), [(180, 1), (181, 1), (360, 0.5), (361, 0.5), (541, 1 / 3), (1, 180), (0, 180)]
)
def test_flaser_steps(write, n, step):
    (scan,) = open_log(write(flaser([1.0] * n)))
    assert len(scan) == n
    assert scan.angle_min == -math.pi / 2
    assert scan.angle_increment == pytest.approx(math.radians(step), rel=1e-15)


def test_param_gives_the_largest_range(write):
    path = write(
        flaser([9.0]),
        "PARAM robot_front_laser_max 8 0 host 0",
        flaser([9.0]),
        "PARAM laser_front_laser_max 20.5 0 host 0",
        "PARAM laser_rear_laser_max 4 0 host 0",
        "PARAM robot_front_laser_max off 0 host 0",
        "PARAM simulator_front_laser_max 3 0 host 0",
        flaser([9.0]),
        flaser([9.0], "RLASER"),
    )
    assert [scan.range_max for scan in open_log(path)] == [50.0, 8.0, 20.5]
    assert [scan.range_max for scan in open_log(path, "RLASER")] == [4.0]
    assert open_log(path).topics == ["FLASER", "RLASER"]


def test_robotlaser_fields(write):
    (scan,) = open_log(write(robotlaser([1.0, 2.0], [7, 8], largest=30)))
    assert (scan.angle_min, scan.angle_increment) == (-math.pi / 2, math.pi / 180)
    assert (scan.stamp, scan.pose, scan.range_max) == (12.5, (4.0, 5.0, 0.25), 30.0)
    assert scan.intensities.tolist() == [7, 8]


def test_robotlaser_without_what_it_needs(write):
    plain, partly = open_log(write(robotlaser([1, 2], largest=0), robotlaser([1, 2], [5])))
    assert plain.range_max == 50.0
    assert plain.intensities is None
    assert partly.intensities is None


@pytest.mark.parametrize(
    ("printed", "radians"),
    [
        ("0.017453", math.pi / 180),
        ("0.008727", math.pi / 360),
        ("0.004363", math.radians(0.25)),
        ("0.005818", math.radians(1 / 3)),
        ("0.006136", 0.006136),
        ("0.0174", 0.0174),
    ],
)
def test_resolution_is_snapped(write, printed, radians):
    (scan,) = open_log(write(robotlaser([1, 2], step=printed)))
    assert scan.angle_increment == radians


def test_other_messages_and_order(write):
    path = write(
        b"#comment FLASER 3",
        b"PARAM x y",
        b"ODOM 0 0 0 0 0 0 1 h 1",
        b"NEFF 1",
        b"VERTEX2 0 1 2 3",
        b"\xff\xfe\x00 garbage",
        b"",
        flaser([1.0], stamp=1),
        robotlaser([2.0]),
        "  " + flaser([3.0], stamp=3) + "\r",
        flaser([4.0], "RLASER"),
    )
    log = open_log(path)
    assert [scan.ranges[0] for scan in log] == [1.0, 2.0, 3.0]
    assert [scan.ranges[0] for scan in log] == [1.0, 2.0, 3.0]  # Once more, from the start.
    assert (len(log), log.skipped, log.faults) == (3, 0, [])
    assert log.topics == ["FLASER", "ROBOTLASER1", "RLASER"]
    assert len(open_log(path, "ROBOTLASER1")) == 1


def test_topics_that_are_not_there(write):
    path = write("ODOM 1 2", flaser([1.0], "RLASER"))
    with pytest.raises(LogError, match=r"'FLASER'; topics there are: RLASER"):
        open_log(path, "FLASER")
    with pytest.raises(LogError, match=r"'scan'; topics there are: RLASER"):
        open_log(path, "scan")
    with pytest.raises(LogError, match=r"expected FLASER or ROBOTLASER1; choose topic RLASER"):
        open_log(path)


def test_no_scans(write):
    with pytest.raises(LogError, match=r"holds ODOM \(2\), PARAM \(1\), expected FLASER or"):
        open_log(write("PARAM a b", "ODOM 1", "ODOM 2"))


FAULTS = [
    ("FLASER 180 " + "1 " * 172 + "0 0 0 0 0 0 1 h 1", "says 180 ranges and has 172 of them"),
    ("FLASER", "FLASER has 0 values, expected 10 or more"),
    ("FLASER 3 1 2", "has 3 values, expected 10 or more"),
    ("FLASER 1.5 1 2 0 0 0 0 0 0 1 h 1", "the number of ranges is '1.5', expected a whole number"),
    ("FLASER -1 1 2 0 0 0 0 0 0 1 h 1", "the number of ranges is '-1'"),
    ("FLASER 2 1 a 0 0 0 0 0 0 1 h 1", "range 2 of 2 is 'a', expected a number"),
    ("FLASER 2 1 1_0 0 0 0 0 0 0 1 h 1", "range 2 of 2 is '1_0'"),
    (b"FLASER 2 1 \xff 0 0 0 0 0 0 1 h 1", "range 2 of 2 is "),
    ("FLASER 1 1 0 nan 0 0 0 0 1 h 1", "expected three finite numbers"),
    ("FLASER 1 1 0 0 0 0 0 0 x h 1", "FLASER stamp is 'x', expected a number"),
    ("ROBOTLASER1 0 1", "has 2 values, expected 23 or more"),
    (robotlaser([1, 2], step=0), "angle_increment is 0"),
    (robotlaser([1, 2], step="inf"), "angle_increment is inf"),
    (robotlaser([1, 2]).replace(" 2 1 2", " 9 1 2"), "has 2 of them before its last 15"),
    (robotlaser([1, 2]).replace(" 2 1 2", " 99 1 2"), "says 99 ranges and has 2 of them"),
    (robotlaser([1, 2], [3, 4]).replace(" 2 3 4", " 3 3 4"), "says 3 remissions and has 2"),
]


@pytest.mark.parametrize(("line", "problem"), FAULTS)
def test_faulty_lines(write, line, problem):
    path = write("# first", flaser([1.0]), line, flaser([2.0]))
    scans = iter(open_log(path))
    assert next(scans).ranges[0] == 1.0
    with pytest.raises(LogError, match=problem) as caught:
        next(scans)
    assert caught.value.line == 3
    assert str(caught.value).startswith(f"{path}:3: ")
    log = open_log(path, keep_going=True)
    for _ in range(2):
        assert [scan.ranges[0] for scan in log] == [1.0, 2.0]
        assert (log.skipped, len(log.faults), len(log)) == (1, 1, 3)


def test_faults_are_counted_but_not_all_kept(write):
    log = open_log(write(*["FLASER 1"] * 50), keep_going=True)
    assert list(log) == []
    assert log.skipped == 50
    assert len(log.faults) == 10


def test_cut_off_gzip_delivers_whole_scans_only(write):
    rng = np.random.default_rng(1)
    text = [flaser(rng.uniform(0, 20, 20).round(2), stamp=i) for i in range(60)]
    path = write(*text, pack=gzip.compress)
    whole, data = list(open_log(path)), path.read_bytes()
    counts = []
    for cut in range(0, len(data), 37):
        path.write_bytes(data[:cut])
        try:
            log = open_log(path, keep_going=True)
        except LogError:
            counts.append(0)
            continue
        scans = list(log)
        assert all(same(a, b) for a, b in zip(scans, whole, strict=False))
        assert (log.skipped, len(log)) == (1, len(scans))
        assert "gzip data ends early" in log.faults[0]
        counts.append(len(scans))
        with pytest.raises(LogError, match=rf":{len(scans) + 1}: gzip data ends early"):
            list(open_log(path))
    assert counts == sorted(counts)
    assert counts[-1] >= 55


def test_broken_gzip(write):
    path = write(*[flaser([1.0 + i], stamp=i) for i in range(500)], pack=gzip.compress)
    data = bytearray(path.read_bytes())
    data[-6] ^= 255  # The checksum, at the very end.
    path.write_bytes(data)
    log = open_log(path, keep_going=True)
    assert [scan.stamp for scan in log] == list(range(500))
    assert log.skipped == 1
    with pytest.raises(LogError, match=":501: gzip data is broken: incorrect data check"):
        list(open_log(path))


@settings(max_examples=150, suppress_health_check=list(HealthCheck))
@given(
    st.lists(
        st.one_of(
            st.binary(max_size=60),
            st.binary(max_size=60).map(lambda b: b"FLASER " + b),
            st.binary(max_size=60).map(lambda b: b"ROBOTLASER1 0 0 1 0.1 9 0 0 1 " + b),
            st.lists(
                st.sampled_from(["FLASER", "0", "1", "2", "-1", "nan", "inf", "1e999", "1_0", "x"]),
                max_size=24,
            ).map(lambda words: " ".join(["FLASER", *words]).encode()),
        ),
        max_size=6,
    ),
    st.booleans(),
)
def test_hostile_lines_never_crash(tmp_path, hostile, keep_going):
    path = tmp_path / "hostile.log"
    path.write_bytes(b"\n".join([b"", *hostile, flaser([1.0], stamp=99).encode()]))
    try:
        log = open_log(path, keep_going=keep_going)
        scans = list(log)
    except LogError:
        assert not keep_going
    else:
        assert all(isinstance(scan, LaserScan) for scan in scans)
        assert len(log) == len(scans) + log.skipped
        assert scans[-1].stamp == 99


@settings(max_examples=60, suppress_health_check=list(HealthCheck))
@given(st.lists(st.floats(0, 100, allow_nan=False), max_size=40))
def test_ranges_are_read_to_the_last_bit(tmp_path, ranges):
    path = tmp_path / "exact.log"
    path.write_text(flaser(ranges) + "\n" + robotlaser(ranges))
    assert [scan.ranges.tolist() for scan in open_log(path)] == [ranges, ranges]


@pytest.mark.parametrize(
    ("name", "count", "beams", "pose"),
    [
        ("carmen/acapulco-corrected.log.gz", 861, 181, (0.694727, 0.0963489, 0.402857)),
        ("carmen/aces-corrected.log.gz", 440, 180, None),
        ("carmen/csail-corrected.log.gz", 406, 361, None),
        ("carmen/intel-corrected.log.gz", 910, 180, None),
        ("graph/intel-lab.log.gz", 2672, 180, (4.78, -5.84, -1.69)),
        ("graph/killian.g2o.zip", 3873, 180, (1.96, 37.867, -2.01239)),
    ],
)
def test_recordings(data_dir, name, count, beams, pose):
    log = open_log(data_dir / name)
    scans = list(log)
    assert len(scans) == len(log) == count
    assert {len(scan) for scan in scans} == {beams}
    assert {scan.range_max for scan in scans} == {50.0}
    assert {scan.angle_min for scan in scans} == {-math.pi / 2}
    assert {scan.angle_increment for scan in scans} == {math.radians(0.5 if beams > 200 else 1)}
    assert pose is None or scans[0].pose == pose
    assert np.mean([scan.valid.mean() for scan in scans]) > 0.9
