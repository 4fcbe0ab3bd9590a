"""All methods on all sensors: what they find, how well, whether their covariances tell it, time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..evaluation.scores import Scores, evaluate
from ..simulation import SCENES, SENSORS
from .charts import dot_chart
from .contenders import LIU_NOTE, PARTITION_ONLY, every_method
from .findings import Figure, Findings, Progress, Setting, Table
from .frames import batch_of, frame_times, scene_numbers, simulated_frames

__all__ = ["run"]

#: Names of the columns, the figures of `_Result.summary` that they show, times what.
_COLUMNS = {
    "corner F1": ("corner_f1_0.10", 1),
    "precision": ("corner_precision_0.10", 1),
    "recall": ("corner_recall_0.10", 1),
    "median error [mm]": ("corner_median_error", 1e3),
    "÷ bound": ("corner_over_bound_median", 1),
    "÷ bound, RMS": ("corner_over_bound", 1),
    "corner NEES": ("corner_nees_median", 1),
    "corner NEES, mean": ("corner_nees", 1),
    "segment F1": ("segment_f1", 1),
    "offset RMS [mm]": ("segment_offset_rmse", 1e3),
    "offset ÷ bound": ("segment_offset_over_bound_median", 1),
    "angle ÷ bound": ("segment_angle_over_bound_median", 1),
    "segment NEES": ("segment_nees_median", 1),
    "segment NEES, mean": ("segment_nees", 1),
    "arc F1": ("arc_f1", 1),
    "partition": ("partition_success", 1),
    "time [µs]": ("time", 1e6),
}


@dataclass(frozen=True, slots=True, eq=False)
class _Result:
    """Scores of a method with a sensor, and the median time per scan [s]."""

    scores: Scores
    time: float

    def summary(self, method: str) -> dict[str, float]:
        """List all figures by name; without those of features that the method does not give."""
        figures = self.scores.summary() | {"time": self.time}
        missing = ("corner_", "segment_", "arc_") if method in PARTITION_ONLY else ()
        return {name: value for name, value in figures.items() if not name.startswith(missing)}


#: By method.
Results = Mapping[str, _Result]


def run(setting: Setting, progress: Progress) -> Findings:
    """Score all methods on frames of all kinds of scenes, for each sensor."""
    methods = every_method(setting, progress)
    numbers = scene_numbers(len(SCENES) * setting.frames, setting.seed)
    results: dict[str, dict[str, _Result]] = {}
    for name, sensor in SENSORS.items():
        progress(f"{name}: simulating")
        frames = list(simulated_frames(sensor, SCENES, numbers))
        scans = [frame.scan for frame in frames]
        results[name] = {}
        for method, extractor in methods.items():
            progress(f"{name}: {method}")
            found = batch_of(extractor, scans)
            scores = map(evaluate, found, (frame.truth for frame in frames))
            time = float(np.median(frame_times(extractor, scans[: len(SCENES)])))
            results[name][method] = _Result(Scores.total(scores), time)
    progress("drawing")
    return Findings(
        "All methods, by sensor",
        _text(results),
        tuple(_table(name, found) for name, found in results.items()),
        (_figure(results),),
        {name: {m: r.summary(m) for m, r in found.items()} for name, found in results.items()},
    )


def _text(results: Mapping[str, Results]) -> tuple[str, ...]:
    about = (
        "Simulated frames of all kinds of scenes, the same scenes for each sensor. The paper has "
        "no such table. Corners are right within 0.1 m; segments within 0.1 m, 10° and with half "
        "of their beams in common. Errors are those of what is right. ‘÷ bound’ is the median "
        "error over that of an estimate that reaches the Cramér-Rao bound; ‘RMS’ is the root of "
        "the mean square, which one gross error within the 0.1 m can rule. NEES is the median of "
        "the squared errors over the method’s own covariance, divided by what it should be: 1 is "
        "right, more is a method that trusts itself too much; ‘mean’ is their mean, likewise. "
        "Every method estimates the noise from the scan."
    )
    return about, _consistency(results), LIU_NOTE, _arcs(results)


def _consistency(results: Mapping[str, Results]) -> str:
    """Tell the 95 % intervals of the mean NEES, and how many rows of the tables lie in theirs."""
    rows = [r.summary(method) for found in results.values() for method, r in found.items()]
    told = ["Where covariances are right, the mean NEES lies in an interval with 95 % probability."]
    for kind in ("corner", "segment"):
        keys = (f"{kind}_nees_low", f"{kind}_nees", f"{kind}_nees_high")
        means = [tuple(row[key] for key in keys) for row in rows if keys[1] in row]
        if not means:
            continue
        means.sort(key=lambda mean: mean[2] - mean[0])
        (low, _, high), (lowest, _, highest) = means[0], means[-1]
        within = sum(below <= mean <= above for below, mean, above in means)
        told.append(
            f"For {kind}s this is {low:.2f} to {high:.2f} where most are right, {lowest:.2f} to "
            f"{highest:.2f} where fewest are; {within} of the {len(means)} rows lie in theirs."
        )
    return " ".join(told)


def _arcs(results: Mapping[str, Results]) -> str:
    """Tell which methods find arcs, and what the others make of round columns."""
    giving = [
        method
        for method in next(iter(results.values()))
        if any(found[method].scores.arcs.counts.found for found in results.values())
    ]
    return (
        f"Arcs are found by {', '.join(giving) or 'none of the methods'}. Without arcs, round "
        "columns become polygons with false corners."
    )


def _table(sensor: str, results: Results) -> Table:
    rows = []
    for method, result in results.items():
        figures = result.summary(method)
        cells: dict[str, object] = {
            column: factor * figures[key] if key in figures else None
            for column, (key, factor) in _COLUMNS.items()
        }
        rows.append({"method": method, **cells})
    scans = next(iter(results.values())).scores.scans
    return Table.of_records(
        f"{sensor}: {SENSORS[sensor].n_beams} beams, {scans} scans",
        rows,
        "A dash: nothing found, or nothing that defines the figure.",
    )


def _figure(results: Mapping[str, Results]) -> Figure:
    shown = {
        "corner F1": ("corner_f1_0.10", 1.0),
        "segment F1": ("segment_f1", 1.0),
        "corner error ÷ bound (median)": ("corner_over_bound_median", 1.0),
        "time per scan [µs]": ("time", 1e6),
    }
    panels = {
        label: {
            sensor: {
                method: factor * result.summary(method).get(key, np.nan)
                for method, result in found.items()
                if method not in PARTITION_ONLY
            }
            for sensor, found in results.items()
        }
        for label, (key, factor) in shown.items()
    }
    logarithmic = frozenset(label for label in shown if "÷" in label or "time" in label)
    return Figure(
        "methods",
        "All methods that find corners and segments (rows), with all sensors (colours).",
        dot_chart(panels, log_axes=logarithmic),
    )
