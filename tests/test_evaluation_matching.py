"""What all metrics stand on: assignment, counts, sums, errors by a covariance, beams, scipy."""

import itertools
import math

import numpy as np
import pytest
from handmade import features, segment
from lineament_lab.evaluation import Counts, NormalisedErrors, match
from lineament_lab.evaluation.beams import (
    beam_masks,
    on_small_surfaces,
    overlap_ratios,
    shared_beams,
    with_neighbours,
)
from lineament_lab.evaluation.consistency import largest_variance, tolerance
from lineament_lab.evaluation.matching import distances_from_segments

from lineament import LaserScan

SCAN = LaserScan([2.0] * 9, 0.0, 0.01)
WALL = features(segments=[segment((2, -1), (2, 1), 10, 49)])


def best_by_trying_all(cost, allowed):
    """(number of pairs, cost) of the best matching, by every order of the columns."""
    if cost.shape[0] > cost.shape[1]:
        cost, allowed = cost.T, allowed.T
    best = (0, 0.0)
    for columns in itertools.permutations(range(cost.shape[1]), cost.shape[0]):
        pairs = [(r, c) for r, c in enumerate(columns) if allowed[r, c]]
        total = sum(cost[p] for p in pairs)
        if (-len(pairs), total) < (-best[0], best[1]):
            best = (len(pairs), total)
    return best


@pytest.mark.parametrize("seed", range(60))
def test_match_is_the_best_of_all(seed):
    rng = np.random.default_rng(seed)
    shape = rng.integers(0, 6, 2)
    cost = rng.choice([1e-6, 1.0, 1e6]) * rng.normal(size=shape)
    allowed = rng.random(shape) < rng.random()
    cost[~allowed] = rng.choice([0.0, np.nan, np.inf])  # whatever it is
    rows, columns = match(cost, allowed)
    assert len(set(rows)) == len(rows) == len(set(columns))
    assert allowed[rows, columns].all()
    assert (np.diff(rows) > 0).all()
    number, least = best_by_trying_all(cost, allowed)
    assert len(rows) == number
    assert cost[rows, columns].sum() == pytest.approx(least)


def test_match_refuses():
    with pytest.raises(ValueError, match=r"cost has shape \(2, 3\), expected .* \(3, 2\)"):
        match(np.zeros((2, 3)), np.ones((3, 2), bool))
    with pytest.raises(ValueError, match="cost of an allowed pair is nan"):
        match(np.array([[np.nan]]), np.array([[True]]))


def test_counts_by_hand():
    # Four found: 0 and 2 are right, 1 is excused, 3 is wrong. That 2 is excused too is no matter.
    excused, demanded = np.array([0, 1, 1, 0], bool), np.array([1, 1, 1, 0], bool)
    counts = Counts.of(np.array([0, 2]), excused, demanded)
    assert counts == Counts(correct=2, found=3, true=3)
    assert Counts(2, 4, 3).summary("_x") == {"precision_x": 1 / 2, "recall_x": 2 / 3, "f1_x": 4 / 7}
    nan = math.nan
    for nothing, expected in (
        (Counts(0, 0, 0), (nan, nan, nan)),
        (Counts(0, 3, 0), (0.0, nan, 0.0)),
        (Counts(0, 0, 3), (nan, 0.0, 0.0)),
    ):
        np.testing.assert_equal(tuple(nothing.summary().values()), expected)


def test_sums():
    parts = [Counts(1, 2, 3), Counts(4, 5, 6), Counts(0, 1, 0)]
    assert Counts.total(parts) == parts[0] + parts[1] + parts[2] == sum(parts, Counts())
    assert Counts.total(iter(parts)) == Counts(5, 8, 9)
    assert Counts.total([]) == Counts()
    with pytest.raises(TypeError):
        Counts() + 1


def test_errors_by_hand():
    # A covariance with correlation: Σ⁻¹ = [[2, -1], [-1, 1]] for Σ = [[1, 1], [1, 2]].
    covariances = np.array([[[1.0, 1.0], [1.0, 2.0]], np.eye(2)])
    normalised = NormalisedErrors.of(np.array([[1.0, 3.0], [3.0, 4.0]]), covariances)
    np.testing.assert_allclose(normalised.squares, [2 - 2 * 3 + 9, 25])
    assert normalised.mean_ratio == pytest.approx(30 / 4)
    # The median of chi-square with two degrees of freedom is 2 ln 2.
    median = 15 / (2 * math.log(2))
    bound = {"x_over_bound": math.sqrt(7.5), "x_over_bound_median": math.sqrt(median)}
    for both in (normalised, normalised + normalised):
        assert (both.mean_ratio, both.median_ratio) == pytest.approx((30 / 4, median))
        assert both.bound_summary("x_") == pytest.approx(bound)


@pytest.mark.parametrize(
    ("error", "covariance"),
    [
        ((1, 1), np.zeros((2, 2))),
        ((1, 1), -np.eye(2)),
        ((1, 1), np.ones((2, 2))),
        ((1, 1), np.full((2, 2), math.nan)),
        ((1, math.inf), np.eye(2)),
    ],
)
def test_errors_without_a_usable_covariance_are_counted(error, covariance):
    normalised = NormalisedErrors.of(np.array([error, (1, 1)]), np.stack((covariance, np.eye(2))))
    assert (normalised.whitened.tolist(), normalised.unusable) == ([[1, 1]], 1)
    none = NormalisedErrors.of(np.array([error]), np.array([covariance]))
    for empty in (none, NormalisedErrors.none(2)):
        assert empty.whitened.shape == (0, 2)
        figures = (*empty.bound_summary().values(), *empty.interval, empty.share_within(0.5))
        assert all(map(math.isnan, figures))


def test_quantiles_are_those_of_the_tables():
    """χ² with 10 degrees of freedom: 3.247 and 20.483; 95 % of two are below -2 ln 0.05 = 5.99."""
    low, high = NormalisedErrors(np.zeros((5, 2))).interval
    assert (10 * low, 10 * high) == (pytest.approx(3.247, abs=1e-3), pytest.approx(20.483, 1e-4))
    errors = np.sqrt([[5.98, 0.0], [0.0, 6.0], [3.0, 2.9], [3.0, 3.1]])
    assert NormalisedErrors(errors).share_within(0.95) == 0.5


def test_largest_variance_and_tolerance():
    turned = np.array([[2.0, 1.0], [1.0, 2.0]])  # eigenvalues 1 and 3
    indefinite = np.array([[1.0, 2.0], [2.0, 1.0]])
    covariances = np.stack([turned, indefinite, np.full((2, 2), np.inf)])
    assert largest_variance(covariances) == pytest.approx([3.0, 0.0, 0.0])
    assert tolerance(np.array([0.04, np.nan])).tolist() == pytest.approx([0.6, 0.0])


def walk(first, last, n):
    beams = {first}
    while first != last:
        first = (first + 1) % n
        beams.add(first)
    return beams


@pytest.mark.parametrize("n", [1, 2, 17])
def test_masks_are_sets_of_beams(n):
    first, last = np.random.default_rng(0).integers(0, n, (2, 40))
    sets = [walk(*ends, n) for ends in zip(first, last, strict=True)]
    masks = beam_masks(first, last, n)
    assert [set(np.flatnonzero(mask)) for mask in masks] == sets
    assert shared_beams(masks, masks).tolist() == [[len(a & b) for b in sets] for a in sets]
    expected = [[len(a & b) / len(a | b) for b in sets] for a in sets]
    np.testing.assert_allclose(overlap_ratios(masks, masks), expected)


def test_small_surfaces_by_hand():
    small = segment((1, 0), (1, 1), 10, 14)
    large = segment((1, 0), (1, 1), 15, 20)
    truth = features(30, segments=[small, large])
    masks = beam_masks(np.array([10, 10, 10, 5]), np.array([14, 19, 20, 10]), 30)
    # 5 of 5, 5 of 10, 5 of 11, 1 of 6.
    assert on_small_surfaces(masks, truth).tolist() == [True, True, False, False]


def test_neighbours_of_the_first_and_the_last_beam():
    fan, ring = LaserScan([1.0] * 3, 0.0, 0.1), LaserScan([1.0] * 3, 0.0, 2 * math.pi / 3)
    assert with_neighbours(fan).tolist() == [[0, 0, 1], [0, 1, 2], [1, 2, 2]]
    assert with_neighbours(ring).tolist() == [[2, 0, 1], [0, 1, 2], [1, 2, 0]]


def test_distances_from_segments_by_hand():
    walls = np.array([segment((0, 0), (4, 0), 0, 1), segment((1, 1), (1, 1), 0, 1)])
    points = np.array([(2.0, 3.0), (7.0, 4.0), (-3.0, 0.0)])
    found = distances_from_segments(points, walls[:, np.newaxis])
    np.testing.assert_allclose(found, [(3, 5, 3), np.hypot(*(points - 1).T)])
