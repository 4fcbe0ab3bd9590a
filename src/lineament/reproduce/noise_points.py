"""Figures 2 and 3: a scan with noise points, filtered and not, and what that does to features."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..evaluation.counts import quantile, ratio, rms
from ..evaluation.scores import Scores, evaluate
from ..extractor import Extractor
from ..features import Features
from ..methods.stages import bilateral_filter
from ..output import canvas, drawing
from ..scan import Array, LaserScan
from ..simulation import SENSORS, Sensor, World, scene, truth
from .findings import Figure, Findings, Progress, Setting, Table
from .frames import scene_numbers
from .repetition_grid import Parameters, best_parameters

__all__ = ["run"]

#: The paper's scanner, with a noise point in every fiftieth beam.
SENSOR: Sensor = replace(SENSORS["paper"], outlier=0.02)
#: A reading farther off than this is a noise point [m]; a step in depth of this is an edge.
OFF = 0.10
#: Noise points by how far they are off [m]: up to about 2 σ_r the filter draws them in.
SIZES = (OFF, 0.3, 0.6, 1.2, math.inf)
#: Beams that the filter takes in on either side.
HALF_WIDTH = 8

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class _Frame:
    """A scan with noise points, what `liu` makes of it, and the places that beams are at."""

    scan: LaserScan
    truth: Features
    filtered: Array
    labelled: Mask
    true: Array
    places: dict[str, Mask]

    def errors(self, ranges: Array, place: str) -> Array:
        """Errors of ranges at a place [m]."""
        return (ranges - self.true)[self.places[place]]


def run(setting: Setting, progress: Progress) -> Findings:
    """Compare raw and filtered ranges, and what is found with the filter and without it."""
    numbers = scene_numbers(4 * setting.frames, setting.seed)
    progress(f"simulating {len(numbers)} scans")
    frames = [_frame(*scene(("room", "hall")[i % 2], n), n) for i, n in enumerate(numbers)]
    ranges, figures = _ranges_table(frames)
    chosen = best_parameters(setting, progress)
    best = asdict(chosen)
    variants = {
        "paper’s numbers, not filtered": Extractor("liu", half_width=0),
        "paper’s numbers, filtered": Extractor("liu"),
        "best of Figure 9, not filtered": Extractor("liu", half_width=0, **best),
        "best of Figure 9, filtered": Extractor("liu", **best),
        "the same, lines fitted to filtered ranges": Extractor("liu", measure="filtered", **best),
    }
    scores = {}
    for name, extract in variants.items():
        progress(name)
        scores[name] = Scores.total(evaluate(extract(f.scan), f.truth) for f in frames)
    progress("drawing")
    return Findings(
        "Noise points, filtered and not (Figures 2 and 3)",
        _text(chosen, figures, scores),
        (ranges, _features_table(scores)),
        (_figure(setting.seed),),
        {"ranges": figures, "features": {name: s.summary() for name, s in scores.items()}},
    )


def _text(
    best: Parameters, figures: dict[str, dict[str, float]], scores: dict[str, Scores]
) -> tuple[str, ...]:
    labelled = {place: f"{100 * of['labelled']:.0f} %" for place, of in figures.items()}
    smallest, *_, largest = (_size(low, high) for low, high in pairwise(SIZES))
    raw, filtered = (
        scores[f"paper’s numbers, {how}"].corners.counts for how in ("not filtered", "filtered")
    )
    return (
        "A noise point between two lines differs much from the readings on both of its sides "
        "(Figure 2); the paper filters it away, so that the spacing of neighbouring points stays "
        "below its threshold (Figure 3) and it is not taken for a corner. Here a noise point is "
        "put into every fiftieth beam of scans of rooms and halls, and the bilateral filter runs "
        "with the paper’s numbers: σ_d = 4 beams, σ_r = 0.3 m.",
        "On planes the filter halves the noise. But its weights fall off with the difference in "
        "range: it draws in noise points that are off by less than σ_r, and leaves those that are "
        "off by more than 2 σ_r where they are. The claim that the filter removes noise points "
        "holds for the small ones. The others are left to the rule of three points a class: it "
        f"labels {labelled[largest]} of those that are off by {largest} as noise, "
        f"{labelled[smallest]} of those off by {smallest}, and {labelled['planes']} of the good "
        "readings on planes. The price of the filter are edges and corners, which it moves by "
        "more than the noise: what is measured should be fitted to raw ranges.",
        f"With the paper’s numbers {100 * raw.precision:.0f} % of the corners found are right "
        f"(within 0.1 m) without the filter, {100 * filtered.precision:.0f} % with it, and "
        f"{100 * raw.recall:.0f} % and {100 * filtered.recall:.0f} % of the true ones are found: "
        "it rounds corners, whose response then stays below the threshold. The best numbers of "
        f"Figure 9 are: {best}.",
    )


def _frame(world: World, pose: tuple[float, float, float], number: int) -> _Frame:
    scan = SENSOR.scan(world, pose, np.random.default_rng([number, 2]))
    true, surface = SENSOR.ideal(world, pose)
    features = truth(world, pose, SENSOR)
    noisy = scan.valid & (abs(scan.ranges - true) > OFF)
    steps = (np.diff(surface) != 0) & (abs(np.diff(true)) > OFF)
    edge = _near(np.append(steps, False), 1, 2)
    corner = np.zeros(len(scan), dtype=np.bool_)
    corner[features.corners["beam"]] = True
    changes = np.append(np.diff(surface) != 0, False)
    plain = ~_near(changes, HALF_WIDTH - 1, HALF_WIDTH) & ~_near(noisy, HALF_WIDTH, HALF_WIDTH)
    clear = scan.valid & ~noisy
    places = {"planes": plain & clear, "edges": edge & clear, "corners": corner & clear & ~edge}
    off = abs(np.where(noisy, scan.ranges - true, 0.0))
    for low, high in pairwise(SIZES):
        places[_size(low, high)] = noisy & (off > low) & (off <= high)
    labelled = Extractor("liu")(scan).clusters < 0
    return _Frame(scan, features, bilateral_filter(scan), labelled, true, places)


def _near(marks: Mask, before: int, after: int) -> Mask:
    """Mark the beams from so many before a mark to so many after it."""
    near = np.convolve(marks, np.ones(before + after + 1))
    return np.asarray(near[before : before + len(marks)] > 0)


def _size(low: float, high: float) -> str:
    return f"{low:g}–{high:g} m" if math.isfinite(high) else f"more than {low:g} m"


def _ranges_table(frames: list[_Frame]) -> tuple[Table, dict[str, dict[str, float]]]:
    names = {"planes": "on planes", "edges": "two beams on either side of an edge"}
    names |= {"corners": "nearest to a corner"}
    rows, figures = [], {}
    for place in frames[0].places:
        raw = np.concatenate([f.errors(f.scan.ranges, place) for f in frames])
        filtered = np.concatenate([f.errors(f.filtered, place) for f in frames])
        labelled = np.concatenate([f.labelled[f.places[place]] for f in frames])
        off = abs(filtered) > OFF
        figures[place] = {
            "beams": len(raw),
            "raw": rms(raw),
            "filtered": rms(filtered),
            "off_after": ratio(float(off.sum()), len(off)),
            "labelled": ratio(float(labelled.sum()), len(labelled)),
        }
        where = names.get(place, f"noise points, off by {place}")
        rows.append(
            {
                "beams": where,
                "number": len(raw),
                "raw, rms [mm]": 1e3 * rms(raw),
                "filtered, rms [mm]": 1e3 * rms(filtered),
                "off by > 0.1 m after [%]": 100 * figures[place]["off_after"],
                "labelled noise by liu [%]": 100 * figures[place]["labelled"],
            }
        )
    note = (
        f"Errors of ranges over {len(frames)} scans; the noise of the ranges is 10 mm. Labelled "
        "noise: in a class of fewer than three points, with the filter and the paper’s numbers."
    )
    return Table.of_records("Errors of ranges", rows, note), figures


def _features_table(scores: dict[str, Scores]) -> Table:
    rows = []
    for name, score in scores.items():
        corners, segments = score.corners, score.segments
        counts = corners.counts
        rows.append(
            {
                "liu": name,
                "corners a scan": counts.found / score.scans,
                "precision": counts.precision,
                "recall": counts.recall,
                "F1": counts.f1,
                "corner error, median [mm]": 1e3 * quantile(corners.errors["position"], 0.5),
                "offset of lines, rmse [mm]": 1e3 * rms(segments.errors["offset"]),
                "the same ÷ bound": segments.over_bound["offset_"].over_bound,
            }
        )
    note = (
        "Precision, recall and F1 are of corners within 0.1 m of true ones that show six beams or "
        "more of both sides; errors are those of right corners and right lines. ÷ bound: root of "
        "the mean square of each offset over its Cramér-Rao bound."
    )
    return Table.of_records("What is found with the filter and without it", rows, note)


def _figure(seed: int) -> Figure:
    """Draw two walls and a third behind them, with noise points: the plan, and the spacings."""
    walls = [[(3.0, -1.6), (3.0, -0.15)], [(2.6, 0.25), (2.6, 1.6)], [(4.0, -2.4), (4.0, 2.4)]]
    sensor = replace(SENSOR, n_beams=181, angle_min=math.radians(-30), outlier=0.03)
    world = World.of_polygons(walls)
    scan = sensor.scan(world, (0.0, 0.0, 0.0), np.random.default_rng([seed, 3]))
    true, _ = sensor.ideal(world, (0.0, 0.0, 0.0))
    filtered = bilateral_filter(scan)
    noisy = abs(scan.ranges - true) > OFF
    bearings = np.column_stack((np.cos(scan.angles), np.sin(scan.angles)))
    figure = canvas.new_figure(12, 5.2)
    plan, spacing = figure.subplots(1, 2, width_ratios=[1, 1.5])
    canvas.style_plane(plan, "Figure 2", "raw and filtered points", scan.points)
    plan.plot(*scan.points.T, ".", color=_RAW, markersize=5, label="raw")
    plan.plot(*(filtered[:, np.newaxis] * bearings).T, ".", color=_FILTERED, ms=3, label="filtered")
    plan.plot(*scan.points[noisy].T, "o", mfc="none", color=canvas.INK, ms=9, label="noise point")
    drawing.draw_sensor(plan)
    canvas.style(spacing, "Figure 3", "distance of each point to the one before it")
    traces = {
        "raw": Extractor("liu", half_width=0).trace(scan),
        "filtered": Extractor("liu").trace(scan),
    }
    for (name, trace), color in zip(traces.items(), (_RAW, _FILTERED), strict=True):
        spacing.plot(np.degrees(scan.angles), trace.spacing, color=color, linewidth=1.1, label=name)
    threshold = traces["filtered"].distance_threshold
    spacing.plot(
        np.degrees(scan.angles), threshold, "--", color=canvas.INK, lw=1, label="threshold"
    )
    spacing.set_yscale("log")
    spacing.set_xlabel("bearing [°]", fontsize=9, color="#57606a")
    spacing.set_ylabel("spacing [m]", fontsize=9, color="#57606a")
    for axes in (plan, spacing):
        axes.legend(fontsize=8, frameon=False)
    caption = (
        "Noise points between and on walls. Those close to a wall are drawn towards it; those "
        "farther off stay where they are, and their spacing stays above the threshold."
    )
    return Figure("fig2-3", caption, canvas.figure_bytes(figure))


_RAW, _FILTERED = "#4477aa", "#d1242f"
