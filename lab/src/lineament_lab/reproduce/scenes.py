"""Figure 11: what the methods find, side by side, in simulated scenes and in recordings."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lineament.features import Features
from lineament.output import canvas
from lineament.output.figures import scan_figure
from lineament.scan import LaserScan

from ..evaluation.scores import Scores
from ..evaluation.similarity import similarity_scores
from .contenders import IEPF, LIU, PAPER, PDBS_LINES, by_letter, fitted_methods, is_drawn
from .experiment import Claim, Experiment, Margins, Measured, Report, better
from .findings import Figure, Progress, Setting, Table
from .prose import prose
from .scans import INDOORS, frames_of, median_scan, recorded_scans, scored, totals
from .similarity import COUNTS, SIMILARITY_NOTE, counts_of

TRUE = "true features"
#: What the first picture of a scan shows; the second one has all others.
FIRST = (TRUE, PDBS_LINES, IEPF, PAPER, LIU, "optimal")
#: Scans of a recording, one of which is drawn; of the measurements, the share that is shown.
CHOICE, NEAR = 5, 0.98

_COLUMNS = {
    "segments found": "segments_found",
    "right segments": "segments_right",
    "F1 of segments": "segment_f1",
    "corners found": "corners_found",
    "right corners": "corners_right",
    "F1 of corners": "corner_f1_0.10",
}


def measure(setting: Setting, progress: Progress) -> Measured:
    """Score scans of simulated scenes, and compare the methods on one of each recording."""
    methods = fitted_methods(setting.methods)
    numbers: dict[str, Any] = {}
    drawn: list[tuple[str, str, LaserScan, Mapping[str, Features]]] = []
    everything = dict.fromkeys(methods, Scores())
    for kind in INDOORS:
        frames = frames_of(setting, [kind])
        scores = scored(methods, frames, progress, kind)
        of_kind = totals(scores)
        everything = {name: everything[name] + total for name, total in of_kind.items()}
        numbers[kind] = {name: _numbers(total) for name, total in of_kind.items()}
        corners = [len(frame.truth.corners) for frame in frames]
        full = [k for k, count in enumerate(corners) if count >= np.median(corners)]
        frame = frames[median_scan(scores, lambda of: of.segments.counts.f1, full)]
        (about,) = prose("fig11-simulated", kind=kind, full=len(full), frames=len(frames))
        found = {name: extract(frame.scan) for name, extract in methods.items()}
        drawn.append((f"fig11-{kind}", about, frame.scan, {TRUE: frame.truth} | found))
    for name, scans in recorded_scans(setting, CHOICE):
        progress(f"{name}: all methods")
        errors = {
            method: [similarity_scores(scan, extract(scan)) for scan in scans]
            for method, extract in methods.items()
        }
        scan = scans[median_scan(errors, lambda of: of.mean)]
        found = {method: extract(scan) for method, extract in methods.items()}
        numbers[name] = {m: counts_of(scan, of) for m, of in found.items()}
        (about,) = prose("fig11-recorded", log=name, scans=CHOICE)
        first = {method: of for method, of in found.items() if method in FIRST}
        drawn.append((f"fig11-{name.lower().replace(' ', '-')}", about, scan, first))
    numbers["segment_f1"] = {name: s.segments.counts.f1 for name, s in everything.items()}
    return Measured(numbers, lambda: [f for picture in drawn for f in pictures(*picture)])


def report(n: Any, setting: Setting) -> Report:
    """Make a table for each kind of scene, and for each recording."""
    tables = []
    for kind in INDOORS:
        true = next(iter(n[kind].values()))
        counts = {of: true[f"{of}_true"] for of in ("segments", "corners")}
        (note,) = prose("notes of scenes", scans=setting.frames, **counts)
        tables.append(Table.of_numbers(f"Scans of a simulated {kind}", n[kind], _COLUMNS, note))
    recorded = (name for name in n if name not in (*INDOORS, "segment_f1"))
    tables += [
        Table.of_numbers(f"{name}, one scan", n[name], COUNTS, SIMILARITY_NOTE) for name in recorded
    ]
    return prose("scenes"), tables


def _numbers(scores: Scores) -> dict[str, float]:
    numbers: dict[str, float] = {}
    for kind, of in (("corners", scores.corners.counts), ("segments", scores.segments.counts)):
        numbers |= {f"{kind}_found": of.found, f"{kind}_right": of.correct, f"{kind}_true": of.true}
    return numbers | scores.summary()


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


def _judged(n: Any, method: str) -> tuple[str, Margins]:
    found = n["segment_f1"]
    others = (found[name] for name in (PDBS_LINES, IEPF))
    return f"{found[method]:.2f}", [better(found[method], other) for other in others]


_JUDGE = by_letter("F1 of lines", _judged, PDBS_LINES, IEPF)
CLAIM = Claim("Figure 11", "Better lines than PDBS and IEPF", _JUDGE, "fig11-room")
EXPERIMENT = Experiment("The methods side by side (Figure 11)", measure, report, (CLAIM,))
