"""Where there is room: a floor on which a scanner and obstacles are put without touching."""

import math

import numpy as np
from numpy.typing import ArrayLike

from ..scan import Array, Pose
from .worlds import World, closed, rectangle

#: Least distance of the scanner from every surface [m].
_KEPT_CLEAR = 0.3
#: Least distance between an obstacle and every other surface [m].
_GAP = 0.2
#: Most circles that cover an elongated box.
_COVERING = 12


class Floor:
    """A closed outline (V, 2) [m], a scanner, and obstacles that are put where there is room.

    An obstacle is covered by circles; there is room if no surface lies within a gap of them.
    """

    def __init__(self, outline: ArrayLike, pose: Pose) -> None:
        self.pose = pose
        self.world = World.of_polygons([closed(outline)])

    def put_box(self, center: ArrayLike, width: float, depth: float, angle: float = 0.0) -> bool:
        """Put a box, its longer side `width` along `angle`; False if there is no room for it."""
        n = min(_COVERING, math.ceil(width / depth))
        along = width * ((np.arange(n) + 0.5) / n - 0.5)
        centers = np.asarray(center) + along[:, np.newaxis] * (math.cos(angle), math.sin(angle))
        if not self._has_room(centers, math.hypot(width / n, depth) / 2):
            return False
        walls = World.of_polygons([closed(rectangle(center, width, depth, angle))]).segments
        self.world = World(np.vstack((self.world.segments, walls)), self.world.circles)
        return True

    def put_column(self, center: ArrayLike, radius: float) -> bool:
        """Put a round column; False if there is no room for it."""
        at = np.asarray(center, dtype=np.float64)
        if not self._has_room(at[np.newaxis], radius):
            return False
        columns = np.vstack((self.world.circles, (*at, radius)))
        self.world = World(self.world.segments, columns)
        return True

    def _has_room(self, centers: Array, radius: float) -> bool:
        from_scanner = np.hypot(*(centers - self.pose[:2]).T)
        return bool(
            (clearance(self.world, centers) >= radius + _GAP).all()
            and is_free(self.world, centers).all()
            and (from_scanner >= radius + _KEPT_CLEAR).all()
        )


def clearance(world: World, points: ArrayLike) -> Array:
    """Distance of points (n, 2) from the nearest surface [m], shape (n,); inf in an empty world."""
    at = np.asarray(points, dtype=np.float64)[:, np.newaxis]
    start, along = world.segments[:, :2], world.segments[:, 2:] - world.segments[:, :2]
    share = ((at - start) * along).sum(axis=2) / (along**2).sum(axis=1)
    feet = start + np.clip(share, 0, 1)[:, :, np.newaxis] * along
    to_walls = np.linalg.norm(at - feet, axis=2)
    to_centers = np.linalg.norm(at - world.circles[:, :2], axis=2)
    distances = np.hstack((to_walls, np.abs(to_centers - world.circles[:, 2])))
    return np.asarray(distances.min(axis=1, initial=math.inf))


def is_free(world: World, points: ArrayLike) -> Array:
    """Whether points lie inside the outline of a world and outside its obstacles.

    They do if a ray meets an odd number of walls, all of which belong to closed outlines.
    """
    at = np.asarray(points, dtype=np.float64)
    x, y = at[:, 0, np.newaxis], at[:, 1, np.newaxis]
    px, py, qx, qy = world.segments.T
    crosses = (py > y) != (qy > y)
    # Where a wall is level it is not crossed, and its slope not asked for.
    rise = np.where(py == qy, 1.0, qy - py)
    met = crosses & (x < px + (y - py) / rise * (qx - px))
    in_column = np.hypot(x - world.circles[:, 0], y - world.circles[:, 1]) < world.circles[:, 2]
    return np.asarray((met.sum(axis=1) % 2 == 1) & ~in_column.any(axis=1))
