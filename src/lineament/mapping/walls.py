"""Walls and columns: their records, and which segments are one wall, by χ² of their common line."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..features import Features
from ..motion.association import chi_square
from ..scan import Array

#: A straight wall. Its covariance is that of (offset along the left normal at the centroid, angle)
#: [m², m·rad, rad²]. `side` is 1 where it was seen from its left alone, 0 where from either side.
WALL = np.dtype(
    [
        ("start", "f8", 2),
        ("end", "f8", 2),
        ("centroid", "f8", 2),
        ("angle", "f8"),
        ("covariance", "f8", (2, 2)),
        ("side", "i4"),
        ("views", "i4"),
    ],
    align=True,
)
#: A round column or a bend: its covariance is that of (x, y, radius) [m²].
COLUMN = np.dtype(
    [("center", "f8", 2), ("radius", "f8"), ("covariance", "f8", (3, 3)), ("views", "i4")],
    align=True,
)

#: Walls on one line are one wall if no more lies between them [m]: a door is wider.
GAP = 0.2
#: Segments that are shorter, or less sure of their direction, make no wall [m, rad].
SHORTEST, LEAST_SURE = 0.15, 0.2

#: Lines whose directions differ by more are never one [rad].
_TURN = 0.35
#: Share of the parts of a wall that the tests keep together.
_GATE = 0.99


class Merger:
    """Walls and columns that grow as features are added, all in the frame of the map."""

    def __init__(self) -> None:
        self._walls, self._n = np.zeros(64, WALL), 0
        self._misfit = np.zeros(64)
        self._columns: list[NDArray[np.void]] = []

    def add(self, features: Features) -> None:
        """Add the features of a scan."""
        segments = features.segments
        walls = np.zeros(len(segments), WALL)
        for name in ("start", "end", "centroid", "angle", "covariance"):
            walls[name] = segments[name]
        walls["side"] = walls["views"] = 1
        long = np.linalg.norm(walls["end"] - walls["start"], axis=1) >= SHORTEST
        with np.errstate(invalid="ignore"):
            long &= walls["covariance"][:, 1, 1] < LEAST_SURE**2
        for wall, misfit in zip(walls[long], segments["misfit"][long] ** 2, strict=True):
            self._join(wall, float(misfit))
        for arc in features.arcs:
            self._see(arc)

    def _join(self, wall: np.void, misfit: float) -> None:
        """Make a wall part of the one that it fits best, or a new one."""
        k = self._mate(self._walls[: self._n], self._misfit[: self._n], wall, misfit)
        if k >= 0:
            own, other = self._walls[k]["views"], wall["views"]
            self._misfit[k] += (misfit - self._misfit[k]) * other / (own + other)
            self._walls[k] = joined(self._walls[k], wall)
            return
        if self._n == len(self._walls):
            self._walls = np.concatenate((self._walls, np.zeros(self._n, WALL)))
            self._misfit = np.concatenate((self._misfit, np.zeros(self._n)))
        self._walls[self._n], self._misfit[self._n] = wall, misfit
        self._n += 1

    @staticmethod
    def _mate(walls: NDArray[np.void], misfits: Array, wall: np.void, misfit: float) -> int:
        """Return the wall whose common line with another has the least χ², -1 if none fits."""
        turn = np.remainder(wall["angle"] - walls["angle"] + math.pi, 2 * math.pi) - math.pi
        u = np.stack((np.cos(walls["angle"]), np.sin(walls["angle"])), axis=1)
        ends = np.stack([((wall[e] - walls["start"]) * u).sum(axis=1) for e in ("start", "end")])
        length = ((walls["end"] - walls["start"]) * u).sum(axis=1)
        near = (np.abs(turn) < _TURN) & (walls["side"] == wall["side"])
        near &= (ends.min(axis=0) < length + GAP) & (ends.max(axis=0) > -GAP)
        k = np.flatnonzero(near)
        if not len(k):
            return -1
        e, spread = _difference(walls[k], wall, u[k], turn[k])
        both = misfits[k] + misfit
        spread[:, 0, 0] += both
        shorter = np.minimum(length[k], np.linalg.norm(wall["end"] - wall["start"]))
        spread[:, 1, 1] += 4 * both / np.maximum(shorter, SHORTEST) ** 2
        d2 = np.einsum("ni,nij,nj->n", e, np.linalg.inv(spread), e)
        return int(k[d2.argmin()]) if d2.min() < chi_square(_GATE, 2) else -1

    def _see(self, arc: np.void) -> None:
        """Make an arc part of a column, or a new one."""
        new = np.zeros((), COLUMN)
        new["center"], new["radius"], new["covariance"] = arc["center"], arc["radius"], 0
        new["covariance"], new["views"] = arc["covariance"], 1
        state = np.append(new["center"], new["radius"])
        for column in self._columns:
            e = state - np.append(column["center"], column["radius"])
            if e @ np.linalg.solve(column["covariance"] + new["covariance"], e) < chi_square(
                _GATE, 3
            ):
                gain = column["covariance"] @ np.linalg.inv(
                    column["covariance"] + new["covariance"]
                )
                column["center"] += (gain @ e)[:2]
                column["radius"] += (gain @ e)[2]
                column["covariance"] -= gain @ column["covariance"]
                column["views"] += 1
                return
        self._columns.append(new)

    def result(self, min_views: int = 1) -> tuple[NDArray[np.void], NDArray[np.void]]:
        """Return walls and columns that were seen often enough; walls that became one are joined.

        The misfit of a wall is part of its covariance.
        """
        before = -1
        while before != self._n:
            before, old, misfits = self._n, self._walls[: self._n], self._misfit[: self._n]
            lengths = np.linalg.norm(old["end"] - old["start"], axis=1)
            self._walls, self._misfit, self._n = np.zeros(64, WALL), np.zeros(64), 0
            for k in np.argsort(-lengths, kind="stable"):
                self._join(old[k], float(misfits[k]))
        walls = self._walls[: self._n].copy()
        misfits = self._misfit[: self._n]
        lengths = np.linalg.norm(walls["end"] - walls["start"], axis=1)
        walls["covariance"][:, 0, 0] += misfits
        walls["covariance"][:, 1, 1] += 4 * misfits / lengths**2
        columns = np.array([c for c in self._columns if c["views"] >= min_views], COLUMN)
        return walls[walls["views"] >= min_views], columns


def walls_of(ends: Array, *, side: int = 0, covariance: ArrayLike = 0.0) -> NDArray[np.void]:
    """Make records of walls from both ends of each, shape (n, 2, 2)."""
    walls = np.zeros(len(ends), WALL)
    walls["start"], walls["end"], walls["centroid"] = ends[:, 0], ends[:, 1], ends.mean(axis=1)
    along = ends[:, 1] - ends[:, 0]
    walls["angle"] = np.arctan2(along[:, 1], along[:, 0])
    walls["covariance"], walls["side"], walls["views"] = covariance, side, 1
    return walls


def _difference(
    walls: NDArray[np.void], wall: np.void, u: Array, turn: Array
) -> tuple[Array, Array]:
    """Offset and angle (n, 2) of a wall from others at its centroid, and covariances (n, 2, 2)."""
    between = wall["centroid"] - walls["centroid"]
    along = (between * u).sum(axis=1)
    off = u[:, 0] * between[:, 1] - u[:, 1] * between[:, 0]
    lever = np.tile(np.eye(2), (len(walls), 1, 1))
    lever[:, 0, 1] = along
    spread = lever @ walls["covariance"] @ lever.transpose(0, 2, 1) + wall["covariance"]
    return np.stack((off, turn), axis=1), spread


def joined(wall: np.void, other: np.void) -> np.void:
    """Return the wall that two are parts of: the mean of their lines by their covariances."""
    result = wall.copy()
    angle = float(wall["angle"])
    u = np.array([math.cos(angle), math.sin(angle)])
    n = np.array([-u[1], u[0]])
    turn = math.remainder(float(other["angle"]) - angle, 2 * math.pi)
    between = other["centroid"] - wall["centroid"]
    along = float(between @ u)
    # The other line at the centroid of the first.
    lever = np.array([[1.0, -along], [0.0, 1.0]])
    seen = np.array([float(between @ n) - along * math.tan(turn), turn])
    spread = lever @ other["covariance"] @ lever.T
    gain = wall["covariance"] @ np.linalg.inv(wall["covariance"] + spread)
    shift, turned = gain @ seen
    covariance = (np.eye(2) - gain) @ wall["covariance"]
    result["covariance"] = (covariance + covariance.T) / 2
    result["angle"] = math.remainder(angle + turned, 2 * math.pi)
    result["centroid"] = wall["centroid"] + shift * n
    u = np.array([math.cos(result["angle"]), math.sin(result["angle"])])
    points = np.stack((wall["start"], wall["end"], other["start"], other["end"]))
    places = (points - result["centroid"]) @ u
    result["start"] = result["centroid"] + places.min() * u
    result["end"] = result["centroid"] + places.max() * u
    result["views"] = wall["views"] + other["views"]
    return result
