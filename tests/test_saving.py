"""Scans saved as npz and CARMEN logs, and npz logs read: round trips, keys, shapes, damage."""

import gzip
import math

import numpy as np
import pytest
from text_logs import check_fault, check_refused, zipped

from lineament import LaserScan, LineamentError, LogError
from lineament.logs import open_log, save_log, save_npz
from lineament.simulation import SENSORS, building, drive

ENDINGS = [".npz", ".log", ".log.gz", ".LOG.GZ"]
GOOD = {"ranges": np.ones((4, 3)), "angle_min": 0.0, "angle_increment": 0.1}


def scan(**fields):
    given = {"range_max": 8.0, "pose": (1.0, -2.0, 0.1), "stamp": 1234567890.123456}
    bearings = {} if "angles" in fields else {"angle_min": 0.2, "angle_increment": 0.1}
    return LaserScan([1.0, math.nan, 1 / 3], **{**bearings, **given, **fields})


def names(folder):
    return [file.name for file in folder.iterdir()]


# Any format


@pytest.mark.slow
@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("sensor", SENSORS)
def test_a_simulated_drive_comes_back_as_it_was(tmp_path, sensor, ending):
    scans = list(drive(*building(), SENSORS[sensor], seed=2, rate=0.5, moving=True))[:21:4]
    path = tmp_path / f"drive{ending}"
    save_log(path, iter(scans))
    log = open_log(path)
    assert len(log) == len(scans) > 3
    for back, one in zip(log, scans, strict=True):
        assert back.valid.tolist() == one.valid.tolist()
        np.testing.assert_array_equal(back.ranges[back.valid], one.ranges[one.valid])
        np.testing.assert_array_equal(back.angles, one.angles)
        for name in ("angle_min", "angle_increment", "range_max", "stamp", "pose", "frame_id"):
            assert getattr(back, name) == getattr(one, name)
        if log.format == "npz":
            assert back.time_increment == one.time_increment > 0
    assert names(tmp_path) == [path.name]


@pytest.mark.parametrize("name", ["drive.bag", "drive", "drive.gz", "drive.npz.gz"])
def test_an_unknown_ending_is_reported_before_the_first_scan(tmp_path, name):
    def scans():
        raise AssertionError
        yield

    with pytest.raises(ValueError, match=r"expected \.npz or \.log or \.log\.gz"):
        save_log(tmp_path / name, scans())
    assert names(tmp_path) == []


IRREGULAR = scan(angles=[0, 1, 3])


@pytest.mark.parametrize(
    ("name", "scans", "problem"),
    [
        ("a.log", [], "no scans"),
        ("a.log", [scan(), scan(pose=None)], "scan 1 has no pose"),
        ("a.log", [scan(range_max=math.inf)], "scan 0 has no finite range_max"),
        ("a.log", [IRREGULAR], "irregular bearings"),
        ("a.npz", [], "no scans"),
        ("a.npz", [LaserScan([], 0.0, 0.1)], "scan 0 has no beams"),
        ("a.npz", [scan(), scan(angle_min=0.0)], "scan 1 has other bearings than scan 0"),
        ("a.npz", [scan(), LaserScan([1.0], 0.0, 0.1)], "scan 1 has other bearings"),
        ("a.npz", [scan(), IRREGULAR], "scan 1 has other bearings"),
        ("a.npz", [scan(), scan(intensities=[1, 2, 3])], "only one of them has intensities"),
    ],
)
def test_what_cannot_be_saved_leaves_nothing(tmp_path, name, scans, problem):
    with pytest.raises(ValueError, match=problem):
        save_log(tmp_path / name, scans)
    assert names(tmp_path) == []


def test_what_was_there_stays_when_a_drive_breaks_off(tmp_path):
    def broken():
        yield scan()
        raise KeyboardInterrupt

    for ending in ENDINGS[:3]:
        path = tmp_path / f"a{ending}"
        save_log(path, [scan()])
        before = path.read_bytes()
        with pytest.raises(KeyboardInterrupt):
            save_log(path, broken())
        assert path.read_bytes() == before
        with pytest.raises(LineamentError, match="does not exist"):
            save_log(tmp_path / "missing" / f"a{ending}", [scan()])
    assert sorted(names(tmp_path)) == ["a.log", "a.log.gz", "a.npz"]


# CARMEN


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
    words = (tmp_path / "a.log").read_text().splitlines()[-1].split()
    assert float(words[3]) == 0.5  # The field of view, which readers need not believe.


def test_the_same_scans_give_the_same_compressed_file(tmp_path):
    for name in ("a.log.gz", "b.log.gz", "c.log"):
        save_log(tmp_path / name, [scan()] * 3)
    first, second, plain = ((tmp_path / name).read_bytes() for name in sorted(names(tmp_path)))
    assert first == second
    assert gzip.decompress(first) == plain
    assert first[4:8] == bytes(4)  # The time.


# npz


@pytest.mark.parametrize(
    "fields",
    [
        [{}, {}],
        [{"range_min": 0.2, "range_max": 30.0, "scan_time": 0.1, "time_increment": 1e-5}] * 3,
        [{"range_max": 30.0, "frame_id": "a"}, {"range_max": 20.0, "frame_id": "long name"}],
        [{"pose": (1.0, 2.0, 3.0)}, {"pose": None}, {"pose": (0.0, 0.0, 0.0)}],
        [{"intensities": [1, 2, 4.5]}] * 2,
        [{"angles": [0, 0.1, 0.35]}] * 2,
    ],
)
def test_npz_round_trip(tmp_path, fields):
    scans = [scan(stamp=10.0 + i, **more) for i, more in enumerate(fields)]
    save_npz(tmp_path / "a.npz", iter(scans), source="a test")
    log = open_log(tmp_path / "a.npz", "ranges")
    assert (log.format, log.topics, log.topic) == ("npz", ["ranges"], "ranges")
    assert len(log) == len(scans)
    for _ in range(2):
        for a, b in zip(log, scans, strict=True):
            for name in ("ranges", "angles", "intensities"):
                np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
            for name in (
                *("range_min", "range_max", "stamp", "scan_time", "time_increment"),
                *("frame_id", "pose", "is_regular"),
            ):
                assert getattr(a, name) == getattr(b, name)
    with np.load(tmp_path / "a.npz") as archive:
        assert archive["source"] == "a test"
        assert archive["ranges"].dtype == np.float64  # 1 / 3 would not survive float32.


def test_covariances_of_poses_are_kept(tmp_path):
    known = np.diag((0.01, 0.02, 0.03)) + 0.001
    scans = [scan(stamp=1.0).with_pose((1, 2, 3), known), scan(stamp=2.0).with_pose((4, 5, 6))]
    save_npz(tmp_path / "a.npz", [*scans, scan(stamp=3.0).with_pose(None)])
    first, second, third = open_log(tmp_path / "a.npz")
    np.testing.assert_array_equal(first.pose_covariance, known)
    assert (second.pose, second.pose_covariance) == ((4, 5, 6), None)
    assert (third.pose, third.pose_covariance) == (None, None)
    save_npz(tmp_path / "b.npz", scans[1:])
    with np.load(tmp_path / "b.npz") as archive:
        assert "pose_covariances" not in archive


def test_float32_stays_float32(tmp_path):
    save_npz(tmp_path / "a.npz", [LaserScan(np.float32([0.1, 0.2]), 0.0, 0.1)])
    with np.load(tmp_path / "a.npz") as archive:
        assert archive["ranges"].dtype == np.float32


@pytest.mark.parametrize(
    ("extra", "problem"),
    [
        ({"stamps": [1.0]}, "extra key stamps is one of the log's own"),
        ({"source": object()}, "extra key source holds objects"),
    ],
)
def test_extra_keys_that_npz_cannot_hold(tmp_path, extra, problem):
    with pytest.raises(ValueError, match=problem):
        save_npz(tmp_path / "a.npz", [scan()], **extra)
    assert names(tmp_path) == []


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"ranges": None}, "expected the keys ranges, .*found angle_min, angle_increment"),
        ({"angle_min": None}, "expected the keys ranges, and angle_min with angle_increment"),
        ({"ranges": np.ones(3)}, r"ranges has shape \(3,\), expected \(scans, beams\)"),
        ({"ranges": np.ones((0, 3))}, "ranges has no scans"),
        ({"ranges": np.ones((10**18, 0))}, "has 1000000000000000000 scans"),  # In no space.
        ({"ranges": np.ones((4, 0))}, "ranges has no beams"),
        ({"ranges": np.array([["a"]])}, "ranges has type <U1, expected numbers"),
        ({"ranges": np.ones((4, 3), complex)}, "ranges has type complex128"),
        ({"ranges": np.array([[None]])}, "is no whole npz archive: ValueError: Object arrays"),
        ({"angle_min": np.zeros(4)}, r"angle_min has shape \(4,\), expected \(\)"),
        ({"angles": np.zeros(4)}, r"angles has shape \(4,\), expected \(3,\)"),
        ({"stamps": np.zeros(3)}, r"stamps has shape \(3,\), expected \(4,\)"),
        ({"poses": np.zeros((4, 2))}, r"poses has shape \(4, 2\), expected \(4, 3\)"),
        ({"range_max": np.ones(2)}, r"range_max has shape \(2,\), expected \(\) or \(4,\)"),
        ({"frame_id": 3}, "frame_id has type int64, expected text"),
        ({"frame_id": np.array([0x110000], ">u4").view(">U1")[0:1].repeat(4)}, "do not exist"),
    ],
)
def test_wrong_keys(tmp_path, change, problem):
    arrays = {key: value for key, value in {**GOOD, **change}.items() if value is not None}
    np.savez(tmp_path / "a.npz", **arrays)
    check_refused(problem, tmp_path / "a.npz")


def test_a_member_that_is_no_array(tmp_path, write):
    np.savez(tmp_path / "a.npz", **GOOD)
    with np.load(tmp_path / "a.npz") as archive:
        files = {name: archive.zip.read(name) for name in archive.zip.namelist()}
    with pytest.raises(LogError, match=r"ranges has shape \(\), expected \(scans, beams\)"):
        open_log(write(zipped(**{**files, "ranges.npy": b"hello"})))


def test_faulty_scans_and_topics(tmp_path):
    np.savez(tmp_path / "a.npz", **GOOD, stamps=[1.0, np.nan, 3.0, 4.0])
    scans = check_fault(tmp_path / "a.npz", ": scan 1: stamp is nan", 3)
    assert [scan.stamp for scan in scans] == [1.0, 3.0, 4.0]
    assert len(open_log(tmp_path / "a.npz")) == 4
    check_refused("no topic 'scan'; topics there are: ranges", tmp_path / "a.npz", "scan")
