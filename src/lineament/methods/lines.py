"""What the methods share that find lines in clusters: the clusters before, the settling after."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..kernels.rivals.settling import settle
from .base import MethodBase
from .checks import check_count, check_number
from .pdbs import check_acute, part
from .steps import limit_vertices, measure
from .workspace import Block

__all__ = ["LineMethod"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LineMethod(MethodBase):
    """A method that parts a scan at its breakpoints, finds lines, and settles their borders.

    Parameters
    ----------
    reach : float
        How many spacings the lines of two neighbouring pieces may meet from the ends of both:
        farther off there is no corner.
    grazing_angle : float
        λ of the breakpoint detector that parts the scan into clusters (Borges and Aldon, see
        `PDBS`), in 0..π/2 [rad].
    max_missing : int
        Missing beams in a row over which a cluster goes on.
    max_vertices : int
        Pieces are joined until their polylines have no more vertices; 0 allows any number.
    """

    reach: float = 6.0
    grazing_angle: float = math.radians(6.0)
    max_missing: int = 5
    max_vertices: int = 0

    def _check_shared(self) -> None:
        """Check the parameters that all have, and settle the types of all."""
        check_number("reach", self.reach, or_equal=True)
        check_acute("grazing_angle", self.grazing_angle)
        check_count("max_missing", self.max_missing, least=0)
        check_count("max_vertices", self.max_vertices, least=0)
        self._settle_types()

    def _part(self, block: Block, row: int, min_points: int, noise_factor: float = 3.0) -> None:
        """Part the scan into clusters."""
        part(
            block,
            row,
            constant=noise_factor,
            angle=self.grazing_angle,
            max_missing=self.max_missing,
            min_points=min_points,
        )

    def _settle_borders(
        self, block: Block, row: int, unevenness: float, moments: NDArray[np.float64]
    ) -> None:
        """Merge the pieces that one line fits, settle their borders, and join them at corners."""
        settle(
            block.floats,
            block.ints,
            block.counts,
            block.noises[row],
            unevenness,
            self.reach,
            moments,
        )

    def _finish(
        self, block: Block, row: int, *, fit: int, sharp: bool = True, trim: int = 0
    ) -> None:
        """Keep within the budget of vertices, and measure."""
        limit_vertices(block, self.max_vertices)
        measure(
            block,
            row,
            fit=fit,
            sharp=sharp,
            trim=trim,
            reach=self.reach,
            gap=self.max_missing + 1.0,
        )
