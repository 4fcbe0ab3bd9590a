"""What the methods share that find lines in clusters: the clusters before, the settling after."""

import math
from typing import Any, ClassVar, Self

from lineament.kernels import layout as at
from lineament.kernels.breakpoints import BORGES_ALDON, FIXED
from lineament.kernels.budget import LINK, WORST, limit_pieces
from lineament.kernels.line_fit import FITS, TOTAL, WEIGHTED
from lineament.methods.base import MethodBase
from lineament.methods.parameters import MOST_VERTICES, method, parameter
from lineament.methods.workspace import Block, budget_scratch

from ..kernels.settling import settle


@method
class LineMethod(MethodBase):
    """A method that parts a scan at its breakpoints, finds lines, and settles their borders.

    Its preset `paper` is the method as published: its own clusters or none, and no settling but
    what its paper has.
    """

    presets: ClassVar[tuple[str, ...]] = ("paper",)
    #: Parameters of the preset `paper`, where they differ from the defaults.
    published: ClassVar[dict[str, Any]] = {}

    clusters: str = parameter(
        "borges_aldon",
        "how the scan is parted first: by the detector of Borges and Aldon, at a fixed distance, "
        "or not at all",
        choices=("borges_aldon", "fixed", "none"),
    )
    distance: float = parameter(
        0.3, "distance at which `fixed` parts two neighbours", above=0, unit="m"
    )
    settling: bool = parameter(
        True,
        "whether neighbours are merged, their border is where both lines fit best, and "
        "lines meet in corners, for all methods alike; else as published",
    )
    reach: float = parameter(
        6.0, "spacings from the ends of two pieces within which their lines meet in a corner", low=0
    )
    corner_trim: int = parameter(
        1, "measurements next to a corner that the last fits leave out", low=0
    )
    grazing_angle: float = parameter(
        math.radians(6.0),
        "λ of the breakpoint detector (Borges and Aldon, see `PDBS`)",
        above=0,
        below=math.pi / 2,
        unit="rad",
    )
    max_missing: int = parameter(5, "missing beams in a row over which a cluster goes on", low=0)
    max_vertices: int = parameter(
        0,
        "pieces are joined until their polylines have no more vertices; 0: any number",
        low=0,
        below=MOST_VERTICES,
    )

    @classmethod
    def paper(cls, **changes: Any) -> Self:
        """Make the method as published; ``docs/methods.md`` names what the papers leave open."""
        return cls(**{"settling": False, **cls.published, **changes})

    def part(self, block: Block, min_points: int, noise_factor: float = 3.0) -> None:
        """Part the scan into clusters."""
        if self.clusters == "borges_aldon":
            rule, missing = (BORGES_ALDON, noise_factor, self.grazing_angle), self.max_missing
        else:
            distance = self.distance if self.clusters == "fixed" else math.inf
            rule, missing = (FIXED, distance, 0.0), block.beams
        block.part(rule, missing, min_points)

    def settle(self, block: Block, misfit: float) -> None:
        """Settle the borders of the pieces, or leave them as the method's paper does."""
        if self.settling:
            settle(*block.workspace, misfit, self.reach)
        else:
            self.leave(block)

    def leave(self, block: Block) -> None:
        """Leave the lines as they are, without corners."""
        block.work.pieces[at.BEFORE] = -1
        block.work.response[:] = math.nan

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
        0.01, "misfit of walls, by which lines may differ and still be merged", low=0, unit="m"
    )
    min_points: int = parameter(3, "clusters of fewer points are noise", low=2)

    def finish(self, block: Block) -> None:
        """Settle the borders and fit."""
        self.settle(block, self.unevenness)
        self.measure(block, fit=WEIGHTED, trim=self.corner_trim)


@method
class VertexMethod(PieceMethod):
    """A method whose pieces meet at measurements, where its corners are as published."""

    corner: str = parameter(
        "intersection",
        "whether a corner lies where its lines meet, or on its measurement",
        choices=("intersection", "beam"),
    )

    def finish(self, block: Block) -> None:
        """Settle the borders and fit; corners stay on measurements if `corner` says so."""
        if self.corner == "intersection":
            PieceMethod.finish(self, block)
        else:
            self.settle(block, self.unevenness)
            self.measure(block, fit=TOTAL, sharp=False)

    def leave(self, block: Block) -> None:
        """Leave the corners where the pieces meet."""


@method
class NearMethod(LineMethod):
    """A method that looks for points near a line, one line after the other."""

    published: ClassVar[dict[str, Any]] = {
        "clusters": "fixed",
        "epsilon": 0.02,
        "sigmas": 0.0,
        "fit": "total",
    }

    epsilon: float = parameter(
        0.01, "misfit: how far a point may lie from the line without noise", low=0, unit="m"
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
        self.measure(block, fit=FITS[self.fit], trim=self.corner_trim)
