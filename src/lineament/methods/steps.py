"""Steps that the methods share: the noise before everything else, the measuring after it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kernels.budget import LINK, WORST, limit_pieces
from ..kernels.layout import RANGE
from ..kernels.line_fit import TOTAL
from ..kernels.measuring import measure as _measure
from ..kernels.noise import estimate_noise as _estimate_noise
from .workspace import Block

__all__ = ["budget_scratch", "estimate_noise", "limit_vertices", "measure"]


def estimate_noise(block: Block, row: int) -> None:
    """Fill the noise of the scan in a block's workspace: that given, or estimated from it."""
    _estimate_noise(block.floats, block.range_min, block.range_max, block.noise, block.noises[row])


def measure(
    block: Block,
    row: int,
    *,
    source: int = RANGE,
    fit: int = TOTAL,
    sharp: bool = True,
    trim: int = 0,
    reach: float = 3.0,
    gap: float = 6.0,
) -> None:
    """Fit the pieces of the scan in a block's workspace, and write its features.

    Parameters
    ----------
    block : Block
        Whose points are listed and whose classes are cut into pieces (see `kernels.layout`).
    row : int
        Which of the block's scans it is; they are measured in order.
    source, fit, sharp, trim, reach, gap
        As in `kernels.measuring.measure`.
    """
    _measure(
        block.floats,
        block.ints,
        block.counts,
        row,
        source,
        block.bearings,
        block.circular,
        block.noises[row],
        fit,
        sharp,
        trim,
        reach,
        gap,
        block.segments,
        block.corners,
        block.breakpoints,
        block.clusters,
        block.offsets,
    )


def limit_vertices(block: Block, max_vertices: int) -> None:
    """Join or leave out pieces until they have no more vertices than allowed; 0 allows any number.

    Parameters
    ----------
    block : Block
        In whose workspace the classes of a scan are cut into pieces.
    max_vertices : int
        As in `kernels.budget.limit_pieces`.
    """
    if max_vertices:
        costs, follow = budget_scratch(block.beams, max_vertices)
        limit_pieces(
            block.floats, block.ints, block.counts, block.bearings,
            len(follow[0]) - 1, LINK, WORST, costs, follow,
        )  # fmt: skip


def budget_scratch(beams: int, max_vertices: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Make the tables of `kernels.budget.limit_pieces`; no scan needs 2 (n + 1) vertices."""
    shape = (beams + 2, min(max_vertices, 2 * beams + 2) + 1)
    return np.empty((2, *shape)), np.empty(shape, np.int64)
