"""What the paper leaves open: its claims for every value of the parameters that it does not state.

One parameter at a time, and the two together that matter most; the thresholds of PDBS and IEPF,
which the paper does not state either, likewise.
"""

from collections.abc import Iterable, Mapping
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from lineament.extractor import Extractor
from lineament.features import Features
from lineament.scan import LaserScan
from lineament.simulation import SCENES

from ..evaluation.counts import Counts
from ..evaluation.kinds import corner_scores
from ..evaluation.partition import PartitionScores, partition_scores
from .contenders import IEPF, PAPER
from .experiment import Experiment, Measured, Report
from .findings import Columns, Progress, Setting, Table, each
from .grid import FORMS, GATE
from .prose import prose
from .scans import Frame, batch_of, filtered, frames_of
from .two_corners import POSES, found_distances, views

#: Changes of `liu:paper` by parameter and value.
OPEN: dict[str, dict[str, dict[str, Any]]] = {
    "half-width of the filter [beams]": {str(h): {"half_width": h} for h in (0, 1, 2, 4, 8)},
    "passes of the filter": {str(n): {"passes": n} for n in (1, 2, 3)},
    "4 and 0.3 of the filter": {
        "standard deviations": {},
        "variances": {"sigma_d": 2.0, "sigma_r": 0.3**0.5},
    },
    "λ": {f"{scale:g}": {"spacing_scale": scale} for scale in (3.0, 4.0, 6.0, 8.0, 12.0)},
    "k": {f"{k:g}": {"density_k": k} for k in (0.0, 1.0, 2.0, 3.0, 5.0)},
    "form of the response": {form: {"response": form} for form in FORMS},
    "recursion": {side: {"recursion": side} for side in ("both", "after")},
    "support at ends of clusters": {ends: {"ends": ends} for ends in ("truncated", "excluded")},
}
#: The two that matter most for corners.
TOGETHER = "half-width of the filter [beams]", "form of the response"
#: D_0 of PDBS, and the tolerance of IEPF [m].
DISTANCES = (0.1, 0.15, 0.2, 0.3, 0.5, 0.8, 1.2)
TOLERANCES = (0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3)
#: What is measured, and what the paper reports of it.
SHOWN: dict[str, tuple[str, float | None]] = {
    "clusters right [%]": ("clusters", 95.11),
    "corners found [%]": ("recall", 92.62),
    "their precision [%]": ("precision", None),
    "both corners found [%]": ("both", 100.0),
}
_COLUMNS: Columns = {label: (key, 1) for label, (key, _) in SHOWN.items()}
_BANDS: Columns = {
    "paper": "paper",
    "liu:paper": "default",
    "least of all": "low",
    "greatest of all": "high",
    "most by": "by",
}
#: Clusters of IEPF, and what they are.
IEPF_CLUSTERS = {
    "none": "as published: of the whole scan",
    "fixed": "within clusters that end at 0.3 m",
}
#: Scans of mixed scenes, and from each of the five places, for each frame of the setting.
SCANS_A_FRAME, VIEWS_A_FRAME = 6, 4


class _Data(NamedTuple):
    """Frames of mixed scenes, and scans from each of the five places."""

    frames: list[Frame]
    views: list[list[LaserScan]]


def measure(setting: Setting, progress: Progress) -> Measured:
    """Measure the claims of the paper for all values of what it leaves open."""
    frames = frames_of(setting, SCENES, SCANS_A_FRAME)
    data = _Data(frames, views(setting.seed, 14, VIEWS_A_FRAME * setting.frames))

    def measured(what: str, variants: Mapping[str, Any], method: str = PAPER) -> dict[str, Any]:
        some = each(variants, progress, what)
        return {name: _measured(data, method, **changes) for name, changes in some}

    alone = {name: measured(name, values) for name, values in OPEN.items()}
    pairs = product(*(OPEN[name].items() for name in TOGETHER))
    both = {f"{row}, {column}": changes | more for (row, changes), (column, more) in pairs}
    default = _measured(data, PAPER)
    distances = {f"{d:g} m": {"rule": "fixed", "distance": d} for d in DISTANCES}
    return Measured(
        {
            "default": default,
            "bands": _bands(default, alone),
            "alone": alone,
            "together": measured("together", both),
            "pdbs": measured("PDBS", distances, "pdbs"),
            "iepf": {
                clusters: measured(f"IEPF {about}", _tolerances(clusters), IEPF)
                for clusters, about in IEPF_CLUSTERS.items()
            },
        }
    )


def report(n: Any, _: Setting) -> Report:
    """Make a table of bands, one for each parameter, two of two together, and of the rivals."""
    bands = {
        label: {"paper": paper, "default": n["default"][key], **n["bands"][key]}
        for label, (key, paper) in SHOWN.items()
    }
    note = "Least and greatest: over all values of the parameters below, one changed at a time."
    tables = [Table.of_numbers("Bands of what the paper leaves open", bands, _BANDS, note, "")]
    tables += [Table.of_numbers(name, of, _COLUMNS, "", "value") for name, of in n["alone"].items()]
    rows, columns = (list(OPEN[name]) for name in TOGETHER)
    for title, key in (("Corners found [%]", "recall"), ("Both corners found [%]", "both")):
        found = {row: {c: n["together"][f"{row}, {c}"][key] for c in columns} for row in rows}
        title = f"{title} by half-width of the filter and form of the response"
        shown = {column: (column, 1) for column in columns}
        tables.append(Table.of_numbers(title, found, shown, "", "half-width"))
    clusters = {label: _COLUMNS[label] for label in list(SHOWN)[:1]}
    tables.append(Table.of_numbers("PDBS by its distance D_0", n["pdbs"], clusters, "", "D_0"))
    for key, about in IEPF_CLUSTERS.items():
        title = f"IEPF by its tolerance, {about}"
        tables.append(Table.of_numbers(title, n["iepf"][key], _COLUMNS, "", "tolerance"))
    return prose("sensitivity"), tables


def _tolerances(clusters: str) -> dict[str, dict[str, Any]]:
    return {f"{t:g} m": {"threshold": t, "clusters": clusters} for t in TOLERANCES}


def _measured(data: _Data, method: str, passes: int = 1, **changes: Any) -> dict[str, float]:
    """Measure a method by the names in `SHOWN` [%]; ranges are filtered `passes` times."""
    extractor = Extractor(method, **changes)

    def found_in(scans: Iterable[LaserScan]) -> list[Features]:
        """Filter scans, which the method does once more, and extract."""
        return batch_of(extractor, (filtered(scan, passes - 1) for scan in scans))

    found = found_in(frame.scan for frame in data.frames)
    pairs = [(features, frame.truth) for features, frame in zip(found, data.frames, strict=True)]
    clusters = PartitionScores.total(partition_scores(*pair) for pair in pairs)
    corners = Counts.total(corner_scores(*pair).by_gate[GATE] for pair in pairs)
    seen = zip(data.views, POSES, strict=True)
    both = sum(len(found_distances(found_in(scans), pose)) for scans, pose in seen)
    shares = {
        "clusters": clusters.success,
        "recall": corners.recall,
        "precision": corners.precision,
        "both": both / sum(map(len, data.views)),
    }
    return {name: 100 * share for name, share in shares.items()}


def _bands(
    default: Mapping[str, float], alone: Mapping[str, Mapping[str, Mapping[str, float]]]
) -> dict[str, dict[str, Any]]:
    """Return the least and the greatest of each measure, and the parameter that moves it most."""
    bands = {}
    for key in default:
        known = {
            name: sorted(of[key] for of in values.values() if not np.isnan(of[key]))
            for name, values in alone.items()
        }
        spans = {name: span for name, span in known.items() if span} or {"": [np.nan]}
        by = max(spans, key=lambda name: spans[name][-1] - spans[name][0])
        ends = [end for span in spans.values() for end in (span[0], span[-1])]
        bands[key] = {"low": min(ends), "high": max(ends), "by": by}
    return bands


EXPERIMENT = Experiment("What the paper leaves open", measure, report)
