"""Features against their scan: phantom walls, covered measurements, similarity; worked by hand."""

import math

import numpy as np
import pytest
from handmade import arc, features, segment
from lineament_lab.evaluation import (
    FreeSpaceScores,
    SimilarityScores,
    free_space_scores,
    similarity_errors,
    similarity_scores,
)

from lineament import LaserScan

#: Eleven beams, 0.1 rad apart. Samples between 1.5 steps and more have their beams on one side.
BEARINGS = 0.1 * np.arange(-5, 6)
NAN = math.nan


def walls(*depths):
    """Return a scan of walls at x = depth, one depth for each beam, or one for all."""
    return LaserScan(np.array(depths) / np.cos(BEARINGS), angle_min=-0.5, angle_increment=0.1)


def across(x, low, high):
    """Return features of a scan of eleven beams: one segment at x, from y = low to high."""
    return features(n=11, segments=[segment((x, low), (x, high), 0, 10)])


STEP = walls(*[1.0] * 6, *[3.0] * 5)
POST = walls(*[3.0] * 5, 1.0, *[3.0] * 5)


@pytest.mark.parametrize(
    ("scan", "found", "drawn", "phantom", "longest"),
    [
        # Walls at 1 m to the right, 3 m to the left, and a segment at 1 m: of 40 samples at
        # y = -0.39 … 0.39 those are phantom whose three beams are to the left: atan y > 0.15,
        # y > 0.1511, the twelve from 0.17 on.
        (STEP, across(1.0, -0.4, 0.4), 0.8, 0.24, 0.24),
        # At 3 m, of 120 at y = -1.19 … 1.19, where atan(y/3) < -0.05: y ≤ -0.17, 52.
        (STEP, across(3.0, -1.2, 1.2), 2.4, 1.04, 1.04),
        # Beside a post samples prove nothing, |atan y| < 0.15: of y = -0.39 … two times twelve.
        (POST, across(1.0, -0.4, 0.4), 0.8, 0.48, 0.24),
        (POST, across(1.0, -0.2, 0.4), 0.6, 0.28, 0.24),  # two left of it
        *((walls(*[3.0] * 5, no, *[3.0] * 5), across(1.0, -0.4, 0.4), 0.8, 0.48, 0.24)
          for no in (NAN, math.inf, 0.0)),
        (walls(3.0), across(1.0, -0.4, 0.4), 0.8, 0.8, 0.8),
        # Both at once: the longest stretch is that of the first.
        (STEP, features(n=11, segments=[segment((3, -1.2), (3, 1.2), 0, 10),
                                        segment((1, -0.4), (1, 0.4), 0, 10)]), 3.2, 1.28, 1.04),
        # The clearance, close to the x axis, where the cosine takes off less than 1 %.
        *((walls(x), across(1.0, -0.05, 0.05), 0.1, phantom, phantom)
          for x, phantom in ((1.19, 0.0), (1.21, 0.1), (0.81, 0.0), (0.79, 0.1))),
        # The view ends half a step behind the last beam: tan 0.55 = 0.613, 31 samples to 0.61.
        (walls(3.0), across(1.0, 0.0, 1.0), 1.0, 0.62, 0.62),
    ],
)  # fmt: skip
def test_phantom_walls(scan, found, drawn, phantom, longest):
    scores = free_space_scores(scan, found)
    assert (scores.drawn, scores.phantom) == pytest.approx((drawn, phantom))
    assert scores.longest == pytest.approx([longest])


@pytest.mark.parametrize("near", [35, 1])
def test_phantom_walls_over_the_seam_of_a_full_circle(near):
    """Beams every 10° from -180° on, one of those beside the seam is short.

    Samples at (-1, ±0.01 … ±0.19) are at most 10.8° from the seam. A neighbour of the short beam
    is that on the seam, the nearest within 5°: beyond, |y| > 0.0875 on the other side, six are
    phantom.
    """
    ranges = np.full(36, 3.0)
    ranges[near] = 1.0
    ring = LaserScan(ranges, angle_min=-math.pi, angle_increment=math.radians(10))
    found = features(n=36, segments=[segment((-1, 0.2), (-1, -0.2), 34, 2, n_points=5)])
    scores = free_space_scores(ring, found)
    assert (scores.drawn, scores.phantom, *scores.longest) == pytest.approx((0.4, 0.12, 0.12))


@pytest.mark.parametrize(
    ("ends", "covered"),
    [
        (((2.06, -1), (2.06, 1)), 1),  # 5 cm and 1 % of 2 m are 7 cm
        (((2.08, -1), (2.08, 1)), 0),
        (((2.0, 0.06), (2.0, 1)), 1),  # its end is near
        (((2.0, 0.08), (2.0, 1)), 0),
    ],
)
def test_covered_by_a_segment(ends, covered):
    scan = LaserScan([2.0, NAN, 5.0], angle_min=0.0, angle_increment=0.5)
    scores = free_space_scores(scan, features(n=3, segments=[segment(*ends, 0, 2)]))
    assert (scores.covered, scores.valid) == (covered, 2)


@pytest.mark.parametrize(
    ("step", "radius", "first", "last", "covered"),
    [
        *((0.01, 2.0, 4, 6, 5), (0.01, 2.06, 4, 6, 5), (0.01, 2.08, 4, 6, 0)),
        *((0.01, 2.0, 0, 1, 3), (0.01, 2.0, 7, 8, 3), (2 * math.pi / 9, 2.0, 8, 0, 4)),
    ],
)
def test_covered_by_an_arc_and_beside_its_beams(step, radius, first, last, covered):
    """All nine measurements are on the circle: those of its beams count, and one on either side.

    The first and the last beam are no neighbours but on a full circle.
    """
    scan = LaserScan([2.0] * 9, angle_min=0.0, angle_increment=step)
    scores = free_space_scores(scan, features(n=9, arcs=[arc(0, 0, radius, first, last)]))
    assert (scores.covered, scores.valid) == (covered, 9)


def test_free_space_scores_add_up():
    together = FreeSpaceScores(4.0, 1.0, np.array([0.4]), 3, 10)
    together += FreeSpaceScores(6.0, 0.0, np.array([0.3]), 5, 6)
    walls = {"phantom_in_100m": 10.0, "longest_phantom": 0.4, "phantom_scans": 0.5}
    assert together.summary() == walls | {"covered": 0.5}
    assert FreeSpaceScores().summary() == SimilarityScores().summary() == {}


def test_similarity_by_hand():
    # Beams along 0, 0.1, … rad; points on x = 2, off by 1 cm and 3 cm, then an arc, then nothing.
    bearings = 0.1 * np.arange(6)
    ranges = np.array([2.0, 2.01, 2.03, 1.0, 5.0, NAN]) / np.cos(bearings)
    ranges[3] = 1.0
    scan = LaserScan(ranges, angles=bearings)
    column = 1.25 * np.array([math.cos(0.3), math.sin(0.3)])
    found = features(6, segments=[segment((2, 0), (2, 1), 0, 2)], arcs=[arc(*column, 0.2, 3, 3)])
    expected = [0.0, 0.01, 0.03, 0.05, NAN, NAN]
    np.testing.assert_allclose(similarity_errors(scan, found), expected, atol=1e-12)
    scores = similarity_scores(scan, found)
    figures = {
        "similarity_explained": 4 / 5,
        "similarity_mean": 0.09 / 4,
        "similarity_rms": math.sqrt((0.0001 + 0.0009 + 0.0025) / 4),
        "similarity_p95": 0.03 + 0.85 * 0.02,
        "similarity_maximum": 0.05,
    }
    assert scores.summary() == pytest.approx(figures)
    assert (scores + scores).summary() == pytest.approx(figures | {"similarity_p95": 0.05})


def test_only_what_a_method_says_that_it_has_is_explained():
    """Of four beams on a wall it has three, the nearest: the 2 m behind it is what it calls noise.

    A beam that two lines explain counts for the nearer; that the nearer does not have, for the
    other; and one that returned nothing, though between them, is not explained.
    """
    scan = LaserScan(np.array([2.0, 4.0, 2.01, 2.02, 2.03, NAN, 2.0]), 0.0, 1e-6)
    wall = segment((2, -1), (2, 1), 0, 3, n_points=3)
    other = segment((2.1, -1), (2.1, 1), 3, 6, n_points=3)
    expected = [0.0, NAN, 0.01, 0.02, 0.07, NAN, 0.1]
    for rows in ([wall, other], [other, wall]):
        errors = similarity_errors(scan, features(7, segments=rows))
        np.testing.assert_allclose(errors, expected, atol=1e-9)
    column = arc(2, 0, 0.1, 0, 3, sigma=0.01)
    column["n_points"] = 2
    errors = similarity_errors(scan, features(7, arcs=[column]))
    np.testing.assert_allclose(errors, [NAN, NAN, 0.09, 0.08, *[NAN] * 3], atol=1e-9)


def test_nothing_found_in_no_scan():
    empty, blind = LaserScan([], 0.0, 0.1), LaserScan([NAN, 2.0], 0.0, 0.1)
    summary = free_space_scores(empty, features(n=0)).summary()
    assert summary == {"longest_phantom": 0.0, "phantom_scans": 0.0}
    assert similarity_scores(blind, features(2)).summary() == {"similarity_explained": 0.0}
    assert len(similarity_errors(empty, features(0))) == 0


@pytest.mark.parametrize("score", [free_space_scores, similarity_errors])
def test_features_of_another_scan_are_refused(score):
    with pytest.raises(ValueError, match="features are of 3 beams, expected the scan's 2"):
        score(LaserScan([1.0, 2.0], 0.0, 0.1), features(3))
