"""How long a method is to take for a scan at most, and how long it takes."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from statistics import median

import numpy as np

from ..extractor import Extractor
from ..scan import Array, LaserScan
from ..simulation import SENSORS, Sensor
from .aims import TOLD, Aim, Limits
from .findings import Progress, Setting
from .frames import frame_times, scene_numbers, simulated_frames
from .recordings import recorded_scans

__all__ = ["garbage", "speed_aims"]

KINDS = ("room", "corridor", "hall")
#: Scans that are timed for each frame of the setting, of each sensor and recording.
SCANS_A_FRAME = 3
#: Sensors that there are aims for, and the method whose kernels the time is a ratio to.
_TIMED, _BASE = ("paper", "utm30lx"), "liu"
#: Beams of the scans that tell how the time grows.
BEAMS = (500, 1000, 2000, 4000)
#: Repetitions of a call, of which the median is taken; scans of a batch for one and two threads.
CALLS, BATCH = 15, 2000


def speed_aims(method: str, setting: Setting, progress: Progress) -> list[Aim]:
    """Time a method in the kernels and through its call, on scans good and bad."""
    extractor, count, aims = Extractor(method), SCANS_A_FRAME * setting.frames, []
    for name in _TIMED:
        progress(f"{name}: timing")
        scans = _scans(SENSORS[name], setting, count)
        kernels, calls = frame_times(extractor, scans), _call_times(extractor, scans)
        base, beams = float(np.median(frame_times(Extractor(_BASE), scans))), len(scans[0])
        aims += [
            Aim(name, f"kernels, {beams} beams [µs]", TOLD, _microseconds(kernels)),
            Aim(name, f"the same ÷ {_BASE}", Limits(high=1.6), float(np.median(kernels) / base)),
            Aim(
                name,
                "call, above the kernels [µs]",
                Limits(high=4.0),
                _microseconds(calls - kernels),
            ),
            Aim(name, "worst garbage ÷ median", Limits(high=4.0), _worst(extractor, scans)),
            Aim(name, "two threads ÷ one", Limits(low=1.85), _gain(extractor, scans)),
        ]
    for name, scans in recorded_scans(setting, count):
        progress(f"{name}: timing")
        time_ = _microseconds(frame_times(extractor, scans))
        aims.append(Aim(name, f"kernels, {len(scans[0])} beams [µs]", TOLD, time_))
    progress("timing long scans")
    return [*aims, *_growth(extractor, setting, count)]


def _scans(sensor: Sensor, setting: Setting, count: int) -> list[LaserScan]:
    numbers = scene_numbers(count, setting.seed)
    return [frame.scan for frame in simulated_frames(sensor, KINDS, numbers)]


def _microseconds(times: Array) -> float:
    return 1e6 * float(np.median(times))


def _seconds(call: Callable[[], object]) -> float:
    started = time.perf_counter()
    call()
    return time.perf_counter() - started


def _call_times(extractor: Extractor, scans: Sequence[LaserScan]) -> Array:
    """Time of a call with each scan [s], the median of several."""
    return np.array(
        [median(_seconds(partial(extractor, scan)) for _ in range(CALLS)) for scan in scans]
    )


def garbage(like: LaserScan, rng: np.random.Generator) -> dict[str, LaserScan]:
    """Make scans of no place: the worst that a method may be given, by name.

    Parameters
    ----------
    like : LaserScan
        Whose beams they have.
    rng : numpy.random.Generator

    Examples
    --------
    >>> scan = LaserScan([2.0] * 9, angle_min=0.0, angle_increment=0.01)
    >>> list(garbage(scan, np.random.default_rng(0)))
    ['white noise', 'constant', 'one spike', 'near and far', 'two depths mixed', 'random walk']
    """
    n = len(like)
    spike = np.full(n, 2.0)
    spike[n // 2] = 1.0
    ranges = {
        "white noise": rng.uniform(0.5, 10.0, n),
        "constant": np.full(n, 2.0),
        "one spike": spike,
        "near and far": np.where(np.arange(n) % 2, 2.0, 5.0),
        "two depths mixed": rng.choice((2.0, 5.0), n) + rng.normal(0.0, 0.01, n),
        "random walk": 3.0 + np.abs(np.cumsum(rng.normal(0.0, 0.05, n))),
    }
    return {
        name: LaserScan(r, like.angle_min, like.angle_increment, range_max=like.range_max)
        for name, r in ranges.items()
    }


def _worst(extractor: Extractor, scans: Sequence[LaserScan]) -> float:
    """Longest time of a garbage scan, in medians of good ones."""
    bad = garbage(scans[0], np.random.default_rng(0))
    longest = max(frame_times(extractor, [scan])[0] for scan in bad.values())
    return float(longest / np.median(frame_times(extractor, scans)))


def _gain(extractor: Extractor, scans: Sequence[LaserScan]) -> float:
    """How many times as fast two threads are."""
    rows, like = np.stack([scan.ranges for scan in scans]), scans[0]
    batch = partial(
        extractor.batch,
        np.tile(rows, (-(-BATCH // len(rows)), 1)),
        angle_min=like.angle_min,
        angle_increment=like.angle_increment,
        range_max=like.range_max,
    )
    times: dict[int, list[float]] = {1: [], 2: []}
    for _ in range(CALLS):
        for workers, taken in times.items():
            taken.append(_seconds(partial(batch, workers=workers)))
    return median(times[1]) / median(times[2])


def _growth(extractor: Extractor, setting: Setting, count: int) -> list[Aim]:
    """Time of a scan with more and more beams over the same field of view."""
    like, each = SENSORS["utm30lx"], {}
    for n in BEAMS:
        step = (like.n_beams - 1) * like.angle_increment / (n - 1)
        sensor = Sensor("dense", n, like.angle_min, step, 0.1, 30.0, noise=like.noise)
        each[n] = _microseconds(frame_times(extractor, _scans(sensor, setting, count))) / n
    first, last = min(each), max(each)
    aims = [Aim("270°", f"{n} beams [ns a beam]", TOLD, 1e3 * t) for n, t in each.items()]
    growth = each[last] / each[first]
    return [*aims, Aim("270°", f"{last} beams ÷ {first}, a beam", Limits(high=1.0), growth)]
