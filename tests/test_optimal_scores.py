"""Scores of method optimal in simulation stay where they are, by sensor and kind of scene.

They may neither fall nor rise by more than about their bootstrap error over these scenes. Whoever
moves them looks at what moved, and makes the table anew: python tests/test_optimal_scores.py
"""

import math

import numpy as np
import pytest

from lineament import Extractor
from lineament.evaluation.scores import Scores, evaluate
from lineament.simulation import SENSORS, scene, truth

KINDS = ("room", "corridor", "hall")
#: Scenes of each kind; no constant was chosen on them.
SEEDS = range(70000, 70150)
#: By how much a figure may move: its bootstrap error, the median of some rows. The figures are F1
#: of corners, segments, regions and arcs; median error of corners and lines over the bound; median
#: NEES of corners and lines, 1 where the covariances are right.
MARGINS = {
    "corners": 0.006,
    "segments": 0.003,
    "regions": 0.012,
    "arcs": 0.012,
    "corner / bound": 0.04,
    "line / bound": 0.04,
    "corner NEES": 0.07,
    "line NEES": 0.05,
}
PINNED = {
    ("paper", "room"): (1.000, 0.999, 0.970, 1.000, 1.030, 1.019, 0.951, 0.908),
    ("paper", "corridor"): (0.976, 0.989, 0.938, 1.000, 1.081, 1.029, 0.845, 0.934),
    ("paper", "hall"): (0.993, 0.991, 0.997, 0.965, 1.058, 0.999, 1.007, 0.958),
    ("noisy", "room"): (0.990, 0.987, 0.910, 0.993, 1.136, 1.024, 1.169, 1.109),
    ("noisy", "corridor"): (0.936, 0.974, 0.876, 0.993, 1.152, 1.081, 1.144, 1.110),
    ("noisy", "hall"): (0.985, 0.969, 0.989, 0.858, 1.120, 0.981, 1.197, 1.117),
    ("utm30lx", "room"): (0.998, 0.997, 0.972, 1.000, 1.083, 1.003, 1.144, 1.053),
    ("utm30lx", "corridor"): (0.970, 0.985, 0.932, 0.987, 1.089, 1.048, 1.064, 1.094),
    ("utm30lx", "hall"): (0.985, 0.985, 0.995, 0.950, 1.067, 1.105, 1.064, 1.154),
    ("lms361", "room"): (0.998, 0.998, 0.962, 1.000, 1.059, 1.032, 0.900, 0.885),
    ("lms361", "corridor"): (0.966, 0.989, 0.913, 1.000, 1.069, 1.087, 0.804, 0.951),
    ("lms361", "hall"): (0.985, 0.984, 0.986, 0.930, 0.994, 1.030, 0.872, 1.024),
    ("lms181", "room"): (0.995, 0.999, 0.908, 1.000, 1.040, 0.963, 0.652, 0.712),
    ("lms181", "corridor"): (0.951, 0.995, 0.880, 1.000, 0.999, 1.107, 0.363, 0.800),
    ("lms181", "hall"): (0.976, 0.993, 0.961, 0.971, 1.031, 1.044, 0.841, 0.949),
    ("rplidar", "room"): (0.980, 0.982, 0.824, 0.993, 1.116, 1.123, 1.168, 1.169),
    ("rplidar", "corridor"): (0.965, 0.986, 0.884, 1.000, 1.125, 1.056, 1.158, 1.122),
    ("rplidar", "hall"): (0.957, 0.955, 0.969, 0.836, 1.135, 1.058, 1.164, 1.156),
    ("ld19", "room"): (0.997, 0.996, 0.906, 1.000, 1.030, 1.047, 0.688, 0.770),
    ("ld19", "corridor"): (0.961, 0.997, 0.882, 1.000, 1.043, 1.160, 0.515, 0.920),
    ("ld19", "hall"): (0.978, 0.985, 0.956, 0.950, 1.030, 1.030, 0.847, 0.978),
}


def figures_of(sensor, kind):
    extractor, device = Extractor("optimal"), SENSORS[sensor]

    def scores_of(seed):
        world, pose = scene(kind, seed)
        found = extractor(device.scan(world, pose, np.random.default_rng(seed)))
        return evaluate(found, truth(world, pose, device))

    return figures(list(map(scores_of, SEEDS)))


def figures(parts):
    scores = Scores.total(parts)
    corners, segments, arcs = scores.corners, scores.segments, scores.arcs.counts
    return (
        corners.counts.f1,
        segments.counts.f1,
        scores.partition.regions.f1,
        arcs.f1 if arcs.true else 1.0 - arcs.found / scores.scans,
        math.sqrt(corners.over_bound[""].median_ratio),
        math.sqrt(segments.over_bound["offset_"].median_ratio),
        corners.consistency.median_ratio,
        segments.consistency.median_ratio,
    )


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("sensor", SENSORS)
def test_scores(sensor, kind):
    found, pinned = figures_of(sensor, kind), PINNED[sensor, kind]
    moved = {
        name: (value, was)
        for (name, margin), value, was in zip(MARGINS.items(), found, pinned, strict=True)
        if not abs(value - was) <= margin
    }
    assert not moved


if __name__ == "__main__":
    for sensor in SENSORS:
        for kind in KINDS:
            row = ", ".join(f"{value:.3f}" for value in figures_of(sensor, kind))
            print(f'    ("{sensor}", "{kind}"): ({row}),')
