"""What was found right, found, and true; and how results of many scans add up."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from .matching import Indices

__all__ = ["Counts", "Summable"]


@dataclass(frozen=True, slots=True)
class Summable:
    """A result that adds up over scans, field by field.

    Numbers are added, arrays of errors are put one behind the other, and results within the
    result add up themselves. Where all fields have defaults, these are those of no scan.
    """

    @classmethod
    def total(cls, parts: Iterable[Self]) -> Self:
        """Add up many results at once; those of no scan if there are none.

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
    """How many were found right, found, and true.

    Attributes
    ----------
    correct : int
        Pairs of a found and a true one.
    found : int
        Found ones, without those that the truth does not judge.
    true : int
        True ones that are demanded.

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
        cls, matched: Indices, excused: NDArray[np.bool_], demanded: NDArray[np.bool_]
    ) -> Counts:
        """Count one scan.

        Parameters
        ----------
        matched : ndarray of int
            Found ones that are paired with a demanded one.
        excused : ndarray of bool, shape (F,)
            Found ones that are no mistake where they are not paired.
        demanded : ndarray of bool, shape (T,)
            Whether each true one is large enough to be demanded.
        """
        judged = ~excused
        judged[matched] = True
        return cls(len(matched), int(judged.sum()), int(demanded.sum()))

    @property
    def precision(self) -> float:
        """Share of the found that are right; NaN where nothing was found."""
        return ratio(self.correct, self.found)

    @property
    def recall(self) -> float:
        """Share of the true that were found; NaN where there is nothing to find."""
        return ratio(self.correct, self.true)

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall, 2 correct / (found + true); NaN of nothing."""
        return ratio(2 * self.correct, self.found + self.true)

    def summary(self, suffix: str = "") -> dict[str, float]:
        """List the three shares by name."""
        return {
            f"precision{suffix}": self.precision,
            f"recall{suffix}": self.recall,
            f"f1{suffix}": self.f1,
        }


def ratio(part: float, whole: float) -> float:
    """Divide; NaN where there is nothing to divide by."""
    return part / whole if whole else math.nan


def rms(values: NDArray[np.float64]) -> float:
    """Root of the mean square; NaN of nothing."""
    return math.sqrt(ratio(float(np.square(values).sum()), values.size))


def quantile(values: NDArray[np.float64], share: float) -> float:
    """Value that a share of them does not exceed; NaN of nothing."""
    return float(np.quantile(values, share)) if len(values) else math.nan


def plain(value: object) -> Any:
    """Make what JSON takes of numbers, arrays and what holds them; not finite becomes None.

    Examples
    --------
    >>> import numpy as np
    >>> plain({"rms": np.float64(0.5), "errors": np.array([1.0, np.nan])})
    {'rms': 0.5, 'errors': [1.0, None]}
    """
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
