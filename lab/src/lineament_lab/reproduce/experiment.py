"""What an experiment declares, and the engine that runs its seeds, pools, draws and judges them."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from .findings import Figure, Findings, Progress, Setting, Table
from .prose import prose
from .seeds import merged

#: What a page says of the numbers: paragraphs, and tables.
Report = tuple[Iterable[str], Iterable[Table]]
#: By how much a claim holds, or by how much, negative, it does not: numbers or `Spread`.
Margins = Sequence[float]


class MissingError(Exception):
    """What an experiment measures is not at hand: the section of ``text.md`` that says what."""


class Measured(NamedTuple):
    """Numbers of one seed, by name, and what draws its figures if it is the first seed."""

    numbers: dict[str, Any]
    draw: Callable[[], Iterable[Figure]] = tuple


class Judged(NamedTuple):
    """What is found here, and margins: not negative where the claim holds, NaN if undecided.

    `blind` are the margins of the control.
    """

    here: str
    margins: Margins
    blind: Margins = ()

    @property
    def verdict(self) -> str:
        """The verdict, one of `WORDS`, and whether blind cuts hold as well."""
        found = word(self.margins)
        too = found in ("holds", "in part") and word(self.blind) == "holds"
        return found + BLIND_TOO * too


#: The words of verdicts, and what they mean.
WORDS = {
    "holds": "in all seeds and all that is compared",
    "in part": "in some",
    "does not": "in none",
    "undecided": "nothing of it can be compared, nothing is found, or times are too much alike",
}
#: What a verdict ends with where cuts at every eighth point, without a detector, hold as well.
BLIND_TOO = "; blind cuts, too"


class Claim(NamedTuple):
    """A claim of the paper: its place there, what it is, and how the numbers judge it.

    `figure` is its picture here; `open` names the band of the same number in `sensitivity`. What
    is judged is the paper's letter, `liu:paper`.
    """

    place: str
    paper: str
    judge: Callable[[Any], Judged]
    figure: str = ""
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


@dataclass(frozen=True, slots=True)
class Experiment:
    """A question, what measures it with one seed, what the numbers are shown as, and verdicts.

    Attributes
    ----------
    title : str
    measure : callable
        Takes the `Setting` of one seed and the `Progress`, and returns what is `Measured`; raises
        `MissingError` without the recordings that it needs.
    report : callable
        Takes the numbers of all seeds, pooled, and the setting; returns text and tables.
    claims : tuple of Claim
        What the paper claims of this.
    once : bool
        Whether one seed is enough: it is measured on recordings, or on nothing random.
    """

    title: str
    measure: Callable[[Setting, Progress], Measured]
    report: Callable[[Any, Setting], Report]
    claims: tuple[Claim, ...] = ()
    once: bool = False

    def run(self, setting: Setting, progress: Progress, name: str) -> Findings:
        """Measure with each seed, pool the numbers, report them, and draw those of the first.

        Numbers that differ between the seeds have median and range: see `Spread`. A table without
        rows is left out. Progress is given the name, the seed if there are several, and what.
        """
        numbers: list[dict[str, Any]] = []
        draw = Measured({}).draw
        for one in setting.by_seed()[: 1 if self.once else None]:
            seed = "" if self.once or setting.seeds == 1 else f", seed {one.seed}"

            def about(what: str, where: str = name + seed) -> None:
                progress(f"{where}: {what}")

            about("starting")
            try:
                measured = self.measure(one, about)
            except MissingError as missing:
                return Findings(self.title, prose(str(missing)))
            draw = draw if numbers else measured.draw
            numbers.append(measured.numbers)
        progress(f"{name}: drawing")
        pooled = merged(numbers) if len(numbers) > 1 else numbers[0]
        text, tables = self.report(pooled, setting)
        shown = tuple(table for table in tables if table.rows)
        return Findings(self.title, tuple(text), shown, tuple(draw()), pooled)
