"""All methods with all sensors: what they find, how exactly, their covariances, and their time."""

import numpy as np

from lineament.simulation import SCENES, SENSORS

from ..evaluation.scores import Scores, evaluate
from .contenders import LIU, LIU_NOTE, PARTITION_ONLY, RIVALS_NOTE, every_method
from .findings import Figure, Findings, Numbers, Progress, Setting, Table, dot_chart, each
from .scans import batch_of, interleaved_times, scene_numbers, simulated_frames, time_ratio

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
    "÷ liu": ("time_ratio", 1),
}
_PANELS = {
    "corner F1": ("corner_f1_0.10", 1),
    "segment F1": ("segment_f1", 1),
    "corner error ÷ bound (median)": ("corner_over_bound_median", 1),
    "time per scan [µs]": ("time", 1e6),
}


def run(setting: Setting, progress: Progress) -> Findings:
    """Score all methods on frames of all kinds of scenes, for each sensor."""
    methods = every_method(setting.methods)
    scenes = scene_numbers(len(SCENES) * setting.frames, setting.seed)
    numbers: dict[str, dict[str, dict[str, float]]] = {}
    for name, sensor in SENSORS.items():
        progress(f"{name}: simulating")
        frames = list(simulated_frames(sensor, SCENES, scenes))
        scans = [frame.scan for frame in frames]
        numbers[name], times = {}, interleaved_times(methods, scans[: len(SCENES)])
        for method, extractor in each(methods, progress, name):
            scores = map(evaluate, batch_of(extractor, scans), (frame.truth for frame in frames))
            of = Scores.total(scores).summary()
            kinds = ("corner", "segment") if method == PARTITION_ONLY else ("corner",)
            if method == PARTITION_ONLY or "corner_precision_0.10" not in of:
                of = {k: v for k, v in of.items() if not k.startswith((*kinds, "arc"))}
            of["time"] = float(np.median(times[method]))
            of["time_ratio"] = time_ratio(times[method], times[LIU])[0]
            numbers[name][method] = of
    progress("drawing")
    shown = {
        sensor: {method: of for method, of in found.items() if method != PARTITION_ONLY}
        for sensor, found in numbers.items()
    }
    logarithmic = [label for label in _PANELS if "÷" in label or "time" in label]
    return Findings(
        "All methods, by sensor",
        (_ABOUT, RIVALS_NOTE, LIU_NOTE, _consistency(numbers), _arcs(numbers)),
        tuple(
            Table.of_numbers(
                f"{name}: {SENSORS[name].n_beams} beams, {len(scenes)} scans",
                found,
                _COLUMNS,
                "A dash: nothing found, or nothing that defines the number.",
            )
            for name, found in numbers.items()
        ),
        (
            Figure(
                "methods",
                "All methods that find corners and segments (rows), with all sensors (colours).",
                dot_chart(shown, _PANELS, logarithmic),
            ),
        ),
        numbers,
    )


_ABOUT = (
    "Simulated frames of all kinds of scenes, the same scenes for each sensor. The paper has no "
    "such table. Corners are right within 0.1 m; segments within 0.1 m, 10° and with half of their "
    "beams in common. Errors are those of correct features. ‘÷ bound’ is the median error over "
    "that of an estimate that reaches the Cramér–Rao bound; ‘RMS’ is the root mean square, which "
    "one gross error can dominate. NEES is the median squared error over the method’s own "
    "covariance, divided by its expected value: 1 is right, more is overconfident; ‘mean’ is the "
    "mean, likewise. Every method estimates the noise from the scan."
)


def _consistency(numbers: Numbers) -> str:
    """Report how many methods have a mean NEES within its 95 % interval."""
    parts = []
    for kind in ("corner", "segment"):
        keys = (f"{kind}_nees_low", f"{kind}_nees", f"{kind}_nees_high")
        rows = [of for found in numbers.values() for of in found.values() if keys[1] in of]
        within = sum(of[keys[0]] <= of[keys[1]] <= of[keys[2]] for of in rows)
        if rows:
            parts.append(f"{within} of {len(rows)} rows for {kind}s")
    return f"The mean NEES lies within its 95 % interval in {' and in '.join(parts) or 'no row'}."


def _arcs(numbers: Numbers) -> str:
    """Name the methods that find arcs."""
    rows = [row for found in numbers.values() for row in found.items()]
    giving = dict.fromkeys(method for method, of in rows if "arc_precision" in of)
    return (
        f"Arcs are found by {', '.join(giving) or 'none of the methods'}. Without arcs, round "
        "columns become polygons with false corners."
    )
