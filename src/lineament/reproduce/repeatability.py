"""Features of real logs with corrected poses, and whether they are found again elsewhere."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from ..evaluation.kinds import vertices
from ..evaluation.repeatability import Repeatability, repeatability
from ..evaluation.similarity import SimilarityScores, similarity_scores
from ..extractor import Extractor
from ..features import Features
from ..logs import open_log
from ..scan import LaserScan
from .charts import dot_chart
from .contenders import LIU_NOTE, feature_methods
from .findings import Figure, Findings, Progress, Setting, Table

__all__ = ["LOGS", "repeats_of", "run", "scan_pairs"]

#: The recordings, by name.
LOGS = {
    "Intel lab": "truth/intel_graph.npz",
    "fr079": "truth/fr079_graph.npz",
    "MIT CSAIL": "carmen/csail-corrected.log.gz",
}
#: Pairs of scans for each frame of the setting.
PAIRS_A_FRAME = 4
#: The other scan of a pair is the first that was taken so far away [m] or turned so far [rad].
MOVED, TURNED = 0.3, math.radians(15)
#: The log is not searched for it any further than so many scans.
_SEARCHED = 200

Pair = tuple[LaserScan, LaserScan]


@dataclass(frozen=True, slots=True, eq=False)
class _Result:
    """What a method repeats in a log, and how far points are from their own lines."""

    repeats: Repeatability
    similarity: SimilarityScores
    corners_per_scan: float

    def summary(self) -> dict[str, float]:
        """List all figures by name."""
        corners, segments = self.repeats.corners, self.repeats.segments
        return {
            "corners_per_scan": self.corners_per_scan,
            "corners_expected": corners.expected,
            "corners_repeated": corners.repeated,
            "corner_rate": corners.rate,
            "corner_rmse": corners.rmse,
            "segments_expected": segments.expected,
            "segment_rate": segments.rate,
            "segment_rmse": segments.rmse,
            **self.similarity.summary(),
        }


def run(setting: Setting, progress: Progress) -> Findings:
    """Look for the features of one scan in another of the same log, for all methods."""
    paths = {name: setting.recording(file) for name, file in LOGS.items()}
    there = {name: path for name, path in paths.items() if path is not None}
    title = "Repeatability in real logs"
    if not there:
        return Findings(title, ("The recordings are not there: nothing was measured.",))
    methods = feature_methods(setting, progress)
    results: dict[str, dict[str, _Result]] = {}
    for name, path in there.items():
        progress(f"{name}: reading")
        pairs = scan_pairs(path, PAIRS_A_FRAME * setting.frames)
        results[name] = {}
        for method, extractor in methods.items():
            progress(f"{name}: {method}")
            results[name][method] = _measure(pairs, extractor)
    return Findings(
        title,
        _TEXT,
        tuple(_table(name, found) for name, found in results.items()),
        (_figure(results),),
        {name: {m: r.summary() for m, r in found.items()} for name, found in results.items()},
    )


_TEXT = (
    "Features of one scan are moved by the corrected poses into the frame of another, taken "
    f"{MOVED} m or {math.degrees(TURNED):.0f}° on, and the other way round. Those that are in its "
    "view and not occluded are expected; they are repeated if they are found within 0.1 m. The "
    "errors of the poses, some 2 to 5 cm, are part of the distances. The paper has no such table.",
    "A method that makes a corner of every other reading repeats many of them by chance: the "
    "corners per scan stand beside. The similarity error, the distance of each point from its own "
    "line, is of the points that belong to a line; the share of those is told too.",
    LIU_NOTE,
)


def scan_pairs(path: Path, count: int) -> list[Pair]:
    """Pick scans at equal steps of a log, each with the first one that was taken elsewhere."""
    scans = [scan for scan in open_log(path, keep_going=True) if scan.pose is not None]
    pairs = []
    for i in range(0, len(scans), max(1, len(scans) // count)):
        later = islice(scans, i + 1, i + 1 + _SEARCHED)
        other = next((scan for scan in later if _is_elsewhere(scans[i], scan)), None)
        if other is not None:
            pairs.append((scans[i], other))
    return pairs[:count]


def _is_elsewhere(scan: LaserScan, other: LaserScan) -> bool:
    if scan.pose is None or other.pose is None:
        return False
    turn = math.remainder(other.pose[2] - scan.pose[2], 2 * math.pi)
    return math.dist(scan.pose[:2], other.pose[:2]) >= MOVED or abs(turn) >= TURNED


def repeats_of(
    pairs: Iterable[Pair],
    extractor: Extractor,
    demanded: Callable[[Features], Features] = lambda features: features,
) -> Repeatability:
    """Look for the features of each scan of each pair in the other.

    Parameters
    ----------
    pairs : iterable of (LaserScan, LaserScan)
    extractor : Extractor
    demanded : callable
        Picks the features of a scan that are looked for in the other, among all of its own.
    """
    repeats = []
    for scan, other in pairs:
        features, others = extractor(scan), extractor(other)
        repeats.append(repeatability(scan, features, other, demanded(others)))
        repeats.append(repeatability(other, others, scan, demanded(features)))
    return Repeatability.total(repeats)


def _measure(pairs: list[Pair], extractor: Extractor) -> _Result:
    scans = [scan for scan, _ in pairs]
    found = [extractor(scan) for scan in scans]
    return _Result(
        repeats_of(pairs, extractor),
        SimilarityScores.total(map(similarity_scores, scans, found)),
        sum(len(vertices(features)) for features in found) / len(pairs),
    )


def _table(log: str, results: Mapping[str, _Result]) -> Table:
    rows = []
    for method, result in results.items():
        corners, segments = result.repeats.corners, result.repeats.segments
        similarity = result.similarity
        rows.append(
            {
                "method": method,
                "corners a scan": result.corners_per_scan,
                "corners expected": corners.expected,
                "corners repeated [%]": 100 * corners.rate,
                "distance of corners, RMS [mm]": 1e3 * corners.rmse,
                "segments expected": segments.expected,
                "segments repeated [%]": 100 * segments.rate,
                "distance of segments, RMS [mm]": 1e3 * segments.rmse,
                "similarity, mean [mm]": 1e3 * similarity.mean,
                "variance [mm²]": 1e6 * similarity.variance,
                "largest [m]": similarity.maximum,
                "points on lines [%]": 100 * similarity.explained,
            }
        )
    return Table.of_records(f"{log}: features found again", rows)


def _figure(results: Mapping[str, Mapping[str, _Result]]) -> Figure:
    shown = {
        "corners repeated [%]": ("corner_rate", 100.0),
        "segments repeated [%]": ("segment_rate", 100.0),
        "corners a scan": ("corners_per_scan", 1.0),
    }
    panels = {
        label: {
            log: {m: factor * r.summary()[key] for m, r in found.items()}
            for log, found in results.items()
        }
        for label, (key, factor) in shown.items()
    }
    return Figure(
        "repeatability",
        "Share of the features of one scan that are found again in another, and corners per scan, "
        "by method (rows) and log (colours).",
        dot_chart(panels, log_axes=frozenset({"corners a scan"})),
    )
