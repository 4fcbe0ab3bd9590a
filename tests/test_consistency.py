"""Covariances are those of the errors, and features as good as the bound (Monte Carlo)."""

import math

import numpy as np
import pytest
from lineament_lab.evaluation import NormalisedErrors
from worlds import NOISE, STEP, errors_of_lines, fan, room, scan_of, vertex, wall

from lineament import Extractor
from lineament.bounds import arc_bound, corner_bound, line_bound
from lineament.simulation import Sensor, World

pytestmark = pytest.mark.slow
OPTIMAL = Extractor("optimal", noise=NOISE)
EXTRACTORS = {
    "optimal": OPTIMAL,
    **{f: Extractor("liu:scale_free", noise=NOISE, fit=f) for f in ("weighted", "total", "y_of_x")},
}
extractors = pytest.mark.parametrize("name", ["optimal", "weighted", "total"])
#: Name: bearings, distance and normal [degrees] of the wall.
WALLS = {
    "frontal": (fan(20), 2.0, 0.0),
    "grazing": (fan(9), 1.0, 70.0),
    "vertical": (fan(20) + math.pi / 2, 2.0, 90.0),
}


def batch_of(name, truth, angles, runs, seed):
    noise = NOISE.sigma * np.random.default_rng(seed).normal(size=(runs, len(angles)))
    return EXTRACTORS[name].batch(truth + noise, angle_min=float(angles[0]), angle_increment=STEP)


def rmse(errors):
    return np.sqrt((errors**2).mean(axis=0))


def assert_consistent(errors, covariances, share=0.0):
    """The mean of n squares of k normal errors lies within k ± 1.96 √(2k/n), or a share of k."""
    n, k = errors.shape
    squares = NormalisedErrors.of(errors, covariances).squares
    assert squares.mean() == pytest.approx(k, abs=share * k or 1.96 * math.sqrt(2 * k / n))
    return squares


def lines_of(name, case, runs, seed):
    """Lines of a wall, and their errors: of the offset at the centroid to the left, and angle."""
    angles, distance, normal = WALLS[case]
    batch = batch_of(name, wall(angles, distance, normal), angles, runs, seed)
    lines = np.concatenate([f.segments for f in batch if len(f.segments) == 1])
    assert len(lines) >= (0.998 if name == "optimal" else 1) * runs
    assert name == "optimal" or (lines["n_points"] == len(angles)).all()
    return lines, errors_of_lines(lines, distance, normal)


def bound(case):
    """Cramér-Rao: standard deviations of the offset at the centroid, and of the angle."""
    angles, distance, normal = WALLS[case]
    alpha = math.radians(normal)
    foot = distance * np.array([math.cos(alpha), math.sin(alpha)])
    return np.sqrt(np.diag(line_bound(angles, foot, alpha + math.pi / 2, NOISE).covariance))


@extractors
@pytest.mark.parametrize("case", WALLS)
def test_lines_know_their_errors_and_reach_the_bound(name, case):
    lines, errors = lines_of(name, case, 4000, 6)
    assert_consistent(errors, lines["covariance"])
    for k in range(2):
        assert_consistent(errors[:, k : k + 1], lines["covariance"][:, k : k + 1, k : k + 1])
    if name != "total":
        np.testing.assert_allclose(rmse(errors), bound(case), rtol=0.05)


def test_plain_lines_do_not_reach_it_at_grazing_incidence():
    """Else the test before could not fail."""
    fits = ("weighted", "total", "y_of_x")
    weighted, total, y_of_x = (rmse(lines_of(fit, "grazing", 2000, 7)[1])[1] for fit in fits)
    assert total > 1.05 * bound("grazing")[1]
    assert weighted < min(total, y_of_x)


def corners_of(batch, share):
    """Corners of the scans in which two lines meet once, which nearly all scans must be."""
    found = [f.corners for f in batch if len(f.segments) == 2 and len(f.corners) == 1]
    assert len(found) > share * len(batch)
    return np.concatenate(found)


@pytest.mark.parametrize(
    ("name", "opening"), [("optimal", 90), ("optimal", 150), ("weighted", 90), ("total", 90)]
)
@pytest.mark.parametrize("convex", [True, False])
def test_corners_know_their_errors_and_come_near_the_bound(name, opening, convex):
    """The vertex lies on a beam: a measurement shared by both walls pulls at them otherwise.

    Near the bound only: the same measurements say where the border is. `optimal` knows that.
    """
    angles, half, away = fan(25), math.radians(opening / 2), 1 if convex else -1
    truth = vertex(angles, 2.83, opening, convex=convex)
    corners = corners_of(
        batch_of(name, truth, angles, 3000, 8), 0.99 if name == "optimal" else 0.967
    )
    assert (corners["convex"] == convex).all()
    errors = corners["position"] - (2.83, 0.0)
    assert_consistent(errors, corners["covariance"], 0.15 if name == "optimal" else 0)
    sides = [
        line_bound(
            angles[side], (2.83, 0.0), sign * (math.pi / 2 - away * (half - math.pi / 2)), NOISE
        )
        for side, sign in ((angles < -1e-9, 1), (angles > 1e-9, -1))
    ]
    if name == "optimal":
        assert np.hypot(*rmse(errors)) < 1.2 * math.sqrt(np.trace(corner_bound(*sides)))
    else:
        assert rmse(errors).max() < 0.003


@extractors
@pytest.mark.parametrize("distances", [(2.0, 2.2), (2.0, 2.5), (2.83, 2.7)])
def test_corners_between_beams_know_their_errors(name, distances):
    """The filter of liu moves the cut; the measurements next to it must not pull at the lines."""
    angles, normals = fan(25), (40.0, -50.0)
    truth = room(angles, list(zip(distances, normals, strict=True)))
    corners = corners_of(
        batch_of(name, truth, angles, 1500, 9), 0.99 if name == "optimal" else 0.933
    )
    across = np.column_stack((np.cos(np.radians(normals)), np.sin(np.radians(normals))))
    errors = corners["position"] - np.linalg.solve(across, distances)
    squares = NormalisedErrors.of(errors, corners["covariance"]).squares
    if name == "optimal":
        assert 1.7 < squares.mean() < 2.3
        return
    # The median of χ² with 2 degrees of freedom. The mean is a little above 2: now and then the
    # cut is further off than the measurements that are left out.
    assert np.median(squares) == pytest.approx(2 * math.log(2), abs=0.15)
    assert 1.7 < squares.mean() < 2.8


def test_columns_reach_the_bound_and_know_it():
    sensor = Sensor("fan", 481, math.radians(-80), STEP, noise=NOISE)
    column = np.array([2.5, 0.3, 0.25])
    world, pose, rng = World([[5, -9, 5, 9]], [column]), (0.0, 0.0, 0.0), np.random.default_rng(1)
    _, surface = sensor.ideal(world, pose)
    least = arc_bound(sensor.angles[surface == 1], column[:2], column[2], NOISE)
    found = [OPTIMAL(sensor.scan(world, pose, rng)).arcs for _ in range(600)]
    arcs = np.concatenate([arcs for arcs in found if len(arcs) == 1])
    assert len(arcs) > 0.99 * len(found)
    errors = np.column_stack((arcs["center"], arcs["radius"])) - column
    assert np.linalg.norm(rmse(errors)) < 1.2 * math.sqrt(np.trace(least))
    assert_consistent(errors, arcs["covariance"], 0.2)


@pytest.mark.parametrize("incidence", [0, 30, 60])
def test_edges_know_how_far_off_they_are(incidence):
    """Beams fall on either side of the end of a wall, wherever they fall."""
    edges, rng = [], np.random.default_rng(2)
    for _ in range(400):
        angles = fan(15) + rng.uniform(0, STEP)
        near = wall(angles, 2.0 * math.cos(math.radians(incidence)), incidence)
        ranges = np.where(angles > 0, 12.0, near) + NOISE.sigma * rng.normal(size=len(angles))
        found = OPTIMAL(scan_of(ranges, angles))
        assert len(found.corners) == 0
        (edge,) = found.edges
        edges.append(edge)
    edges = np.array(edges)
    squares = NormalisedErrors.of(edges["position"] - (2.0, 0.0), edges["covariance"]).squares
    assert 1.6 < squares.mean() < 2.5
