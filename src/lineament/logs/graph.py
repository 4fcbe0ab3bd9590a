"""Graphs of poses with scans: TORO (VERTEX2) and g2o (VERTEX_SE2), both with ROBOTLASER1."""

import math
import re
from array import array
from contextlib import suppress

from ..errors import LogError
from ..scan import LaserScan, Pose
from .base import Head
from .carmen import robotlaser
from .linelog import Fields, LineLog, Parser

_SCAN = "ROBOTLASER1"
_VERTICES = {kind: Fields(kind, "_ x y theta") for kind in ("VERTEX2", "VERTEX_SE2")}
_UNKNOWN = (math.nan, math.nan, math.nan)
#: Messages of a robot's log, of which a graph has none.
_OTHERS = re.compile(rb"(?m)^[ \t]*(?:PARAM|ODOM|[FR]LASER)[ \t]")


class GraphLog(LineLog):
    """A graph of poses whose vertices have scans (ROBOTLASER1)."""

    format = "graph"
    description = "TORO or g2o (VERTEX2, VERTEX_SE2 with ROBOTLASER1)"
    endings = (".g2o", ".toro", ".graph")
    signature = re.compile(rb"(?m)^[ \t]*(?:VERTEX|EDGE)(?:2|_SE2)[ \t]")
    kinds = (*_VERTICES, "EDGE2", "EDGE_SE2", _SCAN)
    scan_kinds = read_kinds = (_SCAN,)
    other_kinds = tuple(_VERTICES)

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether lines near the beginning are those of a graph, and none of a robot's log."""
        return super().recognises(head) and _OTHERS.search(head.data) is None

    def _parser(self) -> Parser:
        by_order = self._vertices_come_first()
        # Three numbers a vertex: all of them where the scans come later, else the last one.
        vertices, taken = array("d"), 0

        def parse(kind: str, line: bytes) -> LaserScan | None:
            nonlocal taken
            if kind == _SCAN:
                vertex = _vertex(vertices, taken)
                taken += by_order
                return robotlaser(line, vertex)
            if not by_order:
                del vertices[:]
            self.limits.check("scans", len(vertices) // 3 + 1)
            vertices.extend(_UNKNOWN)  # Its place is kept even if it cannot be read.
            read = _VERTICES[kind].read(line)
            vertices[-3:] = array("d", (read["x"], read["y"], read["theta"]))
            return None

        return parse

    def _vertices_come_first(self) -> bool:
        """Whether several vertices precede the first scan, and none is between it and the next."""
        before = scans = 0
        # A stream that breaks is reported when the scans are read.
        with suppress(LogError):
            for _, line in self._lines():
                kind = self._kind(line)
                if kind == _SCAN:
                    scans += 1
                    if scans == 2:
                        return before > 1
                elif kind in _VERTICES:
                    if scans:
                        return False
                    before += 1
        return False


def _vertex(vertices: "array[float]", k: int) -> Pose | None:
    pose = vertices[3 * k : 3 * k + 3]
    return (pose[0], pose[1], pose[2]) if len(pose) and all(map(math.isfinite, pose)) else None
