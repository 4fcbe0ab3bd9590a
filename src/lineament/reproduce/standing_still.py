"""Features of sensors that stand still: their scatter, by their covariances."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..errors import LogError
from ..evaluation.standing import ScatterScores, StandingScores, standing_scores
from ..extractor import Extractor
from ..logs import open_log
from ..scan import LaserScan
from .findings import Progress, Setting, Table

__all__ = ["STANDING", "standing_still", "standing_tables", "still_pairs"]

#: Recordings without poses whose sensors stand all the time.
STANDING = (
    "rosbag1/demo_stationary_simple_environment.bag",
    "rosbag1/scans_demo.bag",
    "rosbag2/jackal_mocap",
    "rosbag2/ld19",
)
#: A pose that changes by less is that of a sensor that stands [m], [rad].
_MOVED, _TURNED = 1e-3, 1e-3
#: Pairs of scans in a row of each recording for each frame of the setting.
STILL_A_FRAME = 10
#: Columns of each bin, the figures that they show, and what makes them larger.
_COLUMNS: dict[str, tuple[str, float]] = {
    "NEES": ("nees_median", 1),
    "in 95 % ellipse [%]": ("in_95_ellipse", 100),
    "found again [%]": ("found_again", 100),
    "pairs": ("pairs", 1),
}


def still_pairs(
    path: str | Path, count: int, *, standing: bool = False
) -> list[tuple[LaserScan, LaserScan]]:
    """Pick so many pairs of scans in a row of one topic, at equal steps of the log.

    Both have the same beams, and poses that do not differ; with `standing` the sensor is known to
    stand, whatever its poses.
    """
    before: dict[str, LaserScan] = {}
    pairs = []
    for topic, scan in open_log(path, keep_going=True).items():
        last = before.get(topic)
        stands = last is not None and (standing or _stands(last, scan))
        if last is not None and stands and np.array_equal(last.angles, scan.angles):
            pairs.append((last, scan))
        before[topic] = scan
    chosen = np.linspace(0, len(pairs) - 1, min(count, len(pairs))).astype(int)
    return [pairs[i] for i in chosen]


def _stands(scan: LaserScan, other: LaserScan) -> bool:
    if scan.pose is None or other.pose is None:
        return False
    turn = math.remainder(other.pose[2] - scan.pose[2], 2 * math.pi)
    return math.dist(scan.pose[:2], other.pose[:2]) < _MOVED and abs(turn) < _TURNED


#: Scores of each method, by recording.
Standing = Mapping[str, Mapping[str, StandingScores]]


def standing_still(
    logs: Mapping[str, Path], methods: Mapping[str, Extractor], setting: Setting, progress: Progress
) -> dict[str, dict[str, StandingScores]]:
    """Score every method on the stretches of each log in which its sensor stands, if there are."""
    scores: dict[str, dict[str, StandingScores]] = {}
    for name, path in logs.items():
        progress(f"standing still, {name}: reading")
        try:
            pairs = still_pairs(path, STILL_A_FRAME * setting.frames, standing=name in STANDING)
        except LogError:
            continue
        for method, extractor in methods.items() if pairs else ():
            progress(f"standing still, {name}: {method}")
            scores.setdefault(name, {})[method] = StandingScores.total(
                standing_scores([extractor(scan) for scan in pair]) for pair in pairs
            )
    return scores


def standing_tables(scores: Standing, method: str) -> list[Table]:
    """Make tables of all methods on all recordings, and of one method by recording."""
    if not scores:
        return []
    together = {
        name: StandingScores.total(found[name] for found in scores.values())
        for name in next(iter(scores.values()))
    }
    tables = [
        Table.of_records(
            f"Standing still: {kind}, by measurements",
            [
                {"method": name} | _record(getattr(of, kind), _COLUMNS)
                for name, of in together.items()
            ],
        )
        for kind in ("segments", "corners")
    ]
    short = {"NEES": _COLUMNS["NEES"], "pairs": _COLUMNS["pairs"]}
    mine = {name: found[method] for name, found in scores.items() if method in found}
    for kind in ("segments", "corners") if mine else ():
        records = [
            {"recording": name} | _record(getattr(of, kind), short) for name, of in mine.items()
        ]
        tables.append(
            Table.of_records(f"Standing still: {kind} of {method}, by recording", records)
        )
    return tables


def _record(scores: ScatterScores, columns: Mapping[str, tuple[str, float]]) -> dict[str, object]:
    return {
        f"{name}: {column}": factor * figures[key]
        for name, figures in scores.bins().items()
        for column, (key, factor) in columns.items()
    }
