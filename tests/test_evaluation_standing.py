"""Scatter of the features of a sensor that stands: cases worked by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from handmade import corner, features, segment

from lineament.evaluation import StandingScores, standing_scores

#: The median of χ² with two degrees of freedom.
MEDIAN = 2 * math.log(2)


def wall(first, last):
    """Return a segment along x, with 1 cm and 10 mrad of deviation."""
    return segment((0, 0), (2, 0), first, last)


def segment_bins(*scans):
    return standing_scores(features(segments=rows) for rows in scans).segments.bins()


def corner_bins(*scans, counts=(30, 40)):
    sides = [wall(0, 29), wall(30, 69)]
    for side, count in zip(sides, counts, strict=True):
        side["n_points"] = count
    both = [features(segments=sides, corners=rows) for rows in scans]
    return standing_scores(both).corners.bins()


def at(x, y, sigma=0.01, kind="corner"):
    row = corner(x, y, segments=(0, 1), sigma=sigma)
    row["kind"] = kind
    return row


def test_difference_of_lines_with_its_lever_arm():
    """The second centroid is 1 m on, 3 cm off, and the second line is turned by 20 mrad.

    The angle of the first moves its line there by 1 m times its deviation: the covariances are
    [[2, 1], [1, 1]] + [[1, 0], [0, 1]] = [[3, 1], [1, 2]] cm², whose inverse is [[2, -1], [-1, 3]]
    / 5; of (3, 2) that makes (18 - 12 + 12)/5 = 3.6.
    """
    second = wall(0, 11)
    second["centroid"], second["angle"] = (2.0, 0.03), 0.02
    scores = standing_scores([features(segments=[wall(0, 9)]), features(segments=[second])])
    assert scores.segments.differences.squares == pytest.approx([3.6])
    figures = scores.segments.bins()["10-29"]
    assert figures["nees_median"] == pytest.approx(3.6 / MEDIAN)
    assert figures | {"nees_median": 0} == {
        "pairs": 1,
        "nees_median": 0,
        "in_95_ellipse": 1.0,
        "found_again": 1.0,
    }


@pytest.mark.parametrize(
    ("count", "name"),
    [
        *((3, "3-4"), (4, "3-4"), (5, "5-9"), (9, "5-9"), (10, "10-29"), (29, "10-29")),
        *((30, "30-99"), (99, "30-99"), (100, "100-")),
    ],
)
def test_bins_are_of_the_shorter_arm(count, name):
    few, many = wall(0, 49), wall(0, 49)
    few["n_points"], many["n_points"] = count, 200
    for scans in ([few], [many]), ([many], [few]):
        bins = segment_bins(*scans)
        assert {key: of["pairs"] for key, of in bins.items() if of["pairs"]} == {name: 1}


def test_each_scan_is_compared_with_the_next():
    """The second wall is there in two of three scans, and looked for in the third alone."""
    other = wall(50, 59)
    bins = segment_bins([wall(0, 9)], [wall(0, 9), other], [wall(0, 9)])["10-29"]
    assert (bins["pairs"], bins["found_again"], bins["nees_median"]) == (2, 2 / 3, 0.0)


@pytest.mark.parametrize(("shift", "pairs"), [(3, 1), (4, 0)])
def test_segments_share_half_of_their_beams(shift, pairs):
    """Of ten beams seven of thirteen are common, or six of fourteen."""
    bins = segment_bins([wall(0, 9)], [wall(shift, 9 + shift)])["10-29"]
    assert (bins["pairs"], bins["found_again"]) == (pairs, pairs)


def test_difference_of_corners():
    """2 cm, where both have 1 cm: 4/(1 + 1) = 2; at 4 cm it is 8, out of the ellipse, 5.99."""
    bins = corner_bins([at(1, 0)], [at(1.02, 0)])["30-99"]
    assert bins["nees_median"] == pytest.approx(2 / MEDIAN)
    assert (bins["pairs"], bins["in_95_ellipse"]) == (1, 1.0)
    assert corner_bins([at(1, 0)], [at(1.04, 0)])["30-99"]["in_95_ellipse"] == 0.0


@pytest.mark.parametrize(
    ("distance", "sigma", "again"),
    [(0.09, 0.01, 1), (0.11, 0.01, 0), (0.2, 0.03, 1), (0.22, 0.03, 0)],
)
def test_corners_are_found_within_the_gate_or_five_deviations(distance, sigma, again):
    """Five deviations of a difference are 5 √2 · 3 cm = 21.2 cm."""
    bins = corner_bins([at(1, 0, sigma)], [at(1 + distance, 0, sigma)])["30-99"]
    assert (bins["pairs"], bins["found_again"]) == (again, again)


def test_arm_of_a_corner_is_its_shorter_segment_in_either_scan():
    assert corner_bins([at(1, 0)], [at(1, 0)], counts=(8, 40))["5-9"]["pairs"] == 1
    assert corner_bins([at(1, 0)], [at(1, 0)], counts=(40, 3))["3-4"]["pairs"] == 1


def test_arm_is_the_shorter_one_of_both_scans():
    scans = []
    for count in (40, 7):
        sides = [wall(0, 29), wall(30, 69)]
        sides[1]["n_points"] = count
        scans.append(features(segments=sides, corners=[at(1, 0)]))
    for pair in (scans, scans[::-1]):
        bins = standing_scores(pair).corners.bins()
        assert {name: of["pairs"] for name, of in bins.items() if of["pairs"]} == {"5-9": 1}


def test_without_two_segments_a_corner_is_in_no_bin():
    lonely = at(1, 0)
    lonely["segments"] = (0, -1)
    assert not any(of["pairs"] for of in corner_bins([lonely], [at(1, 0)]).values())


def test_edges_are_left_out():
    bins = corner_bins([at(1, 0), at(0, 1, kind="edge")], [at(1, 0, kind="edge"), at(0, 1)])
    assert (bins["30-99"]["pairs"], bins["30-99"]["found_again"]) == (0, 0.0)


def test_without_a_covariance_it_is_found_again_but_not_compared():
    vague = at(1, 0, math.nan)
    bins = corner_bins([vague], [at(1, 0)])["30-99"]
    assert (bins["pairs"], bins["found_again"]) == (0, 1.0)


def test_nothing_to_compare():
    for scans in [], [features(segments=[wall(0, 9)])]:
        scores = standing_scores(scans)
        assert scores == StandingScores() or len(scores.segments.seen) == 0
        assert math.isnan(scores.segments.bins()["3-4"]["nees_median"])
    empty = standing_scores([features(), features()])
    assert [len(empty.segments.seen), len(empty.corners.seen)] == [0, 0]
    with pytest.raises(ValueError, match="two scans have 9 and 8 beams, expected the same number"):
        standing_scores([features(n=9), features(n=8)])


def test_scores_add_up():
    one = standing_scores([features(segments=[wall(0, 9)])] * 2)
    total = StandingScores.total([one, one])
    assert total.segments.bins()["10-29"]["pairs"] == 2
    assert np.array_equal(total.segments.arms, [10, 10])
