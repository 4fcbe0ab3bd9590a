"""Worlds to scan: straight walls and round columns, and floor plans made of them."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ..scan import Array

Points = Sequence[tuple[float, float]]


@dataclass(frozen=True, eq=False, slots=True)
class World:
    """Surfaces that reflect a beam, in the world frame.

    Surfaces are numbered: walls 0 … S-1 in the order of `segments`, then circles S … S+C-1.
    Arrays are float64 copies and read-only.

    Parameters
    ----------
    segments : array_like, shape (S, 4)
        Straight walls ``x1 y1 x2 y2`` [m], opaque from both sides.
    circles : array_like, shape (C, 3), optional
        Round columns ``x y r`` [m].

    Raises
    ------
    ValueError
        If a shape is wrong, a value is not finite, a wall has no length or a circle no radius.

    Examples
    --------
    >>> world = World([[2, -1, 2, 1]], circles=[[0, 3, 0.5]])
    >>> world
    World(1 segments, 1 circles)
    >>> world.n_surfaces
    2
    """

    segments: Array
    circles: Array = field(default_factory=lambda: np.empty((0, 3)))

    def __init__(self, segments: ArrayLike, circles: ArrayLike = ()) -> None:
        walls, columns = _table("segments", segments, 4), _table("circles", circles, 3)
        bad = np.flatnonzero((walls[:, :2] == walls[:, 2:]).all(axis=1))
        if len(bad):
            raise ValueError(f"segments[{bad[0]}] is {walls[bad[0]].tolist()}: it has no length")
        bad = np.flatnonzero(columns[:, 2] <= 0)
        if len(bad):
            raise ValueError(f"circles[{bad[0]}] has radius {columns[bad[0], 2]}, expected > 0")
        object.__setattr__(self, "segments", walls)
        object.__setattr__(self, "circles", columns)

    def __repr__(self) -> str:
        return f"World({len(self.segments)} segments, {len(self.circles)} circles)"

    @property
    def n_surfaces(self) -> int:
        """Number of surfaces, S + C."""
        return len(self.segments) + len(self.circles)

    @classmethod
    def of_polygons(cls, polygons: Iterable[ArrayLike], circles: ArrayLike = ()) -> Self:
        """Make a world of polylines (V, 2) [m], with a wall between every two successive vertices.

        A polyline is closed if its last vertex repeats its first. Raises ValueError if one has
        fewer than two vertices, or repeats one in succession.

        Examples
        --------
        >>> corner = [(0, 2), (2, 2), (2, 0)]
        >>> World.of_polygons([corner]).segments.tolist()
        [[0.0, 2.0, 2.0, 2.0], [2.0, 2.0, 2.0, 0.0]]
        """
        walls = [np.empty((0, 4))]
        for i, polygon in enumerate(polygons):
            vertices = _table(f"polygons[{i}]", polygon, 2)
            if len(vertices) < 2:
                raise ValueError(f"polygons[{i}] has {len(vertices)} vertices, expected 2 or more")
            walls.append(np.hstack((vertices[:-1], vertices[1:])))
        return cls(np.concatenate(walls), circles)


def room() -> World:
    """Return a rectangular room of 6 m x 4 m around the origin, with one box in it.

    The room spans -3 … 3 m in x and -2 … 2 m in y (surfaces 0-3), the box 1.4 … 2.2 m in x
    and -1.1 … -0.5 m in y (surfaces 4-7).

    Examples
    --------
    >>> room()
    World(8 segments, 0 circles)
    """
    return World.of_polygons([_box(0, 0, 6, 4), _box(1.8, -0.8, 0.8, 0.6)])


def building() -> tuple[World, Array]:
    """Return a storey of 15 m x 10 m [m], x along the corridor, and a way (17, 2) through it [m].

    Five rooms open on a corridor with recessed doors; one room has an alcove, two have a wall
    that is not at right angles, one has two doorways. Desks, cupboards and round columns stand
    in them. Walls meet only at their ends: every corner is an end of exactly two walls. The way
    keeps clear of every surface: down the corridor, into four rooms and out again, and into the
    fifth.

    Examples
    --------
    >>> world, waypoints = building()
    >>> world
    World(116 segments, 8 circles)
    """
    world = World.of_polygons([closed(_OUTLINE), closed(_PIER), *_FURNITURE], _COLUMNS)
    waypoints = np.array(_WAY)
    waypoints.flags.writeable = False
    return world, waypoints


def rectangle(center: ArrayLike, width: float, depth: float, angle: float = 0.0) -> Array:
    """Vertices (4, 2) of a rectangle, counter-clockwise, its width along `angle` [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    halves = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (width / 2, depth / 2)
    return np.asarray(np.asarray(center) + halves @ np.array([[c, s], [-s, c]]))


def closed(vertices: ArrayLike) -> Array:
    """Repeat the first of the vertices at the end."""
    points = np.asarray(vertices, dtype=np.float64)
    return np.vstack((points, points[:1]))


def _box(x: float, y: float, width: float, depth: float, degrees: float = 0.0) -> Array:
    """Return the closed outline of a box around (x, y), turned counter-clockwise."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    corners = rectangle((0, 0), width, depth).tolist()
    # Not by `rectangle`, whose rounding is another: recorded drives stay what they are.
    return closed([(x + c * u - s * v, y + s * u + c * v) for u, v in corners])


# The free space of the storey, counter-clockwise: along the south side of the corridor from west
# to east, and back along its north side, turning into every room on the way. The corridor's sides
# are y = 4.1 and 5.9, walls are 0.15 m thick, closed doors stand back by 0.1 m.
_SOUTH_SIDE: Points = [
    (0.0, 4.1),
    # A room with an alcove to the west and a cupboard built into its corner.
    (1.2, 4.1), (1.2, 3.95), (0.5, 3.95), (0.5, 3.0), (0.0, 3.0), (0.0, 1.4), (0.5, 1.4),
    (0.5, 0.0), (3.4, 0.0), (3.4, 0.6), (4.6, 0.6), (4.6, 3.95), (2.1, 3.95), (2.1, 4.1),
    # Two closed doors.
    (3.3, 4.1), (3.3, 4.0), (4.2, 4.0), (4.2, 4.1),
    (5.2, 4.1), (5.2, 4.0), (6.1, 4.0), (6.1, 4.1),
    # A room with a chimney.
    (7.6, 4.1), (7.6, 3.95), (4.75, 3.95), (4.75, 0.0), (6.2, 0.0), (6.2, 0.4), (7.2, 0.4),
    (7.2, 0.0), (9.3, 0.0), (9.3, 3.95), (8.5, 3.95), (8.5, 4.1),
    # A room with an oblique wall.
    (12.0, 4.1), (12.0, 3.95), (9.45, 3.95), (9.45, 0.0), (13.4, 0.0), (15.0, 1.8),
    (15.0, 3.95), (12.9, 3.95), (12.9, 4.1),
    (15.0, 4.1),
]  # fmt: skip
_NORTH_SIDE: Points = [
    (15.0, 5.9),
    # A large room with a pilaster and two doorways; _PIER is the wall between them.
    (14.1, 5.9), (14.1, 6.05), (15.0, 6.05), (15.0, 10.0), (12.5, 10.0), (12.5, 9.7),
    (12.1, 9.7), (12.1, 10.0), (9.15, 10.0), (9.15, 6.05), (9.9, 6.05), (9.9, 5.9),
    # Two closed doors.
    (8.6, 5.9), (8.6, 6.0), (7.7, 6.0), (7.7, 5.9),
    (6.7, 5.9), (6.7, 6.0), (5.8, 6.0), (5.8, 5.9),
    # A room with an oblique wall.
    (4.3, 5.9), (4.3, 6.05), (5.2, 6.05), (5.2, 10.0), (1.3, 10.0), (0.0, 7.7),
    (0.0, 6.05), (3.4, 6.05), (3.4, 5.9),
    (0.0, 5.9),
    # The way out, closed.
    (0.0, 5.45), (-0.1, 5.45), (-0.1, 4.55), (0.0, 4.55),
]  # fmt: skip
_OUTLINE: Points = [*_SOUTH_SIDE, *_NORTH_SIDE]
_PIER: Points = [(10.8, 5.9), (13.2, 5.9), (13.2, 6.05), (10.8, 6.05)]
_FURNITURE = (
    _box(3.3, 2.4, 0.8, 1.6), _box(5.9, 1.5, 1.4, 0.7), _box(9.0, 2.2, 0.4, 1.2),
    _box(10.6, 2.9, 0.9, 0.6, degrees=25), _box(14.4, 3.2, 0.5, 0.8), _box(12.2, 8.3, 2.0, 0.9),
    _box(2.1, 7.9, 1.4, 0.7, degrees=-30), _box(4.9, 9.2, 0.4, 1.0),
)  # fmt: skip
_COLUMNS = (
    (0.85, 0.4, 0.15), (5.7, 2.9, 0.2), (10.6, 1.3, 0.25), (13.3, 1.3, 0.25),
    (9.9, 8.9, 0.2), (14.2, 8.9, 0.2), (4.85, 6.5, 0.15), (0.6, 6.6, 0.2),
)  # fmt: skip
_WAY: Points = [
    (0.7, 5.0),
    (1.65, 5.0), (1.65, 2.0), (1.65, 5.0),
    (3.85, 5.0), (3.85, 7.8), (3.85, 5.0),
    (8.05, 5.0), (8.05, 2.6), (8.05, 5.0),
    (10.35, 5.0), (10.35, 7.2), (13.65, 7.2), (13.65, 5.0),
    (12.45, 5.0), (12.45, 3.5), (12.2, 2.4),
]  # fmt: skip


def _table(name: str, values: ArrayLike, columns: int) -> Array:
    """Copy `values` into a read-only float64 table."""
    try:
        table = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name} is no table of numbers with {columns} columns") from None
    if table.size == 0:
        table = table.reshape(0, columns)
    if table.ndim != 2 or table.shape[1] != columns:
        raise ValueError(f"{name} has shape {table.shape}, expected (…, {columns})")
    if not np.isfinite(table).all():
        raise ValueError(f"{name} holds a value that is not finite")
    table.flags.writeable = False
    return table
