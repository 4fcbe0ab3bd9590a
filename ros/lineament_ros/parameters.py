"""The parameters of the node: those of `lineament.live.LiveConfig` that ROS does not set itself."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import yaml

from lineament.live import LiveConfig

__all__ = ["DESCRIPTIONS", "FIELDS", "TABLES", "config_of", "value_of"]

#: Names, domain and namespace are of ROS, mountings are on /tf_static, and no log is played.
_OF_OTHERS = (
    *("name", "namespace", "domain", "localhost", "ros", "mountings", "log", "log_topic", "poses"),
    *("ring", "keep_going", "rate", "loop", "foxglove", "host"),
)
#: Below these are parameters without a fixed name: parameters.evidence, limits.beams.
TABLES = ("parameters", "limits")
#: The fields that are one parameter each, by name.
FIELDS = {one.name: one for one in fields(LiveConfig) if one.name not in (*_OF_OTHERS, *TABLES)}


def _descriptions() -> dict[str, str]:
    """Return what the docstring of `LiveConfig` says of each parameter."""
    _, _, text = (LiveConfig.__doc__ or "").partition("Parameters\n    ----------\n")
    found = re.findall(r"^    (\w[\w, ]*) : .*\n((?:        .*\n)+)", text, re.MULTILINE)
    return {
        name: " ".join(about.split()).replace("``", "")
        for names, about in found
        for name in names.split(", ")
        if name in FIELDS
    }


#: What each of them means.
DESCRIPTIONS = _descriptions()


def config_of(given: Mapping[str, Any], **others: Any) -> LiveConfig:
    """Make a configuration from parameters as ROS has them, by name; None is not given.

    ROS has no lists of lists: a mask is the bearings of all its sectors, one after the other.

    Raises
    ------
    ValueError
        If a parameter is not known, or a value is out of bounds. The message names it.
    """
    known: dict[str, Any] = {name: {} for name in TABLES}
    for name, value in given.items():
        table, _, below = name.partition(".")
        if table in TABLES and below:
            known[table][below] = value
        elif name not in FIELDS:
            raise ValueError(
                f"parameter {name} is not known, expected one of {', '.join(FIELDS)}, "
                f"{'.NAME, '.join(TABLES)}.NAME"
            )
        elif value is not None:
            known[name] = _as_field(name, value)
    return LiveConfig(**known, **others)


def value_of(name: str, text: str) -> Any:
    """Return the value of a launch argument: a text, or what YAML makes of it."""
    is_text = str(FIELDS[name].type).startswith("str")
    return text if is_text else yaml.safe_load(text)


def _as_field(name: str, value: Any) -> Any:
    """Return the value of a parameter as the configuration has it."""
    if name == "deskew" and value is False:
        return "off"  # so YAML reads it
    if isinstance(value, bool | int | float | str):
        return value
    values = tuple(value)
    if name != "mask":
        return values
    if len(values) % 2:
        raise ValueError(f"mask is {values}, expected pairs of bearings")
    return tuple(zip(values[::2], values[1::2], strict=True))
