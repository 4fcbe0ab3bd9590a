"""Graphs of poses with scans: TORO (VERTEX2) and g2o (VERTEX_SE2), both with ROBOTLASER1."""

from __future__ import annotations

import math
import re
from array import array
from collections.abc import Iterator
from contextlib import suppress

from ..errors import LogError
from ..scan import LaserScan, Pose
from .base import Head
from .bearings import SICK_RANGE_MAX
from .linelog import LineLog
from .lines import numbered_lines
from .robotlaser import parse_robotlaser
from .words import Numbers, floats

__all__ = ["GraphLog"]

FRAME = "laser"

_SCAN = "ROBOTLASER1"
_VERTICES = ("VERTEX2", "VERTEX_SE2")
_UNKNOWN = (math.nan, math.nan, math.nan)
_KNOWN = re.compile(rb"(?m)^[ \t]*(VERTEX2|VERTEX_SE2|EDGE2|EDGE_SE2|ROBOTLASER1)[ \t]")
_GRAPH = re.compile(rb"(?m)^[ \t]*(?:VERTEX|EDGE)(?:2|_SE2)[ \t]")
_OTHERS = re.compile(rb"(?m)^[ \t]*(?:PARAM|ODOM|[FR]LASER)[ \t]")


class GraphLog(LineLog):
    """A graph of poses whose vertices have scans (ROBOTLASER1).

    The pose of a scan is that of its vertex, moved from the robot to the laser as the scan's own
    two poses say. Its vertex is the last one before it; where all vertices come first, the k-th
    scan has the k-th vertex. A scan without a vertex keeps its own pose. Stamps are the robot's,
    bearings and `range_max` those of the line.

    Raises
    ------
    LogError
        If there is no scan line at all.
    """

    format = "graph"
    description = "TORO or g2o (VERTEX2, VERTEX_SE2 with ROBOTLASER1)"
    endings = (".g2o", ".toro", ".graph")
    scan_kinds = read_kinds = (_SCAN,)

    @classmethod
    def recognises(cls, head: Head) -> bool:
        """Whether lines near the beginning are those of a graph, and none of a robot's log."""
        return _GRAPH.search(head.data) is not None and _OTHERS.search(head.data) is None

    @staticmethod
    def _kind(line: bytes) -> str:
        match = _KNOWN.match(line)
        return match[1].decode() if match else ""

    def _items(self) -> Iterator[tuple[str, LaserScan]]:
        numbers, by_order = Numbers(), self._vertices_come_first()
        # Three numbers a vertex: all of them where the scans come later, else the last one.
        vertices, taken = array("d"), 0
        for number, line in self._lines():
            if line.startswith(b"EDGE"):
                continue
            kind = self._kind(line)
            try:
                if kind in _VERTICES:
                    if not by_order:
                        del vertices[:]
                    # Its place is kept even if it cannot be read.
                    vertices.extend(_UNKNOWN)
                    vertices[-3:] = array("d", _vertex_pose(kind, line.split()))
                if kind != _SCAN:
                    continue
                vertex = _vertex(vertices, taken)
                taken += by_order
                scan = parse_robotlaser(line.split(), numbers, SICK_RANGE_MAX, FRAME, vertex)
            except (ValueError, OverflowError) as error:
                self._bad_line(number, error)
            else:
                yield kind, scan

    def _vertices_come_first(self) -> bool:
        """Whether several vertices precede the first scan, and none is between it and the next."""
        before = scans = 0
        # A stream that breaks is reported when the scans are read.
        with suppress(LogError):
            for _, line in numbered_lines(self.source):
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


def _vertex_pose(kind: str, words: list[bytes]) -> list[float]:
    if len(words) < 5:
        raise ValueError(f"{kind} has {len(words) - 1} values, expected its number, x, y, theta")
    return floats(f"{kind} pose: value", words[2:5])


def _vertex(vertices: array[float], k: int) -> Pose | None:
    pose = vertices[3 * k : 3 * k + 3]
    return (pose[0], pose[1], pose[2]) if len(pose) and all(map(math.isfinite, pose)) else None
