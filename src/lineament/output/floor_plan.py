"""Floor plan of a log: the walls, corners and columns that its scans have in common.

Segments are one wall by the rule of maps (`lineament.walls.sights`): where their lines agree as
well as their covariances, and poses that are off by centimetres, allow. A wall is drawn where it
was seen often enough, so a door that was shut once does not close its doorway.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ..features import SEGMENT, Features
from ..scan import Array
from ..walls import WALL, Records, lengths_of
from ..walls.sights import GAP, SIGHT, joined, sights_of, walls_along
from .markers import Markers, is_drawn

#: Shorter segments say too little about where their wall runs; longer ones no scanner sees: no log
#: shall make a wall without end. Ends must be as sure as this [m].
SHORTEST, LONGEST, SURE = 0.2, 1000.0, 0.05
#: What poses make of a wall that is straight: each segment is off by so much, and walls are one
#: that are so much apart [m].
ROUGH, APART = 0.005, 0.03
#: Segments that are joined at a time, at least, and kept: of more, every second scan is left out.
TOGETHER, MOST_SEGMENTS = 2000, 100_000
#: So many walls, and so many corners, are kept; the least seen are forgotten first.
MOST = 20_000
#: How far the corners, and the centre and radius of the arcs, of one thing may differ [m].
CORNER_RADIUS, ARC_RADIUS = 0.15, 0.1

_HERE = np.zeros((1, 3))


class FloorPlan:
    """Walls, corners and arcs that the scans of a log have in common, in bounded memory.

    Attributes
    ----------
    every : int
        Walls are those of one scan in so many: of all, but for logs of more than `MOST_SEGMENTS`.
    """

    def __init__(self) -> None:
        self.every, self._scans = 1, 0
        self._new: list[Records] = []
        self._sights, self._lines = np.zeros(0, SIGHT), np.zeros(0, WALL)
        self._corners, self._edges = Averages(2, CORNER_RADIUS), Averages(2, CORNER_RADIUS)
        self._arcs = Averages(3, ARC_RADIUS)

    def add(self, features: Features) -> None:
        """Add the features of a scan, moved into the frame of the plan."""
        if self._scans % self.every == 0:
            self._new.append(_sure(features.segments))
        self._scans += 1
        self._corners.add(features.corners["position"])
        self._edges.add(features.edges["position"])
        self._arcs.add(np.column_stack((features.arcs["center"], features.arcs["radius"])))
        # Where there are many walls, more is joined at a time, as each of them is looked at.
        if sum(map(len, self._new)) >= max(TOGETHER, len(self._lines) // 4):
            self._join()

    def _join(self) -> None:
        """Join what is new to the walls."""
        segments = np.concatenate([np.zeros(0, SEGMENT), *self._new])
        self._new = []
        if not len(segments):
            return
        own = int(self._sights["wall"].max(initial=-1)) + 1 + np.arange(len(segments))
        sights = np.concatenate((self._sights, sights_of([(segments, own)], ROUGH)))
        if len(sights) > MOST_SEGMENTS:
            sights, self.every = sights[::2], 2 * self.every
            sights["wall"] = np.unique(sights["wall"], return_inverse=True)[1]
        self._sights, self._lines = joined(sights, APART)
        if len(self._lines) > MOST:
            kept = most_seen(np.bincount(self._sights["wall"]))
            self._sights = self._sights[np.isin(self._sights["wall"], kept)]
            self._sights["wall"] = np.searchsorted(kept, self._sights["wall"])
            self._lines = self._lines[kept]

    def walls(self, min_views: int = 1) -> Records:
        """Return the parts of the walls that were seen in at least so many views, as `WALL`.

        The longest comes first; those shorter than 20 cm are left out. The views of a part are of
        any place of it.
        """
        self._join()
        if not len(self._sights):
            return self._lines
        walls = walls_along(
            self._sights, _HERE, self._lines, GAP, views=min_views, everywhere=min_views
        )
        lengths = lengths_of(walls)
        order = np.argsort(-lengths, kind="stable")
        return walls[order[lengths[order] >= SHORTEST]]

    def markers(self, min_views: int = 1) -> tuple[Markers, NDArray[np.int64]]:
        """Return what is drawn: walls, corners, edges, and arcs as whole circles, seen so often.

        The second array (n,) has the views of each wall.
        """
        walls, arcs = self.walls(min_views), self._arcs.seen(min_views)
        markers = Markers(
            segments=np.stack((walls["start"], walls["end"]), axis=1),
            corners=self._corners.seen(min_views),
            edges=self._edges.seen(min_views),
            arcs=np.hstack((arcs, np.tile([0.0, 2 * math.pi], (len(arcs), 1)))),
            ellipses=np.zeros((0, 5)),
        )
        return markers, walls["views"].astype(np.int64)


def _sure(segments: Records) -> Records:
    """Return segments that are possible, of a length to believe, and sure of their ends."""
    ends = np.stack((segments["start"], segments["end"], segments["centroid"]), axis=1)
    others = np.stack([segments[name] for name in ("angle", "misfit", "rms")], axis=1)
    segments = segments[is_drawn(ends) & is_drawn(others)]
    length: Array = segments["length"]
    spread: Array = segments["covariance"]
    of_offset, both, of_angle = spread[:, 0, 0], spread[:, 0, 1], spread[:, 1, 1]
    sure = (length >= SHORTEST) & (length <= LONGEST)  # NaN is neither
    sure &= (of_offset >= 0) & (of_angle >= 0) & (both**2 <= of_offset * of_angle)
    return segments[sure & (of_offset + (length / 2) ** 2 * of_angle <= SURE**2)]


def most_seen(views: NDArray[np.int64]) -> NDArray[np.intp]:
    """Return which half of `MOST` has the most views, in order."""
    return np.sort(np.argsort(-views, kind="stable")[: MOST // 2])


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
            kept = most_seen(self._views)
            self._means, self._views = self._means[kept], self._views[kept]

    def seen(self, min_views: int) -> Array:
        """Return the means of at least so many points, shape (m, dimensions)."""
        return self._means[self._views >= min_views]
