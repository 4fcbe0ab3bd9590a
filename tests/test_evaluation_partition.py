"""Partition and similarity error: cases by hand and slow twins."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from handmade import arc, breakpoint_at, features, segment

import lineament as ln
from lineament.evaluation import (
    Counts,
    PartitionScores,
    SimilarityScores,
    partition_scores,
    similarity_errors,
    similarity_scores,
)


def labels(*sizes):
    """Number clusters of so many beams; a negative size stands for beams of none."""
    numbers = itertools.count()
    runs = [np.full(abs(size), next(numbers) if size > 0 else -1) for size in sizes]
    return np.concatenate(runs) if runs else np.empty(0)


def regions(found, truth):
    n = len(truth)
    return partition_scores(features(n, clusters=found), features(n, clusters=truth)).regions


def test_partition_by_hand():
    breaks = [breakpoint_at(-1, 0, "scan_end"), breakpoint_at(7, 8), breakpoint_at(15, 16)]
    truth = features(20, clusters=labels(8, 8, 4), breakpoints=breaks)
    breaks = [breakpoint_at(8, 9), breakpoint_at(15, 16), breakpoint_at(19, -1, "scan_end")]
    found = features(20, clusters=labels(9, 7, 4), breakpoints=breaks)
    scores = partition_scores(found, truth)
    assert scores.regions == Counts(2, 2, 2)  # the last one is too small
    assert scores.breakpoints == Counts(1, 1, 1)
    assert scores.success == 1
    # Beam 8 is put to the first eight, and not to the seven that it belongs to: 15 of 190 pairs.
    assert scores.rand_index == pytest.approx(1 - 15 / 190)
    assert scores.summary()["region_f1"] == scores.summary()["breakpoint_f1"] == 1


@pytest.mark.parametrize(
    ("found", "truth", "counts"),
    [
        (labels(20), labels(10, 10), Counts(0, 1, 2)),
        (labels(10, 10), labels(20), Counts(0, 2, 1)),
        (labels(-1, 6, -1), labels(8), Counts(1, 1, 1)),  # one beam at each end
        (labels(-2, 6, -1), labels(9), Counts(0, 1, 1)),
        (labels(-5, 45), labels(50), Counts(1, 1, 1)),  # a tenth
        (labels(-6, 44), labels(50), Counts(0, 1, 1)),
        (labels(-20), labels(20), Counts(0, 0, 1)),
        (labels(20), labels(-20), Counts(0, 0, 0)),
        (labels(5, 20), labels(5, 20), Counts(1, 1, 1)),
        (labels(11, 14), labels(6, 5, 14), Counts(1, 2, 2)),
        (labels(6, 10, 9), labels(6, 5, 5, 9), Counts(2, 2, 2)),  # made of two small ones
    ],
)
def test_regions(found, truth, counts):
    assert regions(found, truth) == counts


def test_region_numbers_do_not_matter():
    truth, found = labels(8, 8, 9), labels(8, 8, 9)
    assert regions(np.array([7, 2, 5])[found], truth) == Counts(3, 3, 3)


@pytest.mark.parametrize(
    ("found", "is_right"),
    [((19, 20), 1), ((18, 19), 1), ((20, 21), 1), ((18, 21), 1), ((17, 18), 0), ((19, 22), 0)],
)
def test_breakpoint_within_one_beam(found, is_right):
    truth = features(40, clusters=labels(20, 20), breakpoints=[breakpoint_at(19, 20)])
    found = features(40, clusters=labels(20, 20), breakpoints=[breakpoint_at(*found, "gap")])
    assert partition_scores(found, truth).breakpoints == Counts(is_right, 1, 1)


def test_breakpoint_next_to_the_seam():
    truth = features(40, breakpoints=[breakpoint_at(39, 0)])
    found = features(40, breakpoints=[breakpoint_at(38, 39), breakpoint_at(0, 1)])
    assert partition_scores(found, truth).breakpoints == Counts(1, 2, 1)


def test_breakpoints_at_small_regions_are_not_judged():
    breaks = [breakpoint_at(9, 10), breakpoint_at(14, 15)]
    truth = features(30, clusters=labels(10, 5, 15), breakpoints=breaks)
    for found in ([], [(9, 10), (14, 15)], [(9, 15)], [(11, 12)], [(8, 16)]):
        marks = [breakpoint_at(*beams) for beams in found]
        scores = partition_scores(features(30, breakpoints=marks), truth)
        assert scores.breakpoints == Counts(0, 0, 0), found
    wrong = partition_scores(features(30, breakpoints=[breakpoint_at(5, 6)]), truth)
    assert wrong.breakpoints == Counts(0, 1, 0)


@pytest.mark.parametrize("seed", range(20))
def test_rand_index_is_that_of_all_pairs(seed):
    rng = np.random.default_rng(seed)
    a, b = rng.integers(-1, 5, (2, 25))
    used = np.flatnonzero((a >= 0) | (b >= 0))
    agreed = [
        (a[i] == a[j] >= 0) == (b[i] == b[j] >= 0) for i, j in itertools.combinations(used, 2)
    ]
    found, truth = features(25, clusters=a), features(25, clusters=b)
    scores = partition_scores(found, truth)
    assert scores.pairs == len(agreed)
    assert scores.rand_index == pytest.approx(np.mean(agreed))
    assert partition_scores(truth, found).rand_index == scores.rand_index


def test_partition_of_nothing():
    scores = partition_scores(features(0), features(0))
    assert scores.regions == scores.breakpoints == Counts()
    assert math.isnan(scores.rand_index)
    assert PartitionScores().summary().keys() == scores.summary().keys()


def test_similarity_by_hand():
    # Beams along 0, 0.1, … rad; points on x = 2, off by 1 cm and 3 cm, then an arc, then nothing.
    bearings = 0.1 * np.arange(6)
    ranges = np.array([2.0, 2.01, 2.03, 1.0, 5.0, np.nan]) / np.cos(bearings)
    ranges[3] = 1.0
    scan = ln.LaserScan(ranges, angles=bearings)
    column = 1.25 * np.array([math.cos(0.3), math.sin(0.3)])
    found = features(6, segments=[segment((2, 0), (2, 1), 0, 2)], arcs=[arc(*column, 0.2, 3, 3)])
    expected = [0.0, 0.01, 0.03, 0.05, np.nan, np.nan]
    np.testing.assert_allclose(similarity_errors(scan, found), expected, atol=1e-12)
    scores = similarity_scores(scan, found)
    assert scores.mean == pytest.approx(0.09 / 4)
    assert scores.variance == pytest.approx((0.0001 + 0.0009 + 0.0025) / 4 - 0.0225**2)
    assert scores.maximum == pytest.approx(0.05)
    assert scores.explained == 4 / 5
    assert set((scores + scores).summary()) == {
        "similarity_mean",
        "similarity_variance",
        "similarity_maximum",
        "similarity_explained",
    }
    assert (scores + scores).mean == pytest.approx(scores.mean)


def test_similarity_of_a_beam_on_two_lines_is_that_to_the_nearer():
    scan = ln.LaserScan([2.0] * 3, 0.0, 0.1)
    near, far = segment((2.01, -1), (2.01, 1), 0, 0), segment((2.5, -1), (2.5, 1), 0, 1)
    errors = similarity_errors(scan, features(3, segments=[far, near]))
    assert errors[0] == pytest.approx(0.01)
    assert errors[1] == pytest.approx(2.5 - 2 * math.cos(0.1))
    assert math.isnan(errors[2])


def test_similarity_of_nothing():
    scan = ln.LaserScan([np.nan, 2.0], 0.0, 0.1)
    scores = similarity_scores(scan, features(2))
    assert scores.summary() == {"similarity_explained": 0.0}
    assert SimilarityScores().summary() == {}
    assert len(similarity_errors(ln.LaserScan([], 0.0, 0.1), features(0))) == 0


def test_other_scans_are_refused():
    with pytest.raises(ValueError, match="found is of a scan of 3 beams, expected 4"):
        partition_scores(features(3), features(4))
    with pytest.raises(ValueError, match="features are of 3 beams, expected the scan's 2"):
        similarity_errors(ln.LaserScan([1.0, 2.0], 0.0, 0.1), features(3))
