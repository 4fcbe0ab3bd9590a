"""What each figure and table of the paper shows, what is found here, and whether it holds."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

from .contenders import LITERAL, LITERAL_BEST, LIU_PAPER, PDBS_LINES
from .findings import Findings
from .grid import RADIUS, THRESHOLD
from .seeds import by_seed
from .two_corners import DISTANCE

#: AR is as large as the largest within this.
FLAT = 0.03
#: The words of verdicts, and what they mean.
WORDS = {
    "holds": "in all seeds and all that is compared",
    "in part": "in some",
    "does not": "in none",
    "undecided": "nothing of it can be compared, or nothing is found",
}


class Claim(NamedTuple):
    """A claim of the paper: its place there and here, what it is, and how to judge it.

    `judge` gets the numbers of the experiment, and returns what is found here, and margins: each
    is a number or `Spread`, not negative where the claim holds, NaN where it is undecided. `open`
    names the band of the same number in `sensitivity`.
    """

    place: str
    experiment: str
    figure: str
    paper: str
    judge: Callable[[Any], tuple[str, Sequence[float]]]
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
            here, margins = claim.judge(findings[claim.experiment].numbers)
            verdict = word(margins)
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
    return lambda n: (about, [margin(n[figure])])


def _filtered(n: Any) -> tuple[str, Sequence[float]]:
    small, large = (n["ranges"][size]["off_after"] for size in ("0.1–0.3 m", "0.6–1.2 m"))
    return (
        f"Still off by more than 0.1 m after it: {100 * small:.0f} % of the points off by "
        f"0.1–0.3 m, {100 * large:.0f} % of those off by 0.6–1.2 m",
        [0.5 - small, 0.5 - large],
    )


def _layers(n: Any) -> tuple[str, Sequence[float]]:
    parts, margins = [], []
    for sensor, about in (("paper", "its scanner"), ("utm30lx", "mixed pixels")):
        liu, pdbs = (n[sensor][name]["success"] for name in ("liu", "pdbs, fixed"))
        parts.append(f"{about}: {100 * liu:.0f} %, PDBS {100 * pdbs:.0f} %")
        margins.append(better(liu, pdbs))
    return f"Clusters right, {'; '.join(parts)}", margins


def _counts(n: Any) -> tuple[str, Sequence[float]]:
    example = n["example"]
    true, liu = example["true features"], example[LIU_PAPER]
    return (
        f"A simulated scene with {true['clusters']} and {true['corners']}: "
        f"{liu['clusters']:.0f} and {liu['corners']:.0f}",
        [-abs(liu[name] - true[name]) for name in ("clusters", "corners")],
    )


def _repetition(n: Any) -> tuple[str, Sequence[float]]:
    """Judge each reading: AR at the paper's parameters, less the largest on both lines."""
    readings: dict[tuple[str, int], list[Any]] = {}
    for p in n["grid"]:
        if p["support_radius"] == RADIUS or p["threshold"] == THRESHOLD:
            readings.setdefault((p["response"], p["half_width"]), []).append(p)
    margins = []
    for along in readings.values():
        here = next(
            p["of_actual"]
            for p in along
            if (p["support_radius"], p["threshold"]) == (RADIUS, THRESHOLD)
        )
        lead = (here - p["of_actual"] + FLAT for p in along)
        margins.append(by_seed(min, *lead, here - 1e-9))
    alike = by_seed(lambda *of: sum(margin >= 0 for margin in of), *margins)
    return (
        f"AR there is within {FLAT} of the largest in {alike:.0f} of {len(margins)} readings of "
        "what the paper leaves open",
        margins,
    )


def _scenes(n: Any) -> tuple[str, Sequence[float]]:
    found = n["segment_f1"]
    names = (LIU_PAPER, PDBS_LINES, "iepf:paper")
    liu, *others = (found[name] for name in names)
    about = ", ".join(f"{name} {found[name]:.2f}" for name in names)
    return f"F1 of lines: {about}", [better(liu, other) for other in others]


def _similarity(n: Any) -> tuple[str, Sequence[float]]:
    simulated = next(iter(n.values()))
    names = (LIU_PAPER, "iepf:paper", PDBS_LINES)
    most = [simulated[name]["similarity_maximum"] for name in names]
    about = ", ".join(f"{name} {value:.2f} m" for name, value in zip(names, most, strict=True))
    return f"Largest: {about}", [0.01 - most[0]]


def _five_places(n: Any) -> tuple[str, Sequence[float]]:
    found = [place["found"] for place in n["places"][LIU_PAPER]]
    least, most = min(found), max(found)
    return (
        f"With its numbers, both are found in {100 * least:.0f} % (worst place) to "
        f"{100 * most:.0f} % (best) of the scans",
        [share - 0.5 for share in found],
    )


def _distance(n: Any) -> tuple[str, Sequence[float]]:
    means = [place["mean"] for place in n["places"][LIU_PAPER] if place["mean"] is not None]
    if not means:
        return "With its numbers, both corners are found in no scan", []
    about = f"{min(means):.3f} to {max(means):.3f} m from the places, of {DISTANCE} m"
    return about, [0.01 - abs(mean - DISTANCE) for mean in means]


def _success(which: str, number: str, papers: Sequence[str], rivals: Sequence[str]) -> Any:
    def judge(n: Any) -> tuple[str, Sequence[float]]:
        share = {name: n[name]["many"][number] for name in (*papers, *rivals)}
        shown = "; ".join(f"{name} {100 * of:.0f} %" for name, of in share.items())
        pairs = product(papers, rivals)
        return f"{which}: {shown}", [better(share[one], share[other]) for one, other in pairs]

    return judge


def _times(n: Any) -> tuple[str, Sequence[float]]:
    pairs = (("liu:paper, no corners", "pdbs, fixed 0.3 m", 0.70), (LITERAL, "iepf:paper", 0.72))
    ratios = [_middle(n[one]["seconds"]) / _middle(n[other]["seconds"]) for one, other, _ in pairs]
    return (
        f"{ratios[0]:.2f} of PDBS, {ratios[1]:.2f} of IEPF",
        [most - ratio for ratio, (*_, most) in zip(ratios, pairs, strict=True)],
    )


def _middle(values: Sequence[Any]) -> Any:
    return sorted(values)[(len(values) - 1) // 2]


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
        _counts,
    ),
    Claim(
        *("Figure 11", "scenes", "fig11-room", "Better lines than PDBS and IEPF"),
        _scenes,
    ),
    Claim(
        *("Figure 12", "similarity", ""),
        "Errors within 0.01 m; PDBS and IEPF up to 0.25 m",
        _similarity,
    ),
    Claim(
        *("Figure 13", "two_corners", "fig13", "A convex and a concave corner from five places"),
        _five_places,
        "both",
    ),
    Claim(
        *("Table 1", "definitions", "", "Hardware and software"),
        lambda _: ("Other hardware, compiled code", ()),
    ),
    Claim(
        *("Table 2", "two_corners", "", "Their distance: 2.302 m on average, variance lost"),
        _distance,
        "both",
    ),
    Claim(
        *("Table 3: partition", "success", "", "95.11 %, PDBS 83.55 %"),
        _success(
            *("Right clusters", "partition_success"),
            *(("liu:paper, no corners",), ("pdbs, fixed 0.3 m",)),
        ),
        "clusters",
    ),
    Claim(
        *("Table 3: corners", "success", "", "92.62 %, IEPF 72.51 %"),
        _success(
            *("Found", "corner_recall_0.10", (LITERAL, LITERAL_BEST)),
            ("iepf:paper", "iepf:paper, in clusters"),
        ),
        "recall",
    ),
    Claim(
        *("Table 3: time", "success", "", "“About half”: 0.61–0.70 of PDBS, 0.72 of IEPF"),
        _times,
    ),
)
