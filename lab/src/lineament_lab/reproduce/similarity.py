"""Figure 12: how many measurements are explained, and how far they are from their lines."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from lineament.extractor import Extractor
from lineament.features import Features
from lineament.methods import DEFAULT_METHOD
from lineament.output import canvas, drawing
from lineament.scan import LaserScan

from ..evaluation.counts import ratio
from ..evaluation.similarity import SimilarityScores, similarity_errors, similarity_scores
from .contenders import IEPF, LIU, PAPER, PDBS_LINES, Extract, by_letter, fitted_methods
from .experiment import Claim, Experiment, Margins, Measured, Report
from .findings import Columns, Figure, Numbers, Progress, Setting, Table
from .prose import prose
from .scans import INDOORS, filtered, frames_of, median_scan, recorded_scans

#: How many measurements a method explains, and how far they are from its lines and arcs.
SIMILARITY = {
    "explained [%]": "similarity_explained",
    "mean error [mm]": "similarity_mean",
    "RMS [mm]": "similarity_rms",
    "95 % [mm]": "similarity_p95",
    "largest [mm]": "similarity_maximum",
}
#: The same, and how many features there are.
COUNTS: Columns = {k: k for k in ("segments", "corners", "arcs", "clusters")} | SIMILARITY
SIMILARITY_NOTE, _VARIANCE = prose("notes of similarity")
#: The literal pipeline, by the points that its lines are fitted to.
FILTERED = f"{PAPER}, filtered points"
#: What the paper says of its largest errors; its other values are lost.
OF_PAPER = {
    PAPER: "within 10 mm",
    FILTERED: "within 10 mm",
    IEPF: "up to 250 mm",
    PDBS_LINES: "up to 250 mm",
}
#: What its Figure 12 shows, its method with better last steps, and the default.
SHOWN = (PAPER, LIU, IEPF, PDBS_LINES, DEFAULT_METHOD)
SIMULATED, TRUE = "simulated rooms, corridors and halls", "the true lines"
#: An error that the paper calls small [m].
SMALL = 0.01
_COLUMNS: Columns = {
    **SIMILARITY,
    "largest, paper": "paper",
    "within 10 mm [%]": "small",
}


def feature_counts(features: Features) -> dict[str, int]:
    """Return how many features and clusters there are, by kind."""
    numbers = {kind: len(getattr(features, kind)) for kind in ("segments", "corners", "arcs")}
    return numbers | {"clusters": int(features.clusters.max(initial=-1)) + 1}


def counts_of(scan: LaserScan, features: Features) -> dict[str, Any]:
    """Return the numbers of `COUNTS` for one scan."""
    return feature_counts(features) | similarity_scores(scan, features).summary()


def measure(setting: Setting, progress: Progress) -> Measured:
    """Measure similarity errors on simulated scans and on recordings."""
    methods = fitted_methods(setting.methods)
    frames = frames_of(setting, INDOORS, len(INDOORS))
    scans = {SIMULATED: [frame.scan for frame in frames]}
    scans |= dict(recorded_scans(setting, setting.frames))
    numbers: dict[str, dict[str, dict[str, float]]] = {}
    drawn: dict[str, LaserScan] = {}
    for where, some in scans.items():
        progress(f"{where}: {len(some)} scans")
        parts = {
            name: [similarity_scores(scan, extract(scan)) for scan in some]
            for name, extract in methods.items()
        }
        literal = Extractor(PAPER)
        parts[FILTERED] = [similarity_scores(filtered(scan), literal(scan)) for scan in some]
        if where == SIMULATED:
            parts = {TRUE: [similarity_scores(f.scan, f.truth) for f in frames]} | parts
        numbers[where] = {name: _numbers(SimilarityScores.total(of)) for name, of in parts.items()}
        drawn[where] = some[median_scan({PAPER: parts[PAPER]}, lambda of: of.maximum)]
    return Measured(
        numbers, lambda: [_figure(where, scan, methods) for where, scan in drawn.items()]
    )


def _numbers(scores: SimilarityScores) -> dict[str, float]:
    small = ratio(int((scores.errors <= SMALL).sum()), len(scores.errors))
    return scores.summary() | {"small": small}


def report(n: Numbers, _: Setting) -> Report:
    """Make a table for the simulated scans, and for each recording."""
    tables = (
        Table.of_numbers(
            f"Similarity error: {where}",
            {method: {"paper": OF_PAPER.get(method), **of} for method, of in found.items()},
            _COLUMNS,
            f"{SIMILARITY_NOTE} {_VARIANCE}",
        )
        for where, found in n.items()
    )
    true, liu = (n[SIMULATED][method] for method in (TRUE, PAPER))
    text = prose(
        "similarity",
        beyond=100 * (1 - true["small"]),
        farthest=1e3 * true["similarity_maximum"],
        explained=100 * liu["similarity_explained"],
        largest=liu.get("similarity_maximum", math.nan),
    )
    # Of nothing that is explained there is no largest error to speak of.
    return text if "similarity_maximum" in liu else text[:-1], tables


def error_strips(scan: LaserScan, found: Mapping[str, Features]) -> Any:
    """Draw the similarity error of each beam, a strip for each method."""
    figure, panels = canvas.new_panels(len(found), 1, height=0.25, sharex=True)
    for axes, (name, features) in zip(panels, found.items(), strict=True):
        errors = similarity_errors(scan, features)
        drawing.draw_errors(axes, scan, errors)
        about = f"{name}: {100 * np.isfinite(errors).sum() / scan.valid.sum():.0f} % explained"
        axes.set_title(about, loc="right", fontsize="medium", fontweight="bold", color=canvas.INK)
        axes.label_outer()
        axes.set_yticks([1e-3, 1e-2, 0.1, 1.0], ["1 mm", "1 cm", "0.1 m", "1 m"])
        axes.minorticks_off()
        axes.axhline(SMALL, color=canvas.CORNER_COLOR, linestyle="--")
    return figure


def _figure(where: str, scan: LaserScan, methods: dict[str, Extract]) -> Figure:
    figure = error_strips(scan, {name: methods[name](scan) for name in SHOWN})
    least = f"{1e3 * drawing.LEAST_ERROR:g} mm"
    name = "-".join(["fig12", *where.lower().replace(",", "").split()[:2]])
    return Figure.of(name, figure, "fig12", where=where, least=least)


def _judged(n: Any, method: str) -> tuple[str, Margins]:
    most = n[SIMULATED][method].get("similarity_maximum", math.nan)
    return "nothing explained" if math.isnan(most) else f"{most:.2f} m", [SMALL - most]


_JUDGE = by_letter("Largest error", _judged, IEPF, PDBS_LINES)
CLAIM = Claim("Figure 12", "Errors within 0.01 m; PDBS and IEPF up to 0.25 m", _JUDGE)
EXPERIMENT = Experiment("Similarity error (Figure 12)", measure, report, (CLAIM,))
