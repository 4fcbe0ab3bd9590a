"""Figures 2 and 3: a scan with noise points, filtered and not, and what that does to features."""

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lineament.extractor import Extractor
from lineament.features import Features
from lineament.methods.liu import Liu
from lineament.methods.stages import bilateral_filter
from lineament.output import canvas, drawing
from lineament.scan import Array, LaserScan
from lineament.simulation import SENSORS, Sensor, World, scene, truth

from ..evaluation.counts import ratio, rms
from .contenders import FIGURE_9, LIU, PAPER
from .experiment import Claim, Experiment, Judged, Measured, Report
from .findings import Figure, Progress, Setting, Table, log_axis
from .prose import prose
from .scans import scene_numbers, scored, totals

#: The paper's scanner, with a noise point in every fiftieth beam.
SENSOR: Sensor = replace(SENSORS["paper"], outlier=0.02)
#: A range that is farther off is a noise point [m]; a larger step in depth is an edge.
OFF = 0.10
#: Noise points by how far they are off [m]: up to about 2 σ_r the filter moves them.
SIZES = [(0.1, 0.3), (0.3, 0.6), (0.6, 1.2), (1.2, math.inf)]
#: Beams that the filter uses on either side.
HALF_WIDTH = Liu().half_width
#: Scans for each frame of the setting.
SCANS_A_FRAME = 4
_RAW, _FILTERED = "#4477aa", "#d1242f"

Mask = NDArray[np.bool_]

_NAMES = {
    "planes": "on planes",
    "edges": "two on either side of an edge",
    "corners": "nearest to a corner",
}
_RANGES = {
    "number": "beams",
    "raw, rms [mm]": "raw",
    "filtered, rms [mm]": "filtered",
    "off by > 0.1 m after [%]": "off_after",
    "labelled noise by liu:paper [%]": "labelled",
}
_FEATURES = {
    "corners a scan": "corners_a_scan",
    "precision": "corner_precision_0.10",
    "recall": "corner_recall_0.10",
    "F1": "corner_f1_0.10",
    "corner error, median [mm]": "corner_median_error",
    "offset of lines, rmse [mm]": "segment_offset_rmse",
    "the same ÷ bound": "segment_offset_over_bound",
}


class _Frame(NamedTuple):
    """A scan with noise points, its true ranges, and the kinds of places of its beams."""

    scan: LaserScan
    truth: Features
    true: Array
    places: dict[str, Mask]


def measure(setting: Setting, progress: Progress) -> Measured:
    """Compare raw and filtered ranges, and what is found with the filter and without it."""
    numbers = scene_numbers(SCANS_A_FRAME * setting.frames, setting.seed)
    progress(f"simulating {len(numbers)} scans")
    frames = [_frame(*scene(("room", "hall")[i % 2], n), n) for i, n in enumerate(numbers)]
    variants = {
        f"{name}, {how}": Extractor(name, **changes)
        for name in (PAPER, FIGURE_9, LIU)
        for how, changes in (("not filtered", {"half_width": 0}), ("filtered", {}))
    }
    variants[f"{LIU}, lines fitted to filtered ranges"] = Extractor(LIU, measure="filtered")
    features = {
        name: {"corners_a_scan": of.corners.counts.found / of.scans, **of.summary()}
        for name, of in totals(scored(variants, frames, progress, "features")).items()
    }
    return Measured(
        {"ranges": _ranges(frames), "features": features}, lambda: [_figure(setting.seed)]
    )


def report(n: Any, setting: Setting) -> Report:
    """Make a table of ranges, by place, and one of features, by variant."""
    of_ranges, of_features = prose("notes of noise", scans=SCANS_A_FRAME * setting.frames)
    places = {_NAMES.get(p, f"noise points, off by {p}"): of for p, of in n["ranges"].items()}
    title = "What is found with the filter and without it"
    tables = (
        Table.of_numbers("Errors of ranges", places, _RANGES, of_ranges, "beams"),
        Table.of_numbers(title, n["features"], _FEATURES, of_features, "liu"),
    )
    labelled = {place: f"{100 * of['labelled']:.0f} %" for place, of in n["ranges"].items()}
    nearest, farthest = (_size(*SIZES[i]) for i in (0, -1))
    shares = {
        how: [
            f"{100 * n['features'][f'{PAPER}, {about}'].get(f'corner_{of}_0.10', math.nan):.0f} %"
            for of in ("precision", "recall")
        ]
        for how, about in (("raw", "not filtered"), ("filtered", "filtered"))
    }
    sizes = {"near": labelled[nearest], "far": labelled[farthest], "planes": labelled["planes"]}
    return prose("noise", nearest=nearest, farthest=farthest, **sizes, **shares), tables


def _judged(n: Any) -> Judged:
    small, large = (n["ranges"][size]["off_after"] for size in ("0.1–0.3 m", "0.6–1.2 m"))
    return Judged(
        f"Still off by more than 0.1 m after it: {100 * small:.0f} % of the points off by "
        f"0.1–0.3 m, {100 * large:.0f} % of those off by 0.6–1.2 m",
        [0.5 - small, 0.5 - large],
    )


def _frame(world: World, pose: tuple[float, float, float], number: int) -> _Frame:
    scan = SENSOR.scan(world, pose, np.random.default_rng([number, 2]))
    true, surface = SENSOR.ideal(world, pose)
    features = truth(world, pose, SENSOR)
    noisy = scan.valid & (abs(scan.ranges - true) > OFF)
    changes = np.append(np.diff(surface) != 0, False)
    edge = _near(changes & np.append(abs(np.diff(true)) > OFF, False), 1, 2)
    corner = np.zeros(len(scan), dtype=np.bool_)
    corner[features.corners["beam"]] = True
    plain = ~_near(changes, HALF_WIDTH - 1, HALF_WIDTH) & ~_near(noisy, HALF_WIDTH, HALF_WIDTH)
    clear = scan.valid & ~noisy
    places = {"planes": plain & clear, "edges": edge & clear, "corners": corner & clear & ~edge}
    off = abs(np.where(noisy, scan.ranges - true, 0.0))
    for low, high in SIZES:
        places[_size(low, high)] = noisy & (off > low) & (off <= high)
    return _Frame(scan, features, true, places)


def _near(marks: Mask, before: int, after: int) -> Mask:
    """Mark the beams from so many before a mark to so many after it."""
    near = np.convolve(marks, np.ones(before + after + 1))
    return np.asarray(near[before : before + len(marks)] > 0)


def _size(low: float, high: float) -> str:
    return f"{low:g}–{high:g} m" if math.isfinite(high) else f"more than {low:g} m"


def _ranges(frames: list[_Frame]) -> dict[str, dict[str, float]]:
    """Errors of raw and filtered ranges, and share of points labelled noise, by place."""
    liu, numbers = Extractor(PAPER), {}
    raw = np.concatenate([f.scan.ranges - f.true for f in frames])
    filtered = np.concatenate([bilateral_filter(f.scan) - f.true for f in frames])
    labelled = np.concatenate([liu(f.scan).clusters < 0 for f in frames])
    for place in frames[0].places:
        at = np.concatenate([f.places[place] for f in frames])
        numbers[place] = {
            "beams": int(at.sum()),
            "raw": rms(raw[at]),
            "filtered": rms(filtered[at]),
            "off_after": ratio(float((abs(filtered[at]) > OFF).sum()), at.sum()),
            "labelled": ratio(float(labelled[at].sum()), at.sum()),
        }
    return numbers


def _figure(seed: int) -> Figure:
    """Draw two walls and a third behind them, with noise points: the plan, and the spacings."""
    walls = [[(3.0, -1.6), (3.0, -0.15)], [(2.6, 0.25), (2.6, 1.6)], [(4.0, -2.4), (4.0, 2.4)]]
    sensor = replace(SENSOR, n_beams=181, angle_min=math.radians(-30), outlier=0.03)
    world, origin = World.of_polygons(walls), (0.0, 0.0, 0.0)
    scan = sensor.scan(world, origin, np.random.default_rng([seed, 3]))
    filtered = bilateral_filter(scan)
    noisy = abs(scan.ranges - sensor.ideal(world, origin)[0]) > OFF
    bearings = np.column_stack((np.cos(scan.angles), np.sin(scan.angles)))
    figure, (plan, spacing) = canvas.new_panels(2, 2)
    canvas.style_plane(plan, "Figure 2", "raw and filtered points", scan.points)
    plan.plot(*scan.points.T, "o", color=_RAW, mfc="none", label="raw")
    plan.plot(*(filtered[:, np.newaxis] * bearings).T, ".", color=_FILTERED, label="filtered")
    plan.plot(*scan.points[noisy].T, "x", color=canvas.INK, label="noise point")
    drawing.draw_sensor(plan)
    about = "distance of each point to the one before it"
    canvas.style(spacing, "Figure 3", about, "bearing [°]", "spacing [m]")
    x = np.degrees(scan.angles)
    for name, half_width, color in (("raw", 0, _RAW), ("filtered", HALF_WIDTH, _FILTERED)):
        trace = Extractor("liu", half_width=half_width).trace(scan)
        spacing.plot(x, trace.spacing, color=color, label=name)
    spacing.plot(x, trace.distance_threshold, "--", color=canvas.INK, label="threshold")
    log_axis(spacing.yaxis)
    for axes in (plan, spacing):
        axes.legend(frameon=False)
    return Figure.of("fig2-3", figure)


TITLE = "Noise points, filtered and not (Figures 2 and 3)"
_PAPER = "Filtering removes noise points and keeps edges"
EXPERIMENT = Experiment(TITLE, measure, report, (Claim("Figures 2, 3", _PAPER, _judged, "fig2-3"),))
