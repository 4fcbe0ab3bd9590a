"""Compile and cache the kernels before they are needed."""

import time
from collections.abc import Sequence


def warm_up(methods: Sequence[str] = ()) -> float:
    """Compile the kernels of some methods (default: `optimal`) and of the tracker, for the cache.

    Returns the seconds that it takes, the import of numba included; a ValueError if a method does
    not exist.
    """
    started = time.perf_counter()
    from ..extractor import WALL, Extractor, load_kernels
    from ..methods import DEFAULT_METHOD
    from ..motion import Tracker
    from ..output.feature_points import feature_points
    from ..progress import compiling

    tracker = Tracker()
    extractors = [Extractor(name) for name in methods or (DEFAULT_METHOD,)]
    with compiling([Tracker.__call__], [Tracker]):
        load_kernels(extractors)
        for features in (extractors[0](WALL), extractors[0](WALL)):
            feature_points(features, tracker(features))
    return time.perf_counter() - started
