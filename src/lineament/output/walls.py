"""One wall of a floor plan: all that was seen of it, and how far lines lie beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

__all__ = ["Wall", "offsets_between"]

Array = NDArray[np.float64]

#: The most that may lie between two lines that touch [m].
GAP = 0.2
#: Length along which views are counted [m].
CELL = 0.05


@dataclass(slots=True)
class Wall:
    """One line in the plan.

    Places along it are measured on an axis, in cells, from the first start that was seen.

    Attributes
    ----------
    origin, axis : float64 array, shape (2,)
        Where places are counted from [m], and the direction in which they are.
    length, first, second
        Sums over the metres seen: of 1, of the points (2,) from the origin, of their products
        (2, 2).
    changes : dict of int to int
        By how much the number of views changes at each cell.
    """

    origin: Array
    axis: Array
    length: float = 0.0
    first: Array = field(default_factory=lambda: np.zeros(2))
    second: Array = field(default_factory=lambda: np.zeros((2, 2)))
    changes: dict[int, int] = field(default_factory=dict)

    def see(self, line: Array) -> None:
        """Add one view of a part of the wall, from start to end, shape (2, 2)."""
        start, end = line - self.origin
        length, middle, half = math.dist(start, end), (start + end) / 2, (end - start) / 2
        self.length += length
        self.first += length * middle
        self.second += length * (middle[:, None] * middle + half[:, None] * half / 3)
        self._count(self._cells(line), 1)

    def absorb(self, other: Wall) -> None:
        """Add all views of another wall."""
        self.length, self.first, self.second = self._joint(other)
        stretches, views = other.stretches()
        for ends, number in zip(self._cells(other.at(stretches)), views, strict=True):
            self._count(ends, number)

    def _joint(self, other: Wall) -> tuple[float, Array, Array]:
        """Give the sums over what was seen of both."""
        shift = other.origin - self.origin
        mixed = np.outer(shift, other.first)
        second = other.second + mixed + mixed.T + other.length * np.outer(shift, shift)
        return (
            self.length + other.length,
            self.first + other.first + other.length * shift,
            self.second + second,
        )

    def spread(self, other: Wall) -> float:
        """Root mean square distance [m] of what was seen of both from their common line."""
        length, first, second = self._joint(other)
        mean = first / length
        variances = np.linalg.eigvalsh(second / length - np.outer(mean, mean))
        return math.sqrt(max(float(variances[0]), 0.0))

    def shared(self, other: Wall) -> float:
        """Share of what was seen of another wall that lies beside what was seen of this one."""
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
        for cell, change in ((begin, views), (max(end, begin + 1), -views)):
            self.changes[cell] = self.changes.get(cell, 0) + change

    def at(self, cells: NDArray[np.int64]) -> Array:
        """Points (..., 2) [m] of the line through all that was seen, at places on the axis."""
        mean = self.first / self.length
        (xx, xy), (_, yy) = (self.second / self.length - mean[:, None] * mean).tolist()
        angle = math.atan2(2 * xy, xx - yy) / 2
        direction = np.array([math.cos(angle), math.sin(angle)])
        along = (CELL * cells - mean @ self.axis) / (direction @ self.axis)
        points: Array = self.origin + mean + along[..., None] * direction
        return points

    def ends(self) -> Array:
        """First and last point that was seen, shape (2, 2)."""
        return self.at(np.array([min(self.changes), max(self.changes)]))

    def stretches(self) -> tuple[NDArray[np.int64], list[int]]:
        """First cell and cell behind the last (n, 2), and views, of each stretch seen alike."""
        cells = sorted(self.changes)
        views = np.cumsum([self.changes[cell] for cell in cells])[:-1]
        ends = np.column_stack((cells[:-1], cells[1:]))
        return ends[views > 0], views[views > 0].tolist()

    def pieces(self, min_views: int) -> list[tuple[Array, Array, float]]:
        """Start, end and mean views of what was seen often enough."""
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


def offsets_between(lines: Array, walls: Array, angles: Array) -> Array:
    """How far each line (n, 2, 2) lies beside each wall (m, 2, 2); infinite where it does not.

    That is the larger distance of the ends of the shorter from the line of the longer.
    """
    offsets = np.full((len(lines), len(walls)), np.inf)
    if not len(lines) or not len(walls):
        return offsets
    low, high = lines.min(axis=(0, 1)) - GAP, lines.max(axis=(0, 1)) + GAP
    x, y = walls[..., 0].T, walls[..., 1].T
    near = np.flatnonzero(
        (np.maximum(*x) >= low[0])
        & (np.minimum(*x) <= high[0])
        & (np.maximum(*y) >= low[1])
        & (np.minimum(*y) <= high[1])
    )
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
