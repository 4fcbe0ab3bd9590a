"""Floor plan of a log: the walls, corners and columns that its scans have in common.

Segments of many scans that lie on one line are one wall; ``docs/formats.md`` has the rules. Its
line goes through all metres that were seen of it (least squares, each metre of each view with the
same weight). Along it a wall counts in how many views each 5 cm were seen: where that was too
seldom it is not drawn, so a door that was shut once does not close its doorway.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..scan import Array
from .markers import Markers, is_drawn
from .walls import Wall, offsets_between

#: A straight piece of a wall [m], and the mean number of segments that show it.
WALL = np.dtype([("start", "f8", 2), ("end", "f8", 2), ("views", "f8")])

ANGLE = math.radians(2)
OFFSET, COPY_OFFSET = 0.05, 0.15
#: Shorter segments say too little about where their wall runs; longer ones no scanner sees: no log
#: shall make a wall without end [m].
SHORTEST, LONGEST = 0.2, 1000.0
#: So many walls, and so many corners, are kept; the least seen are forgotten first.
MOST = 20_000
#: How far the corners, and the centre and radius of the arcs, of one thing may differ [m].
CORNER_RADIUS, ARC_RADIUS = 0.15, 0.1


class FloorPlan:
    """Walls, corners and arcs that the scans of a log have in common, in bounded memory."""

    def __init__(self) -> None:
        self._walls: list[Wall] = []
        self._ends = np.zeros((0, 2, 2))
        self._corners, self._edges = Averages(2, CORNER_RADIUS), Averages(2, CORNER_RADIUS)
        self._arcs = Averages(3, ARC_RADIUS)

    def add(self, features: Features) -> None:
        """Add the features of a scan, moved into the frame of the plan."""
        lines = np.stack((features.segments["start"], features.segments["end"]), axis=1)
        drawn = is_drawn(lines)
        lines, covariance = lines[drawn], features.segments["covariance"][drawn]
        lengths = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
        offset, angle = covariance[:, 0, 0], covariance[:, 1, 1]
        is_sure = offset + (lengths / 2) ** 2 * angle <= OFFSET**2
        good = is_sure & (lengths >= SHORTEST) & (lengths <= LONGEST)  # NaN fails all of these
        self._add_lines(lines[good], 3 * np.sqrt(np.maximum(angle[good], (ANGLE / 3) ** 2)))
        self._corners.add(features.corners["position"])
        self._edges.add(features.edges["position"])
        self._arcs.add(np.column_stack((features.arcs["center"], features.arcs["radius"])))
        if len(self._walls) > MOST:
            self._merge()
            del self._walls[MOST // 2 :]
            self._ends = self._ends[: len(self._walls)]

    def _add_lines(self, lines: Array, angles: Array) -> None:
        offsets = offsets_between(lines, self._ends, angles)
        touched = set()
        for row, line in zip(offsets, lines, strict=True):
            k = int(np.append(row, OFFSET).argmin())
            if k == len(row):  # no wall is as near
                k = len(self._walls)
                self._walls.append(Wall.along(line))
            self._walls[k].see(line)
            touched.add(k)
        added = np.empty((len(self._walls) - len(self._ends), 2, 2))
        self._ends = np.concatenate((self._ends, added))
        for k in touched:
            self._ends[k] = self._walls[k].ends()

    def _merge(self) -> None:
        """Merge walls that have become one, those of which most was seen first."""
        old = sorted(self._walls, key=lambda wall: -wall.length)
        self._walls, self._ends = [], np.full((len(old), 2, 2), np.nan)
        for wall in old:
            k = self._same(wall)
            if k < 0:
                k = len(self._walls)
                self._walls.append(wall)
            else:
                self._walls[k].absorb(wall)
            self._ends[k] = self._walls[k].ends()
        self._ends = self._ends[: len(self._walls)]

    def _same(self, wall: Wall) -> int:
        """Return the wall that a wall is a part of, or a copy that the poses have moved; or -1."""
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
        """Return the parts of the walls that were seen in at least so many views, as `WALL`.

        The longest wall comes first; pieces shorter than 20 cm are left out.
        """
        self._merge()
        pieces = (piece for wall in self._walls for piece in wall.pieces(min_views))
        kept = [piece for piece in pieces if math.dist(piece[0], piece[1]) >= SHORTEST]
        return np.array(kept, dtype=WALL)

    def markers(self, min_views: int = 1) -> tuple[Markers, NDArray[np.int64]]:
        """Return what is drawn: walls, corners, edges, and arcs as whole circles, seen so often.

        The second array (n,) has the mean views of each wall, rounded.
        """
        walls, arcs = self.walls(min_views), self._arcs.seen(min_views)
        markers = Markers(
            segments=np.stack((walls["start"], walls["end"]), axis=1),
            corners=self._corners.seen(min_views),
            edges=self._edges.seen(min_views),
            arcs=np.hstack((arcs, np.tile([0.0, 2 * math.pi], (len(arcs), 1)))),
            ellipses=np.zeros((0, 5)),
        )
        return markers, np.rint(walls["views"]).astype(np.int64)


class Averages:
    """Means of the points that lie near each other.

    A point joins the nearest mean within a radius [m], or begins a new one.
    """

    def __init__(self, dimensions: int, radius: float) -> None:
        self.radius = radius
        self._means = np.zeros((0, dimensions))
        self._views = np.zeros(0, dtype=np.int64)

    def add(self, points: Array) -> None:
        """Add the points (n, dimensions) of one scan; those that cannot be drawn are left out."""
        for point in points[is_drawn(points)]:
            distances = np.linalg.norm(self._means - point, axis=1)
            if len(distances) and distances.min() <= self.radius:
                k = int(distances.argmin())
                self._views[k] += 1
                self._means[k] += (point - self._means[k]) / self._views[k]
            else:
                self._means = np.vstack((self._means, point))
                self._views = np.append(self._views, 1)
        if len(self._means) > MOST:
            kept = np.sort(np.argsort(-self._views, kind="stable")[: MOST // 2])
            self._means, self._views = self._means[kept], self._views[kept]

    def seen(self, min_views: int) -> Array:
        """Return the means of at least so many points, shape (m, dimensions)."""
        return self._means[self._views >= min_views]
