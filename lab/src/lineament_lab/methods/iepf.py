"""Iterative end point fit: a cluster split at the point farthest from its chord, and again.

U. Ramer, *An iterative procedure for the polygonal approximation of plane curves*, Computer
Graphics and Image Processing 1, 1972; R. O. Duda, P. E. Hart, *Pattern Classification and Scene
Analysis*, Wiley 1973. The tolerance that grows with range, and the merging that a joint fit
verifies, are those of M. Przybyła, *Detection and tracking of 2D geometric obstacles from LRF
data*, RoMoCo 2017.
"""

from typing import Any, ClassVar

from lineament.methods.base import MethodBase
from lineament.methods.parameters import method, parameter
from lineament.methods.workspace import Block

from ..kernels.splitting import split
from .lines import VertexMethod


@method
class IEPF(VertexMethod):
    """Iterative end point fit.

    1. *Cluster* neighbouring points (breakpoint detector of Borges and Aldon).
    2. *Split* each cluster at the point farthest from the chord of its ends if that distance is
       above its tolerance; then both sides in turn.
    3. *Merge* neighbours that one line fits as well, put borders where both lines fit best,
       and corners where lines meet.

    The tolerance of a point at range ρ is ``threshold + proportion ρ + noise_factor σ_r``. The
    preset `paper` is the method as published: step 2 alone, of the whole scan, with a fixed
    tolerance; corners on measurements.
    """

    name = "iepf"
    published: ClassVar[dict[str, Any]] = {
        "clusters": "none",
        "threshold": 0.15,
        "proportion": 0.0,
        "noise_factor": 0.0,
        "corner": "beam",
    }
    least_response = 1.0

    threshold: float = parameter(0.0, "constant part of the tolerance", low=0, unit="m")
    proportion: float = parameter(
        0.002, "part of the tolerance that grows with range (Przybyła)", low=0, unit="m/m"
    )
    noise_factor: float = parameter(
        4.0, "part of the tolerance that grows with noise", low=0, unit="σ"
    )
    min_piece: int = parameter(4, "least points of a piece", low=2)

    def __post_init__(self) -> None:
        MethodBase.__post_init__(self)
        if self.threshold == self.proportion == self.noise_factor == 0:
            raise ValueError("threshold, proportion and noise_factor are all 0, expected one > 0")

    def find(self, block: Block) -> None:
        """Cluster, split, merge and fit."""
        self.part(block, self.min_points)
        tolerance = self.threshold, self.proportion, self.noise_factor
        split(*block.workspace, False, *tolerance, self.min_piece)
        self.finish(block)
