"""Small scans by formulas: walls, vertices, rooms, and random scenes with every kind of fault."""

import math

import numpy as np

from lineament import LaserScan, RangeNoise
from lineament.simulation import Sensor, World

STEP = math.radians(1 / 3)
NOISE = RangeNoise(sigma=0.01)


def fan(half_width_deg: float = 40.0, step: float = STEP) -> np.ndarray:
    """Bearings around 0, one of them 0."""
    n = round(math.radians(half_width_deg) / step)
    return step * np.arange(-n, n + 1)


def wall(angles, distance: float, normal_deg: float) -> np.ndarray:
    """Ranges of the line x cos α + y sin α = distance; inf where it lies behind."""
    cosine = np.cos(np.asarray(angles) - math.radians(normal_deg))
    with np.errstate(divide="ignore"):
        return np.where(cosine > 1e-12, distance / cosine, np.inf)


def room(angles, walls) -> np.ndarray:
    """Ranges inside a convex room of walls (distance, normal in degrees)."""
    return np.min([wall(angles, *w) for w in walls], axis=0)


BOX = [(2.0, 0.0), (1.3, 90.0), (2.4, 180.0), (1.7, 270.0)]


def vertex(angles, distance: float, opening_deg: float, *, convex: bool) -> np.ndarray:
    """Ranges of a vertex straight ahead whose arms open symmetrically."""
    half = math.radians(opening_deg / 2)
    left = distance * math.sin(half) / np.sin(half - angles)
    right = distance * math.sin(half) / np.sin(half + angles)
    return np.maximum(left, right) if convex else np.minimum(left, right)


def scan_of(ranges, angles, **fields) -> LaserScan:
    """Make a scan of evenly spaced bearings."""
    step = (angles[-1] - angles[0]) / (len(angles) - 1)
    return LaserScan(ranges, float(angles[0]), float(step), **fields)


def seen(scan, ranges, angles):
    """Make a scan of other ranges and bearings with the limits of one."""
    limits = {"range_min": scan.range_min, "range_max": scan.range_max}
    if scan.is_regular:
        return LaserScan(ranges, float(angles[0]), scan.angle_increment, **limits)
    return LaserScan(ranges, angles=angles, **limits)


def full_circle(n: int = 720) -> np.ndarray:
    return -math.pi + 2 * math.pi / n * np.arange(n)


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


def degenerate_scans() -> dict[str, LaserScan]:
    """Scans at the edge of what a scan can be, by name."""
    angles, ring = fan(30), full_circle(360)
    nan_run = wall(angles, 2.0, 0.0)
    nan_run[40:70] = np.nan
    limits = wall(angles, 2.0, 0.0)
    limits[::7], limits[3::11], limits[5::13] = 0.5, 30.0, 0.49999
    hostile = wall(angles, 2.0, 0.0)
    hostile[[3, 20, 41, 60, 90]] = [np.inf, -np.inf, 0.0, -3.0, 1e9]
    noise = 0.01 * np.random.default_rng(0).normal(size=720)
    irregular = np.sort(np.random.default_rng(1).uniform(-1, 1, 200))
    x = np.array([3.0, 3.0, 3.0, 2.0, 2.0])
    return {
        "zero beams": LaserScan([], 0.0, 0.1),
        "one beam": LaserScan([2.0], 0.0, 0.1),
        "two beams": LaserScan([2.0, 2.0], 0.0, 0.1),
        "two of nothing": LaserScan([np.nan, 0.0], 0.0, 0.1),
        "all invalid": LaserScan([np.nan] * 50, 0.0, 0.01),
        "one valid": LaserScan([np.nan] * 9 + [2.0] + [np.inf] * 9, 0.0, 0.01),
        "all equal": LaserScan([2.0] * 50, 0.0, 0.01),
        "five": LaserScan(x, 0.0, 0.01),
        "huge": LaserScan([1e9] * 50, 0.0, 0.01),
        "tiny": LaserScan([1e-6] * 50, 0.0, 0.01),
        "x = const": scan_of(wall(angles, 2.0, 0.0), angles),
        "y = const": scan_of(wall(angles + math.pi / 2, 2.0, 90.0), angles + math.pi / 2),
        "grazing": scan_of(wall(angles, 0.3, 80.0), angles, range_max=30.0),
        "nan run": scan_of(nan_run, angles),
        "limits": scan_of(limits, angles, range_min=0.5, range_max=30.0),
        "hostile": scan_of(hostile, angles),
        "box": scan_of(room(ring, BOX), ring),
        "noisy box": scan_of(room(full_circle(), BOX) + noise, full_circle()),
        "open box": scan_of(np.where(abs(ring) < 0.4, np.nan, room(ring, BOX)), ring),
        "box with a pillar at the seam": scan_of(
            np.where(abs(ring) > 3.0, 0.8, room(ring, BOX)), ring
        ),
        "ring": scan_of(np.full(360, 2.0), ring),
        "ring off centre": scan_of(2.0 + 0.3 * np.cos(ring - 1.0), ring),
        "three beams around": scan_of(np.full(3, 2.0), full_circle(3)),
        "ten beams around": scan_of(np.full(10, 2.0), full_circle(10)),
        "irregular": LaserScan(wall(irregular, 2.0, 20.0) + noise[:200], angles=irregular),
    }
