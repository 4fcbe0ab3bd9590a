"""Experiments on recordings: the museum, tracking, and measures that need no truth."""

import json
import math
from itertools import pairwise

import numpy as np
import pytest
from lineament_lab.reproduce import (
    Setting,
    museum,
    plans,
    real,
    run_experiments,
    scans,
    tracking,
)
from lineament_lab.reproduce.report import reproduce
from lineament_lab.reproduce.two_corners import DISTANCE, WORLD
from small_experiments import silent, small  # noqa: F401

import lineament as ln
from lineament import LineamentError
from lineament.mapping import LineMap
from lineament.mapping.grids import Grid
from lineament.scan.poses import relative
from lineament.simulation import SENSORS, World, drive, room
from lineament.simulation.surfaces import View


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

    @pytest.mark.slow
    @pytest.mark.usefixtures("small")
    def test_bag_gives_figures_11_to_13_and_tables_2_and_3(self, bag, approve, monkeypatch):
        monkeypatch.setattr(museum, "SCANS_A_FRAME", 20)
        reports = []
        setting = Setting(2, museum=bag)
        findings = run_experiments(["museum"], setting, reports.append)["museum"]
        methods, distance = (findings.numbers[key] for key in ("methods", "distance"))
        assert methods["iepf"]["mean"] < 0.01 < methods["pdbs, fitted"]["mean"]
        assert distance["iepf"]["mean"] == pytest.approx(DISTANCE, abs=0.01)
        assert distance["iepf"]["found"] > 0.8
        assert distance["pdbs, fitted"]["found"] == 0
        approve("museum-bag", findings, reports)

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
        # The whole way counts, not that from the second view on.
        late = [view(at, a=1, b=1) for at in (0.0, 2.0, 2.1, 2.2, 2.5)]
        late += [view(3.0 + 0.5 * k, a=1, c=1) for k in range(5)]
        assert museum.views_of_two(late)[2] == ord("b")
        late = [view(at, a=1, b=1) for at in (0.0, 0.1, 0.2, 0.3, 2.5)]
        assert museum.views_of_two(late + [view(0.4 * k, a=1, c=1) for k in range(5)])[2] == ord(
            "b"
        )
        assert museum.views_of_two(several[:4]) is None
        assert museum.views_of_two([view(k, b=1, c=1) for k in range(9)]) is None


@pytest.mark.slow
def test_the_museums_bag_is_not_overwritten_and_what_is_named_is_run(tmp_path):
    bag = tmp_path / "figures.json"
    bag.write_bytes(b"#ROSBAG V2.0")
    with pytest.raises(LineamentError, match=r"figures\.json"):
        reproduce(tmp_path, ["definitions"], Setting(museum=bag))
    assert bag.read_bytes() == b"#ROSBAG V2.0"
    reports = []
    page = reproduce(tmp_path / "new", ["fig7"], Setting(1, seeds=1), reports.append)
    numbers = json.loads((page.parent / "figures.json").read_text(encoding="utf-8"))
    assert list(numbers["experiments"]) == ["definitions"]
    assert (numbers["recordings"], numbers["museum"]) == (False, False)
    assert reports


def test_synthetic_odometry_has_the_errors_that_are_stated():
    poses = [(0.5 * i, 0.0, 0.0) for i in range(2000)]
    way = tracking.stand_in_odometry(poses, seed=1)
    steps = np.array([relative(a, b) for a, b in pairwise(way)])
    np.testing.assert_allclose(steps.mean(axis=0), (0.5, 0.0, 0.0), atol=0.006)
    np.testing.assert_allclose(steps.std(axis=0), (0.07, 0.07, 0.01), rtol=0.06)
    assert way == tracking.stand_in_odometry(poses, seed=1)


@pytest.mark.slow
def test_all_recordings(data_dir, monkeypatch):
    logs = {"Intel lab": "truth/intel_graph.npz", "ACES": "carmen/aces-corrected.log.gz"}
    methods = {name: ln.Extractor(name) for name in ("optimal", "iepf")}
    for name, value in (("SCANS", 1), ("PAIRS", 4), ("ARENA", 3), ("STILL", 4)):
        monkeypatch.setattr(real, f"{name}_A_FRAME", value)
    monkeypatch.setattr(real, "feature_methods", lambda *_: methods)
    monkeypatch.setattr(real, "corner_methods", lambda *_: methods)
    monkeypatch.setattr(real, "LOGS", logs)
    findings = run_experiments(["real"], Setting(1, 0, data_dir), silent)["real"]
    assert len(findings.numbers["free_space"]) >= 20
    unread = set(findings.text[-2].rstrip(".").split(": ")[1].split(", "))
    doubles = findings.numbers["doubles"]
    assert doubles["mcap/scans_demo.mcap"] == "rosbag1/scans_demo.bag"
    assert len(doubles) >= 4
    assert {"benchmark/ple_real.npz", "benchmark/ple_sim.npz"} <= unread
    assert set(scans.STANDING) < set(findings.numbers["standing"])
    assert list(findings.numbers["repeats"]) == [*logs, *real.FURTHER_LOGS]
    assert list(findings.numbers["arena"]) == list(real.ARENAS)
    json.dumps(findings.to_dict(), allow_nan=False)


class TestPlans:
    """Scenes that are not ours."""

    @pytest.fixture
    def folder(self, tmp_path, monkeypatch):
        (tmp_path / "plans").mkdir()
        (tmp_path / "data").mkdir()
        LineMap.from_lines(room().segments).write(tmp_path / "plans" / "room.yaml")
        cells = Grid.read(tmp_path / "plans" / "room.yaml")
        # A plan without a drive does not know what is free: here, what is within the room.
        inside = np.where(cells.occupied, 100, 0).astype(np.int8)
        Grid(inside, cells.resolution, cells.origin).write(tmp_path / "plans" / "room.yaml")
        monkeypatch.setattr(plans, "PLANS", ("room",))
        return tmp_path

    def test_every_method_is_scored_by_plan(self, folder):
        found = run_experiments(["plans"], Setting(2, 0, folder / "data"), silent)["plans"]
        numbers = found.numbers["methods"]
        assert {"optimal", "liu:paper", "iepf", "blind cut, shared steps"} <= set(numbers)
        best = numbers["optimal"]
        assert best["corner_least"] == best["corner_greatest"] == best["corner_f1_0.10"] > 0.6
        assert best["segment_f1"] > numbers["liu:paper"]["segment_f1"]
        (table,) = found.tables
        assert [row[0] for row in table.rows] == list(numbers)

    def test_scans_stand_free_and_walls_bow(self, folder):
        path = folder / "plans" / "room.yaml"
        frames = list(plans.frames_on(path, 3))
        again = list(plans.frames_on(path, 3))
        for frame, same in zip(frames, again, strict=True):
            assert frame.scan.ranges.tobytes() == same.scan.ranges.tobytes()
            assert np.nanmin(frame.scan.ranges) > plans.CLEAR - 0.1
        walls = [[-3.0, 2.0, 3.0, 2.0], [3.0, 2.0, 3.0, 1.5]]
        world, sensor, rng = World(walls), SENSORS["utm30lx"], np.random.default_rng(1)
        scan = sensor.scan(world, (0.0, 0.0, 0.0), rng)
        view = View(world, (0.0, 0.0, 0.0), sensor)
        longer = plans._bows(view, scan, rng)
        # In the middle of the long wall, met squarely, it is the bow; the short wall has none.
        middle = np.argmin(abs(scan.angles - math.pi / 2))
        assert 0 < abs(longer[middle]) <= plans.BOW
        assert abs(longer[middle]) == pytest.approx(
            np.abs(longer * np.sin(scan.angles)).max(), rel=1e-3
        )
        assert not longer[view.surface == 1].any()
