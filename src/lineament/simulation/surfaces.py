"""What is one surface in a world of walls, and what the beams of a scanner meet of it."""

import math
from collections import defaultdict
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..scan import Array, Pose
from .sensor import Sensor
from .worlds import World

#: Ends of walls nearer to each other than this [m] are one vertex.
_SAME_VERTEX = 1e-3
#: Walls that turn by less than this [rad] where they meet are one straight surface.
_STRAIGHT = 1e-3
#: A beam that meets a wall this near to its end [m] goes through the vertex.
_THROUGH_VERTEX = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Surfaces:
    """Straight surfaces, each of one wall or of several end to end, numbered from 0; then circles.

    In the world frame [m].
    """

    #: Surface to which each wall and circle of the world belongs, shape (S + C,).
    of_world: NDArray[np.int64]
    #: Both ends of each straight surface, shape (W, 2, 2).
    walls: Array
    #: ``x y r``, shape (C, 3).
    circles: Array
    #: Vertices (k, 2) at which two straight surfaces meet, end to end, crossing, or one on the
    #: other.
    joints: dict[tuple[int, int], Array]


@lru_cache(maxsize=16)
def surfaces_of(world: World) -> Surfaces:
    """Find the surfaces of a world."""
    ends = world.segments.reshape(-1, 2, 2)
    meetings = _meetings(ends)
    label = np.arange(len(ends))
    for i, a, j, b in meetings:
        if _goes_on(ends[i], a, ends[j], b):
            label[label == label[j]] = label[i]
    numbers, label = np.unique(label, return_inverse=True)
    joints = defaultdict(list)
    for i, j, vertex in [*((i, j, ends[i, a]) for i, a, j, _ in meetings), *_crossings(ends)]:
        if label[i] != label[j]:
            joints[int(label[i]), int(label[j])].append(vertex)
    return Surfaces(
        np.concatenate((label, len(numbers) + np.arange(len(world.circles)))),
        np.array([_extent(ends[label == k]) for k in range(len(numbers))]).reshape(-1, 2, 2),
        world.circles,
        {pair: np.array(vertices) for pair, vertices in joints.items()},
    )


def _meetings(ends: Array) -> list[tuple[int, int, int, int]]:
    """List (i, a, j, b) where end a of wall i is end b of another wall j; each both ways."""
    points = ends.reshape(-1, 2)
    apart = np.abs(points[:, np.newaxis] - points).max(axis=2)
    first, second = np.nonzero(apart <= _SAME_VERTEX)
    other = first // 2 != second // 2
    pairs = zip(first[other].tolist(), second[other].tolist(), strict=True)
    return [(m // 2, m % 2, n // 2, n % 2) for m, n in pairs]


def _crossings(ends: Array) -> list[tuple[int, int, Array]]:
    """List (i, j, vertex) where wall i crosses another wall j, or one ends on it; each both ways.

    Walls that meet end to end are left to `_meetings`.
    """
    start, arm = ends[:, 0], ends[:, 1] - ends[:, 0]
    length = np.hypot(*arm.T)
    between = start - start[:, np.newaxis]
    determinant = _cross(arm[:, np.newaxis], arm)
    parallel = abs(determinant) < _STRAIGHT * length[:, np.newaxis] * length
    scale = np.where(parallel, 1.0, determinant)
    # Wall i is met at this share of its length, and wall j at that.
    share, other_share = _cross(between, arm) / scale, _cross(between, arm[:, np.newaxis]) / scale
    slack = _SAME_VERTEX / length
    inside = abs(share - 0.5) <= 0.5 + slack[:, np.newaxis]
    inside &= (abs(other_share - 0.5) <= 0.5 + slack) & ~parallel
    at_end = abs(share - 0.5) >= 0.5 - slack[:, np.newaxis]
    at_end &= abs(other_share - 0.5) >= 0.5 - slack
    return [
        (i, j, start[i] + share[i, j] * arm[i])
        for i, j in zip(*(k.tolist() for k in np.nonzero(inside & ~at_end)), strict=True)
    ]


def _cross(u: Array, v: Array) -> Array:
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def _goes_on(wall: Array, a: int, other: Array, b: int) -> bool:
    """Whether `other`, from its end b, goes straight on where `wall` ends at its end a."""
    into, onwards = wall[a] - wall[1 - a], other[1 - b] - other[b]
    return bool(abs(math.atan2(_cross(into, onwards), into @ onwards)) < _STRAIGHT)


def _extent(ends: Array) -> Array:
    """Farthest two ends of walls on one line, shape (2, 2)."""
    points = ends.reshape(-1, 2)
    along = points @ (ends[0, 1] - ends[0, 0])
    return points[[along.argmin(), along.argmax()]]


class View:
    """What the beams of a scanner at rest meet, without noise, in its own frame."""

    def __init__(self, world: World, pose: Pose, sensor: Sensor) -> None:
        surfaces = surfaces_of(world)
        self.bearings = sensor.angles
        #: Ranges beyond the limits too.
        self.ranges, met = sensor.ideal(world, pose)
        valid = (self.ranges >= sensor.range_min) & (self.ranges < sensor.range_max)
        #: The surface that each beam meets within the limits, -1 for none.
        self.surface = np.full(len(met), -1)
        self.surface[valid] = surfaces.of_world[met[valid]]
        c, s = math.cos(pose[2]), math.sin(pose[2])
        self._rotation, self._origin = np.array([[c, -s], [s, c]]), np.array(pose[:2])
        walls = self._to_sensor(surfaces.walls)
        backwards = _cross(walls[:, 0], walls[:, 1]) < 0
        #: Ends of the straight surfaces, that of the lesser bearing first.
        self.walls = np.where(backwards[:, np.newaxis, np.newaxis], walls[:, ::-1], walls)
        self.circles = surfaces.circles.copy()
        self.circles[:, :2] = self._to_sensor(surfaces.circles[:, :2])
        rest = 2 * math.pi - (sensor.n_beams - 1) * sensor.angle_increment
        self.is_full_circle = sensor.n_beams >= 3 and rest <= 2.5 * sensor.angle_increment
        #: From each beam to the next: after the last of a full turn the first, else 0.
        self.steps = np.full(len(met), sensor.angle_increment)
        self.steps[-1] = rest if self.is_full_circle else 0.0
        self._joints_of = {pair: self._to_sensor(at) for pair, at in surfaces.joints.items()}
        self._settle_vertices()
        self._look_between()

    def point_on_wall(self, bearing: float, surface: int) -> Array:
        """Return where a beam meets the line of a straight surface, shape (2,)."""
        (px, py), (qx, qy) = self.walls[surface]
        ux, uy = math.cos(bearing), math.sin(bearing)
        # As in `cast_rays`, with the sensor at the origin.
        distance = (px * qy - py * qx) / (ux * (qy - py) - uy * (qx - px))
        return np.array([distance * ux, distance * uy])

    def bearing_from(self, beam: int, point: Array) -> float:
        """Bearing of a point as seen from the axis of a beam, in (-π, π] [rad]."""
        turn = math.atan2(point[1], point[0]) - self.bearings[beam]
        return math.remainder(turn, 2 * math.pi)

    def _to_sensor(self, points: Array) -> Array:
        return np.asarray((points - self._origin) @ self._rotation)

    def _settle_vertices(self) -> None:
        """Give a beam through the end of a wall to the wall that its neighbours meet.

        Such a beam meets two walls at the same range, of which one may be hidden but for its end.
        """
        before, after = np.roll(self.surface, 1), np.roll(self.surface, -1)
        alone = (self.surface != before) & (self.surface != after) & (self.surface >= 0)
        for i in np.flatnonzero(alone).tolist():
            bearing = self.bearings[i]
            hit = self.ranges[i] * np.array([math.cos(bearing), math.sin(bearing)])
            for neighbour in (before[i], after[i]):
                vertices = self._joints_of.get((int(self.surface[i]), int(neighbour)), ())
                if any(math.dist(vertex, hit) < _THROUGH_VERTEX for vertex in vertices):
                    self.surface[i] = neighbour
                    break

    def _look_between(self) -> None:
        """Find what lies between each beam and the next."""
        after = np.roll(self.surface, -1)
        linked = (self.surface >= 0) & (after >= 0) & (self.steps > 0)
        #: Whether each beam and the next meet the same surface.
        self.goes_on = linked & (self.surface == after)
        #: Vertex between each beam and the next at which the surfaces of both meet; NaN for none.
        self.joints = np.full((len(after), 2), np.nan)
        for i in np.flatnonzero(linked & (self.surface != after)).tolist():
            pair = int(self.surface[i]), int(after[i])
            for vertex in self._joints_of.get(pair, ()):
                turn = self.bearing_from(i, vertex)
                slack = _SAME_VERTEX / math.hypot(*vertex)
                if -slack <= turn <= self.steps[i] + slack:
                    self.joints[i] = vertex
