"""Where a scan is among the walls of the last metres: cases worked by hand, and real walls."""

import math

import numpy as np
import pytest

from lineament import Extractor, LaserScan
from lineament.mapping.around import Around, Sought, doubts, grid_around, open_ways
from lineament.mapping.consistency import agreement
from lineament.mapping.local_map import beams_of
from lineament.mapping.views import looked, views_of
from lineament.motion.estimate import Motion
from lineament.simulation import SENSORS, World

BESIDE = np.diag((0.05, 0.05, 0.02)) ** 2
EXPECTED = np.diag((0.6, 0.6, 0.7)) ** 2


def motion(unobserved=()):
    return Motion(1.0, 0.0, 0.0, EXPECTED, np.array(unobserved, float).reshape(-1, 3))


def seen(walls, pose):
    """Return the scan and the features of a pose among walls, of 2 cm noise."""
    scan = SENSORS["utm30lx"].scan(World(walls), pose, np.random.default_rng(1))
    return scan, Extractor()(scan)


def around(walls):
    scan, features = seen(walls, (0.0, 0.0, 0.0))
    return Around.of(features, scan, views_of(np.zeros((1, 3)), [looked(scan)]))


def test_the_ways_that_no_wall_shows():
    np.testing.assert_allclose(open_ways(motion()), np.empty((0, 2)))
    np.testing.assert_allclose(open_ways(motion([(0.8, 0.0, 0.6)])), [(1.0, 0.0)])
    # A turn alone is no way.
    np.testing.assert_allclose(open_ways(motion([(0.3, 0.0, 0.95)])), np.empty((0, 2)))
    np.testing.assert_allclose(open_ways(motion(np.eye(3))), np.eye(2))


@pytest.mark.parametrize(
    ("other", "nats", "along", "is_doubted"),
    [
        ((1.2, 0.0, 0.0), 9.0, (), False),  # near: the same place
        ((1.5, 0.0, 0.0), 6.1, (), True),
        ((1.5, 0.0, 0.0), 5.9, (), False),  # more than 4 nats less likely
        ((1.0, 0.0, 0.4), 6.1, (), True),
        ((1.0, 0.0, 2 * math.pi + 0.2), 9.9, (), False),  # a turn is the same turn a round on
        ((1.5, 0.0, 0.0), 9.9, [(1, 0, 0)], False),  # along what no wall shows
        ((1.5, 0.4, 0.0), 9.9, [(1, 0, 0)], True),
        ((1.5, 0.4, 0.0), 9.9, np.eye(3), False),
        ((1.5, 0.4, 0.4), 9.9, np.eye(3), True),
    ],
)
def test_another_place_that_is_about_as_likely_is_a_doubt(other, nats, along, is_doubted):
    poses = np.array([(1.0, 0.0, 0.0), other])
    assert doubts(poses, np.array((10.0, nats)), motion(along))[0] == is_doubted
    assert doubts(poses[::-1], np.array((nats, 10.0)), motion(along))[0] == is_doubted


def test_along_what_no_wall_shows_the_pose_is_known_as_well_as_it_is_likelier():
    poses = np.array([(1.0, 0.0, 0.0), (1.4, 0.0, 0.0), (0.6, 0.0, 0.0), (1.0, 0.9, 0.0)])
    nats = np.array((10.0, 10.0 - math.log(3), 10.0 - math.log(3), 9.9))
    covariance = doubts(poses, nats, motion([(1, 0, 0)]))[1]
    variance = 2 * 0.4**2 / 3 / (1 + 2 / 3)
    np.testing.assert_allclose(covariance, BESIDE + np.diag((variance, 0, 0)), atol=1e-12)
    far = doubts(poses, np.array((10.0, -90.0, -90.0, -90.0)), motion([(1, 0, 0)]))[1]
    np.testing.assert_allclose(far, BESIDE, atol=1e-12)


def test_what_is_expected_is_off_by_students_distribution():
    scan, features = seen([[3, -2, 3, 2]], (0.0, 0.0, 0.0))
    sought = Sought(scan, features, np.empty((0, 10)), (1.0, 0.0, math.pi), EXPECTED)
    poses = np.array([(1.0, 0.0, -math.pi), (1.3, 0.0, math.pi), (1.0, 0.0, math.pi + 0.7)])
    np.testing.assert_allclose(
        sought.known(poses), [0.0, -3 * math.log(4 / 3), -3 * math.log(7 / 3)]
    )


def test_turns_and_places_that_are_tried():
    """Seven places each way, by a deviation of 10 to 30 cm; seven turns, by half of one."""
    for way, turn, step, angle in (
        (0.02, 0.02, 0.1, 0.05), (0.2, 0.16, 0.2, 0.08), (9.0, 3.0, 0.3, 0.1)
    ):  # fmt: skip
        tried = grid_around((1.0, 2.0, 0.5), np.diag((way, way, turn)) ** 2)
        assert len(tried) == 343
        for column, (middle, by) in enumerate(((1.0, step), (2.0, step), (0.5, angle))):
            expected = middle + by * np.arange(-3, 4)
            np.testing.assert_allclose(np.unique(tried[:, column].round(9)), expected)


def test_poses_near_the_expected_one_are_tried():
    """Wherever within two deviations the pose is, one is tried within reach of refinement."""
    rng, prior = np.random.default_rng(0), (0.2, -0.1, 0.3)
    for way, turn in ((0.02, 0.02), (0.1, 0.1), (0.3, 0.2)):
        tried = grid_around(prior, np.diag((way, way, turn)) ** 2)
        for off in rng.uniform(-1, 1, (50, 3)) * (2 * way, 2 * way, min(2 * turn, 0.3)):
            away = np.abs(tried - np.add(prior, off)) / (0.16, 0.16, 0.06)
            assert away.max(axis=1).min() < 1


CORRIDOR = [[-40, 1, 40, 1], [40, -1, -40, -1]]
ROOM = [
    *([-3, 2, 1, 2], [1, 2, 1, 3], [1, 3, 4, 3], [4, 3, 4, -2], [4, -2, -1, -2]),
    *([-1, -2, -1, -2.5], [-1, -2.5, -3, -2.5], [-3, -2.5, -3, 2]),
]


@pytest.mark.parametrize("pose", [(0.9, 0.1, 0.2), (0.0, 0.0, -1.6), (-1.2, -0.5, 1.0)])
def test_in_a_room_a_jump_is_found(pose):
    found = around(ROOM).place(*seen(ROOM, pose), (0.3, 0.0, 0.0), EXPECTED, False)
    assert not found.is_lost
    assert found.by_beams is None
    np.testing.assert_allclose(found.motion.pose, pose, atol=0.02)


def test_a_room_that_is_alike_when_it_is_turned_is_a_doubt():
    """Most of what is seen now, the first scan did not see: it looks 270° around."""
    found = around(ROOM).place(*seen(ROOM, (0.0, 0.0, -2.5)), (0.3, 0.0, 0.0), EXPECTED, False)
    assert found.is_lost


def test_in_a_bare_corridor_the_motion_goes_on_and_is_known_no_better():
    found = around(CORRIDOR).place(
        *seen(CORRIDOR, (0.8, 0.1, 0.1)), (0.8, 0.0, 0.0), EXPECTED, False
    )
    assert not found.is_lost
    assert found.by_beams is not None
    np.testing.assert_allclose(found.motion.pose[1:], (0.1, 0.1), atol=0.02)
    assert 0.15 < math.sqrt(found.by_beams[0, 0]) < 0.6
    assert found.by_beams[1, 1] < 0.06**2


def test_a_door_in_the_corridor_shows_how_far():
    doors = [
        *([-40, 1, -3, 1], [-3, 1, -3, 1.3], [-3, 1.3, -2, 1.3], [-2, 1.3, -2, 1]),
        *([-2, 1, 2.5, 1], [2.5, 1, 2.5, 1.2], [2.5, 1.2, 3.6, 1.2], [3.6, 1.2, 3.6, 1]),
        *([3.6, 1, 40, 1], [40, -1, -40, -1]),
    ]
    found = around(doors).place(*seen(doors, (1.1, 0.1, 0.1)), (0.3, 0.0, 0.0), EXPECTED, False)
    assert not found.is_lost
    np.testing.assert_allclose(found.motion.pose, (1.1, 0.1, 0.1), atol=0.05)


@pytest.mark.parametrize(("ends", "least", "most"), [([], 1.2, 1.5), ([6.0], 0.05, 0.8)])
def test_what_beams_alone_leave_open(ends, least, most):
    """All of the five metres that are looked at; half, where the end of the corridor is in view."""
    walls = [*CORRIDOR, *([x, -1, x, 1] for x in ends)]
    scan, features = seen(walls, (0.8, 0.1, 0.1))
    at = Motion(0.8, 0.1, 0.1, EXPECTED, np.array([(1.0, 0.0, 0.0)]))
    covariance = around(walls).beams_alone(scan, features, at)
    assert least <= math.sqrt(covariance[0, 0]) < most
    np.testing.assert_allclose(covariance[1:, 1:], BESIDE[1:, 1:])


@pytest.mark.parametrize("is_near", [True, False])
def test_what_is_tried_where_walls_say_all_but_how_far(is_near):
    """Poses along the walls; of a bend that odometry has not seen, others too."""
    here, (scan, features) = around(CORRIDOR), seen(CORRIDOR, (0.8, 0.1, 0.1))
    prior, spread = (0.8, 0.05, 0.1), np.diag((0.06, 0.06, 0.03)) ** 2
    sought = Sought(scan, features, beams_of(features, scan), prior, spread)
    matched = here._match(features, prior, spread)
    poses = here._searched(sought, matched, is_near)
    assert tuple(poses[-1]) == matched.pose
    across = np.abs(poses[:, 1] - 0.1).max(), np.abs(poses[:, 2] - 0.1).max()
    assert (max(across) < 0.03) == is_near
    along = np.abs(np.subtract.outer(0.8 + np.linspace(-0.15, 0.15, 11), poses[:, 0])).min(axis=1)
    assert along.max() < 0.01


def test_elsewhere_it_is_lost():
    other = [[-1, 1, 1, 1], [1, 1, 1.2, -0.9], [1.2, -0.9, -1, -1.2], [-1, -1.2, -1, 1]]
    found = around(ROOM).place(*seen(other, (0.0, 0.0, 0.0)), (0.0, 0.0, 0.0), EXPECTED, False)
    assert found.is_lost


@pytest.mark.parametrize("walls", [ROOM, CORRIDOR])
def test_people_before_the_scanner_are_no_other_place(walls):
    """They hide so much that a quarter of the ends differ; walls are where they were."""
    people, near = [(1.0, 0.1, 0.3), (0.3, 1.0, 0.4), (0.3, -0.9, 0.3)], (0.2, 0.2, 0.03)
    scan = SENSORS["utm30lx"].scan(World(walls, people), (0, 0, 0), np.random.default_rng(1))
    here = around(walls)
    assert agreement(here.scan, scan, [(0.0, 0.0, 0.0)])[0] < 0.75
    found = here.place(scan, Extractor()(scan), (0.0, 0.0, 0.0), np.diag(near) ** 2, True)
    assert not found.is_lost
    np.testing.assert_allclose(found.motion.pose, 0, atol=0.02)


def test_where_there_are_no_walls_it_is_lost():
    scan = LaserScan(np.full(90, np.nan), -0.5, 0.01)
    nothing = Around.of(Extractor()(scan), scan, views_of(np.zeros((1, 3)), [looked(scan)]))
    found = nothing.place(scan, Extractor()(scan), (0.5, 0.0, 0.0), EXPECTED, False)
    assert found.is_lost
    np.testing.assert_allclose(found.motion.pose, (0.5, 0.0, 0.0))
