"""Simulated storeys and wheels, and rays through large worlds."""

import math

import numpy as np
import pytest

from lineament.scan.poses import relative
from lineament.simulation import SENSORS, Wheels, cast_rays, office, raycast
from lineament.simulation.placing import clearance, is_free


@pytest.mark.parametrize("seed", range(8))
def test_walls_meet_at_their_ends_with_free_space_to_the_left(seed):
    storey = office(seed, (60, 40) if seed % 2 else (30, 20), identical=seed % 3 / 2)
    for plan in (storey.plan, storey.moved(seed, 0.5).plan, storey.mirrored()):
        walls = plan.segments
        _, counts = np.unique(walls.reshape(-1, 2).round(6), axis=0, return_counts=True)
        assert set(counts) == {2}
        along = walls[:, 2:] - walls[:, :2]
        lengths = np.hypot(*along.T)
        assert lengths.min() > 0.05
        aside = along[:, ::-1] * (-0.02, 0.02) / lengths[:, np.newaxis]
        middles = (walls[:, :2] + walls[:, 2:]) / 2
        assert is_free(plan, middles + aside).all()
        assert not is_free(plan, middles - aside).any()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_the_way_is_free_and_closes_after_every_corridor(seed):
    storey = office(seed, (60, 40))
    way = storey.waypoints
    assert way[0].tolist() == way[-1].tolist()
    legs = np.hypot(*np.diff(way, axis=0).T)
    assert 200 < legs.sum() < 900
    dense = [
        np.linspace(one, two, math.ceil(leg / 0.05) + 1)
        for one, two, leg in zip(way, way[1:], legs, strict=False)
    ]
    points = np.vstack(dense)
    assert is_free(storey.world, points).all()
    assert clearance(storey.world, points).min() > 0.3
    for low_x, low_y, high_x, high_y in storey.corridors:
        inside = (points >= (low_x, low_y)).all(axis=1) & (points <= (high_x, high_y)).all(axis=1)
        assert inside.sum() > 200


def test_a_storey_is_that_of_its_seed():
    one, same, other = office(5), office(5), office(6)
    assert one.world.segments.tolist() == same.world.segments.tolist()
    assert one.waypoints.tolist() == same.waypoints.tolist()
    assert one.plan.segments.tolist() != other.plan.segments.tolist()
    moved = one.refurnished(9)
    assert moved.plan is one.plan
    assert moved.world.segments.tolist() != one.world.segments.tolist()
    assert len(one.refurnished(9, 0).world.segments) == len(one.plan.segments)
    assert is_free(one.world, moved.plan.segments[:0, :2]).size == 0
    with pytest.raises(ValueError, match="expected 20 m x 16 m to"):
        office(0, (10, 40))


def test_rooms_of_an_identical_row_are_the_same_and_walls_move_by_what_is_asked():
    storey = office(2, identical=1.0)
    shapes = {}
    for room in storey.rooms:
        size = np.round((room.high[0] - room.low[0], room.door - room.low[0]), 6)
        shapes.setdefault((room.low[1], room.up), []).append(tuple(size))
    assert max(shapes.values(), key=len).count(max(shapes.values(), key=len)[0]) >= 6
    before = {(r.door, r.up): (*r.low, *r.high) for r in storey.rooms}
    off = np.array(
        [
            np.abs(np.subtract((*r.low, *r.high), before[r.door, r.up]))
            for r in storey.moved(1).rooms
        ]
    )
    assert set(off.sum(axis=1).round(9)) == {0.0, 0.3}
    assert 0.15 < (off.sum(axis=1) > 0).mean() < 0.45


def test_free_poses_and_people():
    storey, rng = office(4, (30, 20)), np.random.default_rng(1)
    for in_room in (True, False, None):
        poses = np.array([storey.free_pose(rng, in_room) for _ in range(20)])
        assert is_free(storey.world, poses[:, :2]).all()
        low, high = storey.corridors[:, :2], storey.corridors[:, 2:]
        at = poses[:, np.newaxis, :2]
        outside = ~((at >= low) & (at <= high)).all(axis=2).any(axis=1)
        assert in_room is None or (outside == in_room).all()
    still = len(storey.world.circles)
    one, later = (storey.with_people(3, t, (-9, -9, 0), 5).circles[still:] for t in (1.0, 1.5))
    assert one.shape == (10, 3)
    gone = np.hypot(*(one - later)[:, :2].T)
    assert 0.1 < gone.min() < gone.max() < 1.2
    assert is_free(storey.plan, one[:, :2]).all()
    at = (float(one[0, 0]), float(one[0, 1]), 0.0)
    kept = storey.with_people(3, 1.0, at, 5).circles[still:]
    assert np.hypot(*(kept[:, :2] - at[:2]).T).min() > 0.5


@pytest.mark.slow
def test_wheels_are_exact_without_faults_and_wrong_by_what_is_asked():
    half, n = 2.0, 200
    arc = [(half * math.sin(a), half * (1 - math.cos(a)), a) for a in np.linspace(0, 3, n)]
    exact = Wheels(radius=0, base=0, slip=0, jolts=0, tick=1e-9).odometry(arc, 1)
    np.testing.assert_allclose(exact, arc, atol=1e-6)
    straight = [(0.05 * k, 0.0, 0.0) for k in range(2001)]
    slips = Wheels(radius=0, base=0, slip=0.01, jolts=0, tick=1e-9)
    ends = np.array([slips.odometry(straight, seed)[-1] for seed in range(60)])
    # Both wheels by 0.01 m √100 each: their mean, and their difference over the track.
    assert ends[:, 2].std() == pytest.approx(math.sqrt(2) * 0.1 / 0.4, rel=0.35)
    wrong_track = Wheels(radius=0, base=0.1, slip=0, jolts=0, tick=1e-9).odometry(arc, 1)[-1][2]
    assert abs(wrong_track - 3) > 0.01


def test_a_drive_has_odometry_and_truth_apart():
    storey = office(1, (30, 20))
    scans, truth = storey.drive(SENSORS["lms181"], rate=1, wheels=Wheels(), people=3, seed=2)
    first = [next(scans) for _ in range(30)]
    assert [scan.stamp for scan in first] == list(range(30))
    off = [
        relative(relative(truth[0], pose), scan.pose)
        for pose, scan in zip(truth, first, strict=False)
    ]
    assert first[0].pose == (0, 0, 0)
    assert 1e-3 < np.hypot(*np.array(off)[-1, :2]) < 2.0
    bare, _ = storey.drive(SENSORS["lms181"], rate=1)
    assert next(bare).pose is None


@pytest.mark.parametrize("seed", range(4))
def test_rays_through_large_worlds_meet_what_every_beam_against_every_surface_meets(
    seed, monkeypatch
):
    storey, rng = office(seed, (30, 20)), np.random.default_rng(seed)
    poses = [storey.free_pose(rng) for _ in range(8)]
    # On a wall's end, on its line, and amid a column.
    x1, y1, x2, y2 = storey.world.segments[seed]
    poses += [(x1, y1, 0.0), ((x1 + x2) / 2, (y1 + y2) / 2, 1.0), (2 * x2 - x1, 2 * y2 - y1, 0)]
    poses += [(*storey.world.circles[seed, :2].tolist(), 0.3)]
    angles = np.append(rng.uniform(-9, 9, 300), np.arange(-8, 9) * math.pi / 4)
    found = [cast_rays(storey.world, pose, angles) for pose in poses]
    monkeypatch.setattr(raycast, "_BLOCK", 10**9)
    for pose, (ranges, surface) in zip(poses, found, strict=True):
        every = cast_rays(storey.world, pose, angles)
        np.testing.assert_array_equal(ranges, every[0])
        np.testing.assert_array_equal(surface, every[1])
