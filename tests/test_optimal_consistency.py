"""Method optimal reaches the bounds, and its covariances tell the errors (Monte Carlo)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from test_consistency import WALLS, assert_consistent, bound, line_errors
from worlds import NOISE, STEP, fan, room, vertex, wall

from lineament import Extractor
from lineament.bounds import arc_bound, corner_bound, line_bound
from lineament.evaluation.scores import Scores, evaluate
from lineament.simulation import SENSORS, Sensor, World, scene, truth

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
    """Near it only: the cut is made by the same readings, and the covariance knows that."""
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
    assert all(len(arcs) == 1 for arcs in found)
    arcs = np.concatenate(found)
    errors = np.column_stack((arcs["center"], arcs["radius"])) - column
    assert math.sqrt((errors**2).sum(axis=1).mean()) < 1.2 * math.sqrt(np.trace(least))
    assert 0.8 < mean_nees(errors, arcs["covariance"]) < 1.2


@pytest.mark.parametrize("name", ["paper", "utm30lx"])
def test_simulated_scenes(name):
    """Rooms, corridors and halls with columns; seeds that nothing was tuned on."""
    sensor, parts = SENSORS[name], []
    extractor = Extractor("optimal", noise=sensor.noise)
    for kind in ("room", "corridor", "hall"):
        for seed in range(60000, 60030):
            world, pose = scene(kind, seed)
            scan = sensor.scan(world, pose, np.random.default_rng(seed))
            parts.append(evaluate(extractor(scan), truth(world, pose, sensor)))
    scores = Scores.total(parts)
    corners, segments, arcs = scores.corners, scores.segments, scores.arcs
    assert corners.counts[0.10].f1 > 0.97
    assert segments.counts.f1 > 0.97
    assert segments.fragmentation < 0.02
    assert arcs.counts.f1 > 0.9
    assert corners.over_bound.over_bound_median < 1.2
    assert segments.offset_over_bound.over_bound_median < 1.1
    assert segments.angle_over_bound.over_bound_median < 1.1
    for consistency, off in (
        (corners.consistency, 0.15),
        (segments.consistency, 0.15),
        (arcs.consistency, 0.25),
    ):
        assert consistency.unusable == 0
        assert consistency.mean_ratio == pytest.approx(1.0, abs=off)
