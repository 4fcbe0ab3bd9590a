"""CARMEN logs: text lines FLASER, RLASER and ROBOTLASER1 among others, plain or gzip.

The robots' own logs, their SLAM-corrected versions, and TORO graphs (VERTEX2, EDGE2) that carry
ROBOTLASER1 lines. All other messages are passed over.
"""

from __future__ import annotations

import math
import os
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from ..scan import LaserScan
from .base import Head, Log
from .lines import numbered_lines

__all__ = ["CarmenLog"]

#: Range from which a SICK scanner saw nothing, where the log does not say otherwise [m].
DEFAULT_RANGE_MAX = 50.0
FRAME = "laser"

_FRONT = ("FLASER", "ROBOTLASER1")
_TOPICS = ("FLASER", "ROBOTLASER1", "RLASER")
_KNOWN = re.compile(
    rb"(?m)^[ \t]*(?:PARAM|SYNC|ODOM|NEFF|TRUEPOS|[FR]LASER|LASER[345]|RAWLASER\d|ROBOTLASER\d"
    rb"|VERTEX2|EDGE2)[ \t]"
)
#: The bulk of the lines of most logs, known by their beginning, which is quicker.
_OFTEN = (b"ODOM ", b"NEFF ", b"EDGE2 ", b"VERTEX2 ")
_LASER_MAX = re.compile(rb"(?:robot|laser)_(front|rear)_?laser_max$")
_PARAM_TOPIC = {b"front": "FLASER", b"rear": "RLASER"}

# After the ranges of FLASER: x y theta odom_x odom_y odom_theta ipc_timestamp host logger_time.
_FLASER_TAIL = 9
# After the remissions of ROBOTLASER1: laser pose, robot pose, tv rv forward side turn_axis,
# timestamp host logger_time.
_ROBOTLASER_TAIL = 14
# Logs print angles with 6 decimals; scanners step by simple fractions of a degree.
_ANGLES_PER_DEGREE = 12
_ANGLE_ROUNDING = 6e-7


class CarmenLog(Log):
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

    def __init__(
        self,
        path: str | os.PathLike[str],
        topic: str | None = None,
        *,
        keep_going: bool = False,
    ) -> None:
        super().__init__(path, topic, keep_going=keep_going)
        self._counts: Counter[str] | None = None
        self._wanted = _FRONT if topic is None else (topic,)
        # Stops at the first scan: a good log opens at once, however long it is.
        known = topic is None or topic in _TOPICS
        found = self._survey(self._wanted if known else ())
        if not known or not any(found[name] for name in self._wanted):
            raise self._no_scans(found)

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether a line near the beginning is a message of CARMEN or TORO."""
        return _KNOWN.search(head.data.removeprefix(b"\xef\xbb\xbf")) is not None

    @property
    def topics(self) -> list[str]:
        """The messages of the log that carry scans: FLASER, ROBOTLASER1, RLASER."""
        return [name for name in _TOPICS if self._all_counts()[name]]

    def __len__(self) -> int:
        return sum(self._all_counts()[name] for name in self._wanted)

    def _all_counts(self) -> Counter[str]:
        if self._counts is None:
            self._counts = self._survey(())
        return self._counts

    def _survey(self, until: Collection[str]) -> Counter[str]:
        """Count the lines of each message, without parsing, up to the first one of `until`."""
        counts: Counter[str] = Counter()
        try:
            for _, line in numbered_lines(self.path):
                name = _message(line)
                if name in _TOPICS or _KNOWN.match(line):
                    counts[name] += 1
                    if name in until:
                        break
        except LogError:
            # Without a scan before the break there is nothing to keep going with.
            if not self.keep_going or not any(counts[name] for name in self._wanted):
                raise
        return counts

    def _no_scans(self, found: Counter[str]) -> LogError:
        topics = [name for name in _TOPICS if found[name]]
        if not found:
            return LogError(self.path, f"is no CARMEN log, expected lines {', '.join(_TOPICS)}")
        if self.topic is not None:
            return self._no_such_topic(topics)
        there = ", ".join(f"{name} ({count})" for name, count in found.most_common(8))
        choose = f"; choose topic {topics[0]}" if topics else ""
        return LogError(self.path, f"holds {there}, expected {' or '.join(_FRONT)}{choose}")

    def _lines(self) -> Iterator[tuple[int, bytes]]:
        try:
            yield from numbered_lines(self.path)
        except LogError as error:
            self._fault(error)

    def _scans(self) -> Iterator[LaserScan]:
        numbers = _Numbers()
        range_max = dict.fromkeys(_TOPICS, DEFAULT_RANGE_MAX)
        for number, line in self._lines():
            if line.startswith(_OFTEN):
                continue
            name = _message(line)
            if name in self._wanted:
                try:
                    scan = _PARSERS[name](name, line.split(), numbers, range_max[name])
                except (ValueError, OverflowError) as error:
                    self._fault(LogError(self.path, str(error), line=number))
                else:
                    yield scan
            elif name == "PARAM":
                _read_limit(line.split(), range_max)


def _message(line: bytes) -> str:
    # The longest name has 11 letters: no need to split the thousand characters behind it.
    words = line[:24].split(None, 1)
    return words[0].decode("latin-1") if words else ""


class _Numbers(dict[bytes, float]):
    """Numbers by how they are written.

    Scanners report centimetres: a log has few different values, and to look one up takes half
    the time of converting it. The table is bounded, as memory must not grow with the log.
    """

    def __missing__(self, word: bytes) -> float:
        if b"_" in word:  # Python's own notation, nobody else's.
            raise ValueError
        value = float(word)
        if len(self) < 1 << 15 and len(word) < 16:
            self[word] = value
        return value

    def vector(self, what: str, words: list[bytes]) -> NDArray[np.float64]:
        try:
            return np.fromiter(map(self.__getitem__, words), np.float64, len(words))
        except ValueError:
            raise _no_number(what, words) from None


def _floats(what: str, words: list[bytes]) -> list[float]:
    """Numbers that hardly ever repeat, which would only fill the table."""
    try:
        if any(b"_" in word for word in words):
            raise ValueError
        return list(map(float, words))
    except ValueError:
        raise _no_number(what, words) from None


def _no_number(what: str, words: list[bytes]) -> ValueError:
    for i, word in enumerate(words):
        try:
            _Numbers()[word]
        except ValueError:
            text = word[:24].decode("ascii", "backslashreplace")
            return ValueError(f"{what} {i + 1} of {len(words)} is '{text}', expected a number")
    return ValueError(f"{what}: expected numbers")


def _count(what: str, word: bytes) -> int:
    if not word.isdigit() or len(word) > 9:
        text = word[:24].decode("ascii", "backslashreplace")
        raise ValueError(f"{what} is '{text}', expected a whole number")
    return int(word)


def _parse_flaser(name: str, words: list[bytes], numbers: _Numbers, range_max: float) -> LaserScan:
    if len(words) < 2:
        raise ValueError(f"{name} has nothing behind it, expected the number of ranges")
    n = _count(f"{name}: the number of ranges", words[1])
    _check_count(name, "ranges", n, len(words) - 2 - _FLASER_TAIL, _FLASER_TAIL)
    x, y, theta, *_, stamp = _floats(f"{name} pose and stamp: value", words[2 + n : 9 + n])
    return LaserScan(
        numbers.vector(f"{name} range", words[2 : 2 + n]),
        -math.pi / 2,
        _flaser_step(n),
        range_max=range_max,
        stamp=stamp,
        frame_id=FRAME,
        pose=(x, y, theta),
    )


def _flaser_step(n: int) -> float:
    if n in (180, 181):
        return math.radians(1.0)
    if n in (360, 361):
        return math.radians(0.5)
    return math.pi / max(n - 1, 1)


def _parse_robotlaser(
    name: str, words: list[bytes], numbers: _Numbers, range_max: float
) -> LaserScan:
    if len(words) < 9:
        raise ValueError(f"{name} has {len(words) - 1} values, expected at least 8 and ranges")
    _, start, _, step, own_max, *_ = _floats(f"{name} header: value", words[1:8])
    n = _count(f"{name}: the number of ranges", words[8])
    after = 9 + n  # Where the number of remissions stands.
    if after >= len(words):
        # Nothing tells ranges from what should follow them.
        _check_count(name, "ranges", n, len(words) - 10 - _ROBOTLASER_TAIL, _ROBOTLASER_TAIL + 1)
    m = _count(f"{name}: the number of remissions behind {n} ranges", words[after])
    tail = after + 1 + m
    _check_count(name, "remissions", m, len(words) - after - 1 - _ROBOTLASER_TAIL, _ROBOTLASER_TAIL)
    x, y, theta = _floats(f"{name} pose: value", words[tail : tail + 3])
    (stamp,) = _floats(f"{name} stamp: value", words[tail + 11 : tail + 12])
    remissions = numbers.vector(f"{name} remission", words[after + 1 : tail])
    return LaserScan(
        numbers.vector(f"{name} range", words[9:after]),
        _snap(start),
        _snap(step),
        range_max=own_max if own_max > 0 else range_max,
        stamp=stamp,
        frame_id=FRAME,
        intensities=remissions if m == n and n else None,
        pose=(x, y, theta),
    )


def _check_count(name: str, what: str, says: int, has: int, tail: int) -> None:
    if says != has:
        found = f"{has} of them" if has >= 0 else "too few values even for none"
        raise ValueError(f"{name} says {says} {what} and has {found} before its last {tail} values")


def _snap(angle: float) -> float:
    """Return the multiple of 1/12° that was rounded to `angle` [rad], or `angle` itself."""
    if not math.isfinite(angle):
        return angle
    exact = math.radians(round(math.degrees(angle) * _ANGLES_PER_DEGREE) / _ANGLES_PER_DEGREE)
    return exact if abs(exact - angle) <= _ANGLE_ROUNDING else angle


def _read_limit(words: list[bytes], range_max: dict[str, float]) -> None:
    """Take over the largest range that a PARAM line gives; other lines are none of ours."""
    match = _LASER_MAX.match(words[1]) if len(words) > 2 else None
    if match is None:
        return
    try:
        value = _Numbers()[words[2]]
    except ValueError:
        return
    if 0 < value < math.inf:
        range_max[_PARAM_TOPIC[match[1]]] = value


_PARSERS: dict[str, Callable[[str, list[bytes], _Numbers, float], LaserScan]] = {
    "FLASER": _parse_flaser,
    "RLASER": _parse_flaser,
    "ROBOTLASER1": _parse_robotlaser,
}
