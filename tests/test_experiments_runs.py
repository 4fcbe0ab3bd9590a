"""Every experiment from end to end, so small that it also runs uncompiled."""

from __future__ import annotations

import json

import numpy as np
import pytest

from lineament.logs import save_npz
from lineament.reproduce import (
    EXPERIMENTS,
    Setting,
    all_methods,
    contact_sheet,
    contenders,
    frames,
    layered,
    noise_points,
    optimal_aims,
    real,
    recorded_aims,
    recordings,
    repeatability,
    repetition_grid,
    run_experiments,
    scenes,
    similarity,
    speed_aims,
    standing_still,
    success,
    tracking,
    two_corners,
)
from lineament.simulation import SENSORS, room

#: Found on a small grid elsewhere; here it is only to be quick.
CHOSEN = repetition_grid.Parameters("relative", 6, 0.25)


@pytest.fixture
def small(monkeypatch):
    """Few methods, sensors, kinds and parameters, and times of single calls."""
    for module, changes in (
        (contenders, {"METHODS": {"liu", "pdbs", "iepf"}, "best_parameters": lambda *_: CHOSEN}),
        (noise_points, {"best_parameters": lambda *_: CHOSEN}),
        (frames, {"_COPIES": 1, "_BATCHES": 1}),
        (repetition_grid, {"RADII": (6, 8), "THRESHOLDS": (0.25, 0.66), "SCENES_A_FRAME": 1}),
        (all_methods, {"SENSORS": {"lms181": SENSORS["lms181"]}, "SCENES": ("room", "hall")}),
        (success, {"MORE": 2}),
        (two_corners, {"SCANS_A_FRAME": 2}),
        (scenes, {"KINDS": ("room",)}),
        (similarity, {"KINDS": ("room",)}),
        (layered, {"RULES": ("fixed", "dietmayer")}),
        (real, {"DRAWN": "iepf"}),
        (optimal_aims, {"SENSORS": {"lms181": SENSORS["lms181"]}, "SCENES_A_FRAME": 1}),
        (optimal_aims, {"METHOD": "iepf"}),
        (speed_aims, {"BEAMS": (90, 180), "CALLS": 1, "BATCH": 4, "SCANS_A_FRAME": 1}),
    ):
        for name, value in changes.items():
            monkeypatch.setattr(module, name, value)


@pytest.fixture
def data(tmp_path, monkeypatch):
    """A folder of recordings: a simulated room from some places, as a log and as an arena."""
    poses = np.array([(-1.0, 0.0, 0.0), (-0.6, 0.0, 0.3), (-0.2, 0.1, -0.2)])
    rng, sensor = np.random.default_rng(0), SENSORS["lms181"]
    scans = [sensor.scan(room(), tuple(pose), rng) for pose in poses]
    save_npz(tmp_path / "room.npz", scans)
    np.savez(
        tmp_path / "arena.npz",
        ranges=[scan.ranges for scan in scans],
        poses_refined=poses,
        angle_min=sensor.angle_min,
        angle_increment=sensor.angle_increment,
        range_max=sensor.range_max,
        gt_segments=room().segments,
        gt_corners=room().segments[:, :2],
    )
    monkeypatch.setattr(recordings, "LOGS", {"Office": "room.npz"})
    monkeypatch.setattr(repeatability, "LOGS", {"Office": "room.npz"})
    monkeypatch.setattr(tracking, "LOGS", {"Office": ("room.npz", 0.0)})
    monkeypatch.setattr(success, "ARENA", "arena.npz")
    monkeypatch.setattr(real, "ARENAS", {"arena": "arena.npz"})
    monkeypatch.setattr(real, "LOGS", {"Office": "room.npz"})
    monkeypatch.setattr(contact_sheet, "SHEET", (("room.npz", 1), ("missing.npz", 0)))
    monkeypatch.setattr(standing_still, "STANDING", ("room.npz",))
    monkeypatch.setattr(recorded_aims, "ARENAS", {"arena": "arena.npz"})
    return tmp_path


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_hands_back_tables_figures_and_numbers(name, data):
    told = []
    found = run_experiments([name], Setting(frames=1, data=data), told.append)
    assert list(found) == [name]
    assert told[0] == f"{name} (1/1): starting"
    assert len(told) > 1
    findings = found[name]
    assert all(table.rows for table in findings.tables)
    assert all(figure.png.startswith(b"\x89PNG") for figure in findings.figures)
    assert len({figure.name for figure in findings.figures}) == len(findings.figures) > 0
    assert findings.text
    assert findings.numbers
    json.dumps(findings.to_dict(), allow_nan=False)
