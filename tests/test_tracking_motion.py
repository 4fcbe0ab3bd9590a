"""The motion from matched features: exact without noise, consistent with it, blind in corridors."""

import math

import naive_tracking as naive
import numpy as np
import pytest
from handmade import arc, corner, features, segment

import lineament as ln
from lineament.kernels.tracking.symmetric import diagonalise
from lineament.motion import Matches, associate, estimate_motion
from lineament.motion.association import KINDS
from lineament.scan.poses import compose, inverse
from lineament.simulation import SENSORS, World, scene

APART = (segment((2, -1), (2, 1), 10, 30), segment((2, 3), (-1, 3), 31, 60))
NONE = np.empty((0, 2), np.intp)
#: A motion that is known to 0.1 m and 0.1 rad.
WIDE = np.diag((0.1, 0.1, 0.1)) ** 2


#: What only kernels call has no wrapper for Python where numba compiles it.
_diagonalise = getattr(diagonalise, "py_func", diagonalise)


def symmetric_matrices():
    """Information of frames: full, of a corridor, of one direction, with equal and tiny parts."""
    rng = np.random.default_rng(3)
    for scale in (1.0, 1e6, 1e-6):
        for rank in (3, 2, 1):
            for _ in range(20):
                factor = rng.normal(size=(3, rank)) * 10.0 ** rng.uniform(-3, 3, rank)
                yield scale * factor @ factor.T
    corridor = np.array([[0.0, 0.0, 0.0], [0.0, 5e4, -3e4], [0.0, -3e4, 2e5]])
    yield from (corridor, np.diag((1.0, 1.0, 2.0)), np.ones((3, 3)), np.zeros((3, 3)))
    yield np.array([[1.0, 1e-9, 0.0], [1e-9, 1.0, 1e-9], [0.0, 1e-9, 1.0]])


def test_eigenvectors_are_those_of_numpy():
    for given in symmetric_matrices():
        matrix, vectors = given.copy(), np.empty((3, 3))
        _diagonalise(matrix, vectors)
        scale = max(np.abs(given).max(), 1e-300)
        assert (np.abs(matrix - np.diag(np.diag(matrix))) <= 1e-12 * scale).all()
        np.testing.assert_allclose(
            np.sort(np.diag(matrix)), np.linalg.eigvalsh(given), atol=1e-12 * scale
        )
        np.testing.assert_allclose(vectors.T @ vectors, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(
            vectors @ np.diag(np.diag(matrix)) @ vectors.T, given, atol=1e-11 * scale
        )


def moved_by(motion, **rows):
    before = features(**rows)
    now = before.transform(*inverse(motion))
    pairs = [np.column_stack([np.arange(len(getattr(now, kind)))] * 2) for kind in KINDS]
    return Matches(before, now, *pairs)


def two_points(sigma):
    return [corner(x, 0.0, segments=(-1, -1), sigma=sigma) for x in (1, -1)]


@pytest.mark.parametrize(
    "rows",
    [
        {"segments": APART},
        {"corners": two_points(0.01)},
        {"arcs": [arc(1, 0, 0.3, 0, 9), arc(0, 3, 0.2, 10, 19)]},
        {"segments": APART[:1], "arcs": [arc(0, 3, 0.2, 10, 19)]},
    ],
)
@pytest.mark.parametrize("motion", [(0.3, -0.2, 0.15), (-1.0, 2.0, -0.9), (0.0, 0.0, 3.1)])
def test_motion_without_noise_is_recovered(rows, motion):
    start = tuple(np.add(motion, (0.05, -0.05, 0.08)))
    estimated = estimate_motion(moved_by(motion, **rows), start)
    np.testing.assert_allclose(estimated.pose, motion, atol=1e-5)
    assert estimated.observable


@pytest.mark.parametrize(("sigma", "lost"), [(0.01, 0), (0.095, 0), (0.105, 3)])
def test_covariance_by_hand(sigma, lost):
    # Points at (1, 0) and (-1, 0), seen twice: 2 σ² a point. What is known to 10 cm is observed.
    motion = estimate_motion(moved_by((0.0, 0.0, 0.0), corners=two_points(sigma)))
    assert len(motion.unobserved) == lost
    if not lost:
        np.testing.assert_allclose(motion.covariance, sigma**2 * np.eye(3), rtol=2e-3, atol=1e-8)


def test_derivatives_of_the_twin_are_those_of_its_errors():
    rows = {"segments": APART, "corners": [corner(1, 0)], "arcs": [arc(1, 0, 0.3, 0, 9)]}
    matches, motion = moved_by((0.3, -0.2, 0.15), **rows), np.array((0.25, -0.1, 0.2))
    jacobians = np.array([j for _, j, *_ in naive.residuals(matches, motion, 0.0)])
    for k, step in enumerate(1e-6 * np.eye(3)):
        above, below = (
            np.array([e for e, *_ in naive.residuals(matches, motion + s * step, 0.0)])
            for s in (1, -1)
        )
        np.testing.assert_allclose(jacobians[:, :, k], (above - below) / 2e-6, atol=1e-6)


def test_nothing_matched_is_the_prior():
    motion = estimate_motion(Matches(features(), features(), NONE, NONE, NONE), (1, 2, 3), WIDE)
    assert motion.pose == (1, 2, 3)
    np.testing.assert_allclose(motion.covariance, WIDE)
    assert len(motion.unobserved) == 3


def test_one_wall_leaves_its_own_direction_to_the_prior():
    motion = estimate_motion(moved_by((0.1, 0.3, 0.05), segments=APART[:1]), (0.0, 0.2, 0.0), WIDE)
    np.testing.assert_allclose(np.abs(motion.unobserved[:, :2]), [[0, 1]], atol=0.2)
    assert motion.x == pytest.approx(0.1, abs=0.02)
    assert motion.y == pytest.approx(0.2, abs=0.02)
    assert motion.covariance[1, 1] == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize(("turn", "lost"), [(0.0075, 1), (0.0095, 0)])
def test_walls_that_are_parallel_but_for_their_errors_leave_a_direction_open(turn, lost):
    # Directions known to 1 mrad, twice, of two walls: 3 · √(2 · 2 · 2) mrad may be feigned.
    x, y = math.cos(turn), math.sin(turn)
    ends = ((-1, -1), (1, -1)), ((x, 1 + y), (-x, 1 - y))
    walls = [segment(*pair, 0, 9, sigma=(0.0001, 0.001)) for pair in ends]
    assert len(estimate_motion(moved_by((0.0, 0.0, 0.0), segments=walls)).unobserved) == lost


@pytest.mark.parametrize("directed", [0.06, 0.08])
def test_the_jamb_of_a_door_shows_a_motion_by_itself_or_by_its_corner(directed):
    """Jambs of 0.1 m whose directions are known to 85 and 113 mrad: the second is left to it."""
    ends = ((-9, -1), (9, -1)), ((3, 1), (-9, 1)), ((3, 1.1), (3, 1))
    sigmas = (0.001, 0.0001), (0.001, 0.0001), (0.01, directed)
    walls = [segment(*pair, 0, 9, sigma=of) for pair, of in zip(ends, sigmas, strict=True)]
    matches = moved_by((0.1, 0.0, 0.0), segments=walls, corners=[corner(3, 1, segments=(2, 1))])
    motion = estimate_motion(matches, (0.0, 0.0, 0.0), WIDE)
    assert motion.observable
    # Two measurements of 1 cm, and what was known to 10 cm before.
    known = 1 / (2 * 0.01**2)
    assert motion.x == pytest.approx(0.1 * known / (known + 100), abs=1e-3)
    assert motion.covariance[0, 0] == pytest.approx(1 / (known + 100), rel=0.02)


@pytest.mark.parametrize(
    "covariance",
    [
        *(np.zeros((3, 3)), np.eye(2), np.full((3, 3), math.nan), np.ones((3, 3))),
        *(np.diag(diagonal) for diagonal in ((1, -1, 1), (1, 1, 0), (-1, 1, 1), (1, 1, math.nan))),
    ],
)
def test_covariance_refused(covariance):
    nothing = Matches(features(), features(), NONE, NONE, NONE)
    with pytest.raises(ValueError, match=r"covariance (of the prior )?is .* expected \(3, 3\)"):
        estimate_motion(nothing, covariance=covariance)
    if len(covariance) == 2:
        with pytest.raises(ValueError, match=r"covariance is .* expected \(3, 3\)"):
            associate(features(), features(), covariance=covariance)


@pytest.mark.parametrize("pair", [(0, 2), (2, 0), (-1, 0)])
def test_pairs_must_be_there(pair):
    walls = features(segments=APART)
    with pytest.raises(ValueError, match="name features that are not there"):
        estimate_motion(Matches(walls, walls, np.array([pair]), NONE, NONE))


def _estimated(extract, world, pose, motion, seed):
    rng = np.random.default_rng(seed)
    before, now = (
        extract(SENSORS["utm30lx"].scan(world, place, rng))
        for place in (pose, compose(pose, motion))
    )
    first = estimate_motion(associate(before, now, covariance=WIDE), covariance=WIDE)
    return estimate_motion(associate(before, now, first.pose, first.covariance), covariance=WIDE)


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


@pytest.mark.parametrize("has_end", [False, True])
def test_a_corridor_is_observed_along_itself_where_it_has_an_end(has_end):
    extract = ln.Extractor()
    walls = [[-20, 1, 6, 1], [6, 1, 6, -1], [-20, -1, 6, -1]]
    world = World(walls if has_end else [[-20, 1, 20, 1], [-20, -1, 20, -1]])
    for seed in range(5):
        motion = _estimated(extract, world, (0, 0, 0), (0.07, 0.02, 0.02), seed)
        assert motion.observable == has_end
        expected = (0.07 if has_end else 0.0, 0.02, 0.02)
        np.testing.assert_allclose(motion.pose, expected, atol=5e-3)
        if not has_end:
            np.testing.assert_allclose(np.abs(motion.unobserved), [(1, 0, 0)], atol=0.05)
            assert motion.covariance[0, 0] == pytest.approx(WIDE[0, 0], rel=0.05)


@pytest.mark.parametrize(
    ("name", "given"),
    [
        ("motion", (math.nan, 0, 0)),
        ("motion", (0, 0)),
        ("roughness", -0.01),
        ("roughness", math.inf),
        ("covariance", np.full((3, 3), math.nan)),
    ],
)
def test_numbers_that_are_none_are_refused(name, given):
    nothing = Matches(features(), features(), NONE, NONE, NONE)
    with pytest.raises(ValueError, match=f"{name} is .*, expected"):
        associate(features(), features(), **{name: given})
    name = {"motion": "prior"}.get(name, name)
    with pytest.raises(ValueError, match=f"{name} is .*, expected"):
        estimate_motion(nothing, **{name: given})
