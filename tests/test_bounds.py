"""Bounds: the inverse of the Fisher information by differences, limits that are known, by hand."""

import math

import numpy as np
import pytest

from lineament import RangeNoise
from lineament.bounds import LineBound, arc_bound, corner_bound, line_bound, wall_end_bound

NOISE = RangeNoise(sigma=0.01)
STEP = math.radians(1 / 3)


def line_ranges(line, bearings, point):
    """Ranges of the line (offset at `point` along the left normal, angle)."""
    offset, angle = line
    distance = math.cos(angle) * point[1] - math.sin(angle) * point[0] + offset
    return distance / np.sin(bearings - angle)


def corner_ranges(corner, bearings):
    """Ranges of the corner (x, y, angle before, angle after), of beams on either side."""
    sides = (bearings[bearings < 0], bearings[bearings > 0])
    ranges = [
        line_ranges((0.0, angle), side + math.atan2(0.5, 2.0), corner[:2])
        for angle, side in zip(corner[2:], sides, strict=True)
    ]
    return np.concatenate(ranges)


def circle_ranges(circle, bearings, side):
    """Ranges of the circle (x, y, radius); `side` is -1 for the near side."""
    x, y, radius = circle
    c, s = np.cos(bearings), np.sin(bearings)
    return c * x + s * y + side * np.sqrt(radius**2 - (c * y - s * x) ** 2)


def least_covariance(model, parameters, bearings, noise):
    """Inverse of the Fisher information of ranges, whose bearings have an error too."""

    def slope(f):
        return (f(1e-6) - f(-1e-6)) / 2e-6

    at = np.asarray(parameters, float)
    steps = np.eye(len(at))
    jacobian = np.column_stack([slope(lambda h, d=d: model(at + h * d, bearings)) for d in steps])
    by_bearing = slope(lambda h: model(at, bearings + h))
    variance = noise.range_variance(model(at, bearings)) + (by_bearing * noise.bearing) ** 2
    return np.linalg.inv(jacobian.T @ (jacobian / variance[:, np.newaxis]))


def assert_same(found, expected):
    """Equal, but for what differences leave, in deviations of the parameters."""
    deviations = np.sqrt(np.diag(expected))
    unit = np.outer(deviations, deviations)
    np.testing.assert_allclose(found / unit, expected / unit, atol=1e-5)


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
@pytest.mark.parametrize("along", [-0.7, 0.0, 1.3])
def test_line(line, noise, along):
    """At its centroid, where offset and angle are independent, and elsewhere."""
    bearings, _, angle = line
    bound = line_bound(*line, noise)
    point = bound.centroid + along * np.array([math.cos(angle), math.sin(angle)])
    expected = least_covariance(
        lambda line, beams: line_ranges(line, beams, point), (0.0, angle), bearings, noise
    )
    assert_same(bound.at(point), expected)
    if along == 0.0:
        assert_same(bound.covariance, expected)
        assert bound.covariance[0, 1] == 0.0


@pytest.mark.parametrize("opening", [60, 90, 150])
def test_corner(opening):
    vertex, half, sight = np.array([2.0, 0.5]), math.radians(opening / 2), math.atan2(0.5, 2.0)
    beams = STEP * np.r_[-np.arange(1, 40 if opening < 90 else 80), np.arange(1, 30)]
    angles = sight - half, sight + half
    sides = [
        line_bound(sight + beams[side], vertex, angle, NOISE)
        for side, angle in zip((beams < 0, beams > 0), angles, strict=True)
    ]
    expected = least_covariance(corner_ranges, (*vertex, *angles), beams, NOISE)
    assert_same(corner_bound(*sides), expected[:2, :2])


ARCS = {
    "column": (STEP * np.arange(-15, 16), (2.0, 0.0), 0.3, -1),
    "part of a column": (STEP * np.arange(-20, 6), (1.2, 0.1), 0.25, -1),
    "round room": (math.radians(10) * np.arange(36), (0.6, -0.3), 2.5, 1),
    "apse": (STEP * np.arange(-90, 91), (1.0, 0.4), 2.0, 1),
}


@pytest.mark.parametrize("arc", ARCS.values(), ids=ARCS)
@pytest.mark.parametrize("noise", NOISES.values(), ids=NOISES)
def test_arc(arc, noise):
    bearings, center, radius, side = arc
    circle = (*center, radius)
    expected = least_covariance(lambda c, b: circle_ranges(c, b, side), circle, bearings, noise)
    assert_same(arc_bound(bearings, center, radius, noise), expected)


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


def test_the_direction_of_a_line_does_not_matter():
    beams, point, angle = LINES["oblique"]
    one, other = (line_bound(beams, point, a, NOISE) for a in (angle, angle + math.pi))
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
    from lineament.bounds import _LEAST_SIGMA
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
        (lambda: arc_bound([0, 0.1, 0.2], (2, 0), -0.5, NOISE), "radius is -0.5, expected"),
        (lambda: wall_end_bound((2, 0), 0.0, 0.01), "points at the scanner"),
        (lambda: corner_bound(*[LineBound(np.zeros(2), 0.5, np.eye(2))] * 2), "are parallel: no"),
    ],
)
def test_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
