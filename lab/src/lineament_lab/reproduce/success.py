"""Table 3: success of partition and of corners, and time, for `liu`, PDBS and IEPF."""

import math
from typing import Any

import numpy as np

from lineament.extractor import Extractor
from lineament.simulation import SCENES

from ..evaluation.scores import Scores
from ..methods.controls import BlindCut
from .contenders import BLIND, FIGURE_9, IEPF, LIU, PAPER, by_letter, liu_methods
from .experiment import Claim, Experiment, Judged, Margins, Measured, Report, better
from .findings import Progress, Setting, Table
from .prose import prose
from .scans import frames_of, interleaved_times, scored, time_ratio
from .seeds import by_seed

Paper = dict[str, tuple[float, tuple[float, float]]]
#: What the paper says: success, and the range of the time per frame [ms].
PAPER_PARTITION: Paper = {"liu": (0.9511, (9.6, 25.3)), "pdbs": (0.8355, (15.8, 36.3))}
PAPER_CORNERS: Paper = {"liu": (0.9262, (21.6, 38.2)), "iepf": (0.7251, (29.9, 53.4))}
#: Everything is also measured on so many times the frames, as ten frames have few corners.
MORE = 10
#: No corner has such a response: `liu` then makes clusters and nothing else, as PDBS does.
_NO_CORNERS = 1e9
#: What is counted: title, the number of its success, and what the paper says.
_KINDS = {
    "clusters": ("partition: correct clusters", "partition_success", PAPER_PARTITION),
    "corners": ("corners: correct corners", "corner_recall_0.10", PAPER_CORNERS),
}
#: A ratio of times is another one if it is off by this factor in all rounds and seeds.
CLEAR = 2.0
#: IEPF within clusters that end at 0.3 m.
IN_CLUSTERS = f"{IEPF}, in clusters"
#: What is timed against what, and the ratio that the paper's times give.
RATIO_PDBS, RATIO_IEPF = "partition: liu ÷ PDBS", "corners: liu ÷ IEPF"
_RATIOS = (
    (RATIO_PDBS, "0.61 – 0.70", "liu:paper, no corners", "pdbs, fixed 0.3 m"),
    ("partition: liu ÷ PDBS (Borges, Aldon)", None, "liu:paper, no corners", "pdbs"),
    (RATIO_IEPF, "0.72", PAPER, IEPF),
    ("corners: liu:figure9 ÷ IEPF", None, FIGURE_9, IEPF),
    ("corners: liu with better last steps ÷ iepf", None, LIU, "iepf"),
)


def measure(setting: Setting, progress: Progress) -> Measured:
    """Measure the success of partition and of corners, and the time per frame."""
    progress("simulating")
    few, frames = setting.frames, frames_of(setting, SCENES, MORE)
    methods = {
        "liu:paper, no corners": Extractor("liu:paper", threshold=_NO_CORNERS),
        "liu, no corners": Extractor("liu", threshold=_NO_CORNERS),
        "pdbs, fixed 0.3 m": Extractor("pdbs", rule="fixed"),
        "pdbs": Extractor("pdbs"),
        **liu_methods(),
        IEPF: Extractor(IEPF),
        IN_CLUSTERS: Extractor(IEPF, clusters="fixed"),
        "iepf": Extractor("iepf"),
        BLIND: Extractor(BlindCut()),
    }
    rounds = interleaved_times(methods, [frame.scan for frame in frames[:few]])
    numbers: dict[str, Any] = {}
    for name, scores in scored(methods, frames, progress, "frames").items():
        some, many = Scores.total(scores[:few]), Scores.total(scores)
        numbers[name] = {"few": _numbers(some), "many": _numbers(many)}
        numbers[name]["seconds"] = np.median(rounds[name], axis=0)
    ratios = {about: time_ratio(rounds[one], rounds[other]) for about, _, one, other in _RATIOS}
    return Measured({**numbers, "ratios": ratios})


def _numbers(scores: Scores) -> dict[str, float]:
    """Return the summary, the corners that are right and the true ones, and these of clusters."""
    counts = {"corners": scores.corners.counts, "clusters": scores.partition.regions}
    right = {f"{kind}_right": of.correct for kind, of in counts.items()}
    return scores.summary() | right | {f"{kind}_true": of.true for kind, of in counts.items()}


def report(n: Any, setting: Setting) -> Report:
    """Make the tables of partition and of corners, and that of the ratios of times."""
    *notes, of_times = prose("notes of success")
    tables = []
    for (kind, (title, *_)), note in zip(_KINDS.items(), notes, strict=True):
        names = (name for name in n if name != "ratios" and _kind(name) == kind)
        rows = {name: _row(name, n[name], setting.frames, kind) for name in names}
        columns = {label: label for label in next(iter(rows.values()))}
        tables.append(Table.of_numbers(f"Table 3, {title} of the true ones", rows, columns, note))
    heads = ("", "paper", "here", "least round", "slowest round")
    ratios = tuple((about, paper, *n["ratios"][about]) for about, paper, *_ in _RATIOS)
    tables.append(Table("Ratio of times", heads, ratios, of_times))
    return (*prose("success"), *prose("liu")), tables


def _kind(name: str) -> str:
    is_partition = name.endswith("no corners") or name.startswith("pdbs")
    return "clusters" if is_partition else "corners"


def _row(name: str, of: Any, few: int, kind: str) -> dict[str, object]:
    """Return the row of a method: the paper’s success and time, and those here."""
    _, key, papers = _KINDS[kind]
    success, paper = papers.get(name.split(":")[0].split(",")[0], (None, None))
    row: dict[str, object] = {"paper: success": success}
    for frames, part in ((few, "few"), (MORE * few, "many")):
        some = of[part]
        row[f"here: success, {frames} frames"] = some.get(key)
        right, true = (some[f"{kind}_{which}"] for which in ("right", "true"))
        row[f"{kind} in {frames}"] = f"{right:.0f} of {true:.0f}"
        if kind == "corners":
            row[f"precision in {frames}"] = some.get("corner_precision_0.10")
            row[f"F1 in {frames}"] = some.get("corner_f1_0.10")
    if kind == "clusters":
        for share in ("precision", "recall"):
            row[f"breakpoint {share}"] = of["many"].get(f"partition_breakpoint_{share}")
    row["paper: time [ms]"] = "{:.1f} – {:.1f}".format(*paper) if paper else None
    ends = (1e6 * by_seed(lambda *each, end=end: end(each), *of["seconds"]) for end in (min, max))
    row["here: time [µs]"] = "{:.1f} – {:.1f}".format(*ends)
    return row


def _judged_clusters(n: Any) -> Judged:
    one, other = "liu:paper, no corners", "pdbs, fixed 0.3 m"
    share = {name: n[name]["many"]["partition_success"] for name in (one, other)}
    shown = "; ".join(f"{name} {100 * of:.0f} %" for name, of in share.items())
    return Judged(f"Right clusters: {shown}", [better(share[one], share[other])])


def _judged_corners(n: Any, method: str) -> tuple[str, Margins]:
    names = method, IEPF, IN_CLUSTERS
    recall, *others = (n[name]["many"]["corner_recall_0.10"] for name in names)
    return f"{100 * recall:.0f} %", [better(recall, other) for other in others]


def _judged_times(n: Any) -> Judged:
    """Judge ratios of times, undecided within `CLEAR` of the paper's: a busy machine moves them."""
    parts, margins = [], []
    for about, name, most in (("PDBS", RATIO_PDBS, 0.70), ("IEPF", RATIO_IEPF, 0.72)):
        middle, *ends = n["ratios"][name]
        parts.append(f"{middle:.2f} of {about}")
        known = [value for end in ends for value in getattr(end, "values", (end,))]
        agree = max(known) * CLEAR <= most or min(known) > most * CLEAR
        margins.append(most - float(middle) if agree else math.nan)
    return Judged(", ".join(parts), margins)


_FOUND = by_letter("Found", _judged_corners, IEPF, IN_CLUSTERS)
_TIMES = "“About half”: 0.61–0.70 of PDBS, 0.72 of IEPF"
CLAIMS = (
    Claim("Table 3: partition", "95.11 %, PDBS 83.55 %", _judged_clusters, open="clusters"),
    Claim("Table 3: corners", "92.62 %, IEPF 72.51 %", _FOUND, open="recall"),
    Claim("Table 3: time", _TIMES, _judged_times),
)
TITLE = "Success of partition and of corners, and time (Table 3)"
EXPERIMENT = Experiment(TITLE, measure, report, CLAIMS)
