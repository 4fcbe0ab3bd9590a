"""All methods with all sensors: what they find, how exactly, their covariances, and their time."""

import math
from typing import Any

import numpy as np

from lineament.simulation import SCENES, SENSORS

from .contenders import LIU, PARTITION_ONLY, every_method
from .experiment import Experiment, Measured, Report
from .findings import Figure, Numbers, Progress, Setting, Table, dot_chart
from .prose import prose
from .scans import frames_of, interleaved_times, scored, time_ratio, totals
from .seeds import by_seed

_COLUMNS = {
    "corner F1": "corner_f1_0.10",
    "precision": "corner_precision_0.10",
    "recall": "corner_recall_0.10",
    "median error [mm]": "corner_median_error",
    "÷ bound": "corner_over_bound_median",
    "÷ bound, RMS": "corner_over_bound",
    "corner NEES": "corner_nees_median",
    "corner NEES, mean": "corner_nees",
    "segment F1": "segment_f1",
    "offset RMS [mm]": "segment_offset_rmse",
    "offset ÷ bound": "segment_offset_over_bound_median",
    "angle ÷ bound": "segment_angle_over_bound_median",
    "segment NEES": "segment_nees_median",
    "segment NEES, mean": "segment_nees",
    "arc F1": "arc_f1",
    "partition": "partition_success",
    "time [µs]": "time",
    "÷ liu": "time_ratio",
}
_PANELS = {
    "corner F1": "corner_f1_0.10",
    "segment F1": "segment_f1",
    "corner error ÷ bound (median)": "corner_over_bound_median",
    "time per scan [µs]": "time",
}


def measure(setting: Setting, progress: Progress) -> Measured:
    """Score all methods on frames of all kinds of scenes, for each sensor."""
    methods = every_method(setting.methods)
    numbers: dict[str, dict[str, dict[str, float]]] = {}
    for sensor in SENSORS:
        progress(f"{sensor}: simulating")
        frames = frames_of(setting, SCENES, len(SCENES), sensor)
        times = interleaved_times(methods, [frame.scan for frame in frames[: len(SCENES)]])
        numbers[sensor] = {}
        for method, scores in totals(scored(methods, frames, progress, sensor)).items():
            of = scores.summary()
            kinds = ("corner", "segment") if method == PARTITION_ONLY else ("corner",)
            if method == PARTITION_ONLY or "corner_precision_0.10" not in of:
                of = {k: v for k, v in of.items() if not k.startswith((*kinds, "arc"))}
            of["time"] = float(np.median(times[method]))
            of["time_ratio"] = time_ratio(times[method], times[LIU])[0]
            numbers[sensor][method] = of
    return Measured(numbers, lambda: [_chart(numbers)])


def _chart(numbers: Numbers) -> Figure:
    shown = {
        sensor: {method: of for method, of in found.items() if method != PARTITION_ONLY}
        for sensor, found in numbers.items()
    }
    logarithmic = [label for label in _PANELS if "÷" in label or "time" in label]
    return Figure.of("methods", dot_chart(shown, _PANELS, logarithmic))


def report(n: Numbers, setting: Setting) -> Report:
    """Make a table for each sensor."""
    scans = len(SCENES) * setting.frames
    note = "A dash: nothing found, or nothing that defines the number."
    tables = (
        Table.of_numbers(f"{s}: {SENSORS[s].n_beams} beams, {scans} scans", of, _COLUMNS, note)
        for s, of in n.items()
    )
    about = (*prose("all_methods"), *prose("rivals"), *prose("liu"))
    return (*about, _consistency(n), _arcs(n)), tables


def _consistency(n: Numbers) -> str:
    """Report how many methods have a mean NEES within its 95 % interval."""
    parts = []
    for kind in ("corner", "segment"):
        keys = (f"{kind}_nees_low", f"{kind}_nees", f"{kind}_nees_high")
        every: Any = [[of.get(k) for k in keys] for rows in n.values() for of in rows.values()]
        found = [row for row in every if row[1] is not None]
        within = sum((by_seed(lambda a, x, b: a <= x <= b, *row) for row in found), 0.0)
        known = sum((by_seed(lambda x: not math.isnan(x), row[1]) for row in found), 0.0)
        if found:
            parts.append(f"{within:.0f} of {known:.0f} rows for {kind}s")
    return f"The mean NEES lies within its 95 % interval in {' and in '.join(parts) or 'no row'}."


def _arcs(numbers: Numbers) -> str:
    """Name the methods that find arcs."""
    rows = [row for found in numbers.values() for row in found.items()]
    giving = dict.fromkeys(method for method, of in rows if "arc_precision" in of)
    return (
        f"Arcs are found by {', '.join(giving) or 'none of the methods'}. Without arcs, round "
        "columns become polygons with false corners."
    )


EXPERIMENT = Experiment("All methods, by sensor", measure, report)
