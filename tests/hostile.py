"""Scans that show nothing, and scans as hard to part as there are."""

import math

import numpy as np

from lineament import LaserScan


def hostile_scans(n, rng):
    """Make scans that show nothing, by name."""
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


def all_hostile():
    """Scans of few and many beams, that go around and that do not."""
    for k, n in enumerate((1, 2, 3, 4, 7, 61, 360)):
        for first, step in ((-0.5, 0.005), (-math.pi, 2 * math.pi / n)):
            for ranges in hostile_scans(n, np.random.default_rng(k)).values():
                yield LaserScan(ranges, first, step)


def hard_scans(n: int) -> dict[str, LaserScan]:
    """Make scans over 270° by name: walks, clutter, noise, bent walls, and plain ones."""
    rng, angles = np.random.default_rng(1), 1.5 * math.pi / n * np.arange(n)
    bent = 3 / np.cos(0.6 * (angles - angles.mean()))
    ranges = {
        "fine walk": np.abs(2 + np.cumsum(rng.normal(0, 0.015, n))),
        "coarse walk": np.abs(2 + np.cumsum(rng.normal(0, 0.05, n))),
        "white noise": rng.uniform(0.1, 10, n),
        "noisy ring": 3 + rng.normal(0, 0.03, n),
        "ring": np.full(n, 3.0),
        "bent wall": bent,
        "bent wall, noisy": bent + rng.normal(0, 0.01, n),
        "near and far": np.where(np.arange(n) // 2 % 2, 1.0, 5.0),
        "waves": 3 + 0.3 * np.sin(20 * angles),
        "columns": 3 + 0.3 * np.abs(np.sin(15 * angles)),
        "clutter before a wall": np.where(rng.random(n) < 0.3, rng.uniform(0.5, 5, n), 3.0),
    }
    return {name: LaserScan(r, 0.0, angles[1]) for name, r in ranges.items()}
