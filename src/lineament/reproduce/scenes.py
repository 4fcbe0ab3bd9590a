"""Figure 11: what the methods find, side by side, in simulated scenes and in recordings."""

from collections.abc import Mapping

from ..evaluation.scores import evaluate
from ..features import Features
from ..output import canvas
from ..output.figures import scan_figure
from ..scan import LaserScan
from ..simulation import SENSORS
from .compare import compare_scan
from .contenders import drawn_methods
from .findings import Figure, Findings, Progress, Setting, Table
from .scans import INDOORS, recorded_scans, scene_numbers, simulated_frames

#: What the numbers in the pictures are.
RED_NUMBERS = "Red numbers: response of the corner, in the unit of the method."
#: Scans of a recording, one of which is drawn.
CHOICE = 5

_COLUMNS = {
    "segments found": ("segments_found", 1),
    "right segments": ("segments_right", 1),
    "F1 of segments": ("segment_f1", 1),
    "corners found": ("corners_found", 1),
    "right corners": ("corners_right", 1),
    "F1 of corners": ("corner_f1_0.10", 1),
}


def run(setting: Setting, progress: Progress) -> Findings:
    """Draw scans of simulated scenes and of recordings, and count what is found in them."""
    methods = drawn_methods(setting, progress)
    tables, figures = [], []
    for kind in INDOORS:
        progress(f"{kind}: drawing all methods")
        numbers = scene_numbers(1, setting.seed)
        (frame,) = simulated_frames(SENSORS["paper"], [kind], numbers)
        found = {name: extract(frame.scan) for name, extract in methods.items()}
        rows = {}
        for name, features in found.items():
            scores = evaluate(features, frame.truth)
            corners, segments = scores.corners.counts, scores.segments.counts
            rows[name] = {
                "segments_found": segments.found,
                "segments_right": segments.correct,
                "corners_found": corners.found,
                "corners_right": corners.correct,
                **scores.summary(),
            }
        note = (
            f"True segments: {segments.true}, true corners: {corners.true}, both sides of 6 beams "
            "or more."
        )
        tables.append(Table.of_numbers(f"One scan of a simulated {kind}", rows, _COLUMNS, note))
        caption = f"Simulated {kind}: the true features, and what each method finds. {RED_NUMBERS}"
        shown = {"true features": frame.truth} | found
        figures.append(picture(f"fig11-{kind}", caption, frame.scan, shown))
    for name, scans in recorded_scans(setting, CHOICE):
        progress(f"{name}: drawing all methods")
        # One far point would make a picture of small dots: the scan that reaches the least far.
        nearest = min(scans, key=lambda scan: float(scan.ranges[scan.valid].max(initial=0.0)))
        comparison = compare_scan(nearest, methods, title=f"{name}, one scan")
        tables.append(comparison.table(times=False))
        caption = (
            f"{name}: what each method finds in one scan: of {CHOICE} from equal parts of the "
            f"recording, the one that reaches the least far. {RED_NUMBERS}"
        )
        where = f"fig11-{name.lower().replace(' ', '-')}"
        figures.append(picture(where, caption, nearest, comparison.features))
    return Findings(
        "The methods side by side (Figure 11)",
        (
            "The paper compares its method with PDBS and IEPF on one scan. PDBS, which finds "
            "clusters only, fits one line to each and cuts corners off; IEPF cuts at corners; the "
            "paper’s method does so within its clusters. With the paper’s numbers liu finds few "
            "corners indoors: right angles nearer than some 3 m do not reach a sum of distances "
            "of 0.66 m, and a cluster without corners gets one line, as with PDBS. Its results "
            "with the best numbers of Figure 9 are shown beside.",
        ),
        tuple(tables),
        tuple(figures),
        {table.title: table.to_dict()["rows"] for table in tables},
    )


def picture(name: str, caption: str, scan: LaserScan, found: Mapping[str, Features]) -> Figure:
    """Draw the features of a scan, a panel for each method."""
    return Figure(name, caption, canvas.figure_bytes(scan_figure(scan, found), dpi=100))
