"""Plans from SVG files that lineament wrote: lines and circles by layers, in metres."""

import math
import os
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ..drawings import Drawn, check_file, plan_error
from ..limits import Limits

_NAME = "{http://www.w3.org/2000/svg}"
_ENDS = ("x1", "y1", "x2", "y2")
_NUMBER = r"(-?[\d.]+)"
_ARC = re.compile(rf"M {_NUMBER} {_NUMBER} A {_NUMBER} \S+ 0 ([01]) 1 {_NUMBER} {_NUMBER}")


def read_svg(path: str | os.PathLike[str], limits: Limits) -> Drawn:
    """Return the walls and arcs of an SVG of `map`, `extract` or `LineMap.write`.

    A LineamentError for any other: its units and layers would be guesses.
    """
    check_file(path, limits)
    error = plan_error(path)
    try:
        root = ElementTree.fromstring(Path(path).read_bytes())
    except OSError as problem:
        raise error(problem.strerror or "cannot be read") from None
    except (ElementTree.ParseError, ValueError) as problem:
        raise error(f"is no SVG: {problem}") from None
    layers = {group.get("id"): list(group) for group in root.iter(f"{_NAME}g")}
    if root.tag != f"{_NAME}svg" or not {"walls", "arcs", "corners"} <= set(layers):
        raise error("is no plan that lineament wrote: in an SVG it looks for its own layers")
    limits.check("walls", len(layers["walls"]) + len(layers["arcs"]), error)
    try:
        lines = [[float(row.attrib[k]) for k in _ENDS] for row in layers["walls"]]
        circles = [_circle(row) for row in layers["arcs"]]
    except (KeyError, ValueError, TypeError) as problem:
        raise error(f"is no plan that lineament wrote: {problem!r}") from None
    return Drawn(np.reshape(lines, (-1, 2, 2)), np.reshape(circles, (-1, 3)), 0)


def _circle(row: ElementTree.Element) -> list[float]:
    """Return x, y, r of a circle, or of that which an arc is a part of."""
    if row.tag == f"{_NAME}circle":
        return [float(row.attrib[k]) for k in ("cx", "cy", "r")]
    found = _ARC.fullmatch(row.attrib["d"])
    if found is None:
        raise ValueError(f"arc is {row.attrib['d']!r}")
    x, y, radius, is_large, to_x, to_y = map(float, found.groups())
    # The centre is to the left of the chord of an arc of less than half a turn.
    chord = max(math.hypot(to_x - x, to_y - y), 1e-9)
    high = math.sqrt(max(radius**2 - chord**2 / 4, 0.0)) * (-1 if is_large else 1) / chord
    return [(x + to_x) / 2 - high * (to_y - y), (y + to_y) / 2 + high * (to_x - x), radius]
