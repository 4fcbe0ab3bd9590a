"""Definitions of the ROS messages that are written: those of Noetic (ROS 1) and Humble (ROS 2)."""

from functools import cache
from pathlib import Path

_SEPARATOR = f"{'=' * 80}\nMSG: "


def definition(kind: str, version: int) -> str:
    """Return the text of a type and, behind it, of all types in it, for a version of ROS."""
    types = _types(version)
    found: list[str] = []

    def find(name: str) -> None:
        found.append(name)
        for line in types[name].splitlines():
            inner = line.partition(" ")[0].removesuffix("[]")
            if inner in types and inner not in found:
                find(inner)

    find(kind)
    return types[kind] + "".join(f"{_SEPARATOR}{name}\n{types[name]}" for name in found[1:])


@cache
def _types(version: int) -> dict[str, str]:
    """Read the text of each type alone, by its name."""
    text = Path(__file__).with_name(f"ros{version}.msg").read_text("utf-8")
    sections = (section.partition("\n") for section in text.split(_SEPARATOR)[1:])
    return {name: fields for name, _, fields in sections}
