"""Bounds: by hand, against limits that are known, and reached by maximum likelihood."""

import math

import numpy as np
import pytest

from lineament import RangeNoise
from lineament.bounds import (
    _LEAST_SIGMA,
    LineBound,
    arc_bound,
    corner_bound,
    line_bound,
    wall_end_bound,
)

NOISE = RangeNoise(sigma=0.01)
STEP = math.radians(1 / 3)
RUNS = 4000
#: Statistics are held to this many standard deviations of their own.
SIGMAS = 4.5


# Estimators


def line_ranges(parameters, bearings, point):
    """Ranges of lines (offset at `point` along the left normal, angle)."""
    offset, angle = np.moveaxis(parameters[..., np.newaxis], -2, 0)
    distance = np.cos(angle) * point[1] - np.sin(angle) * point[0] + offset
    return distance / np.sin(bearings - angle)


def circle_ranges(parameters, bearings, side):
    """Ranges of circles (x, y, radius); `side` is -1 for the near side."""
    x, y, radius = np.moveaxis(parameters[..., np.newaxis], -2, 0)
    c, s = np.cos(bearings), np.sin(bearings)
    return c * x + s * y + side * np.sqrt(np.maximum(radius**2 - (c * y - s * x) ** 2, 1e-9))


def readings(model, truth, bearings, noise, rng):
    """Simulate RUNS scans of a surface."""
    shape = (RUNS, len(bearings))
    ranges = model(truth, bearings + noise.bearing * rng.normal(size=shape))
    ranges += np.hypot(noise.sigma, noise.proportional * ranges) * rng.normal(size=shape)
    return np.round(ranges / noise.quantum) * noise.quantum if noise.quantum else ranges


def slopes(model, at, bearings):
    """Derivatives of ranges by the parameters, shape (..., n, k), by differences."""
    steps = 1e-6 * np.eye(at.shape[-1])
    columns = [(model(at + d, bearings) - model(at - d, bearings)) / 2e-6 for d in steps]
    return np.stack(columns, axis=-1)


def maximum_likelihood(model, truth, bearings, noise, ranges):
    """Fit each scan by Gauss-Newton, from the truth."""
    clean = model(truth, bearings)
    per_bearing = (model(truth, bearings + 1e-6) - model(truth, bearings - 1e-6)) / 2e-6
    weight = 1 / (noise.range_variance(clean) + (per_bearing * noise.bearing) ** 2)
    estimate = np.tile(truth, (len(ranges), 1))
    for _ in range(4):
        jacobian = slopes(model, estimate, bearings)
        weighted = np.swapaxes(jacobian, 1, 2) * weight
        residual = ranges - model(estimate, bearings)
        step = np.linalg.solve(weighted @ jacobian, weighted @ residual[..., np.newaxis])
        estimate = estimate + step[..., 0]
    return estimate - truth


def assert_reached(errors, bound):
    """Check that errors have the covariance `bound`: each variance, and all together."""
    ratios = errors.var(axis=0) / np.diag(bound)
    np.testing.assert_allclose(ratios, 1, atol=SIGMAS * math.sqrt(2 / len(errors)))
    squares = np.einsum("ri,ij,rj->r", errors, np.linalg.inv(bound), errors)
    k = len(bound)
    assert squares.mean() == pytest.approx(k, abs=SIGMAS * math.sqrt(2 * k / len(errors)))


def fitted_line(bearings, point, angle, noise, seed=0):
    """Bound of a line and the errors of its estimates at its centroid."""
    bound = line_bound(bearings, point, angle, noise)

    def model(parameters, beams):
        return line_ranges(parameters, beams, bound.centroid)

    truth = np.array([0.0, angle])
    scans = readings(model, truth, bearings, noise, np.random.default_rng(seed))
    return bound, maximum_likelihood(model, truth, bearings, noise, scans)


NOISES = {
    "constant": NOISE,
    "proportional": RangeNoise(sigma=0.002, proportional=0.007),
    "bearing": RangeNoise(sigma=0.01, bearing=0.002),
    "lattice": RangeNoise(sigma=0.008, quantum=0.01),
}
LINES = {
    "frontal": (STEP * np.arange(-45, 46), (2.0, 0.0), math.pi / 2),
    "oblique": (STEP * np.arange(30, 100), (3.0, 1.5), 2.2),
    "grazing": (math.radians(88) - 3 * STEP * np.arange(14), (0.25, 2.0), math.radians(91)),
    "three beams": (np.array([0.1, 0.13, 0.16]), (3.0, 0.0), 1.8),
}


@pytest.mark.parametrize("line", LINES.values(), ids=LINES)
@pytest.mark.parametrize("noise", NOISES.values(), ids=NOISES)
def test_maximum_likelihood_reaches_the_bound_of_a_line(line, noise):
    bound, errors = fitted_line(*line, noise)
    assert_reached(errors, bound.covariance)


@pytest.mark.parametrize("noise", NOISES.values(), ids=NOISES)
def test_the_bound_elsewhere_on_the_line(noise):
    bound, errors = fitted_line(*LINES["oblique"], noise, seed=1)
    u = np.array([math.cos(bound.angle), math.sin(bound.angle)])
    for along in (-0.7, 1.3):
        # The line at angle α through the centroid + offset, met by the normal of the true one.
        moved = errors.copy()
        moved[:, 0] = errors[:, 0] / np.cos(errors[:, 1]) + along * np.tan(errors[:, 1])
        assert_reached(moved, bound.at(bound.centroid + along * u))


@pytest.mark.parametrize("opening", [60, 90, 150])
def test_maximum_likelihood_reaches_the_bound_of_a_corner(opening):
    vertex, half = np.array([2.0, 0.5]), math.radians(opening / 2)
    sight = math.atan2(vertex[1], vertex[0])
    beams = STEP * np.arange(1, 80)
    sides = [
        fitted_line(sight - beams[: 40 if opening < 90 else 80], vertex, sight - half, NOISE, 2),
        fitted_line(sight + beams[:30], vertex, sight + half, NOISE, 3),
    ]
    # Intersections of the estimated lines: offset(t) + t angle error, at the vertex.
    normals, offsets = [], []
    for bound, errors in sides:
        angle = bound.angle + errors[:, 1]
        normal = np.column_stack((-np.sin(angle), np.cos(angle)))
        normals.append(normal)
        offsets.append(normal @ bound.centroid + errors[:, 0])
    corners = np.linalg.solve(np.stack(normals, axis=1), np.stack(offsets, axis=1)[..., None])
    assert_reached(corners[..., 0] - vertex, corner_bound(sides[0][0], sides[1][0]))


ARCS = {
    "column": (STEP * np.arange(-15, 16), (2.0, 0.0), 0.3, -1),
    "part of a column": (STEP * np.arange(-20, 6), (1.2, 0.1), 0.25, -1),
    "round room": (math.radians(10) * np.arange(36), (0.6, -0.3), 2.5, 1),
    "apse": (STEP * np.arange(-90, 91), (1.0, 0.4), 2.0, 1),
}


@pytest.mark.parametrize("arc", ARCS.values(), ids=ARCS)
@pytest.mark.parametrize("noise", NOISES.values(), ids=NOISES)
def test_maximum_likelihood_reaches_the_bound_of_an_arc(arc, noise):
    bearings, center, radius, side = arc
    # Small enough for the circle to be as good as flat within the noise.
    noise = RangeNoise(*(0.2 * np.array([noise.sigma, noise.proportional, noise.bearing,
                                         noise.quantum])).tolist())  # fmt: skip

    def model(parameters, beams):
        return circle_ranges(parameters, beams, side)

    truth = np.array([*center, radius])
    scans = readings(model, truth, bearings, noise, np.random.default_rng(4))
    errors = maximum_likelihood(model, truth, bearings, noise, scans)
    assert_reached(errors, arc_bound(bearings, center, radius, noise))


def test_the_figures_of_the_literature():
    # 10 mm, 90°, arms of 1 m, Δφ = 0.33°: 2.55 mm at 2 m, 3.57 mm at 4 m.
    for distance, expected in ((2.0, 2.55e-3), (4.0, 3.57e-3)):
        arm = math.sqrt(0.5)
        reach = math.atan2(arm, distance - arm)
        beams = math.radians(0.33) * (0.5 + np.arange(reach // math.radians(0.33)))
        before = line_bound(-beams, (distance, 0), math.radians(45), NOISE)
        after = line_bound(beams, (distance, 0), math.radians(135), NOISE)
        rms = math.sqrt(np.trace(corner_bound(before, after)))
        assert rms == pytest.approx(expected, rel=0.03)  # it depends on the phase of the beams


def test_line_by_hand():
    # Three frontal readings at -1, 0 and 1 m of a wall at 1 m; cos² ψ = ½, 1, ½.
    bound = line_bound([-math.pi / 4, 0, math.pi / 4], (1, 7), math.pi / 2, NOISE)
    np.testing.assert_allclose(bound.centroid, (1, 0), atol=1e-15)
    # b = ½, 1, ½ of 1e-4: W = 5e4, S = 2 * 2e4.
    np.testing.assert_allclose(bound.covariance, np.diag([1 / 5e4, 1 / 4e4]), rtol=1e-12)
    np.testing.assert_allclose(bound.at((1, 2))[0, 0], 1 / 5e4 + 4 / 4e4, rtol=1e-12)
    # With an error of bearing ρ² σ_φ² sin² ψ = 2 σ_φ² ½ is added to the outer ones.
    noise = RangeNoise(sigma=0.01, bearing=0.01)
    bound = line_bound([-math.pi / 4, 0, math.pi / 4], (1, 7), math.pi / 2, noise)
    b = np.array([1.5e-4, 1e-4, 1.5e-4])
    expected = np.diag([1 / (1 / b).sum(), 1 / (1 / b[[0, 2]]).sum()])
    np.testing.assert_allclose(bound.covariance, expected, rtol=1e-12)


@pytest.mark.parametrize("turn", [0.7, 2.0, -3.0])
def test_bounds_turn_with_the_scanner(turn):
    c, s = math.cos(turn), math.sin(turn)
    rotation = np.array([[c, -s], [s, c]])
    noise = RangeNoise(sigma=0.01, bearing=0.001)
    beams = STEP * np.arange(20, 60)
    point, other = np.array([2.0, 1.0]), np.array([0.3, 2.5])
    lines = [line_bound(beams, point, 2.0, noise), line_bound(beams + 0.9, other, 3.0, noise)]
    turned = [
        line_bound(beams + turn, rotation @ point, 2.0 + turn, noise),
        line_bound(beams + 0.9 + turn, rotation @ other, 3.0 + turn, noise),
    ]
    for line, moved in zip(lines, turned, strict=True):
        np.testing.assert_allclose(moved.centroid, rotation @ line.centroid, rtol=1e-9)
        np.testing.assert_allclose(moved.covariance, line.covariance, rtol=1e-9, atol=1e-18)
    np.testing.assert_allclose(
        corner_bound(*turned), rotation @ corner_bound(*lines) @ rotation.T, rtol=1e-9
    )
    arc = arc_bound(beams, (2.4, 0.56), 0.6, noise)
    turned_arc = arc_bound(beams + turn, rotation @ (2.4, 0.56), 0.6, noise)
    larger = np.eye(3)
    larger[:2, :2] = rotation
    np.testing.assert_allclose(turned_arc, larger @ arc @ larger.T, rtol=1e-6)


def test_the_direction_of_a_line_does_not_matter():
    beams, point, angle = LINES["oblique"]
    one, other = line_bound(beams, point, angle, NOISE), line_bound(
        beams, point, angle + math.pi, NOISE
    )  # fmt: skip
    np.testing.assert_allclose(one.centroid, other.centroid)
    np.testing.assert_allclose(one.covariance, other.covariance, rtol=1e-9, atol=1e-20)


def test_the_end_of_a_wall_is_uniform_over_a_spacing():
    # Beams of a random phase on a wall at 60° incidence that ends at (2, 1).
    rng = np.random.default_rng(5)
    end = np.array([2.0, 1.0])
    angle = math.atan2(1, 2) + math.radians(30)
    increment = 0.002
    last = math.atan2(1, 2) - increment * rng.random(20_000)
    middle = last + increment / 2
    u = np.array([math.cos(angle), math.sin(angle)])
    distance = u[0] * end[1] - u[1] * end[0]
    errors = distance / np.tan(middle - angle) - end @ u
    assert np.mean(errors**2) == pytest.approx(wall_end_bound(end, angle, increment), rel=0.02)


def test_noiseless_ranges_have_the_least_noise_of_the_methods():
    from lineament.kernels.noise import LEAST_SIGMA

    assert _LEAST_SIGMA == LEAST_SIGMA
    line = LINES["oblique"]
    floor = line_bound(*line, RangeNoise(LEAST_SIGMA)).covariance
    np.testing.assert_array_equal(line_bound(*line, RangeNoise()).covariance, floor)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: line_bound([0.1], (2, 0), 1.5, NOISE), r"shape \(1,\), expected 2"),
        (lambda: line_bound([[0.1, 0.2]], (2, 0), 1.5, NOISE), r"shape \(1, 2\), expected 2"),
        (lambda: line_bound([0.1, 0.1], (2, 0), 1.5, NOISE), "all the same"),
        (lambda: line_bound([0.1, 3.0], (2, 0), 1.5, NOISE), r"bearings\[1\] is 3 rad, .* line"),
        (lambda: line_bound([0.0, 0.1], (2, 0), 0.0, NOISE), "does not meet the line"),
        (lambda: arc_bound([0, 0.1], (2, 0), 0.5, NOISE), r"shape \(2,\), expected 3"),
        (lambda: arc_bound([0, 0.1, 0.1], (2, 0), 0.5, NOISE), "fewer than three"),
        (lambda: arc_bound([0, 0.1, 0.3], (2, 0), 0.5, NOISE), r"bearings\[2\] is 0.3 rad"),
        (lambda: arc_bound([0, 0.1, 3.1], (2, 0), 0.5, NOISE), r"bearings\[2\] is 3.1 rad"),
        (lambda: wall_end_bound((2, 0), 0.0, 0.01), "points at the scanner"),
        (
            lambda: corner_bound(*[LineBound(np.zeros(2), 0.5, np.eye(2))] * 2),
            "are parallel: no corner",
        ),
    ],
)
def test_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
