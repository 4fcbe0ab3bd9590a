"""Load the kernels before they are needed, and compile them where no library fits."""

import time
from collections.abc import Sequence


def warm_up(methods: Sequence[str] = ()) -> float:
    """Run some methods (default: `optimal`) and the tracker once.

    Returns the seconds that it takes, imports included; a ValueError if a method does not exist.
    Only where no compiled library of the kernels fits is there something to wait for: numba
    compiles them then, and caches them.
    """
    started = time.perf_counter()
    from ..extractor import WALL, Extractor, load_kernels
    from ..methods import DEFAULT_METHOD
    from ..motion import Tracker
    from ..output.feature_points import feature_points
    from ..progress import compiling

    tracker = Tracker()
    extractors = [Extractor(name) for name in methods or (DEFAULT_METHOD,)]
    with compiling():
        load_kernels(extractors)
        for features in (extractors[0](WALL), extractors[0](WALL)):
            feature_points(features, tracker(features))
    return time.perf_counter() - started
