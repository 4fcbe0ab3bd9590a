"""Scans of CSM, the Canonical Scan Matcher: JSON objects, one after the other."""

import re
from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from ..scan import LaserScan, Pose
from .base import Head, Log
from .bearings import bearing_fields
from .json_stream import json_objects

_BEGINNING = re.compile(rb"\s*\{\s*\"")
_KEY = re.compile(rb"\"(?:nrays|readings|min_theta)\"\s*:")
#: Poses, the best first.
_POSES = ("true_pose", "estimate", "odometry")


class CsmLog(Log):
    """JSON objects with ``readings`` [m] and ``theta`` [rad], or ``min_theta``, ``max_theta``."""

    format = "csm"
    description = "CSM JSON (readings, theta)"
    endings = (".json", ".csm")

    def _open(self) -> None:
        self._check_topic()
        first = next(json_objects(self.source, self.limits), None)
        if isinstance(first, LogError):
            self._fault(first)
        elif first is None or "readings" not in first:
            # Of a name that ends with .json, what it begins with fits no other format either.
            raise LogError(
                self.source,
                "is no log in JSON that lineament knows: expected objects with readings (CSM), or "
                "with lists of [range, angle] or [x, y] of units (RPLIDAR)",
            )

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether it begins as a JSON object, and names a key of a scan near the beginning."""
        return _BEGINNING.match(head.data) is not None and _KEY.search(head.data) is not None

    def __len__(self) -> int:
        return self._count

    @cached_property
    def _count(self) -> int:
        return sum(isinstance(found, dict) for found in json_objects(self.source, self.limits))

    def _items(self) -> Iterator[tuple[str, LaserScan]]:
        for i, found in enumerate(json_objects(self.source, self.limits)):
            if isinstance(found, LogError):
                self._fault(found)
            else:
                yield from self._made(self.only_topic, f"scan {i}: ", _scan, found)


def _scan(found: dict[str, Any]) -> LaserScan:
    readings = _numbers("readings", found.get("readings"))
    n = len(readings)
    if found.get("valid") is not None:
        readings = np.where(_numbers("valid", found["valid"], n) == 1, readings, np.nan)
    angles = _angles(found, n)
    if n > 1 and angles[-1] < angles[0]:
        readings, angles = readings[::-1], angles[::-1]
    stamp = 0.0
    if found.get("timestamp") is not None:
        seconds, microseconds = _numbers("timestamp", found["timestamp"], 2)
        stamp = float(seconds + 1e-6 * microseconds)
    return LaserScan(readings, **bearing_fields(angles), stamp=stamp, pose=_pose(found))


def _numbers(name: str, values: object, length: int | None = None) -> NDArray[np.float64]:
    """Return a list of numbers as an array, null as NaN."""
    if not isinstance(values, list):
        raise ValueError(f"{name} is {values!r:.40}, expected a list of numbers")
    if length is not None and len(values) != length:
        raise ValueError(f"{name} has {len(values)} values, expected {length}")
    # Booleans are what some programs write for valid; text is never a number.
    if any(not isinstance(value, (int, float, type(None))) for value in values):
        raise ValueError(f"{name} has a value that is no number")
    return np.array(values, np.float64)


@np.errstate(over="ignore", invalid="ignore")  # Absurd limits: `LaserScan` refuses what they make.
def _angles(found: dict[str, Any], n: int) -> NDArray[np.float64]:
    if found.get("theta") is not None:
        return _numbers("theta", found["theta"], n)
    limits = _numbers("min_theta, max_theta", [found.get("min_theta"), found.get("max_theta")])
    if not np.isfinite(limits).all():
        raise ValueError("has neither theta nor finite min_theta and max_theta")
    return np.linspace(limits[0], limits[1], n)


def _pose(found: dict[str, Any]) -> Pose | None:
    for name in _POSES:
        if found.get(name) is not None:
            x, y, theta = _numbers(name, found[name], 3).tolist()
            if np.isfinite((x, y, theta)).all():
                return x, y, theta
    return None
