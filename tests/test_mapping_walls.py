"""Walls, lines and corners of maps: derivatives by differences, covariances, and their gates."""

import math

import numpy as np
import pytest
from small_room import RING, plan_of, query_at

from lineament.errors import LineamentError
from lineament.features import ARC
from lineament.mapping import LineMap
from lineament.mapping.drive_map import passed
from lineament.mapping.hypotheses import anchors, beside, meetings
from lineament.scan.poses import compose, inverse
from lineament.walls import COLUMN, as_walls, cut, moved, segments_of, walls_of, wrapped
from lineament.walls.sights import (
    SIGHT,
    columns_shown,
    errors,
    extents,
    lines_of,
    move,
    walls_along,
)

PLAN = plan_of(RING)
POSES = np.array([(0.3, -0.2, 0.7), (1.0, 0.4, -2.0), (-1.5, 0.1, 3.0)])


def sights_from(poses):
    """What is seen of each wall of the room from each pose, at places along it."""
    seen = [query_at(tuple(pose), PLAN).walls for pose in poses]
    sights = np.zeros((len(poses), len(RING)), SIGHT)
    for k, walls in enumerate(seen):
        sights["frame"][k], sights["wall"][k] = k, np.arange(len(RING))
        u = np.column_stack((np.cos(walls["angle"]), np.sin(walls["angle"])))
        sights["centroid"][k], sights["angle"][k] = walls["centroid"] + 0.2 * k * u, walls["angle"]
        sights["ends"][k] = (-0.3, 0.2)
    sights["covariance"] = np.diag((0.01, 0.02)) ** 2
    return sights.ravel()


def test_derivatives_of_sights_are_those_of_differences():
    sights, lines = sights_from(POSES), lines_of(sights_from(POSES), POSES, len(RING))
    move(lines, np.random.default_rng(0).normal(0, 0.02, (len(RING), 2)))
    off, of_pose, of_wall = errors(sights, POSES, lines)
    assert np.abs(off).max() > 0.01
    for axis in range(3):
        step = np.zeros((3, 3))
        step[:, axis] = 1e-6
        by = (errors(sights, POSES + step, lines)[0] - off) / 1e-6
        np.testing.assert_allclose(of_pose[:, :, axis], by, atol=1e-4)
    for axis in range(2):
        step, other = np.zeros((len(RING), 2)), lines.copy()
        step[:, axis] = 1e-6
        move(other, step)
        by = (errors(sights, POSES, other)[0] - off) / 1e-6
        np.testing.assert_allclose(of_wall[:, :, axis], by, atol=1e-4)


def test_lines_of_exact_sights_are_those_of_the_plan():
    sights, walls = sights_from(POSES), PLAN.walls
    lines = lines_of(sights, POSES, len(RING))
    np.testing.assert_allclose(wrapped(lines["angle"] - walls["angle"]), 0, atol=1e-9)
    off = lines["centroid"] - walls["start"]
    u = np.column_stack((np.cos(walls["angle"]), np.sin(walls["angle"])))
    np.testing.assert_allclose(off[:, 0] * u[:, 1] - off[:, 1] * u[:, 0], 0, atol=1e-9)
    # Three sights at 0, 0.2 and 0.4 m: the mean is at 0.2, and offset and angle add up there.
    by_place = [np.array([[1, x], [0, 1]]) for x in (-0.2, 0.0, 0.2)]
    own = np.linalg.inv(np.diag((0.01, 0.02)) ** 2)
    expected = np.linalg.inv(sum(of.T @ own @ of for of in by_place))
    np.testing.assert_allclose(
        lines["covariance"], np.tile(expected, (8, 1, 1)), rtol=1e-3, atol=1e-12
    )
    low, high = extents(sights, POSES, lines)
    np.testing.assert_allclose(low.reshape(3, 8)[:, 0], (-0.5, -0.3, -0.1), atol=1e-9)
    np.testing.assert_allclose(high.reshape(3, 8)[:, 0], (0.0, 0.2, 0.4), atol=1e-9)


def test_a_sight_that_is_far_off_counts_less():
    """Twenty at y = 0 and one 20 deviations off: by 9 / 400, not by 1."""
    sights = np.zeros(21, SIGHT)
    sights["covariance"] = np.eye(2) * 0.01**2
    sights["centroid"][20, 1] = 0.2
    line = lines_of(sights, np.zeros((1, 3)), 1)[0]
    assert line["centroid"][1] == pytest.approx(0.2 * 9 / 400 / 20, rel=0.2)


def test_walls_are_moved_and_cut():
    pose = (0.4, -1.3, 2.2)
    there = moved(PLAN.walls, pose)
    for name in ("start", "end", "centroid"):
        back = [compose(pose, (x, y, 0.0))[:2] for x, y in there[name].tolist()]
        np.testing.assert_allclose(back, PLAN.walls[name], atol=1e-12)
    np.testing.assert_allclose(
        wrapped(there["angle"] + pose[2] - PLAN.walls["angle"]), 0, atol=1e-9
    )
    again = moved(there, inverse(pose))
    np.testing.assert_allclose(again["start"], PLAN.walls["start"], atol=1e-12)
    wall = walls_of(np.array([[(1.0, 1.0), (1.0, 5.0)]]), covariance=np.diag((1e-4, 1e-6)))[0]
    parts = cut(wall, np.array([0.5, 3.0]), np.array([1.5, 4.0]))
    np.testing.assert_allclose(parts["start"], [(1, 1.5), (1, 4)])
    np.testing.assert_allclose(parts["end"], [(1, 2.5), (1, 5)])
    np.testing.assert_allclose(parts["centroid"], [(1, 2), (1, 4.5)])
    np.testing.assert_allclose(parts["covariance"][:, 0, 0], (1e-4 + 1e-6, 1e-4 + 2.25e-6))
    np.testing.assert_allclose(parts["covariance"][:, 0, 1], (-1e-6, 1.5e-6))


def test_segments_are_walls_that_are_less_sure_by_their_misfit():
    ends = np.array([[0, 0, 4, 0], [0, 1, 0.05, 1], [0, 2, 0.15, 2]], float).reshape(-1, 2, 2)
    segments = segments_of(walls_of(ends))
    np.testing.assert_allclose(segments["length"], (4, 0.05, 0.15))
    segments["misfit"] = 0.02
    walls = as_walls(segments)  # without what is shorter than 10 cm
    np.testing.assert_allclose(walls["covariance"][:, 0, 0], 4e-4)
    np.testing.assert_allclose(walls["covariance"][:, 1, 1], 4 * 4e-4 / np.array((4, 0.15)) ** 2)
    assert walls["side"].tolist() == [1, 1]


@pytest.mark.parametrize(
    ("other", "corners"),
    [
        ((4.0, 0.0, 4.0, 3.0), 1),
        ((4.3, 0.0, 4.3, 3.0), 1),  # 30 cm past the end
        ((4.4, 0.0, 4.4, 3.0), 0),
        ((4.0, 0.3, 4.0, 3.0), 1),
        ((4.0, 0.4, 4.0, 3.0), 0),
        ((3.95, 0.0, 3.95, 3.0), 1),  # 5 cm are no arm, 10 cm are
        ((3.9, 0.0, 3.9, 3.0), 2),
        ((2.0, 0.3, 2.0, 3.0), 2),
        ((2.0, 0.4, 2.0, 3.0), 0),
        ((2.0, -1.0, 2.0, 1.0), 0),  # a crossing, not an end
        ((4.0, 0.0, 7.0, 1.2), 1),  # by 21.8°: sine 0.37
        ((4.0, 0.0, 7.0, 1.0), 0),
        ((4.1, 0.0, 4.1, 0.1), 1),  # a short wall has a short arm
    ],
)
def test_where_two_walls_meet(other, corners):
    """A wall of 4 m along x, and another; whichever way they lead, and wherever they are."""
    ends = np.array([(0.0, 0.0, 4.0, 0.0), other]).reshape(-1, 2, 2)
    for flip in (1, -1):
        for turn in (0.0, 2.0):
            c, s = math.cos(turn), math.sin(turn)
            found = meetings(walls_of(ends[:, ::flip] @ np.array([[c, s], [-s, c]])))
            assert len(found) == corners
            assert len(meetings(walls_of(ends[::-1, ::flip]))) == corners


def test_covariance_of_a_corner_is_that_of_its_walls():
    """By differences: the wall is moved by an offset and a turn about its centroid."""
    walls = walls_of(np.array([(0, 0, 4, 0), (4, 0, 5, 3)], float).reshape(-1, 2, 2))
    walls["covariance"] = [[[4e-4, 1e-4], [1e-4, 9e-4]], [[1e-4, -5e-5], [-5e-5, 4e-4]]]
    here = meetings(walls)[0]
    np.testing.assert_allclose(here["position"], (4, 0), atol=1e-12)
    expected = np.zeros((2, 2))
    for k in range(2):
        slopes = []
        for offset, turn in ((1e-6, 0), (0, 1e-6)):
            other, angle = walls.copy(), walls["angle"][k] + turn
            u = np.array((math.cos(angle), math.sin(angle)))
            middle = walls["centroid"][k] + offset * np.array((-u[1], u[0]))
            half = math.dist(walls["start"][k], walls["end"][k]) / 2
            other["start"][k], other["end"][k] = middle - half * u, middle + half * u
            other["centroid"][k], other["angle"][k] = middle, angle
            slopes.append((meetings(other)[0]["position"] - here["position"]) / 1e-6)
        slope = np.array(slopes).T
        expected += slope @ walls["covariance"][k] @ slope.T
    np.testing.assert_allclose(here["covariance"], expected, rtol=1e-3)


def test_corners_and_ends_of_long_walls_vote():
    walls = walls_of(
        np.array([(0, 0, 4, 0), (4, 0, 4, 0.4), (9, 0, 9, 2)], float).reshape(-1, 2, 2)
    )
    walls["side"] = 1, 1, 0
    rows = anchors(walls, meetings(walls)).tolist()
    quarter = math.pi / 2
    expected = [
        # The room of the first two is on their left.
        (4, 0, 1.5 * quarter, 0, quarter),
        (0, 0, 0, 2, 0),
        (9, 0, quarter, 2, 0),
        (4, 0, 0, 3, 0),
        (9, 2, quarter, 3, 0),
        # From its other side a wall leads back.
        (9, 0, quarter + math.pi, 3, 0),
        (9, 2, quarter + math.pi, 2, 0),
    ]
    np.testing.assert_allclose(rows, expected, atol=1e-12)


def test_all_walls_near_a_place_are_listed():
    """Within 30 cm of any place are only walls that its cell lists; and round columns."""
    columns = np.zeros(1, COLUMN)
    columns["center"], columns["radius"] = (1.0, 0.0), 0.3
    walls = PLAN.walls.copy()
    walls["covariance"] = np.array([[4e-4, 1e-5], [1e-5, 1e-4]])
    walls["centroid"] = walls["start"]
    plan = LineMap(walls, columns, sigma=0.01)
    table, grid, begins, members = plan.index
    n, length = len(RING), table[:8, 4]
    assert len(table) == n + 12
    assert table[:, 5].tolist() == [1.0] * 20
    # What is known at the start of a wall, at its middle.
    lever = length / 2
    np.testing.assert_allclose(table[:n, 6], 4e-4 + 2e-5 * lever + 1e-4 * lever**2 + 1e-4)
    np.testing.assert_allclose(table[:n, 7], 1e-5 + 1e-4 * lever)
    np.testing.assert_allclose(table[:n, 8], 1e-4)
    # Twelve sides around the column, which are seen from outside: that is to their left.
    middles = table[n:, :2] + table[n:, 4:5] * table[n:, 2:4] / 2 - (1.0, 0.0)
    np.testing.assert_allclose(np.hypot(*middles.T), 0.3 * math.cos(math.pi / 12))
    outward = -table[n:, 3] * middles[:, 0] + table[n:, 2] * middles[:, 1]
    assert (outward > 0).all()
    np.testing.assert_allclose(table[n:, 6], 1e-4)
    low, cell, (wide, high) = grid[:2], grid[2], grid[3:].astype(int)
    # Each cell has two lists: of the walls near it, and of those that cross it.
    assert len(begins) == 2 * wide * high + 1
    assert begins[-1] == len(members)
    for place in np.random.default_rng(0).uniform((-3.5, -2.5), (4.5, 3.5), (200, 2)):
        i, j = np.floor((place - low) / cell).astype(int)
        assert 0 <= i < wide
        assert 0 <= j < high
        at = i * high + j
        along = np.clip(((place - table[:, :2]) * table[:, 2:4]).sum(axis=1), 0, table[:, 4])
        away = np.linalg.norm(table[:, :2] + along[:, None] * table[:, 2:4] - place, axis=1)
        listed = members[begins[at] : begins[at + 1]]
        assert {*np.flatnonzero(away < 0.3)} <= {*listed}
        assert away[listed].max(initial=0) < 2.5


@pytest.mark.parametrize("seed", range(4))
def test_walls_of_which_one_may_pass_by_an_end_of_the_other_are_pairs(seed):
    """Of 200 walls; one passes where an end is within 35 cm of its line, or of 35 cm beyond."""
    rng = np.random.default_rng(seed)
    starts, turns = rng.uniform(-15, 15, (200, 2)), rng.uniform(-math.pi, math.pi, 200)
    lengths = rng.choice((0.3, 1.0, 6.0, 20.0), 200)
    ahead = np.column_stack((np.cos(turns), np.sin(turns)))
    ends = starts + lengths[:, None] * ahead
    walls = walls_of(np.stack((starts, ends), axis=1))
    pairs = beside(walls)
    assert (np.diff(pairs @ (200, 1)) > 0).all()
    assert (pairs[:, 0] < pairs[:, 1]).all()
    listed, needed = {*map(tuple, pairs.tolist())}, set()
    for point in (starts, ends):
        for k in range(200):
            arm = point[k] - starts
            along = np.clip((arm * ahead).sum(axis=1), -0.35, lengths + 0.35)
            away = np.linalg.norm(arm - along[:, None] * ahead, axis=1)
            near = np.flatnonzero(away <= 0.35).tolist()
            needed |= {(min(k, i), max(k, i)) for i in near if i != k}
    assert len(needed) > 100
    assert needed <= listed
    assert len(listed) < 6 * len(needed)


def test_a_plan_is_no_larger_than_buildings_are():
    assert LineMap.from_lines([[0, 0, 1999, 0]]).size == (1999, 0)
    with pytest.raises(LineamentError, match="2001 m wide"):
        LineMap.from_lines([[0, 0, 2001, 0]])


@pytest.mark.parametrize(
    ("ys", "ranges", "gone"),
    [
        ((-0.5, 0.0, 0.5), (2.5, 2.5, 2.5), True),
        ((-0.5, 0.0), (2.5, 2.5), False),  # two beams
        ((-0.5, 0.0, 0.5), (2.5, 2.5, 2.25), False),  # less than 30 cm behind it
        ((-0.5, 0.0, 0.5), (2.5, 2.5, 2.35), True),
        ((-0.95, 0.0, 0.5), (2.5, 2.5, 2.5), False),  # 5 cm from its end
        ((-0.85, 0.0, 0.85), (2.5, 2.5, 2.5), True),
        ((0.0, 0.5, 1.1), (2.5, 2.5, 2.5), False),  # beside it
    ],
)
def test_a_wall_that_three_beams_pass_is_gone(ys, ranges, gone):
    """Two metres ahead, from y = -1 to 1, seen from its left."""
    wall = segments_of(walls_of(np.array([[(2.0, -1.0), (2.0, 1.0)]])))
    beams = np.zeros((len(ys), 10))
    bearings = np.arctan2(ys, 2.0)
    beams[:, 2], beams[:, 3] = np.cos(bearings), np.sin(bearings)
    beams[:, 4] = np.array(ranges) / np.cos(bearings)
    assert passed(wall, beams).tolist() == [gone]
    other_side = segments_of(walls_of(np.array([[(2.0, 1.0), (2.0, -1.0)]])))
    assert not passed(other_side, beams).any()


@pytest.mark.parametrize(
    ("across", "views", "ends"),
    [
        (2, 1, [(0, 5)]),
        (2, 3, [(0, 2), (3, 5)]),
        (2, 43, []),
        (4, 2, [(0, 2), (3, 5)]),
        (6, 2, [(0, 5)]),
    ],
)
def test_a_wall_goes_on_where_more_than_a_fifth_of_its_sights_do(across, views, ends):
    """Twenty sights to either side of a doorway, and some along all of it."""
    sights, pose = np.zeros(40 + across, SIGHT), np.zeros((1, 3))
    sights["covariance"] = 1e-6 * np.eye(2)
    sights["ends"][:20], sights["ends"][20:40], sights["ends"][40:] = (0, 2), (3, 5), (0, 5)
    walls = walls_along(sights, pose, lines_of(sights, pose, 1), views=views)
    found = np.column_stack((walls["start"][:, 0], walls["end"][:, 0]))
    np.testing.assert_allclose(found, np.reshape(ends, (-1, 2)), atol=1e-12)


@pytest.mark.parametrize(("square", "columns"), [(10.5, 1), (12.3, 2)])
def test_columns_are_one_within_the_99_percent_of_three_degrees(square, columns):
    """Centre and radius of both are known to 10 mm; the quantile is 11.34."""
    first, other = np.zeros((2, 1), ARC)
    first["covariance"] = other["covariance"] = np.eye(3) * 1e-4
    other["radius"] = math.sqrt(2e-4 * square)
    assert len(columns_shown([first, other])) == columns
