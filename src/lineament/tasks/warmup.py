"""Compile and cache the kernels before they are needed."""

import time
from collections.abc import Sequence

import numpy as np


def warm_up(methods: Sequence[str] = ()) -> float:
    """Compile the kernels of some methods (default: `optimal`) and of the tracker, for the cache.

    Returns the seconds that it takes, the import of numba included; a ValueError if a method does
    not exist.
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
