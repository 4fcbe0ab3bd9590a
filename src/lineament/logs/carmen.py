"""CARMEN logs: text lines FLASER, RLASER and ROBOTLASER1 among others, plain or gzip.

The robots' own logs and their SLAM-corrected versions. All other messages are passed over.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from ..scan import LaserScan
from .base import Head
from .bearings import SICK_RANGE_MAX, sick_step
from .linelog import LineLog
from .lines import BOM
from .robotlaser import check_count, parse_robotlaser
from .words import Numbers, floats, whole_number

__all__ = ["CarmenLog"]

FRAME = "laser"

_KNOWN = re.compile(
    rb"(?m)^[ \t]*(?:PARAM|SYNC|ODOM|NEFF|TRUEPOS|[FR]LASER|LASER[345]|RAWLASER\d|ROBOTLASER\d"
    rb"|VERTEX2|EDGE2)[ \t]"
)
#: The bulk of the lines of most logs, known by their beginning, which is quicker.
_OFTEN = (b"ODOM ", b"NEFF ")
_LASER_MAX = re.compile(rb"(?:robot|laser)_(front|rear)_?laser_max$")
_PARAM_TOPIC = {b"front": "FLASER", b"rear": "RLASER"}

# After the ranges of FLASER: x y theta odom_x odom_y odom_theta ipc_timestamp host logger_time.
_TAIL = 9


class CarmenLog(LineLog):
    """A CARMEN log; front scans (FLASER, ROBOTLASER1) unless another topic is asked for.

    Beams of FLASER and RLASER start at -90°, in steps of exactly 1° (180 or 181 beams), 0.5°
    (360, 361) or π/(n-1). Their `range_max` is that of the last ``PARAM robot_front_laser_max``
    (or ``laser_front_laser_max``, ``robot_rear_laser_max``, …) before them, else 50 m, beyond
    which SICK scanners report that they saw nothing (51.15, 81.83, 81.91). ROBOTLASER1 has its
    own. Poses are those of the laser as logged, stamps the robot's own (``ipc_timestamp``).

    Raises
    ------
    LogError
        If there is no such topic, or no scan line at all.
    """

    format = "carmen"
    description = "CARMEN (FLASER, ROBOTLASER1)"
    endings = (".log", ".clf", ".carmen")
    scan_kinds = ("FLASER", "ROBOTLASER1", "RLASER")
    read_kinds = ("FLASER", "ROBOTLASER1")

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether a line near the beginning is a message of CARMEN."""
        return _KNOWN.search(head.data.removeprefix(BOM)) is not None

    @staticmethod
    def _kind(line: bytes) -> str:
        # The longest name has 11 letters: no need to split the thousand characters behind it.
        words = line[:24].split(None, 1)
        name = words[0].decode("latin-1") if words else ""
        return name if name in CarmenLog.scan_kinds or _KNOWN.match(line) else ""

    def _items(self) -> Iterator[tuple[str, LaserScan]]:
        numbers = Numbers()
        range_max = dict.fromkeys(self.scan_kinds, SICK_RANGE_MAX)
        for number, line in self._lines():
            if line.startswith(_OFTEN):
                continue
            name = self._kind(line)
            if name in self._wanted:
                try:
                    scan = _parse(name, line.split(), numbers, range_max[name])
                except (ValueError, OverflowError) as error:
                    self._bad_line(number, error)
                else:
                    yield name, scan
            elif name == "PARAM":
                _read_limit(line.split(), range_max)


def _parse(name: str, words: list[bytes], numbers: Numbers, range_max: float) -> LaserScan:
    if name == "ROBOTLASER1":
        return parse_robotlaser(words, numbers, range_max, FRAME)
    if len(words) < 2:
        raise ValueError(f"{name} has nothing behind it, expected the number of ranges")
    n = whole_number(f"{name}: the number of ranges", words[1])
    check_count(name, "ranges", n, len(words) - 2 - _TAIL, _TAIL)
    x, y, theta, *_, stamp = floats(f"{name} pose and stamp: value", words[2 + n : 9 + n])
    return LaserScan(
        numbers.vector(f"{name} range", words[2 : 2 + n]),
        -math.pi / 2,
        sick_step(n),
        range_max=range_max,
        stamp=stamp,
        frame_id=FRAME,
        pose=(x, y, theta),
    )


def _read_limit(words: list[bytes], range_max: dict[str, float]) -> None:
    """Take over the largest range that a PARAM line gives; other lines are none of ours."""
    match = _LASER_MAX.match(words[1]) if len(words) > 2 else None
    if match is None:
        return
    try:
        value = Numbers()[words[2]]
    except ValueError:
        return
    if 0 < value < math.inf:
        range_max[_PARAM_TOPIC[match[1]]] = value
