"""The scans that experiments measure: simulated frames with their truth, and parts of logs."""

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from lineament.extractor import Extractor
from lineament.features import FeatureBatch, Features
from lineament.logs import Log, open_log
from lineament.methods.stages import bilateral_filter
from lineament.scan import Array, LaserScan, Pose
from lineament.simulation import SENSORS, Sensor, scene, truth

from ..evaluation.counts import Summable
from ..evaluation.scores import evaluate
from .findings import Progress, Setting, each, median_of

S = TypeVar("S", bound=Summable)
Extract = Callable[[LaserScan], Features]
Pair = tuple[LaserScan, LaserScan]

#: Kinds of scenes of Figures 11 and 12.
INDOORS = ("room", "corridor", "hall")
#: Recordings of Figures 11 and 12.
LOGS = {
    "Intel lab": "carmen/intel-corrected.log.gz",
    "MIT CSAIL": "carmen/csail-corrected.log.gz",
    "ACES": "carmen/aces-corrected.log.gz",
}
#: Recordings without poses whose sensors never move.
STANDING = (
    "rosbag1/demo_stationary_simple_environment.bag",
    "rosbag1/scans_demo.bag",
    "rosbag2/jackal_mocap",
    "rosbag2/ld19",
)
#: The second scan of a pair is the first one that is so far away [m] or turned so far [rad], ...
MOVED, TURNED = 0.3, math.radians(15)
#: ... within so many scans.
_SEARCHED = 200
#: A sensor stands if its pose changes by less [m], [rad].
_STILL = 1e-3, 1e-3

#: Scenes of one seed; parameters are chosen on the first half, and results are of the second.
_SCENES = 20_000
#: A scan is timed as a batch of copies, to time the kernels and not the call from Python, in
#: several rounds.
_COPIES, _BATCHES = 8, 5


class Frame(NamedTuple):
    """A simulated scan, and what there is to find in it."""

    scan: LaserScan
    truth: Features


def scene_numbers(count: int, seed: int, *, reported: bool = True) -> range:
    """Return the seeds of the scenes that are reported, or that parameters are chosen on."""
    first = _SCENES * seed + (_SCENES // 2 if reported else 0)
    return range(first, first + count)


def simulated_frames(sensor: Sensor, kinds: Iterable[str], numbers: range) -> Iterator[Frame]:
    """Simulate a frame for each seed, with these kinds of scenes in turn."""
    in_turn = list(kinds)
    for i, number in enumerate(numbers):
        world, pose = scene(in_turn[i % len(in_turn)], number)
        scan = sensor.scan(world, pose, np.random.default_rng([number, 1]))
        yield Frame(scan, truth(world, pose, sensor))


def frames_of(
    setting: Setting, kinds: Iterable[str], frames: int = 1, sensor: str = "paper"
) -> list[Frame]:
    """Simulate so many frames, for each of the setting, of scenes that are reported."""
    numbers = scene_numbers(frames * setting.frames, setting.seed)
    return list(simulated_frames(SENSORS[sensor], kinds, numbers))


def scored(
    methods: Mapping[str, Extract],
    frames: Sequence[Any],
    progress: Progress,
    what: str,
    score: Callable[[Features, Features], Any] = evaluate,
) -> dict[str, list[Any]]:
    """Score what methods find in each frame, which has a scan and a truth; lists by name."""
    return {
        name: [score(extract(frame.scan), frame.truth) for frame in frames]
        for name, extract in each(methods, progress, what)
    }


def totals(scores: Mapping[str, Sequence[S]]) -> dict[str, S]:
    """Add up the scores of all frames, by method."""
    return {name: of[0].total(of) for name, of in scores.items()}


def median_scan(
    scores: Mapping[str, Sequence[S]],
    figure: Callable[[S], float],
    among: Sequence[int] | None = None,
) -> int:
    """Return the scan, of all or `among` some, with the median figure of all methods together."""
    of_scans = [figure(one[0].total(one)) for one in zip(*scores.values(), strict=True)]
    return median_of(range(len(of_scans)) if among is None else among, of_scans.__getitem__)


def filtered(scan: LaserScan, times: int = 1) -> LaserScan:
    """Return a scan whose ranges are filtered so many times, as the paper does."""
    for _ in range(times):
        scan = LaserScan(
            bilateral_filter(scan),
            *(scan.angle_min, scan.angle_increment),
            range_min=scan.range_min,
            range_max=scan.range_max,
        )
    return scan


def batch_of(extractor: Extractor, scans: Iterable[LaserScan]) -> list[Features]:
    """Extract scans of one sensor with evenly spaced beams, all at once."""
    rows = list(scans)
    return list(_batch(extractor, np.stack([scan.ranges for scan in rows]), rows[0]))


def interleaved_times(
    extractors: Mapping[str, Callable[[LaserScan], Features]],
    scans: Sequence[LaserScan],
    *,
    kernels: bool = True,
) -> dict[str, Array]:
    """Time methods in turns: what the machine does meanwhile, it does to all of them.

    Returns the time that each method takes in each round for each scan [s], (rounds, scans), by
    its name: in the kernels alone, which only an `Extractor` has, or of a call from Python.
    """
    calls = [
        partial(_batch, extract, np.tile(scan.ranges, (_COPIES, 1)), scan)
        if kernels and isinstance(extract, Extractor)
        else partial(extract, scan)
        for scan in scans
        for extract in extractors.values()
    ]
    taken = np.empty((_BATCHES + 1, len(calls)))
    for place in np.ndindex(taken.shape):
        started = time.perf_counter()
        calls[place[1]]()
        taken[place] = time.perf_counter() - started
    # The first round compiles, and touches the buffers.
    rounds = taken[1:].reshape(_BATCHES, len(scans), -1) / (_COPIES if kernels else 1)
    return {name: rounds[:, :, k] for k, name in enumerate(extractors)}


def time_ratio(seconds: Array, others: Array) -> tuple[float, float, float]:
    """Ratio of two methods' `interleaved_times`: median, least and largest of the rounds."""
    of_rounds = np.median(seconds / others, axis=1)
    return float(np.median(of_rounds)), float(of_rounds.min()), float(of_rounds.max())


def frame_times(extractor: Extractor, scans: Iterable[LaserScan]) -> Array:
    """Measure the time that each scan takes in the kernels [s], the median of rounds, (m,)."""
    return np.median(interleaved_times({"": extractor}, list(scans))[""], axis=0)


def _batch(extractor: Extractor, ranges: Array, like: LaserScan) -> FeatureBatch:
    return extractor.batch(
        ranges,
        angle_min=like.angle_min,
        angle_increment=like.angle_increment,
        range_min=like.range_min,
        range_max=like.range_max,
    )


def recorded_scans(setting: Setting, count: int) -> Iterator[tuple[str, list[LaserScan]]]:
    """Read so many scans of each recording that exists, from equal parts of it."""
    for name, path in setting.recordings(LOGS).items():
        yield name, spread_scans(open_log(path, keep_going=True), count)


def spread_scans(log: Log, count: int) -> list[LaserScan]:
    """Read so many scans of a log, from equal parts of it."""
    step = max(len(log) // count, 1)
    return list(islice(log, step // 2, None, step))[:count]


def scan_pairs(path: str | Path, count: int) -> list[Pair]:
    """Read scans at equal steps of a log, each with the first later one from another place."""
    scans = [scan for scan in open_log(path, keep_going=True) if scan.pose is not None]
    pairs = []
    for i in range(0, len(scans), max(1, len(scans) // count)):
        for other in scans[i + 1 : i + 1 + _SEARCHED]:
            way, turn = _motion(scans[i].pose, other.pose)
            if way >= MOVED or turn >= TURNED:
                pairs.append((scans[i], other))
                break
    return pairs[:count]


def still_pairs(path: str | Path, count: int, *, standing: bool = False) -> list[Pair]:
    """Read pairs of successive scans of one topic from one place, at equal steps of the log.

    Their beams are equal, and their poses, which are not compared if the sensor is `standing`.
    """
    before: dict[str, LaserScan] = {}
    pairs = []
    for topic, scan in open_log(path, keep_going=True).items():
        last = before.get(topic)
        before[topic] = scan
        if last is not None and np.array_equal(last.angles, scan.angles):
            way, turn = _motion(last.pose, scan.pose)
            if standing or (way < _STILL[0] and turn < _STILL[1]):
                pairs.append((last, scan))
    chosen = np.linspace(0, len(pairs) - 1, min(count, len(pairs))).astype(int)
    return [pairs[i] for i in chosen]


def _motion(pose: Pose | None, other: Pose | None) -> tuple[float, float]:
    """Return distance [m] and turn [rad] between two poses, NaN where one is missing."""
    if pose is None or other is None:
        return math.nan, math.nan
    return math.dist(pose[:2], other[:2]), abs(math.remainder(other[2] - pose[2], 2 * math.pi))
