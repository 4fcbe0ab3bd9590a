"""Scores of method optimal in simulation stay where they are, by sensor and kind of scene.

They may neither fall nor rise by more than about their bootstrap error over these scenes. Whoever
moves them looks at what moved, and makes the table anew: python tests/test_optimal_scores.py
"""

import math

import numpy as np
import pytest
from lineament_lab.evaluation.scores import Scores, evaluate

from lineament import Extractor
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
    ("paper", "room"): (1.000, 1.000, 0.970, 1.000, 1.038, 1.013, 0.983, 1.053),
    ("paper", "corridor"): (0.978, 0.987, 0.939, 1.000, 1.064, 1.021, 1.017, 0.981),
    ("paper", "hall"): (0.989, 0.991, 0.997, 0.963, 1.066, 1.004, 1.014, 0.930),
    ("noisy", "room"): (0.988, 0.991, 0.906, 1.000, 1.158, 1.029, 1.008, 1.025),
    ("noisy", "corridor"): (0.937, 0.974, 0.877, 0.993, 1.127, 1.060, 1.009, 0.998),
    ("noisy", "hall"): (0.982, 0.969, 0.988, 0.847, 1.117, 0.982, 1.100, 0.990),
    ("utm30lx", "room"): (0.998, 0.997, 0.972, 1.000, 1.088, 1.005, 1.115, 1.067),
    ("utm30lx", "corridor"): (0.969, 0.985, 0.932, 0.987, 1.116, 1.054, 1.102, 1.070),
    ("utm30lx", "hall"): (0.979, 0.985, 0.994, 0.950, 1.059, 1.111, 1.039, 1.158),
    ("lms361", "room"): (0.998, 0.998, 0.962, 1.000, 1.071, 1.037, 1.080, 1.035),
    ("lms361", "corridor"): (0.963, 0.989, 0.913, 1.000, 1.062, 1.079, 1.042, 1.092),
    ("lms361", "hall"): (0.978, 0.984, 0.986, 0.932, 1.019, 1.019, 0.961, 1.040),
    ("lms181", "room"): (0.995, 0.999, 0.908, 1.000, 1.045, 0.974, 0.953, 1.039),
    ("lms181", "corridor"): (0.958, 0.995, 0.880, 1.000, 1.004, 1.108, 0.935, 1.127),
    ("lms181", "hall"): (0.971, 0.992, 0.961, 0.965, 1.040, 1.044, 0.897, 0.987),
    ("rplidar", "room"): (0.982, 0.980, 0.833, 1.000, 1.124, 1.131, 1.026, 1.104),
    ("rplidar", "corridor"): (0.965, 0.985, 0.885, 1.000, 1.102, 1.051, 1.083, 1.116),
    ("rplidar", "hall"): (0.958, 0.957, 0.969, 0.834, 1.148, 1.053, 1.093, 1.097),
    ("ld19", "room"): (0.997, 0.996, 0.908, 1.000, 1.017, 1.051, 0.943, 0.984),
    ("ld19", "corridor"): (0.966, 0.997, 0.882, 1.000, 1.054, 1.154, 0.983, 1.203),
    ("ld19", "hall"): (0.975, 0.985, 0.956, 0.951, 1.034, 1.034, 0.944, 1.032),
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
