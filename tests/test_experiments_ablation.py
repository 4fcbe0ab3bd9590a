"""From liu to optimal, and its aims: what is measured, and what stands in the tables."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from handmade import arc, corner, features, segment

from lineament import Extractor, LaserScan, RangeNoise
from lineament.evaluation.experiments import (
    Setting,
    ablation,
    frames,
    optimal_aims,
    recorded_aims,
    repetition_grid,
    speed_aims,
)
from lineament.evaluation.experiments.aims import Aim, Limits, aims_table
from lineament.evaluation.experiments.ceilings import (
    curved_arcs,
    line_misfit,
    lines_within_gates,
    within_gate,
)
from lineament.evaluation.repeatability import Repeats
from lineament.methods.optimal import PARTS
from lineament.simulation import SENSORS, Sensor, room, scene, truth


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


def test_ladder_puts_the_parts_back_one_by_one(monkeypatch):
    chosen = repetition_grid.Parameters("relative", 6, 0.25)
    monkeypatch.setattr(
        "lineament.evaluation.experiments.contenders.best_parameters", lambda *_: chosen
    )
    rows = ablation.ladder(Setting(frames=1), silent)
    without = [set(e.method.without) for name, e in rows.items() if e.method.name == "optimal"]
    assert without[0] == set(PARTS)
    assert without[-1] == set()
    assert [len(w) for w in without] == list(range(len(PARTS), -1, -1))
    assert all(later < earlier for earlier, later in pairwise(without))


class TestCeilings:
    """What no method can pass."""

    def test_a_corner_is_within_the_gate_as_often_as_drawn_errors_are(self):
        true = truth(room(), (0.0, 0.0, 0.0), SENSORS["paper"])
        corners = true.corners.copy()
        corners["covariance"] = [[[0.01, 0.004], [0.004, 0.003]], [[1e-6, 0], [0, 1e-6]]]
        rng = np.random.default_rng(0)
        errors = rng.multivariate_normal((0, 0), corners["covariance"][0], 100_000)
        drawn = (np.hypot(*errors.T) <= 0.1).mean()
        assert within_gate(replace(true, corners=corners), 0.1) == pytest.approx(
            [drawn, 1.0], abs=0.005
        )

    def test_a_segment_counts_as_often_as_drawn_errors_are_within_its_gates(self):
        true = truth(room(), (0.0, 0.0, 0.0), SENSORS["paper"])
        segments = true.segments.copy()
        segments["covariance"] = np.diag([0.08**2, math.radians(7) ** 2])
        off, turn = np.random.default_rng(0).normal(size=(2, 100_000))
        drawn = ((abs(0.08 * off) <= 0.1) & (abs(7 * turn) <= 10)).mean()
        within = lines_within_gates(replace(true, segments=segments))
        assert len(within) == (segments["n_points"] >= 6).sum() > 0
        assert within == pytest.approx(drawn, abs=0.005)

    def test_a_corner_with_a_small_side_is_not_demanded(self):
        true = features(
            n=20, segments=[wall(0, 9), wall(10, 12)], corners=[corner(1, 1, segments=(0, 1))]
        )
        assert within_gate(true, 0.1).shape == (0,)

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

    def test_the_best_of_the_others_is_told_by_name(self):
        repeats = {
            "optimal": Repeats(10, np.zeros(6)),
            "iepf": Repeats(20, np.zeros(8)),
            "hough": Repeats(5, np.zeros(4)),
            "liu": Repeats(2, np.zeros(2)),  # too few for a rate
        }
        count, rate = recorded_aims._repeat_aims("log", "", "optimal", repeats)
        assert (count.figure, count.limits.low, count.reached) == (
            "corners repeated; best other iepf",
            8,
            6,
        )
        assert (rate.figure, rate.limits.low, rate.reached) == (
            "corner repeatability; best other hough",
            0.8,
            0.6,
        )

    def test_clear_corners_have_two_large_sides_and_no_flat_opening(self):
        found = features(
            n=40,
            segments=[wall(0, 9), wall(10, 14), wall(15, 30)],
            corners=[corner(1, 1, segments=s) for s in ((0, 1), (0, 2), (0, 2), (0, -1))],
        )
        found.corners["opening"] = np.radians([90, 90, 160, 90])
        assert len(recorded_aims.clear_corners(found).corners) == 1

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
    assert [aim.where for aim in aims] == ["paper"] * 4 + ["utm30lx"] * 4 + ["270°"] * 3
    assert all(math.isfinite(aim.reached) for aim in aims)


@pytest.mark.slow
class TestRuns:
    """Both experiments from end to end, on little."""

    def test_ablation_has_a_table_for_each_sensor_and_one_of_recordings(
        self, monkeypatch, data_dir
    ):
        for name, value in {
            "SCANNERS": ("lms181",),
            "SCENES_A_FRAME": 1,
            "SCANS_A_FRAME": 2,
        }.items():
            monkeypatch.setattr(ablation, name, value)
        rows = {name: Extractor(name) for name in ("liu:scale_free", "iepf")}
        monkeypatch.setattr(ablation, "ladder", lambda *_: rows)
        findings = ablation.run(Setting(1, 0, data_dir), silent)
        simulated, recorded = findings.tables
        assert [row[0] for row in simulated.rows] == [row[0] for row in recorded.rows] == list(rows)
        numbers = findings.numbers["lms181"]
        assert numbers["iepf"]["corner_f1_0.10"] > numbers["liu:scale_free"]["corner_f1_0.10"]
        json.dumps(findings.to_dict(), allow_nan=False)

    def test_aims_are_told_for_each_sensor(self, monkeypatch):
        some = {name: SENSORS[name] for name in ("lms181", "noisy")}
        for name, value in {"SENSORS": some, "SCENES_A_FRAME": 1, "METHOD": "iepf"}.items():
            monkeypatch.setattr(optimal_aims, name, value)
        monkeypatch.setattr(optimal_aims, "speed_aims", lambda *_: [Aim("x", "y", Limits(), 1.0)])
        findings = optimal_aims.run(Setting(frames=1), silent)
        simulated, speed = findings.tables
        assert simulated.columns == ("figure", "aim", "lms181", "noisy", "missed with")
        rows = {row[0]: dict(zip(simulated.columns, row, strict=True)) for row in simulated.rows}
        assert rows["corner F1 within 0.1 m"]["noisy"] is None
        assert rows["the same at σ = 3 cm"]["lms181"] is None
        assert 0.5 < rows["its ceiling"]["noisy"] <= 1.0
        assert speed.rows[0][:2] == ("x", "y")
        json.dumps(findings.to_dict(), allow_nan=False)
