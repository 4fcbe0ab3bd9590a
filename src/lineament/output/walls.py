"""One wall of a floor plan: all that was seen of it, and how far lines lie beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..scan import Array

#: The most that may lie between two lines that touch [m].
GAP = 0.2
#: Length along which views are counted [m].
CELL = 0.05


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
