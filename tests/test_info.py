"""The summary of a log, against a slow obvious twin."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lineament import LaserScan
from lineament.logs import info as info_module
from lineament.logs import open_log, save_npz, summarize


def log_of(tmp_path, scans):
    save_npz(tmp_path / "a.npz", scans)
    return open_log(tmp_path / "a.npz")


def test_against_all_at_once(tmp_path, monkeypatch):
    monkeypatch.setattr(info_module, "_BUFFER", 100)
    rng = np.random.default_rng(2)
    stamps = 100 + np.cumsum(rng.uniform(0.05, 0.15, 300))
    ranges = rng.uniform(0, 40, (300, 7))
    poses = rng.normal(size=(300, 3))
    scans = [
        LaserScan(r, -1.0, 0.25, range_max=30, stamp=t, pose=tuple(p), frame_id="front")
        for r, t, p in zip(ranges, stamps, poses, strict=True)
    ]
    info = summarize(log_of(tmp_path, scans))
    valid = ranges[ranges < 30]
    assert (info.scans, info.beams, info.skipped) == (300, (7, 7), 0)
    assert (info.format, info.topic, info.frame_ids) == ("npz", "ranges", ("front",))
    assert info.field_of_view == pytest.approx(1.5)
    assert (info.resolution, info.full_circle) == (0.25, False)
    assert info.duration == pytest.approx(np.ptp(stamps))
    assert info.rate == pytest.approx(1 / np.median(np.diff(stamps)), rel=0.1)  # Thinned.
    assert info.valid == pytest.approx(len(valid) / ranges.size)
    assert info.ranges == pytest.approx((valid.min(), np.median(valid), valid.max()), abs=1.01e-3)
    assert info.poses == 1.0
    way = np.hypot(*np.diff(poses[:, :2], axis=0).T).sum()
    assert info.travelled == pytest.approx(way)


def test_text(tmp_path):
    scans = [LaserScan([1.0, 2.0, 3.0], 0.0, math.pi / 6, stamp=t) for t in (1.0, 1.5, 2.0)]
    info = summarize(log_of(tmp_path, scans))
    assert str(info) == "\n".join(info.lines())
    assert info.lines()[1:] == [
        "scans   3",
        "beams   3, 60°, every 30°",
        "time    1.0 s, 2 Hz",
        "ranges  1.00 to 3.00 m, median 2.00 m, 100.0 % valid",
        "poses   none",
        "frames  not named",
    ]


def test_nothing_known(tmp_path):
    scans = [LaserScan([np.nan, np.inf], 0.0, 0.1)] * 3
    info = summarize(log_of(tmp_path, scans))
    assert (info.duration, info.rate, info.ranges, info.valid) == (None, None, None, 0.0)
    assert "time    no stamps" in info.lines()


def test_beams_that_vary_and_faults(tmp_path):
    path = tmp_path / "a.log"
    tail = "0 0 0 0 0 0 5 h 0"
    path.write_text(f"FLASER 2 1 1 {tail}\nFLASER 1\nFLASER 5 1 1 1 1 1 {tail}\nFLASER 0 {tail}\n")
    info = summarize(open_log(path, keep_going=True))
    assert (info.scans, info.beams, info.skipped) == (3, (0, 5), 1)
    assert info.field_of_view == pytest.approx(math.pi)
    assert (info.duration, info.rate) == (0.0, None)
    text = str(info)
    assert "3, 1 skipped" in text
    assert "0 to 5, 180°, every 45°" in text


def test_nothing_but_faults(tmp_path):
    (tmp_path / "a.log").write_text("FLASER 1\n")
    info = summarize(open_log(tmp_path / "a.log", keep_going=True))
    assert (info.scans, info.beams, info.skipped, info.poses) == (0, (0, 0), 1, 0.0)
    assert "scans   0, 1 skipped" in str(info)


def test_scans_may_be_wrapped(tmp_path):
    log = log_of(tmp_path, [LaserScan([1.0], 0.0, 0.1)] * 5)
    seen = []
    info = summarize(log, (seen.append(scan) or scan for scan in log))
    assert info.scans == len(seen) == 5


def test_recordings(data_dir):
    csail = summarize(open_log(data_dir / "carmen" / "csail-corrected.log.gz"))
    assert csail.rate is None  # Its stamps are rounded to six digits.
    assert math.degrees(csail.field_of_view) == pytest.approx(180)
    intel = summarize(open_log(data_dir / "graph" / "intel-lab.log.gz"))
    assert intel.rate == pytest.approx(1.664, abs=0.01)
    assert intel.travelled == pytest.approx(360.7, abs=0.5)
    jackal = summarize(open_log(data_dir / "truth" / "jackal_mocap_02171554.npz"))
    assert jackal.full_circle
    assert jackal.rate == pytest.approx(9.9, abs=0.1)
