"""Check of a method: that its features are sound, the same however they are asked for."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np

from ..extractor import Extractor
from ..features import TABLES, FeatureBatch, Features
from ..methods import Method
from ..scan import LaserScan
from .claims import claim, during, taking_turns, without_warnings
from .scans import BOX, full_circle, odd_scans, plain_scans, room
from .sound import difference, ends_of, first_problem, led_backwards

#: How far the scanner is turned [rad], and to which beam the seam of a full circle is moved.
_TURN, _SEAM = 0.7, 200
_THREADS, _ROUNDS = 4, 4

Found = dict[str, Features]


def check_method(
    method: str | Method | Callable[[LaserScan], Any],
    *,
    turned: bool = True,
    seam: bool = False,
    mirrored: bool = False,
    **parameters: Any,
) -> None:
    """Check a method: its features are sound, and the same however they are asked for.

    Rooms with noise, and scans of no beams, of nothing valid, of NaN, inf and 0, of ranges of
    10⁻³⁰⁰ and 10³⁰⁰ m are given to it. No warning may come but those that a scan deserves; numbers
    are finite, covariances symmetric and positive definite, beams, segments and clusters that are
    named exist, segments lead from their first to their last beam. The same scan gives the same
    features: again, after others, by another extractor, its copy or a pickled one, by threads that
    share one, in a batch by one worker or two, in a trace. What it is given stays as it was.

    Parameters
    ----------
    method : str, callable or Method
        As in `Extractor`.
    turned : bool
        Whether a scanner that is turned sees the same; a fit of y over x does not.
    seam, mirrored : bool
        Whether the features are the same wherever a full circle begins, and in a mirror. Methods
        that go along the beams have one of their directions, and begin somewhere.
    **parameters
        Parameters of the method that differ from its defaults.

    Raises
    ------
    AssertionError
        If anything of this does not hold: one line that names the method, the scan and what broke.

    Examples
    --------
    >>> check_method("optimal", mirrored=True)
    >>> def careless(scan):
    ...     first, *_, last = scan.valid.nonzero()[0]
    ...     return [(first, last)]
    >>> check_method(careless)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    AssertionError: careless: scan 'zero beams': raised LineamentError: careless failed: ...
    """
    with during(str(method) if isinstance(method, str) else "method"):
        make = partial(Extractor, method, **parameters)
        name = method if isinstance(method, str) else make().method.name
    with during(str(name)):
        found = _sound_on_all(make)
        used = make()
        _same_again(used, found)
        _same_in_copies(used, found)
        _same_in_threads(make(), found)
        _same_in_batches(make())
        _same_in_traces(make(), found)
        if turned:
            _same_when_turned(make(noise=0.01))
        if seam:
            _same_whatever_the_seam(make(noise=0.01))
        if mirrored:
            _same_in_a_mirror(make(noise=0.01))


def _all_scans() -> dict[str, LaserScan]:
    return plain_scans() | odd_scans()


def _sound_on_all(make: Callable[..., Extractor]) -> Found:
    """Return what is found in each scan by an extractor that estimates the noise."""
    found: Found = {}
    for noise in (0.01, None):
        extractor = make(noise=noise)
        for name, scan in plain_scans().items():
            features = found[name] = _of(extractor, name, scan, is_plain=True)
            problem = led_backwards(features, scan)
            claim(not problem, f"scan {name!r}: {problem}")
        for name, scan in odd_scans().items():
            found[name] = _of(extractor, name, scan, is_plain=False)
        counts = [sum(found[name].counts().values()) for name in plain_scans()]
        claim(any(counts), "nothing is found in any room")
    return found


def _of(extractor: Extractor, name: str, scan: LaserScan, is_plain: bool) -> Features:
    before = scan.ranges.tobytes(), scan.angles.tobytes(), scan.valid.tobytes()
    with during(f"scan {name!r}"), without_warnings(of_scans=is_plain):
        features = extractor(scan)
        problem = first_problem(features, scan)
        claim(not problem, problem)
        after = scan.ranges.tobytes(), scan.angles.tobytes(), scan.valid.tobytes()
        claim(before == after, "its scan is changed")
    return features


def _claim_same(
    doing: str, extractor: Callable[[LaserScan], Features], found: Found, names: Iterable[str]
) -> None:
    scans = _all_scans()
    for name in names:
        with during(f"{doing}: scan {name!r}"), without_warnings():
            problem = difference(extractor(scans[name]), found[name])
            claim(not problem, problem)


def _same_again(used: Extractor, found: Found) -> None:
    _claim_same("another extractor finds others", used, found, found)
    _claim_same("after other scans it finds others", used, found, reversed(found))
    for name in plain_scans():
        _claim_same("the same scan again", used, found, [name, name])


def _same_in_copies(used: Extractor, found: Found) -> None:
    names = [*plain_scans(), "zero beams", "one beam"]
    ways: dict[str, Callable[[Extractor], Extractor]] = {
        "a copy": copy.copy,
        "a deep copy": copy.deepcopy,
        "a pickled copy": lambda of: pickle.loads(pickle.dumps(of)),
    }
    for doing, copied in ways.items():
        with during(doing):
            other = copied(used)
        _claim_same(f"{doing} finds others", other, found, names)


def _same_in_threads(shared: Extractor, found: Found) -> None:
    names = [*plain_scans(), "box", "ring", "one beam", "nan run"]

    def work(k: int) -> None:
        order = np.random.default_rng(k).permutation(np.repeat(names, _ROUNDS))
        for name in order.tolist():
            problem = difference(shared(scans[name]), found[name])
            claim(not problem, f"threads that share it find others: scan {name!r}: {problem}")

    scans = _all_scans()
    with without_warnings(), taking_turns(), ThreadPoolExecutor(_THREADS) as pool:
        list(pool.map(work, range(_THREADS)))


def _same_in_batches(extractor: Extractor) -> None:
    angles, rng = full_circle(360), np.random.default_rng(0)
    rows = np.array([room(angles + turn, BOX) for turn in rng.uniform(-3, 3, 9)])
    rows += 0.01 * rng.normal(size=rows.shape)
    rows[rng.random(rows.shape) < 0.03] = np.nan
    rows[3:5, 50:90], rows[7] = 0.7, np.nan
    given: dict[str, Any] = {"angle_min": float(angles[0]), "angle_increment": math.tau / 360}
    given |= {"range_min": 0.2, "range_max": 5.0}
    before = rows.copy()
    with without_warnings():
        singles = [extractor(LaserScan(row, **given)) for row in before]
        for workers in (1, 2, 1):
            with during(f"a batch by {workers} workers"):
                batch: FeatureBatch = extractor.batch(rows, workers=workers, **given)
                claim(len(batch) == len(rows), f"has {len(batch)} of {len(rows)} scans")
                claim(np.array_equal(rows, before, equal_nan=True), "changes its ranges")
                for i, (one, alone) in enumerate(zip(batch, singles, strict=True)):
                    problem = difference(one, alone)
                    claim(not problem, f"is not its scans: row {i}: {problem}")
                    claim(one.noise == alone.noise, f"row {i} has another noise than alone")


def _same_in_traces(extractor: Extractor, found: Found) -> None:
    _claim_same(
        "a trace has others", lambda scan: extractor.trace(scan).features, found, plain_scans()
    )


# The same world, seen in another way


def _same_when_turned(extractor: Extractor) -> None:
    for name, scan in plain_scans().items():
        seen = extractor(_seen(scan, scan.ranges, scan.angles + _TURN))
        with during(f"a scanner that is turned sees others: scan {name!r}"):
            expected = extractor(scan).transform(0.0, 0.0, _TURN)
            _claim_alike(seen, expected)
            claim(seen.clusters.tolist() == expected.clusters.tolist(), "clusters differ")
            for table in ("segments", "corners", "edges", "arcs"):
                one, other = seen[table]["covariance"], expected[table]["covariance"]
                is_close = np.allclose(one, other, rtol=1e-5, atol=1e-12)
                claim(is_close, f"{table} differ in covariance")


def _same_whatever_the_seam(extractor: Extractor) -> None:
    for name, scan in plain_scans().items():
        if scan.is_full_circle:
            angles = np.append(scan.angles[_SEAM:], scan.angles[:_SEAM] + math.tau)
            seen = extractor(_seen(scan, np.roll(scan.ranges, -_SEAM), angles))
            with during(f"where a circle begins matters: scan {name!r}"):
                _claim_alike(seen, extractor(scan))


def _same_in_a_mirror(extractor: Extractor) -> None:
    for name, scan in plain_scans().items():
        seen = extractor(_seen(scan, scan.ranges[::-1], -scan.angles[::-1]))
        ends = np.hstack((seen["segments"]["end"], seen["segments"]["start"]))
        with during(f"in a mirror it finds others: scan {name!r}"):
            _claim_places("segments", ends * (1, -1, 1, -1), ends_of(extractor(scan)))


def _seen(scan: LaserScan, ranges: Any, angles: Any) -> LaserScan:
    first, step = float(angles[0]), scan.angle_increment
    return LaserScan(ranges, first, step, range_min=scan.range_min, range_max=scan.range_max)


def _claim_alike(one: Features, other: Features) -> None:
    for table in TABLES:
        problem = f"{len(one[table])} {table} in place of {len(other[table])}"
        claim(len(one[table]) == len(other[table]), problem)
    _claim_places("segments", ends_of(one), ends_of(other))
    _claim_places("corners", one["corners"]["position"], other["corners"]["position"])


def _claim_places(table: str, one: Any, other: Any) -> None:
    """Claim that places are the same, in whatever order, to a micrometre."""
    claim(len(one) == len(other), f"{len(one)} {table} in place of {len(other)}")
    if len(one):
        apart = np.abs(one[:, None] - other).max(axis=2)
        worst = max(apart.min(axis=0).max(), apart.min(axis=1).max())
        claim(worst < 1e-6, f"{table} are {worst:.3g} m elsewhere")
