"""Every file and folder of the recordings: a log with sensible scans, or a reason that is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lineament import LogError
from lineament.logs import open_log, summarize

#: What opening says of all that is no log.
NO_LOG = {
    "README.md": "is no log that lineament knows",
    "reserved.tar.xz.enc": "is no log that lineament knows",
    "benchmark/ple_real.npz": "expected the keys ranges, .*; found azimuth",
    "benchmark/ple_sim.npz": "expected the keys ranges, .*; found azimuth",
    "graph/intel-lab.relations": "is no log that lineament knows",
    "mcap/nav2_turtlebot_no_scan.mcap": "has no LaserScan .*/amcl_pose",
    "text/rplidar_kitchenette/circle1.json": "is no CSM log",
    "text/rplidar_kitchenette/circle2.json": "is no CSM log",
    "text/rplidar_kitchenette/transforms.json": "is no CSM log",
}
#: Parts of bags, which their folders stand for, and what sqlite keeps beside databases.
PARTS = ("metadata.yaml", "-shm", "-wal")


def test_each_opens_or_says_why_not(data_dir):
    refused = set()
    logs = 0
    folders = {path.parent for path in data_dir.rglob("metadata.yaml")}
    for path in sorted({*data_dir.rglob("*"), *folders}):
        name = path.relative_to(data_dir).as_posix()
        if (path.is_dir() and path not in folders) or name.endswith(PARTS):
            continue
        if name in NO_LOG:
            refused.add(name)
            with pytest.raises(LogError, match=NO_LOG[name]):
                open_log(path)
        else:
            logs += 1
            check_log(path)
    assert refused == NO_LOG.keys()
    assert logs >= 24


def check_log(path):
    """Check every scan of a log, and what is told of them, at one reading."""
    log = open_log(path)
    counts = dict.fromkeys(log.topics, 0)

    def checked():
        for topic, scan in log.items():
            counts[topic] += 1
            assert math.isfinite(scan.stamp), path
            assert len(scan) > 50, path
            assert not np.isnan(scan.angles).any(), path
            yield topic, scan

    info = summarize(log, checked())
    assert sum(counts.values()) == len(log) > 0, path
    assert all(counts.values()), path
    assert {topic.name: topic.scans for topic in info.topics} == counts
    assert all(topic.ranges is not None and topic.valid > 0.3 for topic in info.topics), path
    assert info.skipped == 0
