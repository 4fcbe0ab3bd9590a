"""Scans of RPLIDAR units as JSON: for each unit a list of pairs of numbers."""

import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from ..scan import LaserScan, Pose
from .base import Head, Log
from .bearings import by_bearing
from .json_stream import json_objects

_NUMBER = rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?"
_BEGINNING = re.compile(
    rb"\s*\{\s*\"[^\"]{1,99}\"\s*:\s*\[\s*\[\s*" + _NUMBER + rb"\s*,\s*" + _NUMBER + rb"\s*\]"
)
#: Where the poses of the units stand, beside the scans.
_TRANSFORMS = "transforms.json"


class RplidarLog(Log):
    """A JSON object ``{"unit": [[a, b], …], …}``: one scan a unit, which is a topic."""

    format = "rplidar"
    description = "RPLIDAR JSON ([range, angle] or [x, y] of units)"
    is_held = True
    endings = (".json",)

    def _open(self) -> None:
        found = next(json_objects(self.source, self.limits), None)
        if isinstance(found, LogError):
            raise found.fresh()
        # A name is shown in messages, of one line each.
        self._units = {
            name if name.isprintable() else ascii(name): pairs
            for name, pairs in (found or {}).items()
        }
        if not self._units:
            raise LogError(self.source, f"is no {self.description}")
        self._check_topic()
        self._wanted = self.topics if self.topic is None else [self.topic]

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether it begins as an object whose first value is a list of pairs of numbers."""
        return _BEGINNING.match(head.data) is not None

    @property
    def topics(self) -> list[str]:
        """The units, in the order of the file."""
        return list(self._units)

    def __len__(self) -> int:
        return len(self._wanted)

    def _items(self) -> Iterator[tuple[str, LaserScan]]:
        transforms = _read_transforms(self.path.parent / _TRANSFORMS, self.limits.line)
        for unit in self._wanted:
            yield from self._made(unit, f"unit {unit}: ", self._scan, unit, transforms)

    def _scan(self, unit: str, transforms: dict[str, Any]) -> LaserScan:
        ranges, bearings = _polar(_pairs(self._units[unit]))
        order, angles = by_bearing(bearings)
        pose = None
        if transforms:
            world = self.topics[0]
            pose = (0.0, 0.0, 0.0) if unit == world else _pose(transforms, unit, world)
        return LaserScan(ranges[order], angles=angles, frame_id=unit, pose=pose)


def _pairs(values: object) -> NDArray[np.float64]:
    try:
        pairs = np.array(values, np.float64)
    except (TypeError, ValueError):
        pairs = np.zeros(0)
    if pairs.ndim != 2 or pairs.shape[1] != 2:
        raise ValueError("expected a list of pairs of numbers")
    return pairs


@np.errstate(over="ignore")
def _polar(pairs: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return ranges and bearings of pairs of either kind."""
    first, second = pairs.T
    steps = np.diff(second)
    one_way = (steps >= 0).all() or (steps <= 0).all()
    if one_way and (first >= 0).all():
        return first, second
    return np.hypot(first, second), np.arctan2(second, first)


def _read_transforms(path: Path, most: int) -> dict[str, Any]:
    """Read the matrices beside the scans; none where there is no such file, or another one."""
    if not path.is_file():
        return {}
    try:
        with path.open("rb") as file:
            found = json.loads(file.read(most))
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _pose(transforms: dict[str, Any], unit: str, world: str) -> Pose | None:
    """Return the pose of a unit in the frame of another, from the matrix between them."""
    try:
        matrix = np.array(transforms[unit][world], np.float64)
        (c, _, x), (s, _, y) = matrix[:2].tolist()
    except (KeyError, TypeError, ValueError, IndexError):
        return None
    return x, y, math.atan2(s, c)
