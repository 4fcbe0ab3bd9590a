"""Where beams meet a world: exact, every beam against every surface."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..scan import Array, Pose
from .worlds import World

#: A surface nearer than this [m] touches the sensor and is not met, whatever rounding does.
_TOUCHING = 1e-9
#: Pairs of a beam and a surface that are worked on at a time: their arrays stay in the cache and
#: in memory that the process already has, whatever the size of the world.
_BLOCK = 12_000


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


def _to_walls(world: World, origin: Array, direction: Array) -> Array:
    """Distance along every ray to every wall, shape (n, S); inf where they do not meet.

    There is one origin, shape (1, 2), or one for each ray, (n, 2).
    """
    ux, uy = direction[:, :, np.newaxis]
    ox, oy = origin.T[:, :, np.newaxis]
    px, py, qx, qy = world.segments.T
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


def _to_circles(world: World, origin: Array, direction: Array) -> Array:
    """Distance along every ray to every circle, shape (n, C); inf where they do not meet."""
    ux, uy = direction[:, :, np.newaxis]
    ox, oy = origin.T[:, :, np.newaxis]
    cx, cy = world.circles[:, 0] - ox, world.circles[:, 1] - oy
    along, across = ux * cx + uy * cy, ux * cy - uy * cx
    square = world.circles[:, 2] ** 2 - across**2
    half_chord = np.sqrt(np.maximum(square, 0.0))
    near, far = along - half_chord, along + half_chord
    # From within a circle its far side is met.
    distance: Array = np.where(near > _TOUCHING, near, far)
    distance[(square < 0) | (distance <= _TOUCHING)] = np.inf
    return distance
