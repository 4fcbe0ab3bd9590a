"""Phantom walls and covered measurements: cases worked by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from handmade import arc, features, segment

from lineament import LaserScan
from lineament.evaluation import FreeSpaceScores, free_space_scores

#: Eleven beams, 0.1 rad apart. Samples between 1.5 steps and more have their beams on one side.
BEARINGS = 0.1 * np.arange(-5, 6)


def walls(depths):
    """Return a scan of walls at x = depth, one depth for each beam."""
    return LaserScan(np.asarray(depths) / np.cos(BEARINGS), angle_min=-0.5, angle_increment=0.1)


def across(x, low, high):
    """Return features of a scan of eleven beams: one segment at x, from y = low to high."""
    return features(n=11, segments=[segment((x, low), (x, high), 0, 10)])


def scores_of(scan, found):
    scores = free_space_scores(scan, found)
    return tuple(round(float(v), 9) for v in (scores.drawn, scores.phantom, scores.longest[0]))


def test_beams_that_go_on():
    """The walls are at 1 m to the right, 3 m to the left; the segment is at 1 m all along.

    Of 40 samples at y = -0.39 … 0.39 those are phantom whose beam and both neighbours are to the
    left: atan y > 0.15, y > 0.1511, the twelve from 0.17 on.
    """
    scan = walls([1.0] * 6 + [3.0] * 5)
    assert scores_of(scan, across(1.0, -0.4, 0.4)) == (0.8, 0.24, 0.24)


def test_beams_that_end_before():
    """At 3 m, of 120 samples at y = -1.19 … 1.19, where atan(y/3) < -0.05: y ≤ -0.17, 52."""
    scan = walls([1.0] * 6 + [3.0] * 5)
    assert scores_of(scan, across(3.0, -1.2, 1.2)) == (2.4, 1.04, 1.04)


def test_longest_of_two_stretches():
    """A post before the middle beam: samples beside it prove nothing, |atan y| < 0.15."""
    scan = walls([3.0] * 5 + [1.0] + [3.0] * 5)
    assert scores_of(scan, across(1.0, -0.4, 0.4)) == (0.8, 0.48, 0.24)
    # Of y = -0.19 … 0.39 two are left of it, twelve right.
    assert scores_of(scan, across(1.0, -0.2, 0.4)) == (0.6, 0.28, 0.24)


@pytest.mark.parametrize("invalid", [np.nan, np.inf, 0.0])
def test_a_beam_without_a_range_proves_nothing_beside_it_either(invalid):
    assert scores_of(walls([3.0] * 11), across(1.0, -0.4, 0.4)) == (0.8, 0.8, 0.8)
    scan = walls([3.0] * 5 + [invalid] + [3.0] * 5)
    assert scores_of(scan, across(1.0, -0.4, 0.4)) == (0.8, 0.48, 0.24)


@pytest.mark.parametrize(("depth", "phantom"), [(1.19, 0.0), (1.21, 0.1), (0.81, 0.0), (0.79, 0.1)])
def test_clearance(depth, phantom):
    """Close to the x axis, where the cosine takes off less than 1 %."""
    assert scores_of(walls([depth] * 11), across(1.0, -0.05, 0.05))[1] == phantom


def test_out_of_view_nothing_is_phantom():
    """The view ends half a step behind the last beam: tan 0.55 = 0.613, 31 samples to 0.61."""
    assert scores_of(walls([3.0] * 11), across(1.0, 0.0, 1.0)) == (1.0, 0.62, 0.62)


@pytest.mark.parametrize("near", [35, 1])
def test_over_the_seam_of_a_full_circle(near):
    """Beams every 10° from -180° on, one of those beside the seam is short.

    Samples at (-1, ±0.01 … ±0.19) are at most 10.8° from the seam. A neighbour of the short beam
    is that on the seam, the nearest within 5°: beyond, |y| > 0.0875 on the other side, six are
    phantom.
    """
    ranges = np.full(36, 3.0)
    ranges[near] = 1.0
    ring = LaserScan(ranges, angle_min=-math.pi, angle_increment=math.radians(10))
    found = features(n=36, segments=[segment((-1, 0.2), (-1, -0.2), 34, 2, n_points=5)])
    assert scores_of(ring, found) == (0.4, 0.12, 0.12)


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
    scan = LaserScan([2.0, np.nan, 5.0], angle_min=0.0, angle_increment=0.5)
    scores = free_space_scores(scan, features(n=3, segments=[segment(*ends, 0, 2)]))
    assert (scores.covered, scores.valid) == (covered, 2)


@pytest.mark.parametrize(
    ("radius", "first", "last", "covered"),
    [(2.0, 4, 6, 5), (2.06, 4, 6, 5), (2.08, 4, 6, 0), (2.0, 0, 1, 3), (2.0, 7, 8, 3)],
)
def test_covered_by_an_arc_and_beside_its_beams(radius, first, last, covered):
    """All nine measurements are on the circle: those of its beams count, and one on either side.

    The first and the last beam are no neighbours here.
    """
    scan = LaserScan([2.0] * 9, angle_min=0.0, angle_increment=0.01)
    scores = free_space_scores(scan, features(n=9, arcs=[arc(0, 0, radius, first, last)]))
    assert (scores.covered, scores.valid) == (covered, 9)


def test_scores_of_scans_add_up():
    together = FreeSpaceScores(4.0, 1.0, np.array([0.4]), 3, 10)
    together += FreeSpaceScores(6.0, 0.0, np.array([0.3]), 5, 6)
    assert together.summary() == {
        "phantom_in_100m": 10.0,
        "longest_phantom": 0.4,
        "phantom_scans": 0.5,
        "covered": 0.5,
    }
    assert FreeSpaceScores().summary() == {}


def test_nothing_found_in_no_scan():
    empty = LaserScan([], angle_min=0.0, angle_increment=0.1)
    scores = free_space_scores(empty, features(n=0))
    assert scores.summary() == {"longest_phantom": 0.0, "phantom_scans": 0.0}
    with pytest.raises(ValueError, match="features are of 9 beams, expected the scan's 0"):
        free_space_scores(empty, features(n=9))
