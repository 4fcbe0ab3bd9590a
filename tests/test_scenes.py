"""Random scenes: what their worlds and poses promise, whatever the seed."""

import math
from collections import Counter

import numpy as np
import pytest

from lineament.simulation import SCENES, Sensor, World, building, cast_rays, room, scene, truth
from lineament.simulation.placing import Floor, clearance, is_free
from lineament.simulation.worlds import rectangle

SEEDS = range(12)
EVERY = [scene(kind, seed) for kind in SCENES for seed in SEEDS]
EVERY += [(building()[0], (x, y, 0.0)) for x, y in building()[1].tolist()]
EVERY += [(room(), (0.0, 0.0, 0.0))]
RING = Sensor("ring", 720, -math.pi, math.pi / 360)


def walls_apart(world):
    """Least distance of each wall from those that it shares no end with."""
    shares = 0
    least = math.inf
    for i, wall in enumerate(world.segments):
        ends = wall.reshape(2, 2)
        others = np.array([
            other for j, other in enumerate(world.segments)
            if j != i and not (ends[:, None] == other.reshape(2, 2)).all(axis=2).any()
        ])  # fmt: skip
        shares += len(world.segments) - 1 - len(others)
        along = np.linspace(0, 1, 40)[:, np.newaxis]
        points = (1 - along) * ends[0] + along * ends[1]
        least = min(least, clearance(World(others), points).min())
    assert shares == 2 * len(world.segments)
    return least


@pytest.mark.parametrize(("world", "pose"), EVERY)
def test_the_scanner_stands_clear_in_a_closed_world(world, pose):
    assert clearance(world, [pose[:2]])[0] >= 0.3
    assert is_free(world, [pose[:2]])[0]
    ranges, _ = cast_rays(world, pose, RING.angles)
    assert np.isfinite(ranges).all()
    assert ranges.max() < 25
    assert all(isinstance(value, float) for value in pose)


@pytest.mark.parametrize("world", [world for world, _ in (*EVERY[:-2:3], *EVERY[-2:])])
def test_walls_meet_at_their_ends_alone(world):
    ends = Counter(map(tuple, world.segments.reshape(-1, 2).tolist()))
    assert set(ends.values()) == {2}
    assert walls_apart(world) > 0.02  # the thinnest walls are 3 cm thick
    for i, (x, y, r) in enumerate(world.circles):
        others = World(world.segments, np.delete(world.circles, i, axis=0))
        assert clearance(others, [(x, y)])[0] >= r + 0.2 - 1e-9
        assert is_free(others, [(x, y)])[0]


#: Sum of the squares of all numbers of the first twelve scenes of a kind.
SQUARES = {
    "room": 9158.98945879,
    "star": 3275.83423833,
    "corridor": 67007.0439540,
    "hall": 14639.2485779,
    "grazing": 31605.6975253,
    "layers": 63592.4094855,
}


@pytest.mark.parametrize("kind", SCENES)
def test_a_seed_gives_the_scene_that_it_always_gave(kind):
    scenes = [scene(kind, seed) for seed in SEEDS]
    parts = [part for world, pose in scenes for part in (world.segments, world.circles, pose)]
    assert sum(np.square(part).sum() for part in parts) == pytest.approx(SQUARES[kind], rel=1e-9)


def test_each_kind_holds_what_it_is_for():
    for kind, name, least in (
        *(("room", "corners", 5), ("star", "corners", 5), ("corridor", "breakpoints", 3)),
        *(("hall", "arcs", 2), ("hall", "corners", 4), ("layers", "breakpoints", 10)),
        ("grazing", "segments", 10),
    ):
        scans = [truth(*scene(kind, seed), RING) for seed in SEEDS]
        assert np.mean([len(getattr(scan, name)) for scan in scans]) > least


def test_a_star_has_no_flat_corners():
    for seed in range(200):
        ends = scene("star", seed)[0].segments.reshape(-1, 2, 2)
        bearings = np.unwrap(np.arctan2(*(ends[:, 1] - ends[:, 0]).T[::-1]))
        assert abs(np.diff(bearings, append=bearings[0] + 2 * math.pi)).min() >= math.radians(20)


def test_thin_walls_are_met_at_grazing_incidence():
    incidences = []
    for seed in SEEDS:
        world, pose = scene("grazing", seed)
        for segment in truth(world, pose, RING).segments:
            x, y = segment["centroid"]
            incidences.append(abs(math.cos(segment["angle"] - math.atan2(y, x))))
    assert np.mean(np.array(incidences) > math.cos(math.radians(20))) > 0.3


def test_clearance_and_freedom_by_hand():
    points = [(0, 0), (1.8, -0.8), (1.3, -0.8), (2.9, 1.9), (5, 0)]
    np.testing.assert_allclose(clearance(room(), points), (np.hypot(1.4, 0.5), 0.3, 0.1, 0.1, 2))
    assert is_free(room(), points).tolist() == [True, False, True, True, False]
    column = World(room().segments, [[-1, 0, 0.5]])
    assert clearance(column, [(-1.2, 0)])[0] == pytest.approx(0.3)
    assert is_free(column, [(-1.2, 0), (-1.5, 0), (-1.6, 0)]).tolist() == [False, True, True]
    assert clearance(World([]), [(0, 0)]).tolist() == [math.inf]


def test_obstacles_are_put_where_there_is_room_alone():
    floor = Floor(rectangle((0, 0), 6, 4), (-2.0, 0.0, 0.0))
    assert not floor.put_box((2.5, 0), 1.5, 0.3)  # in the wall
    assert not floor.put_box((-2.3, 0.3), 0.3, 0.3)  # on the scanner
    assert not floor.put_column((9, 9), 0.2)  # outside
    assert floor.put_box((1, 0), 1.5, 1.5, 0.5)
    assert not floor.put_column((1, 0), 0.1)  # inside the box
    assert not floor.put_box((1, 0), 0.3, 0.3)
    assert floor.put_box((-0.3, -1.5), 2.0, 0.05, 0.1)  # beside the box, longer than its gap
    assert repr(floor.world) == "World(12 segments, 0 circles)"
