"""Covariances are those of the errors, and lines are as good as the bound (Monte Carlo)."""

import math

import numpy as np
import pytest
from worlds import NOISE, STEP, fan, room, vertex, wall

from lineament import Extractor
from lineament.bounds import line_bound
from lineament.evaluation import NormalisedErrors

SIGMA = NOISE.sigma
#: Name: bearings, distance and normal [degrees] of the wall.
WALLS = {
    "frontal": (fan(20), 2.0, 0.0),
    "grazing": (fan(9), 1.0, 70.0),
    "vertical": (fan(20) + math.pi / 2, 2.0, 90.0),
}


def features_of(truth, angles, runs, seed, **settings):
    noise = SIGMA * np.random.default_rng(seed).normal(size=(runs, len(angles)))
    extractor = Extractor("liu:scale_free", noise=NOISE, **settings)
    return extractor.batch(truth + noise, angle_min=float(angles[0]), angle_increment=STEP)


def line_errors(segments, distance, normal_deg):
    """(offset at the centroid along the left normal, angle) of each line, less the truth."""
    alpha = math.radians(normal_deg)
    # Seen from inside, beams run along the normal turned left by 90°.
    turn = segments["angle"] - (alpha + math.pi / 2)
    turn = np.angle(np.exp(1j * turn))
    left = -np.array([math.cos(alpha), math.sin(alpha)])
    return np.column_stack((segments["centroid"] @ left + distance, turn))


def assert_consistent(errors, covariances):
    """The mean of n squares of k normal errors lies within k ± 1.96 √(2k/n)."""
    n, k = errors.shape
    squares = NormalisedErrors.of(errors, covariances).squares
    assert squares.mean() == pytest.approx(k, abs=1.96 * math.sqrt(2 * k / n))


def the_corners(batch, least):
    """Corners of the scans that show two segments and one corner, of which so many must be."""
    one = [f.corners for f in batch if len(f.segments) == 2 and len(f.corners) == 1]
    assert len(one) > least
    return np.concatenate(one)


@pytest.mark.slow
@pytest.mark.parametrize("fit", ["weighted", "total"])
@pytest.mark.parametrize("name", WALLS)
def test_covariance_of_lines(name, fit):
    angles, distance, normal = WALLS[name]
    batch = features_of(wall(angles, distance, normal), angles, 1500, 5, fit=fit)
    lines = batch.segments
    assert len(lines) == 1500
    assert (lines["n_points"] == len(angles)).all()
    errors = line_errors(lines, distance, normal)
    assert_consistent(errors, lines["covariance"])
    for k in range(2):
        assert_consistent(errors[:, k : k + 1], lines["covariance"][:, k : k + 1, k : k + 1])


def bound(angles, distance, normal_deg):
    """Cramér-Rao: standard deviations of the offset at the centroid, and of the angle."""
    alpha = math.radians(normal_deg)
    foot = distance * np.array([math.cos(alpha), math.sin(alpha)])
    return np.sqrt(np.diag(line_bound(angles, foot, alpha + math.pi / 2, NOISE).covariance))


def rmse_of_lines(name, runs, seed, fit):
    angles, distance, normal = WALLS[name]
    batch = features_of(wall(angles, distance, normal), angles, runs, seed, fit=fit)
    return np.sqrt((line_errors(batch.segments, distance, normal) ** 2).mean(axis=0))


@pytest.mark.slow
@pytest.mark.parametrize("name", WALLS)
def test_weighted_lines_reach_the_bound(name):
    found = rmse_of_lines(name, 4000, 6, "weighted")
    np.testing.assert_allclose(found, bound(*WALLS[name]), rtol=0.05)


@pytest.mark.slow
def test_plain_lines_do_not_reach_it_at_grazing_incidence():
    """Else the test before could not fail."""
    fits = ("weighted", "total", "y_of_x")
    weighted, total, y_of_x = (rmse_of_lines("grazing", 2000, 7, fit)[1] for fit in fits)
    assert total > 1.05 * bound(*WALLS["grazing"])[1]
    assert weighted < min(total, y_of_x)


@pytest.mark.slow
@pytest.mark.parametrize("fit", ["weighted", "total"])
@pytest.mark.parametrize("convex", [True, False])
def test_covariance_of_a_corner(fit, convex):
    """The vertex lies on a beam: a measurement shared by both walls pulls at them otherwise."""
    angles = fan(25)
    batch = features_of(vertex(angles, 2.83, 90, convex=convex), angles, 3000, 8, fit=fit)
    corners = the_corners(batch, 2900)
    assert (corners["convex"] == convex).all()
    errors = corners["position"] - (2.83, 0.0)
    assert_consistent(errors, corners["covariance"])
    assert np.sqrt((errors**2).mean(axis=0)).max() < 0.003


@pytest.mark.slow
@pytest.mark.parametrize("fit", ["weighted", "total"])
@pytest.mark.parametrize("distances", [(2.0, 2.2), (2.0, 2.5), (2.83, 2.7)])
def test_covariance_of_a_corner_between_beams(fit, distances):
    """The filter moves the cut; the measurements next to it must not pull at the lines."""
    angles, normals = fan(25), (40.0, -50.0)
    walls = list(zip(distances, normals, strict=True))
    batch = features_of(room(angles, walls), angles, 1500, 9, fit=fit)
    corners = the_corners(batch, 1400)
    directions = np.radians(normals)
    across = np.column_stack((np.cos(directions), np.sin(directions)))
    errors = corners["position"] - np.linalg.solve(across, distances)
    squares = NormalisedErrors.of(errors, corners["covariance"]).squares
    # The median of χ² with 2 degrees of freedom. The mean is a little above 2: now and then the
    # cut is further off than the measurements that are left out.
    assert np.median(squares) == pytest.approx(2 * math.log(2), abs=0.15)
    assert 1.7 < squares.mean() < 2.8
