"""What each figure and table of the paper shows, what is found here, and whether it holds."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from lineament.methods.liu import Liu

from .contenders import BLIND, FIGURE_9, IEPF, LIU, PAPER, PDBS_LINES
from .findings import Findings
from .grid import CRITERIA, RADIUS, THRESHOLD
from .seeds import by_seed
from .success import RATIO_IEPF, RATIO_PDBS
from .two_corners import DISTANCE

#: AR is as large as the largest within this.
FLAT = 0.03
#: A ratio of times is another one if it is off by this factor in all rounds and seeds.
CLEAR = 2.0
#: The words of verdicts, and what they mean.
WORDS = {
    "holds": "in all seeds and all that is compared",
    "in part": "in some",
    "does not": "in none",
    "undecided": "nothing of it can be compared, nothing is found, or times are too much alike",
}
#: What a verdict ends with where cuts at every eighth point, without a detector, hold as well.
BLIND_TOO = "; blind cuts, too"

Margins = Sequence[float]


class Judged(NamedTuple):
    """What is found here, and margins: numbers or `Spread`, not negative where the claim holds.

    NaN is undecided. `blind` are the margins of the control.
    """

    here: str
    margins: Margins
    blind: Margins = ()


class Claim(NamedTuple):
    """A claim of the paper: its place there and here, what it is, and how to judge it.

    `judge` gets the numbers of the experiment; `open` names the band of the same number in
    `sensitivity`. What is judged is the paper's letter, `liu:paper`.
    """

    place: str
    experiment: str
    figure: str
    paper: str
    judge: Callable[[Any], Judged]
    open: str = ""


def word(margins: Iterable[float]) -> str:
    """Return the verdict: one of `WORDS`.

    Examples
    --------
    >>> word([0.1, 0.0]), word([0.1, -0.1]), word([-0.1]), word([])
    ('holds', 'in part', 'does not', 'undecided')
    """
    values = [value for margin in margins for value in getattr(margin, "values", (margin,))]
    good = [value >= 0 for value in values if not math.isnan(value)]
    if not good:
        return "undecided"
    return "holds" if all(good) else "in part" if any(good) else "does not"


def better(one: Any, other: Any) -> Any:
    """Return the margin by which one number is more than another; the same is not more."""
    return one - other - 1e-9


def verdicts(findings: Mapping[str, Findings]) -> list[tuple[Claim, str, str]]:
    """Judge all claims by what experiments found: each with what is here, and the verdict.

    Of an experiment that was not run both are empty.
    """
    judged = []
    for claim in CLAIMS:
        here, verdict = "", ""
        if claim.experiment in findings:
            here, margins, blind = claim.judge(findings[claim.experiment].numbers)
            verdict = word(margins)
            if verdict in ("holds", "in part") and word(blind) == "holds":
                verdict += BLIND_TOO
        judged.append((claim, here, verdict))
    return judged


def bands(findings: Mapping[str, Findings]) -> dict[str, str]:
    """Return how far claims move with what the paper leaves open, by place; over all seeds."""
    if "sensitivity" not in findings:
        return {}
    found: Any = findings["sensitivity"].numbers["bands"]
    texts = {}
    for claim in CLAIMS:
        if claim.open in found:
            ends = (found[claim.open][end] for end in ("low", "high"))
            low, high = (getattr(end, "values", (end,)) for end in ends)
            texts[claim.place] = f"{min(low):.0f}–{max(high):.0f} %"
    return texts


def _definition(figure: str, about: str, margin: Callable[[Any], float]) -> Any:
    return lambda n: Judged(about, [margin(n[figure])])


def _by_letter(about: str, measure: Callable[[Any, str], tuple[str, Margins]], *rivals: str) -> Any:
    """Judge a measure of methods by the letter; what others have stands beside it."""

    def judge(n: Any) -> Judged:
        here, margins = measure(n, PAPER)
        beside = (f"{name} {measure(n, name)[0]}" for name in (FIGURE_9, LIU, *rivals))
        here = f"{about}: {here} (beside it: {', '.join(beside)})"
        return Judged(here, margins, measure(n, BLIND)[1])

    return judge


def _filtered(n: Any) -> Judged:
    small, large = (n["ranges"][size]["off_after"] for size in ("0.1–0.3 m", "0.6–1.2 m"))
    return Judged(
        f"Still off by more than 0.1 m after it: {100 * small:.0f} % of the points off by "
        f"0.1–0.3 m, {100 * large:.0f} % of those off by 0.6–1.2 m",
        [0.5 - small, 0.5 - large],
    )


def _layers(n: Any) -> Judged:
    parts, margins = [], []
    for sensor, about in (("paper", "its scanner"), ("utm30lx", "mixed pixels")):
        liu, pdbs = (n[sensor][name]["success"] for name in (PAPER, "pdbs, fixed"))
        parts.append(f"{about}: {100 * liu:.0f} %, PDBS {100 * pdbs:.0f} %")
        margins.append(better(liu, pdbs))
    return Judged(f"Clusters right, {'; '.join(parts)}", margins)


def _counts(n: Any, method: str) -> tuple[str, Margins]:
    example = n["example"]
    true, found = example["true features"], example[method]
    return (
        f"{found['clusters']:.0f} and {found['corners']:.0f}",
        [-abs(found[name] - true[name]) for name in ("clusters", "corners")],
    )


def _repetition(n: Any) -> Judged:
    """Judge the letter by the repetition of two views; all readings by both criteria beside it."""
    readings: dict[tuple[str, int], list[Any]] = {}
    for p in n["grid"]:
        if p["support_radius"] == RADIUS or p["threshold"] == THRESHOLD:
            readings.setdefault((p["response"], p["half_width"]), []).append(p)
    margins = {
        name: {reading: _lead(along, name) for reading, along in readings.items()}
        for name in CRITERIA
    }
    alike = {
        about: by_seed(lambda *each: sum(m >= 0 for m in each), *margins[name].values())
        for name, about in CRITERIA.items()
    }
    letter = Liu.paper()
    return Judged(
        f"Of {len(readings)} readings, within {FLAT} of the largest there: "
        f"{'; '.join(f'{k:.0f} by {about}' for about, k in alike.items())}",
        [margins["repetition"][letter.response, letter.half_width]],
    )


def _lead(along: Sequence[Any], criterion: str) -> float:
    """Return the margin by which the paper's parameters are as good as any of a reading."""
    at_paper = (RADIUS, THRESHOLD)
    here = next(p[criterion] for p in along if (p["support_radius"], p["threshold"]) == at_paper)
    return by_seed(min, *(here - p[criterion] + FLAT for p in along), here - 1e-9)


def _scenes(n: Any, method: str) -> tuple[str, Margins]:
    found = n["segment_f1"]
    others = (found[name] for name in (PDBS_LINES, IEPF))
    return f"{found[method]:.2f}", [better(found[method], other) for other in others]


def _similarity(n: Any, method: str) -> tuple[str, Margins]:
    most = next(iter(n.values()))[method]["similarity_maximum"]
    return f"{most:.2f} m", [0.01 - most]


def _five_places(n: Any, method: str) -> tuple[str, Margins]:
    found = [place["found"] for place in n["places"][method]]
    least, most = min(found), max(found)
    return f"{100 * least:.0f} to {100 * most:.0f} %", [share - 0.5 for share in found]


def _distance(n: Any, method: str) -> tuple[str, Margins]:
    means = [place["mean"] for place in n["places"][method] if place["mean"] is not None]
    if not means:
        return "found in no scan", []
    about = f"{min(means):.3f} to {max(means):.3f} m"
    return about, [0.01 - abs(mean - DISTANCE) for mean in means]


def _clusters(n: Any) -> Judged:
    one, other = "liu:paper, no corners", "pdbs, fixed 0.3 m"
    share = {name: n[name]["many"]["partition_success"] for name in (one, other)}
    shown = "; ".join(f"{name} {100 * of:.0f} %" for name, of in share.items())
    return Judged(f"Right clusters: {shown}", [better(share[one], share[other])])


def _corners(n: Any, method: str) -> tuple[str, Margins]:
    recall, *others = (
        n[name]["many"]["corner_recall_0.10"] for name in (method, IEPF, f"{IEPF}, in clusters")
    )
    return f"{100 * recall:.0f} %", [better(recall, other) for other in others]


def _times(n: Any) -> Judged:
    """Judge ratios of times, undecided within `CLEAR` of the paper's: a busy machine moves them."""
    parts, margins = [], []
    for about, name, most in (("PDBS", RATIO_PDBS, 0.70), ("IEPF", RATIO_IEPF, 0.72)):
        middle, *ends = n["ratios"][name]
        parts.append(f"{middle:.2f} of {about}")
        known = [value for end in ends for value in getattr(end, "values", (end,))]
        agree = max(known) * CLEAR <= most or min(known) > most * CLEAR
        margins.append(most - float(middle) if agree else math.nan)
    return Judged(", ".join(parts), margins)


CLAIMS = (
    Claim(
        *("Figure 1", "definitions", "fig1", "Breakpoint, corner and noise point of a scan"),
        _definition("fig1", "Each found where it is drawn", lambda n: 0.02 - n["off"]),
    ),
    Claim(
        *("Figures 2, 3", "noise", "fig2-3", "Filtering removes noise points and keeps edges"),
        _filtered,
    ),
    Claim(
        *("Figure 4", "definitions", "fig4", "Points are farther apart at a distance"),
        _definition("fig4", "So is the threshold", lambda n: min(n["ratio"] - 1, -n["beyond"])),
    ),
    Claim(
        *("Figure 5", "layers", "fig5", "Adaptive clusters part the levels of obstacles"),
        _layers,
    ),
    Claim(
        *("Figure 6", "definitions", "fig6", "Primary corners are farthest from the chord"),
        _definition("fig6", "Corners within a beam", lambda n: 0.02 - n["off"]),
    ),
    Claim(
        *("Figure 7", "definitions", "fig7", "Distance to the tangent grows with the curvature"),
        _definition("fig7", "Proportional", lambda n: 1e-9 - n["off"]),
    ),
    Claim(
        *("Figure 8", "definitions", "fig8", "Support, arc length, parabolas, tangent"),
        _definition(
            *("fig8", "By definition and by the code: the same sum"),
            lambda n: 1e-9 - abs(n["sum"] - n["stage"]),
        ),
    ),
    Claim(
        *("Figure 9", "repetition", "fig9a"),
        "Repetition is largest at radius 6 and threshold 0.66",
        _repetition,
    ),
    Claim(
        *("Figure 10", "layers", "fig10", "11 clusters and 5 corners, as in the scene"),
        _by_letter("A scene with as many", _counts),
    ),
    Claim(
        *("Figure 11", "scenes", "fig11-room", "Better lines than PDBS and IEPF"),
        _by_letter("F1 of lines", _scenes, PDBS_LINES, IEPF),
    ),
    Claim(
        *("Figure 12", "similarity", ""),
        "Errors within 0.01 m; PDBS and IEPF up to 0.25 m",
        _by_letter("Largest error", _similarity, IEPF, PDBS_LINES),
    ),
    Claim(
        *("Figure 13", "two_corners", "fig13", "A convex and a concave corner from five places"),
        _by_letter("Both found, worst to best place", _five_places),
        "both",
    ),
    Claim(
        *("Table 1", "definitions", "", "Hardware and software"),
        lambda _: Judged("Other hardware, compiled code", ()),
    ),
    Claim(
        *("Table 2", "two_corners", "", "Their distance: 2.302 m on average, variance lost"),
        _by_letter(f"Means of the places, of {DISTANCE} m", _distance),
        "both",
    ),
    Claim(
        *("Table 3: partition", "success", "", "95.11 %, PDBS 83.55 %"),
        _clusters,
        "clusters",
    ),
    Claim(
        *("Table 3: corners", "success", "", "92.62 %, IEPF 72.51 %"),
        _by_letter("Found", _corners, IEPF, f"{IEPF}, in clusters"),
        "recall",
    ),
    Claim(
        *("Table 3: time", "success", "", "“About half”: 0.61–0.70 of PDBS, 0.72 of IEPF"),
        _times,
    ),
)
