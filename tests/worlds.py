"""Small scans by formulas: walls, vertices, rooms, and random scenes with every kind of fault."""

import math

import numpy as np

from lineament import LaserScan, RangeNoise
from lineament.checks.scans import (  # noqa: F401  (others import them from here)
    BOX,
    STEP,
    degenerate_scans,
    fan,
    full_circle,
    room,
    scan_of,
    wall,
)
from lineament.simulation import Sensor, World

NOISE = RangeNoise(sigma=0.01)
#: Where the walls of `BOX` meet [m].
BOX_CORNERS = [(2.0, 1.3), (-2.4, 1.3), (-2.4, -1.7), (2.0, -1.7)]


def errors_of_lines(lines, distance: float, normal_deg: float) -> np.ndarray:
    """Errors of lines off a wall: the offset at the centroid to its left [m], and the angle."""
    normal = math.radians(normal_deg)
    off = distance - lines["centroid"] @ (math.cos(normal), math.sin(normal))
    # Seen from inside, beams run along the normal turned left by 90°.
    turn = np.angle(np.exp(1j * (lines["angle"] - normal - math.pi / 2)))
    return np.column_stack((off, turn))


def vertex(angles, distance: float, opening_deg: float, *, convex: bool) -> np.ndarray:
    """Ranges of a vertex straight ahead whose arms open symmetrically."""
    half = math.radians(opening_deg / 2)
    left = distance * math.sin(half) / np.sin(half - angles)
    right = distance * math.sin(half) / np.sin(half + angles)
    return np.maximum(left, right) if convex else np.minimum(left, right)


def seen(scan, ranges, angles):
    """Make a scan of other ranges and bearings with the limits of one."""
    limits = {"range_min": scan.range_min, "range_max": scan.range_max}
    if scan.is_regular:
        return LaserScan(ranges, float(angles[0]), scan.angle_increment, **limits)
    return LaserScan(ranges, angles=angles, **limits)


def ring_sensor(n_beams=2000, **settings):
    """Make a full turn without noise but that of `settings`."""
    return Sensor("ring", n_beams, -math.pi, 2 * math.pi / n_beams, **settings)


def drum(radius):
    """Make a round room: every true range from its centre is the radius."""
    return World([], [[0, 0, radius]])


def random_scan(seed: int, n: int | None = None) -> LaserScan:
    """Walls, vertices, arcs and clutter with jumps, noise, lattice, faults; some wrap."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(60, 400)) if n is None else n
    full = rng.random() < 0.4
    angles = rng.uniform(-3, 0) + rng.uniform(0.002, 0.015) * np.arange(n)
    if full:
        angles = full_circle(n)
    ranges = np.empty(n)
    if rng.random() < 0.5:
        spread = np.linspace(0, 360, int(rng.integers(3, 7)), endpoint=False)
        walls = [(rng.uniform(0.8, 5), a + rng.uniform(-20, 20)) for a in spread]
        ranges[:] = room(angles, walls)
    else:
        start = 0
        while start < n:
            stop = start + int(rng.integers(2, 80))
            part = angles[start:stop]
            normal = np.degrees(part.mean()) + rng.uniform(-70, 70)
            distance = rng.uniform(0.5, 8)
            ranges[start:stop] = wall(part, distance, normal) if rng.random() < 0.8 else distance
            start = stop
    ranges += rng.choice([1e-3, 0.01, 0.03]) * rng.normal(size=n)
    if rng.random() < 0.2:
        ranges = np.round(ranges, 2) + 1e-7 * rng.normal(size=n)  # A lattice, but without ties.
    for _ in range(int(rng.integers(0, 4))):
        at = int(rng.integers(0, n))
        ranges[at : at + int(rng.integers(1, 12))] = rng.choice([np.nan, np.inf, 0.0, -1.0, 60.0])
    ranges[rng.random(n) < rng.choice([0, 0.05])] = rng.choice([np.nan, 0.2, 9.0])
    limits = {"range_min": 0.1, "range_max": 30.0}
    if not full and rng.random() < 0.3:
        jitter = rng.uniform(-0.3, 0.3, n) * (angles[1] - angles[0])
        return LaserScan(ranges, angles=angles + jitter, **limits)
    return LaserScan(ranges, float(angles[0]), float(angles[1] - angles[0]), **limits)
