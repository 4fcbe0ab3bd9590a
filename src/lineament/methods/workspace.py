"""`Block`: some scans with the same bearings on their way through a method's kernels."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from ..features import TABLES
from ..features.records import words
from ..kernels import bind
from ..kernels import layout as at
from ..kernels.breakpoints import part_by_distance
from ..kernels.line_fit import TOTAL
from ..kernels.measuring import measure
from ..kernels.noise import estimate_noise
from ..kernels.units import find_farthest
from ..scan import LaserScan
from ..scan.units import CODES, FAR

Array = NDArray[np.float64]

#: Values in a block of a batch: its arrays stay in the cache, and a kernel has so much to do that
#: threads hardly ever wait for each other.
_BLOCK_VALUES = 32768


class Block:
    """What goes into the kernels and comes out of them, for up to `capacity` scans.

    A method's ``run`` reads the ranges, the bearings and `noise`, and fills `noises` and the tables
    scan after scan. `floats` and `ints` are the workspace of one scan, `work` its parts by name,
    see `kernels.layout`; `own` is what the method needs besides. All is kept from call to call.

    Parameters
    ----------
    frame : LaserScan
        Any scan with the bearings and range limits of those to come.
    noise : float64 array, shape (5,)
        Noise of the sensor as a row, NaN where it is to be estimated.
    capacity : int
        Scans that have room.
    own : object
        The method's own arrays.
    """

    def __init__(self, frame: LaserScan, noise: Array, capacity: int, own: Any = None) -> None:
        n = len(frame)
        self.frame, self.capacity, self.beams = frame, capacity, n
        self.row = 0
        #: How many scans it has, and the same where kernels read it.
        self.rows, self.extent = 0, np.zeros(1, np.int64)
        self.bearings = np.stack((np.cos(frame.angles), np.sin(frame.angles)))
        self.step, self.circular = frame.angle_increment, frame.is_full_circle
        self.range_min, self.range_max = frame.range_min, frame.range_max
        self.sensor = self.range_min, self.range_max, self.step, self.circular
        self.noise, self.own = noise, own
        self.noises = np.empty((capacity, 5))
        self.ranges = np.empty((capacity, n))
        #: Of each scan the largest range below the limit, and how many equal it, where that is far.
        self.farthest = np.zeros((capacity, 2))
        limit = min(self.range_max, CODES)
        self._find_farthest: Callable[[], Any] | None = None
        if limit > FAR:
            farthest = bind(find_farthest, self.ranges, self.extent, limit, self.farthest)
            self._find_farthest = farthest
        self.floats, self.ints = at.workspace(n)
        self.work = at.named(self.floats, self.ints)
        self.counts = self.work.counts
        # Zeros, as the padding between fields is written out too. No scan has more than n + 1.
        records = [np.zeros(capacity * (n + 1), dtype) for dtype in TABLES.values()]
        self.features = tuple(map(words, records))
        self._bytes = [
            (memoryview(table.view(np.uint8)), table.itemsize)  # type: ignore[arg-type]
            for table in records
        ]
        self.clusters = np.empty((capacity, n), np.int32)
        self.offsets = np.zeros((capacity + 1, len(TABLES)), np.int64)
        #: What runs all kernels over it, of a method that has one for them; its arrays stay.
        self.call: Callable[[], Any] | None = None

    def fits(self, scan: LaserScan) -> bool:
        """Whether a scan has the bearings and range limits that the block was made for."""
        frame = self.frame
        if scan.range_min != frame.range_min or scan.range_max != frame.range_max:
            return False
        if scan.is_regular and frame.is_regular:
            return (
                len(scan.ranges) == self.beams
                and scan.angle_min == frame.angle_min
                and scan.angle_increment == frame.angle_increment
            )
        return np.array_equal(scan.angles, frame.angles)

    def load(self, ranges: Array) -> None:
        """Take in the ranges of some scans, shape (m, n), or of one, shape (n,)."""
        self.rows = self.extent[0] = rows = 1 if ranges.ndim == 1 else len(ranges)
        self.ranges[:rows] = ranges

    def take(self, row: int) -> None:
        """Put a scan, and its noise, into the workspace, for kernels that are called one by one."""
        self.row = row
        self.work.beams[at.RANGE, : self.beams] = self.ranges[row]
        limits = self.range_min, self.range_max
        floats, ints, noise = self.workspace
        estimate_noise(floats, ints, self.bearings, *limits, self.noise, noise)

    def scan(self) -> LaserScan:
        """Return the scan that was taken, without its stamp and pose: a batch has none here."""
        frame = self.frame
        limits: dict[str, Any] = {"range_min": self.range_min, "range_max": self.range_max}
        ranges = self.ranges[self.row]
        if frame.is_regular:
            return LaserScan(ranges, frame.angle_min, frame.angle_increment, **limits)
        return LaserScan(ranges, angles=frame.angles, **limits)

    @property
    def workspace(self) -> tuple[Array, NDArray[np.int64], Array]:
        """Workspace and noise of the scan that was taken, as kernels are given them."""
        return self.floats, self.ints, self.noises[self.row]

    def part(self, rule: tuple[int, float, float], max_missing: int, min_points: int) -> None:
        """Part the scan that was taken into clusters, see `kernels.breakpoints`."""
        floats, ints, noise = self.workspace
        limits = max_missing, min_points
        part_by_distance(floats, ints, self.bearings, self.sensor, noise, rule, *limits)

    def measure(
        self,
        *,
        source: int = at.RANGE,
        fit: int = TOTAL,
        sharp: bool = True,
        trim: int = 0,
        reach: float = 3.0,
        gap: float = 6.0,
    ) -> None:
        """Fit the pieces of the scan that was taken, and write its features.

        Scans are measured in order. Parameters are those of `kernels.measuring.Options`.
        """
        floats, ints, noise = self.workspace
        options = source, fit, sharp, trim, reach, gap
        measure(floats, ints, self.row, self.bearings, self.circular, noise, options, self.tables)

    @property
    def tables(self) -> tuple[NDArray[Any], ...]:
        """Results of the kernels, as in `kernels.layout.Tables`."""
        return *self.features, self.clusters, self.offsets

    def raw(self) -> list[bytes]:
        """Copy the records that the last run wrote, as bytes, in the order of the tables."""
        counts = self.offsets[self.rows].tolist()
        # Numpy would copy records field by field, several times slower, and not their padding.
        return [
            bytes(table[: count * size])
            for (table, size), count in zip(self._bytes, counts, strict=True)
        ]

    def found(self) -> list[bytes]:
        """Copy what the last run found in one scan: the tables, its clusters and its noise."""
        return [*self.raw(), self.clusters.tobytes(), self.noises.tobytes()]

    def find_farthest(self) -> Array:
        """Return, of each scan, the largest range and how many equal it; 0 where none is far."""
        if self._find_farthest is not None:
            self._find_farthest()
        return self.farthest[: self.rows]

    def written(self) -> list[NDArray[np.void]]:
        """Copy the records that the last run wrote, in the order of the tables."""
        return [
            np.frombuffer(raw, dtype)
            for raw, dtype in zip(self.raw(), TABLES.values(), strict=True)
        ]


class Blocks(list[Block]):
    """Blocks that no call uses: each call takes one out, and puts it back if it ends well.

    Threads, signal handlers and whatever else calls meanwhile find others, or none. Views of a
    block are not views of its copy: a copy of these has no blocks.
    """

    def __reduce__(self) -> tuple[type[Self], tuple[()]]:
        return type(self), ()

    def take(self, frame: LaserScan) -> Block | None:
        """Take out a block that fits; those that do not are dropped."""
        try:
            while not (block := self.pop()).fits(frame):
                pass
        except IndexError:
            return None
        return block


def budget_scratch(beams: int, max_vertices: int) -> tuple[Array, NDArray[np.int64]]:
    """Make the tables of `kernels.budget.limit_pieces`; no scan needs 2 (n + 1) vertices."""
    shape = (beams + 2, min(max_vertices, 2 * beams + 2) + 1)
    return np.empty((2, *shape)), np.empty(shape, np.int64)


class Batch(NamedTuple):
    """What came of some rows: counts and arrays by row, records by table."""

    counts: NDArray[np.int64]
    clusters: NDArray[np.int32]
    noises: Array
    farthest: Array
    records: dict[str, NDArray[np.void]]


def block_capacity(beams: int) -> int:
    """Return how many scans of so many beams go into a block of a batch."""
    return max(1, _BLOCK_VALUES // max(beams, 1))


def run_batch(rows: Array, blocks: Sequence[Block], run: Callable[[Block], None]) -> Batch:
    """Run a method over rows of ranges, shape (m, n), with a thread for each block."""
    m, n = rows.shape
    counts, clusters = np.empty((m, len(TABLES)), np.int64), np.empty((m, n), np.int32)
    batch = Batch(counts, clusters, np.empty((m, 5)), np.empty((m, 2)), {})

    def run_share(k: int) -> list[list[bytes]]:
        """Run over some of the rows; arrays go to the batch at once, records are returned."""
        block, written = blocks[k], []
        share = range(m * k // len(blocks), m * (k + 1) // len(blocks))
        for start in share[:: block.capacity]:
            part = slice(start, min(start + block.capacity, share.stop))
            block.load(rows[part])
            run(block)
            count = block.rows
            batch.clusters[part], batch.noises[part] = block.clusters[:count], block.noises[:count]
            batch.farthest[part] = block.find_farthest()
            batch.counts[part] = np.diff(block.offsets[: count + 1], axis=0)
            written.append(block.raw())
        return written

    if len(blocks) == 1:
        written = run_share(0)
    else:
        with ThreadPoolExecutor(len(blocks)) as pool:
            written = list(chain(*pool.map(run_share, range(len(blocks)))))
    for k, (name, dtype) in enumerate(TABLES.items()):
        batch.records[name] = np.frombuffer(b"".join(raw[k] for raw in written), dtype)
    return batch
