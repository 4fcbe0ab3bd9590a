"""Whether two scans may show one place: by hand, against a naive twin, and on drives."""

import math
from dataclasses import replace

import numpy as np
import pytest

import lineament as ln
from lineament.mapping import LineMap
from lineament.mapping.consistency import agreement, is_consistent
from lineament.mapping.following import Follower
from lineament.scan import LaserScan
from lineament.scan.poses import compose, inverse, relative
from lineament.simulation import SENSORS, World, room

HERE = (0.0, 0.0, 0.0)


def ring(ranges, first=0.0):
    """Return a scan of a whole circle; an end at a beam is beside that one and one on each side."""
    step = 2 * math.pi / len(ranges)
    return LaserScan(np.asarray(ranges, float), first, step)


@pytest.mark.parametrize(("nearer", "expected"), [(26, True), (27, False)])
def test_at_most_so_many_beams_may_end_where_the_other_scan_looked_through(nearer, expected):
    """Of 100 beams, k end nearer: 100 - k are explained in both scans, k contradicted in one."""
    ranges = np.full(100, 2.0)
    ranges[:nearer] = 1.0
    assert is_consistent(ring(np.full(100, 2.0)), ring(ranges), HERE) is expected
    assert is_consistent(ring(ranges), ring(np.full(100, 2.0)), HERE) is expected


def test_what_lies_behind_says_nothing_but_what_was_before_it_is_gone():
    assert not is_consistent(ring(np.full(100, 2.0)), ring(np.full(100, 4.0)), HERE)


@pytest.mark.parametrize("bad", [math.nan, math.inf, 0.0])
def test_few_beams_say_nothing(bad):
    """The other scan has 19 ends beside 17 beams, which look through them; 20 beside 18."""
    few = np.full(100, bad)
    few[:17] = 4.0
    assert is_consistent(ring(np.full(100, 2.0)), ring(few), HERE)
    few[:18] = 4.0
    assert not is_consistent(ring(np.full(100, 2.0)), ring(few), HERE)
    assert is_consistent(ring(few), ring(np.full(100, bad)), HERE)


@pytest.mark.parametrize(("off", "expected"), [(0.079, True), (0.081, False)])
def test_ends_are_explained_within_8_cm_and_a_tenth_of_the_way(off, expected):
    before = ring(np.full(100, 2.0))
    assert is_consistent(before, ring(np.full(100, 2.0 - off)), HERE) is expected


@pytest.mark.parametrize("turn", [0.5, 2.0, 3.1, -3.1, 9.0])
def test_turns_are_followed_across_the_ends_of_the_circle(turn):
    bearings = np.arange(120) * 2 * math.pi / 120
    before = ring(3.0 + 2.0 * np.sign(np.sin(bearings)))
    after = ring(3.0 + 2.0 * np.sign(np.sin(bearings + turn)))
    assert is_consistent(before, after, (0.0, 0.0, turn))
    assert not is_consistent(before, after, (0.0, 0.0, turn + 1.5))


def naive(before, scan, motion):
    """Count the ends that are explained and contradicted, one beam after the other."""
    near = 0.08 + 0.1 * math.dist(motion[:2], (0, 0))
    spacing = max(before.angle_increment, scan.angle_increment)
    turned = max(0.015, 1.01 * spacing) + 0.1 * abs(math.remainder(motion[2], math.tau))
    explained = contradicted = 0
    for ends, beams, pose in ((scan, before, motion), (before, scan, inverse(motion))):
        for r, bearing in zip(ends.ranges[ends.valid], ends.angles[ends.valid], strict=True):
            x, y, _ = compose(pose, (r * math.cos(bearing), r * math.sin(bearing), 0.0))
            beside = [
                s
                for s, other in zip(
                    beams.ranges[beams.valid], beams.angles[beams.valid], strict=True
                )
                if abs(math.remainder(other - math.atan2(y, x), math.tau)) < turned
            ]
            if not beside:
                continue
            far = math.hypot(x, y)
            explained += min(beside) - near < far < max(beside) + near
            contradicted += far <= min(beside) - near
    return explained, contradicted


def test_it_counts_as_a_loop_over_beams_does():
    rng, found = np.random.default_rng(3), []
    for _ in range(150):
        n = int(rng.integers(5, 90))
        ranges = rng.uniform(1.0, rng.choice((1.1, 1.3, 3.0)), n)
        ranges[rng.random(n) < 0.1] = math.nan
        before = LaserScan(ranges, -2.5, rng.uniform(0.01, 5.0 / n))
        noise = rng.normal(0.0, rng.choice((0.02, 0.1)), n)
        motion = tuple(rng.normal(0.0, (0.1, 0.1, 0.05)))
        after = LaserScan(
            np.where(rng.random(n) < 0.9, ranges + noise, 0.5), -2.5, before.angle_increment
        )
        found.append(is_consistent(before, after, motion))
        explained, contradicted = naive(before, after, motion)
        share = (
            explained / (explained + contradicted) if explained + contradicted > 19 else math.nan
        )
        np.testing.assert_allclose(agreement(before, after, [motion]), [share], rtol=1e-12)
        assert found[-1] == (not share < 0.85)
        assert found[-1] == is_consistent(after, before, inverse(motion))
    assert 30 < sum(found) < 120


@pytest.mark.parametrize("sensor", ["paper", "lms181", "utm30lx", "rplidar", "ld19"])
def test_in_a_bare_corridor_all_motions_along_it_agree_alike(sensor):
    """Else a robot that drives seems to stand, where the beams of both scans lie on each other."""
    world, along = World([[-60, 1, 60, 1], [60, -1, -60, -1]]), np.linspace(-0.3, 0.3, 13)
    motions = np.column_stack((along, np.zeros((13, 2))))
    for step in (0.0, 0.03, 0.1, 0.2):
        rng = np.random.default_rng(1)
        here, there = (SENSORS[sensor].scan(world, (x, 0.0, 0.0), rng) for x in (0.0, step))
        assert np.ptp(agreement(here, there, motions)) < 0.01


@pytest.mark.parametrize("sensor", ["paper", "lms181", "utm30lx", "rplidar", "ld19"])
def test_scans_of_a_room_are_consistent_by_their_motion_alone(sensor):
    rng, poses = np.random.default_rng(1), [(-1.0, 0.5, 0.7), (-0.8, 0.6, 0.9)]
    before, after = (SENSORS[sensor].scan(room(), pose, rng) for pose in poses)
    motion = relative(*poses)
    assert is_consistent(before, after, motion)
    assert not is_consistent(before, after, compose(motion, (0.0, 0.0, 0.6)))


def test_a_robot_that_looks_through_what_it_saw_is_lost_though_the_plan_goes_with_it():
    """It stood among things that the plan does not have; a plain room has two places for it."""
    bare = [(-3, -2, 3, -2), (3, -2, 3, 2), (3, 2, -3, 2), (-3, 2, -3, -2)]
    boxes = [(1.0, -1.2, 1.0, 0.3), (-1.5, 1.0, 0.2, 1.0)]
    plan, extract, rng = (
        LineMap.from_lines(bare, sigma=0.045),
        ln.Extractor(),
        np.random.default_rng(2),
    )
    follower, verdicts = Follower(plan), []
    follower.suppose((-0.5, 0.2, 0.1))
    for k, lines in enumerate([[*bare, *boxes]] * 4 + [bare]):
        scan = SENSORS["ld19"].scan(World(np.array(lines)), (-0.5, 0.2, 0.1), rng)
        verdicts.append(follower(extract(scan.stamped("first", k * 10**8)), HERE).verdict)
    assert verdicts[-2:] == ["located", "ambiguous"]


def test_without_a_clock_nothing_says_how_far_it_went_along_a_corridor():
    """From the end of a corridor into its middle, where a scanner of 8 m sees neither end."""
    walls = [(0, -1, 40, -1), (40, -1, 40, 1), (40, 1, 0, 1), (0, 1, 0, -1)]
    world, plan = World(np.array(walls)), LineMap.from_lines(walls, sigma=0.045)
    sensor = replace(SENSORS["rplidar"], range_max=8.0)
    follower, extract, rng = Follower(plan), ln.Extractor(), np.random.default_rng(5)
    follower.suppose((4.0, 0.1, 0.0))
    verdicts = []
    for x in np.arange(4.0, 20.0, 0.5):
        scan = sensor.scan(world, (x, 0.1, 0.0), rng).stamped("first", 0)
        where = follower(extract(scan))
        verdicts.append(where.verdict)
        assert where.verdict != "located" or abs(where.pose[0] - x) < 0.3
    assert (verdicts[0], verdicts[1]) == ("located", "direction unobserved")
    assert "located" not in verdicts[-10:]
