"""Scans saved as logs by ending, and read back."""

from __future__ import annotations

import gzip
import math

import numpy as np
import pytest

from lineament import LaserScan, LineamentError
from lineament.logs import open_log, save_log
from lineament.simulation import SENSORS, building, drive

ENDINGS = [".npz", ".log", ".log.gz", ".LOG.GZ"]


def drive_of(sensor, n=6):
    scans = list(drive(*building(), SENSORS[sensor], seed=2, rate=0.5, moving=True))
    return scans[::4][:n]


def scan(**fields):
    given = {"range_max": 8.0, "pose": (1.0, -2.0, 0.1), "stamp": 1234567890.123456}
    return LaserScan([1.0, math.nan, 1 / 3], 0.2, 0.1, **{**given, **fields})


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("sensor", SENSORS)
def test_a_simulated_drive_comes_back_as_it_was(tmp_path, sensor, ending):
    scans = drive_of(sensor)
    path = tmp_path / f"drive{ending}"
    save_log(path, iter(scans))
    log = open_log(path)
    assert len(log) == len(scans)
    for back, one in zip(log, scans, strict=True):
        assert back.valid.tolist() == one.valid.tolist()
        np.testing.assert_array_equal(back.ranges[back.valid], one.ranges[one.valid])
        np.testing.assert_array_equal(back.angles, one.angles)
        for name in ("angle_min", "angle_increment", "range_max", "stamp", "pose", "frame_id"):
            assert getattr(back, name) == getattr(one, name)
        if log.format == "npz":
            assert back.time_increment == one.time_increment > 0
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_carmen_keeps_intensities_and_loses_what_is_invalid(tmp_path):
    one = LaserScan(
        [1.0, math.nan, 0.0, 0.05, 9.0, 2.5], 0.0, 0.1, range_min=0.1, range_max=8.0,
        intensities=[1, 2, 3, 4.5, 5, 6], pose=(0, 0, 0),
    )  # fmt: skip
    save_log(tmp_path / "a.log", [one])
    (back,) = open_log(tmp_path / "a.log")
    assert back.ranges.tolist() == [1.0, 8.0, 8.0, 8.0, 8.0, 2.5]
    assert back.valid.tolist() == one.valid.tolist()
    assert back.intensities.tolist() == [1, 2, 3, 4.5, 5, 6]


def test_the_same_scans_give_the_same_compressed_file(tmp_path):
    for name in ("a.log.gz", "b.log.gz"):
        save_log(tmp_path / name, [scan()] * 3)
    first, second = ((tmp_path / f"{name}.log.gz").read_bytes() for name in "ab")
    assert first == second
    save_log(tmp_path / "c.log", [scan()] * 3)
    assert gzip.decompress(first) == (tmp_path / "c.log").read_bytes()


@pytest.mark.parametrize("name", ["drive.bag", "drive", "drive.gz", "drive.npz.gz"])
def test_an_unknown_ending_is_told_before_the_first_scan(tmp_path, name):
    def scans():
        raise AssertionError
        yield

    with pytest.raises(ValueError, match=r"expected \.npz or \.log or \.log\.gz"):
        save_log(tmp_path / name, scans())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("scans", "problem"),
    [
        ([], "no scans"),
        ([scan(), scan(pose=None)], "scan 1 has no pose"),
        ([scan(range_max=math.inf)], "scan 0 has no finite range_max"),
        ([LaserScan([1, 2], angles=[0, 1], range_max=8, pose=(0, 0, 0))], "irregular bearings"),
    ],
)
def test_what_carmen_cannot_hold_leaves_nothing(tmp_path, scans, problem):
    with pytest.raises(ValueError, match=problem):
        save_log(tmp_path / "a.log", scans)
    assert list(tmp_path.iterdir()) == []


def test_what_was_there_stays_when_a_drive_breaks_off(tmp_path):
    def broken():
        yield scan()
        raise KeyboardInterrupt

    path = tmp_path / "a.log.gz"
    save_log(path, [scan()])
    before = path.read_bytes()
    with pytest.raises(KeyboardInterrupt):
        save_log(path, broken())
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["a.log.gz"]
    with pytest.raises(LineamentError, match="does not exist"):
        save_log(tmp_path / "missing" / "a.log", [scan()])
