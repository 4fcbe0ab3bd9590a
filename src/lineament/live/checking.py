"""What the parameters of a live node may be: their types, choices and bounds."""

import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, fields
from typing import Any

from ..drawings import NAMES
from ..logs.base import ECHOES
from ..scan.fields import STAMPS

_CHOICES: dict[str, tuple[object, ...]] = {
    "type": ("LaserScan", "MultiEchoLaserScan"),
    "echo": ECHOES,
    "stamp": STAMPS,
    "reliability": ("best-effort", "reliable"),
    "ros": (0, 1, 2),
    "units": tuple(NAMES),
}
_BOUNDS: dict[str, tuple[float, float]] = {
    "depth": (1, 1000),
    "rate": (0, 1e6),
    "noise": (0, 1000),
    "scale": (1e-9, 1e9),
    "domain": (0, 232),
    "foxglove": (0, 65535),
    "dock_track": (0, 2**31 - 1),
    "transform_tolerance": (0, 10),
    "tolerance": (0, 10),
}
FRAMES = ("map_frame", "odom_frame", "base_frame")
_NAMES = ("topic", "merge", "namespace", "name", "deskew", "odometry", "judge", *FRAMES)
#: What has to be given, too: whether a configuration has it, and what changes nothing without it.
#: What describes the scanner may stay while deskewing, say, is switched on and off.
_NEEDED: dict[str, tuple[Callable[[Any], bool], tuple[str, ...]]] = {
    "a log": (
        lambda it: it.log is not None,
        ("log_topic", "poses", "ring", "keep_going", "rate", "loop"),
    ),
    "several topics": (lambda it: bool(it.merge), ("mountings", "unsure", "tolerance")),
    "a map": (lambda it: it.map is not None, ("layers", "units", "judge")),
    "a map or mapping": (
        lambda it: it.has_map,
        ("odometry", "map_frame", "odom_frame", "transform_tolerance", "broadcast"),
    ),
    "a map, mapping or several topics": (lambda it: it.has_map or it.merge, ("base_frame",)),
    "a dock": (lambda it: it.dock is not None, ("dock_shape",)),
    "foxglove": (lambda it: it.foxglove is not None, ("host",)),
}
#: What each annotation accepts, and how it is called in a message.
_KINDS: dict[str, tuple[type | tuple[type, ...], str]] = {
    "str": (str, "a text"),
    "bool": (bool, "true or false"),
    "int": (int, "a whole number"),
    "float": ((int, float), "a number"),
    "Pose": ((tuple, list), "three numbers"),
    "Mask": ((tuple, list), "pairs of bearings"),
    "Point": ((tuple, list), "two numbers"),
    "Names": ((tuple, list), "names"),
    "Mapping[str, Any]": (Mapping, "a table"),
}
#: How many numbers those of fixed length have.
_COUNTS = {"Pose": 3, "Point": 2}
#: x, y [m]; and names of topics.
Point = tuple[float, float]
Names = Sequence[str]


def check(name: str, annotation: str, value: Any) -> None:
    """Check the type of a parameter, and its value where a table above bounds it."""
    kind, _, optional = annotation.partition(" | ")
    if optional and value is None:
        return
    if optional and value == "":
        raise ValueError(f"{name} is empty, expected a text, or no {name}")
    types, wanted = _KINDS[kind]
    is_known = isinstance(value, types)
    if not is_known or (isinstance(value, bool) and kind != "bool"):
        raise ValueError(f"{name} is {value!r}, expected {wanted}")
    if (n := _COUNTS.get(kind, 0)) and (len(value) != n or not all(map(_is_finite, value))):
        raise ValueError(f"{name} is {value}, expected {wanted.replace(' ', ' finite ')}")
    if name in _CHOICES and value not in _CHOICES[name]:
        wanted = ", ".join(map(str, _CHOICES[name]))
        raise ValueError(f"{name} is {value!r}, expected one of {wanted}")
    if name in _BOUNDS and not _BOUNDS[name][0] <= value <= _BOUNDS[name][1]:
        raise ValueError(f"{name} is {value}, expected {_BOUNDS[name][0]} to {_BOUNDS[name][1]}")
    texts = value if name == "merge" else [value]
    if name == "namespace":
        texts = [value.strip("/") or "none"]
    if name in _NAMES and not all(_is_name(text) for text in texts):
        raise ValueError(f"{name} is {value!r}, expected a name of letters, digits, _ and /")


def check_needed(config: Any) -> None:
    """Refuse what would change nothing, as something that it needs is not given."""
    defaults = {one.name: {} if one.default is MISSING else one.default for one in fields(config)}
    for what, (is_given, names) in _NEEDED.items():
        for name in () if is_given(config) else names:
            if (value := getattr(config, name)) != defaults[name]:
                raise ValueError(f"{name} is {value!r}, expected {what} as well")


def _is_finite(value: Any) -> bool:
    return isinstance(value, int | float) and abs(value) <= sys.float_info.max


def _is_name(text: Any) -> bool:
    return isinstance(text, str) and bool(re.fullmatch(r"/?\w+(/\w+)*", text, re.ASCII))
