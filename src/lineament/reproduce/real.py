"""All methods on all recordings, by measures that need no truth; the corners of an arena."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

from ..errors import LogError
from ..evaluation.counts import Summable
from ..evaluation.free_space import FreeSpaceScores, free_space_scores
from ..evaluation.kinds import vertices
from ..evaluation.repeatability import (
    RankedRepeats,
    Repeatability,
    ranked_repeats,
    repeatability,
)
from ..evaluation.standing import StandingScores, standing_scores
from ..extractor import Extractor
from ..logs import find_logs
from ..scan import LaserScan
from .arena import ARENAS, arena_figure, arena_scores, load_arena
from .contenders import feature_methods
from .findings import NO_RECORDINGS, Columns, Findings, Progress, Setting, Table, each
from .scans import STANDING, scan_pairs, spread_scans, still_pairs

#: Method whose quality is compared with the repeats.
SHOWN = "optimal"
#: Logs with corrected poses, in which corners are looked for again.
LOGS = {
    "Intel lab": "truth/intel_graph.npz",
    "fr079": "truth/fr079_graph.npz",
    "MIT CSAIL": "carmen/csail-corrected.log.gz",
    "ACES": "carmen/aces-corrected.log.gz",
}
#: For each frame of the setting: scans of each recording, pairs of successive scans of a sensor
#: that stands, pairs of scans from different places, scans of each arena.
SCANS_A_FRAME, STILL_A_FRAME, PAIRS_A_FRAME, ARENA_A_FRAME = 3, 10, 12, 10
#: Share of the corners that must be repeated, and the bounds of the bins of quality.
RATE, QUALITIES = 0.8, (0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)

#: Titles of the tables of free space, and the numbers that they show.
FREE_SPACE: Columns = {
    "Phantom metres in 100 m of segments": ("phantom_in_100m", 1),
    "Longest phantom stretch [m]": ("longest_phantom", 1),
    "Scans with a phantom stretch of more than 0.3 m [%]": ("phantom_scans", 100),
    "Covered measurements [%]": ("covered", 100),
}
_STANDING: Columns = {
    "NEES": ("nees_median", 1),
    "in 95 % ellipse [%]": ("in_95_ellipse", 100),
    "found again [%]": ("found_again", 100),
    "pairs": ("pairs", 1),
}
_AT = f"repeated at {100 * RATE:.0f} %"
_REPEATS: Columns = {
    "corners expected": ("expected", 1),
    "repeated [%]": ("rate", 100),
    "by chance [%]": ("chance", 100),
    "AUC of quality": ("auc", 1),
    _AT: ("count", 1),
    "without edges: AUC": ("auc_without_edges", 1),
    f"without edges: {_AT}": ("count_without_edges", 1),
}
_REPEATABILITY: Columns = {
    "corners a scan": ("corners_per_scan", 1),
    "corners expected": ("corners_expected", 1),
    "corners repeated [%]": ("corner_rate", 100),
    "distance of corners, RMS [mm]": ("corner_rmse", 1e3),
    "segments expected": ("segments_expected", 1),
    "segments repeated [%]": ("segment_rate", 100),
    "distance of segments, RMS [mm]": ("segment_rmse", 1e3),
}
_ARENA: Columns = {
    "recall": ("recall", 1),
    "median error [mm]": ("median_error", 1e3),
    "at no real corner, of those found": ("false", 1),
    "corners a scan": ("corners_per_scan", 1),
}

S = TypeVar("S", bound=Summable)
#: Scores by recording and method.
Scored = dict[str, dict[str, S]]


def run(setting: Setting, progress: Progress) -> Findings:
    """Measure every method on all recordings."""
    title, logs = "Real scans", _logs(setting)
    if not logs:
        return Findings(title, (NO_RECORDINGS,))
    methods, frames = feature_methods(setting, progress), setting.frames
    unread: list[str] = []

    def scored(
        what: str,
        kind: type[S],
        read: Callable[[str, Path], Sequence[Any]],
        measure: Callable[[Any, Extractor], S],
    ) -> Scored[S]:
        """Score all methods on what is read of each log."""
        found: Scored[S] = {}
        for log, path in logs.items():
            try:
                items = [] if log in unread else read(log, path)
            except LogError:
                unread.append(log)
                continue
            for method, extract in each(methods, progress, f"{what}, {log}") if items else ():
                total = kind.total(measure(item, extract) for item in items)
                found.setdefault(log, {})[method] = total
        return found

    free = scored(
        *("free space", FreeSpaceScores),
        lambda _, path: spread_scans(path, SCANS_A_FRAME * frames),
        lambda scan, extract: free_space_scores(scan, extract(scan)),
    )
    standing = scored(
        *("standing still", StandingScores),
        lambda log, path: still_pairs(path, STILL_A_FRAME * frames, standing=log in STANDING),
        lambda pair, extract: standing_scores(map(extract, pair)),
    )
    repeats: dict[str, dict[str, dict[str, float]]] = {}
    ranked: dict[str, RankedRepeats] = {}
    for log, path in setting.recordings(LOGS).items():
        pairs = scan_pairs(path, PAIRS_A_FRAME * frames)
        for method, extract in each(methods, progress, f"repeated corners, {log}") if pairs else ():
            every, numbers = _repeats(pairs, extract)
            repeats.setdefault(log, {})[method] = numbers
            if method == SHOWN:
                ranked[log] = every
    arenas, arena_tables, figures = {}, [], []
    for name, path in setting.recordings(ARENAS).items():
        arena = load_arena(path, ARENA_A_FRAME * frames)
        scores = {m: arena_scores(arena, e) for m, e in each(methods, progress, name)}
        arenas[name] = {method: of for method, (of, _) in scores.items()}
        about = f"Corners of the {name}: {len(arena.scans)} scans"
        arena_tables.append(Table.of_numbers(about, arenas[name], _ARENA))
        figures.append(arena_figure(name, arena, scores))
    return Findings(
        title,
        (*_TEXT, *([f"Left out, as they hold no scans: {', '.join(unread)}."] if unread else [])),
        (
            *_free_space_tables(free),
            *_standing_tables(standing),
            *(
                Table.of_numbers(f"{log}: {about}", found, columns)
                for log, found in repeats.items()
                for about, columns in (
                    ("repeated corners, ranked by quality", _REPEATS),
                    ("features but edges found again", _REPEATABILITY),
                )
            ),
            *_quality_table(ranked),
            *arena_tables,
        ),
        tuple(figures),
        {
            "free_space": {
                log: {method: of.summary() for method, of in found.items()}
                for log, found in free.items()
            },
            "standing": {
                log: {
                    method: {"segments": of.segments.bins(), "corners": of.corners.bins()}
                    for method, of in found.items()
                }
                for log, found in standing.items()
            },
            "repeats": repeats,
            "arena": arenas,
        },
    )


_TEXT = (
    "Free space: segments are sampled every 2 cm. A sample is phantom if the three beams around it "
    "all continued by more than 0.2 m, or all ended more than 0.2 m before. A measurement is "
    "covered within 5 cm and 1 % of its range of a segment or an arc.",
    "Standing still: the same feature in two successive scans, normalised by the sum of their "
    "covariances. NEES is the median, 1 is right; the 95 % ellipse should hold 95 %. Bins are the "
    "number of measurements of the feature, or of the shorter arm of a corner.",
    "Repeated corners: those of one scan found in another from elsewhere within 0.1 m, ranked by "
    "quality, chance subtracted. The count is how many are repeated among the best of which "
    f"{100 * RATE:.0f} % are. AUC: probability that a repeated corner has the higher quality. The "
    "errors of the corrected poses, some 2 to 5 cm, are part of the distances. A method that finds "
    "a corner at every other point repeats many by chance: see the corners per scan.",
    "Arena: corners of which a scan shows both walls, found within 0.1 m. Walls and poses are "
    "known to about 1 cm, and the walls bow by 13 to 23 mm rms: smaller errors mean nothing, and "
    "where a wall bends there may be a corner that is not listed.",
)


def _logs(setting: Setting) -> dict[str, Path]:
    """Find all logs of the folder of recordings, by their names in it."""
    if setting.data is None:
        return {}
    try:
        paths = [Path(path) for path in find_logs(setting.data)]
    except LogError:
        return {}
    return {path.relative_to(setting.data).as_posix(): path for path in paths}


def _totals(scored: Scored[S], kind: type[S]) -> dict[str, S]:
    methods = next(iter(scored.values()), {})
    return {m: kind.total(found[m] for found in scored.values()) for m in methods}


def _free_space_tables(scored: Scored[FreeSpaceScores]) -> list[Table]:
    """Make one table for each number: a row for each recording, and one for all of them."""
    rows = {**scored, "all": _totals(scored, FreeSpaceScores)}
    methods, tables = list(rows["all"]), []
    for title, (key, factor) in FREE_SPACE.items():
        records = [
            {"recording": log}
            | {m: factor * found[m].summary().get(key, math.nan) for m in methods}
            | {"scans": len(found[methods[0]].longest)}
            for log, found in rows.items()
            if methods
        ]
        tables += [Table.of_records(title, records)] if records else []
    return tables


def _standing_tables(scored: Scored[StandingScores]) -> list[Table]:
    """Make tables of all methods on all recordings together, by kind of feature."""
    totals, tables = _totals(scored, StandingScores), []
    for kind in ("segments", "corners") if totals else ():
        records = [
            {"method": name}
            | {
                f"{bin_}: {label}": factor * of[key]
                for bin_, of in getattr(scores, kind).bins().items()
                for label, (key, factor) in _STANDING.items()
            }
            for name, scores in totals.items()
        ]
        tables.append(Table.of_records(f"Standing still: {kind}, by measurements", records))
    return tables


def _repeats(
    pairs: Sequence[tuple[LaserScan, LaserScan]], extract: Extractor
) -> tuple[RankedRepeats, dict[str, float]]:
    """Return the ranked corners of all pairs both ways, and their numbers."""
    found = [(a, extract(a), b, extract(b)) for a, b in pairs]
    views = [view for a, fa, b, fb in found for view in ((a, fa, b, fb), (b, fb, a, fa))]
    again = Repeatability.total(repeatability(*view) for view in views)
    every, alone = (
        RankedRepeats.total(
            ranked_repeats(a, of(fa), b, of(fb), of(fb).corners["quality"])
            for a, fa, b, fb in views
        )
        for of in (replace, lambda features: replace(features, corners=vertices(features)))
    )
    return every, {
        "expected": len(every.scores),
        "rate": every.rate,
        "auc": every.auc,
        "count": every.count_at(RATE),
        "chance": float(every.chance.mean()) if len(every.chance) else 0.0,
        "count_without_edges": alone.count_at(RATE),
        "auc_without_edges": alone.auc,
        "corners_per_scan": sum(len(vertices(features)) for _, features, _, _ in found)
        / len(found),
        "corners_expected": again.corners.expected,
        "corner_rate": again.corners.rate,
        "corner_rmse": again.corners.rmse,
        "segments_expected": again.segments.expected,
        "segment_rate": again.segments.rate,
        "segment_rmse": again.segments.rmse,
    }


def _quality_table(ranked: Mapping[str, RankedRepeats]) -> list[Table]:
    """Compare the share that is found again with what the quality promises."""
    records = [
        {"log": log}
        | {f"{a:.1f}–{b:.1f}": 100 * every.rate_between(a, b) for a, b in pairwise(QUALITIES)}
        for log, every in ranked.items()
    ]
    title = f"Corners of {SHOWN} found again [%], by their quality"
    return [Table.of_records(title, records)] if records else []
