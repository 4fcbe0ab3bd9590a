"""The verdicts: what the paper claims, what is found of it here, and whether it holds."""

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from . import EXPERIMENTS, experiment
from .experiment import Claim, Judged
from .findings import Findings


class Verdict(NamedTuple):
    """A claim, the experiment that judges it, what is found, and the verdict; empty if not run."""

    experiment: str
    claim: Claim
    here: str
    verdict: str


def claims() -> list[tuple[str, Claim]]:
    """Return the claims that experiments declare, with their names, in the order of the paper."""

    def place(named: tuple[str, Claim]) -> tuple[str, int]:
        kind, number = re.findall(r"[FT]|\d+", named[1].place)[:2]
        return kind, int(number)

    given = [(name, claim) for name in EXPERIMENTS for claim in experiment(name).claims]
    return sorted(given, key=place)


def verdicts(findings: Mapping[str, Findings]) -> list[Verdict]:
    """Judge all claims by what experiments found."""
    judged = []
    for name, claim in claims():
        found = claim.judge(findings[name].numbers) if name in findings else Judged("", ())
        judged.append(Verdict(name, claim, found.here, found.verdict if name in findings else ""))
    return judged


def bands(findings: Mapping[str, Findings]) -> dict[str, str]:
    """Return how far claims move with what the paper leaves open, by place; over all seeds."""
    if "sensitivity" not in findings:
        return {}
    found: Any = findings["sensitivity"].numbers["bands"]
    texts = {}
    for _, claim in claims():
        if claim.open in found:
            ends = (found[claim.open][end] for end in ("low", "high"))
            low, high = (getattr(end, "values", (end,)) for end in ends)
            texts[claim.place] = f"{min(low):.0f}–{max(high):.0f} %"
    return texts
