"""Parameters of methods, each declared once: its default, bounds, unit and meaning."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, field, fields
from inspect import cleandoc
from numbers import Integral, Real
from textwrap import wrap
from typing import Any, TypeVar, dataclass_transform

__all__ = ["Bounds", "bounds_of", "method", "parameter"]

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Bounds:
    """What a value must be.

    Parameters
    ----------
    kind : type
        bool, int, float (any real number that is finite) or str.
    low, above, below : float, optional
        The least value, or bounds that are not reached.
    choices : collection of str
        The only values.
    """

    kind: type
    low: float | None = None
    above: float | None = None
    below: float | None = None
    choices: Collection[str] = ()

    def __str__(self) -> str:
        if self.kind is bool:
            return "True or False"
        if self.choices:
            return f"one of: {', '.join(self.choices)}"
        limits = (("≥", self.low), (">", self.above), ("<", self.below))
        parts = [f"{sign} {limit:.12g}" for sign, limit in limits if limit is not None]
        return " ".join(
            ["a whole number" if self.kind is int else "a number", " and ".join(parts)]
        ).strip()

    def check(self, name: str, value: Any) -> None:
        """Refuse a value out of bounds, with the name of the parameter."""
        if not self._holds(value):
            raise ValueError(f"{name} is {value!r}, expected {self}")

    def _holds(self, value: Any) -> bool:
        if self.kind is bool:
            return isinstance(value, bool)
        if self.choices:
            return isinstance(value, str) and value in self.choices
        if isinstance(value, bool) or not isinstance(value, Integral if self.kind is int else Real):
            return False
        try:
            finite = math.isfinite(value)
        except OverflowError:
            return False
        return (
            finite
            and (self.low is None or value >= self.low)
            and (self.above is None or value > self.above)
            and (self.below is None or value < self.below)
        )


def parameter(
    default: bool | int | float | str,
    meaning: str,
    *,
    low: float | None = None,
    above: float | None = None,
    below: float | None = None,
    choices: Collection[str] = (),
) -> Any:
    """Declare a parameter of a method; its type is that of its default."""
    bounds = Bounds(type(default), low, above, below, choices)
    return field(default=default, metadata={"meaning": meaning, "bounds": bounds})


def bounds_of(cls: Any, name: str) -> Bounds:
    """Return the bounds of a parameter of a method."""
    (found,) = [one.metadata["bounds"] for one in fields(cls) if one.name == name]
    return found  # type: ignore[no-any-return]


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(parameter,))
def method(cls: type[T]) -> type[T]:
    """Make a frozen dataclass of a method, and list its parameters in its docstring."""
    made = dataclass(frozen=True, slots=True, kw_only=True)(cls)
    lines = ["Parameters", "----------"]
    for one in fields(made):  # type: ignore[arg-type]
        bounds, meaning = one.metadata["bounds"], one.metadata["meaning"]
        lines += [f"{one.name} : {bounds.kind.__name__}, default {one.default!r}"]
        text = meaning if meaning[1] in " ," else meaning[0].upper() + meaning[1:]
        lines += wrap(f"{text}; {bounds}.", 96, initial_indent="    ", subsequent_indent="    ")
    lines += ["", "Raises", "------", "ValueError", "    If a parameter is out of bounds."]
    text = cleandoc(made.__doc__ or "")
    ends = [text.find(f"{name}\n---") for name in ("References", "Examples")]
    end = min((at for at in ends if at >= 0), default=len(text))
    made.__doc__ = "\n".join([text[:end].rstrip(), "", *lines, "", text[end:]])
    return made
