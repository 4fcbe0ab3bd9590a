"""Figure 11: what the methods find, side by side, in simulated scenes and in recordings."""

from __future__ import annotations

import numpy as np

from ..evaluation.scores import evaluate
from ..output import canvas
from ..output.figures import scan_figure
from ..simulation import SENSORS, scene, truth
from .compare import compare_scan
from .contenders import Extract, drawn_methods
from .findings import Figure, Findings, Progress, Setting, Table
from .frames import scene_numbers
from .recordings import recorded_scans

__all__ = ["RESPONSES", "run"]

#: What the numbers in the pictures are.
RESPONSES = "Red numbers: response of the corner, in the unit of the method."
#: Scans of a recording, one of which is drawn.
CHOICE = 5
#: Kinds of scenes that are drawn.
KINDS = ("room", "corridor", "hall")


def run(setting: Setting, progress: Progress) -> Findings:
    """Draw scans of simulated scenes and of recordings, and count what is found in them."""
    methods = drawn_methods(setting, progress)
    tables, figures = [], []
    for kind in KINDS:
        progress(f"{kind}: drawing all methods")
        table, figure = _simulated(kind, scene_numbers(1, setting.seed)[0], methods)
        tables.append(table)
        figures.append(figure)
    for name, scans in recorded_scans(setting, CHOICE):
        progress(f"{name}: drawing all methods")
        # One far reading would make a picture of small dots: the scan that reaches the least far.
        nearest = min(scans, key=lambda scan: float(scan.ranges[scan.valid].max(initial=0.0)))
        comparison = compare_scan(nearest, methods, title=f"{name}, one scan")
        tables.append(comparison.table(times=False))
        picture = canvas.figure_bytes(comparison.figure(errors=False), dpi=100)
        caption = (
            f"{name}: what each method finds in one scan, of {CHOICE} from equal parts of the "
            f"recording the one that reaches the least far. {RESPONSES}"
        )
        figures.append(Figure(f"fig11-{name.lower().replace(' ', '-')}", caption, picture))
    numbers = {table.title: table.to_dict()["rows"] for table in tables}
    return Findings(
        "The methods side by side (Figure 11)", _TEXT, tuple(tables), tuple(figures), numbers
    )


_TEXT = (
    "The paper compares its method with PDBS and IEPF on one scan: PDBS, which gives regions "
    "alone, fits one line to each and cuts corners off; IEPF cuts at corners; the paper’s method "
    "does so within its classes. With the paper’s own numbers liu finds few corners indoors: a "
    "sum of distances of 0.66 m is not reached by right angles nearer than some 3 m, and a class "
    "without corners is fitted by one line, like PDBS’s. The numbers that its own Figure 9 finds "
    "best are shown beside.",
)


def _simulated(kind: str, number: int, methods: dict[str, Extract]) -> tuple[Table, Figure]:
    world, pose = scene(kind, number)
    sensor = SENSORS["paper"]
    scan = sensor.scan(world, pose, np.random.default_rng([number, 1]))
    true = truth(world, pose, sensor)
    found = {name: extract(scan) for name, extract in methods.items()}
    rows = []
    for name, features in found.items():
        scores = evaluate(features, true)
        corners, segments = scores.corners.counts, scores.segments.counts
        rows.append(
            {
                "method": name,
                "segments found": segments.found,
                "right segments": segments.correct,
                "F1 of segments": segments.f1,
                "corners found": corners.found,
                "right corners": corners.correct,
                "F1 of corners": corners.f1,
            }
        )
    note = (
        f"True segments: {segments.true}, true corners: {corners.true}, both sides of 6 beams or "
        "more."
    )
    picture = scan_figure(scan, {"true features": true} | found)
    caption = f"Simulated {kind}: the true features, and what each method finds. {RESPONSES}"
    figure = Figure(f"fig11-{kind}", caption, canvas.figure_bytes(picture, dpi=100))
    return Table.of_records(f"One scan of a simulated {kind}", rows, note), figure
