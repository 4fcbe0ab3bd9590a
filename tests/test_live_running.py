"""A node as it is configured: what it leaves behind in its process."""

from __future__ import annotations

import gc

import pytest

from lineament import LaserScan, LineamentError
from lineament.live import LiveConfig, run_live
from lineament.logs import save_npz


def is_searched_for_garbage() -> bool:
    return gc.isenabled() and not gc.get_freeze_count()


def test_garbage_is_searched_for_again_after_a_run(tmp_path):
    pytest.importorskip("foxglove", reason="needs the extra foxglove")
    path = tmp_path / "log.npz"
    save_npz(path, [LaserScan([2.0] * 5, 0.0, 0.01, stamp=i / 10) for i in range(3)])
    config = LiveConfig(log=str(path), rate=0, ros=0, foxglove=0)
    report = run_live(config, tell=[].append, show=[].append)
    assert report.total_scans == 3
    assert is_searched_for_garbage()


def test_garbage_is_searched_for_again_after_a_start_that_fails(tmp_path):
    config = LiveConfig(log=str(tmp_path / "missing.npz"), rate=0, ros=0, foxglove=0)
    with pytest.raises(LineamentError, match=r"missing\.npz"):
        run_live(config, tell=[].append)
    assert is_searched_for_garbage()
