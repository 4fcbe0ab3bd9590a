"""Logs of tinySLAM (CoreSLAM): a line a scan of an URG-04LX, in columns without names."""

from __future__ import annotations

import math
from collections.abc import Iterator

from ..scan import LaserScan
from .base import Head
from .linelog import LineLog
from .lines import BOM
from .words import Numbers, floats

__all__ = ["TinyslamLog"]

_TOPIC = "scan"
#: Columns before the ranges: the stamp, then encoders and other things of the robot.
_BEFORE = 25
_BEAMS = 682
# Data sheet of the URG-04LX: 1024 steps a turn, of which 44 to 725 measure and 384 looks ahead.
_STEP = 2 * math.pi / 1024
_FIRST_STEP = 44 - 384
_RANGE_MIN, _RANGE_MAX = 0.02, 5.6
_SCAN_TIME = 0.1


class TinyslamLog(LineLog):
    """A tinySLAM log: 707 columns, the stamp [µs], 24 others and 682 ranges [mm].

    The scanner is an URG-04LX: -119.53° to 119.88°, 20 mm (below are its error codes) to 5.6 m,
    10 Hz. Wheel encoders are no poses and are passed over.

    Raises
    ------
    LogError
        If there is no line at all.
    """

    format = "tinyslam"
    description = "tinySLAM (707 columns, URG-04LX)"
    endings = (".dat",)
    scan_kinds = read_kinds = (_TOPIC,)

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether the first line has as many numbers as a tinySLAM log has columns."""
        words = head.data.removeprefix(BOM).lstrip().partition(b"\n")[0].split()
        if len(words) != _BEFORE + _BEAMS:
            return False
        try:
            floats("column", words)
        except ValueError:
            return False
        return True

    @staticmethod
    def _kind(line: bytes) -> str:
        return _TOPIC if line[:16].lstrip()[:1].isdigit() else ""

    def _items(self) -> Iterator[tuple[str, LaserScan]]:
        numbers = Numbers()
        for number, line in self._lines():
            if not self._kind(line):
                continue
            try:
                scan = _scan(line.split(), numbers)
            except (ValueError, OverflowError) as error:
                self._bad_line(number, error)
            else:
                yield _TOPIC, scan


def _scan(words: list[bytes], numbers: Numbers) -> LaserScan:
    if len(words) != _BEFORE + _BEAMS:
        raise ValueError(f"has {len(words)} columns, expected {_BEFORE + _BEAMS}")
    (microseconds,) = floats("stamp: value", words[:1])
    return LaserScan(
        numbers.vector("range", words[_BEFORE:]) / 1000,
        _FIRST_STEP * _STEP,
        _STEP,
        range_min=_RANGE_MIN,
        range_max=_RANGE_MAX,
        stamp=microseconds * 1e-6,
        scan_time=_SCAN_TIME,
    )
