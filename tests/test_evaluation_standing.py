"""Scatter of the features of a sensor that stands: cases worked by hand."""

import math

import numpy as np
import pytest
from handmade import corner, features, segment
from lineament_lab.evaluation import standing_scores

#: The median of χ² with two degrees of freedom.
MEDIAN = 2 * math.log(2)


def wall(first, last, n_points=None):
    """Return a segment along x, with 1 cm and 10 mrad of deviation."""
    return segment((0, 0), (2, 0), first, last, n_points=n_points)


def segment_bins(*scans):
    return standing_scores(features(segments=rows) for rows in scans).segments.bins()


def corner_bins(*scans, arms=((30, 40), (30, 40))):
    """Return the bins of corners between two walls of so many measurements, in either scan."""
    sides = [[wall(0, 29, one), wall(30, 69, other)] for one, other in arms]
    both = [features(segments=s, corners=c) for s, c in zip(sides, scans, strict=True)]
    return standing_scores(both).corners.bins()


def at(x, y=0, sigma=0.01, kind="corner", segments=(0, 1)):
    return corner(x, y, segments=segments, sigma=sigma, kind=kind)


def pairs(bins):
    return {name: figures["pairs"] for name, figures in bins.items() if figures["pairs"]}


def test_difference_of_lines_with_its_lever_arm():
    """The second centroid is 1 m on, 3 cm off, and the second line is turned by 20 mrad.

    The angle of the first moves its line there by 1 m times its deviation: the covariances are
    [[2, 1], [1, 1]] + [[1, 0], [0, 1]] = [[3, 1], [1, 2]] cm², whose inverse is [[2, -1], [-1, 3]]
    / 5; of (3, 2) that makes (18 - 12 + 12)/5 = 3.6. All of it may be turned.
    """
    second = wall(0, 11)
    second["centroid"], second["angle"] = (2.0, 0.03), 0.02
    scans = [features(segments=[row]) for row in (wall(0, 9), second)]
    for turn in (0.0, 2.0):
        scores = standing_scores(scan.transform(0, 0, turn) for scan in scans)
        assert scores.segments.differences.squares == pytest.approx([3.6])
    assert scores.segments.bins()["10-29"] == pytest.approx(
        {"pairs": 1, "nees_median": 3.6 / MEDIAN, "in_95_ellipse": 1.0, "found_again": 1.0}
    )


@pytest.mark.parametrize(
    ("count", "name"),
    [
        *((3, "3-4"), (4, "3-4"), (5, "5-9"), (9, "5-9"), (10, "10-29"), (29, "10-29")),
        *((30, "30-99"), (99, "30-99"), (100, "100-")),
    ],
)
def test_bins_are_of_the_shorter_arm_in_either_scan(count, name):
    few, many = wall(0, 49, count), wall(0, 49, 200)
    for scans in ([few], [many]), ([many], [few]):
        assert pairs(segment_bins(*scans)) == {name: 1}
    for first in ((count, 200), (200, count)):
        for arms in ((first, (200, 200)), ((200, 200), first)):
            assert pairs(corner_bins([at(1)], [at(1)], arms=arms)) == {name: 1}


def test_what_is_looked_for_is_in_the_bin_of_the_first_scan():
    bins = segment_bins([wall(0, 8), wall(20, 27), wall(40, 45)], [wall(0, 8)])
    assert bins["5-9"]["found_again"] == pytest.approx(1 / 3)
    assert math.isnan(bins["3-4"]["found_again"])


@pytest.mark.parametrize(("shift", "found"), [(3, 1), (4, 0)])
def test_segments_share_half_of_their_beams(shift, found):
    """Of ten beams seven of thirteen are common, or six of fourteen."""
    bins = segment_bins([wall(0, 9)], [wall(shift, 9 + shift)])["10-29"]
    assert (bins["pairs"], bins["found_again"]) == (found, found)


@pytest.mark.parametrize(("distance", "share"), [(0.024, 1.0), (0.025, 0.0)])
def test_difference_of_corners(distance, share):
    """Both have 1 cm: of (d, d) the square is 2 d²/(1 + 1), 5.76 and 6.25 beside 5.99."""
    bins = corner_bins([at(1)], [at(1 + distance, distance)])["30-99"]
    assert bins["nees_median"] == pytest.approx((distance / 0.01) ** 2 / MEDIAN)
    assert (bins["pairs"], bins["in_95_ellipse"]) == (1, share)


@pytest.mark.parametrize(
    ("distance", "sigma", "again"),
    [(0.09, 0.01, 1), (0.11, 0.01, 0), (0.2, 0.03, 1), (0.22, 0.03, 0)],
)
def test_corners_are_found_within_the_gate_or_five_deviations(distance, sigma, again):
    """Five deviations of a difference are 5 √2 · 3 cm = 21.2 cm."""
    bins = corner_bins([at(1, 0, sigma)], [at(1 + distance, 0, sigma)])["30-99"]
    assert (bins["pairs"], bins["found_again"]) == (again, again)


@pytest.mark.parametrize(
    ("first", "second", "found", "again"),
    [
        ([at(1, segments=(0, -1))], [at(1)], {}, math.nan),  # without two segments in no bin
        ([at(1)], [at(0, 1)], {}, 0.0),
        ([at(1, sigma=math.nan)], [at(1)], {}, 1.0),  # found again, but not compared
        ([at(1, kind="slit")], [at(1)], {"30-99": 1}, 1.0),
    ],
)
def test_which_corners_are_compared(first, second, found, again):
    bins = corner_bins(first, second)
    assert pairs(bins) == found
    np.testing.assert_equal(bins["30-99"]["found_again"], again)


def test_nothing_to_compare():
    for scans in [], [features(segments=[wall(0, 9)])], [features(), features()]:
        scores = standing_scores(scans)
        assert [len(scores.segments.seen), len(scores.corners.seen)] == [0, 0]
        assert math.isnan(scores.segments.bins()["3-4"]["nees_median"])
    with pytest.raises(ValueError, match="two scans have 9 and 8 beams, expected the same number"):
        standing_scores([features(n=9), features(n=8)])
