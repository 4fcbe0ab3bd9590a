"""Floor plans: walls that are one, worked by hand; marks of arcs and covariances."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from handmade import arc, corner, features, segment
from hypothesis import given, settings
from hypothesis import strategies as st

from lineament import LaserScan
from lineament.output.floor_plan import Averages, FloorPlan
from lineament.output.markers import Markers, ellipses_of, markers_of

SURE = (0.002, 0.002)


def line(start, end, sigma=SURE):
    return segment(start, end, 0, 9, sigma=sigma)


def plan_of(*scans):
    plan = FloorPlan()
    for segments in scans:
        plan.add(features(segments=segments))
    return plan


def walls_of(*scans, min_views=1):
    walls = plan_of(*scans).walls(min_views)
    return [(*w["start"].round(3).tolist(), *w["end"].round(3).tolist(), w["views"]) for w in walls]


def test_overlapping_views_are_one_wall_with_its_views():
    scans = [[line((0, 1), (2, 1))], [line((1, 1), (3, 1))], [line((3.1, 1), (4, 1))]]
    # 1 m once, 1 m twice, 1 m once; the third is not seen to touch, but is near: one line.
    (first, second) = walls_of(*scans)
    assert first == (0, 1, 3, 1, pytest.approx(4 / 3))
    assert second == (3.1, 1, 4, 1, 1)
    assert len(plan_of(*scans)._walls) == 1
    assert walls_of(*scans, min_views=2) == [(1, 1, 2, 1, 2)]
    assert walls_of(*scans, min_views=3) == []


def test_doorway_stays_open_though_the_door_was_shut_once():
    open_door = [line((0, 0), (2, 0)), line((3, 0), (5, 0))]
    shut = [line((0, 0), (5, 0))]
    walls = walls_of(open_door, open_door, shut, open_door, min_views=2)
    assert walls == [(0, 0, 2, 0, 4), (3, 0, 5, 0, 4)]


def test_both_faces_of_a_partition_stay_apart():
    walls = walls_of([line((0, 0), (4, 0))], [line((4, 0.04), (0, 0.04))])
    assert walls == [(0, 0, 4, 0, 1), (4, 0.04, 0, 0.04, 1)]


@pytest.mark.parametrize(
    ("other", "count"),
    [
        (((0, 0.04), (4, 0.04)), 1),  # on the line
        (((1, 0.04), (2, 0.04)), 1),
        (((4.15, 0), (6, 0)), 1),  # touches
        (((4.25, 0), (6, 0)), 2),
        (((0, 0.0), (4, 0.2)), 2),  # turned by 2.9 degrees
        (((0, 0.09), (4, 0.09)), 1),  # a copy that the poses have moved
        (((4.1, 0.1), (8, 0.1)), 2),  # beside it stands nothing: a wall of its own
        (((0, 0.2), (4, 0.2)), 2),
    ],
)
def test_what_is_one_wall(other, count):
    plan = plan_of([line((0, 0), (4, 0))], [line(*other)])
    plan.walls()
    assert len(plan._walls) == count


def test_line_goes_through_all_metres_seen():
    # Two views of 3 m at y = 0 and one of 3 m at y = 0.03: the mean is 0.01.
    wall = [line((0, 0), (3, 0))]
    assert walls_of(wall, wall, [line((0, 0.03), (3, 0.03))]) == [(0, 0.01, 3, 0.01, 3)]


def test_uncertain_short_or_impossible_segments_are_left_out():
    bad = [
        line((0, 0), (4, 0), sigma=(0.06, 0.001)),
        line((0, 1), (4, 1), sigma=(0.001, 0.03)),  # 6 cm at its ends
        line((0, 2), (0.1, 2)),
        line((0, 3), (2000, 3)),
        line((0, 4), (np.nan, 4)),
        line((1e300, 5), (1e300, 8)),
    ]
    assert walls_of(bad) == []
    assert walls_of([*bad, line((0, 6), (4, 6))]) == [(0, 6, 4, 6, 1)]


def test_plan_far_from_its_origin_is_as_good():
    x, y = 448_000.0, 5_412_000.0  # UTM
    scans = [[line((x, y), (x + 3, y + 0.01))], [line((x + 2, y), (x + 4, y))]]
    (wall,) = plan_of(*scans).walls()
    assert wall["start"] == pytest.approx((x, y), abs=0.02)
    assert wall["end"] == pytest.approx((x + 4, y), abs=0.02)


@settings(max_examples=20)
@given(st.integers(0, 10_000))
def test_many_noisy_views_give_the_room(seed):
    rng = np.random.default_rng(seed)
    room = np.array([(0, 0), (5, 0), (5, 4), (0, 4), (0, 0)]) @ turned(rng.uniform(0, 6))
    plan = FloorPlan()
    for _ in range(30):
        seen = []
        for a, b in pairwise(room):
            low, high = np.sort(rng.uniform(0, 1, 2))
            along, normal = b - a, np.array([a[1] - b[1], b[0] - a[0]]) / math.dist(a, b)
            noise = rng.normal(0, 0.008, 2)
            seen.append(
                line(*(a + t * along + e * normal for t, e in zip((low, high), noise, strict=True)))
            )
        plan.add(features(segments=seen))
    plan.walls()
    main = sorted(plan._walls, key=lambda wall: -wall.length)[:4]
    for wall in main:
        distances = [_distance(wall.ends(), a, b) for a, b in pairwise(room)]
        assert min(distances) < 0.03
    assert sum(wall.length for wall in main) > 0.9 * sum(wall.length for wall in plan._walls)


def turned(angle):
    return np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])


def _distance(points, a, b):
    normal = np.array([a[1] - b[1], b[0] - a[0]]) / math.dist(a, b)
    return float(np.abs((points - a) @ normal).max())


def test_walls_are_bounded_in_number(monkeypatch):
    monkeypatch.setattr("lineament.output.floor_plan.MOST", 40)
    plan = FloorPlan()
    kept = [line((0, 0), (5, 0))]
    for y in range(1, 300):
        plan.add(features(segments=[*kept, line((0, y), (1, y))], corners=[corner(0, y)]))
        assert len(plan._walls) <= 41
        assert len(plan._ends) < 200
        assert len(plan._corners.seen(1)) <= 41
    assert plan.walls()[0]["views"] == 299


def test_edges_stay_apart_from_corners():
    plan = FloorPlan()
    for shift in (0.0, 0.02):
        plan.add(features(corners=[corner(shift, 1), corner(0.05, 1 + shift, kind="edge")]))
    markers, _ = plan.markers(min_views=2)
    np.testing.assert_allclose(markers.corners, [(0.01, 1)])
    np.testing.assert_allclose(markers.edges, [(0.05, 1.01)])


def test_averages_join_what_is_near():
    means = Averages(2, 0.1)
    means.add(np.array([(0, 0), (1, 0), (np.nan, 0), (1e300, 0)]))
    means.add(np.array([(0.06, 0), (1.2, 0)]))
    np.testing.assert_allclose(means.seen(1), [(0.03, 0), (1, 0), (1.2, 0)])
    np.testing.assert_allclose(means.seen(2), [(0.03, 0)])


def test_arcs_are_where_their_points_were():
    angles = np.linspace(-0.2, 0.2, 9)
    scan = LaserScan(np.full(9, 2.0), angle_min=-0.2, angle_increment=0.05)
    # A circle about (1, 0) through (2, 0): the points lie at its right.
    markers = markers_of(features(9, arcs=[arc(1, 0, 1, 0, 8)]), scan)
    first = math.atan2(2 * math.sin(angles[0]), 2 * math.cos(angles[0]) - 1)
    np.testing.assert_allclose(markers.arcs, [[1, 0, 1, first, -first]])
    whole = markers_of(features(9, arcs=[arc(1, 0, 1, 0, 8)]))
    assert whole.arcs[0, 4] - whole.arcs[0, 3] == 2 * math.pi
    assert len(whole.arc_strips()[0]) == 49


@given(st.floats(0.01, 1), st.floats(0.01, 1), st.floats(-3, 3))
def test_ellipses_hold_95_percent(a, b, turn):
    rotation = turned(turn)
    covariance = rotation @ np.diag([a**2, b**2]) @ rotation.T
    ellipses = ellipses_of(np.array([[1.0, 2.0]]), covariance[None])
    none = np.zeros((0, 2))
    markers = Markers(none.reshape(0, 2, 2), none, none, np.zeros((0, 5)), ellipses)
    offset = markers.ellipse_strips()[0] - (1.0, 2.0)
    squared = np.einsum("ni,ij,nj->n", offset, np.linalg.inv(covariance), offset)
    np.testing.assert_allclose(squared, -2 * math.log(0.05), rtol=1e-6)
