"""All methods on all recordings, by measures that need no truth; the corners of an arena."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from ..errors import LogError
from ..evaluation.free_space import FreeSpaceScores, free_space_scores
from ..evaluation.kinds import vertices
from ..evaluation.repeatability import RankedRepeats, ranked_repeats
from ..extractor import Extractor
from ..features import Features
from ..logs import find_logs
from ..scan import LaserScan
from .arena import ArenaScores, arena_scores, load_arena
from .contact_sheet import contact_sheet, sheet_scans
from .contenders import feature_methods
from .findings import Findings, Progress, Setting, Table
from .recorded_aims import ARENAS
from .recordings import spread_scans
from .repeatability import scan_pairs
from .standing_still import standing_still, standing_tables

__all__ = ["run"]

#: Method of the contact sheet, and of the tables by recording.
DRAWN = "optimal"
#: Logs with corrected poses, in which corners are looked for again, by name.
LOGS = {
    "Intel lab": "truth/intel_graph.npz",
    "fr079": "truth/fr079_graph.npz",
    "MIT CSAIL": "carmen/csail-corrected.log.gz",
    "ACES": "carmen/aces-corrected.log.gz",
}
#: For each frame of the setting: scans of each recording, pairs of scans of a log from different
#: places, scans of each arena.
SCANS_A_FRAME, PAIRS_A_FRAME, ARENA_A_FRAME = 3, 12, 10
#: Share of the corners that must be repeated, and the bounds of the bins of quality.
RATE, _QUALITIES = 0.8, (0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)

#: Titles of the tables of free space, the figures that they show, and what makes them larger.
_FREE_SPACE = {
    "Phantom metres in 100 m of segments": ("phantom_in_100m", 1.0),
    "Longest phantom stretch [m]": ("longest_phantom", 1.0),
    "Scans with a phantom stretch of more than 0.3 m [%]": ("phantom_scans", 100.0),
    "Covered measurements [%]": ("covered", 100.0),
}

Methods = Mapping[str, Extractor]


def run(setting: Setting, progress: Progress) -> Findings:
    """Measure every method on all recordings that are there."""
    title = "Real scans"
    logs = _logs(setting)
    if not logs:
        return Findings(title, ("The recordings are not there: nothing was measured.",))
    methods = feature_methods(setting, progress)
    free, unread = _free_space(logs, methods, setting, progress)
    standing = standing_still(logs, methods, setting, progress)
    repeats = _repeats(methods, setting, progress)
    arenas = _arenas(methods, setting, progress)
    progress("drawing")
    sheet = sheet_scans(setting)
    text = (*_TEXT, f"Left out, as they hold no scans: {', '.join(unread)}.") if unread else _TEXT
    return Findings(
        title,
        text,
        (
            *_free_space_tables(free),
            *standing_tables(standing, DRAWN),
            *(_repeats_table(name, found) for name, found in repeats.items()),
            *([_quality_table(repeats, DRAWN)] if repeats else []),
            *_arena_tables(arenas),
        ),
        (contact_sheet(sheet, Extractor(DRAWN)),) if sheet else (),
        {
            "free_space": {log: _summaries(found) for log, found in free.items()},
            "standing": {
                log: {
                    method: {"segments": of.segments.bins(), "corners": of.corners.bins()}
                    for method, of in found.items()
                }
                for log, found in standing.items()
            },
            "repeats": {
                log: {method: _repeats_figures(ranked) for method, ranked in found.items()}
                for log, found in repeats.items()
            },
            "arena": {name: _summaries(found) for name, found in arenas.items()},
        },
    )


_TEXT = (
    "Free space: segments are sampled every 2 cm; a sample is phantom where the three beams about "
    "it all went on by more than 0.2 m, or all ended as much before. A measurement is covered "
    "within 5 cm and 1 % of its range of a segment or an arc.",
    "Standing still: the same feature in two scans in a row, by the sum of their covariances. "
    "NEES is the median, 1 is right, and the 95 % ellipse should hold 95 %. Bins are of the "
    "measurements of the feature, of a corner of its shorter arm.",
    "Repeated corners: those of one scan in another from elsewhere, within 0.1 m, ranked by "
    "quality, with what chance repeats taken off. Counted is how many are repeated among the best "
    f"of which {100 * RATE:.0f} % are. AUC is the probability that a repeated one has the higher "
    "quality.",
)


def _logs(setting: Setting) -> dict[str, Path]:
    """All logs of the folder of recordings, by their names in it."""
    if setting.data is None:
        return {}
    try:
        paths = [Path(path) for path in find_logs(setting.data)]
    except LogError:
        return {}
    return {path.relative_to(setting.data).as_posix(): path for path in paths}


def _summaries(
    scores: Mapping[str, FreeSpaceScores] | Mapping[str, ArenaScores],
) -> dict[str, dict[str, float]]:
    return {method: of.summary() for method, of in scores.items()}


def _free_space(
    logs: Mapping[str, Path], methods: Methods, setting: Setting, progress: Progress
) -> tuple[dict[str, dict[str, FreeSpaceScores]], list[str]]:
    """Scores by recording and method, and the names of those that hold no scans."""
    scores: dict[str, dict[str, FreeSpaceScores]] = {}
    unread = []
    for name, path in logs.items():
        try:
            scans = spread_scans(path, SCANS_A_FRAME * setting.frames)
        except LogError:
            unread.append(name)
            continue
        scores[name] = {}
        for method, extractor in methods.items():
            progress(f"free space, {name}: {method}")
            parts = [free_space_scores(scan, extractor(scan)) for scan in scans]
            scores[name][method] = FreeSpaceScores.total(parts)
    return scores, unread


def _free_space_tables(scores: Mapping[str, Mapping[str, FreeSpaceScores]]) -> list[Table]:
    """One table a figure, a row for each recording, and one for all of them."""
    methods = list(next(iter(scores.values()), {}))
    together = {m: FreeSpaceScores.total(found[m] for found in scores.values()) for m in methods}
    rows = {**scores, "all": together}
    figures = {name: _summaries(found) for name, found in rows.items()}
    return [
        Table.of_records(
            title,
            [
                {"recording": name}
                | {m: _scaled(of[m].get(key), factor) for m in methods}
                | {"scans": len(rows[name][methods[0]].longest)}
                for name, of in figures.items()
            ],
        )
        for title, (key, factor) in _FREE_SPACE.items()
        if scores
    ]


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else factor * value


def _repeats(
    methods: Methods, setting: Setting, progress: Progress
) -> dict[str, dict[str, tuple[RankedRepeats, RankedRepeats]]]:
    """Ranked corners by log and method: all of them, and those without edges."""
    repeats: dict[str, dict[str, tuple[RankedRepeats, RankedRepeats]]] = {}
    for name, file in LOGS.items():
        path = setting.recording(file)
        if path is None:
            continue
        progress(f"repeated corners, {name}: reading")
        pairs = scan_pairs(path, PAIRS_A_FRAME * setting.frames)
        repeats[name] = {}
        for method, extractor in methods.items() if pairs else ():
            progress(f"repeated corners, {name}: {method}")
            found = [(a, extractor(a), b, extractor(b)) for a, b in pairs]
            alone = [(a, _vertices(fa), b, _vertices(fb)) for a, fa, b, fb in found]
            repeats[name][method] = _both_ways(found), _both_ways(alone)
    return {name: found for name, found in repeats.items() if found}


def _vertices(features: Features) -> Features:
    return replace(features, corners=vertices(features))


def _both_ways(
    pairs: Sequence[tuple[LaserScan, Features, LaserScan, Features]],
) -> RankedRepeats:
    parts = []
    for a, found, b, others in pairs:
        parts.append(ranked_repeats(a, found, b, others, others.corners["quality"]))
        parts.append(ranked_repeats(b, others, a, found, found.corners["quality"]))
    return RankedRepeats.total(parts)


def _repeats_figures(ranked: tuple[RankedRepeats, RankedRepeats]) -> dict[str, float]:
    every, alone = ranked
    return {
        "expected": len(every.scores),
        "rate": every.rate,
        "auc": every.auc,
        "count": every.count_at(RATE),
        "chance": float(every.chance.mean()) if len(every.chance) else 0.0,
        "count_without_edges": alone.count_at(RATE),
        "auc_without_edges": alone.auc,
    }


def _repeats_table(log: str, repeats: Mapping[str, tuple[RankedRepeats, RankedRepeats]]) -> Table:
    at = f"repeated at {100 * RATE:.0f} %"
    records = []
    for method, ranked in repeats.items():
        figures = _repeats_figures(ranked)
        records.append(
            {
                "method": method,
                "corners expected": figures["expected"],
                "repeated [%]": 100 * figures["rate"],
                "by chance [%]": 100 * figures["chance"],
                "AUC of quality": figures["auc"],
                at: figures["count"],
                "without edges: AUC": figures["auc_without_edges"],
                f"without edges: {at}": figures["count_without_edges"],
            }
        )
    return Table.of_records(f"{log}: repeated corners, ranked by quality", records)


def _quality_table(
    repeats: Mapping[str, Mapping[str, tuple[RankedRepeats, RankedRepeats]]], method: str
) -> Table:
    """Compare the share that is found again with what the quality promises."""
    records = []
    for log, found in repeats.items():
        every, _ = found[method]
        rates = {
            f"{a:.1f}–{b:.1f}": 100 * every.rate_between(a, b) for a, b in pairwise(_QUALITIES)
        }
        records.append({"log": log, **rates})
    return Table.of_records(f"Corners of {method} found again [%], by their quality", records)


def _arenas(
    methods: Methods, setting: Setting, progress: Progress
) -> dict[str, dict[str, ArenaScores]]:
    scores: dict[str, dict[str, ArenaScores]] = {}
    for name, file in ARENAS.items():
        path = setting.recording(file)
        if path is None:
            continue
        arena = load_arena(path, ARENA_A_FRAME * setting.frames)
        scores[name] = {}
        for method, extractor in methods.items():
            progress(f"{name}: {method}")
            scores[name][method] = arena_scores(arena, extractor)
    return scores


def _arena_tables(scores: Mapping[str, Mapping[str, ArenaScores]]) -> list[Table]:
    if not scores:
        return []
    figures = {name: _summaries(found) for name, found in scores.items()}
    records = []
    for method in next(iter(figures.values())):
        record: dict[str, object] = {"method": method}
        for name, found in figures.items():
            record[f"{name}: recall"] = found[method]["recall"]
            record[f"{name}: median error [mm]"] = 1e3 * found[method]["median_error"]
        records.append(record)
    demanded = ", ".join(
        f"{next(iter(found.values())).corners.counts.true} ({name})"
        for name, found in scores.items()
    )
    note = f"Corners of which both walls show: {demanded}. They are found within 0.1 m."
    return [Table.of_records("Corners of the arena", records, note)]
