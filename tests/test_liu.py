"""Method liu: the paper's numbers; scenes by hand."""

import math

import numpy as np
import pytest
from liu_2023 import Paper, corner_response, polar
from worlds import NOISE, STEP, fan, scan_of, vertex

from lineament import Extractor, LaserScan
from lineament.methods import stages

# The responses at a true vertex: r = 6, Δφ = 1/3°.

TABLE = [
    (90, 1, 0.24, 0.05, 0.71),
    (90, 2, 0.47, 0.19, 0.71),
    (90, 4, 0.95, 0.76, 0.71),
    (90, 6, 1.43, 1.72, 0.71),
    (120, 4, 0.53, 0.25, 0.50),
]


@pytest.mark.parametrize(("opening", "distance", "tangent", "product", "relative"), TABLE)
def test_response_at_a_true_vertex(opening, distance, tangent, product, relative):
    angles = fan(10)
    points = polar(vertex(angles, distance, opening, convex=False), angles)
    at = len(points) // 2
    for kind, expected in (("tangent", tangent), ("product", product), ("relative", relative)):
        found = stages.corner_response(points, response=kind)
        assert found[at] == pytest.approx(expected, rel=0.05)
        assert found.argmax() == at
        assert found[at] == pytest.approx(
            corner_response(points, at, False, Paper(response=kind)), rel=1e-9
        )
    # By hand: the tangent lies across the bisector, so d/s is cos of half the opening.
    assert found[at] == pytest.approx(math.cos(math.radians(opening / 2)), rel=1e-3)


# Scenes by hand


@pytest.mark.parametrize("opening", [60, 90, 110])
@pytest.mark.parametrize("convex", [True, False])
def test_vertex_is_found_with_its_side_and_opening(opening, convex):
    angles = fan(25, STEP / 2)
    scan = scan_of(vertex(angles, 3.0, opening, convex=convex), angles)
    features = Extractor("liu:scale_free", noise=NOISE)(scan)
    (corner,) = features.corners
    np.testing.assert_allclose(corner["position"], (3.0, 0.0), atol=2e-3)
    assert corner["opening"] == pytest.approx(math.radians(opening), abs=0.01)
    assert corner["convex"] == convex
    assert abs(corner["beam"] - len(angles) // 2) <= 1
    assert corner["segments"].tolist() == [0, 1]
    first, second = features.segments
    assert first["end"].tolist() == second["start"].tolist() == corner["position"].tolist()
    assert first["last_beam"] == second["first_beam"] == corner["beam"]


def test_breakpoints_name_the_side_that_occludes():
    ranges = np.array([2.0] * 20 + [4.0] * 20 + [3.0] * 20)
    scan = LaserScan(ranges, 0.0, 0.01)
    features = Extractor("liu", noise=NOISE, sigma_d=0.5)(scan)
    first, second, start, end = features.breakpoints
    assert (first["beam"].tolist(), str(first["kind"]), first["occluder"]) == ([19, 20], "jump", 19)
    np.testing.assert_allclose(first["position"], scan.points[19], rtol=1e-12)
    assert (second["beam"].tolist(), second["occluder"]) == ([39, 40], 40)
    np.testing.assert_allclose(second["position"], scan.points[40], rtol=1e-12)
    assert (start["beam"].tolist(), start["occluder"]) == ([-1, 0], -1)
    assert (end["beam"].tolist(), end["kind"]) == ([59, -1], "scan_end")
    np.testing.assert_allclose(end["position"], scan.points[59], rtol=1e-12)
