"""The motion from matched features: exact without noise, consistent with it, blind in corridors."""

import math
from dataclasses import replace

import numpy as np
import pytest
from handmade import arc, corner, features, segment
from naive_motion import residuals

import lineament as ln
from lineament.motion import Matches, associate, estimate_motion
from lineament.scan.poses import compose, inverse
from lineament.simulation import SENSORS, World, scene

WALLS = (segment((2, -1), (2, 1), 10, 30), segment((2, 3), (-1, 3), 31, 60))
NONE = np.empty((0, 2), np.intp)
#: A motion that is known to 0.1 m and 0.1 rad.
WIDE = np.diag((0.1, 0.1, 0.1)) ** 2


def all_pairs(before, now):
    pairs = [
        np.column_stack([np.arange(len(t))] * 2) for t in (now.segments, now.corners, now.arcs)
    ]
    return Matches(before, now, *pairs)


def moved_by(motion, **rows):
    before = features(**rows)
    return all_pairs(before, before.transform(*inverse(motion)))


@pytest.mark.parametrize(
    "rows",
    [
        {"segments": WALLS},
        {"corners": [corner(1, 0, segments=(-1, -1)), corner(0, 3, segments=(-1, -1))]},
        {"arcs": [arc(1, 0, 0.3, 0, 9), arc(0, 3, 0.2, 10, 19)]},
        {"segments": WALLS[:1], "arcs": [arc(0, 3, 0.2, 10, 19)]},
    ],
)
@pytest.mark.parametrize("motion", [(0.3, -0.2, 0.15), (-1.0, 2.0, -0.9), (0.0, 0.0, 3.1)])
def test_motion_without_noise_is_recovered(rows, motion):
    start = tuple(np.add(motion, (0.05, -0.05, 0.08)))
    estimated = estimate_motion(moved_by(motion, **rows), start)
    np.testing.assert_allclose(estimated.pose, motion, atol=1e-5)
    assert estimated.observable


def test_covariance_by_hand():
    # Points at (1, 0) and (-1, 0), seen twice with 1 cm each: 2 cm² a point.
    points = [corner(x, 0.0, segments=(-1, -1)) for x in (1, -1)]
    motion = estimate_motion(moved_by((0.0, 0.0, 0.0), corners=points))
    np.testing.assert_allclose(motion.covariance, np.diag([1e-4, 1e-4, 1e-4]), atol=1e-8)


def test_a_corner_of_matched_walls_tells_nothing_new():
    whole = moved_by((0.1, 0.0, 0.0), segments=WALLS, corners=[corner(2, 3, segments=(0, 1))])
    walls = replace(whole, corners=NONE)
    np.testing.assert_allclose(estimate_motion(whole).covariance, estimate_motion(walls).covariance)
    # Where one wall is matched, the corner tells the place along it alone: here, y.
    one = replace(whole, segments=whole.segments[:1])
    known = residuals(one, np.array((0.1, 0.0, 0.0)), 0.0).information[1]
    np.testing.assert_allclose(known, [[0.0, 0.0], [0.0, 1 / 2e-4]], atol=1e-6)


def test_a_wrong_pair_counts_little():
    rows = [corner(x, y, segments=(-1, -1)) for x in (-1, 1, 2) for y in (-1, 1, 2)]
    matches = moved_by((0.1, 0.0, 0.02), corners=rows)
    matches.now.corners.flags.writeable = True
    matches.now.corners["position"][0] += (0.5, 0.3)
    np.testing.assert_allclose(estimate_motion(matches).pose, (0.1, 0.0, 0.02), atol=2e-3)


def test_derivatives_are_those_of_the_errors():
    rows = {"segments": WALLS, "corners": [corner(1, 0)], "arcs": [arc(1, 0, 0.3, 0, 9)]}
    matches, at = moved_by((0.3, -0.2, 0.15), **rows), np.array((0.25, -0.1, 0.2))
    jacobians = residuals(matches, at, 0.0).jacobians
    for k, step in enumerate(1e-6 * np.eye(3)):
        above, below = (residuals(matches, at + s * step, 0.0).errors for s in (1, -1))
        np.testing.assert_allclose(jacobians[:, :, k], (above - below) / 2e-6, atol=1e-6)


def test_nothing_matched_is_the_prior():
    motion = estimate_motion(Matches(features(), features(), NONE, NONE, NONE), (1, 2, 3), WIDE)
    assert motion.pose == (1, 2, 3)
    np.testing.assert_allclose(motion.covariance, WIDE)
    assert len(motion.unobserved) == 3


def test_one_wall_leaves_its_own_direction_to_the_prior():
    matches = moved_by((0.1, 0.3, 0.05), segments=WALLS[:1])
    motion = estimate_motion(matches, (0.0, 0.2, 0.0), WIDE)
    np.testing.assert_allclose(np.abs(motion.unobserved[:, :2]), [[0, 1]], atol=0.2)
    assert motion.x == pytest.approx(0.1, abs=0.02)
    assert motion.y == pytest.approx(0.2, abs=0.02)
    assert motion.covariance[1, 1] == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize("covariance", [np.zeros((3, 3)), np.eye(2), np.full((3, 3), math.nan)])
def test_prior_refused(covariance):
    with pytest.raises(ValueError, match=r"covariance (of the prior )?is .* expected \(3, 3\)"):
        estimate_motion(Matches(features(), features(), NONE, NONE, NONE), covariance=covariance)


def _estimated(extract, world, pose, motion, seed):
    rng = np.random.default_rng(seed)
    before, now = (
        extract(SENSORS["utm30lx"].scan(world, at, rng)) for at in (pose, compose(pose, motion))
    )
    first = estimate_motion(associate(before, now, covariance=WIDE), covariance=WIDE)
    return estimate_motion(associate(before, now, first.pose, first.covariance), covariance=WIDE)


@pytest.mark.parametrize("pair", [(0, 2), (2, 0), (-1, 0)])
def test_pairs_must_be_there(pair):
    walls = features(segments=WALLS)
    with pytest.raises(ValueError, match="name features that are not there"):
        estimate_motion(Matches(walls, walls, np.array([pair]), NONE, NONE))


def test_the_misfit_of_a_wall_counts_where_one_frame_saw_it_alone():
    # Two directions known to 1 mrad each, and two misfits of 1 cm over 2 m: 12 (2 · 0.01²)/2².
    noise, bow = 2e-6, 6e-4

    def frame(start, end):
        row = segment(start, end, 0, 99, sigma=(0.001, 0.001))
        row["misfit"] = 0.01
        return features(segments=[row])

    def turn_variance(start, end):
        return estimate_motion(all_pairs(wall, frame(start, end))).covariance[2, 2]

    wall = frame((2, -1), (2, 1))
    assert turn_variance((2, -1), (2, 1)) == pytest.approx(noise, rel=1e-3)
    assert turn_variance((2, 1), (2, 3)) == pytest.approx(noise + bow, rel=1e-3)
    # Of three metres that were seen, one is common.
    assert turn_variance((2, 0), (2, 2)) == pytest.approx(noise + bow * 2 / 3, rel=1e-3)


@pytest.mark.slow
def test_covariance_is_that_of_the_errors():
    """NEES of 120 motions has a deviation of √(2/360) = 0.075."""
    extract, squares = ln.Extractor(), []
    for seed in range(40):
        for kind in ("room", "star", "hall"):
            world, pose = scene(kind, seed)
            motion = tuple(0.05 * np.random.default_rng([seed, 1]).standard_normal(3))
            estimated = _estimated(extract, world, pose, motion, seed)
            assert estimated.observable
            error = np.subtract(estimated.pose, motion)
            squares.append(error @ np.linalg.solve(estimated.covariance, error) / 3)
    assert 0.8 < np.mean(squares) < 1.25


@pytest.mark.slow
def test_a_bare_corridor_is_told_unobservable():
    extract, corridor = ln.Extractor(), World([[-20, 1, 20, 1], [-20, -1, 20, -1]])
    for seed in range(10):
        motion = _estimated(extract, corridor, (0, 0, 0), (0.07, 0.02, 0.02), seed)
        assert len(motion.unobserved) == 1
        np.testing.assert_allclose(np.abs(motion.unobserved[0]), (1, 0, 0), atol=0.05)
        np.testing.assert_allclose(motion.pose, (0.0, 0.02, 0.02), atol=3e-3)
        assert motion.covariance[0, 0] == pytest.approx(WIDE[0, 0], rel=0.05)


@pytest.mark.slow
def test_a_corridor_with_an_end_wall_is_observable():
    extract = ln.Extractor()
    corridor = World([[-20, 1, 6, 1], [6, 1, 6, -1], [-20, -1, 6, -1]])
    for seed in range(5):
        motion = _estimated(extract, corridor, (0, 0, 0), (0.07, 0.02, 0.02), seed)
        assert motion.observable
        np.testing.assert_allclose(motion.pose, (0.07, 0.02, 0.02), atol=5e-3)
