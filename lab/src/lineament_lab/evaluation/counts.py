"""Counts of what is found and true, shares and means, and how results of many scans add up."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Summable:
    """A result that adds up over scans, field by field.

    Numbers are added, arrays are concatenated, and results within the result add up themselves.
    The defaults of the fields are those of no scan.
    """

    @classmethod
    def total(cls, parts: Iterable[Self]) -> Self:
        """Add up many results at once.

        Examples
        --------
        >>> Counts.total([Counts(1, 2, 3), Counts(4, 5, 6)])
        Counts(correct=5, found=7, true=9)
        """
        rows = [[getattr(part, field.name) for field in fields(cls)] for part in parts]
        return cls(*map(_joined, zip(*rows, strict=True)))

    def __add__(self, other: Self) -> Self:
        if type(other) is not type(self):
            return NotImplemented
        return self.total((self, other))


def _joined(values: tuple[Any, ...]) -> Any:
    first = values[0]
    if isinstance(first, Summable):
        return first.total(values)
    if isinstance(first, dict):
        return {key: _joined(tuple(value[key] for value in values)) for key in first}
    return np.concatenate(values) if isinstance(first, np.ndarray) else sum(values)


@dataclass(frozen=True, slots=True)
class Counts(Summable):
    """Numbers of pairs of a found and a true feature, of found ones, and of true ones.

    Found ones that the truth does not judge and true ones that are not demanded do not count.

    Examples
    --------
    >>> counts = Counts(correct=6, found=8, true=10)
    >>> counts.precision, counts.recall, round(counts.f1, 3)
    (0.75, 0.6, 0.667)
    """

    correct: int = 0
    found: int = 0
    true: int = 0

    @classmethod
    def of(
        cls, matched: NDArray[np.intp], excused: NDArray[np.bool_], demanded: NDArray[np.bool_]
    ) -> Self:
        """Count one scan: those `matched` with a demanded one are right, the `excused` no mistake.

        `excused` (F,) are found ones, `demanded` (T,) true ones that are large enough.
        """
        judged = ~excused
        judged[matched] = True
        return cls(len(matched), int(judged.sum()), int(demanded.sum()))

    @property
    def precision(self) -> float:
        """Share of the found that are right; NaN if nothing is found."""
        return ratio(self.correct, self.found)

    @property
    def recall(self) -> float:
        """Share of the true that are found; NaN if nothing is true."""
        return ratio(self.correct, self.true)

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall, 2 correct / (found + true)."""
        return ratio(2 * self.correct, self.found + self.true)

    def summary(self, suffix: str = "") -> dict[str, float]:
        """List the three shares by name."""
        return {f"{name}{suffix}": getattr(self, name) for name in ("precision", "recall", "f1")}


def ratio(part: float, whole: float) -> float:
    """Divide; NaN if the whole is 0."""
    return part / whole if whole else math.nan


def rms(values: NDArray[np.float64]) -> float:
    """Root of the mean square; NaN of nothing."""
    return math.sqrt(ratio(float(np.square(values).sum()), values.size))


def quantile(values: NDArray[np.float64], share: float) -> float:
    """Value that a share of them does not exceed; NaN of nothing."""
    return float(np.quantile(values, share)) if len(values) else math.nan


def finite_figures(figures: dict[str, float]) -> dict[str, float]:
    """Leave out the figures that nothing defines."""
    return {name: value for name, value in figures.items() if math.isfinite(value)}


def plain(value: object) -> Any:
    """Convert numbers, arrays and containers to what JSON takes; not finite becomes None."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
