"""A figure that is to be reached, beside the one that is reached."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from .findings import Table, cell_text

__all__ = ["TOLD", "Aim", "Limits", "aims_table"]


@dataclass(frozen=True, slots=True)
class Limits:
    """Between which values a figure is to lie; with none of them it is only told.

    Examples
    --------
    >>> [str(Limits(low=0.97)), str(Limits(high=1.2)), str(Limits(0.9, 1.15)), str(Limits())]
    ['≥ 0.97', '≤ 1.2', '0.9–1.15', '–']
    >>> Limits(low=0.97).hold(0.98), Limits(high=1.2).hold(math.nan), Limits().hold(1.0)
    (True, False, None)
    """

    low: float | None = None
    high: float | None = None

    def __str__(self) -> str:
        low, high = cell_text(self.low), cell_text(self.high)
        if self.low is None:
            return high if self.high is None else f"≤ {high}"
        return f"≥ {low}" if self.high is None else f"{low}–{high}"

    def hold(self, value: float) -> bool | None:
        """Whether a value lies between them; None where there are none."""
        if self.low is None and self.high is None:
            return None
        low = -math.inf if self.low is None else self.low
        high = math.inf if self.high is None else self.high
        return low <= value <= high


#: Of a figure that is only told.
TOLD = Limits()


@dataclass(frozen=True, slots=True)
class Aim:
    """A figure that is to be reached.

    Attributes
    ----------
    where : str
        What it is measured on.
    figure : str
        Which figure, with its unit.
    limits : Limits
        Where it is to lie.
    reached : float
        Where it lies.
    """

    where: str
    figure: str
    limits: Limits
    reached: float

    def to_dict(self) -> dict[str, object]:
        """List everything by the names of the columns of `aims_table`."""
        met = {True: "yes", False: "no", None: None}[self.limits.hold(self.reached)]
        return {
            "on": self.where,
            "figure": self.figure,
            "aim": str(self.limits),
            "reached": self.reached,
            "met": met,
        }


def aims_table(title: str, aims: Iterable[Aim], note: str = "") -> Table:
    """Put aims and what is reached side by side.

    Examples
    --------
    >>> print(aims_table("Speed", [Aim("paper", "kernels [µs]", Limits(high=30.0), 24.5)]))
    on           figure   aim  reached  met
    paper  kernels [µs]  ≤ 30     24.5  yes
    """
    return Table.of_records(title, [aim.to_dict() for aim in aims], note)
