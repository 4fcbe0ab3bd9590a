"""Rerun: its own reader finds the file whole, and in it what was written."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections import namedtuple
from pathlib import Path

import pytest
from handmade import arc, corner, features, segment

from lineament import LaserScan, LineamentError
from lineament.output import open_writer

pytest.importorskip("rerun")

FOUND = features(
    6,
    segments=[segment((1, 0), (1, 2), 0, 1), segment((0, 3), (-1, 3), 1, 3)],
    corners=[corner(1, 2), corner(-1, 3, kind="edge")],
    arcs=[arc(2, 1, 0.25, 0, 1)],
)


def rerun(*arguments):
    command = [str(Path(sys.executable).with_name("rerun")), "rrd", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_recording_is_whole_and_has_everything(tmp_path):
    path = tmp_path / "a.rrd"
    with open_writer(path) as writer:
        for k in range(250):
            scan = LaserScan([2.0] * 6, 0.0, 0.1, stamp=0.5 * k, pose=(k, 0.0, 0.1))
            writer.write(FOUND, scan)
    rerun("verify", path)
    told = rerun("stats", path)
    for entity in ("", "/points", "/segments", "/arcs", "/corners", "/edges", "/ellipses"):
        assert f"/world/scan{entity}: " in told
    assert "num_rows = 1 750" in told.replace("\u2009", " ")
    assert "log_time" not in told
    assert "stamp" in told


def test_full_disk_is_told_before_rerun_meets_it(tmp_path, monkeypatch):
    path, scan = tmp_path / "a.rrd", LaserScan([2.0] * 6, 0.0, 0.1)
    full = namedtuple("usage", "total used free")(1, 1, 0)
    with open_writer(path) as writer:
        writer.write(FOUND, scan)
    path.unlink()
    monkeypatch.setattr(shutil, "disk_usage", lambda _: full)
    with pytest.raises(LineamentError, match=r"a\.rrd: cannot be written: less than 32") as told:
        open_writer(path).__enter__()
    assert "\n" not in str(told.value)
    assert not list(tmp_path.iterdir())
