"""From `liu` to `optimal`, one change a row: what each buys in accuracy, and what it costs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...extractor import Extractor
from ...methods.optimal import PARTS
from ...simulation import SENSORS
from ..repeatability import Repeatability
from ..scores import Scores, evaluate
from .arena import ArenaScores, arena_scores, load_arena
from .charts import dot_chart
from .contenders import LIU_BEST, LIU_PAPER, liu_methods
from .findings import Figure, Findings, Progress, Setting, Table
from .frames import batch_of, frame_times, scene_numbers, simulated_frames
from .repeatability import repeats_of, scan_pairs

__all__ = ["NO_PARTS", "PUT_BACK", "ladder", "run"]

#: Names of the sensors, and the kinds of scenes.
SCANNERS, KINDS = ("paper", "utm30lx", "rplidar"), ("room", "corridor", "hall")
#: For each frame of the setting: scenes of each kind, scans of the arena, pairs of a real log.
SCENES_A_FRAME, SCANS_A_FRAME, PAIRS_A_FRAME = 3, 10, 4
#: Recordings with a moving or a turning robot: corners that are known, corners found again.
ARENA, LOG = "truth/jackal_static_data.npz", "truth/intel_graph.npz"

NO_PARTS = "optimal, no parts"
#: The parts of `optimal` in the order in which they are put back.
PUT_BACK = (
    "borders",
    "dissolving",
    "spikes",
    "growth",
    "arcs",
    "straightening",
    "unevenness",
)

#: Names of the columns, the figures of `Scores.summary` that they show, and what makes them larger
#: by how much.
_COLUMNS = {
    "corner F1": ("corner_f1_0.10", 1),
    "precision": ("corner_precision_0.10", 1),
    "recall": ("corner_recall_0.10", 1),
    "RMSE ÷ bound": ("corner_over_bound", 1),
    "median ÷ bound": ("corner_over_bound_median", 1),
    "corner NEES": ("corner_nees", 1),
    "segment F1": ("segment_f1", 1),
    "in pieces [%]": ("segment_fragmentation", 100),
    "segment NEES": ("segment_nees", 1),
    "partition F1": ("partition_region_f1", 1),
    "arc F1": ("arc_f1", 1),
}


@dataclass(frozen=True, slots=True, eq=False)
class _Simulated:
    """Scores of a row with a sensor, and the median time of a scan in the kernels [s]."""

    scores: Scores
    time: float

    def summary(self) -> dict[str, float]:
        return self.scores.summary() | {"time": self.time}


def ladder(setting: Setting, progress: Progress) -> dict[str, Extractor]:
    """Make the rows: `liu`, the classical way without its filter, and `optimal` part by part.

    Examples
    --------
    >>> set(PUT_BACK) == set(PARTS)
    True
    """
    liu = liu_methods(setting, progress)
    rows = {name: liu[name] for name in (LIU_PAPER, LIU_BEST)}
    rows |= {name: Extractor(name) for name in ("liu:scale_free", "iepf", "line_tracking")}
    rows[NO_PARTS] = Extractor("optimal", without=tuple(PARTS))
    for k, part in enumerate(PUT_BACK, 1):
        rows[f"… with {part}"] = Extractor("optimal", without=PUT_BACK[k:])
    return rows


def run(setting: Setting, progress: Progress) -> Findings:
    """Score every row on simulated scenes of three sensors, in the arena and in a real log."""
    rows = ladder(setting, progress)
    simulated = {name: _simulated(name, rows, setting, progress) for name in SCANNERS}
    tables = [_table(name, found) for name, found in simulated.items()]
    numbers: dict[str, object] = {
        name: {row: result.summary() for row, result in found.items()}
        for name, found in simulated.items()
    }
    recorded = _recorded(rows, setting, progress)
    if recorded:
        tables.append(_recorded_table(recorded))
        numbers["recordings"] = recorded
    progress("drawing")
    return Findings(
        "From liu to optimal, one change a row",
        _TEXT,
        tuple(tables),
        (_figure(simulated),),
        numbers,
    )


_TEXT = (
    "The first rows are the paper’s method with its own numbers, with the best of its Figure 9, "
    "and with the response that does not depend on range; then two classical methods, which cut "
    "unfiltered ranges. “optimal, no parts” clusters by incidence, merges stretches bottom-up by "
    "χ², fits by maximum likelihood and joins pieces where they meet; below it its parts are put "
    "back one by one, and the last row is the method as it is. A row shows what its part adds to "
    "those above: in another order the parts would share differently.",
    "The noise is estimated from each scan. Times are of the kernels, one thread.",
)


def _simulated(
    name: str, rows: Mapping[str, Extractor], setting: Setting, progress: Progress
) -> dict[str, _Simulated]:
    progress(f"{name}: simulating")
    numbers = scene_numbers(len(KINDS) * SCENES_A_FRAME * setting.frames, setting.seed)
    frames = list(simulated_frames(SENSORS[name], KINDS, numbers))
    scans = [frame.scan for frame in frames]
    found = {}
    for row, extractor in rows.items():
        progress(f"{name}: {row}")
        features = batch_of(extractor, scans)
        scores = map(evaluate, features, (frame.truth for frame in frames))
        time = float(np.median(frame_times(extractor, scans[: 2 * len(KINDS)])))
        found[row] = _Simulated(Scores.total(scores), time)
    return found


def _table(sensor: str, found: Mapping[str, _Simulated]) -> Table:
    records = []
    for row, result in found.items():
        figures = result.summary()
        cells: dict[str, object] = {
            column: factor * figures[key] if key in figures else None
            for column, (key, factor) in _COLUMNS.items()
        }
        records.append({"method": row, **cells, "time [µs]": 1e6 * result.time})
    scans = next(iter(found.values())).scores.scans
    return Table.of_records(f"{sensor}: {SENSORS[sensor].n_beams} beams, {scans} scans", records)


def _recorded(
    rows: Mapping[str, Extractor], setting: Setting, progress: Progress
) -> dict[str, dict[str, float]]:
    """Figures of the recordings that are there, by row."""
    figures: dict[str, dict[str, float]] = {}
    arena, log = setting.recording(ARENA), setting.recording(LOG)
    if arena is not None:
        loaded = load_arena(arena, SCANS_A_FRAME * setting.frames)
        for row, extractor in rows.items():
            progress(f"arena: {row}")
            figures[row] = _arena_figures(arena_scores(loaded, extractor))
    if log is not None:
        pairs = scan_pairs(log, PAIRS_A_FRAME * setting.frames)
        for row, extractor in rows.items():
            progress(f"Intel lab: {row}")
            figures[row] = figures.get(row, {}) | _log_figures(repeats_of(pairs, extractor))
    return figures


def _arena_figures(scores: ArenaScores) -> dict[str, float]:
    figures = scores.summary()
    return {
        "arena: recall": figures["recall"],
        "on no real corner": figures["false"],
        "median error [mm]": 1e3 * figures["median_error"],
    }


def _log_figures(repeats: Repeatability) -> dict[str, float]:
    return {
        "Intel lab: corners repeated": repeats.corners.repeated,
        "of those expected": repeats.corners.rate,
        "segments repeated": repeats.segments.rate,
    }


def _recorded_table(figures: Mapping[str, Mapping[str, float]]) -> Table:
    return Table.of_records(
        "Recordings: corners of the arena, and features found again in a log",
        [{"method": row, **of} for row, of in figures.items()],
    )


def _figure(found: Mapping[str, Mapping[str, _Simulated]]) -> Figure:
    shown = {
        "corner F1": ("corner_f1_0.10", 1.0),
        "corner RMSE ÷ bound": ("corner_over_bound", 1.0),
        "segment F1": ("segment_f1", 1.0),
        "time per scan [µs]": ("time", 1e6),
    }
    panels = {
        label: {
            sensor: {row: factor * r.summary().get(key, np.nan) for row, r in of.items()}
            for sensor, of in found.items()
        }
        for label, (key, factor) in shown.items()
    }
    return Figure(
        "ablation",
        "From liu to optimal (rows), with three sensors (colours).",
        dot_chart(panels, log_axes=frozenset({"corner RMSE ÷ bound", "time per scan [µs]"})),
    )
