"""Compiles and caches the kernels before they are needed."""

from __future__ import annotations

import time

import numpy as np

__all__ = ["warm_up"]


def warm_up() -> float:
    """Compile the kernels of all methods, or load them from the cache.

    Returns
    -------
    float
        Seconds that it took, import of numba included.
    """
    started = time.perf_counter()
    from .extractor import Extractor
    from .methods import METHODS
    from .scan import LaserScan

    bearings = np.linspace(-1.0, 1.0, 101)
    wall = LaserScan(2.0 / np.cos(bearings), angles=bearings, range_max=30.0)
    for name in METHODS:
        Extractor(name)(wall)
    return time.perf_counter() - started
