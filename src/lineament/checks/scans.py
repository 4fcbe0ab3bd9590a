"""Scans that every method must take: rooms, nearly nothing, and what no scanner sees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..scan import LaserScan

Array = NDArray[np.float64]

STEP = math.radians(1 / 3)


def fan(half_width_deg: float = 40.0, step: float = STEP) -> Array:
    """Bearings around 0, one of them 0."""
    n = round(math.radians(half_width_deg) / step)
    return step * np.arange(-n, n + 1, dtype=np.float64)


def wall(angles: ArrayLike, distance: float, normal_deg: float) -> Array:
    """Ranges of the line x cos α + y sin α = distance; inf where it lies behind."""
    cosine = np.cos(np.asarray(angles) - math.radians(normal_deg))
    with np.errstate(divide="ignore"):
        ranges: Array = np.where(cosine > 1e-12, distance / cosine, np.inf)
    return ranges


def room(angles: ArrayLike, walls: Sequence[tuple[float, float]]) -> Array:
    """Ranges inside a convex room of walls (distance, normal in degrees)."""
    nearest: Array = np.min([wall(angles, *w) for w in walls], axis=0)
    return nearest


#: A room: the distance of each wall [m], and where its normal points [°].
BOX = [(2.0, 0.0), (1.3, 90.0), (2.4, 180.0), (1.7, 270.0)]


def scan_of(ranges: ArrayLike, angles: Array, **fields: Any) -> LaserScan:
    """Make a scan of evenly spaced bearings."""
    step = (angles[-1] - angles[0]) / (len(angles) - 1)
    return LaserScan(ranges, float(angles[0]), float(step), **fields)


def full_circle(n: int = 720) -> Array:
    """Bearings once around, from -π."""
    return -math.pi + 2 * math.pi / n * np.arange(n, dtype=np.float64)


def degenerate_scans() -> dict[str, LaserScan]:
    """Make scans at the edge of what a scan can be, by name."""
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


def hostile_scans(n: int, rng: np.random.Generator) -> dict[str, Array]:
    """Ranges of scans that show nothing, by name."""
    mixed = rng.uniform(2, 4, n)
    mixed[rng.random(n) < 0.2] = np.nan
    spike = np.full(n, 2.0)
    spike[n // 2] = 5.0
    return {
        "white noise": rng.uniform(0.1, 10, n),
        "white noise of all sizes": 10.0 ** rng.uniform(-3, 3, n),
        "constant": np.full(n, 3.0),
        "one spike": spike,
        "near and far": np.where(np.arange(n) % 2, 1.0, 5.0),
        "near and far in twos": np.where(np.arange(n) // 2 % 2, 1.0, 5.0),
        "near and far in threes": np.where(np.arange(n) // 3 % 2, 1.0, 1.2),
        "all mixed": mixed,
        "walk": np.abs(2 + np.cumsum(rng.normal(0, 0.05, n))),
        "lattice": np.round(rng.uniform(0.5, 2, n), 1),
        "huge": np.full(n, 1e300),
        "huge and noisy": 1e300 * rng.uniform(0.9, 1, n),
        "large": 1e9 * rng.uniform(0.9, 1, n),
        "tiny": np.full(n, 1e-300),
        "tiny and noisy": 1e-9 * rng.uniform(0.9, 1, n),
        "all NaN": np.full(n, np.nan),
        "all infinite": np.full(n, np.inf),
        "negative": -rng.uniform(1, 2, n),
        "every sort": rng.choice([np.nan, np.inf, -np.inf, 0, -1, 1e-320, 1e308, 1, 2], n),
    }


def plain_scans() -> dict[str, LaserScan]:
    """Make scans as a scanner has them, by name; each shows walls, with a noise of 1 cm."""
    rng, ring, front = np.random.default_rng(7), full_circle(), fan(90, math.radians(0.5))
    noise = 0.01 * rng.normal(size=720)
    limits = {"range_min": 0.1, "range_max": 20.0}
    pillar = np.where(abs(front - 0.3) < 0.1, 0.9, room(front, BOX))
    # From between two angles of the grid: nothing is alike on both sides.
    turned = ring[-300:] + 0.001
    gap = np.where(abs(turned - 2.0) < 0.2, np.nan, room(turned, BOX))
    return {
        "a room": scan_of(room(ring, BOX) + noise, ring, **limits),
        "a pillar in a room": scan_of(
            np.where(abs(ring - 2.0) < 0.15, 0.8, room(ring, BOX)) + noise, ring, **limits
        ),
        "a pillar before walls": scan_of(pillar + noise[:361], front, **limits),
        "walls with a gap": scan_of(gap + noise[-300:], turned, **limits),
    }


def odd_scans() -> dict[str, LaserScan]:
    """Make scans that say little, or nothing, or what is impossible, by name."""
    rng = np.random.default_rng(0)
    hostile = {
        f"{name}, {n} beams{' around' * is_ring}": LaserScan(
            ranges, -0.5, 2 * math.pi / n if is_ring else 0.005
        )
        for n, is_ring in ((1, True), (3, False), (61, False), (61, True))
        for name, ranges in hostile_scans(n, rng).items()
    }
    return degenerate_scans() | hostile
