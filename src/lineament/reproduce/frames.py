"""Simulated frames with their truth, and the time that a method takes for a frame."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from ..extractor import Extractor
from ..features import FeatureBatch, Features
from ..scan import Array, LaserScan
from ..simulation import Sensor, scene, truth

__all__ = ["Frame", "batch_of", "frame_times", "scene_numbers", "simulated_frames"]

#: Scenes of one seed; parameters are chosen on one half of them, and reported on the other.
_SCENES = 20_000
#: A frame is timed as a batch of so many copies, so that the kernels are timed and not the call
#: from Python; of so many batches the median is taken.
_COPIES, _BATCHES = 8, 5


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """A simulated scan, and what there is to find in it."""

    scan: LaserScan
    truth: Features


def scene_numbers(count: int, seed: int, *, reported: bool = True) -> range:
    """Seeds of so many scenes: those that are reported, or those that parameters are chosen on.

    Examples
    --------
    >>> scene_numbers(3, 0), scene_numbers(3, 0, reported=False)
    (range(10000, 10003), range(0, 3))
    """
    first = _SCENES * seed + (_SCENES // 2 if reported else 0)
    return range(first, first + count)


def simulated_frames(sensor: Sensor, kinds: Iterable[str], numbers: range) -> Iterator[Frame]:
    """Simulate a frame of each number, in scenes of the kinds in turn.

    Parameters
    ----------
    sensor : Sensor
        The scanner.
    kinds : iterable of str
        Names of `lineament.simulation.SCENES`.
    numbers : range
        Seeds of the scenes and of the noise.

    Examples
    --------
    >>> from lineament.simulation import SCENES, SENSORS
    >>> [len(frame.scan) for frame in simulated_frames(SENSORS["ld19"], SCENES, range(2))]
    [455, 455]
    """
    in_turn = list(kinds)
    for i, number in enumerate(numbers):
        world, pose = scene(in_turn[i % len(in_turn)], number)
        scan = sensor.scan(world, pose, np.random.default_rng([number, 1]))
        yield Frame(scan, truth(world, pose, sensor))


def batch_of(extractor: Extractor, scans: Iterable[LaserScan]) -> list[Features]:
    """Extract scans of one sensor with evenly spaced beams, all at once."""
    rows = list(scans)
    return list(_batch(extractor, np.stack([scan.ranges for scan in rows]), rows[0]))


def frame_times(extractor: Extractor, scans: Iterable[LaserScan]) -> Array:
    """Measure the time that each scan takes in the kernels [s], shape (m,).

    Examples
    --------
    >>> scan = LaserScan([2.0] * 9, angle_min=0.0, angle_increment=0.01)
    >>> frame_times(Extractor("pdbs"), [scan, scan]).shape
    (2,)
    """
    return np.array([_frame_time(extractor, scan) for scan in scans])


def _frame_time(extractor: Extractor, scan: LaserScan) -> float:
    copies = np.tile(scan.ranges, (_COPIES, 1))
    _batch(extractor, copies, scan)  # Compiles, and touches the buffers.
    times = []
    for _ in range(_BATCHES):
        started = time.perf_counter()
        _batch(extractor, copies, scan)
        times.append(time.perf_counter() - started)
    return float(np.median(times)) / _COPIES


def _batch(extractor: Extractor, ranges: Array, like: LaserScan) -> FeatureBatch:
    return extractor.batch(
        ranges,
        angle_min=like.angle_min,
        angle_increment=like.angle_increment,
        range_min=like.range_min,
        range_max=like.range_max,
    )
