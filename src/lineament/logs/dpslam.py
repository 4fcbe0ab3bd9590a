"""DP-SLAM logs: text lines Odometry and Laser, in turns."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from ..scan import LaserScan, Pose
from .base import Head
from .bearings import SICK_RANGE_MAX, sick_step
from .linelog import LineLog
from .lines import BOM
from .words import Numbers, floats, whole_number

__all__ = ["DpslamLog"]

_KNOWN = re.compile(rb"[ \t]*(Odometry|Laser)[ \t]")
_BEGINNING = re.compile(rb"(?m)^[ \t]*Laser[ \t]+\d+[ \t]+[-+.\d]")
#: A SICK scanner that counts millimetres in 13 bits reports what it saw nothing of from here [m].
_MILLIMETRE_CODES, _MILLIMETRE_LARGEST = 8.183, 8.1915


class DpslamLog(LineLog):
    """A DP-SLAM log: ``Odometry x y theta``, then ``Laser n r1 … rn`` [m, rad], no stamps.

    Beams are those of a SICK scanner, as in a CARMEN log: from -90°, in steps of 1° for 180 or
    181. Poses are those of the robot's odometry. `range_max` is 8.183 m for a scan that goes just
    as far as the codes of the scanner's millimetre mode, 8.183 to 8.191 m, else 50 m.

    Raises
    ------
    LogError
        If there is no scan line at all.
    """

    format = "dpslam"
    description = "DP-SLAM (Odometry, Laser)"
    endings = (".dpslam",)
    scan_kinds = read_kinds = ("Laser",)

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether a line near the beginning is ``Laser``, a count and a number."""
        return _BEGINNING.search(head.data.removeprefix(BOM)) is not None

    @staticmethod
    def _kind(line: bytes) -> str:
        match = _KNOWN.match(line)
        return match[1].decode() if match else ""

    def _items(self) -> Iterator[tuple[str, LaserScan]]:
        numbers, pose = Numbers(), None
        for number, line in self._lines():
            kind = self._kind(line)
            try:
                if kind == "Odometry":
                    pose = _odometry(line.split())
                if kind != "Laser":
                    continue
                scan = _scan(line.split(), numbers, pose)
            except (ValueError, OverflowError) as error:
                # The pose of another scan would be worse than none.
                pose = None
                self._bad_line(number, error)
            else:
                yield kind, scan


def _odometry(words: list[bytes]) -> Pose:
    if len(words) != 4:
        raise ValueError(f"Odometry has {len(words) - 1} values, expected x, y, theta")
    x, y, theta = floats("Odometry: value", words[1:])
    return x, y, theta


def _scan(words: list[bytes], numbers: Numbers, pose: Pose | None) -> LaserScan:
    if len(words) < 2:
        raise ValueError("Laser has nothing behind it, expected the number of ranges")
    n = whole_number("Laser: the number of ranges", words[1])
    if len(words) != n + 2:
        raise ValueError(f"Laser says {n} ranges and has {len(words) - 2}")
    ranges = numbers.vector("Laser range", words[2:])
    largest = ranges.max(initial=0.0)
    in_millimetres = _MILLIMETRE_CODES <= largest <= _MILLIMETRE_LARGEST
    return LaserScan(
        ranges,
        -math.pi / 2,
        sick_step(n),
        range_max=_MILLIMETRE_CODES if in_millimetres else SICK_RANGE_MAX,
        pose=pose,
    )
