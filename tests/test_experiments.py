"""The experiments: each from end to end on little, and its parts by hand."""

import json
import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from handmade import corner, features

import lineament as ln
from lineament.evaluation import Counts, FeatureScores, Scores, SimilarityScores
from lineament.evaluation.consistency import NormalisedErrors
from lineament.logs import save_npz
from lineament.methods import METHODS
from lineament.methods.stages import corner_response
from lineament.output import canvas, drawing
from lineament.reproduce import (
    EXPERIMENTS,
    Setting,
    all_methods,
    contenders,
    controls,
    definitions,
    grid,
    layers,
    museum,
    noise,
    real,
    repetition,
    run_experiments,
    scans,
    scenes,
    similarity,
    success,
    tracking,
    two_corners,
)
from lineament.reproduce.claims import WORDS, verdicts
from lineament.reproduce.grid import Parameters
from lineament.reproduce.seeds import Spread
from lineament.reproduce.two_corners import DISTANCE, POSES, WORLD, A, B
from lineament.scan.poses import relative
from lineament.simulation import SENSORS, drive, room, truth

PAPER = SENSORS["paper"]
#: Found on a small grid elsewhere; here it is only to be quick.
CHOSEN = Parameters("relative", 8, 6, 0.25)


def silent(about):
    assert about


@pytest.fixture
def small(monkeypatch):
    """Few methods, sensors, kinds and parameters, and times of single calls."""
    few = {"METHODS": ("liu", "pdbs", "iepf"), "best_parameters": lambda *_: CHOSEN}
    for module, changes in (
        (contenders, few),
        (noise, {"best_parameters": lambda *_: CHOSEN}),
        (scans, {"_COPIES": 1, "_BATCHES": 1}),
        (grid, {"RADII": (6, 8), "THRESHOLDS": (0.25, 0.66), "SCENES_A_FRAME": 1}),
        (all_methods, {"SENSORS": {"lms181": SENSORS["lms181"]}, "SCENES": ("room", "hall")}),
        (success, {"MORE": 2}),
        (two_corners, {"SCANS_A_FRAME": 2}),
        (scenes, {"INDOORS": ("room",)}),
        (similarity, {"INDOORS": ("room",), "SHOWN": ("iepf", "pdbs, fitted")}),
        (layers, {"RULES": ("fixed", "dietmayer")}),
        (real, {"SHOWN": "iepf"}),
    ):
        for name, value in changes.items():
            monkeypatch.setattr(module, name, value)


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


#: Some numbers of each experiment, in the small setting, as they are: what changes them is to be
#: explained. Paths are into `Findings.numbers`.
PINNED: dict[str, dict[str, float]] = {
    "definitions": {
        "fig1/corners": 1,
        "fig1/noise": 1.0,
        "fig4/ratio": 21.237,
        "fig6/corners": 2,
        "fig8/sum": 1.27076,
    },
    "noise": {
        "ranges/planes/beams": 1616,
        "ranges/planes/raw": 0.010006,
        "ranges/planes/filtered": 0.0048273,
        "ranges/edges/raw": 0.0098828,
        "ranges/edges/filtered": 0.021081,
        "ranges/corners/beams": 11,
        "ranges/more than 1.2 m/labelled": 1.0,
        "ranges/more than 1.2 m/off_after": 1.0,
        "features/paper’s numbers, not filtered/corner_recall_0.10": 1,
        "features/best of Figure 9, filtered/segment_offset_rmse": 0.005089,
    },
    "layers": {
        "paper/liu/success": 1.0,
        "utm30lx/liu/success": 0.83019,
        "utm30lx/pdbs, dietmayer/breakpoint_f1": 0.92473,
    },
    "repetition": {
        "grid/0/of_actual": 0.65,
        "grid/3/among_found": 0.767,
        "best/threshold": 0.66,
        "choices/7/f1": 0.33333,
        "choices/7/corners_per_view": 10,
    },
    "scenes": {
        "room/iepf/segments_found": 3,
        "room/iepf/corners_right": 2,
        "Office/iepf/segments": 5,
        "segment_f1/iepf": 1.0,
    },
    "similarity": {
        "simulated rooms, corridors and halls/the true lines/similarity_mean": 0.0069737,
        "simulated rooms, corridors and halls/the true lines/similarity_maximum": 0.035599,
        "simulated rooms, corridors and halls/pdbs, fitted/similarity_mean": 0.19321,
        "simulated rooms, corridors and halls/iepf/similarity_mean": 0.0068901,
        "simulated rooms, corridors and halls/liu:paper, filtered points/similarity_mean": 0.19317,
        "simulated rooms, corridors and halls/pdbs, fitted/similarity_maximum": 0.50955,
        "Office/iepf/similarity_explained": 1.0,
    },
    "two_corners": {
        "bound/0": 0.0042308,
        "places/iepf/0/mean": 2.3025,
        "places/iepf/4/standard_deviation": 0.0018932,
        "places/liu, best of Figure 9/2/found": 0.0,
    },
    "sensitivity": {
        "default/both": 100.0,
        "alone/half-width of the filter [beams]/8/both": 55,
        "iepf/none/0.1 m/recall": 100.0,
    },
    "success": {
        "liu, no corners/many/partition_success": 1.0,
        "liu, no corners/few/scans": 1,
        "liu, no corners/many/scans": 2,
        "iepf/many/corner_f1_0.10": 1.0,
        "iepf:paper/few/corner_f1_0.10": 1.0,
    },
    "all_methods": {
        "lms181/iepf/corner_f1_0.10": 0.75,
        "lms181/liu, paper’s numbers/segment_f1": 0.72,
        "lms181/pdbs/partition_success": 0.9,
    },
    "museum": {},
    "tracking": {
        "Office/relations/the log’s corrected poses/way_mean": 0.015,
        "Office/near/the log’s corrected poses/way_mean": 0.03,
        "Office/far_apart/the log’s corrected poses/motions": 1,
        "Office/far_apart/features/way_mean": 0.002978,
        "Office/motion/features/way_median": 0.0016062,
        "Office/motion/features/unobserved": 0.0,
        "Office/motion/ICP/way_rmse": 0.0016927,
        "Office/tracks/features/segments/kept": 1.0,
    },
    "real": {
        "free_space/room.npz/iepf/covered": 0.99815,
        "standing/room.npz/iepf/segments/30-99/pairs": 4,
        "repeats/Office/iepf/expected": 11,
        "repeats/Office/iepf/segment_rmse": 0.0079746,
        "arena/arena/iepf/recall": 1.0,
        "arena/arena/iepf/median_error": 0.0023415,
    },
}


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_returns_tables_figures_and_its_numbers(name, data):
    reports = []
    found = run_experiments([name], Setting(frames=1, data=data, seeds=1), reports.append)
    assert list(found) == [name]
    assert reports[0] == f"{name} (1/1): starting"
    assert len(reports) > (name != "museum")
    findings = found[name]
    assert findings.text
    for table in findings.tables:
        assert table.rows
        assert {len(row) for row in table.rows} == {len(table.columns)}
    assert all(figure.png.startswith(b"\x89PNG") for figure in findings.figures)
    words = [word for claim, _, word in verdicts(found) if claim.experiment == name]
    assert set(words) <= set(WORDS)
    names = {figure.name for figure in findings.figures}
    assert len(names) == len(findings.figures)
    numbers = json.loads(json.dumps(findings.to_dict(), allow_nan=False))["numbers"]
    here = {}
    for path in PINNED[name]:
        here[path] = numbers
        for key in path.split("/"):
            here[path] = here[path][int(key) if isinstance(here[path], list) else key]
    assert here == pytest.approx(PINNED[name], rel=1e-3)


@pytest.mark.usefixtures("small")
def test_seeds_are_merged_and_recordings_are_read_once(data):
    reports, setting = [], Setting(1, 4, data, seeds=2)
    found = run_experiments(["similarity", "two_corners", "tracking"], setting, reports.append)
    starts = [report.split(":")[0] for report in reports if report.endswith("starting")]
    twice = "similarity (1/3)", "two_corners (2/3)"
    names = [f"{name}, seed {seed}" for name in twice for seed in (4, 5)]
    assert starts == [*names, "tracking (3/3)"]
    alone = [two_corners.run(one, silent) for one in setting.by_seed()]
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


@pytest.mark.parametrize("name", ["tracking", "real"])
def test_without_recordings_nothing_is_measured(name, tmp_path):
    for setting in (Setting(), Setting(1, 0, tmp_path)):
        findings = run_experiments([name], setting, silent)[name]
        assert findings.text == ("The recordings are missing: nothing is measured.",)
        assert findings.tables == findings.figures == ()


@pytest.mark.parametrize("figure", ["fig1", "fig6"])
def test_figures_of_definitions_show_what_is_there(figure):
    assert definitions.run(Setting(), silent).numbers[figure]["off"] < 0.01


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


@pytest.mark.parametrize("seed", [0, 1])
def test_scene_of_figure_10_has_as_many_clusters_and_corners(seed):
    true = layers.like_figure_10(seed).truth
    assert (true.clusters.max() + 1, len(true.corners)) == layers.PAPER_COUNTS


class TestMuseum:
    """A bag of the layout of the museum's: echoes of a drive past the two corners of Table 2."""

    @pytest.fixture
    def bag(self, tmp_path):
        pytest.importorskip("rosbags")
        from ros_bags import Messages, write

        messages, way = Messages(1), [(0.7, 0.9), (3.0, 1.3), (1.6, 2.4)]
        items = []
        for scan in drive(WORLD, way, SENSORS["utm30lx"], speed=0.8, rate=10):
            echoes = [[r, r + 0.5] if r > 0 else [] for r in np.nan_to_num(scan.ranges, posinf=0)]
            beams = {"angle_min": scan.angle_min, "angle_increment": scan.angle_increment}
            message = messages.echoes(5 + scan.stamp, echoes, **beams)
            items.append(("horizontal_laser_2d", int(1e9 * scan.stamp), message))
            other = messages.scan(5 + scan.stamp, [1.0] * 9)
            items.append(("another", int(1e9 * scan.stamp), other))
        return write(tmp_path, "rosbag1", items, "museum")

    @pytest.mark.usefixtures("small")
    def test_bag_gives_figures_11_to_13_and_tables_2_and_3(self, bag, monkeypatch):
        monkeypatch.setattr(museum, "SCANS_A_FRAME", 20)
        findings = museum.run(Setting(2, museum=bag), silent)
        names = [figure.name for figure in findings.figures]
        parts = "fig11", "fig11-others", "fig12", "fig13"
        assert names == [f"museum-{part}" for part in parts]
        methods, distance = (findings.numbers[key] for key in ("methods", "distance"))
        assert list(methods) == list(distance)
        assert methods["iepf"]["corners"] > 3
        assert methods["iepf"]["mean"] < 0.01 < methods["pdbs, fitted"]["mean"]
        assert distance["iepf"]["mean"] == pytest.approx(DISTANCE, abs=0.01)
        assert distance["iepf"]["found"] > 0.8
        assert distance["pdbs, fitted"]["found"] == 0
        assert len(distance["iepf"]["places"]) == 5
        row = next(row for row in findings.tables[1].rows if row[0] == contenders.LIU_PAPER)
        first = dict(zip(findings.tables[1].columns, row, strict=True))
        assert (first["method"], first["paper: mean [m]"]) == ("liu, paper’s numbers", "2.302")
        json.dumps(findings.to_dict(), allow_nan=False)

    def test_scans_are_of_the_museums_topic_and_apart(self, bag):
        frames, in_row = museum.read(bag, 3)
        assert [len(scan) for scan in frames] == [1081] * 3
        assert frames[2].stamp - frames[1].stamp == pytest.approx(frames[1].stamp - frames[0].stamp)
        assert (np.diff([scan.stamp for scan in in_row]) > 0.09).all()
        assert in_row[0].stamp > frames[0].stamp

    def test_two_corners_are_a_convex_and_a_concave_one_seen_over_the_longest_way(self):
        def view(way, **corners):
            places = {"a": (0, True), "b": (2, False), "c": (3.5, False), "f": (9, False)}
            shown = {ord(n): (np.array((places[n][0], 0.0)), places[n][1]) for n in corners}
            return museum.View(None, None, way, shown)

        several = [view(0.1 * k, a=1, b=1, f=1) for k in range(6)]
        several += [view(1.0 + 0.3 * k, a=1, c=1) for k in range(5)]
        views, a, b = museum.views_of_two(several)
        assert (chr(a), chr(b), len(views)) == ("a", "c", 5)
        assert [v.way for v in museum._at_places(views)] == [v.way for v in views]
        places = [several.index(v) for v in museum._at_places(several)]
        assert places == [0, 5, 6, 8, 10]
        assert museum.views_of_two(several[:4]) is None
        assert museum.views_of_two([view(k, b=1, c=1) for k in range(9)]) is None


class TestMethods:
    def test_every_method_takes_part_as_published_and_with_shared_steps(self, monkeypatch):
        monkeypatch.setattr(contenders, "best_parameters", lambda *_: CHOSEN)
        names = list(contenders.every_method(Setting(), silent))
        assert [n.split(",")[0] for n in names[:4]] == ["liu:paper", "liu:paper", "liu", "liu"]
        assert names[4:6] == ["liu:tuned", "liu’s operator, shared steps"]
        assert names[6:8] == ["optimal", "pdbs"]
        rivals = [name for name in METHODS if name not in ("liu", "optimal", "pdbs")]
        assert names[8:-1] == [row for name in rivals for row in (f"{name}:paper", name)]
        assert names[-1] == "blind cut, shared steps"
        features = list(contenders.feature_methods(Setting(), silent))
        assert features == [name for name in names if name != "pdbs"]
        fitted = list(contenders.fitted_methods(Setting(), silent))
        assert fitted == ["pdbs, fitted" if name == "pdbs" else name for name in names]
        drawn = list(filter(contenders.is_drawn, fitted))
        assert drawn == [*names[2:5], "optimal", "pdbs, fitted", "iepf:paper", *rivals]

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

    def test_each_cluster_has_a_line(self):
        bearings = 0.02 * np.arange(10)
        ranges = np.where(bearings < 0.1, 2.0, 4.0) / np.cos(bearings)
        scan = ln.LaserScan(ranges, angle_min=0.0, angle_increment=0.02)
        lines = contenders.region_lines(scan, ln.extract(scan, method="pdbs")).segments
        assert lines["first_beam"].tolist() == [0, 5]
        assert lines["last_beam"].tolist() == [4, 9]
        assert lines["cluster"].tolist() == [0, 1]
        np.testing.assert_allclose(lines["centroid"][:, 0], [2.0, 4.0])
        np.testing.assert_allclose(np.abs(np.sin(lines["angle"])), 1.0)

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

    def test_errors_are_of_the_beams_of_each_place(self):
        """Ranges of two flat frames that are off by known amounts."""
        angles = {"angle_min": -0.1, "angle_increment": 0.01}
        true = 2.0 / np.cos(-0.1 + 0.01 * np.arange(21))
        off = np.zeros(21)
        off[4], off[12] = 0.02, 1.5
        scan = ln.LaserScan(true + off, **angles)
        places = {"small": off == 0.02, "large": off == 1.5, "none": off > 9}
        found = noise._ranges([noise._Frame(scan, features(21), true, places)] * 2)
        assert (found["small"]["beams"], found["large"]["beams"]) == (2, 2)
        assert found["small"]["raw"] == pytest.approx(0.02)
        assert found["small"]["filtered"] < 0.01
        assert found["large"]["raw"] == pytest.approx(1.5)
        assert (found["small"]["off_after"], found["large"]["off_after"]) == (0.0, 1.0)
        assert (found["small"]["labelled"], found["large"]["labelled"]) == (0.0, 1.0)
        assert math.isnan(found["none"]["raw"])

    def test_places_of_a_frame(self):
        """A wall, a nearer one, and noise points: what is an edge, a corner, a plane."""
        frame = noise._frame(room(), (0.0, 0.0, 0.3), 5)
        errors = abs(frame.scan.ranges - frame.true)
        sizes = [frame.places[noise._size(*size)] for size in noise.SIZES]
        for (low, high), place in zip(noise.SIZES, sizes, strict=True):
            assert ((errors[place] > low) & (errors[place] <= high)).all()
        noisy = np.logical_or.reduce(sizes)
        assert (noisy == (frame.scan.valid & (errors > noise.OFF))).all()
        assert not (frame.places["planes"] & noisy).any()
        corners = truth(room(), (0.0, 0.0, 0.3), noise.SENSOR).corners["beam"]
        assert set(np.flatnonzero(frame.places["corners"])) <= set(corners.tolist())
        near = np.abs(np.flatnonzero(frame.places["planes"])[:, np.newaxis] - corners)
        assert near.min() >= noise.HALF_WIDTH - 1


class TestRepetition:
    @pytest.fixture
    def made(self):
        """Every form at three radii and three thresholds; the tangent as the paper has it."""
        ar = {("tangent", 8, 6, 0.66): 0.9, ("tangent", 8, 8, 0.66): 0.91}
        ar |= {("product", 2, 8, 0.66): 0.7, ("product", 2, 6, 0.5): 0.6}
        other = {"f1": 0.5}
        return {
            p: other | {"of_actual": ar.get(p, 0.1 * (p[0] != "relative")), "among_found": 1 - p[3]}
            for form in grid.FORMS
            for half_width in grid.HALF_WIDTHS
            for radius in (5, 6, 8)
            for threshold in (0.5, 0.66, 0.8)
            for p in [Parameters(form, half_width, radius, threshold)]
        }

    def test_largest_is_among_those_asked_for(self, made):
        assert grid.largest(made, "of_actual") == ("tangent", 8, 8, 0.66)
        assert grid.largest(made, "of_actual", response="product") == ("product", 2, 8, 0.66)
        fixed = {"response": "product", "support_radius": 6}
        assert grid.largest(made, "of_actual", **fixed) == ("product", 2, 6, 0.5)
        assert grid.largest(made, "among_found", threshold=0.8).threshold == 0.8
        assert grid.largest(made, "among_found").threshold == 0.5

    def test_readings_are_alike_whose_peak_is_at_the_papers_parameters(self, made):
        flat = [paper.reading for paper in repetition._papers() if paper.response != "relative"]
        flat.remove("product, half-width 2")
        assert repetition._alike(made) == flat
        made[Parameters("tangent", 8, 8, 0.66)]["of_actual"] = 0.95
        flat.remove("tangent, half-width 8")
        assert repetition._alike(made) == flat

    def test_table_of_peaks_has_the_paper_beside_and_invents_nothing(self, made):
        rows = {name: cells for name, *cells in repetition._peaks(made).rows}
        assert rows["paper"] == [6, "lost", 0.66, "lost", "lost", "lost"]
        assert rows["tangent, half-width 8"] == [8, 0.91, 0.66, 0.9, 0.9, 0.91]
        assert rows["product, half-width 2"] == [8, 0.7, 0.5, 0.6, 0.1, 0.7]
        assert rows["relative, half-width 2"] == [None, 0.0, 0.5, 0.0, 0.0, 0.0]

    def test_average_repetition_by_hand(self):
        turn = 0.002
        before = features(corners=[corner(*p) for p in ((1, 0), (2, 0), (3, 0), (0, 4))])
        after = features(corners=[corner(*p) for p in ((1, 0.03), (2.04, 0), (7, 7))])
        turned = after.transform(0, 0, -turn)
        assert grid.average_repetition(before, turned, turn) == (2 / 4 + 2 / 3) / 2
        assert grid.average_repetition(before, before, 0.06) == 0.25  # One of four is near enough.
        assert grid.average_repetition(before, features(), 0.0) == 0.0
        assert math.isnan(grid.average_repetition(features(), features(), 0.0))

    def test_everything_a_corner_repeats_well_and_is_wrong(self):
        everywhere = grid.repetition(Parameters("tangent", 8, 6, 0.0), range(1))
        assert everywhere["among_found"] > 0.9
        assert everywhere["precision"] < 0.1
        assert everywhere["corners_per_view"] > 100
        nothing = grid.repetition(Parameters("relative", 8, 6, 5.0), range(1))
        assert [nothing[name] for name in (*grid.CRITERIA, "corners_per_view")] == [0.0] * 3

    def test_parameters_are_chosen_on_scenes_that_are_not_reported(self):
        setting = Setting(frames=50, seed=3)
        chosen_on, reported = (grid.repetition_scenes(setting, reported=r) for r in (False, True))
        assert len(chosen_on) == len(reported) == 100
        assert not set(chosen_on) & set(reported)
        later = grid.repetition_scenes(Setting(frames=50, seed=4), reported=False)
        assert not set(reported) & set(later)


class TestTwoCorners:
    def test_both_corners_are_seen_well_from_all_five_places(self):
        assert math.dist(A, B) == pytest.approx(2.302, abs=1e-12)
        for pose in POSES:
            seen = truth(WORLD, pose, PAPER).transform(*pose)
            for vertex, convex in ((A, True), (B, False)):
                is_it = np.hypot(*(seen.corners["position"] - vertex).T) < 1e-9
                assert is_it.sum() == 1
                assert seen.corners["convex"][is_it][0] == convex
                sides = seen.corners["segments"][is_it][0]
                assert (seen.segments["n_points"][sides] >= 6).all()
            # No wall is a side of both: their errors are independent.
            assert len(set(seen.corners["segments"].ravel())) >= 4
            found = two_corners.found_distances([truth(WORLD, pose, PAPER)], pose)
            assert found == pytest.approx([DISTANCE], abs=1e-9)

    def test_distance_is_of_the_nearest_corners_and_of_nothing_too_far(self):
        along = (B - A) / DISTANCE
        views = [
            features(corners=[corner(*p) for p in positions])
            for positions in (
                (A - 0.01 * along, A + 0.2 * along, B),
                (A,),
                (A, B + 0.26 * along),
                (A - 0.24 * along, B),
                (),
            )
        ]
        found = two_corners.found_distances(views, (0.0, 0.0, 0.0))
        assert found == pytest.approx([DISTANCE + 0.01, DISTANCE + 0.24])

    def test_bound_is_that_of_both_corners_along_their_line(self, monkeypatch):
        """Variances of 4 and 9 mm² along the line from A to B add up, those across do not count."""
        along = (B - A) / DISTANCE
        across = np.array((-along[1], along[0]))
        rows = [corner(*A), corner(*B)]
        for row, variance in zip(rows, (4e-6, 9e-6), strict=True):
            row["covariance"] = variance * np.outer(along, along) + 1e-2 * np.outer(across, across)
        monkeypatch.setattr(two_corners, "truth", lambda *_: features(corners=rows))
        assert two_corners.distance_bound((0.0, 0.0, 0.0)) == pytest.approx(math.sqrt(13e-6))

    def test_tables_by_hand(self):
        found = {"liu": [np.array([DISTANCE - 0.0125] * 2), np.empty(0)], "iepf": [np.empty(0)] * 2}
        overall = two_corners._overall(found, np.array([0.003, 0.004]), 4)
        liu, iepf, bound = (dict(zip(overall.columns, row, strict=True)) for row in overall.rows)
        assert liu["paper: mean [m]"] == "2.302"
        assert liu["here: mean [m]"] == "2.2895"
        assert liu["RMS error ÷ bound"] == pytest.approx(12.5 / math.sqrt(12.5))
        assert liu["share of scans with both"] == pytest.approx(2 / 20)
        assert iepf["here: mean [m]"] is iepf["paper: mean [m]"] is None
        assert bound["RMS error [mm]"] == pytest.approx(math.sqrt(12.5))
        off, spread, share = two_corners._by_place(found, np.array([0.003, 0.004]), 4)
        assert off.rows == (("liu", pytest.approx(-12.5), None), ("iepf", None, None))
        assert spread.rows == (("liu", 0.0, None), ("iepf", None, None), ("bound", 3.0, 4.0))
        assert share.rows == (("liu", 50.0, 0.0), ("iepf", 0.0, 0.0))

    def test_drawn_is_the_scan_with_the_median_error(self, monkeypatch):
        """Errors of 1, 3 and 2 cm, and one without both corners, which is the worst."""
        along, (x, y, turn) = (B - A) / DISTANCE, POSES[0]
        rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
        found = [
            features(corners=[corner(*((place - (x, y)) @ rotation)) for place in places])
            for places in [(A, B + off * along) for off in (0.01, 0.03, 0.02)] + [(A,)]
        ]
        monkeypatch.setattr(two_corners, "batch_of", lambda *_: found)
        assert two_corners._median_view(None, range(4), POSES[0]) == (2, found[2])

    @pytest.mark.slow
    def test_good_method_spreads_like_the_bound_and_none_spreads_less(self):
        pose, rng = POSES[4], np.random.default_rng(2)
        seen = [PAPER.scan(WORLD, pose, rng) for _ in range(200)]
        extract = ln.Extractor("ransac", noise=PAPER.noise)
        distances = two_corners.found_distances(scans.batch_of(extract, seen), pose)
        assert len(distances) > 190
        error = np.sqrt(np.mean((distances - DISTANCE) ** 2))
        # 4 standard deviations of a standard deviation of 190 draws are 0.2 of it.
        assert 0.8 < error / two_corners.distance_bound(pose) < 1.4


class TestTexts:
    """What the page says follows from its numbers."""

    def test_shares_and_errors_of_figure_12(self):
        true, liu = (
            SimilarityScores(np.array([0.0, 0.01, error, error]), 4) for error in (0.03, 0.5)
        )
        text = similarity._text(true, liu)
        assert "100 % are explained, and the largest error is 0.50 m" in text[-1]
        assert "50 % of the points are more than 0.01 m" in text[1]

    def test_table_of_similarity(self):
        scores = SimilarityScores(np.array([0.01, 0.03, 0.005, 0.015]), 5)
        (row,) = similarity._table("x", {"iepf": scores}).rows
        rms = math.sqrt((100 + 900 + 25 + 225) / 4)
        assert row[:6] == ("iepf", *map(pytest.approx, (80, 15, rms, 27.75, 30)))
        assert row[6:] == ("up to 250 mm", 50)

    def test_mean_nees_is_compared_with_its_interval(self):
        """Two corners, each off by one σ along x: the mean NEES of four components is a half."""
        off = NormalisedErrors(np.array([[1.0, 0.0], [1.0, 0.0]]))
        within = Scores(1, replace(FeatureScores.none("corners"), consistency=off)).summary()
        beyond = within | {"corner_nees": within["corner_nees_high"] + 0.1}
        text = all_methods._consistency({"lms181": {"liu": within, "iepf": beyond, "pdbs": {}}})
        assert text == "The mean NEES lies within its 95 % interval in 1 of 2 rows for corners."

    def test_methods_with_arcs_are_named(self):
        sensors = {"lms181": {"liu": {}, "optimal": {}}, "ld19": {"liu": {}}}
        assert all_methods._arcs(sensors).startswith("Arcs are found by none of the methods.")
        sensors["ld19"]["optimal"] = {"arc_precision": 0.5}
        assert all_methods._arcs(sensors).startswith("Arcs are found by optimal.")

    def test_rows_of_table_3_have_the_papers_numbers(self):
        counts = [Counts(1, 2, 4), Counts(3, 4, 6)]
        row = success._row("iepf:paper", 2, counts, "corners")
        assert row["paper: success"] == 0.7251
        assert (row["here: success, 2 frames"], row["corners in 2"]) == (0.25, "1 of 4")
        assert (row["precision in 20"], row["F1 in 20"]) == (0.75, 0.6)
        times = success._times("liu, no corners", np.array([3e-6, 1e-6]), success.PAPER_PARTITION)
        assert list(times.values()) == ["9.6 – 25.3", "1.0 – 3.0"]
        assert success._row("hough", 2, counts, "corners")["paper: success"] is None


@pytest.mark.parametrize("errors", [[0.0, 0.02, np.nan], [3.0, 0.1, 0.1], [np.nan] * 3])
def test_axis_of_errors_is_the_same_for_all_methods(errors):
    axes = canvas.new_figure(4, 3).subplots()
    drawing.draw_errors(axes, ln.LaserScan([1.0, 1.0, 1.0], 0.0, 0.1), np.array(errors))
    assert axes.get_ylim() == (1e-4, 10.0)
    drawn = axes.lines[0].get_ydata()
    np.testing.assert_array_equal(drawn, np.maximum(errors, drawing.LEAST_ERROR))


class TestTracking:
    def test_synthetic_odometry_has_the_errors_that_are_stated(self):
        poses = [(0.5 * i, 0.0, 0.0) for i in range(2000)]
        way = tracking.stand_in_odometry(poses, seed=1)
        steps = np.array([relative(a, b) for a, b in pairwise(way)])
        np.testing.assert_allclose(steps.mean(axis=0), (0.5, 0.0, 0.0), atol=0.006)
        np.testing.assert_allclose(steps.std(axis=0), (0.07, 0.07, 0.01), rtol=0.06)
        assert way == tracking.stand_in_odometry(poses, seed=1)

    @pytest.mark.slow
    def test_a_small_log(self, tmp_path):
        path = tmp_path / "small.npz"
        save_npz(path, list(drive(room(), [(-2, 0), (1, 0)], SENSORS["lms361"], speed=1, rate=10)))
        found = tracking.load_recording(path, 12, 0.5)
        every = tracking.load_recording(path, 99)
        assert found[0].stamp == every[len(every) // 2].stamp
        numbers = tracking.measure("small", found, 0, silent)
        motions, tracks = numbers["motion"], numbers["tracks"]
        assert numbers["relations"] == numbers["near"] == numbers["far_apart"] == {}
        assert list(motions) == [
            *("odometry, synthetic", "features", "ICP"),
            *("features, no odometry", "ICP, no odometry"),
        ]
        for name in ("features", "ICP", "features, no odometry"):
            assert motions[name]["way_median"] < 0.01
        assert motions["features"]["unobserved"] == 0
        assert tracks["features"]["segments"]["kept"] > 0.95


class TestReal:
    """A right angle 2 m ahead, six times from one place and twice from others; and no log."""

    @pytest.fixture
    def folder(self, tmp_path, monkeypatch):
        poses = [(0.0, 0.0, 0.0)] * 6 + [(0.4, 0.0, 0.0), (0.4, 0.4, 0.0)]
        bearings = np.radians(np.arange(-45, 46))
        rng, found = np.random.default_rng(5), []
        for k, (x, y, theta) in enumerate(poses):
            directions = np.column_stack((np.cos(bearings), np.sin(bearings)))
            # The walls x + y = 2 and x - y = 2 meet at (2, 0).
            ranges = np.minimum(*((2.0 - x - s * y) / (directions @ (1.0, s)) for s in (1.0, -1.0)))
            ranges += rng.normal(0.0, 0.003, len(ranges))
            beams = {"angle_min": bearings[0], "angle_increment": math.radians(1)}
            found.append(ln.LaserScan(ranges, **beams, pose=(x, y, theta), stamp=0.1 * k))
        save_npz(tmp_path / "wedge.npz", found)
        np.savez(tmp_path / "other.npz", azimuth=np.zeros(3))
        methods = {name: ln.Extractor(name) for name in ("optimal", "iepf")}
        monkeypatch.setattr(real, "feature_methods", lambda *_: methods)
        monkeypatch.setattr(real, "LOGS", {"Wedge": "wedge.npz", "Missing": "missing.npz"})
        for name, value in (("SCANS", 1), ("PAIRS", 4), ("ARENA", 3), ("STILL", 4)):
            monkeypatch.setattr(real, f"{name}_A_FRAME", value)
        return tmp_path

    def test_numbers_of_a_tiny_recording(self, folder):
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
            counts = [bins["pairs"] for bins in standing[kind].values()]
            assert counts == [0, 0, 0, pairs, 0]
            assert standing[kind]["30-99"]["found_again"] == 1.0
            assert 0.1 < standing[kind]["30-99"]["nees_median"] < 5.0
        # The first six are each paired with the next, that with the last, both ways: one corner
        # and two walls each.
        (repeats,) = findings.numbers["repeats"].values()
        found = repeats["optimal"]
        assert [found[name] for name in ("expected", "rate", "count", "chance")] == [14, 1, 14, 0]
        assert math.isnan(found["auc"])
        assert (found["count_without_edges"], found["corners_expected"]) == (14, 14)
        assert (found["corners_per_scan"], found["corner_rate"], found["segment_rate"]) == (1, 1, 1)
        assert found["segments_expected"] == 28
        assert found["corner_rmse"] < 0.02
        assert findings.numbers["arena"] == {}
        measures = len(real.FREE_SPACE), 2 * len(real.STANDING_STILL), len(real.REPEATS), 1
        assert len(findings.tables) == sum(measures)
        assert {table.columns for table in findings.tables[:-1]} == {
            ("recording", "optimal", "iepf")
        }
        assert findings.tables[3].rows[1][:2] == ("all", 100.0)
        again = findings.tables[6]
        assert again.title == "Standing still, segments: found again [%]"
        assert [row[:2] for row in again.rows[:1]] == [("wedge.npz", 100.0)]
        json.dumps(findings.to_dict(), allow_nan=False)

    @pytest.mark.slow
    @pytest.mark.usefixtures("folder")
    def test_all_recordings(self, data_dir, monkeypatch):
        logs = {"Intel lab": "truth/intel_graph.npz", "ACES": "carmen/aces-corrected.log.gz"}
        monkeypatch.setattr(real, "LOGS", logs)
        findings = real.run(Setting(1, 0, data_dir), silent)
        assert len(findings.numbers["free_space"]) >= 24
        unread = set(findings.text[-1].rstrip(".").split(": ")[1].split(", "))
        assert {"benchmark/ple_real.npz", "benchmark/ple_sim.npz"} <= unread
        assert set(scans.STANDING) < set(findings.numbers["standing"])
        assert list(findings.numbers["repeats"]) == [*logs, *real.FURTHER_LOGS]
        assert list(findings.numbers["arena"]) == list(real.ARENAS)
        json.dumps(findings.to_dict(), allow_nan=False)
