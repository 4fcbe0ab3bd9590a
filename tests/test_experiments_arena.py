"""The arena with its fitted walls, and pairs of scans in logs with poses."""

from __future__ import annotations

import math

import numpy as np
import pytest
from handmade import corner, features

from lineament import Extractor, LaserScan
from lineament.logs import save_npz
from lineament.reproduce import Setting, arena, repeatability
from lineament.reproduce.arena import ARENA, arena_scores, load_arena
from lineament.reproduce.repeatability import scan_pairs
from lineament.simulation import Sensor, World, truth

#: A room of 4 m x 3 m whose fitted walls leave gaps at two corners; a board ends on a wall.
WALLS = [[0, 0, 4, 0], [4, 0.05, 4, 3], [4, 3, 0.08, 3], [0, 3, 0, 0], [2, 3.02, 2, 2]]
CORNERS = [[0, 0], [4, 0], [4, 3], [0, 3]]


@pytest.fixture
def recording(tmp_path):
    closed = World([[0, 0, 4, 0], [4, 0, 4, 3], [4, 3, 0, 3], [0, 3, 0, 0], [2, 3, 2, 2]])
    poses = np.array([(0.8, 0.8, 0.3), (3.0, 0.7, 2.0), (1.2, 1.5, -1.0), (2.5, 0.6, 3.0)])
    sensor = Sensor("ring", 720, -math.pi, math.radians(0.5), 0.0, 30.0)
    rng = np.random.default_rng(0)
    ranges = [sensor.scan(closed, tuple(pose), rng).ranges for pose in poses.tolist()]
    path = tmp_path / "arena.npz"
    np.savez(
        path,
        ranges=ranges,
        poses=poses + 1.0,
        poses_refined=poses,
        angle_min=sensor.angle_min,
        angle_increment=sensor.angle_increment,
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
    assert len(load_arena(recording, 100).scans) == 4


def test_visible_corners_are_in_the_frame_of_the_scan(recording):
    loaded = load_arena(recording, 4)
    for scan, true in zip(loaded.scans, loaded.truths, strict=True):
        for position in true.transform(*scan.pose).corners["position"]:
            assert min(np.hypot(*(np.array(CORNERS) - position).T)) < 1e-9


@pytest.mark.parametrize(("kept", "shown"), [(3, False), (4, True)])
def test_a_corner_is_demanded_where_both_its_walls_show(kept, shown):
    """Of the wall x = 4 beside (4, 0) all measurements but a few are 5 cm before it.

    Those that count are from 0.1 to 0.6 m from the corner, along the wall: the other faces and the
    corner at (4, 3) are as they were.
    """
    walls = World([[0, 0, 4, 0], [4, 0, 4, 3], [4, 3, 0, 3], [0, 3, 0, 0]])
    sensor, pose = Sensor("ring", 720, -math.pi, math.radians(0.5), 0.0, 30.0), (1.5, 1.5, 0.3)
    scan = sensor.scan(walls, pose, np.random.default_rng(0))
    visible = truth(walls, pose, sensor)
    assert arena.faces_shown(scan, visible, walls).tolist() == [True] * 4
    bearings = scan.angles + pose[2]
    x, y = pose[0] + scan.ranges * np.cos(bearings), pose[1] + scan.ranges * np.sin(bearings)
    on_face = np.flatnonzero((abs(x - 4) < 1e-3) & (y > 0.1) & (y < 0.6))
    assert len(on_face) > 8
    ranges = scan.ranges.copy()
    ranges[on_face[kept:]] -= 0.05 / np.cos(bearings[on_face[kept:]])
    before = LaserScan(ranges, sensor.angle_min, sensor.angle_increment, pose=pose)
    corner_at = visible.transform(*pose).corners["position"]
    demanded = arena.faces_shown(before, visible, walls)
    there = np.hypot(*(corner_at - (4, 0)).T) < 1e-6
    assert there.sum() == 1
    assert demanded[there].tolist() == [shown]
    assert demanded[~there].all()


def test_a_scan_without_a_pose_shows_no_faces():
    scan = LaserScan([2.0] * 9, angle_min=0.0, angle_increment=0.01)
    with pytest.raises(ValueError, match="scan has no pose"):
        arena.faces_shown(scan, features(n=9), World([[0, 0, 4, 0]]))


def test_scores_of_found_corners_worked_by_hand(recording, monkeypatch):
    """Of four visible corners one is found 3 cm off; the board's end is no mistake, one is."""
    loaded = load_arena(recording, 1)
    x, y, theta = loaded.scans[0].pose
    found = features(n=720, corners=[corner(0.03, 0), corner(2, 3), corner(2, 0)])
    turn = np.array([[math.cos(theta), -math.sin(theta)], [math.sin(theta), math.cos(theta)]])
    found.corners["position"] = (found.corners["position"] - (x, y)) @ turn
    monkeypatch.setattr(arena, "batch_of", lambda *_: [found])
    scores = arena_scores(loaded, Extractor("iepf"))
    visible = len(loaded.truths[0].corners)
    assert visible >= 3
    summary = scores.summary()
    assert summary["recall"] == 1 / visible
    assert summary["false"] == pytest.approx(1 / 3)
    assert summary["median_error"] == pytest.approx(0.03)
    assert summary["corners_per_scan"] == 3


def test_methods_find_the_corners_of_the_recorded_arena(data_dir):
    loaded = load_arena(data_dir / ARENA, 10)
    assert len(loaded.corners) == 6  # Five listed ones, and a wall that ends on another.
    assert arena_scores(loaded, Extractor("region_growing")).summary()["recall"] > 0.8


def test_scan_pairs_are_apart_by_way_or_by_turn(tmp_path):
    poses = [(0.1 * i, 0.0, 0.0) for i in range(8)] + [
        (0.7, 0.0, math.radians(8 * i)) for i in (1, 2)
    ]
    path = tmp_path / "log.npz"
    scans = [LaserScan([2.0] * 9, 0.0, 0.01, pose=pose, stamp=i) for i, pose in enumerate(poses)]
    save_npz(path, scans)
    pairs = scan_pairs(path, 5)
    stamps = [(a.stamp, b.stamp) for a, b in pairs]
    # Every second one; 0.3 m are three or (as 0.1 is none in binary) four scans, 15° are two.
    assert [a for a, _ in stamps] == [0, 2, 4, 6]
    assert all(b - a in (3, 4, 5) for a, b in stamps)
    assert stamps[-1] == (6, 9)


def test_without_recordings_it_says_so():
    findings = repeatability.run(Setting(frames=1), lambda _: None)
    assert findings.text == ("The recordings are not there: nothing was measured.",)
    assert findings.tables == findings.figures == ()
