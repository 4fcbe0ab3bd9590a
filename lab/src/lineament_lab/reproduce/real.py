"""All methods on all recordings, by measures that need no truth; the corners of an arena."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

from lineament.errors import LogError
from lineament.extractor import Extractor
from lineament.logs import find_logs
from lineament.output import canvas
from lineament.scan import LaserScan

from ..evaluation.counts import Summable, ratio
from ..evaluation.free_space import FreeSpaceScores, free_space_scores
from ..evaluation.repeatability import (
    RankedRepeats,
    Repeatability,
    ranked_repeats,
    repeatability,
    with_edges,
)
from ..evaluation.standing import ScatterScores, StandingScores, standing_scores
from .arena import ARENAS, arena_figure, arena_scores, load_arena
from .contenders import corner_methods, feature_methods
from .findings import (
    NO_RECORDINGS,
    Columns,
    Figure,
    Findings,
    Numbers,
    Progress,
    Setting,
    Table,
    cells,
    each,
)
from .recordings import BUILDINGS, by_building, distinct, pooled, pooled_table
from .scans import STANDING, scan_pairs, spread_scans, still_pairs

#: Method whose quality is compared with the repeats.
SHOWN = "optimal"
#: Logs with corrected poses, in which corners are looked for again: those that the quality was
#: fitted to, and further ones.
LOGS = {
    "Intel lab": "truth/intel_graph.npz",
    "fr079": "truth/fr079_graph.npz",
    "MIT CSAIL": "carmen/csail-corrected.log.gz",
    "ACES": "carmen/aces-corrected.log.gz",
}
FURTHER_LOGS = {
    "Acapulco": "carmen/acapulco-corrected.log.gz",
    "MIT Killian Court": "graph/killian.g2o.zip",
    "arena, moving": "truth/jackal_mocap_02171554.npz",
}
#: For each frame of the setting: scans of each recording, pairs of successive scans of a sensor
#: that stands, pairs of scans from different places, scans of each arena.
SCANS_A_FRAME, STILL_A_FRAME, PAIRS_A_FRAME, ARENA_A_FRAME = 3, 10, 12, 10
#: The curves of repeated corners begin behind so many, as a few scatter.
FIRST = 9
#: Share of the corners that must be repeated, and the bounds of the bins of quality.
RATE, QUALITIES = 0.8, (0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)

#: Titles of the tables, and the numbers that they show.
FREE_SPACE: Columns = {
    "Phantom metres in 100 m of segments": ("phantom_in_100m", 1),
    "Longest phantom stretch [m]": ("longest_phantom", 1),
    "Scans with a phantom stretch of more than 0.3 m [%]": ("phantom_scans", 100),
    "Covered measurements [%]": ("covered", 100),
}
STANDING_STILL: Columns = {
    "NEES, median": ("nees_median", 1),
    "in the 95 % ellipse [%]": ("in_95_ellipse", 100),
    "found again [%]": ("found_again", 100),
    "pairs": ("pairs", 1),
}
_AT = f"repeated among the best, of which {100 * RATE:.0f} % are"
REPEATS: Columns = {
    "Corners: expected in the other scan": ("expected", 1),
    "Corners: repeated, less chance [%]": ("rate", 100),
    "Corners: repeated by chance [%]": ("chance", 100),
    "Corners: AUC of the quality": ("auc", 1),
    f"Corners: {_AT}": ("count", 1),
    "Corners alone: AUC of the quality": ("auc_without_edges", 1),
    f"Corners alone: {_AT}": ("count_without_edges", 1),
    "Corners alone: in a scan": ("corners_per_scan", 1),
    "Corners alone: repeated [%]": ("corner_rate", 100),
    "Corners alone: repeated of the fewer [%]": ("fewer_rate", 100),
    "Corners alone: distance, RMS [mm]": ("corner_rmse", 1e3),
    "Segments: repeated [%]": ("segment_rate", 100),
    "Segments: distance, RMS [mm]": ("segment_rmse", 1e3),
}
ARENA: Columns = {
    "Corners of the arena: recall [%]": ("recall", 100),
    "Corners of the arena: error, median [mm]": ("median_error", 1e3),
    "Corners of the arena: at no real corner, of those found [%]": ("false", 100),
    "Corners of the arena: in a scan": ("corners_per_scan", 1),
}

S = TypeVar("S", bound=Summable)
#: Scores by recording and method.
Scored = dict[str, dict[str, S]]


def run(setting: Setting, progress: Progress) -> Findings:
    """Measure every method on all recordings."""
    title, (logs, doubles) = "Real scans", distinct(_logs(setting))
    if not logs:
        return Findings(title, (NO_RECORDINGS,))
    methods, frames = feature_methods(setting.methods), setting.frames
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
    methods = corner_methods(setting.methods)
    repeats: dict[str, dict[str, dict[str, float]]] = {}
    ranked: dict[str, dict[str, RankedRepeats]] = {}
    for log, path in setting.recordings(LOGS | FURTHER_LOGS).items():
        pairs = scan_pairs(path, PAIRS_A_FRAME * frames)
        for method, extract in each(methods, progress, f"repeated corners, {log}") if pairs else ():
            found = _repeats(pairs, extract)
            ranked.setdefault(log, {})[method], repeats.setdefault(log, {})[method] = found
    arenas, figures = {}, []
    for name, path in setting.recordings(ARENAS).items():
        arena = load_arena(path, ARENA_A_FRAME * frames)
        scores = {m: arena_scores(arena, e) for m, e in each(methods, progress, name)}
        arenas[name] = {method: of for method, (of, _) in scores.items()}
        figures.append(arena_figure(name, arena, scores))
    pools = {
        about: pooled(*(by_building(_only(of, chosen)) for of in (free, standing)))
        for about, chosen in (("all", False), ("nothing chosen", True))
    }
    pools = {about: rows for about, rows in pools.items() if rows}
    numbers = {
        "pooled": pools,
        "doubles": doubles,
        "free_space": _numbers(free, FreeSpaceScores.summary),
        "standing": _numbers(
            standing, lambda of: {"segments": of.segments.bins(), "corners": of.corners.bins()}
        ),
        "repeats": repeats,
        "arena": arenas,
    }
    every_free = {**free, "all": _totals(free, FreeSpaceScores)}
    return Findings(
        title,
        (
            *_TEXT,
            *([f"Left out, as they hold no scans: {', '.join(unread)}."] if unread else []),
            *([f"Left out, as others have the same scans: {', '.join(doubles)}."] * bool(doubles)),
        ),
        (
            *(pooled_table(_POOLS[about], rows) for about, rows in pools.items()),
            *_tables(_numbers(every_free, FreeSpaceScores.summary), FREE_SPACE),
            *(table for kind in ("segments", "corners") for table in _standing(standing, kind)),
            *_tables(repeats, REPEATS),
            *_quality_table(ranked),
            *_tables(arenas, ARENA),
        ),
        (*_curves(ranked), *figures),
        numbers,
    )


#: Titles of the pooled tables.
_POOLS = {
    "all": "All buildings",
    "nothing chosen": "Recordings on which nothing was chosen",
}
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
    "a corner at every other point repeats many, as there is always one near, and turns about the "
    "sensor do not show that: see the corners per scan. ‘Of the fewer’ is the repeatability that "
    "keypoints are compared by (Mikolajczyk and Schmid 2005): pairs within 0.1 m over the fewer of "
    "both scans’ corners that the other scan can see; chance is not subtracted.",
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


def _only(scored: Scored[S], unknown: bool) -> Scored[S]:
    """Return the scores of all recordings, or of those on which nothing was chosen."""
    return {log: of for log, of in scored.items() if not (unknown and log in BUILDINGS)}


def _totals(scored: Scored[S], kind: type[S]) -> dict[str, S]:
    methods = next(iter(scored.values()), {})
    return {m: kind.total(found[m] for found in scored.values()) for m in methods}


def _numbers(scored: Scored[S], figures: Callable[[S], Any]) -> dict[str, dict[str, Any]]:
    return {log: {m: figures(of) for m, of in found.items()} for log, found in scored.items()}


def _tables(numbers: Numbers, columns: Columns, about: str = "") -> list[Table]:
    """Make one table for each measure: recordings are its rows, methods its columns."""
    return [
        Table.of_records(
            f"{about}{title}",
            [
                {"recording": log} | {m: cells(of, {m: column})[m] for m, of in found.items()}
                for log, found in numbers.items()
            ],
        )
        for title, column in columns.items()
        if any(numbers.values())
    ]


def _standing(scored: Scored[StandingScores], kind: str) -> list[Table]:
    """Make the tables of one kind of feature; the last rows are of all recordings, by arms."""
    totals = _totals(scored, StandingScores)
    rows = _numbers(scored, lambda of: getattr(of, kind).figures())
    for name in ScatterScores().bins() if totals else ():
        rows[f"all, {name} measurements"] = {
            method: getattr(of, kind).bins()[name] for method, of in totals.items()
        }
    return _tables(rows, STANDING_STILL, f"Standing still, {kind}: ")


def _repeats(
    pairs: Sequence[tuple[LaserScan, LaserScan]], extract: Extractor
) -> tuple[RankedRepeats, dict[str, float]]:
    """Return the ranked corners of all pairs both ways, and their numbers."""
    found = [(a, extract(a), b, extract(b)) for a, b in pairs]
    views = [view for a, fa, b, fb in found for view in ((a, fa, b, fb), (b, fb, a, fa))]
    each_way = [repeatability(*view) for view in views]
    again = Repeatability.total(each_way)
    both_ways = list(zip(each_way[::2], each_way[1::2], strict=True))
    every, alone = (
        RankedRepeats.total(
            ranked_repeats(a, of(fa), b, of(fb), of(fb).corners["quality"])
            for a, fa, b, fb in views
        )
        for of in (with_edges, replace)
    )
    return every, {
        "expected": len(every.scores),
        "rate": every.rate,
        "auc": every.auc,
        "count": every.count_at(RATE),
        "chance": float(every.chance.mean()) if len(every.chance) else 0.0,
        "count_without_edges": alone.count_at(RATE),
        "auc_without_edges": alone.auc,
        "rate_without_edges": alone.rate,
        "corners_per_scan": sum(len(features.corners) for _, features, _, _ in found) / len(found),
        "corners_expected": again.corners.expected,
        "corner_rate": again.corners.rate,
        "corner_rmse": again.corners.rmse,
        "fewer_rate": ratio(
            sum(min(a.corners.repeated, b.corners.repeated) for a, b in both_ways),
            sum(min(a.corners.expected, b.corners.expected) for a, b in both_ways),
        ),
        "segments_expected": again.segments.expected,
        "segment_rate": again.segments.rate,
        "segment_rmse": again.segments.rmse,
    }


def _quality_table(ranked: Scored[RankedRepeats]) -> list[Table]:
    """Compare the share that is found again with what the quality promises."""
    records = [
        {"recording": log}
        | {f"{a:.1f}–{b:.1f}": 100 * of[SHOWN].rate_between(a, b) for a, b in pairwise(QUALITIES)}
        for log, of in ranked.items()
    ]
    title = f"Corners of {SHOWN} found again [%], by their quality"
    return [Table.of_records(title, records)] if records else []


def _curves(ranked: Scored[RankedRepeats]) -> list[Figure]:
    """Draw how many corners are repeated against the share of them, as less certain ones come."""
    if not ranked:
        return []
    figure, panels = canvas.new_panels(len(ranked), 2)
    for axes, (log, found) in zip(panels, ranked.items(), strict=True):
        canvas.style(axes, log, "", "corners repeated", "share repeated [%]")
        for k, (method, of) in enumerate(found.items()):
            count, rate = (part[FIRST:] for part in of.curve())
            line = {"linestyle": "-" if k < len(canvas.PALETTE) else "--", "label": method}
            color = canvas.PALETTE[k % len(canvas.PALETTE)]
            axes.plot(count, 100 * rate, color=color, **line)
        axes.set_ylim(0, 100)
    canvas.add_legend(figure)
    caption = (
        "Corners found again from another place, less chance, ranked by their quality: how many "
        f"of the best, and which share of them, from the {FIRST + 1}th on. Further to the upper "
        "right is better."
    )
    return [Figure("repeated-corners", caption, canvas.figure_bytes(figure))]
