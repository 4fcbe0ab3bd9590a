"""What several seeds give, as one: numbers that differ become their median and range."""

import math
import operator
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from statistics import median
from typing import Any, Self

import numpy as np

from ..evaluation.counts import ratio


def by_seed(operation: Callable[..., float], *numbers: float) -> float:
    """Apply an operation seed by seed to spreads, and to numbers that are the same in all seeds.

    The result is a spread if one of them is.

    Examples
    --------
    >>> by_seed(min, Spread([1.0, 3.0]), 2.0)
    Spread([1.0, 2.0])
    """
    n = max(len(getattr(number, "values", ())) for number in numbers)
    if n == 0:
        return operation(*numbers)
    each = (getattr(number, "values", (number,) * n) for number in numbers)
    return Spread(map(operation, *each))


def _operator(operation: Callable[..., float]) -> Callable[..., float]:
    return lambda *numbers: by_seed(operation, *numbers)


class Spread(float):
    """A number by seed, NaN where a seed has none; as a float it is the median of the others.

    Sums, products and their inverses are taken seed by seed, comparisons by the median, and a
    format is that of the median and of the least and the greatest value.

    Examples
    --------
    >>> f1 = Spread([0.5, 0.75, 0.625])
    >>> f"{100 * f1:.1f} %", f"{f1 - 0.125:.2f}"
    ('62.5 (50.0–75.0) %', '0.50 (0.38–0.62)')
    """

    values: tuple[float, ...]

    def __new__(cls, values: Iterable[float]) -> Self:
        """Make it of the numbers of at least one seed."""
        given = tuple(float(value) for value in values)
        known = [value for value in given if not math.isnan(value)]
        self = super().__new__(cls, median(known) if known else math.nan)
        self.values = given
        return self

    __add__ = __radd__ = _operator(operator.add)
    __sub__ = _operator(operator.sub)
    __rsub__ = _operator(lambda b, a: a - b)
    __mul__ = __rmul__ = _operator(operator.mul)
    __truediv__ = _operator(ratio)
    __rtruediv__ = _operator(lambda whole, part: ratio(part, whole))
    __neg__, __abs__ = _operator(operator.neg), _operator(abs)

    def __getnewargs__(self) -> Any:
        """Return what copies are made of."""
        return (self.values,)

    def written(self, write: Callable[[float], str]) -> str:
        """Write the median, and the range if that is another, each as a function does."""
        known = [value for value in self.values if not math.isnan(value)]
        ends = (min(known), max(known)) if known else (math.nan, math.nan)
        middle, least, most = map(write, (float(self), *ends))
        to = " to " if least[:1] in ("-", "−", "+") else "–"
        about = [f"{least}{to}{most}"] if least != most else []
        if 0 < len(known) < len(self.values):
            about.append(f"{len(known)} of {len(self.values)} seeds")
        return f"{middle} ({', '.join(about)})" if about else middle

    def __format__(self, form: str) -> str:
        """Write each number in a format."""
        return self.written(lambda value: format(value, form))

    def __repr__(self) -> str:
        """Write all numbers."""
        return f"Spread({list(self.values)})"

    def tolist(self) -> dict[str, object]:
        """Return the median and the numbers of all seeds, as JSON has them."""
        return {"median": float(self), "seeds": list(self.values)}


def merged(values: Sequence[Any]) -> Any:
    """Merge the same number, text or container of several seeds; None is one that has none.

    Of texts that differ the most frequent one counts.

    Examples
    --------
    >>> merged([{"f1": 0.5, "best": "λ"}, {"f1": 0.75, "best": "λ"}])
    {'f1': Spread([0.5, 0.75]), 'best': 'λ'}
    """
    given = [value.tolist() if isinstance(value, np.ndarray) else value for value in values]
    known = [value for value in given if value is not None]
    if not known:
        return None
    first = known[0]
    if isinstance(first, Mapping):
        names = dict.fromkeys(name for value in known for name in value)
        return {name: merged([value.get(name) for value in known]) for name in names}
    if isinstance(first, list | tuple) and len({len(value) for value in known}) == 1:
        return [merged(items) for items in zip(*known, strict=True)]
    if all(isinstance(value, int | float | np.number) for value in known):
        numbers = [math.nan if value is None else value for value in given]
        return first if all(repr(value) == repr(first) for value in numbers) else Spread(numbers)
    if all(value == first for value in known):
        return first
    if isinstance(first, str):
        most, count = Counter(known).most_common(1)[0]
        return f"{most} (so in {count} of {len(known)} seeds)"
    return given
