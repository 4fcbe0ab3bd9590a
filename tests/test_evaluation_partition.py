"""Clusters and breakpoints against the truth: by hand, and the Rand index by its definition."""

import itertools
import math

import numpy as np
import pytest
from handmade import breakpoint_at, features
from lineament_lab.evaluation import Counts, PartitionScores, partition_scores


def labels(*sizes):
    """Number clusters of so many beams; a negative size stands for beams of no cluster."""
    numbers = itertools.count()
    runs = [np.full(abs(size), next(numbers) if size > 0 else -1) for size in sizes]
    return np.concatenate(runs) if runs else np.empty(0)


def of_labels(found, truth):
    n = len(truth)
    return partition_scores(features(n, clusters=found), features(n, clusters=truth))


def of_breaks(n, found, truth, clusters=None):
    """Counts of breakpoints between these beams, found and true."""
    rows = [[breakpoint_at(*beams) for beams in breaks] for breaks in (found, truth)]
    one, other = (features(n, clusters=clusters, breakpoints=breaks) for breaks in rows)
    return partition_scores(one, other).breakpoints


def test_partition_by_hand():
    breaks = [breakpoint_at(-1, 0, "scan_end"), breakpoint_at(7, 8), breakpoint_at(15, 16)]
    truth = features(20, clusters=labels(8, 8, 4), breakpoints=breaks)
    breaks = [breakpoint_at(8, 9), breakpoint_at(15, 16), breakpoint_at(19, -1, "scan_end")]
    found = features(20, clusters=labels(9, 7, 4), breakpoints=breaks)
    scores = partition_scores(found, truth)
    assert scores.regions == Counts(2, 2, 2)  # the last one is too small
    assert scores.breakpoints == Counts(1, 1, 1)
    # Beam 8 is put to the first eight, and not to the seven that it belongs to: 15 of 190 pairs.
    assert scores.summary() == pytest.approx(
        {"success": 1, "rand_index": 1 - 15 / 190}
        | {f"{kind}_{share}": 1 for kind in ("region", "breakpoint")
           for share in ("precision", "recall", "f1")}
    )  # fmt: skip


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
        (labels(11, 9), labels(6, -5, 9), Counts(1, 2, 2)),  # not half of it is in no cluster
        (labels(10, 5), labels(5, 10), Counts(0, 1, 1)),  # half of it is in a small one
        (np.array([7, 2, 5])[labels(8, 8, 9)], labels(8, 8, 9), Counts(3, 3, 3)),
    ],
)
def test_regions(found, truth, counts):
    assert of_labels(found, truth).regions == counts


@pytest.mark.parametrize(
    ("found", "is_right"),
    [((19, 20), 1), ((18, 19), 1), ((20, 21), 1), ((18, 21), 1), ((17, 18), 0), ((19, 22), 0)],
)
def test_breakpoint_within_one_beam_whatever_its_kind(found, is_right):
    counts = of_breaks(40, [(*found, "gap")], [(19, 20)], labels(20, 20))
    assert counts == Counts(is_right, 1, 1)


def test_breakpoint_next_to_the_seam():
    assert of_breaks(40, [(38, 39), (0, 1)], [(39, 0)]) == Counts(1, 2, 1)


@pytest.mark.parametrize(
    ("found", "counts"),
    [
        *(((), Counts()), (((9, 10), (14, 15)), Counts()), (((9, 15),), Counts())),
        *((((11, 12),), Counts()), (((8, 16),), Counts()), (((5, 6),), Counts(0, 1, 0))),
    ],
)
def test_breakpoints_at_small_regions_are_not_judged(found, counts):
    assert of_breaks(30, found, [(9, 10), (14, 15)], labels(10, 5, 15)) == counts


@pytest.mark.parametrize("seed", range(20))
def test_rand_index_is_that_of_all_pairs(seed):
    a, b = np.random.default_rng(seed).integers(-1, 5, (2, 25))
    used = np.flatnonzero((a >= 0) | (b >= 0))
    agreed = [
        (a[i] == a[j] >= 0) == (b[i] == b[j] >= 0) for i, j in itertools.combinations(used, 2)
    ]
    scores = of_labels(a, b)
    assert scores.pairs == len(agreed)
    assert scores.rand_index == pytest.approx(np.mean(agreed))
    assert of_labels(b, a).rand_index == scores.rand_index


def test_partition_of_nothing():
    scores = partition_scores(features(0), features(0))
    assert scores.regions == scores.breakpoints == Counts()
    assert math.isnan(scores.rand_index)
    assert PartitionScores().summary().keys() == scores.summary().keys()
    with pytest.raises(ValueError, match="found is of a scan of 3 beams, expected 4"):
        partition_scores(features(3), features(4))
