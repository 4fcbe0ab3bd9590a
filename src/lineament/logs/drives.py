"""A log as the drive of one scanner, as `map`, `locate` and `calibrate` take it."""

import math
from collections.abc import Iterator
from itertools import chain, islice, pairwise

import numpy as np

from ..errors import LogError, one_line, warn
from ..rosmsg.frames import FASTEST
from ..scan import LaserScan, Pose
from .base import Log
from .sweeps import JUDGED, Sweeps

#: Headings in radians jump by a turn at most, where they wrap. Headings that jump by more than a
#: turn and a half, so often, are in degrees.
_JUMP, _JUMPS = 3 * math.pi, 3
#: Where a scanner stands, less than half of its ranges change by so much [m], people included. If
#: more do in so many scans, it moves.
_CHANGE, _CHANGES = 0.3, 3
_WAY_OUT = "--no-odometry leaves it out"


def one_scanner(log: Log, *, odometry: bool, deskewed: bool = False) -> Iterator[LaserScan]:
    """Return the scans of a log; a LogError if those of several topics, or scanners, are in it.

    If they are to be `deskewed`, it is one, too, that beams take far longer than from scan to scan.

    Scanners share a topic if it returns to a frame that it left; a scanner may be renamed within a
    log. At the end of the log, a warning says if its poses, where they are `odometry`, are in other
    units, stand still while the scanner moves, or are not there, though they are to be moved.
    """
    if log.topic is None and len(log.topics) > 1:
        several = ", ".join(log.topics)
        raise LogError(log.name, f"has scans of {several}, expected those of one: choose it")
    scans = _of_one_frame(log, odometry=odometry)
    return _in_time(log.name, scans) if deskewed else scans


def _in_time(name: str, scans: Iterator[LaserScan]) -> Iterator[LaserScan]:
    """Pass on scans, unless the first of them take too long to be deskewed."""
    sweeps, first = Sweeps(), list(islice(scans, JUDGED))
    for scan in first:
        sweeps.add(scan)
    if sweeps.is_too_long:
        problem = f"the beams of a scan take {sweeps.beams:.3g} s, and scans come every"
        raise LogError(
            name,
            f"{problem} {sweeps.step:.3g} s: are time_increment and scan_time in seconds? "
            "--no-deskew leaves them out",
        )
    yield from chain(first, scans)


def _of_one_frame(log: Log, *, odometry: bool) -> Iterator[LaserScan]:
    frame, before = "", dict.fromkeys([""])
    moved: list[tuple[float, Pose]] = []
    first, changes, has_moved = None, 0, False
    for topic, scan in log.measured():
        if scan.frame_id and scan.frame_id != frame:
            if scan.frame_id in before:
                frames = " and ".join(sorted(filter(None, before)))
                problem = f"has scans of frames {frames} by turns on {topic}"
                raise LogError(log.name, f"{problem}, expected those of one scanner")
            frame = scan.frame_id
            before[frame] = None
        if odometry and scan.pose is not None:
            moved.append((scan.stamp, scan.pose))
            first = scan if first is None else first
            has_moved = has_moved or scan.pose != first.pose
            changes += not has_moved and _is_elsewhere(first, scan)
        yield scan
    name = one_line(log.name)
    if odometry and not moved and any(log.options.laser_pose or ()):
        warn(f"{name}: no scan has a pose: laser_pose moves none")
    if changes >= _CHANGES and not has_moved:
        warn(f"{name}: its odometry stands still, and the scanner does not: {_WAY_OUT}")
    _check_units(name, moved)


def _is_elsewhere(first: LaserScan, scan: LaserScan) -> bool:
    """Whether half of the beams that are valid in both see something else."""
    if len(first) != len(scan):
        return False
    both = first.valid & scan.valid
    off = abs(scan.ranges[both] - first.ranges[both])
    return bool(2 * np.count_nonzero(off > _CHANGE) > len(off))


def _check_units(name: str, moved: list[tuple[float, Pose]]) -> None:
    """Warn if most steps of the odometry are faster than any robot, or if headings jump."""
    fast = jumps = 0
    for (since, before), (stamp, pose) in pairwise(moved):
        fast += math.dist(before[:2], pose[:2]) > FASTEST * (stamp - since) > 0
        jumps += abs(pose[2] - before[2]) > _JUMP
    if fast > len(moved) / 2:
        warn(
            f"{name}: its odometry is mostly faster than {FASTEST:g} m/s: is it in millimetres? "
            f"{_WAY_OUT}"
        )
    if jumps >= _JUMPS:
        warn(
            f"{name}: headings of its odometry jump by more than a turn, {jumps} times: are they "
            f"in degrees? {_WAY_OUT}"
        )
