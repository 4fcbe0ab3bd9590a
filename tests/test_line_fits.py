"""Line fits of the table of NEES: by hand, against each other, and by their own covariances."""

import math

import numpy as np
import pytest
from lineament_lab.evaluation.line_fits import (
    FITS,
    algebraic_fit,
    conformal_fit,
    fit_walls,
    meeting,
)
from lineament_lab.reproduce import Setting
from lineament_lab.reproduce.fits import measure
from lineament_lab.reproduce.scans import scene_numbers, simulated_frames

from lineament import RangeNoise
from lineament.simulation import SENSORS

NOISE = RangeNoise(sigma=0.01)


def wall(distance, normal, start, stop, rng=None, sigma=0.01):
    """Points of a wall by its normal, as beams each degree see it."""
    bearings = np.radians(np.arange(start, stop))
    ranges = distance / np.cos(bearings - normal)
    if rng is not None:
        ranges = ranges + rng.normal(0.0, sigma, len(bearings))
    return ranges[:, np.newaxis] * np.column_stack((np.cos(bearings), np.sin(bearings)))


@pytest.mark.parametrize("name", FITS)
@pytest.mark.parametrize("normal", [0.0, 0.7, math.pi / 2, 3.0, -2.0])
def test_a_wall_without_noise(name, normal):
    degrees = math.degrees(normal)
    line = FITS[name](wall(2.0, normal, degrees - 30, degrees + 40), NOISE)
    direction = math.remainder(line.angle - (normal + math.pi / 2), 2 * math.pi)
    assert direction == pytest.approx(0.0, abs=1e-9)
    assert line.point @ (math.cos(normal), math.sin(normal)) == pytest.approx(2.0, abs=1e-9)
    assert (np.linalg.eigvalsh(line.covariance) >= -1e-18).all()


def test_only_the_algebraic_fit_depends_on_the_unit():
    points = wall(3.0, 0.4, -20, 60, np.random.default_rng(3), 0.05)
    turned = []
    for fit in (conformal_fit, algebraic_fit):
        metres, millimetres = (fit(k * points, RangeNoise(sigma=0.05 * k)) for k in (1.0, 1e3))
        turned.append(abs(millimetres.angle - metres.angle))
    assert turned[0] < 1e-12 < 1e-6 < turned[1]


@pytest.mark.parametrize("name", FITS)
def test_a_covariance_is_that_of_the_errors_where_all_beams_meet_the_wall_upright(name):
    """From 20 m a wall is seen at right angles: range and distance are one, and all are right."""
    rng, errors, claimed = np.random.default_rng(5), [], []
    for _ in range(400):
        bearings = np.radians(np.linspace(-3, 3, 61))
        ranges = 20.0 / np.cos(bearings) + rng.normal(0.0, 0.01, 61)
        line = FITS[name](
            ranges[:, np.newaxis] * np.column_stack((np.cos(bearings), np.sin(bearings))), NOISE
        )
        errors.append([20.0 - line.point[0], line.angle - math.pi / 2])
        claimed.append(line.covariance)
    squares = [e @ np.linalg.solve(c, e) / 2 for e, c in zip(errors, claimed, strict=True)]
    assert np.mean(squares) == pytest.approx(1.0, abs=0.12)


def test_the_meeting_of_two_walls_at_right_angles():
    before = FITS["lineament"](wall(2.0, -math.pi / 4, -80, 0), NOISE)
    after = FITS["lineament"](wall(2.0, math.pi / 4, 1, 81), NOISE)
    place, covariance = meeting(before, after)
    np.testing.assert_allclose(place, (2 * math.sqrt(2), 0.0), atol=1e-9)
    # Alike by symmetry, x and y are independent.
    assert covariance[0, 1] == pytest.approx(0.0, abs=1e-3 * covariance[0, 0])


def test_fitted_walls_are_numbered_anew():
    frames = simulated_frames(SENSORS["paper"], ["room", "hall"], scene_numbers(6, 7))
    for frame in frames:
        found = fit_walls(frame.scan, frame.truth, FITS["lineament"])
        assert len(found.segments) <= len(frame.truth.segments)
        for corner in found.corners:
            for k in corner["segments"].tolist():
                line = found.segments[k]
                normal = (-math.sin(line["angle"]), math.cos(line["angle"]))
                assert (corner["position"] - line["centroid"]) @ normal == pytest.approx(
                    0, abs=1e-9
                )


def test_weights_without_incidence_claim_too_much_and_ours_are_right():
    """The claim of the table: NEES of WCTLS is far below 1, that of lineament at 1."""
    numbers = measure(Setting(4, 3), str).numbers
    for of in numbers.values():
        assert 0.4 < of["WCTLS"]["segment_nees"] < 0.8
        assert 0.8 < of["lineament"]["segment_nees"] < 1.25
        assert of["lineament"]["segment_offset_over_bound"] < 1.2
