"""What method `optimal` is to reach, and what it reaches: in simulation, on recordings, in time.

The scenes are others than those that it was tuned on, of five seeds; experiment `real` has what
recordings say without a truth.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from ..evaluation.scores import Scores, evaluate
from ..extractor import Extractor
from ..methods.optimal import Optimal
from ..simulation import SENSORS
from .aims import TOLD, Limits, aims_table
from .charts import dot_chart
from .curved_arcs import curved_arcs
from .findings import Figure, Findings, Progress, Setting, Table, cell_text
from .frames import Frame, batch_of, scene_numbers, simulated_frames
from .recorded_aims import recorded_aims
from .speed_aims import speed_aims

__all__ = ["run"]

METHOD = "optimal"
KINDS = ("room", "corridor", "hall")
#: Seeds, and the scenes of each kind and seed for each frame of the setting.
SEEDS, SCENES_A_FRAME = 5, 4
#: How far the seed of these scenes is ahead of the setting's: method and constants were tuned on
#: scenes of the first two, 0 … 39 999.
_AHEAD = 2
#: The sensors whose noise hides what is small: σ = 3 cm, and 1 % of the range.
_NOISY = ("noisy", "rplidar")
_OTHERS = tuple(name for name in SENSORS if name not in _NOISY)
#: χ² by which an arc must differ from a line to be told from it, as the method asks by default.
_EVIDENCE = Optimal().evidence


@dataclass(frozen=True, slots=True)
class _Row:
    """A figure of `_Result.summary`, its limits, and the sensors that these are for."""

    figure: str
    key: str
    limits: Limits = TOLD
    sensors: tuple[str, ...] = tuple(SENSORS)

    def record(self, results: Mapping[str, Sequence[Mapping[str, float]]]) -> dict[str, object]:
        """Make a row of the table: median and range over the seeds, by sensor."""
        values = {
            name: [of_seed.get(self.key, math.nan) for of_seed in of]
            for name, of in results.items()
            if name in self.sensors
        }
        missed = [n for n, seeds in values.items() if self.limits.hold(median(seeds)) is False]
        return {
            "figure": self.figure,
            "aim": str(self.limits),
            **{name: _with_range(values[name]) if name in values else None for name in results},
            "missed with": ", ".join(missed) or None,
        }


def _with_range(values: Sequence[float]) -> str:
    low, middle, high = (cell_text(v) for v in (min(values), median(values), max(values)))
    return f"{middle} ({low}–{high})"


_ROWS = (
    _Row("corner F1 within 0.1 m", "corner_f1_0.10", Limits(low=0.98)),
    _Row("corner RMSE ÷ bound", "corner_over_bound", Limits(high=1.1)),
    _Row("its median", "corner_over_bound_median"),
    _Row("corner NEES", "corner_nees", Limits(0.9, 1.1)),
    _Row("its median", "corner_nees_median"),
    _Row("segment F1", "segment_f1", Limits(low=0.985), _OTHERS),
    _Row("the same with much noise", "segment_f1", Limits(low=0.95), _NOISY),
    _Row("segments in pieces", "segment_fragmentation", Limits(high=0.02)),
    _Row("line offset ÷ bound, median", "segment_offset_over_bound_median", Limits(high=1.05)),
    _Row("line angle ÷ bound, median", "segment_angle_over_bound_median", Limits(high=1.05)),
    _Row("segment NEES", "segment_nees", Limits(0.9, 1.1)),
    _Row("its median", "segment_nees_median"),
    _Row("partition F1", "partition_region_f1", Limits(low=0.97)),
    _Row("arc F1", "arc_f1", Limits(low=0.95), _OTHERS),
    _Row("the same with much noise", "arc_f1", Limits(low=0.88), _NOISY),
    _Row("arcs that are no lines", "curved_arcs"),
    _Row("arc NEES, median", "arc_nees_median"),
)


def run(setting: Setting, progress: Progress) -> Findings:
    """Measure every figure of the aims."""
    extractor = Extractor(METHOD)
    results: dict[str, list[dict[str, float]]] = {name: [] for name in SENSORS}
    scenes = len(KINDS) * SCENES_A_FRAME * setting.frames
    seeds = [scene_numbers(scenes, setting.seed + _AHEAD + k) for k in range(SEEDS)]
    for name, sensor in SENSORS.items():
        progress(f"{name}: simulating")
        for numbers in seeds:
            frames = list(simulated_frames(sensor, KINDS, numbers))
            results[name].append(_measure(extractor, frames, name))
    recorded = recorded_aims(METHOD, setting, progress)
    speed = speed_aims(METHOD, setting, progress)
    title = f"Simulated sensors, {SEEDS} seeds of {scenes} scans each: median (range)"
    tables = [Table.of_records(title, [row.record(results) for row in _ROWS])]
    if recorded:
        tables.append(aims_table("Recordings", recorded, _RECORDED_NOTE))
    tables.append(aims_table("Speed, one thread", speed))
    return Findings(
        "What optimal is to reach, and what it reaches",
        _text(seeds),
        tuple(tables),
        (_figure(results),),
        {
            "simulated": results,
            "recorded": [aim.to_dict() for aim in recorded],
            "speed": [aim.to_dict() for aim in speed],
        },
    )


def _text(seeds: Sequence[range]) -> tuple[str, ...]:
    first = ", ".join(str(numbers[0]) for numbers in seeds)
    return (
        f"Rooms, corridors with doors and halls with boxes and round columns, scenes from {first} "
        "on, the same for each sensor; the noise is estimated from each scan. "
        "‘÷ bound’ is the error over that of an estimate that reaches the Cramér-Rao bound; NEES "
        "is the mean of the squared errors over the method’s own covariance, divided by what it "
        "should be.",
        "A feature is right within the gates or three deviations of its bound, if that is more. "
        f"Arcs that are no lines differ from a line by at least {_EVIDENCE:g} in χ²: the others "
        "look straight.",
    )


_RECORDED_NOTE = (
    "A corner of the arena is demanded where the scan shows both its walls. ‘Sharp’ corners are "
    "those with an opening of less than 150° that are not within 0.3 m of an end of a fitted wall "
    "that is at no listed corner: panels bend, and where no wall was fitted, corners are not "
    "listed."
)


def _measure(extractor: Extractor, frames: list[Frame], sensor: str) -> dict[str, float]:
    """Score the scans of a seed; with the share of the arcs that do not look straight."""
    found = batch_of(extractor, [frame.scan for frame in frames])
    truths = [frame.truth for frame in frames]
    curved = np.concatenate([curved_arcs(truth, SENSORS[sensor], _EVIDENCE) for truth in truths])
    share = float(curved.mean()) if len(curved) else math.nan
    return Scores.total(map(evaluate, found, truths)).summary() | {"curved_arcs": share}


def _figure(results: Mapping[str, Sequence[Mapping[str, float]]]) -> Figure:
    shown = {
        "corner F1": "corner_f1_0.10",
        "corner RMSE ÷ bound": "corner_over_bound",
        "partition F1": "partition_region_f1",
        "arc F1": "arc_f1",
    }
    panels = {
        label: {METHOD: {n: median(of.get(key, math.nan) for of in r) for n, r in results.items()}}
        for label, key in shown.items()
    }
    return Figure("aims", "Figures of optimal by sensor (rows).", dot_chart(panels))
