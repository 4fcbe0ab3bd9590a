"""DP-SLAM logs: text lines Odometry and Laser, in turns."""

import math
import re

from ..scan import LaserScan, Pose
from .bearings import SICK_RANGE_MAX, sick_step
from .linelog import Fields, LineLog, Parser

_ODOMETRY = Fields("Odometry", "x y theta")
_LASER = Fields("Laser", "ranges*")
#: A SICK scanner that counts millimetres in 13 bits reports what it saw nothing of from here [m].
_MILLIMETRE_CODES, _MILLIMETRE_LARGEST = 8.183, 8.1915


class DpslamLog(LineLog):
    """A DP-SLAM log: ``Odometry x y theta``, then ``Laser n r1 … rn`` [m, rad], no stamps."""

    format = "dpslam"
    description = "DP-SLAM (Odometry, Laser)"
    endings = (".dpslam",)
    signature = re.compile(rb"(?m)^[ \t]*Laser[ \t]+\d+[ \t]+[-+.\d]")
    kinds = ("Odometry", "Laser")
    scan_kinds = read_kinds = ("Laser",)
    other_kinds = ("Odometry",)

    def _parser(self) -> Parser:
        pose: Pose | None = None

        def parse(kind: str, line: bytes) -> LaserScan | None:
            nonlocal pose
            # Behind a fault none is known: that of another scan would be worse.
            known, pose = pose, None
            if kind == "Odometry":
                read = _ODOMETRY.read(line)
                pose = read["x"], read["y"], read["theta"]
                return None
            ranges = _LASER.read(line)["ranges"]
            is_millimetres = _MILLIMETRE_CODES <= ranges.max(initial=0.0) <= _MILLIMETRE_LARGEST
            pose = known
            return LaserScan(
                ranges,
                -math.pi / 2,
                sick_step(len(ranges)),
                range_max=_MILLIMETRE_CODES if is_millimetres else SICK_RANGE_MAX,
                pose=known,
            )

        return parse
