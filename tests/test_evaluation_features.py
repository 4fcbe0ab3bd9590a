"""Corners, segments and arcs against the truth: cases worked by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from handmade import SIDE, arc, corner, features, segment

from lineament.evaluation import Counts, arc_scores, corner_scores, segment_scores

SMALL = segment((5, 0), (5, 0.1), 70, 74)


def corners(*positions, **fields):
    return features(segments=[SIDE, SMALL], corners=[corner(*p, **fields) for p in positions])


def test_corners_by_hand():
    truth = corners((2, 0), (0, 2))
    found = corners((2, 0.03), (0, 2.08), (5, 5), sigma=0.02)
    scores = corner_scores(found, truth)
    assert scores.counts == {0.05: Counts(1, 3, 2), 0.10: Counts(2, 3, 2), 0.25: Counts(2, 3, 2)}
    np.testing.assert_allclose(scores.errors, [(0, 0.03), (0, 0.08)], atol=1e-12)
    assert scores.rmse == pytest.approx(math.sqrt((0.03**2 + 0.08**2) / 2))
    # In units of the bound, 1 cm, the squares are 9 and 64; of the found 2 cm a quarter of that.
    assert scores.over_bound.over_bound == pytest.approx(math.sqrt(73 / 4))
    assert scores.over_bound.median_ratio == pytest.approx(36.5 / (2 * math.log(2)))
    assert scores.consistency.mean_ratio == pytest.approx(73 / 16)
    summary = scores.summary()
    assert summary["precision_0.10"] == pytest.approx(2 / 3)
    assert summary["f1_0.10"] == pytest.approx(4 / 5)
    assert summary["median_error"] == pytest.approx(0.055)


@pytest.mark.parametrize("sides", [(0, 1), (1, 0), (0, -1)])
def test_corner_with_a_small_side_is_neither_demanded_nor_punished(sides):
    truth = corners((2, 0), segments=sides)
    assert corner_scores(corners(), truth).counts[0.10] == Counts(0, 0, 0)
    scores = corner_scores(corners((2, 0.01)), truth)
    assert scores.counts[0.10] == Counts(0, 0, 0)
    assert len(scores.errors) == 0
    # It excuses one only.
    assert corner_scores(corners((2, 0.01), (2, 0.02)), truth).counts[0.10] == Counts(0, 1, 0)


def test_demanded_corners_come_first():
    small, large = corner(0, 2, segments=(0, 1)), corner(0.09, 2)
    truth = features(segments=[SIDE, SMALL], corners=[small, large])
    assert corner_scores(corners((0.01, 2)), truth).counts[0.10] == Counts(1, 1, 1)
    assert corner_scores(corners((0.01, 2), (0.08, 2)), truth).counts[0.10] == Counts(1, 1, 1)


def test_corners_are_matched_one_to_one_by_distance():
    truth = corners((0, 2), (0.08, 2))
    scores = corner_scores(corners((0.07, 2), (0.01, 2), (0.04, 2)), truth)
    assert scores.counts[0.10] == Counts(2, 3, 2)
    np.testing.assert_allclose(scores.distances, 0.01)


def test_corner_on_a_column_is_a_mistake():
    truth = features(segments=[SIDE], arcs=[arc(2, 0, 0.3, 10, 30)])
    assert corner_scores(corners((1.7, 0)), truth).counts[0.10] == Counts(0, 1, 0)


def test_corner_that_is_no_number_is_a_mistake():
    found = corners((math.nan, math.nan))
    assert corner_scores(found, corners((2, 0))).counts[0.25] == Counts(0, 1, 1)


def walls(*segments):
    return features(segments=segments)


WALL = segment((2, -1), (2, 1), 10, 49, sigma=(0.01, 0.02))


def moved(first, last, *, x=2.0, turn=0.0, **fields):
    """Return the wall at another x, turned about its middle."""
    dx, dy = -math.sin(turn), math.cos(turn)
    return segment((x - dx, -dy), (x + dx, dy), first, last, **fields)


def test_segment_by_hand():
    found = moved(20, 49, x=2.03, turn=0.02)
    found["centroid"] += 0.2 * np.array((-math.sin(0.02), math.cos(0.02)))
    scores = segment_scores(walls(found), walls(WALL))
    assert scores.counts == Counts(1, 1, 1)
    # Seen from the sensor the found line is 3 cm behind: to the right of the direction +y.
    np.testing.assert_allclose(scores.errors, [(-0.03 * math.cos(0.02), 0.02)])
    assert scores.offset_over_bound.over_bound == pytest.approx(3 * math.cos(0.02))
    assert scores.angle_over_bound.over_bound == pytest.approx(1)
    # At its own centroid it is nearer by 0.2 m · sin 0.02; both deviations are 0.01.
    offset = -0.03 + 0.2 * math.sin(0.02)
    assert scores.consistency.mean_ratio == pytest.approx((offset**2 + 0.02**2) / 1e-4 / 2)
    start = math.hypot(0.03 + math.sin(0.02), 1 - math.cos(0.02))
    end = math.hypot(0.03 - math.sin(0.02), 1 - math.cos(0.02))
    np.testing.assert_allclose(scores.end_distances, [start, end])
    summary = scores.summary()
    assert summary["end_median"] == pytest.approx((start + end) / 2)
    assert summary["end_p90"] == pytest.approx(end + 0.9 * (start - end))


@pytest.mark.parametrize(
    ("found", "is_right"),
    [
        (moved(10, 49, x=2.09), True),
        (moved(10, 49, x=2.11), False),
        (moved(10, 49, x=1.89), False),
        (moved(10, 49, turn=math.radians(9.9)), True),
        (moved(10, 49, turn=math.radians(-10.1)), False),
        (moved(10, 49, turn=math.pi), False),  # the other side of the wall
        (moved(10, 29), True),  # 20 of 40 beams
        (moved(10, 28), False),
        (moved(0, 89), False),  # 40 of 90
    ],
)
def test_segment_gates(found, is_right):
    assert segment_scores(walls(found), walls(WALL)).counts == Counts(int(is_right), 1, 1)


def test_segment_over_the_seam():
    wall = segment((-2, 1), (-2, -1), 90, 9, n_points=20)
    found = segment((-2, 0.5), (-2, -0.5), 95, 4, n_points=10)
    scores = segment_scores(walls(found), walls(wall))
    assert scores.counts == Counts(1, 1, 1)
    np.testing.assert_allclose(scores.errors, 0, atol=1e-12)


def test_angles_are_compared_across_the_turn():
    wall = segment((1, 2), (-1, 2 + 1e-3), 10, 49)
    found = segment((1, 2), (-1, 2 - 1e-3), 10, 49)
    assert abs(wall["angle"] - found["angle"]) > 6
    scores = segment_scores(walls(found), walls(wall))
    assert scores.errors[0, 1] == pytest.approx(1e-3, rel=1e-3)


def test_fragmentation_and_merging_by_hand():
    whole, pieces = moved(10, 49), (moved(10, 22), moved(24, 45))
    broken = segment_scores(walls(*pieces), walls(whole))
    assert (broken.counts, broken.fragmented, broken.merged) == (Counts(1, 2, 1), 1, 0)
    assert broken.fragmentation == 1
    joined = segment_scores(walls(whole), walls(*pieces))
    assert (joined.counts, joined.fragmented, joined.merged) == (Counts(1, 1, 2), 0, 1)
    assert joined.merging == 1
    # Two pieces that have no more than half of it are not the wall.
    assert segment_scores(walls(moved(10, 19), moved(30, 39)), walls(whole)).fragmented == 0
    # A small neighbour that is found together with a wall is not demanded.
    small = moved(50, 54)
    assert segment_scores(walls(moved(10, 54)), walls(whole, small)).merged == 0


def test_what_lies_on_small_surfaces_is_not_judged():
    truth = features(segments=[SMALL], arcs=[arc(3, 0, 0.1, 60, 64), arc(0, 3, 0.5, 20, 39)])
    on_wall, on_column = moved(70, 74), moved(60, 66)
    assert segment_scores(walls(on_wall, on_column), truth).counts == Counts(0, 0, 0)
    # A polygon around a large column is.
    assert segment_scores(walls(moved(20, 29), moved(30, 39)), truth).counts == Counts(0, 2, 0)
    assert arc_scores(features(arcs=[arc(9, 9, 1, 70, 75)]), truth).counts == Counts(0, 0, 1)
    assert arc_scores(features(arcs=[arc(9, 9, 1, 50, 70)]), truth).counts == Counts(0, 1, 1)


def test_segment_that_is_no_number_is_a_mistake():
    scores = segment_scores(walls(moved(10, 49, x=math.nan)), walls(WALL))
    assert (scores.counts, len(scores.errors)) == (Counts(0, 1, 1), 0)


def test_arc_by_hand():
    truth = features(arcs=[arc(2, 0, 0.3, 10, 29, sigma=0.01)])
    found = features(arcs=[arc(2.01, 0.02, 0.33, 15, 29, sigma=0.02), arc(5, 5, 1, 60, 79)])
    scores = arc_scores(found, truth)
    assert scores.counts == Counts(1, 2, 1)
    np.testing.assert_allclose(scores.errors, [(0.01, 0.02, 0.03)], atol=1e-12)
    assert scores.over_bound.over_bound == pytest.approx(math.sqrt((1 + 4 + 9) / 3))
    assert scores.consistency.mean_ratio == pytest.approx((1 + 4 + 9) / 3 / 4)
    summary = scores.summary()
    assert summary["center_rmse"] == pytest.approx(math.hypot(0.01, 0.02))
    assert summary["radius_rmse"] == pytest.approx(0.03)


@pytest.mark.parametrize(
    "found",
    [
        arc(2.08, 0.08, 0.3, 10, 29),  # centre 11 cm off
        arc(2, 0, 0.45, 10, 29),
        arc(2, 0, 0.3, 10, 18),  # 9 of 20 beams
        arc(math.nan, 0, 0.3, 10, 29),
    ],
)
def test_arc_gates(found):
    truth = features(arcs=[arc(2, 0, 0.3, 10, 29)])
    assert arc_scores(features(arcs=[found]), truth).counts == Counts(0, 1, 1)


@pytest.mark.parametrize(("sigma", "right"), [(0.04, (0, 0, 1)), (0.05, (1, 1, 1))])
def test_a_corner_may_be_three_deviations_of_the_bound_off(sigma, right):
    """14 cm are more than 3 · 4 cm, and less than 3 · 5 cm, of the larger axis of the ellipse."""
    truth = corners((2, 0))
    truth.corners["covariance"] = np.diag([0.01**2, sigma**2])
    counts = corner_scores(corners((2, 0.14)), truth).counts
    assert tuple(of.correct for of in counts.values()) == right


@pytest.mark.parametrize(
    ("sigma", "offset", "turn", "right"),
    [
        ((0.05, 0.01), 0.14, 0.0, 1),
        ((0.04, 0.01), 0.14, 0.0, 0),
        ((0.01, 0.08), 0.0, 0.2, 1),  # 11.5° of 13.8°
        ((0.01, 0.06), 0.0, 0.2, 0),
    ],
)
def test_a_segment_may_be_three_deviations_of_the_bound_off(sigma, offset, turn, right):
    true = segment((2, -1), (2, 1), 0, 19, sigma=sigma)
    found = segment((2 + offset, -1), (2 + offset, 1), 0, 19)
    found["angle"] += turn
    counts = segment_scores(features(segments=[found]), features(segments=[true])).counts
    assert counts == Counts(right, 1, 1)


@pytest.mark.parametrize(
    ("sigma", "center", "radius", "right"),
    [
        (0.04, 0.16, 0.0, 1),  # 3 √2 · 4 cm = 17 cm
        (0.03, 0.16, 0.0, 0),
        (0.04, 0.0, 0.11, 1),  # 3 · 4 cm = 12 cm
        (0.03, 0.0, 0.11, 0),
    ],
)
def test_an_arc_may_be_three_deviations_of_the_bound_off(sigma, center, radius, right):
    true = features(arcs=[arc(2, 0, 0.5, 0, 9, sigma=sigma)])
    found = features(arcs=[arc(2 + center, 0, 0.5 + radius, 0, 9)])
    assert arc_scores(found, true).counts == Counts(right, 1, 1)


def test_edges_are_no_corners():
    found = corners((2, 0), (5, 5), (0, 2))
    found.corners["kind"] = "corner", "edge", "slit"
    assert corner_scores(found, corners((2, 0), (0, 2), (5, 5))).counts[0.10] == Counts(2, 2, 3)
