"""Figure 11: what the methods find, side by side, in simulated scenes and in recordings."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lineament.features import Features
from lineament.output import canvas
from lineament.output.figures import scan_figure
from lineament.scan import LaserScan
from lineament.simulation import SENSORS

from ..evaluation.scores import Scores, evaluate
from ..evaluation.similarity import SimilarityScores, similarity_scores
from .compare import compare_scan
from .contenders import LIU, PAPER, PDBS_LINES, fitted_methods, is_drawn
from .findings import Figure, Findings, Progress, Setting, Table, median_of
from .scans import INDOORS, recorded_scans, scene_numbers, simulated_frames

TRUE = "true features"
#: What the first picture of a scan shows; the second one has all others.
FIRST = (TRUE, PDBS_LINES, "iepf:paper", PAPER, LIU, "optimal")
#: Scans of a recording, one of which is drawn; of the measurements, the share that is shown.
CHOICE, NEAR = 5, 0.98

_COLUMNS = {
    "segments found": ("segments_found", 1),
    "right segments": ("segments_right", 1),
    "F1 of segments": ("segment_f1", 1),
    "corners found": ("corners_found", 1),
    "right corners": ("corners_right", 1),
    "F1 of corners": ("corner_f1_0.10", 1),
}


def run(setting: Setting, progress: Progress) -> Findings:
    """Score and draw scans of simulated scenes and of recordings."""
    methods = fitted_methods(setting.methods)
    tables, figures = [], []
    numbers: dict[str, Any] = {}
    everything = dict.fromkeys(methods, Scores())
    for kind in INDOORS:
        progress(f"{kind}: all methods")
        scenes = scene_numbers(setting.frames, setting.seed)
        frames = list(simulated_frames(SENSORS["paper"], [kind], scenes))
        scores = {
            name: [evaluate(extract(frame.scan), frame.truth) for frame in frames]
            for name, extract in methods.items()
        }
        totals = {name: Scores.total(of) for name, of in scores.items()}
        everything = {name: everything[name] + total for name, total in totals.items()}
        rows = numbers[kind] = {name: _numbers(total) for name, total in totals.items()}
        some = next(iter(totals.values()))
        note = (
            f"{len(frames)} scans. True segments: {some.segments.counts.true}, true corners: "
            f"{some.corners.counts.true}, both sides of 6 beams or more."
        )
        tables.append(Table.of_numbers(f"Scans of a simulated {kind}", rows, _COLUMNS, note))
        of_frames = [Scores.total(of) for of in zip(*scores.values(), strict=True)]
        corners = [len(frame.truth.corners) for frame in frames]
        full = [k for k, count in enumerate(corners) if count >= np.median(corners)]
        f1 = [scores.segments.counts.f1 for scores in of_frames]
        frame = frames[median_of(full, f1.__getitem__)]
        about = (
            f"Simulated {kind}: of {len(full)} of {len(frames)} scans, those with most corners, "
            "the one with the median F1 of the segments of all methods together"
        )
        found = {name: extract(frame.scan) for name, extract in methods.items()}
        figures += pictures(f"fig11-{kind}", about, frame.scan, {TRUE: frame.truth} | found)
    for name, scans in recorded_scans(setting, CHOICE):
        progress(f"{name}: all methods")
        errors = [
            SimilarityScores.total(similarity_scores(scan, e(scan)) for e in methods.values()).mean
            for scan in scans
        ]
        scan = scans[median_of(range(len(scans)), errors.__getitem__)]
        comparison = compare_scan(scan, methods, title=f"{name}, one scan")
        table = comparison.table(times=False)
        tables.append(table)
        about = (
            f"{name}: of {CHOICE} scans from equal parts of the recording the one with the median "
            "mean similarity error of all methods together"
        )
        where = f"fig11-{name.lower().replace(' ', '-')}"
        figures += pictures(where, about, scan, comparison.features)[:1]
        numbers[name] = {
            str(m): dict(zip(table.columns[1:], of, strict=True)) for m, *of in table.rows
        }
    return Findings(
        "The methods side by side (Figure 11)",
        (
            "The paper compares its method with PDBS and IEPF on one scan. PDBS, which finds "
            "clusters only, fits one line to each and cuts corners off; IEPF cuts at corners; the "
            "paper’s method does so within its clusters. By the letter of equation 22 it misses "
            "corners nearer than some 3 m; by the reading of liu:figure9 it also cuts at points "
            "beside corners, and at noise on near walls. Its results with better last steps (liu), "
            "and with the numbers that it was tuned to, are shown beside. Of recordings, "
            "further methods are in the tables alone.",
        ),
        tuple(tables),
        tuple(figures),
        numbers | {"segment_f1": {n: s.segments.counts.f1 for n, s in everything.items()}},
    )


def _numbers(scores: Scores) -> dict[str, float]:
    counts = {"corners": scores.corners.counts, "segments": scores.segments.counts}
    found = {f"{kind}_found": of.found for kind, of in counts.items()}
    return found | {f"{kind}_right": of.correct for kind, of in counts.items()} | scores.summary()


def pictures(name: str, about: str, scan: LaserScan, found: Mapping[str, Features]) -> list[Figure]:
    """Draw the features of a scan, a panel for each method: those of `FIRST`, then the others."""
    ranges = scan.ranges[scan.valid]
    farthest = 1.1 * float(np.quantile(ranges, NEAR)) if len(ranges) else np.inf
    beyond = int((ranges > farthest).sum())
    left_out = f" {beyond} points beyond {farthest:.0f} m are left out." if beyond else ""
    first = {method: found[method] for method in FIRST if method in found}
    others = {m: found[m] for m in found if m not in first and is_drawn(m)}
    figures = []
    for part, shown in (("", first), ("-others", others)):
        if shown:
            figure = scan_figure(scan, shown, panel=canvas.PAGE_WIDTH / 3, farthest=farthest)
            caption = f"{about}{', further methods' if part else ''}.{left_out}"
            figures.append(Figure(name + part, caption, canvas.figure_bytes(figure)))
    return figures
