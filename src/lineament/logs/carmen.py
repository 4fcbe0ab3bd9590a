"""CARMEN logs: text lines FLASER, RLASER and ROBOTLASER1 among others.

The robots' logs and their SLAM-corrected versions. All other messages are passed over.
"""

import math
import re
from contextlib import suppress

from ..scan import LaserScan, Pose
from .bearings import SICK_RANGE_MAX, sick_step, snap
from .linelog import Fields, LineLog, Parser, number_parser

_KINDS = (
    *("PARAM", "SYNC", "ODOM", "NEFF", "TRUEPOS", "FLASER", "RLASER", "LASER3", "LASER4", "LASER5"),
    *(f"{name}{i}" for name in ("RAWLASER", "ROBOTLASER") for i in range(10)),
    *("VERTEX2", "EDGE2"),
)
_LASER_MAX = re.compile(rb"(?:robot|laser)_(front|rear)_?laser_max$")
_PARAM_TOPIC = {b"front": "FLASER", b"rear": "RLASER"}

# Behind the poses: odometry, time of IPC, host, time of the logger.
_LASER = "ranges* x y theta _ _ _ stamp _ _"
_ROBOTLASER = (
    "_ start _ step limit _ _ ranges* remissions* x y theta robot_x robot_y robot_theta "
    "_ _ _ _ _ stamp _ _"
)
_FIELDS = {
    "FLASER": Fields("FLASER", _LASER),
    "RLASER": Fields("RLASER", _LASER),
    "ROBOTLASER1": Fields("ROBOTLASER1", _ROBOTLASER),
}


class CarmenLog(LineLog):
    """A CARMEN log; front scans (FLASER, ROBOTLASER1) unless another topic is asked for."""

    format = "carmen"
    description = "CARMEN (FLASER, ROBOTLASER1)"
    endings = (".log", ".clf", ".carmen")
    kinds = _KINDS
    signature = re.compile(rb"(?m)^[ \t]*(?:%s)[ \t]" % "|".join(_KINDS).encode())
    scan_kinds = ("FLASER", "ROBOTLASER1", "RLASER")
    read_kinds = ("FLASER", "ROBOTLASER1")
    other_kinds = ("PARAM",)

    def _parser(self) -> Parser:
        range_max = dict.fromkeys(self.scan_kinds, SICK_RANGE_MAX)

        def parse(kind: str, line: bytes) -> LaserScan | None:
            if kind == "PARAM":
                _read_limit(line, range_max)
                return None
            if kind == "ROBOTLASER1":
                return robotlaser(line)
            read = _FIELDS[kind].read(line)
            ranges = read["ranges"]
            return LaserScan(
                ranges,
                -math.pi / 2,
                sick_step(len(ranges)),
                range_max=range_max[kind],
                stamp=read["stamp"],
                frame_id="laser",
                pose=(read["x"], read["y"], read["theta"]),
            )

        return parse


def robotlaser(line: bytes, corrected: Pose | None = None) -> LaserScan:
    """Return the scan of a line ROBOTLASER1, which CARMEN logs and graphs of poses have.

    A corrected pose of the robot [m, m, rad] replaces that of the line; the laser moves along.
    """
    read = _FIELDS["ROBOTLASER1"].read(line)
    ranges, remissions = read["ranges"], read["remissions"]
    pose = read["x"], read["y"], read["theta"]
    if corrected is not None:
        robot = read["robot_x"], read["robot_y"], read["robot_theta"]
        pose = _moved(pose, robot, corrected)
    return LaserScan(
        ranges,
        snap(read["start"]),
        snap(read["step"]) or read["step"],
        range_max=read["limit"] if read["limit"] > 0 else SICK_RANGE_MAX,
        stamp=read["stamp"],
        frame_id="laser",
        intensities=remissions if 0 < len(remissions) == len(ranges) else None,
        pose=pose,
    )


def _moved(laser: Pose, robot: Pose, corrected: Pose) -> Pose:
    """Return the pose of the laser, which is fixed to the robot, with the robot at `corrected`."""
    x, y, turn = (a - b for a, b in zip(laser, robot, strict=True))
    angle = corrected[2] - robot[2]
    cos, sin = math.cos(angle), math.sin(angle)
    return corrected[0] + cos * x - sin * y, corrected[1] + sin * x + cos * y, corrected[2] + turn


def _read_limit(line: bytes, range_max: dict[str, float]) -> None:
    """Take over the largest range that a PARAM line gives; others do not matter here."""
    words = line.split()
    match = _LASER_MAX.match(words[1]) if len(words) > 2 else None
    if match is None:
        return
    with suppress(ValueError):
        value = number_parser(line)(words[2])
        if 0 < value < math.inf:
            range_max[_PARAM_TOPIC[match[1]]] = value
