"""What the methods share that find lines in clusters: the clusters before, the settling after."""

import math

from ..kernels.budget import LINK, WORST, limit_pieces
from ..kernels.line_fit import FITS, WEIGHTED
from ..kernels.rivals.settling import settle
from .base import MethodBase
from .parameters import method, parameter
from .workspace import Block, budget_scratch


@method
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

    def part(self, block: Block, min_points: int, noise_factor: float = 3.0) -> None:
        """Part the scan into clusters."""
        block.part(
            constant=noise_factor,
            angle=self.grazing_angle,
            max_missing=self.max_missing,
            min_points=min_points,
        )

    def settle(self, block: Block, misfit: float) -> None:
        """Merge the pieces that one line fits, settle their borders, and join them at corners."""
        settle(*block.workspace, misfit, self.reach)

    def measure(self, block: Block, *, fit: int, sharp: bool = True, trim: int = 0) -> None:
        """Keep within the budget of vertices, and measure."""
        if self.max_vertices:
            costs, follow = budget_scratch(block.beams, self.max_vertices)
            limits = follow.shape[1] - 1, LINK, WORST
            limit_pieces(block.floats, block.ints, block.bearings, *limits, costs, follow)
        gap = self.max_missing + 1.0
        block.measure(fit=fit, sharp=sharp, trim=trim, reach=self.reach, gap=gap)


@method
class PieceMethod(LineMethod):
    """A method that cuts or grows along clusters, and merges what one line fits."""

    unevenness: float = parameter(
        0.01, "misfit of walls, by which lines may differ and still be merged [m]", low=0
    )
    corner_trim: int = parameter(
        1, "measurements next to a corner that the last fits leave out", low=0
    )
    min_points: int = parameter(3, "clusters of fewer points are noise", low=2)

    def finish(self, block: Block) -> None:
        """Settle the borders and fit."""
        self.settle(block, self.unevenness)
        self.measure(block, fit=WEIGHTED, trim=self.corner_trim)


@method
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

    def finish(self, block: Block) -> None:
        """Settle the borders and fit."""
        self.settle(block, self.epsilon)
        self.measure(block, fit=FITS[self.fit])
