"""Where beams meet a world, exactly."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..scan import Array, Pose
from .worlds import World

#: A surface nearer than this [m] touches the sensor and is not met, whatever rounding does.
_TOUCHING = 1e-9
#: Pairs of a beam and a surface that are worked on at a time: their arrays stay in the cache and
#: in memory that the process already has, whatever the size of the world.
_BLOCK = 12_000
#: Bearings of surfaces are widened by this on both sides [rad].
_SLACK = 1e-9


def cast_rays(
    world: World, pose: Pose | Array, angles: ArrayLike
) -> tuple[Array, NDArray[np.int32]]:
    """Distance along each beam to the nearest surface, and which surface that is.

    A beam leaves the sensor o in the direction u = (cos(θ + φ), sin(θ + φ)). With
    a × b = a_x b_y - a_y b_x, it meets the wall from p to q if o + ρ u lies between them:

        ρ = (p - o) × (q - p) / (u × (q - p)),   u × (p - o) and u × (q - o) of opposite signs

    and the circle of centre c and radius r, with b = u · (c - o) and h = u × (c - o), at

        ρ = b ∓ sqrt(r² - h²),   |h| ≤ r

    A ray through the common end of two walls meets one of them: both compare it with that end
    by the same number. A wall seen exactly edge-on or touched by the sensor is not met.

    Parameters
    ----------
    world : World
    pose : (x, y, theta) or ndarray, shape (n, 3)
        Pose of the sensor in the world frame [m, m, rad], or its pose at each beam.
    angles : array_like, shape (n,)
        Bearings φ of the beams in the sensor frame [rad].

    Returns
    -------
    ranges : ndarray, shape (n,)
        Distance to the nearest surface ahead [m]; inf if there is none.
    surface : ndarray of int32, shape (n,)
        Number of that surface in `world` (the lowest of several at the same distance), or -1.

    Raises
    ------
    ValueError
        If the poses are not 1 or n times three finite numbers, or the bearings no finite vector.

    Examples
    --------
    >>> ranges, surface = cast_rays(World([[2, -1, 2, 1]]), (0.5, 0, 0), [0.0, 3.14])
    >>> ranges.tolist(), surface.tolist()
    ([1.5, inf], [0, -1])
    """
    bearings = np.asarray(angles, dtype=np.float64)
    if bearings.ndim != 1 or not np.isfinite(bearings).all():
        raise ValueError(f"angles have shape {bearings.shape}, expected a finite vector")
    n = len(bearings)
    poses = np.array(pose, dtype=np.float64, ndmin=2)
    if poses.shape not in ((1, 3), (n, 3)) or not np.isfinite(poses).all():
        raise ValueError(f"pose is {pose!r:.60}, expected three finite numbers, or {n} times three")
    heading = poses[:, 2] + bearings
    direction = np.array((np.cos(heading), np.sin(heading)))
    ranges, surface = np.full(n, np.inf), np.full(n, -1, dtype=np.int32)
    if world.n_surfaces == 0:
        return ranges, surface
    if len(poses) == 1 and n * world.n_surfaces > _BLOCK:
        return _cast_where_they_may_meet(world, poses[:, :2], direction)
    at_a_time = max(16, _BLOCK // world.n_surfaces)
    for first in range(0, n, at_a_time):
        block = slice(first, first + at_a_time)
        origin = poses[block, :2] if len(poses) > 1 else poses[:, :2]
        towards = _to_walls(world, origin, direction[:, block])
        towards = np.hstack((towards, _to_circles(world, origin, direction[:, block])))
        nearest = towards.argmin(axis=1)
        ranges[block] = np.take_along_axis(towards, nearest[:, np.newaxis], axis=1)[:, 0]
        surface[block] = nearest
    surface[np.isinf(ranges)] = -1
    return ranges, surface


def _cast_where_they_may_meet(
    world: World, origin: Array, direction: Array
) -> tuple[Array, NDArray[np.int32]]:
    """As `cast_rays` from one pose, each beam with the surfaces alone that lie at its bearing."""
    n = direction.shape[1]
    first, width = _bearings(world, origin[0])
    headings = np.mod(np.arctan2(direction[1], direction[0]), 2 * math.pi)
    order = np.argsort(headings, kind="stable")
    twice = np.concatenate((headings[order], headings[order] + 2 * math.pi))
    low, high = np.searchsorted(twice, first), np.searchsorted(twice, first + width, "right")
    counts = np.minimum(high - low, n)
    surface = np.repeat(np.arange(world.n_surfaces), counts)
    places = np.arange(len(surface)) + np.repeat(low - (np.cumsum(counts) - counts), counts)
    beam = np.concatenate((order, order))[places]
    is_wall = surface < len(world.segments)
    distance = np.concatenate(
        [
            of_kind(table[surface[which] - skipped], origin, direction[:, beam[which]])
            for of_kind, table, which, skipped in (
                (_along_walls, world.segments, is_wall, 0),
                (_along_circles, world.circles, ~is_wall, len(world.segments)),
            )
        ]
    )
    beam = np.concatenate((beam[is_wall], beam[~is_wall]))
    surface = np.concatenate((surface[is_wall], surface[~is_wall]))
    ranges, nearest = np.full(n, np.inf), np.full(n, world.n_surfaces, dtype=np.int32)
    np.minimum.at(ranges, beam, distance)
    met = np.isfinite(distance) & (distance == ranges[beam])
    np.minimum.at(nearest, beam[met], surface[met].astype(np.int32))
    nearest[np.isinf(ranges)] = -1
    return ranges, nearest


def _bearings(world: World, origin: Array) -> tuple[Array, Array]:
    """First bearing at which each surface may be met, in [0, 2π), and how wide it is [rad]."""
    ends = world.segments.reshape(-1, 2, 2) - origin
    angles = np.arctan2(ends[:, :, 1], ends[:, :, 0])
    turn = np.mod(angles[:, 1] - angles[:, 0] + math.pi, 2 * math.pi) - math.pi
    arms = world.circles[:, :2] - origin
    away = np.hypot(*arms.T)
    half = np.arcsin(np.minimum(world.circles[:, 2] / np.maximum(away, 1e-12), 1.0))
    half[away <= world.circles[:, 2]] = math.pi
    first = np.concatenate(
        (np.where(turn < 0, angles[:, 1], angles[:, 0]), np.arctan2(arms[:, 1], arms[:, 0]) - half)
    )
    # Rounding may not lose a beam, nor a wall that the sensor stands at: its ends are opposite.
    width = np.concatenate((abs(turn), 2 * half)) + 2 * _SLACK
    beside = np.concatenate((abs(turn) > math.pi - 1e-6, np.zeros(len(half), dtype=bool)))
    return np.mod(first - _SLACK, 2 * math.pi), np.where(beside, 2 * math.pi, width)


def _to_walls(world: World, origin: Array, direction: Array) -> Array:
    """Distance along every ray to every wall, shape (n, S); inf where they do not meet.

    There is one origin, shape (1, 2), or one for each ray, (n, 2).
    """
    return _along_walls(world.segments, origin[:, np.newaxis], direction[:, :, np.newaxis])


def _to_circles(world: World, origin: Array, direction: Array) -> Array:
    """Distance along every ray to every circle, shape (n, C); inf where they do not meet."""
    return _along_circles(world.circles, origin[:, np.newaxis], direction[:, :, np.newaxis])


def _along_walls(walls: Array, origin: Array, direction: Array) -> Array:
    """Distance of walls (…, 4) along rays, of any shapes that go together; inf if not met."""
    (ux, uy), (ox, oy) = direction, np.moveaxis(origin, -1, 0)
    px, py, qx, qy = walls.T
    px, py, qx, qy = px - ox, py - oy, qx - ox, qy - oy
    side_p = ux * py - uy * px
    side_q = ux * qy - uy * qx
    # The sides differ unless both are 0, where the wall is seen edge-on.
    crosses = (np.minimum(side_p, side_q) <= 0) & (np.maximum(side_p, side_q) >= 0)
    crosses &= side_p != side_q
    # (p - o) × (q - p) = (p - o) × (q - o), and u × (q - p) = side_q - side_p.
    distance = np.full(crosses.shape, np.inf)
    cross = np.broadcast_to(px * (qy - py) - py * (qx - px), crosses.shape)
    np.divide(cross, side_q - side_p, out=distance, where=crosses)
    distance[distance <= _TOUCHING] = np.inf
    return distance


def _along_circles(circles: Array, origin: Array, direction: Array) -> Array:
    """Distance of circles (…, 3) along rays; inf if not met."""
    (ux, uy), (ox, oy) = direction, np.moveaxis(origin, -1, 0)
    cx, cy = circles[:, 0] - ox, circles[:, 1] - oy
    along, across = ux * cx + uy * cy, ux * cy - uy * cx
    square = circles[:, 2] ** 2 - across**2
    half_chord = np.sqrt(np.maximum(square, 0.0))
    near, far = along - half_chord, along + half_chord
    # From within a circle its far side is met.
    distance: Array = np.where(near > _TOUCHING, near, far)
    distance[(square < 0) | (distance <= _TOUCHING)] = np.inf
    return distance
