"""Logs of the robot server Player, by its driver writelog: a line a message of a device.

https://playerstage.sourceforge.net/doc/Player-svn/player/group__tutorial__datalog.html
"""

import re

from ..scan import LaserScan, Pose
from .bearings import snap
from .linelog import Fields, LineLog, Parser

# A line: time, host, robot, interface, index, type, subtype, and what the message holds.
_LINE = rb"[ \t]*\d+\.\d+[ \t]+\d+[ \t]+\d+[ \t]+([a-z]\w*)[ \t]+\d+[ \t]+(\d{3})[ \t]+(\d{3})[ \t]"
_BEAMS = "first _ step limit ranges,intensities*"
_FIELDS = {
    "laser 1:1": Fields("laser", f"_ _ _ index _ _ _ {_BEAMS}"),
    "laser 1:2": Fields("laser", f"_ _ _ index _ _ _ x y theta {_BEAMS}"),
    "position2d 1:1": Fields("position2d", "_ _ _ _ _ _ x y theta"),
}


class PlayerLog(LineLog):
    """A log of Player 2 or 3; poses are the robot's, the last one given."""

    format = "player"
    description = "Player (laser of writelog)"
    endings = (".log",)
    signature = re.compile(rb"(?m)^" + _LINE)
    scan_kinds = read_kinds = ("laser 1:1", "laser 1:2")
    other_kinds = ("position2d 1:1",)

    def _kind(self, line: bytes) -> str:
        match = re.match(_LINE, line)
        return f"{match[1].decode()} {int(match[2])}:{int(match[3])}" if match else ""

    def _parser(self) -> Parser:
        robot: Pose | None = None

        def parse(kind: str, line: bytes) -> LaserScan | None:
            nonlocal robot
            known, robot = robot, None  # Behind a fault it is not known.
            read = _FIELDS[kind].read(line)
            robot = (read["x"], read["y"], read["theta"]) if "x" in read else known
            if kind in self.other_kinds:
                return None
            return LaserScan(
                read["ranges"],
                read["first"],
                snap(read["step"]) or read["step"],
                range_max=read["limit"] or float("inf"),
                stamp=float(line.split(None, 1)[0]),
                frame_id=f"laser:{read['index']:g}",
                intensities=read["intensities"] if read["intensities"].any() else None,
                pose=robot,
            )

        return parse
