"""Method optimal reaches the bounds, and its covariances tell the errors (Monte Carlo)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from test_consistency import WALLS, assert_consistent, bound, line_errors
from worlds import NOISE, STEP, fan, room, scan_of, vertex, wall

from lineament import Extractor
from lineament.bounds import arc_bound, corner_bound, line_bound
from lineament.simulation import Sensor, World

pytestmark = pytest.mark.slow
AWARE = Extractor("optimal", noise=NOISE)


def batch_of(true, angles, runs, seed):
    noise = NOISE.sigma * np.random.default_rng(seed).normal(size=(runs, len(angles)))
    return AWARE.batch(true + noise, angle_min=float(angles[0]), angle_increment=STEP)


def mean_nees(errors, covariances):
    """Mean of the squares over their degrees of freedom: 1 where the covariances are right."""
    squares = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(covariances), errors)
    return squares.mean() / errors.shape[1]


@pytest.mark.parametrize("name", WALLS)
def test_lines_reach_the_bound_and_know_it(name):
    angles, distance, normal = WALLS[name]
    batch = batch_of(wall(angles, distance, normal), angles, 4000, 6)
    whole = [features.segments for features in batch if len(features.segments) == 1]
    assert len(whole) > 0.998 * len(batch)
    lines = np.concatenate(whole)
    errors = line_errors(lines, distance, normal)
    rmse = np.sqrt((errors**2).mean(axis=0))
    np.testing.assert_allclose(rmse, bound(angles, distance, normal), rtol=0.05)
    assert_consistent(errors, lines["covariance"])


def one_each(batch):
    """Segments and corners of the scans in which two lines meet once; nearly all."""
    found = [f for f in batch if len(f.segments) == 2 and len(f.corners) == 1]
    assert len(found) > 0.99 * len(batch)
    return np.stack([f.segments for f in found]), np.concatenate([f.corners for f in found])


@pytest.mark.parametrize("convex", [True, False])
@pytest.mark.parametrize("opening", [90, 150])
def test_corners_come_near_the_bound_and_know_it(opening, convex):
    """Near it only: the same measurements tell where the border is; the covariance knows that."""
    angles, half = fan(25, STEP), math.radians(opening / 2)
    batch = batch_of(vertex(angles, 2.83, opening, convex=convex), angles, 2000, 8)
    _, corners = one_each(batch)
    errors = corners["position"] - (2.83, 0.0)
    away = 1 if convex else -1
    sides = [
        line_bound(
            angles[side], (2.83, 0.0), sign * (math.pi / 2 - away * (half - math.pi / 2)), NOISE
        )
        for side, sign in ((angles < -1e-9, 1), (angles > 1e-9, -1))
    ]
    least = np.sqrt(np.trace(corner_bound(*sides)))
    assert math.sqrt((errors**2).sum(axis=1).mean()) < 1.2 * least
    assert 0.85 < mean_nees(errors, corners["covariance"]) < 1.15


@pytest.mark.parametrize("distances", [(2.0, 2.2), (2.0, 2.5), (2.83, 2.7)])
def test_corners_between_beams_are_as_good(distances):
    angles, normals = fan(25), np.radians((40.0, -50.0))
    batch = batch_of(
        room(angles, list(zip(distances, (40.0, -50.0), strict=True))), angles, 1500, 9
    )
    _, corners = one_each(batch)
    across = np.column_stack((np.cos(normals), np.sin(normals)))
    errors = corners["position"] - np.linalg.solve(across, distances)
    assert 0.85 < mean_nees(errors, corners["covariance"]) < 1.15


def test_columns_reach_the_bound_and_know_it():
    sensor = Sensor("fan", 481, math.radians(-80), STEP, noise=NOISE)
    column = np.array([2.5, 0.3, 0.25])
    world, pose, rng = World([[5, -9, 5, 9]], [column]), (0.0, 0.0, 0.0), np.random.default_rng(1)
    _, surface = sensor.ideal(world, pose)
    least = arc_bound(sensor.angles[surface == 1], column[:2], column[2], NOISE)
    found = [AWARE(sensor.scan(world, pose, rng)).arcs for _ in range(600)]
    arcs = np.concatenate([arcs for arcs in found if len(arcs) == 1])
    assert len(arcs) > 0.99 * len(found)
    errors = np.column_stack((arcs["center"], arcs["radius"])) - column
    assert math.sqrt((errors**2).sum(axis=1).mean()) < 1.2 * math.sqrt(np.trace(least))
    assert 0.8 < mean_nees(errors, arcs["covariance"]) < 1.2


@pytest.mark.parametrize("incidence", [0, 30, 60])
def test_edges_know_how_far_off_they_are(incidence):
    """Beams fall on either side of the end of a wall, wherever they fall."""
    errors, covariances, rng = [], [], np.random.default_rng(2)
    for _ in range(400):
        angles = fan(15) + rng.uniform(0, STEP)
        near = wall(angles, 2.0 * math.cos(math.radians(incidence)), incidence)
        ranges = np.where(angles > 0, 12.0, near) + NOISE.sigma * rng.normal(size=len(angles))
        (edge,) = AWARE(scan_of(ranges, angles)).corners
        assert edge["kind"] == "edge"
        errors.append(edge["position"] - (2.0, 0.0))
        covariances.append(edge["covariance"])
    assert 0.8 < mean_nees(np.array(errors), np.array(covariances)) < 1.25
