"""open_log: formats by content, one clear line for what is wrong, bounded memory, recordings."""

import gc
import gzip
import json
import math
import os
from contextlib import suppress

import numpy as np
import pytest
from text_logs import FLASER, at_most, check_fault, check_refused, csm_scan, scan_texts, zipped

from lineament import LogError
from lineament.limits import Limits
from lineament.logs import lines, open_log, summarize


@pytest.mark.parametrize("name", ["a.log", "a.npz", "a"])
@pytest.mark.parametrize("pack", [bytes, gzip.compress, b"\xef\xbb\xbf".__add__])
@pytest.mark.parametrize(
    ("kind", "n", "topics"),
    [
        ("carmen", 12, ["FLASER"]),
        ("graph", 9, ["ROBOTLASER1"]),
        ("player", 9, ["laser 1:1"]),
        ("dpslam", 12, ["Laser"]),
        ("csm", 9, ["scan"]),
        ("rplidar", 4, ["dev0", "dev1", "dev2", "dev3"]),
        ("tinyslam", 3, ["scan"]),
        ("csv", 15, ["scan"]),
        ("csv_beams", 1, ["scan"]),
    ],
)
def test_each_format_is_found_by_content(write, kind, n, topics, name, pack):
    log = open_log(str(write(scan_texts()[kind], name, pack)))
    assert log.format == kind.removesuffix("_beams")
    assert (len(log), log.topics, log.topic, log.path.name) == (n, topics, None, name)
    assert [topic for topic, _ in log.items()] == topics * (n // len(topics))
    for topic in topics:
        assert len(list(open_log(log.path, topic))) == n // len(topics)
    check_refused(rf"no topic 'x'; topics there are: {', '.join(topics)}", log.path, "x")
    np.testing.assert_array_equal(log.scan(n - 1).ranges, list(log)[-1].ranges)
    for index in (-1, n):
        with pytest.raises(LogError, match=rf"has no scan {index}, expected 0 to {n - 1}"):
            log.scan(index)


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        ("a", b"", "is empty, expected"),
        ("a", gzip.compress(b""), "is empty once decompressed"),
        ("a", b"\x1f\x8b\x08", "gzip data ends early"),
        ("a", b"\x1f\x8bnonsense that is no gzip", "gzip data is broken"),
        ("a", b"hello\nworld\n", r"is no log that lineament knows: .*CARMEN \(FLASER, ROBOTLASER1"),
        ("a", bytes(range(256)) * 300, "is no log that lineament knows"),
        ("a", zipped(readme="hello"), "is no log that lineament knows"),
        # The ending shows which reader's error helps.
        ("a.log", b"hello\n", r"is no log of CARMEN \(FLASER, ROBOTLASER1\): has no such line$"),
        ("a.json", b'{"a": 1}', r"in JSON that lineament knows: .* \(CSM\), or .* \(RPLIDAR\)$"),
        ("a.npz", b"hello\n", r"is no whole npz archive: begins with b'hell', expected b'PK\\x03"),
        ("a.npz", zipped(readme="hello"), "expected the keys"),
        ("a\nb", b"hello\n", r"a\\nb: is no log"),
    ],
)
def test_what_is_no_log(write, name, content, problem):
    with pytest.raises(LogError, match=problem) as caught:
        open_log(write(content, name))
    assert str(caught.value).isprintable()


def test_missing_directory_and_odd_paths(tmp_path):
    for path, problem in (
        (tmp_path / "missing.log", "there is no such file, expected a log"),
        (tmp_path, "is a directory, expected a log file"),
        ("nul\0byte", "is no path"),
        (None, "is no path"),
        ("x" * 5000, "cannot be read"),
    ):
        check_refused(problem, path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_pipes_are_refused_and_do_not_block(tmp_path, write):
    os.mkfifo(tmp_path / "transforms.json")
    check_refused("is no regular file", tmp_path / "transforms.json")
    # Beside a log of units, which looks there for poses.
    assert len(list(open_log(write('{"a": [[1, 2]]}', "a.json")))) == 1


@pytest.mark.parametrize("error", [PermissionError(13, "denied"), OSError(5, "I/O error")])
def test_os_errors_do_not_escape(error):
    expected = r"^a\.log: (no permission|cannot be read: I/O error)"
    with pytest.raises(LogError, match=expected), lines.reading("a.log"):
        raise error


def test_a_log_that_grows_while_it_is_read(write):
    log = open_log(write(FLASER * 3))
    count = 0
    for _ in log:
        with log.path.open("ab") as file:  # Would never end if what is new were read too.
            file.write(FLASER * 2)
        count += 1
    assert (count, len(list(log))) == (3, 9)


# Lines and pieces


def test_lines_keep_their_numbers_over_pieces_and_members(write, monkeypatch):
    monkeypatch.setattr(lines, "_PLAIN", 7)
    expected = [(i + 1, b"line %d" % i + b"x" * (i % 13)) for i in range(60)]
    text = b"\n".join(line for _, line in expected)
    for compressed, plain in ((5, b""), (64, b"\xef\xbb\xbf")):
        monkeypatch.setattr(lines, "_COMPRESSED", compressed)
        members = gzip.compress(plain + text[:100]) + gzip.compress(text[100:]) + b"\0" * 40
        assert list(lines.numbered_lines(write(members))) == expected
        assert list(lines.numbered_lines(write(plain + text))) == expected


def test_an_endless_line_is_refused(write):
    limits = Limits(line=1 << 20)
    path = write(b"one\n\n" + b"x" * (1 << 20))
    assert [number for number, _ in lines.numbered_lines(path, limits)] == [1, 3]
    for size, end in ((1 << 20) + 1, b""), (3 << 20, b"\n"):
        path = write(b"one\n" + b"x" * size + end)
        with pytest.raises(LogError, match=r":2: has \d+ bytes in a line"):
            list(lines.numbered_lines(path, limits))


def test_pieces_of_gzip_do_not_pile_up(write):
    path = write(FLASER + (b" " * 4095 + b"\n") * (1 << 11), pack=gzip.compress)
    with at_most(10):
        assert sum(len(piece) for piece in lines.chunks(path)) == len(FLASER) + (1 << 23)
        assert len(list(open_log(path))) == 1


@pytest.mark.parametrize(
    ("name", "beginning", "problem"),
    [
        ("a.csv", b"", r":1: has \d+ bytes in a line"),
        ("a.json", b'{"readings": [', ":1: JSON is broken: Expecting value"),
    ],
)
def test_a_gigabyte_without_a_scan(tmp_path, name, beginning, problem):
    path = tmp_path / name
    with path.open("wb") as file:
        file.write(beginning)
        file.truncate(1 << 30)  # A hole, which takes no space.
    with at_most(100), pytest.raises(LogError, match=problem):
        open_log(path)


# Damage


def test_a_wrong_or_missing_end_costs_no_scan(write):
    whole = gzip.compress(FLASER * 500)
    wrong = whole[:-6] + bytes([whole[-6] ^ 255]) + whole[-5:]
    for data, problem in ((wrong, "is broken: incorrect data check"), (whole[:-1], "ends early")):
        check_fault(write(data), f":501: gzip data {problem}", 500)


def test_what_a_file_holds_does_not_break_lines_or_steer_terminals(write):
    with pytest.raises(LogError, match=r"range 1 of 3 is '\\x1b\[31m', expected a number$"):
        list(open_log(write(FLASER.replace(b"1.5", b"\x1b[31m"))))
    log = open_log(write("angle_min,angle_increment,frame_id,r0\n0,1,\x1b[1m\x85,1\n"))
    assert summarize(log).lines()[-1] == r"frames   \x1b[1m\x85"


@pytest.mark.parametrize(
    "text",
    [
        "angle_deg,range\n-1e308,1\n1e308,2\n1,2\n",
        "angle_min,angle_increment,r0,r1\n1e308,0.1,1,2\n",
        "angle_min,angle_increment,r0,r1\n0.5,1e-320,1,2\n",
        json.dumps(csm_scan(theta=[-1e308, 0, 1e308])),
        json.dumps(csm_scan(theta=None, min_theta=-1e308, max_theta=1e308)),
        '{"a": [[1, -1e308], [1, 1e308]]}',
    ],
)
def test_bearings_without_measure_are_refused(write, text):
    with pytest.raises(LogError, match=r"once around|too small|expected a finite bearing"):
        list(open_log(write(text)))


@pytest.mark.parametrize(
    "member",
    [
        FLASER + b"FLASER 9\n",
        b'{"a": [[1, 2]',
        gzip.compress(b'{"a": [[1, 2],' + b"[3, 4]," * 99 + b"[5, 6]]}")[:-9],
        gzip.compress(FLASER)[:-1],
        b"#ROSBAG V2.0\n",
    ],
)
def test_temporary_copies_do_not_wait_for_the_collector(write, temporary, member):
    """An error that is kept and raised again refers to itself by its traceback."""
    path = write(zipped(member=member), "a.zip")
    gc.disable()
    try:
        for keep_going in (False, True):
            with suppress(LogError):
                list(open_log(path / "member", keep_going=keep_going))
        assert list(temporary.iterdir()) == []
    finally:
        gc.enable()


# Recordings

#: Scans by topic, their beams, and a range of the first one or its pose.
RECORDINGS = {
    "carmen/acapulco-corrected.log.gz": (861, 181, (0.694727, 0.0963489, 0.402857)),
    "carmen/aces-corrected.log.gz": (440, 180, None),
    "carmen/csail-corrected.log.gz": (406, 361, None),
    "carmen/intel-corrected.log.gz": (910, 180, None),
    "graph/intel-lab.log.gz": (2672, 180, (4.78, -5.84, -1.69)),
    "graph/killian.g2o.zip": (3873, 180, (1.96, 37.867, -2.01239)),
    "mcap/scans_demo.mcap": ({"/front_scan": 331, "/rear_scan": 330}, 726, None),
    "rosbag1/corridor_alternating_beams.bag": ({"/scan_filtered": 4752}, (179, 180), None),
    "rosbag1/demo_stationary_simple_environment.bag": ({"/scan": 1265}, 512, None),
    "rosbag1/jackal_mocap.bag": ({"/scan": 414}, 897, None),
    "rosbag1/scans_demo.bag": ({"/front_scan": 331, "/rear_scan": 330}, 726, None),
    "rosbag1/urg_handheld_v2_old.bag": ({"/scan": 360}, 681, None),
    "rosbag1/urg_v1_2.bag": ({"scan": 123}, 512, None),
    "rosbag2/jackal_mocap": ({"/scan": 189}, 897, None),
    "rosbag2/ld19": ({"/scan": 436}, (452, 456), None),
    "rosbag2/ld19/data1_nov1_0.db3": ({"/scan": 436}, (452, 456), None),
    "rosbag2/two_publishers": ({"/scan": 507}, (82, 524), None),
    "text/csm_scans.json": (1, 181, 5.000762),
    "text/dpslam_loop5.log.gz": (551, 181, 0.642),
    "text/lidar01.csv": (1, 154, 0.5335),
    "text/tinyslam_exp1.dat.gz": (756, 682, 2.229),
    "text/rplidar_kitchenette/scans_2025-09-04-16-43-09.json": (5, None, 6.095749855041504),
    "text/rplidar_kitchenette/scans_2025-09-04-16-51-11.json": (5, None, 6.096749782562256),
    "truth/fr079_graph.npz": (1464, 360, None),
    "truth/intel_graph.npz": (2672, 180, None),
    "truth/jackal_mocap_02171554.npz": (414, 897, None),
    "truth/jackal_static_data.npz": (350, 897, None),
    "truth/obstdet_front_scan.npz": (331, 726, None),
}
#: What opening says of all that is no log.
NO_LOG = {
    "README.md": "is no log that lineament knows",
    "reserved.tar.xz.enc": "is no log that lineament knows",
    "benchmark/ple_real.npz": "expected the keys ranges, .*; found azimuth",
    "benchmark/ple_sim.npz": "expected the keys ranges, .*; found azimuth",
    "graph/intel-lab.relations": "is no log that lineament knows",
    "mcap/nav2_turtlebot_no_scan.mcap": "has no LaserScan or MultiEchoLaserScan; topics there "
    r"are: /amcl_pose \(geometry_msgs/PoseWithCovarianceStamped, 135\), .*, /tf_static \(.*, 1\)$",
    "text/rplidar_kitchenette/circle1.json": "is no log in JSON that lineament knows",
    "text/rplidar_kitchenette/circle2.json": "is no log in JSON that lineament knows",
    "text/rplidar_kitchenette/transforms.json": "is no log in JSON that lineament knows",
}
#: Parts of bags, which their folders stand for, and what sqlite keeps beside databases.
PARTS = ("metadata.yaml", "-shm", "-wal")


@pytest.mark.slow
def test_each_recording_opens_or_says_why_not(data_dir):
    seen, logs = set(), 0
    folders = {path.parent for path in data_dir.rglob("metadata.yaml")}
    for path in sorted({*data_dir.rglob("*"), *folders}):
        name = path.relative_to(data_dir).as_posix()
        if (path.is_dir() and path not in folders) or name.endswith(PARTS):
            continue
        seen.add(name)
        if name in NO_LOG:
            with pytest.raises(LogError, match=NO_LOG[name]):
                open_log(path)
        else:
            logs += 1
            check_log(path, RECORDINGS.get(name))
    assert seen >= {*NO_LOG, *RECORDINGS}
    assert logs >= 24


def check_log(path, expected):
    """Check every scan of a log, and its summary, at one reading."""
    log = open_log(path)
    firsts = {}

    def checked():
        for topic, scan in log.items():
            firsts.setdefault(topic, scan)
            assert math.isfinite(scan.stamp), path
            assert len(scan) > 50, path
            assert not np.isnan(scan.angles).any(), path
            if path.parent.name in ("carmen", "graph"):
                step = math.radians(0.5 if len(scan) > 200 else 1)
                given = scan.range_max, scan.angle_min, scan.angle_increment
                assert given == (50.0, -math.pi / 2, step)
            yield topic, scan

    info = summarize(log, checked())
    counts = {topic.name: topic.scans for topic in info.topics}
    assert sum(counts.values()) == len(log) > 0, path
    assert counts.keys() == {*log.topics}
    assert all(topic.ranges is not None and topic.valid > 0.3 for topic in info.topics), path
    assert info.skipped == 0
    if expected is not None:
        count, beams, given = expected
        assert count == (counts if isinstance(count, dict) else len(log)), path
        fewest, most = beams if isinstance(beams, tuple) else (beams, beams)
        assert beams is None or all(topic.beams == (fewest, most) for topic in info.topics), path
        first = firsts[log.topics[0]]
        if isinstance(given, float):
            assert np.abs(first.ranges[first.valid] - given).min() < 1e-12
        else:
            assert given is None or first.pose == given
