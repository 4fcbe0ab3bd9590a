"""The line ROBOTLASER1, which CARMEN logs and graphs of poses hold."""

from __future__ import annotations

import math

from ..scan import LaserScan, Pose
from .bearings import snap
from .words import Numbers, floats, whole_number

__all__ = ["check_count", "parse_robotlaser"]

# After the remissions: laser pose, robot pose, tv rv forward side turn_axis,
# timestamp host logger_time.
_TAIL = 14


def parse_robotlaser(
    words: list[bytes],
    numbers: Numbers,
    range_max: float,
    frame_id: str,
    corrected: Pose | None = None,
) -> LaserScan:
    """Make a scan of the words of a line ROBOTLASER1.

    Parameters
    ----------
    words : list of bytes
        The line.
    numbers : Numbers
        Numbers that were met before.
    range_max : float
        Largest range [m] where the line has none of its own.
    frame_id : str
        Frame of the scan.
    corrected : (x, y, theta), optional
        Pose of the robot that replaces the line's own [m, m, rad]; that of the laser moves along.

    Raises
    ------
    ValueError
        If the counts in the line do not fit, or a word is no number.
    """
    name = "ROBOTLASER1"
    if len(words) < 9:
        raise ValueError(f"{name} has {len(words) - 1} values, expected at least 8 and ranges")
    _, start, _, step, own_max, *_ = floats(f"{name} header: value", words[1:8])
    n = whole_number(f"{name}: the number of ranges", words[8])
    after = 9 + n  # Where the number of remissions stands.
    if after >= len(words):
        # Nothing tells ranges from what should follow them.
        check_count(name, "ranges", n, len(words) - 10 - _TAIL, _TAIL + 1)
    m = whole_number(f"{name}: the number of remissions behind {n} ranges", words[after])
    tail = after + 1 + m
    check_count(name, "remissions", m, len(words) - after - 1 - _TAIL, _TAIL)
    pose = _pose(words[tail : tail + 3], words[tail + 3 : tail + 6], corrected)
    (stamp,) = floats(f"{name} stamp: value", words[tail + 11 : tail + 12])
    remissions = numbers.vector(f"{name} remission", words[after + 1 : tail])
    return LaserScan(
        numbers.vector(f"{name} range", words[9:after]),
        snap(start),
        snap(step),
        range_max=own_max if own_max > 0 else range_max,
        stamp=stamp,
        frame_id=frame_id,
        intensities=remissions if m == n and n else None,
        pose=pose,
    )


def check_count(name: str, what: str, says: int, has: int, tail: int) -> None:
    """Check that a line has as many values as it says, before its last `tail`."""
    if says != has:
        found = f"{has} of them" if has >= 0 else "too few values even for none"
        raise ValueError(f"{name} says {says} {what} and has {found} before its last {tail} values")


def _pose(laser: list[bytes], robot: list[bytes], corrected: Pose | None) -> Pose:
    """Return the pose of the laser, which is fixed to the robot, with the robot at `corrected`."""
    if corrected is not None and laser == robot:
        return corrected
    x, y, theta = floats("ROBOTLASER1 pose: value", laser)
    if corrected is None:
        return x, y, theta
    a, b, c = floats("ROBOTLASER1 robot pose: value", robot)
    cos, sin = math.cos(corrected[2] - c), math.sin(corrected[2] - c)
    return (
        corrected[0] + cos * (x - a) - sin * (y - b),
        corrected[1] + sin * (x - a) + cos * (y - b),
        corrected[2] + theta - c,
    )
