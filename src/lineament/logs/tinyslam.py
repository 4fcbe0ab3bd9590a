"""Logs of tinySLAM (CoreSLAM): a line a scan of an URG-04LX, in columns without names."""

import math

from ..scan import LaserScan
from .base import Head
from .linelog import LineLog, Parser, number_parser, numbers, scalar

#: Columns before the ranges: the stamp, then encoders and other things of the robot.
_BEFORE = 25
_COLUMNS = _BEFORE + 682
# Data sheet of the URG-04LX: 1024 steps a turn, of which 44 to 725 measure and 384 looks ahead.
_STEP = 2 * math.pi / 1024
_FIRST_STEP = 44 - 384
_RANGE_MIN, _RANGE_MAX = 0.02, 5.6
_SCAN_TIME = 0.1


class TinyslamLog(LineLog):
    """A tinySLAM log: 707 columns, the stamp [µs], 24 others and 682 ranges [mm]."""

    format = "tinyslam"
    description = "tinySLAM (707 columns, URG-04LX)"
    endings = (".dat",)
    scan_kinds = read_kinds = ("scan",)

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether the first line has as many numbers as a tinySLAM log has columns."""
        words = head.data.lstrip().partition(b"\n")[0].split()
        try:
            return len(words) == len(numbers("column", words)) == _COLUMNS
        except ValueError:
            return False

    def _kind(self, line: bytes) -> str:
        return self.only_topic if line[:16].lstrip()[:1].isdigit() else ""

    def _parser(self) -> Parser:
        return lambda _, line: _scan(line)


def _scan(line: bytes) -> LaserScan:
    words = line.split()
    if len(words) != _COLUMNS:
        raise ValueError(f"has {len(words)} columns, expected {_COLUMNS}")
    number = number_parser(line)
    return LaserScan(
        numbers("range", words[_BEFORE:], number) / 1000,
        _FIRST_STEP * _STEP,
        _STEP,
        range_min=_RANGE_MIN,
        range_max=_RANGE_MAX,
        stamp=scalar("stamp", words[0], number) * 1e-6,
        scan_time=_SCAN_TIME,
    )
