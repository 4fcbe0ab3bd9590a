"""Tunes `liu` as its rivals were tuned: F1 of corners on simulated scenes that are not reported.

One parameter after the other takes its best value, until none gains; the last line is the preset
`liu:tuned`. One minute: python benchmarks/tune_liu.py
"""

import argparse
import sys
from itertools import product
from typing import Any

from lineament_lab.evaluation.counts import Counts
from lineament_lab.evaluation.kinds import corner_scores
from lineament_lab.reproduce.scans import batch_of, scene_numbers, simulated_frames

from lineament import Extractor
from lineament.simulation import SCENES, SENSORS

GATE = 0.1
#: Values that are tried, of parameters that go together or alone.
STEPS: tuple[tuple[tuple[str, ...], tuple[tuple[Any, ...], ...]], ...] = (
    (("half_width",), ((0, 1, 2, 3, 4, 6, 8),)),
    (
        ("response", "threshold"),
        (
            ("tangent", "product", "relative", "chord_scaled", "product_scaled"),
            (0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.66, 0.8, 1.0),
        ),
    ),
    (("support_radius",), ((3, 4, 5, 6, 7, 8, 10, 12, 16),)),
    (("spacing_scale",), ((3.0, 4.0, 6.0, 8.0, 10.0, 12.0, 15.0),)),
    (("density_k",), ((0.0, 1.0, 2.0, 3.0, 4.0, 6.0),)),
    (("sigma_r",), ((0.05, 0.1, 0.2, 0.3, 0.55),)),
    (("recursion",), (("both", "after"),)),
    (("ends",), (("truncated", "excluded"),)),
)


def main() -> None:
    """Tune, and print each gain."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=5, help="scans a kind of scene and sensor")
    parser.add_argument("--method", default="liu")
    given = parser.parse_args()
    scenes = scene_numbers(len(SCENES) * given.frames, 0, reported=False)
    frames = [list(simulated_frames(sensor, SCENES, scenes)) for sensor in SENSORS.values()]

    def score(changes: dict[str, Any]) -> float:
        extractor, total = Extractor(given.method, **changes), 0.0
        for of_sensor in frames:
            found = batch_of(extractor, [frame.scan for frame in of_sensor])
            counts = (
                corner_scores(features, frame.truth).by_gate[GATE]
                for features, frame in zip(found, of_sensor, strict=True)
            )
            total += Counts.total(counts).f1
        return total / len(frames)

    best: dict[str, Any] = {}
    most, before = score(best), 0.0
    while most > before:
        before = most
        for names, values in STEPS:
            for chosen in product(*values):
                changes = best | dict(zip(names, chosen, strict=True))
                f1 = score(changes)
                if f1 > most + 1e-9:
                    best, most = changes, f1
            print(f"{most:.4f} {best}", flush=True)
    sys.stdout.write(f"mean F1 over {len(frames)} sensors {most:.3f}: {best}\n")


if __name__ == "__main__":
    main()
