"""Quality of corners and edges: fitted on some logs, calibration and AUC on others.

Run: python benchmarks/quality.py. Of each log with corrected poses, pairs of scans from two places:
whether each corner of one is found again in the other, within 0.1 m. A logistic line in the
logarithm of the present measure (the spread of a corner, the prominence of an edge) is fitted to
four of the logs, beside what chance finds. Printed are its constants, those of
`kernels/writing.py`, and by log the share that is found again, less chance, by quality.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
from lineament_lab.evaluation.repeatability import RankedRepeats, ranked_repeats, with_edges
from lineament_lab.reproduce.real import FURTHER_LOGS, LOGS
from lineament_lab.reproduce.scans import scan_pairs
from recordings import DATA

from lineament import Extractor, Features
from lineament.kernels.writing import _FALL, _PROMINENCE, _RISE, _SPREAD

PAIRS, BINS = 150, np.linspace(0.0, 1.0, 6)
#: Of a kind, its present constants: where half are found again, and how fast that changes.
PRESENT = {"corners": (_SPREAD, -_FALL), "edges": (_PROMINENCE, _RISE)}


def only(features: Features, kind: str) -> Features:
    """Return features whose corners are those of one kind, edges or corners."""
    every, n = with_edges(features).corners, len(features.corners)
    return replace(features, corners=every[:n] if kind == "corners" else every[n:])


def repeats_of(log: str, kind: str) -> Iterator[RankedRepeats]:
    """Yield the corners or edges of each scan, and whether they are found again."""
    extract = Extractor()
    for pair in scan_pairs(DATA / log, PAIRS):
        found = [extract(scan) for scan in pair]
        for one, other in ((0, 1), (1, 0)):
            seen = only(found[other], kind)
            scores = seen.corners["quality"].astype(float)
            yield ranked_repeats(pair[one], with_edges(found[one]), pair[other], seen, scores)


def fitted(repeats: RankedRepeats) -> tuple[float, float]:
    """Fit logit q' = a + b logit q, where found again are c + (1 - c) q', c of them by chance."""
    scores = np.clip(repeats.scores, 1e-6, 1 - 1e-6)
    x, chance, line = np.log(scores / (1 - scores)), repeats.chance, np.array((0.0, 1.0))
    terms = np.column_stack((np.ones_like(x), x))
    for _ in range(50):  # scoring, by Fisher's information
        quality = 1 / (1 + np.exp(-terms @ line))
        share = np.clip(chance + (1 - chance) * quality, 1e-6, 1 - 1e-6)
        slope = (1 - chance) * quality * (1 - quality)
        weight = slope / (share * (1 - share))
        step = np.linalg.solve(
            (terms * (weight * slope)[:, None]).T @ terms,
            terms.T @ (weight * (repeats.repeated - share)),
        )
        line += step
        if abs(step).max() < 1e-9:
            break
    a, b = line.tolist()
    return a, b


def main() -> None:
    """Print the constants, and for each log and bin what is found again."""
    for kind, (half, power) in PRESENT.items():
        logs = {
            name: RankedRepeats.total(repeats_of(path, kind))
            for name, path in (LOGS | FURTHER_LOGS).items()
        }
        a, b = fitted(RankedRepeats.total(logs[name] for name in LOGS))
        print(f"## {kind}\n")
        print(
            f"Fitted to {', '.join(LOGS)}: half at {half * math.exp(-a / (b * power)):.3g}, "
            f"power {b * power:.2g}; in use are {half:g} and {power:g}.\n"
        )
        print("|log|n|AUC|" + "|".join(f"{q:.1f}–{q + 0.2:.1f}" for q in BINS[:-1]) + "|")
        print("|---" * (len(BINS) + 2) + "|")
        groups = {**logs, "not fitted to": RankedRepeats.total(logs[n] for n in FURTHER_LOGS)}
        for name, repeats in groups.items():
            rates = [repeats.rate_between(low, high) for low, high in pairwise(BINS)]
            cells = [f"{rate:.2f}" for rate in rates]
            print(f"|{name}|{len(repeats.scores)}|{repeats.auc:.3f}|" + "|".join(cells) + "|")
        print()


if __name__ == "__main__":
    main()
