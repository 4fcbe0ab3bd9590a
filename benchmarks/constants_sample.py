"""What `constants.py` measures each row on, and what it makes of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from lineament_lab.evaluation import (
    FeatureScores,
    FreeSpaceScores,
    NormalisedErrors,
    RankedRepeats,
    Scores,
    StandingScores,
    corner_scores,
    evaluate,
    free_space_scores,
    ranked_repeats,
    standing_scores,
)
from lineament_lab.evaluation.arena import ARENAS, load_arena
from lineament_lab.evaluation.repeatability import with_edges
from lineament_lab.reproduce.real import LOGS
from lineament_lab.reproduce.scans import (
    STANDING,
    Frame,
    scan_pairs,
    scene_numbers,
    simulated_frames,
    spread_scans,
    still_pairs,
)

from lineament import Extractor, LaserScan, LogError
from lineament.logs import find_logs, open_log
from lineament.simulation import SENSORS

KINDS = ("room", "corridor", "hall")
#: Seed of the scenes, behind those that are reported.
SEED = 7
#: Measurements of the arms of the standing features that are compared, at least.
LONG = 30

#: Lists of what was measured, scan by scan, by what it was measured on.
Parts = dict[str, dict[str, list[Any]]]


@dataclass
class Sample:
    """The scans that all rows see."""

    simulated: dict[str, list[Frame]]
    recorded: dict[str, list[LaserScan]] = field(default_factory=dict)
    still: dict[str, list[tuple[LaserScan, LaserScan]]] = field(default_factory=dict)
    pairs: dict[str, list[tuple[LaserScan, LaserScan]]] = field(default_factory=dict)
    arenas: dict[str, list[Frame]] = field(default_factory=dict)


def take_sample(scenes: int, scans: int, data: Path) -> Sample:
    """Simulate so many scenes of each kind for each sensor, and read so many scans of each log."""
    numbers = scene_numbers(len(KINDS) * scenes, SEED)
    sample = Sample({n: list(simulated_frames(s, KINDS, numbers)) for n, s in SENSORS.items()})
    if not data.is_dir():
        return sample
    for path in map(Path, find_logs(data)):
        name = path.relative_to(data).as_posix()
        try:
            sample.recorded[name] = spread_scans(open_log(path, keep_going=True), scans)
        except LogError:
            continue
        if pairs := still_pairs(path, 3 * scans, standing=name in STANDING):
            sample.still[name] = pairs
    for name, file in LOGS.items():
        sample.pairs[name] = scan_pairs(data / file, 10 * scans)
    for name, file in ARENAS.items():
        arena = load_arena(data / file, 10 * scans)
        sample.arenas[name] = list(map(Frame, arena.scans, arena.truths))
    return sample


def measure(extract: Extractor, sample: Sample) -> Parts:
    """Score every scan."""
    return {
        "simulated": {
            name: [evaluate(extract(frame.scan), frame.truth) for frame in frames]
            for name, frames in sample.simulated.items()
        },
        "free": {
            name: [free_space_scores(scan, extract(scan)) for scan in scans]
            for name, scans in sample.recorded.items()
        },
        "still": {
            name: [standing_scores([extract(a), extract(b)]) for a, b in pairs]
            for name, pairs in sample.still.items()
        },
        "repeats": {
            name: [_repeats(extract, a, b) for a, b in pairs]
            for name, pairs in sample.pairs.items()
        },
        "arena": {
            name: [corner_scores(extract(frame.scan), frame.truth) for frame in frames]
            for name, frames in sample.arenas.items()
        },
    }


def _repeats(extract: Extractor, a: LaserScan, b: LaserScan) -> RankedRepeats:
    found, others = with_edges(extract(a)), with_edges(extract(b))
    there = ranked_repeats(a, found, b, others, others.corners["quality"])
    return there + ranked_repeats(b, others, a, found, found.corners["quality"])


def figures(parts: Parts) -> dict[str, float]:
    """Figures of all that was measured, by column."""
    sums = [Scores.total(scores) for scores in parts["simulated"].values()]
    columns = {
        "corner F1": [s.corners.counts.f1 for s in sums],
        "segment F1": [s.segments.counts.f1 for s in sums],
        "partition F1": [s.partition.regions.f1 for s in sums],
        "arc F1": [s.arcs.counts.f1 for s in sums],
        "corner NEES": [s.corners.consistency.mean_ratio for s in sums],
    }
    all_of = {name: float(np.nanmean(values)) for name, values in columns.items()}
    if not parts["free"]:
        return all_of
    free = FreeSpaceScores.total(s for scores in parts["free"].values() for s in scores)
    shares = free.summary()
    all_of |= {"phantom in 100 m": shares["phantom_in_100m"], "covered": shares["covered"]}
    for name, scores in parts["arena"].items():
        corners = FeatureScores.total(scores)
        all_of[f"{name}: recall"] = corners.counts.recall
        all_of[f"{name}: error [mm]"] = 1e3 * float(np.median(corners.errors["position"]))
    all_of["repeated at .8"] = sum(
        RankedRepeats.total(scores).count_at(0.8) for scores in parts["repeats"].values()
    )
    still = StandingScores.total(s for scores in parts["still"].values() for s in scores)
    for kind in ("segments", "corners"):
        scatter = getattr(still, kind)
        long = NormalisedErrors(scatter.differences.whitened[scatter.arms >= LONG])
        all_of[f"still: {kind}, NEES"] = long.median_ratio
    return all_of


def resampled(parts: Parts, rng: np.random.Generator) -> Parts:
    """Draw as many scans again from each list: the same ones for each row."""
    return {
        of: {
            name: [scores[i] for i in rng.integers(len(scores), size=len(scores))]
            for name, scores in lists.items()
        }
        for of, lists in parts.items()
    }
