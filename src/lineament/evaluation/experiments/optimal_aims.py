"""What method `optimal` is to reach, and what it reaches: in simulation, on recordings, in time.

The scenes are others than those that it was tuned on; of the recordings there are no others.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...extractor import Extractor
from ...simulation import SENSORS
from ..scores import Scores, evaluate
from .aims import TOLD, Limits, aims_table
from .ceilings import curved_arcs, lines_within_gates, within_gate
from .charts import dot_chart
from .findings import Figure, Findings, Progress, Setting, Table
from .frames import Frame, batch_of, scene_numbers, simulated_frames
from .recorded_aims import recorded_aims
from .speed_aims import speed_aims

__all__ = ["run"]

METHOD = "optimal"
KINDS = ("room", "corridor", "hall")
#: Scenes of each kind for each frame of the setting.
SCENES_A_FRAME = 10
#: How far the seed of these scenes is ahead of the setting's: method and constants were tuned on
#: scenes of the first two, 0 … 39 999.
_AHEAD = 2
#: The sensor with σ = 3 cm and drop-outs, for which there is an aim of its own.
_NOISY = "noisy"
_OTHERS = tuple(name for name in SENSORS if name != _NOISY)
#: χ² by which an arc must differ from a line to be told from it, as the method asks by default.
_EVIDENCE = 25.0


@dataclass(frozen=True, slots=True)
class _Row:
    """A figure of `_Result.summary`, its limits, and the sensors that these are for."""

    figure: str
    key: str
    limits: Limits = TOLD
    sensors: tuple[str, ...] = tuple(SENSORS)

    def record(self, results: Mapping[str, Mapping[str, float]]) -> dict[str, object]:
        """Make a row of the table, of all figures by sensor."""
        values = {name: of.get(self.key, math.nan) for name, of in results.items()}
        judged = {name: value for name, value in values.items() if name in self.sensors}
        missed = [name for name, value in judged.items() if self.limits.hold(value) is False]
        return {
            "figure": self.figure,
            "aim": str(self.limits),
            **{name: judged.get(name) for name in values},
            "missed with": ", ".join(missed) or None,
        }


_ROWS = (
    _Row("corner F1 within 0.1 m", "corner_f1_0.10", Limits(low=0.97), _OTHERS),
    _Row("the same at σ = 3 cm", "corner_f1_0.10", Limits(low=0.95), (_NOISY,)),
    _Row("its ceiling", "corner_ceiling"),
    _Row("corner RMSE ÷ bound", "corner_over_bound", Limits(high=1.2)),
    _Row("its median", "corner_over_bound_median"),
    _Row("corner NEES", "corner_nees", Limits(0.9, 1.15)),
    _Row("its median", "corner_nees_median"),
    _Row("segment F1", "segment_f1", Limits(low=0.97)),
    _Row("its ceiling", "segment_ceiling"),
    _Row("segments in pieces", "segment_fragmentation", Limits(high=0.02)),
    _Row("line offset ÷ bound, median", "segment_offset_over_bound_median", Limits(high=1.05)),
    _Row("line angle ÷ bound, median", "segment_angle_over_bound_median", Limits(high=1.05)),
    _Row("segment NEES", "segment_nees", Limits(0.9, 1.15)),
    _Row("its median", "segment_nees_median"),
    _Row("partition F1", "partition_region_f1", Limits(low=0.97)),
    _Row("arc F1", "arc_f1", Limits(low=0.9)),
    _Row("arcs that are no lines", "curved_arcs"),
    _Row("arc NEES, median", "arc_nees_median"),
)


@dataclass(frozen=True, slots=True, eq=False)
class _Result:
    """Scores with a sensor, and what no method could pass."""

    scores: Scores
    corner_ceiling: float
    segment_ceiling: float
    curved: float

    def summary(self) -> dict[str, float]:
        return self.scores.summary() | {
            "corner_ceiling": self.corner_ceiling,
            "segment_ceiling": self.segment_ceiling,
            "curved_arcs": self.curved,
        }


def run(setting: Setting, progress: Progress) -> Findings:
    """Measure every figure of the aims."""
    extractor = Extractor(METHOD)
    results = {}
    numbers = scene_numbers(len(KINDS) * SCENES_A_FRAME * setting.frames, setting.seed + _AHEAD)
    for name, sensor in SENSORS.items():
        progress(f"{name}: simulating")
        results[name] = _measure(extractor, list(simulated_frames(sensor, KINDS, numbers)), name)
    recorded = recorded_aims(METHOD, setting, progress)
    speed = speed_aims(METHOD, setting, progress)
    tables = [_table(results)]
    if recorded:
        tables.append(aims_table("Recordings", recorded, _RECORDED_NOTE))
    tables.append(aims_table("Speed, one thread", speed))
    return Findings(
        "What optimal is to reach, and what it reaches",
        _text(numbers),
        tuple(tables),
        (_figure(results),),
        {
            "simulated": {name: result.summary() for name, result in results.items()},
            "recorded": [aim.to_dict() for aim in recorded],
            "speed": [aim.to_dict() for aim in speed],
        },
    )


def _text(numbers: range) -> tuple[str, ...]:
    return (
        f"Rooms, corridors with doors and halls with boxes and round columns, seeds {numbers[0]} "
        f"to {numbers[-1]}, the same for each sensor; the noise is estimated from each scan. "
        "‘÷ bound’ is the error over that of an estimate that reaches the Cramér-Rao bound; NEES "
        "is the mean of the squared errors over the method’s own covariance, divided by what it "
        "should be.",
        "Ceilings: the largest F1 of corners and segments that the bounds allow, as a corner whose "
        "place the readings do not tell to 0.1 m is both missed and false, and a segment whose "
        "angle they do not tell to 10°; and the share of the arcs that differ from a line by at "
        f"least {_EVIDENCE:g} in χ²: the others look straight.",
    )


_RECORDED_NOTE = (
    "Peers are C++ systems, measured elsewhere on the static set of the arena. ‘Sharp’ corners are "
    "those with an opening of less than 150° that are not within 0.3 m of an end of a fitted wall "
    "that is at no listed corner: panels bend, and where no wall was fitted, corners are not "
    "listed. ‘Clear’ corners are those with an opening of less than 150° and both sides of 6 beams "
    "or more. ‘Best other’ is the best figure of any other method of the project."
)


def _measure(extractor: Extractor, frames: list[Frame], sensor: str) -> _Result:
    found = batch_of(extractor, [frame.scan for frame in frames])
    truths = [frame.truth for frame in frames]
    within = np.concatenate([within_gate(truth, 0.1) for truth in truths])
    lines = np.concatenate([lines_within_gates(truth) for truth in truths])
    curved = np.concatenate([curved_arcs(truth, SENSORS[sensor], _EVIDENCE) for truth in truths])
    return _Result(
        Scores.total(map(evaluate, found, truths)),
        float(within.mean()) if len(within) else math.nan,
        float(lines.mean()) if len(lines) else math.nan,
        float(curved.mean()) if len(curved) else math.nan,
    )


def _table(results: Mapping[str, _Result]) -> Table:
    figures = {name: result.summary() for name, result in results.items()}
    scans = next(iter(results.values())).scores.scans
    rows = [row.record(figures) for row in _ROWS]
    return Table.of_records(f"Simulated sensors, {scans} scans each", rows)


def _figure(results: Mapping[str, _Result]) -> Figure:
    shown = {
        "corner F1": "corner_f1_0.10",
        "corner RMSE ÷ bound": "corner_over_bound",
        "partition F1": "partition_region_f1",
        "arc F1": "arc_f1",
    }
    panels = {
        label: {METHOD: {name: r.summary().get(key, math.nan) for name, r in results.items()}}
        for label, key in shown.items()
    }
    return Figure("aims", "Figures of optimal by sensor (rows).", dot_chart(panels))
