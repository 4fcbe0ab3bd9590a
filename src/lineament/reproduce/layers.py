"""Figures 5 and 10: the clusters of layered obstacles, and all methods on them."""

import math
from collections.abc import Mapping

import numpy as np

from ..evaluation.partition import PartitionScores, partition_scores
from ..extractor import Extractor
from ..features import Features
from ..methods.pdbs import RULES
from ..output import canvas, drawing
from ..scan import LaserScan
from ..simulation import SENSORS
from .contenders import drawn_methods
from .findings import Figure, Findings, Progress, Setting, Table
from .scans import scene_numbers, simulated_frames
from .scenes import RED_NUMBERS, picture

#: What the paper reports of ten frames of its recording [%].
PAPER = {"liu": 95.11, "liu:paper": 95.11, "pdbs, fixed": 83.55}
_COLUMNS = {
    "success, paper [%]": ("paper", 1),
    "success, here [%]": ("success", 100),
    "breakpoints: precision": ("breakpoint_precision", 1),
    "recall": ("breakpoint_recall", 1),
    "F1": ("breakpoint_f1", 1),
    "Rand index": ("rand_index", 1),
}


def run(setting: Setting, progress: Progress) -> Findings:
    """Score the clusters of layered obstacles, and draw the results of all methods on one scan."""
    scenes = scene_numbers(4 * setting.frames, setting.seed)
    rules = {f"pdbs, {rule}": Extractor("pdbs", rule=rule) for rule in RULES}
    methods = {"liu": Extractor("liu"), "liu:paper": Extractor("liu:paper"), **rules}
    numbers, lead, tables = {}, {}, []
    for sensor in ("paper", "utm30lx"):
        progress(f"clusters, {sensor}")
        frames = list(simulated_frames(SENSORS[sensor], ["layers"], scenes))
        scores = {
            name: PartitionScores.total(partition_scores(e(f.scan), f.truth) for f in frames)
            for name, e in methods.items()
        }
        numbers[sensor] = {name: score.summary() for name, score in scores.items()}
        success = 100 * (scores["liu"].success - scores["pdbs, fixed"].success)
        lead[sensor] = f"{success:+.1f}".replace("-", "−")
        rows = {n: {"paper": PAPER.get(n, math.nan)} | of for n, of in numbers[sensor].items()}
        title = f"Clusters of layered obstacles, sensor “{sensor}”"
        tables.append(Table.of_numbers(title, rows, _COLUMNS, f"{len(scenes)} scans."))
    progress("drawing")
    mixed, example = scores["liu"].regions, frames[0]
    few = {name: methods[name](example.scan) for name in ("liu", "pdbs, fixed")}
    found = {name: e(example.scan) for name, e in drawn_methods(setting, progress).items()}
    caption = (
        "The same scan by all methods. Figure 10 of the paper shows 11 clusters and 5 corners of a "
        f"separate scene. {RED_NUMBERS}"
    )
    return Findings(
        "Layered obstacles (Figures 5 and 10)",
        (
            "Several levels of obstacles stand one behind the other before a back wall. A cluster "
            "is right if it has the beams of the true one, but for one at each end or a tenth of "
            "them; a breakpoint, if the beams on both its sides are within one of the true ones. "
            "The paper’s numbers are of ten frames of a recording that is not used here. It does "
            "not name the rule and the threshold of its PDBS: a fixed distance of 0.3 m and the "
            "adaptive rules of the literature are compared.",
            "The paper reports a lead of 11.6 points over PDBS. Over a fixed distance it is "
            f"{lead['paper']} points here with the paper’s scanner and {lead['utm30lx']} with one "
            "whose ranges mix both depths at edges (utm30lx), where it finds "
            f"{mixed.found} clusters for {mixed.true} true ones.",
        ),
        tuple(tables),
        (
            _clusters(example.scan, {"true clusters": example.truth} | few),
            picture("fig10", caption, example.scan, {"true features": example.truth} | found),
        ),
        numbers,
    )


def _clusters(scan: LaserScan, found: Mapping[str, Features]) -> Figure:
    """Draw the clusters alone, side by side, with the ends of surfaces."""
    figure = canvas.new_figure(5 * len(found), 5)
    for axes, (name, features) in zip(figure.subplots(1, len(found)), found.items(), strict=True):
        shown = drawing.draw_beams(axes, scan, features.clusters)
        clusters = len(np.unique(features.clusters[features.clusters >= 0]))
        canvas.style_plane(axes, name, canvas.count(clusters, "cluster"), shown)
        drawing.draw_breakpoints(axes, features.breakpoints)
    return Figure(
        "fig5",
        "A scan of layered obstacles with mixed pixels at edges (utm30lx): true clusters, those of "
        "the paper’s method, and those of PDBS with a fixed distance. Grey crosses are noise, "
        "rings breakpoints.",
        canvas.figure_bytes(figure),
    )
