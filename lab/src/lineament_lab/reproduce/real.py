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
from .experiment import NO_RECORDINGS, Experiment, Measured, Report
from .findings import Columns, Figure, Numbers, Progress, Setting, Table, column, each
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
    "Phantom metres in 100 m of segments": "phantom_in_100m",
    "Longest phantom stretch [m]": "longest_phantom",
    "Scans with a phantom stretch of more than 0.3 m [%]": "phantom_scans",
    "Covered measurements [%]": "covered",
}
STANDING_STILL: Columns = {
    "NEES, median": "nees_median",
    "in the 95 % ellipse [%]": "in_95_ellipse",
    "found again [%]": "found_again",
    "pairs": "pairs",
}
_AT = f"repeated among the best, of which {100 * RATE:.0f} % are"
REPEATS: Columns = {
    "Corners: expected in the other scan": "expected",
    "Corners: repeated, less chance [%]": "rate",
    "Corners: repeated by chance [%]": "chance",
    "Corners: AUC of the quality": "auc",
    f"Corners: {_AT}": "count",
    "Corners alone: AUC of the quality": "auc_without_edges",
    f"Corners alone: {_AT}": "count_without_edges",
    "Corners alone: in a scan": "corners_per_scan",
    "Corners alone: repeated [%]": "corner_rate",
    "Corners alone: repeated of the fewer [%]": "fewer_rate",
    "Corners alone: distance, RMS [mm]": "corner_rmse",
    "Segments: repeated [%]": "segment_rate",
    "Segments: distance, RMS [mm]": "segment_rmse",
}
ARENA: Columns = {
    "Corners of the arena: recall [%]": "recall",
    "Corners of the arena: error, median [mm]": "median_error",
    "Corners of the arena: at no real corner, of those found [%]": "false",
    "Corners of the arena: in a scan": "corners_per_scan",
}

S = TypeVar("S", bound=Summable)
#: Scores by recording and method.
Scored = dict[str, dict[str, S]]


def measure(setting: Setting, progress: Progress) -> Measured:
    """Measure every method on all recordings."""
    logs, doubles = distinct(_logs(setting))
    if not logs:
        raise NO_RECORDINGS
    methods, frames = feature_methods(setting.methods), setting.frames
    unread: list[str] = []

    def scored(
        what: str,
        kind: type[S],
        read: Callable[[str, Path], Sequence[Any]],
        measured: Callable[[Any, Extractor], S],
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
                total = kind.total(measured(item, extract) for item in items)
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
    ranked: Scored[RankedRepeats] = {}
    for log, path in setting.recordings(LOGS | FURTHER_LOGS).items():
        pairs = scan_pairs(path, PAIRS_A_FRAME * frames)
        for method, extract in each(methods, progress, f"repeated corners, {log}") if pairs else ():
            found = _repeats(pairs, extract)
            ranked.setdefault(log, {})[method], repeats.setdefault(log, {})[method] = found
    arenas = {}
    for name, path in setting.recordings(ARENAS).items():
        arena = load_arena(path, ARENA_A_FRAME * frames)
        scores = {m: arena_scores(arena, e) for m, e in each(methods, progress, name)}
        arenas[name] = arena, scores
    numbers = {
        "pooled": _pooled(free, standing),
        "doubles": doubles,
        "unread": unread,
        "free_space": _numbers(free, FreeSpaceScores.summary),
        "free_space_all": {m: of.summary() for m, of in _totals(free, FreeSpaceScores).items()},
        "standing": _numbers(standing, _of_standing(ScatterScores.bins)),
        "standing_figures": _numbers(standing, _of_standing(ScatterScores.figures)),
        "standing_all": {
            method: _of_standing(ScatterScores.bins)(of)
            for method, of in _totals(standing, StandingScores).items()
        },
        "repeats": repeats,
        "quality": {log: _by_quality(of[SHOWN]) for log, of in ranked.items()},
        "arena": {
            name: {method: of for method, (of, _) in scores.items()}
            for name, (_, scores) in arenas.items()
        },
    }
    return Measured(
        numbers,
        lambda: [*_curves(ranked), *(arena_figure(name, *of) for name, of in arenas.items())],
    )


def report(n: Any, _: Setting) -> Report:
    """Make the pooled tables, and one for each measure: recordings are rows, methods columns."""
    unread, doubles = (", ".join(n[key]) for key in ("unread", "doubles"))
    text = (
        *_TEXT,
        *([f"Left out, as they hold no scans: {unread}."] if unread else []),
        *([f"Left out, as others have the same scans: {doubles}."] if doubles else []),
    )
    title = f"Corners of {SHOWN} found again [%], by their quality"
    quality = {name: (name, 100.0) for name in next(iter(n["quality"].values()), ())}
    return text, (
        *(pooled_table(_POOLS[about], rows) for about, rows in n["pooled"].items()),
        *_tables({**n["free_space"], "all": n["free_space_all"]}, FREE_SPACE),
        *(table for kind in ("segments", "corners") for table in _standing(n, kind)),
        *_tables(n["repeats"], REPEATS),
        *([Table.of_numbers(title, n["quality"], quality, first="recording")] if quality else []),
        *_tables(n["arena"], ARENA),
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


def _of_standing(figures: Callable[[ScatterScores], Any]) -> Callable[[StandingScores], Any]:
    """Return what takes figures of both kinds of features."""
    return lambda of: {"segments": figures(of.segments), "corners": figures(of.corners)}


def _pooled(free: Scored[FreeSpaceScores], standing: Scored[StandingScores]) -> dict[str, Any]:
    """Pool the scores of all buildings, and of those on which nothing was chosen."""
    pools = {
        about: pooled(*(by_building(_only(of, chosen)) for of in (free, standing)))
        for about, chosen in (("all", False), ("nothing chosen", True))
    }
    return {about: rows for about, rows in pools.items() if rows}


def _tables(numbers: Numbers, columns: Columns, about: str = "") -> list[Table]:
    """Make one table for each measure: recordings are its rows, methods its columns."""
    methods = next(iter(numbers.values()), ())
    return [
        Table.of_numbers(
            f"{about}{title}",
            {log: {m: of.get(key) for m, of in found.items()} for log, found in numbers.items()},
            {method: (method, factor) for method in methods},
            first="recording",
        )
        for title in columns
        for key, factor in [column(columns, title)]
        if any(numbers.values())
    ]


def _standing(n: Any, kind: str) -> list[Table]:
    """Make the tables of one kind of feature; the last rows are of all recordings, by arms."""
    rows = {
        log: {method: figures[kind] for method, figures in found.items()}
        for log, found in n["standing_figures"].items()
    }
    for name in ScatterScores().bins() if n["standing_all"] else ():
        rows[f"all, {name} measurements"] = {
            method: bins[kind][name] for method, bins in n["standing_all"].items()
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


def _by_quality(ranked: RankedRepeats) -> dict[str, float]:
    """Return the share that is found again, by what the quality promises."""
    return {f"{a:.1f}–{b:.1f}": ranked.rate_between(a, b) for a, b in pairwise(QUALITIES)}


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


EXPERIMENT = Experiment("Real scans", measure, report, once=True)
