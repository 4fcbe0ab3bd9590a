"""All methods on recordings: a tiny one whose figures are known, and those that there are."""

from __future__ import annotations

import io
import json
import math

import numpy as np
import pytest
from matplotlib.image import imread

from lineament import Extractor, LaserScan
from lineament.logs import save_npz
from lineament.reproduce import Setting, contact_sheet, real, standing_still
from lineament.reproduce.contact_sheet import sheet_scans
from lineament.reproduce.standing_still import still_pairs
from lineament.simulation import SENSORS, room

#: Bins of arm lengths with their numbers of pairs.
PAIRS = {"3-4": 0, "5-9": 0, "10-29": 0, "30-99": 0, "100-": 0}


def silent(about):
    assert about


@pytest.fixture
def few(monkeypatch):
    """Two methods, and few scans."""
    methods = {name: Extractor(name) for name in ("optimal", "iepf")}
    monkeypatch.setattr(real, "feature_methods", lambda *_: methods)
    for module, name, value in (
        (real, "SCANS_A_FRAME", 1),
        (real, "PAIRS_A_FRAME", 4),
        (real, "ARENA_A_FRAME", 3),
        (standing_still, "STILL_A_FRAME", 4),
    ):
        monkeypatch.setattr(module, name, value)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A right angle 2 m ahead, six times from one place and twice from others; and no log."""
    poses = [(0.0, 0.0, 0.0)] * 6 + [(0.4, 0.0, 0.0), (0.4, 0.4, 0.0)]
    bearings = np.radians(np.arange(-45, 46))
    rng = np.random.default_rng(5)
    scans = []
    for k, (x, y, theta) in enumerate(poses):
        directions = np.column_stack((np.cos(bearings), np.sin(bearings)))
        # The walls x + y = 2 and x - y = 2 meet at (2, 0).
        ranges = np.minimum(*((2.0 - x - s * y) / (directions @ (1.0, s)) for s in (1.0, -1.0)))
        ranges += rng.normal(0.0, 0.003, len(ranges))
        given = {"angle_min": bearings[0], "angle_increment": math.radians(1)}
        scans.append(LaserScan(ranges, **given, pose=(x, y, theta), stamp=0.1 * k))
    save_npz(tmp_path / "wedge.npz", scans)
    np.savez(tmp_path / "other.npz", azimuth=np.zeros(3))
    monkeypatch.setattr(real, "LOGS", {"Wedge": "wedge.npz", "Missing": "missing.npz"})
    monkeypatch.setattr(contact_sheet, "SHEET", (("wedge.npz", 7), ("wedge.npz", 8), ("no", 0)))
    return tmp_path


@pytest.mark.usefixtures("few")
def test_figures_of_a_tiny_recording(folder):
    findings = real.run(Setting(2, 0, folder), silent)
    assert findings.text[-1] == "Left out, as they hold no scans: other.npz."
    free = findings.numbers["free_space"]
    assert list(free) == ["wedge.npz"]
    assert free["wedge.npz"]["optimal"] == {
        "phantom_in_100m": 0.0,
        "longest_phantom": 0.0,
        "phantom_scans": 0.0,
        "covered": 1.0,
    }
    # The first five pairs in a row are from one place: each has two walls and their corner.
    standing = findings.numbers["standing"]["wedge.npz"]["optimal"]
    for kind, pairs in (("segments", 10), ("corners", 5)):
        counts = {name: bins["pairs"] for name, bins in standing[kind].items()}
        assert counts == PAIRS | {"30-99": pairs}
        assert standing[kind]["30-99"]["found_again"] == 1.0
        assert 0.1 < standing[kind]["30-99"]["nees_median"] < 5.0
    repeats = findings.numbers["repeats"]
    assert list(repeats) == ["Wedge"]
    # The first six are each paired with the next, that with the last, both ways: one corner each.
    assert repeats["Wedge"]["optimal"] == {
        "expected": 14,
        "rate": 1.0,
        "auc": pytest.approx(math.nan, nan_ok=True),
        "count": 14.0,
        "chance": 0.0,
        "count_without_edges": 14.0,
        "auc_without_edges": pytest.approx(math.nan, nan_ok=True),
    }
    assert findings.numbers["arena"] == {}
    titles = [table.title for table in findings.tables]
    assert titles == [
        "Phantom metres in 100 m of segments",
        "Longest phantom stretch [m]",
        "Scans with a phantom stretch of more than 0.3 m [%]",
        "Covered measurements [%]",
        "Standing still: segments, by measurements",
        "Standing still: corners, by measurements",
        "Standing still: segments of optimal, by recording",
        "Standing still: corners of optimal, by recording",
        "Wedge: repeated corners, ranked by quality",
        "Corners of optimal found again [%], by their quality",
    ]
    covered = findings.tables[3]
    assert covered.columns == ("recording", "optimal", "iepf", "scans")
    assert [row[0] for row in covered.rows] == ["wedge.npz", "all"]
    assert covered.rows[1][1::2] == (100.0, 2)
    assert len(findings.figures) == 1
    json.dumps(findings.to_dict(), allow_nan=False)


def test_pairs_of_a_sensor_that_stands(folder):
    log = folder / "wedge.npz"
    pairs = still_pairs(log, 10)
    assert [(round(a.stamp, 6), round(b.stamp, 6)) for a, b in pairs] == [
        (round(0.1 * k, 6), round(0.1 * k + 0.1, 6)) for k in range(5)
    ]
    assert len(still_pairs(log, 10, standing=True)) == 7
    assert [round(a.stamp, 6) for a, _ in still_pairs(log, 3)] == [0.0, 0.2, 0.4]
    assert still_pairs(log, 0) == []


def test_sheet_has_the_scans_that_are_there(folder):
    scans = sheet_scans(Setting(1, 0, folder))
    assert [title for title, _ in scans] == ["wedge.npz · 7"]
    assert scans[0][1].stamp == pytest.approx(0.7)
    assert sheet_scans(Setting()) == []


def test_sheet_draws_a_panel_for_each_scan():
    """A sheet of five has two rows: it is about as high as wide, less two of four columns."""
    scan = SENSORS["lms181"].scan(room(), (0.0, 0.0, 0.0), np.random.default_rng(0))
    nothing = LaserScan([np.nan] * 9, angle_min=0.0, angle_increment=0.1)
    shapes = []
    for scans in ([scan] * 4, [scan] * 4 + [nothing]):
        figure = contact_sheet.contact_sheet([("room", s) for s in scans], Extractor("optimal"))
        shapes.append(imread(io.BytesIO(figure.png)).shape[:2])
    (one, width), (two, _) = shapes
    assert width > 3 * one
    assert 1.8 * one < two < 2.2 * one


def test_without_recordings_it_says_so(tmp_path):
    for setting in (Setting(), Setting(1, 0, tmp_path)):
        findings = real.run(setting, silent)
        assert findings.text == ("The recordings are not there: nothing was measured.",)
        assert findings.tables == findings.figures == ()


@pytest.mark.slow
@pytest.mark.usefixtures("few")
def test_all_recordings(data_dir):
    findings = real.run(Setting(1, 0, data_dir), silent)
    assert len(findings.numbers["free_space"]) >= 24
    assert {"benchmark/ple_real.npz", "benchmark/ple_sim.npz"} <= set(
        findings.text[-1].rstrip(".").split(": ")[1].split(", ")
    )
    assert set(standing_still.STANDING) < set(findings.numbers["standing"])
    assert list(findings.numbers["repeats"]) == list(real.LOGS)
    assert list(findings.numbers["arena"]) == ["arena, static", "arena, moving"]
    assert len(sheet_scans(Setting(1, 0, data_dir))) == len(contact_sheet.SHEET) == 22
    json.dumps(findings.to_dict(), allow_nan=False)
