"""One scan given in many ways, which must all have the same features.

Other types, masks, units, directions of the beams, and copies or threads of one extractor: nothing
raises where these go wrong, so that only the features of the plain scan can tell.
"""

import copy
import math
import pickle
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
from fuzz_targets import NOISES, Target, any_method, any_scan

from lineament import Extractor, Features, LaserScan
from lineament.features import TABLES

THREADS = 4


def words_of(features: Features) -> list[bytes]:
    """Everything that was found, as bytes."""
    return [features.clusters.tobytes(), *(features[name].tobytes() for name in TABLES)]


class Forms(Target):
    """A scan and what an extractor was used for before; a way to give the scan again."""

    def __init__(self, _: Path) -> None:
        self._interval = sys.getswitchinterval()
        sys.setswitchinterval(1e-5)  # Threads take turns within a call.

    def close(self) -> None:
        sys.setswitchinterval(self._interval)

    def make(self, chance: Random) -> tuple[str, Any, Any, list[LaserScan]]:
        form = chance.choice(list(self.FORMS))
        scans = [any_scan(chance, 120) for _ in range(THREADS if form == "threads" else 2)]
        return form, any_method(chance), chance.choice(NOISES), scans

    def check(self, made: tuple[str, Any, Any, list[LaserScan]]) -> str:
        form, method, noise, scans = made
        used = Extractor(method, noise=noise)
        scan, *others = scans
        for other in others:
            used(other)
        expected = Extractor(method, noise=noise)(self.AS.get(form, lambda one: one)(scan))
        found = self.FORMS[form](used, scans)
        for one in found if isinstance(found, list) else [found]:
            assert words_of(one) == words_of(expected), form
        return f"{form}: {'found' if any(expected.counts().values()) else 'nothing'}"

    #: What the plain scan is before it is compared, where that is another.
    AS: ClassVar[dict[str, Callable[[LaserScan], LaserScan]]] = {
        "millimetres": lambda scan: fields_of(scan, 1e-3 * (1e3 * scan.ranges), 1e-3 * 1e3),
        "single precision": lambda scan: fields_of(scan, narrow(scan.ranges)),
        "message": lambda scan: fields_of(scan, narrow(scan.ranges)),
    }
    FORMS: ClassVar[dict[str, Callable[[Extractor, list[LaserScan]], Any]]] = {}


def form(function: Callable[[Extractor, list[LaserScan]], Any]) -> Any:
    """Add a way to give a scan; the underscores of its name are spaces."""
    Forms.FORMS[function.__name__.strip("_").replace("_", " ")] = function
    return function


def narrow(ranges: Any) -> Any:
    with np.errstate(over="ignore"):
        return ranges.astype(np.float32)


def fields_of(scan: LaserScan, ranges: Any, factor: float = 1.0) -> LaserScan:
    """Return the same scan with other ranges, and limits that are rounded by a factor."""
    bearings: dict[str, Any] = {"angles": scan.angles}
    if scan.is_regular:
        bearings = {"angle_min": scan.angle_min, "angle_increment": scan.angle_increment}
    limits = {"range_min": factor * scan.range_min, "range_max": factor * scan.range_max}
    return LaserScan(ranges, **bearings, **limits)


def batch_of(extractor: Extractor, rows: Any, scan: LaserScan, workers: int = 1) -> Any:
    bearings: dict[str, Any] = {"angles": scan.angles}
    if scan.is_regular:
        bearings = {"angle_min": scan.angle_min, "angle_increment": scan.angle_increment}
    limits = {"range_min": scan.range_min, "range_max": scan.range_max}
    return extractor.batch(rows, **bearings, **limits, workers=workers)


@form
def again(used: Extractor, scans: list[LaserScan]) -> Any:
    return used(scans[0])


@form
def pickled(used: Extractor, scans: list[LaserScan]) -> Any:
    return pickle.loads(pickle.dumps(used))(pickle.loads(pickle.dumps(scans[0])))


@form
def deep_copy(used: Extractor, scans: list[LaserScan]) -> Any:
    return copy.deepcopy(used)(copy.deepcopy(scans[0]))


@form
def copies_take_turns(used: Extractor, scans: list[LaserScan]) -> Any:
    other = copy.copy(used)
    other(scans[1])
    first = used(scans[0])
    other(scans[1])
    return [first, other(scans[0])]


@form
def threads(used: Extractor, scans: list[LaserScan]) -> Any:
    with ThreadPoolExecutor(THREADS) as pool:
        found = list(pool.map(used, scans * 3))
    for scan, features in zip(scans, found, strict=False):
        assert words_of(features) == words_of(used(scan))
    return found[::THREADS]


@form
def batch(used: Extractor, scans: list[LaserScan]) -> Any:
    scan = scans[0]
    return list(batch_of(used, np.stack([scan.ranges] * 3), scan, workers=2))


@form
def masked(used: Extractor, scans: list[LaserScan]) -> Any:
    scan = scans[0]
    ranges = np.ma.masked_array(np.where(scan.valid, scan.ranges, 1.0), ~scan.valid)
    return [used(fields_of(scan, ranges)), batch_of(used, ranges[None], scan)[0]]


@form
def masked_anew(used: Extractor, scans: list[LaserScan]) -> Any:
    """A mask over measurements is as if they were NaN."""
    scan = scans[0]
    hidden = np.arange(len(scan)) % 5 == 2
    expected = used(fields_of(scan, np.where(hidden, np.nan, scan.ranges)))
    found = used(fields_of(scan, np.ma.masked_array(scan.ranges, hidden)))
    assert words_of(found) == words_of(expected)
    return used(scan)


@form
def list_of_numbers(used: Extractor, scans: list[LaserScan]) -> Any:
    ranges = [None if math.isnan(r) else r for r in scans[0].ranges.tolist()]
    return used(fields_of(scans[0], ranges))


@form
def other_memory(used: Extractor, scans: list[LaserScan]) -> Any:
    scan = scans[0]
    strided = np.repeat(scan.ranges, 2)[::2]
    return [used(fields_of(scan, r)) for r in (strided, scan.ranges.astype(">f8"))]


@form
def single_precision(used: Extractor, scans: list[LaserScan]) -> Any:
    return used(fields_of(scans[0], narrow(scans[0].ranges).astype(np.float64)))


@form
def millimetres(used: Extractor, scans: list[LaserScan]) -> Any:
    scan = scans[0]
    plain = fields_of(scan, 1e3 * scan.ranges, 1e3)
    ends = {"range_min": plain.range_min, "range_max": plain.range_max}
    bearings: dict[str, Any] = {"angles": scan.angles}
    if scan.is_regular:
        bearings = {"angle_min": scan.angle_min, "angle_increment": scan.angle_increment}
    return [
        used(LaserScan(plain.ranges, **bearings, **ends, scale=1e-3)),
        used(plain.scaled(1e-3)),
        used.batch(plain.ranges[None], **bearings, **ends, scale=1e-3)[0],
    ]


@form
def clockwise(used: Extractor, scans: list[LaserScan]) -> Any:
    """Beams in the other order are put in the order of their bearings."""
    scan = scans[0]
    ranges, limits = scan.ranges[::-1], {"range_min": scan.range_min, "range_max": scan.range_max}
    if len(scan) < 2:
        return used(scan)
    reversed_scan = LaserScan(ranges, angles=scan.angles[::-1], **limits)
    ordered = LaserScan(scan.ranges, angles=scan.angles, **limits)
    assert words_of(used(reversed_scan)) == words_of(used(ordered))
    return used(scan)


@form
def message(used: Extractor, scans: list[LaserScan]) -> Any:
    scan = scans[0]
    if not scan.is_regular:
        return used(fields_of(scan, narrow(scan.ranges)))
    names = "angle_min angle_increment range_min range_max scan_time time_increment"
    fields = {name: getattr(scan, name) for name in names.split()}
    return used(LaserScan.from_message(SimpleNamespace(ranges=narrow(scan.ranges), **fields)))
