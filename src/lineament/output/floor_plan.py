"""Floor plan of a log: the walls, corners and columns that its scans have in common.

Segments of many scans that lie on one line are one wall. A segment joins a wall

- that it faces the same way as: their directions, from start to end as the sensor sees them, differ
  by less than 2°, or by less than three deviations of the segment's own angle,
- that it lies on: the ends of the shorter are within 5 cm of the line of the longer,
- that it touches: they overlap along the line, or leave less than 20 cm between them.

Segments whose own covariance leaves their ends more than 5 cm uncertain join none. Walls that have
become one are merged, and so are copies that the poses have moved: walls less than 15 cm apart of
which half lies beside each other, since the nearer would hide the farther; all that was seen of
both must lie on one line within 5 cm (rms).

The line of a wall is the one through all metres that were seen of it (least squares, each metre of
each view with the same weight). Along it a wall counts in how many views each 5 cm were seen: where
that was too seldom it is not drawn, so a door that was shut once does not close its doorway, and a
person who stood still is no wall. Both sides of a partition face different ways and stay apart.

Nothing is pulled straight, parallel or square, and no gap is filled. What is drawn is as good as
the poses: where they drift by more, a wall is there twice.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from .averages import Averages
from .markers import FARTHEST, Markers
from .walls import Wall, offsets_between

__all__ = ["WALL", "FloorPlan"]

Array = NDArray[np.float64]

#: A straight piece of a wall [m], and the mean number of segments that show it.
WALL = np.dtype([("start", "f8", 2), ("end", "f8", 2), ("views", "f8")])

ANGLE = math.radians(2)
OFFSET, COPY_OFFSET = 0.05, 0.15
#: Shorter segments tell too little about where their wall runs; longer ones than any scanner can
#: see are left out too, so that no log can make a wall without end [m].
SHORTEST, LONGEST = 0.2, 1000.0
#: So many walls are kept at a time; the least seen are forgotten first.
MOST_WALLS = 20_000
#: How far the corners, and the centre and radius of the arcs, of one thing may differ [m].
CORNER_RADIUS, ARC_RADIUS = 0.15, 0.1


class FloorPlan:
    """Walls, corners and arcs that the scans of a log have in common, merged as they come.

    Memory grows with what the plan shows, not with the number of scans, and is bounded.

    Examples
    --------
    >>> import lineament as ln
    >>> scan = ln.LaserScan([2.0] * 41, angle_min=-0.2, angle_increment=0.01)
    >>> wall = ln.LaserScan(2.0 / np.cos(scan.angles), angle_min=-0.2, angle_increment=0.01)
    >>> plan = FloorPlan()
    >>> for y in (0.0, 0.1, 0.2):
    ...     plan.add(ln.extract(wall).transform(1.0, y, 0.0))
    >>> plan.walls(min_views=3)["start"].round(1).tolist()
    [[3.0, -0.2]]
    """

    def __init__(self) -> None:
        self._walls: list[Wall] = []
        self._ends = np.zeros((0, 2, 2))
        self._corners, self._edges = Averages(2, CORNER_RADIUS), Averages(2, CORNER_RADIUS)
        self._arcs = Averages(3, ARC_RADIUS)

    def add(self, features: Features) -> None:
        """Add the features of a scan, moved into the frame of the plan."""
        lines = np.stack((features.segments["start"], features.segments["end"]), axis=1)
        is_near = (np.abs(lines) < FARTHEST).all(axis=(1, 2))
        lines, covariance = lines[is_near], features.segments["covariance"][is_near]
        lengths = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
        offset, angle = covariance[:, 0, 0], covariance[:, 1, 1]
        is_sure = offset + (lengths / 2) ** 2 * angle <= OFFSET**2
        good = is_sure & (lengths >= SHORTEST) & (lengths <= LONGEST)  # NaN is none of these
        self._add_lines(lines[good], 3 * np.sqrt(np.maximum(angle[good], (ANGLE / 3) ** 2)))
        corners = features.corners
        is_edge = corners["kind"] == "edge"
        self._corners.add(corners["position"][~is_edge])
        self._edges.add(corners["position"][is_edge])
        self._arcs.add(np.column_stack((features.arcs["center"], features.arcs["radius"])))
        if len(self._walls) > MOST_WALLS:
            self._merge()
            del self._walls[MOST_WALLS // 2 :]
            self._ends = self._ends[: len(self._walls)]

    def _add_lines(self, lines: Array, angles: Array) -> None:
        offsets = offsets_between(lines, self._ends, angles)
        touched = set()
        for row, line in zip(offsets, lines, strict=True):
            k = int(row.argmin()) if len(row) else -1
            if k < 0 or not row[k] < OFFSET:
                k = len(self._walls)
                self._walls.append(Wall(line[0], (line[1] - line[0]) / math.dist(*line)))
            self._walls[k].see(line)
            touched.add(k)
        self._update(touched)

    def _update(self, touched: set[int]) -> None:
        """Bring the array of the ends, by which walls are found, up to date."""
        missing = len(self._walls) - len(self._ends)
        if missing > 0:  # twice the place: a row at a time would copy all of them each time
            spare = np.full((missing + len(self._ends), 2, 2), np.nan)
            self._ends = np.concatenate((self._ends, spare))
        for k in touched:
            self._ends[k] = self._walls[k].ends()

    def _merge(self) -> None:
        """Merge walls that have become one, those of which most was seen first."""
        old = sorted(self._walls, key=lambda wall: -wall.length)
        self._walls, self._ends = [], np.zeros((0, 2, 2))
        for wall in old:
            k = self._same(wall)
            if k < 0:
                k = len(self._walls)
                self._walls.append(wall)
            else:
                self._walls[k].absorb(wall)
            self._update({k})

    def _same(self, wall: Wall) -> int:
        """Find the wall that a wall is a part of, or a copy that the poses have moved; or -1."""
        ends = wall.ends()[None]
        offsets = offsets_between(ends, self._ends, np.array([ANGLE]))[0]
        near = np.flatnonzero(offsets < COPY_OFFSET)
        for k in near[np.argsort(offsets[near], kind="stable")]:
            mate = self._walls[k]
            is_beside = offsets[k] < OFFSET or mate.shared(wall) > 0.5
            if is_beside and mate.spread(wall) < OFFSET:
                return int(k)
        return -1

    def walls(self, min_views: int = 1) -> NDArray[np.void]:
        """Give the parts of the walls that were seen in at least so many views.

        Returns
        -------
        structured array, shape (n,)
            Of dtype `WALL`, the longest wall first; pieces shorter than 20 cm are left out.
        """
        self._merge()
        found = [
            piece
            for wall in self._walls
            for piece in wall.pieces(min_views)
            if math.dist(piece[0], piece[1]) >= SHORTEST
        ]
        return np.array(found, dtype=WALL)

    def markers(self, min_views: int = 1) -> tuple[Markers, NDArray[np.int64]]:
        """Give what is drawn: walls, corners, edges, and arcs as whole circles, seen so often.

        The second array (n,) tells the mean views of each wall, rounded.
        """
        walls, arcs = self.walls(min_views), self._arcs.seen(min_views)
        turn = np.tile([0.0, 2 * math.pi], (len(arcs), 1))
        markers = Markers(
            segments=np.stack((walls["start"], walls["end"]), axis=1),
            corners=self._corners.seen(min_views),
            edges=self._edges.seen(min_views),
            arcs=np.hstack((arcs, turn)),
            ellipses=np.zeros((0, 5)),
        )
        return markers, np.rint(walls["views"]).astype(np.int64)
