"""All scores together: what must hold for any features."""

import json

import numpy as np
import pytest
from handmade import features, random_features, shaken, shuffled
from lineament_lab.evaluation import Counts, Scores, evaluate

from lineament.simulation import SCENES, SENSORS, scene
from lineament.simulation import truth as truth_of

SEEDS = range(12)


def counts_of(scores):
    return [
        *scores.corners.by_gate.values(),
        scores.segments.counts,
        scores.arcs.counts,
        scores.partition.regions,
        scores.partition.breakpoints,
    ]


def assert_same(one, other):
    assert one.summary() == pytest.approx(other.summary(), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(
    "truth",
    [
        *map(random_features, SEEDS),
        *(truth_of(*scene(kind, 1), SENSORS["paper"]) for kind in SCENES),
    ],
)
def test_perfect_features_score_one(truth):
    scores = evaluate(truth, truth)
    summary = scores.summary()
    for name, value in summary.items():
        if any(word in name for word in ("precision", "recall", "f1", "success", "rand_index")):
            assert value == 1, name
        elif any(word in name for word in ("rmse", "error", "over_bound", "fragm", "merg", "end")):
            assert value == pytest.approx(0, abs=1e-9), name
    assert {"corner_f1_0.10", "segment_f1", "partition_region_f1"} <= summary.keys()
    assert scores.segments.counts.true == sum(truth.segments["n_points"] >= 6)


@pytest.mark.parametrize("seed", SEEDS)
def test_order_and_frame_do_not_matter(seed):
    truth = random_features(seed, least=2)
    found, motion = shaken(truth, seed), (3.0, -2.0, 2.5)
    scores = evaluate(found, truth)
    assert_same(evaluate(shuffled(found, 1), shuffled(truth, 2)), scores)
    assert_same(evaluate(found.transform(*motion), truth.transform(*motion)), scores)


def test_scores_add_up():
    truths = [random_features(seed) for seed in SEEDS]
    parts = [evaluate(shaken(truth, 1), truth) for truth in truths]
    total = Scores.total(parts)
    assert total.scans == len(parts)
    for k, counts in enumerate(counts_of(total)):
        assert counts == Counts.total(counts_of(part)[k] for part in parts)
    assert_same(sum(parts, Scores()), total)
    assert all(counts.correct > 0 for counts in counts_of(total))
    squares = np.concatenate([part.corners.consistency.squares for part in parts])
    assert total.summary()["corner_nees"] == pytest.approx(squares.mean() / 2)
    assert 0 < total.summary()["corner_rmse"] < 0.1


def test_hostile_features_raise_no_warning_and_figures_are_json():
    truth = random_features(0)
    broken = shaken(truth, 1)
    for name, field in (("segments", "centroid"), ("corners", "position"), ("arcs", "radius")):
        table = getattr(broken, name)
        table[field][::2] = np.nan
        table["covariance"][1::2] = np.inf
    scores = evaluate(broken, truth)
    assert scores.corners.consistency.unusable == len(scores.corners.errors["position"]) > 0
    empty = features(0)
    for some in (scores, Scores(), evaluate(empty, empty), evaluate(features(200), truth)):
        summary = some.summary()
        assert json.loads(json.dumps(summary, allow_nan=False)) == summary
