"""What the methods share that find lines in clusters: the clusters before, the settling after."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..kernels.budget import LINK, WORST, limit_pieces
from ..kernels.line_fit import FITS, WEIGHTED
from ..kernels.rivals.settling import settle
from .base import MethodBase
from .parameters import documented, parameter
from .steps import budget_scratch, measure, part
from .workspace import Block

__all__ = ["LineMethod", "NearMethod", "PieceMethod"]


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

    def _measure(
        self, block: Block, row: int, *, fit: int, sharp: bool = True, trim: int = 0
    ) -> None:
        """Keep within the budget of vertices, and measure."""
        if self.max_vertices:
            costs, follow = budget_scratch(block.beams, self.max_vertices)
            budget = follow.shape[1] - 1
            limit_pieces(
                block.floats, block.ints, block.bearings, budget, LINK, WORST, costs, follow
            )
        gap = self.max_missing + 1.0
        measure(block, row, fit=fit, sharp=sharp, trim=trim, reach=self.reach, gap=gap)


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class PieceMethod(LineMethod):
    """A method that cuts or grows along clusters, and merges what one line fits."""

    unevenness: float = parameter(
        0.01, "misfit of walls, by which lines may differ and still be merged [m]", low=0
    )
    corner_trim: int = parameter(
        1, "measurements next to a corner that the last fits leave out", low=0
    )
    min_points: int = parameter(3, "clusters of fewer points are noise", low=2)

    def _finish(self, block: Block, row: int) -> None:
        """Settle the borders and fit."""
        self._settle(block, row, self.unevenness)
        self._measure(block, row, fit=WEIGHTED, trim=self.corner_trim)


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class NearMethod(LineMethod):
    """A method that looks for points near a line, one line after the other."""

    epsilon: float = parameter(
        0.01, "misfit: how far a point may lie from the line without noise [m]", low=0
    )
    sigmas: float = parameter(
        2.5, "standard deviations of its range noise that a point may lie off besides", low=0
    )
    fit: str = parameter("weighted", "how the final lines are fitted", choices=FITS)
    noise_factor: float = parameter(
        3.0, "standard deviations of the breakpoint detector, see `PDBS`", low=0
    )

    def _finish(self, block: Block, row: int) -> None:
        """Settle the borders and fit."""
        self._settle(block, row, self.epsilon)
        self._measure(block, row, fit=FITS[self.fit])
