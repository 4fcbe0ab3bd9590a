"""What the methods share that find lines in clusters: the clusters before, the settling after."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..kernels.rivals.settling import settle
from .base import MethodBase
from .parameters import documented, parameter
from .steps import limit_vertices, measure, part
from .workspace import Block

__all__ = ["LineMethod"]


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class LineMethod(MethodBase):
    """A method that parts a scan at its breakpoints, finds lines, and settles their borders."""

    reach: float = parameter(
        6.0, "spacings from the ends of two pieces within which their lines meet in a corner", low=0
    )
    grazing_angle: float = parameter(
        math.radians(6.0),
        "λ of the breakpoint detector (Borges and Aldon, see `PDBS`) [rad]",
        above=0,
        below=math.pi / 2,
    )
    max_missing: int = parameter(5, "missing beams in a row over which a cluster goes on", low=0)
    max_vertices: int = parameter(
        0, "pieces are joined until their polylines have no more vertices; 0: any number", low=0
    )

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

    def _settle(self, block: Block, row: int, misfit: float) -> None:
        """Merge the pieces that one line fits, settle their borders, and join them at corners."""
        settle(block.floats, block.ints, block.noises[row], misfit, self.reach)

    def _finish(
        self, block: Block, row: int, *, fit: int, sharp: bool = True, trim: int = 0
    ) -> None:
        """Keep within the budget of vertices, and measure."""
        limit_vertices(block, self.max_vertices)
        gap = self.max_missing + 1.0
        measure(block, row, fit=fit, sharp=sharp, trim=trim, reach=self.reach, gap=gap)
