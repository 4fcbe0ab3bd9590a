"""Split-and-merge: a cluster split where it is not the line fitted to it, and alike lines merged.

V. Nguyen, S. Gächter, A. Martinelli, N. Tomatis, R. Siegwart, *A comparison of line extraction
algorithms using 2D range data for indoor mobile robotics*, Autonomous Robots 23, 2007. The weights
of the points and the χ² test of the merging follow S. T. Pfister, S. I. Roumeliotis, J. W. Burdick,
*Weighted line fitting algorithms for mobile robot map building and efficient data representation*,
ICRA 2003.
"""

from typing import Any, ClassVar

from lineament.methods.base import MethodBase
from lineament.methods.parameters import method, parameter
from lineament.methods.workspace import Block

from ..kernels.settling import merge_alike
from ..kernels.splitting import split
from .lines import PieceMethod


@method
class SplitAndMerge(PieceMethod):
    """Split-and-merge.

    1. *Cluster* neighbouring points (breakpoint detector of Borges and Aldon).
    2. *Split* each cluster that is not straight: if two neighbouring points lie off the weighted
       line fitted to it, on one side and by more than their tolerances. One alone is an outlier.
       It is split at the point farthest from the chord of its ends, as what is farthest from the
       fitted line may be an end: that of an L is. Then both sides in turn.
    3. *Merge* neighbours whose joint fit costs no more in χ² than chance allows, put
       borders where both lines fit best, and corners where lines meet.

    The tolerance of a point at range ρ is ``threshold + noise_factor σ_r``.
    """

    name = "split_and_merge"
    published: ClassVar[dict[str, Any]] = {
        "clusters": "fixed",
        "threshold": 0.04,
        "noise_factor": 0.0,
        "corner_trim": 0,
    }
    least_response = 1.0

    threshold: float = parameter(0.0, "constant part of the tolerance", low=0, unit="m")
    noise_factor: float = parameter(
        2.0, "part of the tolerance that grows with noise", low=0, unit="σ"
    )
    min_piece: int = parameter(4, "least points of a piece", low=2)

    def __post_init__(self) -> None:
        MethodBase.__post_init__(self)
        if self.threshold == self.noise_factor == 0:
            raise ValueError("threshold and noise_factor are both 0, expected one > 0")

    def find(self, block: Block) -> None:
        """Cluster, split, merge and fit."""
        self.part(block, self.min_points)
        tolerance = self.threshold, 0.0, self.noise_factor
        split(*block.workspace, True, *tolerance, self.min_piece)
        self.finish(block)

    def leave(self, block: Block) -> None:
        """Merge neighbours that one line fits; lines that touch meet in a corner."""
        merge_alike(*block.workspace, self.unevenness)
