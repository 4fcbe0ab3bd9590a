"""Many scans with the same bearings, a block at a time, over threads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..features import TABLES
from .workspace import Block

__all__ = ["Batch", "block_capacity", "run_batch"]

#: Values in a block: its arrays stay in the cache, and a kernel has so much to do that threads
#: hardly ever wait for each other.
_BLOCK_VALUES = 32768


@dataclass(slots=True)
class Batch:
    """What came of some rows: counts and arrays by row, records by table."""

    counts: NDArray[np.int64]
    clusters: NDArray[np.int32]
    noises: NDArray[np.float64]
    records: dict[str, NDArray[np.void]] = field(default_factory=dict)


def block_capacity(beams: int) -> int:
    """Return how many scans of so many beams go into a block of a batch."""
    return max(1, _BLOCK_VALUES // max(beams, 1))


def run_batch(
    rows: NDArray[np.float64], blocks: Sequence[Block], run: Callable[[Block], None]
) -> Batch:
    """Run a method over rows of ranges, shape (m, n), with a thread for each block."""
    m, n = rows.shape
    batch = Batch(
        np.empty((m, len(TABLES)), np.int64), np.empty((m, n), np.int32), np.empty((m, 4))
    )
    shares = [range(m * k // len(blocks), m * (k + 1) // len(blocks)) for k in range(len(blocks))]

    def run_share(k: int) -> list[list[bytes]]:
        return _run_share(rows, shares[k], blocks[k], run, batch)

    if len(blocks) == 1:
        written = [run_share(0)]
    else:
        with ThreadPoolExecutor(len(blocks)) as pool:
            written = list(pool.map(run_share, range(len(blocks))))
    for k, (name, dtype) in enumerate(TABLES.items()):
        parts = [raw[k] for of_share in written for raw in of_share]
        batch.records[name] = np.frombuffer(b"".join(parts), dtype)
    return batch


def _run_share(
    rows: NDArray[np.float64],
    share: range,
    block: Block,
    run: Callable[[Block], None],
    batch: Batch,
) -> list[list[bytes]]:
    """Run over some of the rows; arrays go to the batch at once, records are handed back."""
    written = []
    own = block.clusters, block.noises
    for start in share[:: block.capacity]:
        part = slice(start, min(start + block.capacity, share.stop))
        block.load(rows[part])
        block.clusters, block.noises = batch.clusters[part], batch.noises[part]
        run(block)
        batch.counts[part] = np.diff(block.offsets[: block.rows + 1], axis=0)
        written.append(block.raw())
    block.clusters, block.noises = own
    return written
