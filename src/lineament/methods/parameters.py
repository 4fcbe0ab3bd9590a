"""Parameters of methods, each declared once: its default, bounds, unit and meaning."""

import sys
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, fields, is_dataclass
from difflib import get_close_matches
from functools import wraps
from inspect import cleandoc, isfunction, signature
from numbers import Integral, Real
from textwrap import wrap
from typing import Any, TypeVar, dataclass_transform

from ..scan import LaserScan

T = TypeVar("T")

_NUMBERS = {int: ("a whole number", Integral), float: ("a number", Real)}
_INFINITE = sys.float_info.max
#: No whole number is as large.
_MANY = 2**31
#: No budget of vertices is as large: time and memory grow with it.
MOST_VERTICES = 1025


@dataclass(frozen=True, slots=True)
class Bounds:
    """What a value must be: of a kind (bool, int, float or str), and within bounds or choices."""

    kind: type
    low: float = -_INFINITE
    above: float = -_INFINITE
    below: float = _INFINITE
    choices: Collection[str] = ()

    def __str__(self) -> str:
        if self.choices:
            return f"one of: {', '.join(self.choices)}"
        if self.kind is bool:
            return "True or False"
        limits = (("≥", self.low), (">", self.above), ("<", self.below))
        parts = [f"{sign} {limit:.12g}" for sign, limit in limits if abs(limit) < _INFINITE]
        return f"{_NUMBERS[self.kind][0]} {' and '.join(parts)}"

    def holds(self, value: Any) -> bool:
        """Whether a value is within the bounds."""
        if self.choices:
            return value in tuple(self.choices)
        if self.kind is bool or isinstance(value, bool):
            return self.kind is type(value)
        if not isinstance(value, _NUMBERS[self.kind][1]):
            return False
        number = int(value) if isinstance(value, Integral) else float(value)
        most = min(self.below, _MANY) if self.kind is int else self.below
        return self.low <= number and self.above < number < most

    def check(self, name: str, value: Any) -> None:
        """Refuse a value out of bounds, with the name of the parameter."""
        if not self.holds(value):
            many = self.kind is int and isinstance(value, Integral) and int(value) >= _MANY
            less = f" and < {_MANY}" if many and self.below > _MANY else ""
            raise ValueError(f"{name} is {value!r}, expected {self}{less}")


#: Fields of a scan, which a parameter that is not known may be meant as.
_FIELDS = [name for name in signature(LaserScan).parameters if name != "ranges"]


def unknown(owner: str, name: str, known: Iterable[str]) -> str:
    """Return what to write in place of a parameter that a method does not have."""
    known = list(known)
    if name == "angle_max":
        return (
            "angle_max is no field of a scan, expected angle_increment, "
            "(angle_max - angle_min)/(n - 1) for n beams"
        )
    names = [*known, *_FIELDS]
    words = sorted(name.split("_"))  # max_range is range_max
    near = [one for one in names if one.startswith(name) or sorted(one.split("_")) == words]
    near = near or get_close_matches(name, names, n=1)
    hint = ""
    if near:
        hint = f"is it {near[0]}{'' if near[0] in known else ', a field of the scan'}? "
    return f"{owner} has no parameter {name!r}: {hint}expected one of: {', '.join(known)}"


def parameter(
    default: bool | int | float | str, meaning: str, *, unit: str = "", **bounds: Any
) -> Any:
    """Declare a parameter of a method; its type is that of its default.

    `bounds` are those of `Bounds`.
    """
    declared = {"meaning": meaning, "unit": unit, "bounds": Bounds(type(default), **bounds)}
    return field(default=default, metadata=declared)


def bounds_of(cls: Any, name: str) -> Bounds:
    """Return the bounds of a parameter of a method."""
    (found,) = [one.metadata["bounds"] for one in fields(cls) if one.name == name]
    return found  # type: ignore[no-any-return]


def sentence(meaning: str) -> str:
    """Begin the meaning of a parameter with a capital letter, unless it begins with a symbol."""
    return meaning if meaning[1] in " ,_" else meaning[0].upper() + meaning[1:]


def indented(text: str) -> list[str]:
    """Break a text into indented lines."""
    return wrap(text, 96, initial_indent="    ", subsequent_indent="    ")


def described(name: str, method: Any) -> str:
    """Describe a method in plain text: its parameters, defaults, units and bounds."""
    method = getattr(method, "function", method)  # of somebody's own
    documented = method if isfunction(method) else type(method)
    lines = [f"{name}: {(documented.__doc__ or 'no description').strip().splitlines()[0]}"]
    if presets := getattr(method, "presets", ()):
        lines += [f"Presets: {', '.join(f'{method.name}:{preset}' for preset in presets)}"]
    lines += ["", f"{'parameter':<16} {'default':<22} {'unit':<6} bounds"]
    for one in fields(method) if is_dataclass(method) else ():
        value = getattr(method, one.name)
        value = f"{value:.6g}" if isinstance(value, float) else str(value)
        about = {"unit": "", "bounds": "", "meaning": "", **one.metadata}
        lines += [f"{one.name:<16} {value:<22} {about['unit']:<6} {about['bounds']}".rstrip()]
        if about["meaning"]:
            lines += indented(f"{sentence(about['meaning'])}.")
    return "\n".join(lines)


_EXAMPLE = """Examples
--------
>>> import lineament as ln
>>> import numpy as np
>>> from lineament.simulation import SENSORS, room
>>> scan = SENSORS["paper"].scan(room(), (0.0, 0.0, 0.0), np.random.default_rng(7))
>>> ln.extract(scan, method="{}").corners["position"].round(1).tolist()
[[1.4, -0.5], [3.0, 2.0]]
"""


@dataclass_transform(frozen_default=True, kw_only_default=True)
def method(cls: type[T]) -> type[T]:
    """Make a class of parameters a frozen dataclass, and list them in its docstring.

    One with a name, and without an example, gets the example that finds the corners of a room.
    """
    cls = dataclass(frozen=True, slots=True, kw_only=True)(cls)
    _check_names(cls)
    lines = ["Parameters", "----------"]
    for one in fields(cls):  # type: ignore[arg-type]
        bounds = one.metadata["bounds"]
        lines += [f"{one.name} : {bounds.kind.__name__}, default {one.default!r}"]
        unit = f" [{one.metadata['unit']}]" if one.metadata["unit"] else ""
        lines += indented(f"{sentence(one.metadata['meaning'])}{unit}; {bounds}.")
    lines += ["", "Raises", "------", "ValueError", "    If a parameter is out of bounds."]
    text = cleandoc(cls.__doc__ or "")
    name = getattr(cls, "name", "")
    if name and "Examples\n---" not in text:
        text += "\n\n" + _EXAMPLE.format(name)
    ends = [text.find(f"{head}\n---") for head in ("References", "Examples")]
    end = min((at for at in ends if at >= 0), default=len(text))
    cls.__doc__ = "\n".join([text[:end].rstrip(), "", *lines, "", text[end:]])
    return cls


def _check_names(cls: Any) -> None:
    """Let a class name what it was given that is no parameter, and what may be meant."""
    made, known = cls.__init__, [one.name for one in fields(cls)]

    @wraps(made)
    def checked(self: Any, **given: Any) -> None:
        for name in given:
            if name not in known:
                raise TypeError(unknown(cls.__name__, name, known))
        made(self, **given)

    cls.__init__ = checked
