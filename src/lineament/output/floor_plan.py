"""Floor plan of a log: the walls, corners and columns that its scans have in common.

Segments of many scans that lie on one line are one wall; ``docs/formats.md`` has the rules. Its
line goes through all metres that were seen of it (least squares, each metre of each view with the
same weight). Along it a wall counts in how many views each 5 cm were seen: where that was too
seldom it is not drawn, so a door that was shut once does not close its doorway.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..scan import Array
from .markers import Markers, is_drawn

#: A straight piece of a wall [m], and the mean number of segments that show it.
PIECE = np.dtype([("start", "f8", 2), ("end", "f8", 2), ("views", "f8")])

ANGLE = math.radians(2)
OFFSET, COPY_OFFSET = 0.05, 0.15
#: Shorter segments say too little about where their wall runs; longer ones no scanner sees: no log
#: shall make a wall without end [m].
SHORTEST, LONGEST = 0.2, 1000.0
#: So many walls, and so many corners, are kept; the least seen are forgotten first.
MOST = 20_000
#: How far the corners, and the centre and radius of the arcs, of one thing may differ [m].
CORNER_RADIUS, ARC_RADIUS = 0.15, 0.1

#: The most that may lie between two lines that touch [m].
GAP = 0.2
#: Length along which views are counted [m].
CELL = 0.05


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
        """Return the parts of the walls that were seen in at least so many views, as `PIECE`.

        The longest wall comes first; pieces shorter than 20 cm are left out.
        """
        self._merge()
        pieces = (piece for wall in self._walls for piece in wall.pieces(min_views))
        kept = [piece for piece in pieces if math.dist(piece[0], piece[1]) >= SHORTEST]
        return np.array(kept, dtype=PIECE)

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


@dataclass(slots=True)
class Wall:
    """One line in the plan.

    Places along it are counted in cells on an axis, from an origin [m]: the first start that was
    seen. Moments are the integral over all metres seen of v vᵀ, v = (1, x, y) from the origin;
    changes, by how much the number of views changes at each cell.
    """

    origin: Array
    axis: Array
    moments: Array = field(default_factory=lambda: np.zeros((3, 3)))
    changes: dict[int, int] = field(default_factory=dict)

    @classmethod
    def along(cls, line: Array) -> Self:
        """Make a wall on a line (2, 2) that nothing was seen of yet."""
        return cls(line[0], (line[1] - line[0]) / math.dist(*line))

    @property
    def length(self) -> float:
        """Length of all that was seen, as often as it was seen [m]."""
        return float(self.moments[0, 0])

    def see(self, line: Array) -> None:
        """Add one view of a part of the wall, from start to end, shape (2, 2)."""
        middle, half = np.ones(3), np.zeros(3)
        middle[1:], half[1:] = line.mean(axis=0) - self.origin, (line[1] - line[0]) / 2
        length = math.dist(*line)
        self.moments += length * (middle[:, None] * middle + half[:, None] * half / 3)
        self._count(self._cells(line), 1)

    def absorb(self, other: Wall) -> None:
        """Add all views of another wall."""
        self.moments = self._joint(other)
        stretches, views = other.stretches()
        for ends, number in zip(self._cells(other.at(stretches)), views, strict=True):
            self._count(ends, number)

    def _joint(self, other: Wall) -> Array:
        """Return the moments of what was seen of both."""
        shift = np.eye(3)
        shift[1:, 0] = other.origin - self.origin
        return self.moments + shift @ other.moments @ shift.T

    def spread(self, other: Wall) -> float:
        """Return the rms distance [m] of what was seen of both from their common line."""
        _, covariance = _mean_and_covariance(self._joint(other))
        return math.sqrt(max(float(np.linalg.eigvalsh(covariance)[0]), 0.0))

    def shared(self, other: Wall) -> float:
        """Return the share of what was seen of another wall that lies beside what this one has."""
        own, _ = self.stretches()
        theirs = np.sort(self._cells(other.at(other.stretches()[0])), axis=1)
        low = np.maximum(own[:, None, 0], theirs[:, 0])
        high = np.minimum(own[:, None, 1], theirs[:, 1])
        seen = int((theirs[:, 1] - theirs[:, 0]).sum())
        return float(np.maximum(high - low, 0).sum()) / seen if seen else 0.0

    def _cells(self, points: Array) -> NDArray[np.int64]:
        places: Array = (points - self.origin) @ self.axis
        return np.rint(places / CELL).astype(np.int64)

    def _count(self, ends: NDArray[np.int64], views: int) -> None:
        begin, end = ends.tolist()
        for cell, change in ((begin, views), (end, -views)):
            self.changes[cell] = self.changes.get(cell, 0) + change

    def at(self, cells: NDArray[np.int64]) -> Array:
        """Return the points (..., 2) [m] at places of the line through all that was seen."""
        mean, covariance = _mean_and_covariance(self.moments)
        (xx, xy), (_, yy) = covariance.tolist()
        angle = math.atan2(2 * xy, xx - yy) / 2
        direction = np.array([math.cos(angle), math.sin(angle)])
        along = (CELL * cells - mean @ self.axis) / (direction @ self.axis)
        points: Array = self.origin + mean + along[..., None] * direction
        return points

    def ends(self) -> Array:
        """Return the first and last point that was seen, shape (2, 2)."""
        return self.at(np.array([min(self.changes), max(self.changes)]))

    def stretches(self) -> tuple[NDArray[np.int64], list[int]]:
        """Return first cell and cell behind the last (n, 2), and views, of each part seen alike."""
        cells = sorted(self.changes)
        views = np.cumsum([self.changes[cell] for cell in cells])[:-1]
        ends = np.column_stack((cells[:-1], cells[1:]))
        return ends[views > 0], views[views > 0].tolist()

    def pieces(self, min_views: int) -> list[tuple[Array, Array, float]]:
        """Return start, end and mean views of what was seen often enough."""
        pieces: list[list[int]] = []
        for (begin, end), views in zip(*self.stretches(), strict=True):
            if views < min_views:
                continue
            if pieces and begin - pieces[-1][1] <= 1:  # rounding may leave a cell between views
                pieces[-1][1:] = [end, pieces[-1][2] + views * (end - begin)]
            else:
                pieces.append([begin, end, views * (end - begin)])
        return [
            (*self.at(np.array([begin, end])), seen / (end - begin)) for begin, end, seen in pieces
        ]


def _mean_and_covariance(moments: Array) -> tuple[Array, Array]:
    mean = moments[0, 1:] / moments[0, 0]
    return mean, moments[1:, 1:] / moments[0, 0] - mean[:, None] * mean


def offsets_between(lines: Array, walls: Array, angles: Array) -> Array:
    """Return how far each line (n, 2, 2) lies beside each wall (m, 2, 2) [m].

    That is the larger distance of the ends of the shorter from the line of the longer. It is
    infinite where their directions differ by more than the angle (n,) of the line [rad], or more
    than `GAP` lies between them.
    """
    offsets = np.full((len(lines), len(walls)), np.inf)
    if not offsets.size:
        return offsets
    # Most walls are far from all lines; NaN is.
    low, high = lines.min(axis=(0, 1)) - GAP, lines.max(axis=(0, 1)) + GAP
    is_near = (walls.max(axis=1) >= low) & (walls.min(axis=1) <= high)
    near = np.flatnonzero(is_near.all(axis=1))
    walls = walls[near]
    own, length = _directions(lines)
    others, other_length = _directions(walls)
    from_start = lines[:, None] - walls[None, :, None, 0]
    turn = np.arctan2(_cross(own[:, None], others[None]), own @ others.T)
    of_line = np.abs(_cross(others[None, :, None], from_start))
    of_wall = np.abs(_cross(own[:, None, None], walls[None] - lines[:, None, None, 0]))
    is_shorter = (length[:, None] <= other_length)[..., None]
    offset = np.where(is_shorter, of_line, of_wall).max(axis=-1)
    along = np.einsum("mk,nmek->nme", others, from_start)
    hole = np.maximum(along.min(axis=-1) - other_length, -along.max(axis=-1))
    offsets[:, near] = np.where((np.abs(turn) < angles[:, None]) & (hole < GAP), offset, np.inf)
    return offsets


def _directions(lines: Array) -> tuple[Array, Array]:
    along = lines[:, 1] - lines[:, 0]
    length = np.linalg.norm(along, axis=-1)
    return along / length[:, None], length


def _cross(a: Array, b: Array) -> Array:
    product: Array = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return product
