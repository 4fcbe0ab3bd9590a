"""The summary of a log, against a slow obvious twin."""

import math

import numpy as np
import pytest
from text_logs import flaser, robotlaser

from lineament import LaserScan
from lineament.logs import LogInfo, info, open_log, save_npz, summarize
from lineament.logs.base import Topic
from lineament.rosmsg.poses import POSE_TYPES, TRANSFORMS


@pytest.fixture
def summary(tmp_path):
    """Summarize scans by way of an npz log."""

    def summarized(scans):
        save_npz(tmp_path / "a.npz", scans)
        return summarize(open_log(tmp_path / "a.npz"))

    return summarized


def rows_of(found):
    (topic,) = found.topics
    return dict(topic.rows())


def test_against_all_at_once(summary, monkeypatch):
    monkeypatch.setattr(info, "_STEPS", 100)
    rng = np.random.default_rng(2)
    stamps = 100 + np.cumsum(rng.uniform(0.05, 0.15, 300))
    ranges = rng.uniform(0, 40, (300, 7))
    poses = rng.normal(size=(300, 3))
    found = summary(
        LaserScan(r, -1.0, 0.25, range_max=30, stamp=t, pose=tuple(p), frame_id="front")
        for r, t, p in zip(ranges, stamps, poses, strict=True)
    )
    (topic,) = found.topics
    valid = ranges[ranges < 30]
    assert (topic.scans, topic.beams, found.skipped) == (300, (7, 7), 0)
    assert (found.format, topic.name, topic.frame_ids) == ("npz", "ranges", ("front",))
    assert topic.field_of_view == pytest.approx(1.5)
    assert (topic.resolution, topic.full_circle, topic.backwards) == (0.25, False, 0)
    assert (topic.start, topic.duration) == (stamps[0], pytest.approx(np.ptp(stamps)))
    assert topic.rate == pytest.approx(1 / np.median(np.diff(stamps)), rel=0.1)  # Thinned.
    assert topic.valid == pytest.approx(len(valid) / ranges.size)
    assert topic.ranges == pytest.approx((valid.min(), np.median(valid), valid.max()), abs=1.01e-3)
    assert (topic.limits, topic.intensities, topic.poses) == ((0.0, 30.0), 0.0, 1.0)
    assert topic.travelled == pytest.approx(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum())


def test_text(summary):
    scans = [LaserScan([1.0, 2.0, 3.0], 0.0, math.pi / 6, stamp=t) for t in (1.0, 1.5, 2.0)]
    found = summary(scans)
    assert str(found) == "\n".join(found.lines())
    assert found.lines() == [
        f"log      {found.path} (npz: ranges)",
        "scans    3",
        "beams    3, 60°, every 30°",
        "time     1.0 s, 2 Hz",
        "ranges   1.00 to 3.00 m, median 2.00 m, 100.0 % valid",
        "poses    none",
        "frames   not named",
    ]


def test_limits_intensities_and_poses(summary):
    fields = {"intensities": [5.0, 6.0]}
    rows = rows_of(
        summary(
            LaserScan([1.0, 9.0], 0.0, 0.1, range_min=low, range_max=high, pose=pose, **fields)
            for low, high, pose in ((0.3, 8, (1, 2, 0)), (0.1, 10, None), (0.2, 5, (1, 5, 0)))
        )
    )
    assert rows["beams"] == "2, 5.73°, every 5.73°, with intensities"
    assert rows["ranges"] == "1.00 to 9.00 m, median 1.00 m, 66.7 % valid (limits 0.1 to 10 m)"
    assert rows["poses"] == "67 % of scans, 3.0 m travelled"


@pytest.mark.parametrize(
    ("stamps", "time"),
    [
        ([1.7e9, 1.7e9 + 0.1, 1.7e9 + 0.2], "2023-11-14 22:13:20 UTC, 0.2 s, 10 Hz"),
        ([1.7e9, 5, 1.7e9 + 0.1, 5.1], "1699999995.1 s, 2 stamps run backwards"),
        ([1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 9], "9.0 s, 1 Hz, 1 stamps run backwards"),
        ([1, 2, 3, 4, 5, 6, 7, 8, 9, 8], "8.0 s, 1 stamps run backwards"),
        ([5, 5, 6], "1.0 s, 1 Hz"),
        ([5, 5, 5, 6], "1.0 s, no rate: most stamps stand still"),
        ([5], "0.0 s"),
        ([0, 0], "no stamps"),
    ],
)
def test_time(summary, stamps, time):
    assert rows_of(summary(LaserScan([1.0], 0, 1, stamp=t) for t in stamps))["time"] == time


@pytest.mark.parametrize(
    ("ranges", "median"), [([7], 7), ([1, 3, 20], 3), ([1, 2, 10, 20], 6), ([1e3, 2e3, 3e3], 1e3)]
)
def test_median(summary, ranges, median):
    (topic,) = summary([LaserScan(ranges, 0.0, 0.1)]).topics
    assert topic.ranges == (ranges[0], median, ranges[-1])


def test_geometry_is_that_of_the_first_scan_with_most_beams(write):
    steps = (("0.1", 2), ("0.2", 3), ("0.3", 3), ("0.4", 1))
    text = "".join(robotlaser([1] * n, step=step) for step, n in steps)
    (topic,) = summarize(open_log(write(text))).topics
    assert (topic.beams, topic.resolution) == ((1, 3), 0.2)
    assert topic.field_of_view == pytest.approx(0.4)


def test_frames(summary):
    scans = [LaserScan([1.0], 0, 1, frame_id=name) for name in ("front", "", "rear", "front")]
    assert rows_of(summary(scans))["frames"] == (
        "front, rear: more than one scanner on this topic?"
    )


def test_no_valid_beam(summary):
    (topic,) = summary([LaserScan([np.nan, np.inf], 0.0, 0.1)] * 3).topics
    assert (topic.rate, topic.ranges, topic.valid) == (None, None, 0.0)
    assert dict(topic.rows())["ranges"] == "0.0 % valid"


def test_values_without_measure(write):
    header = "stamp,x,y,theta,angle_min,angle_increment,r0,r1\n"
    rows = [f"{stamp},{stamp},0,0,0,0.1,1,1e307\n" for stamp in (-1.7e308, 1.7e308, 0, 1.7e308)]
    (topic,) = summarize(open_log(write(header + "".join(rows)))).topics
    assert topic.ranges == (1.0, 500.5, 1e307)
    assert topic.travelled == math.inf


def test_beams_that_vary_and_faults(write):
    text = flaser([1, 1]) + "FLASER 1\n" + flaser([1] * 5) + flaser([])
    found = summarize(open_log(write(text), keep_going=True))
    (topic,) = found.topics
    assert (topic.scans, topic.beams, found.skipped) == (3, (0, 5), 1)
    assert topic.field_of_view == pytest.approx(math.pi)
    assert "beams    0 to 5, 180°, every 45°" in found.lines()
    assert found.lines()[-1] == "skipped  1"
    found = summarize(open_log(write("FLASER 1\n"), keep_going=True))
    assert found.lines()[1:] == ["holds    FLASER  1", "scans    0", "skipped  1"]


def test_several_topics(write):
    found = summarize(open_log(write("ODOM 1\n" + flaser([1]) * 2 + robotlaser([2.5]))))
    lines = found.lines()
    assert lines[:7] == [
        f"log      {found.path} (carmen)",
        "holds    FLASER       2",
        "         ODOM         1",
        "         ROBOTLASER1  1",
        "",
        "topic    FLASER",
        "scans    2",
    ]
    assert lines.count("topic    ROBOTLASER1") == 1


@pytest.mark.parametrize("kind", [*POSE_TYPES, *TRANSFORMS])
def test_what_holds_poses_is_named(summary, kind):
    (topic,) = summary([LaserScan([1.0], 0.0, 0.1)]).topics
    scan = Topic("/scan", "sensor_msgs/LaserScan", 1, 2)
    lines = LogInfo("a.bag", "rosbag1", (topic,), (scan, Topic("/odom", kind, 7))).lines()
    width = max(len(kind), len(scan.type))
    assert lines[1:3] == [
        f"holds    /scan  {scan.type:<{width}}  1, 2 publishers",
        f"         /odom  {kind:<{width}}  7",
    ]
    assert lines[-1] == "         poses are in /odom: choose with --poses"
    many = tuple(Topic(f"/t{i}", "x/Y", 1) for i in range(25))
    assert "         and 5 more topics" in LogInfo("a.bag", "rosbag1", (topic,), many).lines()


def test_items_may_be_wrapped_and_topics_are_bounded(tmp_path):
    scan = LaserScan([1.0], 0.0, 0.1)
    save_npz(tmp_path / "a.npz", [scan])
    found = summarize(open_log(tmp_path / "a.npz"), ((f"unit {i % 40}", scan) for i in range(80)))
    assert (len(found.topics), found.unread) == (32, 16)
    assert {topic.scans for topic in found.topics} == {2}
    assert "more     16 scans of further topics" in found.lines()


def test_recordings(data_dir):
    def topic_of(name):
        (topic,) = summarize(open_log(data_dir / name)).topics
        return topic

    csail = topic_of("carmen/csail-corrected.log.gz")
    assert csail.rate is None  # Its stamps are rounded to six digits.
    assert math.degrees(csail.field_of_view) == pytest.approx(180)
    intel = topic_of("graph/intel-lab.log.gz")
    assert intel.rate == pytest.approx(1.664, abs=0.01)
    assert intel.travelled == pytest.approx(360.7, abs=0.5)
    jackal = topic_of("truth/jackal_mocap_02171554.npz")
    assert (jackal.full_circle, jackal.rate) == (True, pytest.approx(9.9, abs=0.1))
