"""Figures 5 and 10: the clusters of layered obstacles, and all methods on them."""

from collections.abc import Iterable, Mapping
from typing import Any

from lineament.extractor import Extractor
from lineament.features import Features
from lineament.output import canvas, drawing
from lineament.scan import LaserScan
from lineament.simulation import SENSORS

from ..evaluation.partition import PartitionScores, partition_scores
from ..methods.pdbs import RULES
from .contenders import LIU, PAPER, by_letter, fitted_methods
from .experiment import Claim, Experiment, Judged, Margins, Measured, Report, better
from .findings import Figure, Progress, Setting, Table
from .prose import prose
from .scans import Frame, frames_of, median_scan, scene_numbers, scored, simulated_frames
from .scenes import TRUE, pictures

#: What the paper reports of ten frames of its recording [%].
FIXED = "pdbs, fixed"
OF_PAPER = {PAPER: 95.11, FIXED: 83.55}
#: Clusters and corners of Figure 10, and how many scenes are looked at for such a one.
PAPER_COUNTS, SOUGHT = (11, 5), 400
#: Scans for each frame of the setting; sensors, and what distinguishes them.
SCANS_A_FRAME, SCANNERS = 4, {"paper": "its scanner", "utm30lx": "mixed pixels"}
_COLUMNS = {
    "success, paper [%]": ("paper", 1),
    "success, here [%]": "success",
    "breakpoints: precision": "breakpoint_precision",
    "recall": "breakpoint_recall",
    "F1": "breakpoint_f1",
    "Rand index": "rand_index",
}
_COUNTS = {"clusters": "clusters", "corners": "corners"}


def measure(setting: Setting, progress: Progress) -> Measured:
    """Score the clusters of layered obstacles, and count those of a scene like Figure 10."""
    rules = {f"pdbs, {rule}": Extractor("pdbs", rule=rule) for rule in RULES}
    methods = {PAPER: Extractor(PAPER), LIU: Extractor(LIU), **rules}
    numbers: dict[str, Any] = {}
    for sensor in SCANNERS:
        frames = frames_of(setting, ["layers"], SCANS_A_FRAME, sensor)
        scores = scored(methods, frames, progress, f"clusters, {sensor}", partition_scores)
        found = {name: PartitionScores.total(of) for name, of in scores.items()}
        numbers[sensor] = {name: score.summary() for name, score in found.items()}
    mixed = found[PAPER].regions
    numbers["mixed"] = {"found": mixed.found, "true": mixed.true}
    alike = like_figure_10(setting.seed)
    example = {TRUE: alike.truth}
    example |= {name: e(alike.scan) for name, e in fitted_methods(setting.methods).items()}
    numbers["example"] = {name: _counts(features) for name, features in example.items()}

    def draw() -> Iterable[Figure]:
        """Draw the last frame with the median success of all methods, and the scene."""
        shown = frames[median_scan(scores, lambda of: of.success)]
        few = {name: methods[name](shown.scan) for name in (PAPER, FIXED)}
        yield _clusters(shown.scan, {"true clusters": shown.truth} | few)
        yield from pictures("fig10", prose("fig10")[0], alike.scan, example)

    return Measured(numbers, draw)


def report(n: Any, setting: Setting) -> Report:
    """Make a table for each sensor, and that of the scene."""
    text = prose("layers", paper=_lead(n["paper"]), mixed=_lead(n["utm30lx"]), **n["mixed"])
    note = f"{SCANS_A_FRAME * setting.frames} scans."
    tables = []
    for sensor in SCANNERS:
        rows = {name: {"paper": OF_PAPER.get(name)} | of for name, of in n[sensor].items()}
        title = f"Clusters of layered obstacles, sensor “{sensor}”"
        tables.append(Table.of_numbers(title, rows, _COLUMNS, note))
    rows = {"paper": dict(zip(_COUNTS, PAPER_COUNTS, strict=True))} | n["example"]
    title = "Figure 10: clusters and corners of a scene with as many as the paper’s"
    note = "The paper’s scene is not available."
    return text, (*tables, Table.of_numbers(title, rows, _COUNTS, note))


def _lead(n: Any) -> str:
    return f"{100 * (n[PAPER]['success'] - n[FIXED]['success']):+.1f}".replace("-", "−")


def _counts(features: Features) -> dict[str, int]:
    clusters = int(features.clusters.max(initial=-1)) + 1
    return {"clusters": clusters, "corners": len(features.corners)}


def like_figure_10(seed: int) -> Frame:
    """Return the first scene with the counts of Figure 10, or that which is nearest to them."""

    def off(frame: Frame) -> int:
        counts = _counts(frame.truth).values()
        return sum(abs(a - b) for a, b in zip(counts, PAPER_COUNTS, strict=True))

    frames = simulated_frames(SENSORS["paper"], ["layers"], scene_numbers(SOUGHT, seed))
    best = next(frames)
    for frame in frames:
        if off(best) == 0:
            break
        best = min(best, frame, key=off)
    return best


def _clusters(scan: LaserScan, found: Mapping[str, Features]) -> Figure:
    """Draw the clusters alone, side by side, with the ends of surfaces."""
    figure, panels = canvas.new_panels(len(found), len(found))
    for axes, (name, features) in zip(panels, found.items(), strict=True):
        shown = drawing.draw_beams(axes, scan, features.clusters)
        canvas.style_plane(
            axes, name, canvas.count(_counts(features)["clusters"], "cluster"), shown
        )
        drawing.draw_breakpoints(axes, features.breakpoints)
    return Figure.of("fig5", figure)


def _judged_layers(n: Any) -> Judged:
    parts, margins = [], []
    for sensor, about in SCANNERS.items():
        liu, pdbs = (n[sensor][name]["success"] for name in (PAPER, FIXED))
        parts.append(f"{about}: {100 * liu:.0f} %, PDBS {100 * pdbs:.0f} %")
        margins.append(better(liu, pdbs))
    return Judged(f"Clusters right, {'; '.join(parts)}", margins)


def _judged_counts(n: Any, method: str) -> tuple[str, Margins]:
    true, found = n["example"][TRUE], n["example"][method]
    about = f"{found['clusters']:.0f} and {found['corners']:.0f}"
    return about, [-abs(found[name] - true[name]) for name in true]


_COUNTED = by_letter("A scene with as many", _judged_counts)
CLAIMS = (
    Claim("Figure 5", "Adaptive clusters part the levels of obstacles", _judged_layers, "fig5"),
    Claim("Figure 10", "11 clusters and 5 corners, as in the scene", _COUNTED, "fig10"),
)
EXPERIMENT = Experiment("Layered obstacles (Figures 5 and 10)", measure, report, CLAIMS)
