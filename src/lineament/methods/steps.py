"""Steps that methods share: the noise first; clusters; at the end the measuring."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kernels.layout import RANGE
from ..kernels.line_fit import TOTAL
from ..kernels.measuring import measure as _measure
from ..kernels.noise import estimate_noise as _estimate_noise
from ..kernels.rivals.pdbs import BORGES_ALDON, part_by_distance
from .workspace import Block

__all__ = ["budget_scratch", "estimate_noise", "measure", "part"]


def estimate_noise(block: Block, row: int) -> None:
    """Fill the noise of the scan in a block's workspace: that given, or estimated from it."""
    _estimate_noise(block.floats, block.range_min, block.range_max, block.noise, block.noises[row])


def part(
    block: Block,
    row: int,
    *,
    rule: int = BORGES_ALDON,
    constant: float = 3.0,
    angle: float,
    max_missing: int,
    min_points: int,
) -> None:
    """Part scan `row` of a block, which is in its workspace, into clusters.

    Parameters are those of `kernels.rivals.pdbs.part_by_distance`; by default the breakpoint
    detector of Borges and Aldon, with the angle λ and three standard deviations.
    """
    part_by_distance(
        block.floats, block.ints, block.bearings, block.sensor, block.noises[row],
        (rule, constant, angle), max_missing, min_points,
    )  # fmt: skip


def budget_scratch(beams: int, max_vertices: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Make the tables of `kernels.budget.limit_pieces`; no scan needs 2 (n + 1) vertices."""
    shape = (beams + 2, min(max_vertices, 2 * beams + 2) + 1)
    return np.empty((2, *shape)), np.empty(shape, np.int64)


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
    """Fit the pieces of scan `row` of a block, which is in its workspace; write its features.

    Scans are measured in order. Parameters are those of `kernels.measuring.Options`.
    """
    _measure(
        block.floats, block.ints, row, block.bearings, block.circular, block.noises[row],
        (source, fit, sharp, trim, reach, gap), block.tables,
    )  # fmt: skip
