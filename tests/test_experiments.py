"""The experiments: each from end to end on little, and its parts by hand."""

import json

import numpy as np
import pytest
from handmade import features
from lineament_lab.evaluation import SimilarityScores
from lineament_lab.methods import RIVALS, controls
from lineament_lab.reproduce import (
    EXPERIMENTS,
    Setting,
    all_methods,
    contenders,
    definitions,
    layers,
    noise,
    real,
    run_experiments,
    scans,
    similarity,
    tracking,
)
from lineament_lab.reproduce.seeds import Spread
from small_experiments import PAPER, silent, small  # noqa: F401

import lineament as ln
from lineament.logs import save_npz
from lineament.methods.stages import corner_response
from lineament.simulation import SENSORS, room


@pytest.fixture
def data(tmp_path, monkeypatch):
    """A folder of recordings: a simulated room from some places, as a log and as an arena."""
    poses = np.array([(-1.0, 0.0, 0.0), (-0.6, 0.0, 0.3), (-0.2, 0.1, -0.2)])
    rng, sensor = np.random.default_rng(0), SENSORS["lms181"]
    found = [sensor.scan(room(), tuple(pose), rng, 40.0 * k) for k, pose in enumerate(poses)]
    save_npz(tmp_path / "room.npz", found)
    (tmp_path / "room.relations").write_text("0 80 0.8 0.1 0 0 0 -0.2\n0 40 0.4 0.03 0 0 0 0.3\n")
    np.savez(
        tmp_path / "arena.npz",
        ranges=[scan.ranges for scan in found],
        poses_refined=poses,
        angle_min=sensor.angle_min,
        angle_increment=sensor.angle_increment,
        range_max=sensor.range_max,
        gt_segments=room().segments,
        gt_corners=room().segments[:, :2],
    )
    for module, name, value in (
        (scans, "LOGS", {"Office": "room.npz"}),
        (tracking, "LOGS", {"Office": ("room.npz", 0.0), "none": ("no.npz", 0.0)}),
        (tracking, "RELATIONS", {"Office": "room.relations"}),
        (real, "ARENAS", {"arena": "arena.npz"}),
        (real, "LOGS", {"Office": "room.npz", "none": "no.npz"}),
        (real, "STANDING", ("room.npz",)),
    ):
        monkeypatch.setattr(module, name, value)
    return tmp_path


@pytest.mark.slow
@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_returns_tables_figures_and_its_numbers(name, data, approve):
    reports = []
    found = run_experiments([name], Setting(frames=2, data=data, seeds=1), reports.append)
    assert list(found) == [name]
    assert reports[0] == f"{name} (1/1): starting"
    findings = found[name]
    assert findings.text
    for table in findings.tables:
        assert table.rows
        assert {len(row) for row in table.rows} == {len(table.columns)}
    approve(name, findings, reports)
    numbers = findings.numbers
    if name == "all_methods":  # of what finds clusters alone, nothing else is scored
        control = numbers["lms181"][contenders.PARTITION_ONLY]
        scored = {key.split("_")[0] for key in control}
        assert not scored & {"corner", "segment", "arc"}
        assert {"corner", "segment"} <= {key.split("_")[0] for key in numbers["lms181"]["iepf"]}


@pytest.mark.slow
@pytest.mark.usefixtures("small")
def test_seeds_are_merged_and_recordings_are_read_once(data):
    reports, setting = [], Setting(1, 4, data, seeds=2)
    found = run_experiments(["similarity", "two_corners", "tracking"], setting, reports.append)
    starts = [report.split(":")[0] for report in reports if report.endswith("starting")]
    twice = "similarity (1/3)", "two_corners (2/3)"
    names = [f"{name}, seed {seed}" for name in twice for seed in (4, 5)]
    assert starts == [*names, "tracking (3/3)"]
    alone = [run_experiments(["two_corners"], one, silent) for one in setting.by_seed()]
    alone = [one["two_corners"] for one in alone]
    mean = found["two_corners"].numbers["places"]["iepf"][0]["mean"]
    assert mean.values == tuple(one.numbers["places"]["iepf"][0]["mean"] for one in alone)
    overall = {row[0]: row[4:6] for row in found["two_corners"].tables[0].rows}
    assert all(isinstance(cell, Spread) for cell in overall["iepf"])
    assert not any(isinstance(cell, Spread) for cell in overall["bound"])
    assert found["two_corners"].figures == alone[0].figures
    simulated, office = found["similarity"].tables
    assert isinstance(simulated.rows[0][2], Spread)
    assert not any(isinstance(cell, Spread) for row in office.rows for cell in row)
    json.dumps(found["similarity"].to_dict(), allow_nan=False)


@pytest.mark.parametrize(
    ("name", "missing"),
    [
        ("tracking", "The recordings are missing: nothing is measured."),
        ("real", "The recordings are missing: nothing is measured."),
        ("plans", "not at hand"),
    ],
)
def test_without_recordings_nothing_is_measured(name, missing, tmp_path):
    for setting in (Setting(), Setting(1, 0, tmp_path)):
        findings = run_experiments([name], setting, silent)[name]
        assert missing in findings.text[0]
        assert len(findings.text) == 1
        assert findings.tables == findings.figures == ()


def test_operator_by_definition_is_that_of_the_code():
    """Equations 15 to 22 by least squares of NumPy, and the stage, on a noisy corner."""
    rng, arm = np.random.default_rng(3), np.linspace(0.3, 0.02, 8)
    points = np.vstack([np.column_stack((arm, 0 * arm)), np.column_stack((0 * arm, arm))[::-1]])
    points += rng.normal((2.0, 1.0), 0.01, points.shape)
    response = corner_response(points, support_radius=6, response="tangent")
    for at in range(6, 10):
        s, slopes, bends = definitions.fitted(points, at, 6)
        assert (s[6], len(s)) == (0, 13)
        assert (np.diff(s) > 0).all()
        normal = np.array((-slopes[1], slopes[0])) / np.hypot(*slopes)
        off = points[at - 6 : at + 7] - points[at]
        assert response[at] == pytest.approx(abs(off @ normal).sum())
        fit = np.outer(s, slopes) + np.outer(s**2, bends)
        np.testing.assert_allclose(np.vstack((s, s**2)) @ (off - fit), 0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_scene_of_figure_10_has_as_many_clusters_and_corners(seed):
    true = layers.like_figure_10(seed).truth
    assert (true.clusters.max() + 1, len(true.corners)) == layers.PAPER_COUNTS


class TestMethods:
    def test_every_method_takes_part_as_published_and_with_shared_steps(self):
        names = list(contenders.every_method())
        assert names[:4] == ["liu:paper", "liu:figure9", "liu", "liu:tuned"]
        assert names[4:7] == ["liu’s operator, shared steps", "optimal", "pdbs"]
        of_corners = ("pdbs", "falko", "flirt")
        rivals = [name for name in RIVALS if name not in of_corners]
        assert names[7:-1] == [row for name in rivals for row in (f"{name}:paper", name)]
        assert names[-1] == "blind cut, shared steps"
        features = list(contenders.feature_methods())
        assert features == [name for name in names if name != "pdbs"]
        corners = list(contenders.corner_methods())
        assert corners == [*features, "falko:paper", "falko", "flirt"]
        fitted = list(contenders.fitted_methods())
        assert fitted == ["pdbs, fitted" if name == "pdbs" else name for name in names]
        drawn = list(filter(contenders.is_drawn, fitted))
        assert drawn == [*names[:4], "optimal", "pdbs, fitted", "iepf:paper", *rivals]

    def test_controls_cut_where_they_are_said_to(self):
        """A wall of 25 points: a blind cut at every eighth leaves one line after the settling."""
        bearings = 0.02 * np.arange(-12, 13)
        scan = ln.LaserScan(2.0 / np.cos(bearings), angle_min=-0.24, angle_increment=0.02)
        noise = ln.RangeNoise(0.01)
        for settling, pieces in ((False, [(0, 8), (9, 16), (17, 24)]), (True, [(0, 24)])):
            method = controls.BlindCut(settling=settling)
            lines = ln.Extractor(method, noise=noise)(scan).segments
            ends = zip(lines["first_beam"], lines["last_beam"], strict=True)
            assert [tuple(map(int, pair)) for pair in ends] == pieces
        bearings = 0.02 * np.arange(-20, 21)
        ranges = 2.0 / (np.cos(bearings) + abs(np.sin(bearings)))
        corner = ln.LaserScan(ranges, angle_min=-0.4, angle_increment=0.02)
        for method in (controls.OperatorCut(), controls.BlindCut()):
            (found,) = ln.Extractor(method, noise=noise)(corner).corners
            np.testing.assert_allclose(found["position"], (2.0, 0.0), atol=1e-6)

    def test_two_beams_are_a_line_and_one_is_none(self):
        scan, labels = ln.LaserScan([2.0] * 9, 0.0, 0.02), [0, -1, 1, 1, -1, 2, 2, 2, 3]
        for n in (0, 1, 9):
            found = contenders.region_lines(scan, features(clusters=labels[:n] + [-1] * (9 - n)))
            lines = found.segments[["cluster", "first_beam", "last_beam"]].tolist()
            assert lines == [(1, 2, 3), (2, 5, 7)] * (n == 9)

    def test_a_cluster_over_the_seam_is_one_line(self):
        bearings = np.radians(np.arange(0, 360, 2.0))
        ranges = np.full(180, np.nan)
        seen = np.r_[170:180, 0:10]
        ranges[seen] = 2.0 / np.cos(bearings[seen])
        scan = ln.LaserScan(ranges, angle_min=0.0, angle_increment=np.radians(2.0))
        (line,) = contenders.region_lines(scan, ln.extract(scan, method="pdbs")).segments
        assert (line["first_beam"], line["last_beam"], line["n_points"]) == (170, 9, 20)
        assert line["centroid"][0] == pytest.approx(2.0)


class TestNoise:
    def test_beams_around_a_mark(self):
        marks = np.array([0, 0, 0, 1, 0, 0, 0], dtype=bool)
        assert np.flatnonzero(noise._near(marks, 1, 2)).tolist() == [2, 3, 4, 5]


class TestTexts:
    """What the page says follows from its numbers."""

    def test_shares_and_errors_of_figure_12(self):
        true, liu = (
            similarity._numbers(SimilarityScores(np.array([0.0, 0.01, error, error]), 4))
            for error in (0.03, 0.5)
        )
        found = {similarity.SIMULATED: {similarity.TRUE: true, "liu:paper": liu}}
        text, _ = similarity.report(found, Setting())
        assert "100 % are explained, and the largest error is 0.50 m" in text[-1]
        assert "50 % of the points are more than 0.01 m" in text[1]

    def test_a_method_that_explains_nothing_has_no_verdict(self):
        some, none = (
            similarity._numbers(SimilarityScores(errors, 4))
            for errors in (np.array([0.001]), np.empty(0))
        )
        found = dict.fromkeys(("liu:paper", "liu:figure9", "liu", "iepf:paper"), none)
        found |= {similarity.TRUE: some, "pdbs, fitted": some, contenders.BLIND: some}
        (claim,) = similarity.EXPERIMENT.claims
        judged = claim.judge({similarity.SIMULATED: found})
        assert judged.verdict == "undecided"
        assert judged.here.startswith("Largest error: nothing explained (beside it: ")
        text, _ = similarity.report({similarity.SIMULATED: found}, Setting())
        assert "nan" not in " ".join(text)

    def test_methods_with_arcs_are_named(self):
        sensors = {"lms181": {"liu": {}, "optimal": {}}, "ld19": {"liu": {}}}
        assert all_methods._arcs(sensors).startswith("Arcs are found by none of the methods.")
        sensors["ld19"]["optimal"] = {"arc_precision": 0.5}
        assert all_methods._arcs(sensors).startswith("Arcs are found by optimal.")
