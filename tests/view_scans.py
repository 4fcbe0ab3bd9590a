"""Scans that the tests of `view` look at."""

import numpy as np

from lineament import LaserScan

__all__ = ["corners", "walls"]


def walls(count, beams=31):
    """Scans of a wall that comes nearer, every third beam invalid in another way."""
    bearings = np.linspace(-0.5, 0.5, beams)
    for k in range(count):
        ranges = (3.0 - 0.01 * k) / np.cos(bearings)
        ranges[:3] = np.nan, np.inf, 0.0
        yield LaserScan(
            ranges, -0.5, 1.0 / (beams - 1), range_max=30.0, stamp=10 + 0.1 * k, frame_id="laser"
        )


def corners(count):
    """Scans of a corner straight ahead that comes nearer; nothing comes back on the left."""
    bearings = np.radians(np.arange(-60, 61))
    rng = np.random.default_rng(1)
    for k in range(count):
        ranges = (4.0 - 0.05 * k) / (np.cos(bearings) + abs(np.sin(bearings)))
        ranges += rng.normal(0.0, 0.01, len(ranges))
        ranges[110:] = np.nan
        yield LaserScan(ranges, bearings[0], np.radians(1), range_max=30.0, stamp=5 + 0.05 * k)
