"""Checks of a method's parameters; each refusal names the parameter and its value."""

from __future__ import annotations

import math
from collections.abc import Collection
from numbers import Integral, Real

__all__ = ["check_choice", "check_count", "check_number"]


def check_number(name: str, value: object, *, above: float = 0.0, or_equal: bool = False) -> None:
    """Refuse what is not a finite number above (or at) a bound."""
    if not isinstance(value, Real) or isinstance(value, bool):
        raise ValueError(f"{name} is {value!r}, expected a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number) or number < above or (number == above and not or_equal):
        raise ValueError(
            f"{name} is {value}, expected a number {'≥' if or_equal else '>'} {above:g}"
        )


def check_count(name: str, value: object, *, least: int) -> None:
    """Refuse what is not a whole number of at least `least`."""
    if not isinstance(value, Integral) or isinstance(value, bool) or value < least:
        raise ValueError(f"{name} is {value!r}, expected a whole number ≥ {least}")


def check_choice(name: str, value: object, options: Collection[str]) -> None:
    """Refuse what is not one of `options`."""
    if value not in options:
        raise ValueError(f"{name} is {value!r}, expected one of: {', '.join(options)}")
