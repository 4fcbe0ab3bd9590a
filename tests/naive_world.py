"""Slow obvious twins of the ray caster and of distances, and sensors to try them with."""

from __future__ import annotations

import math

import numpy as np

from lineament.simulation import Sensor, World

INF = math.inf


def naive_cast(world, pose, angle):
    """Cast one ray: every wall by a linear system, every circle by the quadratic formula."""
    x, y, theta = pose
    u = np.array([math.cos(theta + angle), math.sin(theta + angle)])
    best, best_surface = INF, -1
    for i, (x1, y1, x2, y2) in enumerate(world.segments):
        system = np.column_stack((u, [x1 - x2, y1 - y2]))
        if abs(np.linalg.det(system)) < 1e-14:
            continue
        distance, share = np.linalg.solve(system, [x1 - x, y1 - y])
        if 0 <= share <= 1 and 1e-9 < distance < best:
            best, best_surface = distance, i
    for i, (cx, cy, r) in enumerate(world.circles):
        b = u[0] * (x - cx) + u[1] * (y - cy)
        c = (x - cx) ** 2 + (y - cy) ** 2 - r**2
        if b * b < c:
            continue
        for distance in (-b - math.sqrt(b * b - c), -b + math.sqrt(b * b - c)):
            if 1e-9 < distance < best:
                best, best_surface = distance, len(world.segments) + i
    return best, best_surface


def distance_to_walls(world, points):
    """Distance of every point to the nearest surface, by projection."""
    p, q = world.segments[:, :2], world.segments[:, 2:]
    along = q - p
    share = ((points[:, None] - p) * along).sum(axis=2) / (along**2).sum(axis=1)
    foot = p + np.clip(share, 0, 1)[:, :, None] * along
    walls = np.linalg.norm(points[:, None] - foot, axis=2).min(axis=1)
    if len(world.circles) == 0:
        return walls
    centres = np.linalg.norm(points[:, None] - world.circles[:, :2], axis=2)
    return np.minimum(walls, np.abs(centres - world.circles[:, 2]).min(axis=1))


def ring_sensor(n_beams=2000, **settings):
    """Make a full turn without noise but that of `settings`."""
    return Sensor("ring", n_beams, -math.pi, 2 * math.pi / n_beams, **settings)


def drum(radius):
    """Make a round room: every true range from its centre is the radius."""
    return World([], [[0, 0, radius]])
