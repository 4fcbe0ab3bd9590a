"""Work of the kernels over fixed scans, a beam: counted, so that no busy machine changes it.

Run: make bench-check. It fails where a count is more than 5 % above, or below, what is stored here:
then either something became slower, or the new count is to be stored.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import islice
from typing import Any
from unittest.mock import patch

os.environ["NUMBA_DISABLE_JIT"] = "1"  # Only plain functions can be counted.

import numpy as np

import lineament as ln
from lineament.kernels import corner_operator, cutting, noise
from lineament.kernels.optimal import arcs, fits, partition
from lineament.simulation import SENSORS, building, drive

#: What of a stored count another may differ by: counts depend on rounding.
TOLERANCE = 0.05
#: Scans of each sensor.
SCANS = 4
#: Functions whose work is counted, and how much there is of it in a call, by its arguments.
COUNTED: dict[str, tuple[Any, str, Callable[[Any], int]]] = {
    "χ² of lines to next ends": (partition, "costs_on", lambda a: a[3] - a[2]),
    "χ² of lines of a group": (partition, "least_from", lambda a: a[2] - a[1]),
    "groups opened": (partition, "least_from", lambda _: 1),
    "ranges ranked for the noise": (noise, "ranked", lambda a: a[1]),
    "measurements fitted": (fits, "fit_line", lambda a: a[2] - a[1]),
    "circles tried": (arcs, "_looks_round", lambda _: 1),
    "measurements of circles": (arcs, "fit_arc", lambda a: a[2] - a[1] + 1),
    "responses": (cutting, "corner_response", lambda _: 1),
    "distances from a tangent or a chord": (corner_operator, "_distances", lambda a: len(a[0])),
    "distances from the chord of a piece": (
        cutting,
        "farthest_from_chord",
        lambda a: a[3] - a[2] + 1,
    ),
}
#: Counts a beam, by method and sensor, in the order of `COUNTED`.
STORED: dict[tuple[str, str], tuple[float, ...]] = {
    ("optimal", "paper"): (3.132, 2.929, 0.155, 2.0, 0.959, 0.059, 0.179, 0.0, 0.0, 0.0),
    ("optimal", "noisy"): (3.852, 5.764, 0.257, 1.96, 0.946, 0.065, 0.467, 0.0, 0.0, 0.0),
    ("optimal", "utm30lx"): (3.332, 4.462, 0.176, 1.997, 0.968, 0.039, 0.101, 0.0, 0.0, 0.0),
    ("optimal", "rplidar"): (3.731, 5.348, 0.245, 1.943, 0.948, 0.077, 0.125, 0.0, 0.0, 0.0),
    ("liu", "paper"): (0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.021, 0.243, 1.062),
    ("liu", "noisy"): (0.0, 0.0, 0.0, 1.96, 0.0, 0.0, 0.0, 0.023, 0.26, 1.078),
    ("liu", "utm30lx"): (0.0, 0.0, 0.0, 1.997, 0.0, 0.0, 0.0, 0.012, 0.138, 1.033),
    ("liu", "rplidar"): (0.0, 0.0, 0.0, 1.943, 0.0, 0.0, 0.0, 0.016, 0.182, 1.028),
}


@contextmanager
def counting() -> Iterator[Counter[str]]:
    """Count the work of what is called meanwhile."""
    counts: Counter[str] = Counter()

    def counted(name: str, amount: Callable[[Any], int], function: Callable[..., Any]) -> Any:
        def call(*arguments: Any) -> Any:
            counts[name] += amount(arguments)
            return function(*arguments)

        return call

    with ExitStack() as stack:
        for name, (module, function, amount) in COUNTED.items():
            call = counted(name, amount, getattr(module, function))
            stack.enter_context(patch.object(module, function, call))
        yield counts


def work_of(method: str, sensor: str) -> tuple[float, ...]:
    """Counts a beam over some scans of a drive, in the order of `COUNTED`."""
    world, waypoints = building()
    scans = list(islice(drive(world, waypoints, SENSORS[sensor], rate=0.1, seed=11), SCANS))
    extractor = ln.Extractor(method)
    with counting() as counts, np.errstate(all="ignore"):
        for scan in scans:
            extractor(scan)
    beams = sum(map(len, scans))
    return tuple(round(float(counts[name]) / beams, 3) for name in COUNTED)


def differs(count: float, stored: float) -> bool:
    """Whether a count is not what is stored, but for a few calls."""
    return abs(count - stored) > TOLERANCE * stored + 0.002


def main() -> int:
    """Compare all counts with those stored. Returns 1 if one differs, else 0."""
    rows, failed = [], False
    for (method, sensor), stored in STORED.items():
        found = work_of(method, sensor)
        for name, count, before in zip(COUNTED, found, stored, strict=True):
            if differs(count, before):
                failed = True
                print(f"{method}, {sensor}: {name} {count:.4f} a beam, stored {before:.4f}")
        rows.append(f'    ("{method}", "{sensor}"): {found},')
    if failed:
        print("the counts of now:", *rows, sep="\n")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
