"""Scans whose beams take longer than from scan to scan."""

import numpy as np
import pytest

import lineament as ln
from lineament import LogError
from lineament.live import LiveConfig
from lineament.live.running import run_live
from lineament.logs import open_log, save_npz
from lineament.logs.drives import one_scanner


def log_of(path, stamps, **times):
    made = [ln.LaserScan(np.full(101, 2.0), -0.5, 0.01, stamp=stamp, **times) for stamp in stamps]
    save_npz(path, made)
    return open_log(path)


TENTHS = [0.1 * k for k in range(50)]


def test_beams_that_take_far_too_long_are_an_error_where_scans_are_deskewed(tmp_path):
    log = log_of(tmp_path / "a.npz", TENTHS, time_increment=1.0)
    said = r"a\.npz: the beams of a scan take 100 s, and scans come every 0\.1 s: .*--no-deskew"
    with pytest.raises(LogError, match=said):
        next(one_scanner(log, odometry=False, deskewed=True))
    assert len(list(one_scanner(log, odometry=False))) == 50


@pytest.mark.parametrize(
    ("stamps", "times"),
    [
        (TENTHS, {"time_increment": 1.9e-3}),
        (TENTHS, {"scan_time": 1.2}),  # 1 rad of a turn
        ([0.0] * 5, {"time_increment": 1.0}),  # no stamps
        ([7.0], {"time_increment": 1.0}),
        ([0.2 * (k // 2) + 0.001 * (k % 2) for k in range(50)], {"time_increment": 1e-3}),  # pairs
        (TENTHS, {}),
    ],
)
def test_jitter_and_logs_without_stamps_are_no_error(tmp_path, stamps, times):
    log = log_of(tmp_path / "a.npz", stamps, **times)
    found = list(one_scanner(log, odometry=False, deskewed=True))
    assert [scan.stamp for scan in found] == pytest.approx(stamps)


def test_a_node_that_deskews_says_nothing_of_the_scan_that_kernels_are_tried_on(tmp_path):
    log_of(tmp_path / "a.npz", TENTHS, time_increment=1e-4)
    lines = []
    config = LiveConfig(log=str(tmp_path / "a.npz"), deskew="scans", rate=0, ros=0)
    run_live(config, write=lines.append)
    assert not any("deskewed" in line for line in lines)
