"""`Extractor`: a method with its tables and buffers, over one scan or many."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sized
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .features import TABLES, FeatureBatch, Features, noise_row
from .features.records import BREAKPOINTS, SEGMENTS
from .methods import DEFAULT_METHOD, Method, get_method
from .methods.trace import Trace
from .methods.workspace import Block, Blocks, block_capacity, run_batch
from .progress import compiling
from .scan import LaserScan, NoiseLike, RangeNoise
from .scan.fields import is_whole, numbers
from .scan.laser_scan import FIELDS, no_scan, scan_of
from .scan.units import FAR, FEW, warn_of_units, warn_of_whole_numbers

__all__ = ["WALL", "Extractor", "extract", "load_kernels", "trace"]

_BEARINGS = np.linspace(-1.0, 1.0, 101)
#: What kernels are loaded with, all of them: the first scan need not wait, whatever its limits.
WALL = LaserScan(2.0 / np.cos(_BEARINGS), angles=_BEARINGS)


class Extractor:
    """Extracts the features of scans by one method.

    It keeps the tables of the last bearings and its buffers from scan to scan, so that a scan
    costs microseconds. Any number of threads may share an extractor: calls at the same time have
    different buffers. A copy, also one that was pickled for another process, has none yet.

    Parameters
    ----------
    method : str, callable or Method
        Name of a method (``"liu"``, ``"liu:paper"``, ``"my.py:find"``), one of `lineament.methods`,
        or a function from a scan to segments, see `lineament.methods.functions`.
    noise : RangeNoise or float, optional
        Noise of the sensor, or its sigma [m]; estimated from each scan if it is not given.
    **parameters
        Parameters of the method that differ from its defaults.

    Raises
    ------
    ValueError
        If the method or a parameter is unknown or out of bounds.

    Examples
    --------
    >>> extractor = Extractor("liu", support_radius=5, noise=0.01)
    >>> bearings = np.linspace(-0.5, 0.5, 101)
    >>> wall = extractor(LaserScan(2.0 / np.cos(bearings), angles=bearings))
    >>> wall.segments["start"].round(3).tolist(), wall.segments["end"].round(3).tolist()
    ([[2.0, -1.093]], [[2.0, 1.093]])
    """

    def __init__(
        self,
        method: str | Method | Callable[[LaserScan], Any] = DEFAULT_METHOD,
        *,
        noise: NoiseLike | None = None,
        **parameters: Any,
    ) -> None:
        self._method = _method_of(method, parameters)
        self._noise = None if noise is None else RangeNoise.of(noise)
        self._noise_row = noise_row(self._noise)
        #: For calls with a scan, and for batches.
        self._blocks, self._workers = Blocks(), Blocks()
        #: That of the method, once its kernels are compiled.
        self._run: Callable[[Block], None] | None = None

    @property
    def method(self) -> Method:
        """The method, with its parameters."""
        return self._method

    @property
    def noise(self) -> RangeNoise | None:
        """Noise of the sensor; None if it is estimated from each scan."""
        return self._noise

    def __repr__(self) -> str:
        return f"Extractor({self.method!r}, noise={self.noise!r})"

    def __call__(self, scan: LaserScan) -> Features:
        """Extract the features of one scan; a TypeError if it is something else.

        Ranges that can hardly be metres are a `LineamentWarning`.
        """
        if not isinstance(scan, LaserScan):
            raise no_scan(scan)
        block = self._blocks.take(scan) or self._new_block(scan, 1)
        block.load(scan.ranges)
        (self._run or self._first_run)(block)
        found, largest, equal = block.found(), 0.0, 0.0
        if scan.range_max > FAR:
            ((largest, equal),) = block.find_farthest().tolist()
        self._blocks.append(block)
        is_empty = not (found[SEGMENTS] or found[BREAKPOINTS])
        if is_empty or equal > FEW or largest > FAR:
            warn_of_units(scan.ranges, scan, is_empty, largest, equal)
        return Features.as_written(found, self._noise, scan)

    def batch(
        self,
        ranges: ArrayLike,
        *,
        angle_min: float | None = None,
        angle_increment: float | None = None,
        angles: ArrayLike | None = None,
        range_min: float = 0.0,
        range_max: float = math.inf,
        stamps: ArrayLike | None = None,
        frame_id: str = "",
        scale: float = 1.0,
        workers: int = 1,
    ) -> FeatureBatch:
        """Extract the features of many scans with the same bearings.

        As in `LaserScan`, beams that are given clockwise are reversed.

        Parameters
        ----------
        ranges : array_like, shape (m, n)
            One scan a row [m].
        angle_min, angle_increment, angles, range_min, range_max, frame_id, scale
            As in `LaserScan`, for all rows.
        stamps : array_like, shape (m,), optional
            Stamp of each row [s]; 0 if not given.
        workers : int
            Threads; the result does not depend on their number.

        Returns
        -------
        FeatureBatch
            ``batch[i]`` equals the features of row i alone.

        Raises
        ------
        ValueError
            If a field makes no sense. The message names it and its value.
        """
        rows = _matrix(ranges)
        m, n = rows.shape
        if not is_whole(workers) or workers < 1:
            raise ValueError(f"workers is {workers!r}, expected a whole number ≥ 1")
        times = np.zeros(m) if stamps is None else np.array(numbers("stamps", stamps))
        if times.shape != (m,):
            raise ValueError(f"stamps has shape {times.shape}, expected ({m},), one for each row")
        if not np.isfinite(times).all():
            raise ValueError("stamps have one that is not finite, expected numbers [s]")
        frame = LaserScan(
            np.zeros(n),
            angle_min,
            angle_increment,
            angles=angles,
            range_min=range_min,
            range_max=range_max,
            frame_id=frame_id,
            scale=scale,
        )
        capacity = block_capacity(n)
        # New memory costs more to touch than to fill, above all from several threads at once.
        blocks = [
            self._workers.take(frame) or self._new_block(frame, capacity)
            for _ in range(max(1, min(workers, m)))
        ]
        if frame.stamp_beam:  # It was taken first, as the last: they are given clockwise.
            rows = rows[:, ::-1]
        if scale != 1:
            rows = scale * rows
        else:
            warn_of_whole_numbers(ranges)
        found = run_batch(rows, blocks, self._run or self._first_run)
        self._workers.extend(blocks)
        offsets = np.zeros(m + 1, [(name, np.int64) for name in TABLES])
        for k, name in enumerate(TABLES):
            np.cumsum(found.counts[:, k], out=offsets[name][1:])
        is_empty = found.counts.sum(axis=1) == 0
        doubtful = np.flatnonzero(is_empty | (found.farthest > (FAR, FEW)).any(axis=1))
        any(warn_of_units(rows[i], frame, is_empty[i], *found.farthest[i]) for i in doubtful)
        return FeatureBatch(
            **found.records,
            clusters=found.clusters,
            offsets=offsets,
            stamps=times,
            noises=found.noises,
            frame_id=frame.frame_id,
        )

    def trace(self, scan: LaserScan) -> Trace:
        """Extract the features of one scan and keep every intermediate of the run."""
        return self._method.trace(scan, self(scan), self._noise_row)

    def _first_run(self, block: Block) -> None:
        with compiling():
            self._method.run(block)
        self._run = self._method.run

    def _new_block(self, frame: LaserScan, capacity: int) -> Block:
        return Block(frame, self._noise_row, capacity, self._method.own_arrays(len(frame)))


def _method_of(method: Any, parameters: dict[str, Any]) -> Method:
    """Return the method of a name, a class or a function, or as it was made."""
    if isinstance(method, type):
        method = method(**parameters)
    elif not callable(method) and not hasattr(method, "run"):
        return get_method(method, **parameters)
    elif parameters:
        raise ValueError("parameters are given together with a method that was made before")
    if hasattr(method, "run"):
        return cast(Method, method)
    from .methods.functions import as_method

    return as_method(method)


def extract(
    scan: LaserScan | ArrayLike,
    *,
    method: str | Method | Callable[[LaserScan], Any] = DEFAULT_METHOD,
    noise: NoiseLike | None = None,
    angle_min: float | None = None,
    angle_increment: float | None = None,
    angles: ArrayLike | None = None,
    range_min: float = 0.0,
    range_max: float = math.inf,
    scale: float = 1.0,
    **parameters: Any,
) -> Features:
    """Extract the features of one scan; for many, keep an `Extractor`.

    Parameters
    ----------
    scan : LaserScan, or array_like, shape (n,)
        The scan, or its ranges [m].
    method, noise, **parameters
        As in `Extractor`.
    angle_min, angle_increment, angles, range_min, range_max, scale
        As in `LaserScan`; for ranges, not for a scan, which has them. So are its other fields,
        ``stamp`` or ``frame_id``.

    Raises
    ------
    TypeError
        If it is something else than a scan or ranges. The message says what to pass.
    ValueError
        If a field of the scan, the method or a parameter makes no sense.

    Warns
    -----
    LineamentWarning
        If the ranges can hardly be metres.

    Examples
    --------
    >>> extract([2.0, 2.0, 2.0], angle_min=-0.01, angle_increment=0.01, method="liu", min_points=4)
    Features(0 segments, 0 corners, 0 edges, 0 arcs, 0 breakpoints, 0 clusters, stamp=0.000)
    """
    bearings, limits = (angle_min, angle_increment, angles), (range_min, range_max, scale)
    fields = {name: parameters.pop(name) for name in FIELDS if name in parameters}
    extractor = Extractor(method, noise=noise, **parameters)
    return extractor(scan_of(scan, bearings, limits, fields))


def trace(
    scan: LaserScan | ArrayLike,
    *,
    method: str | Method | Callable[[LaserScan], Any] = DEFAULT_METHOD,
    noise: NoiseLike | None = None,
    angle_min: float | None = None,
    angle_increment: float | None = None,
    angles: ArrayLike | None = None,
    range_min: float = 0.0,
    range_max: float = math.inf,
    scale: float = 1.0,
    **parameters: Any,
) -> Trace:
    """Extract the features of one scan and keep every intermediate.

    It answers why a line is missing. Parameters are those of `extract`.

    Examples
    --------
    >>> trace([2.0, 2.0, 2.0], angle_min=-0.01, angle_increment=0.01).spacing.round(2).tolist()
    [nan, 0.02, 0.02]
    """
    bearings, limits = (angle_min, angle_increment, angles), (range_min, range_max, scale)
    fields = {name: parameters.pop(name) for name in FIELDS if name in parameters}
    extractor = Extractor(method, noise=noise, **parameters)
    return extractor.trace(scan_of(scan, bearings, limits, fields))


def load_kernels(extractors: Iterable[Extractor]) -> None:
    """Run some extractors once, so that no scan waits for what the first one needs."""
    with compiling():
        for extractor in extractors:
            extractor(WALL)


def _matrix(ranges: ArrayLike) -> NDArray[np.float64]:
    first = ranges[0] if isinstance(ranges, list | tuple) and ranges else ranges
    if isinstance(first, LaserScan):
        raise TypeError(
            "batch takes no LaserScan, expected a matrix of ranges, one scan a row, with "
            "angle_min=... and angle_increment=...; an extractor itself takes a scan"
        )
    try:
        rows = numbers("ranges", ranges)
    except ValueError:
        rows_given = ranges if isinstance(ranges, list | tuple) else []
        sizes = [len(row) if isinstance(row, Sized) else 0 for row in rows_given]
        other = next((i for i, size in enumerate(sizes) if size != sizes[0]), None)
        if other is None:
            raise
        raise ValueError(
            f"ranges has {sizes[0]} in row 0 and {sizes[other]} in row {other}, "
            "expected as many in each: scans of one scanner"
        ) from None
    if rows.ndim != 2:
        raise ValueError(f"ranges has shape {rows.shape}, expected (m, n): one scan a row")
    return rows
