"""Features found again from other places."""

from __future__ import annotations

import math

import numpy as np
import pytest
from handmade import corner, features, segment

import lineament as ln
from lineament.evaluation import Repeatability, repeatability
from lineament.evaluation.repeatability import in_sight
from lineament.simulation import SENSORS, Sensor, World, room

PAPER = SENSORS["paper"]


def corners_at(*positions):
    return features(corners=[corner(*p) for p in positions])


# A wall x = 3 and a pillar before its upper half, as the first scanner sees it.
WORLD = World([[3, -3, 3, 3], [1.5, 0.5, 1.5, 1.1]])
QUIET = Sensor("quiet", 361, -math.pi / 4, math.pi / 720, range_max=20.0)
HERE, THERE = (0.0, 0.0, 0.0), (2.0, -1.0, math.pi / 2)
RNG = np.random.default_rng(0)
SCAN = QUIET.scan(WORLD, HERE, RNG)
OTHER = QUIET.scan(WORLD, THERE, RNG)


def seen_from(pose, found):
    """Features of the world frame in that of a sensor."""
    x, y, theta = pose
    return found.transform(-x, -y, 0).transform(0, 0, -theta)


def test_in_sight_by_hand():
    points = {
        (2.0, 0.0): True,  # before the wall
        (3.05, 0.0): True,  # on it
        (3.2, 0.0): False,  # behind it
        (3.0, 1.4): False,  # on it, behind the pillar
        (1.5, 0.8): True,  # on the pillar
        (0.0, 2.0): False,  # outside of the field of view
        (-1.0, 0.0): False,
    }
    assert in_sight(SCAN, np.array(list(points)), 0.1).tolist() == list(points.values())
    # Nothing is known where nothing returned.
    blind = ln.LaserScan([np.inf] * 90, -math.pi / 4, math.pi / 180, range_max=20.0)
    assert not in_sight(blind, np.array([[2.0, 0.0]]), 0.1).any()
    assert in_sight(ln.LaserScan([], 0.0, 0.1), np.zeros((2, 2)), 0.1).tolist() == [False] * 2


def test_in_sight_around_the_circle():
    n = 360
    ring = ln.LaserScan([2.0] * n, math.pi / 3, 2 * math.pi / n, range_max=20.0)
    bearings = np.random.default_rng(0).uniform(-10, 10, 200)
    around = np.column_stack((np.cos(bearings), np.sin(bearings)))
    assert in_sight(ring, 1.99 * around, 0.1).all()
    assert not in_sight(ring, 2.2 * around, 0.1).any()


def test_repeated_corners_by_hand():
    here = seen_from(HERE, corners_at((3, 0), (3, -1), (3, 0.3)))
    there = corners_at((3, 0.04), (3, -0.5), (3, 1.4), (5, 0), (3, -2.9))
    found = repeatability(SCAN, here, OTHER, seen_from(THERE, there))
    # Found again; not found again; hidden by the pillar; behind the wall; in view, not found.
    assert (found.corners.expected, found.corners.repeated) == (3, 1)
    assert found.corners.rate == 1 / 3
    assert found.corners.rmse == pytest.approx(0.04)
    assert found.segments.expected == 0
    twice = found + found
    assert (twice.corners.expected, twice.corners.repeated) == (6, 2)


@pytest.mark.parametrize(
    ("there", "expected", "repeated"),
    [
        (((3, -2), (3, 0.5)), 1, 1),
        (((3, -2.9), (3, 2.9)), 1, 1),  # longer than what is seen of it from here
        (((3.04, -2), (3.04, 0.5)), 1, 1),
        (((2.85, -2), (2.85, 0.5)), 1, 0),  # too far before it
        (((3, 0.5), (3, -2)), 0, 0),  # its back
        (((3, 1.2), (3, 1.9)), 0, 0),  # hidden
        (((2.7, 0.0), (3.3, 0.6)), 1, 0),  # another direction
        (((3, -2.95), (3, -2.3)), 1, 0),  # a part that is not found here
    ],
)
def test_repeated_segments_by_hand(there, expected, repeated):
    here = features(segments=[segment((3, -2), (3, 1), 0, 50)])
    other = features(segments=[segment(*there, 0, 50)])
    found = repeatability(SCAN, here, OTHER, seen_from(THERE, other))
    assert (found.segments.expected, found.segments.repeated) == (expected, repeated)


def test_pieces_of_one_wall_are_found_again_once():
    here = features(segments=[segment((3, -2), (3, 1), 0, 50)])
    pieces = [segment((3, -2), (3, -1), 0, 20), segment((3, -0.9), (3, 0.1), 21, 40)]
    found = repeatability(SCAN, here, OTHER, seen_from(THERE, features(segments=pieces)))
    assert (found.segments.expected, found.segments.repeated) == (2, 1)


def test_a_scan_repeats_itself():
    scan = PAPER.scan(room(), (0.2, 0.1, 1.0), np.random.default_rng(5))
    found = ln.extract(scan, method="liu:scale_free")
    again = repeatability(scan, found, scan, found)
    assert again.corners.rate == again.segments.rate == 1
    assert again.corners.rmse == pytest.approx(0, abs=1e-12)


def test_repeatability_refuses():
    lost = ln.LaserScan(SCAN.ranges, SCAN.angle_min, SCAN.angle_increment)
    nothing = features(len(SCAN))
    with pytest.raises(ValueError, match="other_scan has no pose"):
        repeatability(SCAN, nothing, lost, nothing)
    with pytest.raises(ValueError, match=r"gate is -1, expected a distance > 0"):
        repeatability(SCAN, nothing, SCAN, nothing, gate=-1)
    assert math.isnan(repeatability(SCAN, nothing, SCAN, nothing).corners.rate)
    assert Repeatability.total([]).segments.expected == 0


def test_repeatability_of_a_real_log(data_dir):
    """Neighbouring scans of the arena, whose poses are good to a centimetre."""
    log = np.load(data_dir / "truth" / "jackal_static_data.npz")
    scans = [
        ln.LaserScan(
            ranges,
            float(log["angle_min"]),
            float(log["angle_increment"]),
            range_max=float(log["range_max"]),
            pose=tuple(pose),
        )
        for ranges, pose in zip(log["ranges"][:6], log["poses"][:6], strict=True)
    ]
    extract = ln.Extractor("liu:scale_free")
    found = [extract(scan) for scan in scans]
    total = Repeatability.total(
        repeatability(scans[i], found[i], scans[i + 1], found[i + 1]) for i in range(5)
    )
    assert total.segments.expected > 10
    assert total.segments.rate > 0.5
