"""Compiles and caches the kernels before they are needed."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

__all__ = ["warm_up"]


def warm_up(methods: Sequence[str] = ()) -> float:
    """Compile the kernels of some methods, of the tracker and of `lineament live`.

    They are cached: the next program loads them.

    Parameters
    ----------
    methods : sequence of str
        Names of methods; by default the one that is used where none is named.

    Returns
    -------
    float
        Seconds that it took, import of numba included.

    Raises
    ------
    ValueError
        If there is no such method.
    """
    started = time.perf_counter()
    from ..extractor import Extractor
    from ..methods import DEFAULT_METHOD
    from ..motion import Tracker
    from ..output.feature_points import feature_points
    from ..scan import LaserScan

    bearings = np.linspace(-1.0, 1.0, 101)
    wall = LaserScan(2.0 / np.cos(bearings), angles=bearings, range_max=30.0)
    tracker = Tracker()
    for extractor in [Extractor(name) for name in methods or (DEFAULT_METHOD,)]:
        tracker(extractor(wall))
    features = extractor(wall)
    feature_points(features, tracker(features))
    return time.perf_counter() - started
