"""The scans of experiments: simulated, recorded, in pairs, and those of the arena."""

import math

import numpy as np
import pytest
from handmade import corner, features
from lineament_lab.evaluation import arena
from lineament_lab.evaluation.arena import ARENAS, arena_scores, load_arena
from lineament_lab.reproduce import Setting, scans
from lineament_lab.reproduce.scans import (
    frame_times,
    interleaved_times,
    scan_pairs,
    still_pairs,
    time_ratio,
)

from lineament import Extractor, LaserScan
from lineament.logs import save_npz
from lineament.simulation import Sensor, World, truth


def test_methods_are_timed_in_turns(monkeypatch):
    """A clock by which each call takes twice as long as the one before it.

    Two methods on two scans are four calls a round, of which the first round does not count: a scan
    of a batch takes an eighth of 16, 32, 64, 128 s, then of 16 times that.
    """
    clock = iter([t for k in (*range(12), 9, 3, 4) for t in (0.0, 2.0**k)])
    monkeypatch.setattr(scans.time, "perf_counter", lambda: next(clock))
    monkeypatch.setattr(scans, "_BATCHES", 2)
    scan = LaserScan([2.0] * 9, angle_min=0.0, angle_increment=0.01)
    taken = interleaved_times({"a": Extractor("pdbs"), "b": Extractor("pdbs")}, [scan, scan])
    assert taken["a"].tolist() == [[2.0, 8.0], [32.0, 128.0]]
    assert taken["b"].tolist() == [[4.0, 16.0], [64.0, 256.0]]
    taken["b"][1] += 4 * taken["a"][1]
    assert time_ratio(taken["b"], taken["a"]) == (4.0, 2.0, 6.0)
    assert frame_times(Extractor("pdbs"), [scan]).tolist() == [1.5]


def test_recorded_scans_are_spread_over_the_log(tmp_path, monkeypatch):
    some = [LaserScan([1.0, 1.0], 0.0, 0.1, stamp=float(i)) for i in range(10)]
    save_npz(tmp_path / "a.npz", some)
    monkeypatch.setattr(scans, "LOGS", {"A": "a.npz", "B": "b.npz"})
    expected = {1: [5.0], 2: [2.0, 7.0], 3: [1.0, 4.0, 7.0], 20: [float(i) for i in range(10)]}
    for count, stamps in expected.items():
        found = dict(scans.recorded_scans(Setting(data=tmp_path), count))
        assert list(found) == ["A"]
        assert [scan.stamp for scan in found["A"]] == stamps


def walk(path, poses, **beams):
    beams = {"angle_min": 0.0, "angle_increment": 0.01} | beams
    some = [LaserScan([2.0] * 9, **beams, pose=p, stamp=i) for i, p in enumerate(poses)]
    save_npz(path, some)


def test_scan_pairs_are_apart_by_way_or_by_turn(tmp_path):
    poses = [(0.1 * i, 0.0, 0.0) for i in range(8)]
    poses += [(0.7, 0.0, math.radians(8 * i)) for i in (1, 2)]
    walk(tmp_path / "log.npz", poses)
    stamps = [(a.stamp, b.stamp) for a, b in scan_pairs(tmp_path / "log.npz", 5)]
    # Every second one; 0.3 m are three or (as 0.1 is none in binary) four scans, 15° are two.
    assert [a for a, _ in stamps] == [0, 2, 4, 6]
    assert all(b - a in (3, 4, 5) for a, b in stamps)
    assert stamps[-1] == (6, 9)
    assert len(scan_pairs(tmp_path / "log.npz", 2)) == 2


def test_scan_pairs_are_sought_behind_a_scan_and_not_for_ever(tmp_path, monkeypatch):
    monkeypatch.setattr(scans, "_SEARCHED", 2)
    for way, expected in (([0, 0.5, 1.0], [(0, 1), (1, 2)]), ([0, 0, 0, 0.5], [(1, 3), (2, 3)])):
        walk(tmp_path / "log.npz", [(x, 0.0, 0.0) for x in way])
        stamps = [(a.stamp, b.stamp) for a, b in scan_pairs(tmp_path / "log.npz", 9)]
        assert stamps == expected


def test_scan_pairs_over_the_turn_of_the_angle(tmp_path):
    """From -179° to 179° is a turn of 2°, from there to 160° one of 19°."""
    walk(tmp_path / "log.npz", [(0.0, 0.0, math.radians(a)) for a in (-179, 179, 160)])
    stamps = [(a.stamp, b.stamp) for a, b in scan_pairs(tmp_path / "log.npz", 9)]
    assert stamps == [(0, 2), (1, 2)]


def test_pairs_of_a_sensor_that_stands(tmp_path):
    poses = [(0.0, 0.0, 0.0)] * 6 + [(0.4, 0.0, 0.0), (0.4, 0.0, 0.4), (0.4009, 0.0, 0.4009)]
    walk(tmp_path / "log.npz", poses)

    def stamps(count, **how):
        return [(a.stamp, b.stamp) for a, b in still_pairs(tmp_path / "log.npz", count, **how)]

    still = [(k, k + 1) for k in range(5)] + [(7, 8)]
    assert stamps(10) == still
    assert stamps(10, standing=True) == [(k, k + 1) for k in range(8)]
    assert stamps(3) == [still[0], still[2], still[5]]
    assert stamps(0) == []


#: A room of 4 m x 3 m whose fitted walls leave gaps at two corners; a board ends on a wall.
WALLS = [[0, 0, 4, 0], [4, 0.05, 4, 3], [4, 3, 0.08, 3], [0, 3, 0, 0], [2, 3.02, 2, 2]]
CORNERS = [[0, 0], [4, 0], [4, 3], [0, 3]]
RING = Sensor("ring", 720, -math.pi, math.radians(0.5), 0.0, 30.0)


@pytest.fixture
def recording(tmp_path):
    closed = World([[0, 0, 4, 0], [4, 0, 4, 3], [4, 3, 0, 3], [0, 3, 0, 0], [2, 3, 2, 2]])
    poses = np.array([(0.8, 0.8, 0.3), (3.0, 0.7, 2.0), (1.2, 1.5, -1.0), (2.5, 0.6, 3.0)])
    rng = np.random.default_rng(0)
    path = tmp_path / "arena.npz"
    np.savez(
        path,
        ranges=[RING.scan(closed, tuple(pose), rng).ranges for pose in poses.tolist()],
        poses=poses + 1.0,
        poses_refined=poses,
        angle_min=RING.angle_min,
        angle_increment=RING.angle_increment,
        range_max=30.0,
        gt_segments=np.array(WALLS, dtype=float),
        gt_corners=np.array(CORNERS, dtype=float),
    )
    return path


def test_fitted_walls_end_at_the_corners_that_they_are_near_to(recording):
    loaded = load_arena(recording, 2)
    assert loaded.walls.segments[1].tolist() == [4, 0, 4, 3]
    assert loaded.walls.segments[2].tolist() == [4, 3, 0, 3]
    assert loaded.walls.segments[4].tolist() == WALLS[4]
    assert loaded.corners.tolist() == [*CORNERS, [2, 3.02]]
    assert [scan.pose for scan in loaded.scans] == [(0.8, 0.8, 0.3), (2.5, 0.6, 3.0)]
    every = load_arena(recording, 100)
    assert len(every.scans) == 4
    for scan, true in zip(every.scans, every.truths, strict=True):
        for position in true.transform(*scan.pose).corners["position"]:
            assert min(np.hypot(*(np.array(CORNERS) - position).T)) < 1e-9


@pytest.mark.parametrize(
    ("kept", "off", "shown"), [(3, 0.05, False), (4, 0.05, True), (0, 0.03, True)]
)
def test_a_corner_is_demanded_where_both_its_walls_show(kept, off, shown):
    """Of the wall x = 4 beside (4, 0) all measurements but a few are some cm before it.

    Those that count are from 0.1 to 0.6 m from the corner, along the wall: the other faces and the
    corner at (4, 3) are as they were.
    """
    walls, pose = World([[0, 0, 4, 0], [4, 0, 4, 3], [4, 3, 0, 3], [0, 3, 0, 0]]), (1.5, 1.5, 0.3)
    scan = RING.scan(walls, pose, np.random.default_rng(0))
    visible = truth(walls, pose, RING)
    assert arena.faces_shown(scan, pose, visible, walls).tolist() == [True] * 4
    bearings = scan.angles + pose[2]
    x, y = pose[0] + scan.ranges * np.cos(bearings), pose[1] + scan.ranges * np.sin(bearings)
    on_face = np.flatnonzero((abs(x - 4) < 1e-3) & (y > 0.1) & (y < 0.6))
    assert len(on_face) > 8
    ranges = scan.ranges.copy()
    ranges[on_face[kept:]] -= off / np.cos(bearings[on_face[kept:]])
    before = LaserScan(ranges, RING.angle_min, RING.angle_increment)
    corner_at = visible.transform(*pose).corners["position"]
    demanded = arena.faces_shown(before, pose, visible, walls)
    there = np.hypot(*(corner_at - (4, 0)).T) < 1e-6
    assert there.sum() == 1
    assert demanded[there].tolist() == [shown]
    assert demanded[~there].all()


def test_scores_of_found_corners_worked_by_hand(recording):
    """Of four visible corners one is found 3 cm off; the board's end is no mistake, one is."""
    loaded = load_arena(recording, 1)
    x, y, theta = loaded.scans[0].pose
    found = features(n=720, corners=[corner(0.03, 0), corner(2, 3), corner(2, 0)])
    turn = np.array([[math.cos(theta), -math.sin(theta)], [math.sin(theta), math.cos(theta)]])
    found.corners["position"] = (found.corners["position"] - (x, y)) @ turn
    numbers, positions = arena_scores(loaded, lambda _: found)
    visible = len(loaded.truths[0].corners)
    assert visible >= 3
    assert numbers["recall"] == 1 / visible
    assert numbers["false"] == pytest.approx(1 / 3)
    assert numbers["median_error"] == pytest.approx(0.03)
    assert numbers["corners_per_scan"] == 3
    np.testing.assert_allclose(positions, [(0.03, 0), (2, 3), (2, 0)], atol=1e-12)


def test_methods_find_the_corners_of_the_recorded_arena(data_dir):
    loaded = load_arena(data_dir / ARENAS["arena, static"], 10)
    assert len(loaded.corners) == 6  # Five listed ones, and a wall that ends on another.
    assert arena_scores(loaded, Extractor("region_growing"))[0]["recall"] > 0.8
