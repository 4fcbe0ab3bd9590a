"""The aims of optimal: what is measured, and what stands in the tables."""

from __future__ import annotations

import json
import math
from statistics import median

import numpy as np
import pytest
from handmade import arc, segment

from lineament import LaserScan, RangeNoise
from lineament.reproduce import (
    Setting,
    frames,
    optimal_aims,
    recorded_aims,
    speed_aims,
)
from lineament.reproduce.aims import Aim, Limits, aims_table
from lineament.reproduce.curved_arcs import curved_arcs, line_misfit
from lineament.reproduce.findings import cell_text
from lineament.simulation import SENSORS, Sensor, scene, truth


def silent(about):
    assert about


def wall(first, last):
    """Return a segment somewhere, of so many beams."""
    return segment((1, 0), (1, 1), first, last)


def test_limits_tell_what_lies_between_them():
    both = Limits(0.9, 1.15)
    assert [both.hold(x) for x in (0.89, 0.9, 1.15, 1.16, math.nan)] == [
        False,
        True,
        True,
        False,
        False,
    ]
    table = aims_table(
        "A", [Aim("x", "told", Limits(), 1.0), Aim("x", "missed", Limits(high=1.0), 2.0)]
    )
    assert table.columns == ("on", "figure", "aim", "reached", "met")
    assert [row[2:] for row in table.rows] == [("–", 1.0, None), ("≤ 1", 2.0, "no")]


class TestCurvedArcs:
    """Arcs that differ from a line, and those that look straight."""

    def test_line_through_an_arc_is_off_by_what_a_search_finds(self):
        """The least χ² over all lines, by brute force over offset and direction."""
        angles, noise = np.radians(np.arange(-4, 5)), RangeNoise(sigma=0.005, proportional=0.002)
        column = arc(1.5, 0.05, 0.2, 0, 8)
        along = 1.5 * np.cos(angles) + 0.05 * np.sin(angles)
        ranges = along - np.sqrt(0.2**2 - (1.5**2 + 0.05**2 - along**2))
        normals = np.linspace(-0.8, 0.8, 321)[:, np.newaxis, np.newaxis]
        offsets = np.linspace(1.0, 1.5, 501)[:, np.newaxis]
        # Errors of 1/ρ as ρ² in range: what the misfit is defined by.
        errors = ranges**2 * (np.cos(angles - normals) / offsets - 1 / ranges)
        least = (errors**2 / noise.range_variance(ranges)).sum(axis=2).min()
        assert line_misfit(angles, column, noise) == pytest.approx(least, rel=0.02)

    def test_far_columns_look_straight(self):
        world, pose = scene("hall", 3)
        sensor = SENSORS["rplidar"]
        true = truth(world, pose, sensor)
        demanded = (true.arcs["n_points"] >= 6).sum()
        assert curved_arcs(true, sensor, 0.0).sum() == demanded > 0
        assert curved_arcs(true, sensor, 1e9).sum() == 0

    def test_an_arc_over_the_seam(self):
        sensor = Sensor("ring", 360, -math.pi, math.radians(1), 0.0, 30.0, noise=RangeNoise(0.01))
        behind, ahead = arc(-2.0, 0.0, 0.2, 356, 4), arc(2.0, 0.0, 0.2, 176, 184)
        behind["n_points"] = 9
        one, other = (line_misfit(sensor.angles, a, sensor.noise) for a in (behind, ahead))
        assert one == pytest.approx(other)


class TestRecorded:
    """Aims against the best of the others."""

    def test_without_recordings_nothing_is_measured(self, tmp_path):
        assert recorded_aims.recorded_aims("iepf", Setting(frames=1), silent) == []
        assert recorded_aims.recorded_aims("iepf", Setting(1, 0, tmp_path), silent) == []


def test_garbage_is_of_the_same_beams():
    like = LaserScan([2.0] * 50, angle_min=-0.3, angle_increment=0.01, range_max=12.0)
    for name, scan in speed_aims.garbage(like, np.random.default_rng(0)).items():
        assert np.array_equal(scan.angles, like.angles), name
        assert scan.valid.any(), name


def test_speed_has_an_aim_for_each_sensor(monkeypatch):
    for module, changes in (
        (frames, {"_COPIES": 1, "_BATCHES": 1}),
        (speed_aims, {"BEAMS": (90, 180), "CALLS": 1, "BATCH": 4, "SCANS_A_FRAME": 1}),
    ):
        for name, value in changes.items():
            monkeypatch.setattr(module, name, value)
    aims = speed_aims.speed_aims("iepf", Setting(frames=1), silent)
    assert [aim.where for aim in aims] == ["paper"] * 5 + ["utm30lx"] * 5 + ["270°"] * 3
    assert all(math.isfinite(aim.reached) for aim in aims)


@pytest.mark.slow
def test_aims_are_told_for_each_sensor(monkeypatch):
    some = {name: SENSORS[name] for name in ("lms181", "noisy")}
    changes = {"SENSORS": some, "SEEDS": 2, "SCENES_A_FRAME": 1, "METHOD": "iepf"}
    for name, value in changes.items():
        monkeypatch.setattr(optimal_aims, name, value)
    monkeypatch.setattr(optimal_aims, "speed_aims", lambda *_: [Aim("x", "y", Limits(), 1.0)])
    findings = optimal_aims.run(Setting(frames=1), silent)
    simulated, speed = findings.tables
    assert simulated.columns == ("figure", "aim", "lms181", "noisy", "missed with")
    rows = {row[0]: dict(zip(simulated.columns, row, strict=True)) for row in simulated.rows}
    assert rows["segment F1"]["noisy"] is None
    assert rows["arcs that are no lines"]["noisy"].endswith(")")
    of_seeds = [seed["corner_f1_0.10"] for seed in findings.numbers["simulated"]["noisy"]]
    middle, low, high = (cell_text(f(of_seeds)) for f in (median, min, max))
    assert rows["corner F1 within 0.1 m"]["noisy"] == f"{middle} ({low}–{high})"
    assert speed.rows[0][:2] == ("x", "y")
    json.dumps(findings.to_dict(), allow_nan=False)
