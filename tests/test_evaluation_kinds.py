"""Corners, segments and arcs against the truth: cases worked by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from handmade import SIDE, arc, corner, edge, features, segment
from lineament_lab.evaluation import Counts, arc_scores, corner_scores, segment_scores

from lineament.features import ARC

SMALL = segment((5, 0), (5, 0.1), 70, 74)
NAN = math.nan


def corners(*positions, **fields):
    return features(segments=[SIDE, SMALL], corners=[corner(*p, **fields) for p in positions])


def arcs(*rows):
    return features(arcs=rows)


def walls(*rows):
    return features(segments=rows)


def moved(first, last, *, x=2.0, turn=0.0, **fields):
    """Return the wall at another x, turned about its middle."""
    dx, dy = -math.sin(turn), math.cos(turn)
    return segment((x - dx, -dy), (x + dx, dy), first, last, **fields)


WALL = moved(10, 49, sigma=(0.01, 0.02))


def test_corners_by_hand():
    found = corners((2, 0.03), (0, 2.08), (5, 5), sigma=0.02)
    scores = corner_scores(found, corners((2, 0), (0, 2)))
    assert scores.by_gate == {0.05: Counts(1, 3, 2), 0.10: Counts(2, 3, 2), 0.25: Counts(2, 3, 2)}
    assert scores.counts == scores.by_gate[0.10]
    np.testing.assert_allclose(scores.errors["position"], [0.03, 0.08])
    # In units of the bound, 1 cm, the squares are 9 and 64; of the found 2 cm a quarter of that.
    assert scores.summary() == pytest.approx(
        {
            "precision_0.05": 1 / 3, "recall_0.05": 1 / 2, "f1_0.05": 2 / 5,
            "precision_0.10": 2 / 3, "recall_0.10": 1.0, "f1_0.10": 4 / 5,
            "precision_0.25": 2 / 3, "recall_0.25": 1.0, "f1_0.25": 4 / 5,
            "rmse": math.sqrt((0.03**2 + 0.08**2) / 2), "median_error": 0.055,
            "over_bound": math.sqrt(73 / 4),
            "over_bound_median": math.sqrt(36.5 / (2 * math.log(2))),
            "nees": 73 / 16, "nees_median": 36.5 / 4 / (2 * math.log(2)), "nees_unusable": 0,
            "nees_low": 0.4844 / 4, "nees_high": 11.1433 / 4,
        },
        rel=1e-4,
    )  # fmt: skip


@pytest.mark.parametrize("sides", [(0, 1), (1, 0), (0, -1)])
def test_corner_with_a_small_side_is_neither_demanded_nor_punished(sides):
    truth = corners((2, 0), segments=sides)
    assert corner_scores(corners(), truth).counts == Counts(0, 0, 0)
    scores = corner_scores(corners((2, 0.01)), truth)
    assert (scores.counts, len(scores.errors["position"])) == (Counts(0, 0, 0), 0)
    six = replace(truth, segments=np.array([SIDE, segment((5, 0), (5, 0.1), 70, 75)]))
    assert corner_scores(corners(), six).counts == Counts(0, 0, sides != (0, -1))
    # It excuses one only.
    assert corner_scores(corners((2, 0.01), (2, 0.02)), truth).counts == Counts(0, 1, 0)


@pytest.mark.parametrize(
    ("found", "counts"),
    [
        ([(0.01, 2)], Counts(1, 1, 1)),  # nearer to the small one, and yet the large one's
        ([(0.01, 2), (0.08, 2)], Counts(1, 1, 1)),
        ([(0.01, 2), (0.08, 2), (0.04, 2)], Counts(1, 2, 1)),
        ([(0.05, 2), (-0.08, 2)], Counts(1, 1, 1)),  # the second is the small one's
    ],
)
def test_demanded_corners_come_first(found, counts):
    small, large = corner(0, 2, segments=(0, 1)), corner(0.09, 2)
    truth = features(segments=[SIDE, SMALL], corners=[small, large])
    assert corner_scores(corners(*found), truth).counts == counts


def test_corners_are_matched_one_to_one_by_distance():
    found = corners((0.07, 2), (0.01, 2), (0.04, 2))
    scores = corner_scores(found, corners((0, 2), (0.08, 2)))
    assert scores.counts == Counts(2, 3, 2)
    assert scores.errors["position"].tolist() == pytest.approx([0.01] * 2)


@pytest.mark.parametrize("position", [(1.7, 0), (NAN, NAN)])
def test_corner_on_a_column_or_without_a_place_is_a_mistake(position):
    truth = features(segments=[SIDE], arcs=[arc(2, 0, 0.3, 10, 30)], corners=[corner(2, 2)])
    assert corner_scores(corners(position), truth).by_gate[0.25] == Counts(0, 1, 1)


def test_slits_are_corners_and_edges_are_not():
    found = corners((2, 0), (0, 2))
    found.corners["kind"] = "corner", "slit"
    found = replace(found, edges=np.array([edge(5, 5)]))
    assert corner_scores(found, corners((2, 0), (0, 2), (5, 5))).counts == Counts(2, 2, 3)


def test_segment_by_hand():
    found = moved(20, 49, x=2.03, turn=0.02)
    found["centroid"] += 0.2 * np.array((-math.sin(0.02), math.cos(0.02)))
    scores = segment_scores(walls(found), walls(WALL))
    assert scores.counts == Counts(1, 1, 1)
    # Seen from the sensor the found line is 3 cm behind: to the right of the direction +y.
    assert scores.errors["offset"].tolist() == pytest.approx([-0.03 * math.cos(0.02)])
    assert scores.errors["angle"].tolist() == pytest.approx([0.02])
    # At its own centroid it is nearer by 0.2 m · sin 0.02; both deviations are 0.01.
    offset = -0.03 + 0.2 * math.sin(0.02)
    start = math.hypot(0.03 + math.sin(0.02), 1 - math.cos(0.02))
    end = math.hypot(0.03 - math.sin(0.02), 1 - math.cos(0.02))
    summary = scores.summary()
    expected = {
        "nees": (offset**2 + 0.02**2) / 1e-4 / 2,
        "offset_over_bound": 3 * math.cos(0.02),
        "angle_over_bound": 1,
        "offset_rmse": 0.03 * math.cos(0.02),
        "angle_rmse": 0.02,
        "end_median": (start + end) / 2,
        "end_p90": end + 0.9 * (start - end),
        "f1": 1.0,
    }
    assert {name: summary[name] for name in expected} == pytest.approx(expected)


COLUMN = arc(2, 0, 0.3, 10, 29)


@pytest.mark.parametrize(
    ("found", "true", "right"),
    [
        (moved(10, 49, x=2.09), WALL, 1),
        (moved(10, 49, x=2.11), WALL, 0),
        (moved(10, 49, x=1.89), WALL, 0),
        (moved(10, 49, x=NAN), WALL, 0),
        (moved(10, 49, turn=math.radians(9.9)), WALL, 1),
        (moved(10, 49, turn=math.radians(-10.1)), WALL, 0),
        (moved(10, 49, turn=math.pi), WALL, 0),  # the other side of the wall
        (moved(10, 29), WALL, 1),  # 20 of 40 beams
        (moved(10, 28), WALL, 0),
        (moved(0, 89), WALL, 0),  # 40 of 90
        (arc(2.07, 0.07, 0.3, 10, 29), COLUMN, 1),
        (arc(2.08, 0.08, 0.3, 10, 29), COLUMN, 0),  # centre 11 cm off
        (arc(2, 0, 0.39, 10, 29), COLUMN, 1),
        (arc(2, 0, 0.41, 10, 29), COLUMN, 0),
        (arc(2, 0, 0.3, 10, 19), COLUMN, 1),
        (arc(2, 0, 0.3, 10, 18), COLUMN, 0),  # 9 of 20 beams
        (arc(NAN, 0, 0.3, 10, 29), COLUMN, 0),
        # Three deviations of the bound: of 5 and 4 cm; 11.5° of 13.8°; 3 √2 · 4 cm = 17 cm; 12 cm.
        (moved(0, 19, x=2.14), moved(0, 19, sigma=(0.05, 0.01)), 1),
        (moved(0, 19, x=2.14), moved(0, 19, sigma=(0.04, 0.01)), 0),
        (moved(0, 19, turn=0.2), moved(0, 19, sigma=(0.01, 0.08)), 1),
        (moved(0, 19, turn=0.2), moved(0, 19, sigma=(0.01, 0.06)), 0),
        (arc(2.16, 0, 0.5, 0, 9), arc(2, 0, 0.5, 0, 9, sigma=(0.04, 0.04, 0.01)), 1),
        (arc(2.16, 0, 0.5, 0, 9), arc(2, 0, 0.5, 0, 9, sigma=(0.03, 0.03, 0.09)), 0),
        (arc(2, 0, 0.61, 0, 9), arc(2, 0, 0.5, 0, 9, sigma=(0.01, 0.01, 0.04)), 1),
        (arc(2, 0, 0.61, 0, 9), arc(2, 0, 0.5, 0, 9, sigma=(0.09, 0.09, 0.03)), 0),
    ],
)
def test_segments_and_arcs_within_their_gates(found, true, right):
    of_kind, score = (arcs, arc_scores) if true.dtype == ARC else (walls, segment_scores)
    assert score(of_kind(found), of_kind(true)).counts == Counts(right, 1, 1)


@pytest.mark.parametrize(("sigma", "right"), [(0.04, (0, 0, 1)), (0.05, (1, 1, 1))])
def test_a_corner_may_be_three_deviations_of_the_bound_off(sigma, right):
    """14 cm are more than 3 · 4 cm, and less than 3 · 5 cm, of the larger axis of the ellipse."""
    by_gate = corner_scores(corners((2, 0.14)), corners((2, 0), sigma=(0.01, sigma))).by_gate
    assert tuple(of.correct for of in by_gate.values()) == right


def test_segments_are_matched_by_the_overlap_of_their_beams():
    """The better line has 25 of 40 beams, the other 30."""
    scores = segment_scores(walls(moved(10, 34), moved(20, 49, x=2.05)), walls(WALL))
    assert scores.counts == Counts(1, 2, 1)
    assert scores.errors["offset"].tolist() == pytest.approx([-0.05])


def test_segment_over_the_seam():
    wall = segment((-2, 1), (-2, -1), 90, 9, n_points=20)
    found = segment((-2, 0.5), (-2, -0.5), 95, 4, n_points=10)
    scores = segment_scores(walls(found), walls(wall))
    assert scores.counts == Counts(1, 1, 1)
    assert scores.errors["end"].tolist() == pytest.approx([0.5] * 2)


def test_angles_are_compared_across_the_turn():
    wall = segment((1, 2), (-1, 2 + 1e-3), 10, 49)
    found = segment((1, 2), (-1, 2 - 1e-3), 10, 49)
    assert abs(wall["angle"] - found["angle"]) > 6
    scores = segment_scores(walls(found), walls(wall))
    assert scores.errors["angle"].tolist() == pytest.approx([1e-3], rel=1e-3)


@pytest.mark.parametrize(
    ("found", "true", "counts", "fragmented", "merged"),
    [
        ([moved(10, 22), moved(24, 45)], [moved(10, 49)], Counts(1, 2, 1), 1, 0),
        ([moved(10, 49)], [moved(10, 22), moved(24, 45)], Counts(1, 1, 2), 0, 1),
        # Two pieces that have no more than half of it are not the wall.
        ([moved(10, 19), moved(30, 39)], [moved(10, 49)], Counts(0, 2, 1), 0, 0),
        ([moved(10, 19), moved(30, 40)], [moved(10, 49)], Counts(0, 2, 1), 1, 0),
        # A piece with half of its beams elsewhere is none of it.
        ([moved(10, 30), moved(40, 59)], [moved(10, 49)], Counts(1, 2, 1), 0, 0),
        # A small neighbour that is found together with a wall is not demanded.
        ([moved(10, 54)], [moved(10, 49), moved(50, 54)], Counts(1, 1, 1), 0, 0),
    ],
)
def test_fragmentation_and_merging(found, true, counts, fragmented, merged):
    scores = segment_scores(walls(*found), walls(*true))
    assert scores.counts == counts
    assert scores.pieces == {"fragmentation": fragmented, "merging": merged}
    summary = scores.summary()
    assert summary["fragmentation"] == fragmented / counts.true
    assert summary["merging"] == merged / counts.found


def test_what_lies_on_small_surfaces_is_not_judged():
    truth = features(segments=[SMALL], arcs=[arc(3, 0, 0.1, 60, 64), arc(0, 3, 0.5, 20, 39)])
    on_wall, on_column = moved(70, 74), moved(60, 66)
    assert segment_scores(walls(on_wall, on_column), truth).counts == Counts(0, 0, 0)
    # A polygon around a large column is.
    assert segment_scores(walls(moved(20, 29), moved(30, 39)), truth).counts == Counts(0, 2, 0)
    assert arc_scores(arcs(arc(9, 9, 1, 70, 75)), truth).counts == Counts(0, 0, 1)
    assert arc_scores(arcs(arc(9, 9, 1, 50, 70)), truth).counts == Counts(0, 1, 1)


def test_arc_by_hand():
    truth = arcs(arc(2, 0, 0.3, 10, 29, sigma=0.01))
    found = arcs(arc(2.01, 0.02, 0.33, 15, 29, sigma=0.02), arc(5, 5, 1, 60, 79))
    scores = arc_scores(found, truth)
    assert scores.counts == Counts(1, 2, 1)
    assert scores.errors["radius"].tolist() == pytest.approx([0.03])
    summary = scores.summary()
    assert summary["center_rmse"] == pytest.approx(math.hypot(0.01, 0.02))
    assert summary["radius_rmse"] == pytest.approx(0.03)
    assert summary["over_bound"] == pytest.approx(math.sqrt((1 + 4 + 9) / 3))
    assert summary["nees"] == pytest.approx((1 + 4 + 9) / 3 / 4)
