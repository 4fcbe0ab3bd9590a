"""The pose of a corner: where it is, which way it looks, its covariance, and how it is followed."""

import math

import numpy as np
import pytest
from handmade import corner, features, segment

import lineament as ln
from lineament.motion import Dock, Tracks, corner_pose
from lineament.scan.poses import compose, inverse

SIGMA = 0.01
BEARINGS = np.linspace(-0.4, 1.3, 500)


def beams(x, y):
    """Ranges of the corner of a room, x ahead and y to the left."""
    return np.minimum(x / np.cos(BEARINGS), y / np.maximum(np.sin(BEARINGS), 1e-9))


@pytest.mark.parametrize("method", ["optimal", "iepf"])
def test_the_covariance_holds_by_monte_carlo(method):
    extract, rng = ln.Extractor(method, noise=ln.RangeNoise(sigma=SIGMA)), np.random.default_rng(5)
    truth, errors = np.array((3.0, 1.5, -0.75 * math.pi)), []
    for _ in range(400):
        noisy = beams(3.0, 1.5) + rng.normal(0, SIGMA, len(BEARINGS))
        found = extract(ln.LaserScan(noisy, angles=BEARINGS))
        nearest = np.hypot(*(found.corners["position"] - truth[:2]).T).argmin()
        pose = corner_pose(found, int(nearest))
        assert pose is not None
        off = pose.pose - truth
        white = np.linalg.solve(np.linalg.cholesky(pose.covariance), off)
        errors.append(white)
        np.testing.assert_allclose(pose.pose[:2], found.corners["position"][nearest], atol=1e-9)
        own = found.corners["covariance"][nearest]
        np.testing.assert_allclose(pose.covariance[:2, :2], own, rtol=1e-6, atol=1e-12)
    squares = np.square(errors)
    # The mean of 400 χ² with three degrees of freedom is 3 ± 0.12, of one 1 ± 0.07.
    assert squares.sum(axis=1).mean() == pytest.approx(3.0, abs=0.5)
    np.testing.assert_allclose(np.mean(errors, axis=0), 0, atol=0.2)


@pytest.mark.parametrize("turn", [0.0, 1.0, math.pi, -2.0])
@pytest.mark.parametrize("opening", [0.3, math.pi / 2, 2.5])
@pytest.mark.parametrize("flips", [(False, False), (True, False), (False, True), (True, True)])
def test_it_looks_to_where_the_walls_open(turn, opening, flips):
    arms = turn - opening / 2, turn + opening / 2
    walls = []
    for arm, is_flipped in zip(arms, flips, strict=True):
        away = (1.0 + 2 * math.cos(arm), 2.0 + 2 * math.sin(arm))
        ends = (away, (1.0, 2.0)) if is_flipped else ((1.0, 2.0), away)
        walls.append(segment(*ends, 0, 9))
    found = corner_pose(features(50, walls, [corner(1, 2, segments=(0, 1))]), 0)
    x, y, theta = found.pose
    assert (x, y) == pytest.approx((1.0, 2.0))
    assert math.remainder(theta - turn, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("sides", [(0, -1), (-1, 0), (-1, -1), (0, 2)])
def test_a_corner_without_two_segments_that_cross_has_no_pose(sides):
    walls = [segment((1.0, 2.0), (3.0, 2.0), 0, 9), segment((1.0, 2.0), (1.0, 4.0), 9, 18)]
    walls.append(segment((3.0, 2.0), (5.0, 2.05), 19, 28))  # nearly in line with the first
    assert corner_pose(features(50, walls, [corner(1, 2, segments=(0, 1))]), 0) is not None
    assert corner_pose(features(50, walls, [corner(1, 2, segments=sides)]), 0) is None


@pytest.mark.slow
def test_covariance_by_small_errors_of_the_walls():
    """Each wall is moved by its own errors: the pose follows as its covariance says."""
    rng = np.random.default_rng(2)
    walls = [segment((0.5, 0.2), (3, 1), 0, 9), segment((3, 1), (3.5, 4), 10, 19)]
    spreads = [np.array([[4, 1], [1, 2]]) * 1e-6, np.array([[1, -0.5], [-0.5, 3]]) * 1e-6]
    for wall, spread in zip(walls, spreads, strict=True):
        wall["covariance"] = spread
    rows = [corner(3, 1, segments=(0, 1))]
    known, poses = corner_pose(features(50, walls, rows), 0), []
    for _ in range(5000):
        moved = [wall.copy() for wall in walls]
        for wall, spread in zip(moved, spreads, strict=True):
            offset, turn = rng.multivariate_normal((0, 0), spread)
            angle = float(wall["angle"])
            wall["centroid"] += offset * np.array((-math.sin(angle), math.cos(angle)))
            wall["angle"] = angle + turn
        poses.append(corner_pose(features(50, moved, rows), 0).pose)
    white = np.linalg.inv(np.linalg.cholesky(known.covariance))
    np.testing.assert_allclose(white @ np.cov(np.transpose(poses)) @ white.T, np.eye(3), atol=0.08)


WALLS = [segment((0, 0), (2, 0), 0, 9), segment((2, 0), (2, 3), 10, 19)]
WALLS += [segment((2, 3), (5, 3), 20, 29), segment((5, 3), (5, 9), 30, 39)]
PLACES = [(2, 0), (2, 3), (5, 3)]


def room(*seen, lone=None):
    """Features of the corners with these numbers, and one of which only one wall is known."""
    corners = [corner(*PLACES[k], segments=(k, k + 1)) for k in seen]
    if lone is not None:
        corners.append(corner(*lone, segments=(0, -1)))
    return features(50, WALLS, corners)


def tracks(*numbers, ended=()):
    nothing = np.empty(0, np.int64)
    ended = np.array(ended, np.int64)
    return Tracks(np.arange(4) + 90, np.array(numbers, np.int64), nothing, nothing, ended, None)


HERE = (0.0, 0.0, 0.0)


def place(found):
    return None if found is None else tuple(np.round(found.pose[:2], 9))


def test_the_nearest_corner_is_followed_by_its_track():
    dock = Dock((2.2, 2.6))
    assert dock(room(), tracks(), HERE) is None
    assert place(dock(room(0, lone=(2.2, 2.6)), tracks(7, 6), HERE)) is None  # 2.6 m away
    assert place(dock(room(0, 1, 2, lone=(2.2, 2.6)), tracks(7, 8, 9, 6), HERE)) == (2, 3)
    assert dock.track == 8
    # By its number, wherever it is and in whatever order they come.
    assert place(dock(room(2, 1, 0), tracks(8, 7, 9), HERE)) == (5, 3)
    # Not seen, it is waited for, until its track ends: then the nearest to where it was.
    assert dock(room(0, 1), tracks(7, 6), HERE) is None
    assert dock.track == 8
    assert dock(room(0, 1), tracks(7, 6, ended=[8]), HERE) is None
    assert place(dock(room(0, 1, 2), tracks(7, 6, 11), HERE)) == (5, 3)
    assert dock.track == 11


def test_the_point_is_in_the_frame_of_the_first_scan():
    pose = (1.0, -2.0, 0.7)
    found = room(0, 1, 2).transform(*inverse(pose))
    dock = Dock((5.5, 3.5))
    seen = dock(found, tracks(7, 8, 9), pose)
    assert compose(pose, seen.pose)[:2] == pytest.approx((5.0, 3.0))
    # When its track has ended, it is looked for where it was, not where it was asked for.
    later = (1.5, -1.0, -0.3)
    dock._point = (5.0, 3.0)
    again = dock(room(2).transform(*inverse(later)), tracks(20, ended=[9]), later)
    assert compose(later, again.pose)[:2] == pytest.approx((5.0, 3.0))


@pytest.mark.parametrize("seen", [0, 1])
@pytest.mark.parametrize(("away", "is_near"), [(0.99, True), (1.01, False)])
def test_a_corner_is_looked_for_within_a_metre(away, is_near, seen):
    dock = Dock((2.0, PLACES[seen][1] - away))
    assert (dock(room(seen), tracks(8), HERE) is not None) == is_near


@pytest.mark.parametrize(
    ("deviations", "is_near"),
    [((0.3, 0.3, 0.0), True), ((0.4, 0.4, 0.0), False), ((0.0, 0.0, 0.13), True),
     ((0.0, 0.0, 0.15), False)],
)  # fmt: skip
def test_no_corner_is_chosen_where_its_place_is_not_known(deviations, is_near):
    dock, covariance = Dock((2.0, 3.0)), np.diag(deviations) ** 2
    assert (dock(room(1), tracks(8), HERE, covariance) is not None) == is_near
    # One that is followed goes on, wherever it is.
    if is_near:
        assert dock(room(1), tracks(8), HERE, 100 * covariance) is not None


def test_a_track_alone():
    dock = Dock(track=8)
    assert dock(room(0), tracks(7), HERE) is None
    assert place(dock(room(0, 1), tracks(7, 8), HERE)) == (2, 3)
    assert dock(room(0, 1), tracks(7, 9, ended=[8]), HERE) is None
    assert dock.track == 8


@pytest.mark.parametrize("given", [{}, {"point": (1, 2), "track": 3}])
def test_a_point_or_a_track(given):
    with pytest.raises(ValueError, match="expected a point or a track, one of them"):
        Dock(**given)


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        ({"point": (math.nan, 0)}, "x of the point is nan, expected a finite number"),
        ({"point": (1, 2, 3)}, r"point is \(1, 2, 3\), expected \(x, y\)"),
        ({"point": 1.0}, r"point is 1.0, expected \(x, y\)"),
        ({"track": -1}, "track is -1, expected ≥ 0"),
    ],
)
def test_a_point_that_is_nowhere_is_refused(given, problem):
    with pytest.raises(ValueError, match=problem):
        Dock(**given)
