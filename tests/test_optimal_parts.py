"""Method optimal: where surfaces part, and columns that are little seen."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lineament import Extractor, LaserScan, RangeNoise
from lineament.simulation import Sensor, World, truth

NOISE = RangeNoise(sigma=0.01)
EXTRACTOR = Extractor("optimal", noise=NOISE)
FAN = Sensor("fan", 181, -math.pi / 2, math.radians(1.0), noise=NOISE)
RING = Sensor("ring", 360, -math.pi, math.radians(1.0), noise=NOISE)


def features(world, sensor=FAN, seed=0):
    """What is found, and what there is."""
    pose = (0.0, 0.0, 0.0)
    scan = sensor.scan(world, pose, np.random.default_rng(seed))
    return EXTRACTOR(scan), truth(world, pose, sensor)


def regions(found):
    """Sizes of the clusters."""
    return np.bincount(found.clusters[found.clusters >= 0]).tolist()


@pytest.mark.parametrize("seed", range(5))
def test_a_step_that_is_hidden_parts_and_one_that_is_seen_does_not(seed):
    # The right half is nearer: from the left its side is hidden, from the right it is seen.
    hidden = World.of_polygons([[(3.0, -3.0), (3.0, 1.0), (3.4, 1.0), (3.4, 4.0)]])
    found, there = features(hidden, seed=seed)
    assert len(regions(found)) == len(regions(there)) == 2
    np.testing.assert_allclose(regions(found), regions(there), atol=1)
    seen = World.of_polygons([[(3.0, -3.0), (3.0, -1.5), (3.4, -1.5), (3.4, 4.0)]])
    found, there = features(seen, seed=seed)
    assert len(regions(found)) == len(regions(there)) == 1


@pytest.mark.parametrize("behind", [3.2, 3.25, 3.3])
@pytest.mark.parametrize("seed", range(5))
def test_a_wall_seen_edge_on_that_ends_before_another_makes_no_corner_with_it(seed, behind):
    # Their lines cross a beam from the end of the first, which is 0.3 m nearer there.
    world = World([[-1.0, 0.65, 3.0, 0.65], [behind, -3.0, behind, 3.0]])
    found, there = features(world, seed=seed)
    assert len(found.corners) == len(there.corners) == 0
    np.testing.assert_allclose(regions(found), regions(there), atol=1)


@pytest.mark.parametrize("seed", range(5))
def test_a_ring_with_one_jump_is_one_region(seed):
    room = [(3.0, -2.0), (3.0, 2.0), (-2.0, 2.0), (-2.0, -2.6), (1.0, -2.6), (1.0, -2.0)]
    found, there = features(World.of_polygons([[*room, room[0]]]), RING, seed)
    assert len(regions(found)) == len(regions(there)) == 1
    assert len(found.breakpoints) == len(there.breakpoints)


@pytest.mark.parametrize("seed", range(5))
def test_a_column_of_few_beams_has_its_steep_ends_and_is_parted_from_the_wall(seed):
    world = World([[4.0, -3.0, 4.0, 3.0]], circles=[[2.5, 0.0, 0.2]])
    found, there = features(world, seed=seed)
    assert len(there.arcs) == len(found.arcs) == 1
    assert abs(found.arcs["n_points"][0] - there.arcs["n_points"][0]) <= 2
    np.testing.assert_allclose(found.arcs["center"], there.arcs["center"], atol=0.1)
    assert len(regions(found)) == 3


@pytest.mark.parametrize("seed", range(5))
def test_a_false_return_beside_a_lost_one_does_not_part_a_wall(seed):
    rng, angles = np.random.default_rng(seed), math.radians(0.5) * np.arange(-60, 61)
    ranges = 2.0 / np.cos(angles) + 0.01 * rng.standard_normal(121)
    ranges[70], ranges[71] = 0.7, math.inf
    found = EXTRACTOR(LaserScan(ranges, angles[0], math.radians(0.5)))
    assert len(found.segments) == 1
    assert regions(found) == [119]
