"""The summary of a log, against a slow obvious twin."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lineament import LaserScan
from lineament.logs import LogInfo, open_log, save_npz, summarize
from lineament.logs import info as counters
from lineament.logs.base import Topic


def log_of(tmp_path, scans):
    save_npz(tmp_path / "a.npz", scans)
    return open_log(tmp_path / "a.npz")


def only_topic(info):
    (topic,) = info.topics
    return topic


def test_against_all_at_once(tmp_path, monkeypatch):
    monkeypatch.setattr(counters, "_BUFFER", 100)
    rng = np.random.default_rng(2)
    stamps = 100 + np.cumsum(rng.uniform(0.05, 0.15, 300))
    ranges = rng.uniform(0, 40, (300, 7))
    poses = rng.normal(size=(300, 3))
    scans = [
        LaserScan(r, -1.0, 0.25, range_max=30, stamp=t, pose=tuple(p), frame_id="front")
        for r, t, p in zip(ranges, stamps, poses, strict=True)
    ]
    info = summarize(log_of(tmp_path, scans))
    topic = only_topic(info)
    valid = ranges[ranges < 30]
    assert (topic.scans, topic.beams, info.skipped) == (300, (7, 7), 0)
    assert (info.format, topic.name, topic.frame_ids) == ("npz", "ranges", ("front",))
    assert topic.field_of_view == pytest.approx(1.5)
    assert (topic.resolution, topic.full_circle) == (0.25, False)
    assert topic.start == stamps[0]
    assert topic.duration == pytest.approx(np.ptp(stamps))
    assert topic.backwards == 0
    assert topic.rate == pytest.approx(1 / np.median(np.diff(stamps)), rel=0.1)  # Thinned.
    assert topic.valid == pytest.approx(len(valid) / ranges.size)
    assert topic.ranges == pytest.approx((valid.min(), np.median(valid), valid.max()), abs=1.01e-3)
    assert (topic.limits, topic.intensities, topic.poses) == ((0.0, 30.0), 0.0, 1.0)
    way = np.hypot(*np.diff(poses[:, :2], axis=0).T).sum()
    assert topic.travelled == pytest.approx(way)


def test_text(tmp_path):
    scans = [LaserScan([1.0, 2.0, 3.0], 0.0, math.pi / 6, stamp=t) for t in (1.0, 1.5, 2.0)]
    info = summarize(log_of(tmp_path, scans))
    assert str(info) == "\n".join(info.lines())
    assert info.lines() == [
        f"log      {tmp_path / 'a.npz'} (npz: ranges)",
        "scans    3",
        "beams    3, 60°, every 30°",
        "time     1.0 s, 2 Hz",
        "ranges   1.00 to 3.00 m, median 2.00 m, 100.0 % valid",
        "poses    none",
        "frames   not named",
    ]


def test_limits_and_intensities(tmp_path):
    fields = {"intensities": [5.0, 6.0]}
    scans = [
        LaserScan([1.0, 9.0], 0.0, 0.1, range_min=low, range_max=high, **fields)
        for low, high in ((0.1, 8.0), (0.2, 10.0), (0.3, 5.0))
    ]
    topic = only_topic(summarize(log_of(tmp_path, scans)))
    assert (topic.limits, topic.intensities) == ((0.1, 10.0), 1.0)
    rows = dict(topic.rows())
    assert rows["beams"] == "2, 5.73°, every 5.73°, with intensities"
    assert rows["ranges"].endswith("66.7 % valid (limits 0.1 to 10 m)")


def test_dates_and_two_clocks(tmp_path):
    stamps = [1.7e9, 5.0, 1.7e9 + 0.1, 5.1, 1.7e9 + 0.2, 5.2]
    frames = ["front", "rear"] * 3
    scans = [
        LaserScan([1.0], 0, 1, stamp=t, frame_id=f) for t, f in zip(stamps, frames, strict=True)
    ]
    topic = only_topic(summarize(log_of(tmp_path, scans)))
    assert (topic.backwards, topic.rate) == (3, None)
    rows = dict(topic.rows())
    assert rows["time"] == "1699999995.2 s, 3 stamps run backwards"
    assert rows["frames"] == "front, rear: more than one scanner on this topic?"
    topic = only_topic(summarize(log_of(tmp_path, scans[::2])))
    assert dict(topic.rows())["time"] == "2023-11-14 22:13:20 UTC, 0.2 s, 10 Hz"


def test_nothing_known(tmp_path):
    scans = [LaserScan([np.nan, np.inf], 0.0, 0.1)] * 3
    info = summarize(log_of(tmp_path, scans))
    topic = only_topic(info)
    assert (topic.duration, topic.rate, topic.ranges, topic.valid) == (None, None, None, 0.0)
    assert "time     no stamps" in info.lines()


def test_beams_that_vary_and_faults(tmp_path):
    path = tmp_path / "a.log"
    tail = "0 0 0 0 0 0 5 h 0"
    path.write_text(f"FLASER 2 1 1 {tail}\nFLASER 1\nFLASER 5 1 1 1 1 1 {tail}\nFLASER 0 {tail}\n")
    info = summarize(open_log(path, keep_going=True))
    topic = only_topic(info)
    assert (topic.scans, topic.beams, info.skipped) == (3, (0, 5), 1)
    assert topic.field_of_view == pytest.approx(math.pi)
    assert (topic.duration, topic.rate) == (0.0, None)
    assert "beams    0 to 5, 180°, every 45°" in info.lines()
    assert "skipped  1" in info.lines()


def test_nothing_but_faults(tmp_path):
    (tmp_path / "a.log").write_text("FLASER 1\n")
    info = summarize(open_log(tmp_path / "a.log", keep_going=True))
    assert (info.topics, info.skipped) == ((), 1)
    assert info.lines()[1:] == ["holds    FLASER  1", "scans    0", "skipped  1"]


def test_several_topics(tmp_path):
    path = tmp_path / "a.log"
    tail = "0 0 0 0 0 0 5 h 0"
    header = "ROBOTLASER1 0 0 1 0.5 9 0 0"
    path.write_text(
        f"ODOM 1\nFLASER 1 1 {tail}\nFLASER 1 1 {tail}\n"
        f"{header} 1 2.5 0 1 1 0 1 1 0 0 0 0 0 0 5 h 0\n"
    )
    info = summarize(open_log(path))
    assert [(topic.name, topic.scans) for topic in info.topics] == [
        ("FLASER", 2),
        ("ROBOTLASER1", 1),
    ]
    lines = info.lines()
    assert lines[:7] == [
        f"log      {path} (carmen)",
        "holds    FLASER       2",
        "         ODOM         1",
        "         ROBOTLASER1  1",
        "",
        "topic    FLASER",
        "scans    2",
    ]
    assert lines.count("topic    ROBOTLASER1") == 1


def test_what_holds_poses_is_said(tmp_path):
    topic = only_topic(summarize(log_of(tmp_path, [LaserScan([1.0], 0.0, 0.1)])))
    contents = (
        Topic("/scan", "sensor_msgs/LaserScan", 1, 2),
        Topic("/odom", "nav_msgs/Odometry", 7),
    )
    lines = LogInfo("a.bag", "rosbag1", (topic,), contents).lines()
    assert lines[1:3] == [
        "holds    /scan  sensor_msgs/LaserScan  1, 2 publishers",
        "         /odom  nav_msgs/Odometry      7",
    ]
    assert lines[-1] == "         poses are in /odom: choose with --poses"
    many = tuple(Topic(f"/t{i}", "x/Y", 1) for i in range(25))
    assert "         and 5 more topics" in LogInfo("a.bag", "rosbag1", (topic,), many).lines()


def test_topics_are_bounded(tmp_path):
    scan = LaserScan([1.0], 0.0, 0.1)
    info = summarize(log_of(tmp_path, [scan]), ((f"unit {i}", scan) for i in range(40)))
    assert (len(info.topics), info.unread) == (32, 8)
    assert "more     8 scans of further topics" in info.lines()


def test_items_may_be_wrapped(tmp_path):
    log = log_of(tmp_path, [LaserScan([1.0], 0.0, 0.1)] * 5)
    seen = []
    info = summarize(log, (seen.append(item) or item for item in log.items()))
    assert only_topic(info).scans == len(seen) == 5


def test_recordings(data_dir):
    csail = only_topic(summarize(open_log(data_dir / "carmen" / "csail-corrected.log.gz")))
    assert csail.rate is None  # Its stamps are rounded to six digits.
    assert math.degrees(csail.field_of_view) == pytest.approx(180)
    intel = only_topic(summarize(open_log(data_dir / "graph" / "intel-lab.log.gz")))
    assert intel.rate == pytest.approx(1.664, abs=0.01)
    assert intel.travelled == pytest.approx(360.7, abs=0.5)
    jackal = only_topic(summarize(open_log(data_dir / "truth" / "jackal_mocap_02171554.npz")))
    assert jackal.full_circle
    assert jackal.rate == pytest.approx(9.9, abs=0.1)
