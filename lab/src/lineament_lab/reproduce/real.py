"""All methods on all recordings, by measures that need no truth; the corners of an arena."""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

from lineament.errors import LogError
from lineament.extractor import Extractor
from lineament.logs import find_logs, open_log
from lineament.output import canvas
from lineament.scan import Array

from ..evaluation.arena import ARENAS, Arena, arena_scores, load_arena
from ..evaluation.counts import Summable
from ..evaluation.free_space import FreeSpaceScores, free_space_scores
from ..evaluation.pooling import distinct, pools
from ..evaluation.repeatability import RankedRepeats, score_pairs
from ..evaluation.standing import ScatterScores, StandingScores, standing_scores
from .contenders import corner_methods, feature_methods
from .experiment import Experiment, Measured, MissingError, Report
from .findings import Columns, Figure, Numbers, Progress, Setting, Table, column, each
from .prose import prose
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

_POOLED: Columns = {
    "phantom m in 100 m": "phantom_in_100m",
    "covered [%]": "covered",
    "NEES still, segments": "segments_nees",
    "NEES still, corners": "corners_nees",
}

#: Titles of the pooled tables.
_POOLS = {
    "all": "All buildings",
    "nothing chosen": "Recordings on which nothing was chosen",
}

T = TypeVar("T")
U = TypeVar("U")
S = TypeVar("S", bound=Summable)
#: Scores by recording and method.
Scored = dict[str, dict[str, S]]
Figures = dict[str, dict[str, Any]]


def measure(setting: Setting, progress: Progress) -> Measured:
    """Measure every method on all recordings."""
    logs, doubles = distinct(_logs(setting), STANDING)
    if not logs:
        raise MissingError("no recordings")
    frames, unread = setting.frames, list[str]()

    def scored(
        what: str,
        logs: Mapping[str, Path],
        methods: Mapping[str, Extractor],
        read: Callable[[str, Path], Sequence[T]],
        score: Callable[[Sequence[T], Extractor], U],
    ) -> dict[str, dict[str, U]]:
        """Score methods on what is read of each log."""
        found: dict[str, dict[str, U]] = {}
        for log, path in logs.items():
            try:
                items = [] if log in unread else read(log, path)
            except LogError:
                unread.append(log)
                continue
            for method, extract in each(methods, progress, f"{what}, {log}") if items else ():
                found.setdefault(log, {})[method] = score(items, extract)
        return found

    methods = feature_methods(setting.methods)
    free = scored(
        *("free space", logs, methods),
        lambda _, path: spread_scans(open_log(path, keep_going=True), SCANS_A_FRAME * frames),
        lambda scans, of: FreeSpaceScores.total(free_space_scores(s, of(s)) for s in scans),
    )
    standing = scored(
        *("standing still", logs, methods),
        lambda log, path: still_pairs(path, STILL_A_FRAME * frames, standing=log in STANDING),
        lambda pairs, of: StandingScores.total(standing_scores(map(of, pair)) for pair in pairs),
    )
    methods = corner_methods(setting.methods)
    again = scored(
        *("repeated corners", setting.recordings(LOGS | FURTHER_LOGS), methods),
        lambda _, path: scan_pairs(path, PAIRS_A_FRAME * frames),
        lambda pairs, of: score_pairs(pairs, of, RATE),
    )
    arenas, found = {}, {}
    for name, path in setting.recordings(ARENAS).items():
        arenas[name] = arena = load_arena(path, ARENA_A_FRAME * frames)
        found[name] = {m: arena_scores(arena, of) for m, of in each(methods, progress, name)}
    ranked = _numbers(again, lambda of: of[0])
    every = {"all": _totals(free, FreeSpaceScores)} if free else {}
    numbers = {
        "pooled": pools(free, standing),
        "doubles": doubles,
        "unread": unread,
        "free_space": _numbers(free, FreeSpaceScores.summary),
        "free_space_all": _numbers(every, FreeSpaceScores.summary),
        "standing": _numbers(
            standing, lambda of: {"segments": of.segments.bins(), "corners": of.corners.bins()}
        ),
        "scatter": {kind: _scatter(standing, kind) for kind in ("segments", "corners")},
        "repeats": _numbers(again, lambda of: of[1]),
        "quality": {log: _by_quality(of[SHOWN]) for log, of in ranked.items()},
        "arena": _numbers(found, lambda of: of[0]),
    }
    return Measured(
        numbers,
        lambda: [*_curves(ranked), *(arena_figure(n, arenas[n], of) for n, of in found.items())],
    )


def report(n: Any, _: Setting) -> Report:
    """Make the pooled tables, and one for each measure: recordings are rows, methods columns."""
    unread, doubles = (", ".join(n[key]) for key in ("unread", "doubles"))
    text = (
        *prose("real", rate=100 * RATE),
        *([f"Left out, as they hold no scans: {unread}."] if unread else []),
        *([f"Left out, as others have the same scans: {doubles}."] if doubles else []),
    )
    title = f"Corners of {SHOWN} found again [%], by their quality"
    quality = {name: (name, 100.0) for name in next(iter(n["quality"].values()), ())}
    return text, (
        *(pooled_table(_POOLS[about], rows) for about, rows in n["pooled"].items()),
        *_tables(n["free_space"] | n["free_space_all"], FREE_SPACE),
        *_tables(n["scatter"]["segments"], STANDING_STILL, "Standing still, segments: "),
        *_tables(n["scatter"]["corners"], STANDING_STILL, "Standing still, corners: "),
        *_tables(n["repeats"], REPEATS),
        Table.of_numbers(title, n["quality"], quality, first="recording"),
        *_tables(n["arena"], ARENA),
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


def _numbers(scored: Mapping[str, Mapping[str, T]], figures: Callable[[T], Any]) -> Figures:
    """Return figures of the scores by recording and method."""
    return {log: {m: figures(of) for m, of in found.items()} for log, found in scored.items()}


def _scatter(standing: Scored[StandingScores], kind: str) -> Numbers:
    """Return the figures of one kind of feature by recording, then of all, by arms."""
    rows = _numbers(standing, lambda of: getattr(of, kind).figures())
    bins = {m: getattr(of, kind).bins() for m, of in _totals(standing, StandingScores).items()}
    for name in ScatterScores().bins() if bins else ():
        rows[f"all, {name} measurements"] = {method: of[name] for method, of in bins.items()}
    return rows


def pooled_table(title: str, rows: Mapping[str, Mapping[str, Any]]) -> Table:
    """Make the table of what is pooled: a row for each method."""
    (note,) = prose("notes of real", **next(iter(rows.values())))
    return Table.of_numbers(title, rows, _POOLED, note)


def _tables(numbers: Numbers, columns: Columns, about: str = "") -> list[Table]:
    """Make one table for each measure: recordings are its rows, methods its columns."""
    methods = next(iter(numbers.values()), ())
    tables = []
    for title in columns:
        key, factor = column(columns, title)
        rows = {log: {m: of.get(key) for m, of in found.items()} for log, found in numbers.items()}
        shown = {method: (method, factor) for method in methods}
        tables.append(Table.of_numbers(about + title, rows, shown, first="recording"))
    return tables


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
    return [Figure.of("repeated-corners", figure, first=FIRST + 1)]


def arena_figure(
    name: str, arena: Arena, scores: Mapping[str, tuple[Mapping[str, float], Array]]
) -> Figure:
    """Draw the corners that the methods found in all scans, on the map of the arena."""
    scores = {method: found for method, found in scores.items() if len(found[1])}
    figure, panels = canvas.new_panels(len(scores), 4)
    ends = arena.walls.segments.reshape(-1, 2)
    for axes, (method, (numbers, positions)) in zip(panels, scores.items(), strict=True):
        about = f"found {100 * numbers['recall']:.0f} %, false {100 * numbers['false']:.0f} %"
        canvas.style_plane(axes, method, about, ends)
        axes.plot(*ends.reshape(-1, 2, 2).T, color=canvas.INK)
        axes.plot(*arena.corners.T, "o", mfc="none", mec=canvas.FAINT)
        axes.plot(*positions.T, ".", color=canvas.CORNER_COLOR)
    return Figure.of(name.replace(", ", "-"), figure, "arena", where=name)


EXPERIMENT = Experiment("Real scans", measure, report, once=True)
