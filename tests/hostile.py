"""Scans that show nothing, and scans as hard to part as there are."""

import math

import numpy as np

from lineament import LaserScan
from lineament.checks.scans import hostile_scans


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
