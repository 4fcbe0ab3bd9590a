"""npz logs: round trip, keys and shapes, damaged archives, recordings."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest

from lineament import LaserScan, LineamentError, LogError
from lineament.logs import open_log, save_npz
from lineament.logs import sources as copies

GOOD = {"ranges": np.ones((4, 3)), "angle_min": 0.0, "angle_increment": 0.1}


def scan(i=0, **fields):
    given = {"angle_min": -0.5, "angle_increment": 0.1, "stamp": 10.0 + i, "frame_id": "front"}
    return LaserScan([1.0 + i, np.nan, np.inf, 0.1], **{**given, **fields})


def check_same(a, b):
    for name in ("ranges", "angles", "intensities"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    for name in (
        *("range_min", "range_max", "stamp", "scan_time", "time_increment"),
        *("frame_id", "pose", "is_regular"),
    ):
        assert getattr(a, name) == getattr(b, name)


@pytest.mark.parametrize(
    "fields",
    [
        [{}, {}],
        [{"range_min": 0.2, "range_max": 30.0, "scan_time": 0.1, "time_increment": 1e-5}] * 3,
        [{"range_max": 30.0, "frame_id": "a"}, {"range_max": 20.0, "frame_id": "long name"}],
        [{"pose": (1.0, 2.0, 3.0)}, {}, {"pose": (0.0, 0.0, 0.0)}],
        [{"intensities": [1, 2, 3, 4.5]}] * 2,
        [{"angle_min": None, "angle_increment": None, "angles": [0, 0.1, 0.3, 0.35]}] * 2,
    ],
)
def test_round_trip(tmp_path, fields):
    scans = [scan(i, **more) for i, more in enumerate(fields)]
    save_npz(tmp_path / "a.npz", iter(scans), source="a test")
    log = open_log(tmp_path / "a.npz", "ranges")
    assert (log.format, log.topics, log.topic, len(log)) == (
        "npz",
        ["ranges"],
        "ranges",
        len(scans),
    )
    for _ in range(2):
        for a, b in zip(log, scans, strict=True):
            check_same(a, b)
    assert [file.name for file in tmp_path.iterdir()] == ["a.npz"]
    with np.load(tmp_path / "a.npz") as archive:
        assert archive["source"] == "a test"
        assert archive["ranges"].dtype == np.float64  # 0.1 would not survive float32.


def test_float32_stays_float32(tmp_path):
    save_npz(tmp_path / "a.npz", [LaserScan(np.float32([0.1, 0.2]), 0.0, 0.1)])
    with np.load(tmp_path / "a.npz") as archive:
        assert archive["ranges"].dtype == np.float32


@pytest.mark.parametrize(
    ("scans", "extra", "problem"),
    [
        ([], {}, "no scans"),
        ([scan(), scan(angle_min=0.0)], {}, "scan 1 has other bearings than scan 0"),
        ([scan(), LaserScan([1.0], 0.0, 0.1)], {}, "scan 1 has other bearings"),
        ([scan(), scan(intensities=[1, 2, 3, 4])], {}, "only one of them has intensities"),
        ([scan()], {"stamps": [1.0]}, "extra key stamps is one of the log's own"),
        ([scan()], {"source": object()}, "extra key source holds objects"),
    ],
)
def test_what_cannot_be_saved_leaves_nothing(tmp_path, scans, extra, problem):
    with pytest.raises(ValueError, match=problem):
        save_npz(tmp_path / "a.npz", scans, **extra)
    assert list(tmp_path.iterdir()) == []


def test_nowhere_to_save(tmp_path):
    with pytest.raises(LineamentError, match="does not exist"):
        save_npz(tmp_path / "missing" / "a.npz", [scan()])
    (tmp_path / "folder").mkdir()
    with pytest.raises(LineamentError, match="is a folder"):
        save_npz(tmp_path / "folder", [scan()])
    assert [file.name for file in tmp_path.iterdir()] == ["folder"]


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"ranges": None}, "expected the keys ranges, .*found angle_min, angle_increment"),
        ({"angle_min": None}, "expected the keys ranges, and angle_min with angle_increment"),
        ({"ranges": np.ones(3)}, r"ranges has shape \(3,\), expected \(scans, beams\)"),
        ({"ranges": np.ones((0, 3))}, "ranges has no scans"),
        ({"ranges": np.array([["a"]])}, "ranges has type <U1, expected numbers"),
        ({"ranges": np.ones((4, 3), complex)}, "ranges has type complex128"),
        ({"angle_min": np.zeros(4)}, r"angle_min has shape \(4,\), expected \(\)"),
        ({"angles": np.zeros(4)}, r"angles has shape \(4,\), expected \(3,\)"),
        ({"stamps": np.zeros(3)}, r"stamps has shape \(3,\), expected \(4,\)"),
        ({"poses": np.zeros((4, 2))}, r"poses has shape \(4, 2\), expected \(4, 3\)"),
        ({"range_max": np.ones(2)}, r"range_max has shape \(2,\), expected \(\) or \(4,\)"),
        ({"frame_id": 3}, "frame_id has type int64, expected text"),
    ],
)
def test_wrong_keys(tmp_path, change, problem):
    arrays = {k: v for k, v in {**GOOD, **change}.items() if v is not None}
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(LogError, match=problem):
        open_log(tmp_path / "a.npz")


def test_objects_are_not_loaded(tmp_path):
    np.savez(tmp_path / "a.npz", **{**GOOD, "ranges": np.array([[None]])})
    with pytest.raises(LogError, match="is no whole npz archive: ValueError: Object arrays"):
        open_log(tmp_path / "a.npz")


def test_unknown_topic(tmp_path):
    np.savez(tmp_path / "a.npz", **GOOD)
    with pytest.raises(LogError, match="no topic 'scan'; topics there are: ranges"):
        open_log(tmp_path / "a.npz", "scan")


def test_faulty_scans(tmp_path):
    np.savez(tmp_path / "a.npz", **GOOD, stamps=[1.0, np.nan, 3.0, 4.0])
    with pytest.raises(LogError, match="scan 1: stamp is nan"):
        list(open_log(tmp_path / "a.npz"))
    log = open_log(tmp_path / "a.npz", keep_going=True)
    assert [scan.stamp for scan in log] == [1.0, 3.0, 4.0]
    assert (log.skipped, len(log)) == (1, 4)


def test_cut_off_and_damaged_archives(tmp_path):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, **GOOD)
    data = path.read_bytes()
    for cut in range(1, len(data), 17):
        path.write_bytes(data[:cut])
        with pytest.raises(LogError, match=r"is no whole (npz|zip) archive|is no log"):
            open_log(path)
    for at in range(0, len(data), 5):
        path.write_bytes(data[:at] + bytes([data[at] ^ 0x55]) + data[at + 1 :])
        with contextlib.suppress(LogError):  # Some bytes matter to nobody.
            list(open_log(path))


@pytest.mark.parametrize(
    ("name", "shape"),
    [
        ("fr079_graph", (1464, 360)),
        ("intel_graph", (2672, 180)),
        ("jackal_mocap_02171554", (414, 897)),
        ("jackal_static_data", (350, 897)),
        ("obstdet_front_scan", (331, 726)),
    ],
)
def test_recordings(data_dir, name, shape):
    log = open_log(data_dir / "truth" / f"{name}.npz")
    with np.load(log.path) as archive:
        ranges, poses, stamps = archive["ranges"], archive["poses"], archive["stamps"]
    assert len(log) == shape[0]
    for i, one in enumerate(log):
        assert len(one) == shape[1]
        np.testing.assert_array_equal(one.ranges, ranges[i].astype(float))
        assert one.pose == tuple(poses[i])
        assert one.stamp == stamps[i]
    assert i == shape[0] - 1
    assert one.is_full_circle == name.startswith("jackal")


@pytest.mark.parametrize("name", ["ple_real", "ple_sim"])
def test_the_benchmark_is_no_log(data_dir, name):
    with pytest.raises(LogError, match=r"expected the keys ranges, .*found azimuth, radius"):
        open_log(data_dir / "benchmark" / f"{name}.npz")


def test_an_archive_that_grows_too_much(tmp_path, monkeypatch):
    monkeypatch.setattr(copies, "SMALL_COPY", 1 << 20)
    np.savez_compressed(tmp_path / "a.npz", **{**GOOD, "ranges": np.zeros((1000, 2000))})
    with pytest.raises(LogError, match=r"a\.npz: unpacks to more than 300 times its size"):
        open_log(tmp_path / "a.npz")
