"""Iterative end point fit: a cluster split at the point farthest from its chord, and again.

U. Ramer, *An iterative procedure for the polygonal approximation of plane curves*, Computer
Graphics and Image Processing 1, 1972; R. O. Duda, P. E. Hart, *Pattern Classification and Scene
Analysis*, Wiley 1973. The tolerance that grows with range, and the merging that a joint fit
verifies, are those of M. Przybyła, *Detection and tracking of 2D geometric obstacles from LRF
data*, RoMoCo 2017.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from ..kernels.line_fit import TOTAL, WEIGHTED
from ..kernels.rivals.splitting import split
from .base import MethodBase
from .lines import PieceMethod
from .parameters import documented, parameter
from .workspace import Block

__all__ = ["IEPF"]


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class IEPF(PieceMethod):
    """Iterative end point fit.

    1. *Cluster* neighbouring points (breakpoint detector of Borges and Aldon).
    2. *Split* each cluster at the point farthest from the chord of its ends if that distance is
       above its tolerance; then both sides in turn.
    3. *Merge* neighbours that one line fits as well, let each point at a border go to the nearer
       line, and put corners where lines meet.

    The tolerance of a point at range ρ is ``threshold + proportion ρ + noise_factor σ_r``. The
    preset `paper` is the method as published: step 2 alone, of the whole scan, with a fixed
    tolerance; corners on measurements.

    Examples
    --------
    >>> import lineament as ln
    >>> import numpy as np
    >>> from lineament.simulation import SENSORS, room
    >>> scan = SENSORS["paper"].scan(room(), (0.0, 0.0, 0.0), np.random.default_rng(7))
    >>> ln.extract(scan, method="iepf").corners["position"].round(1).tolist()
    [[1.4, -0.5], [3.0, 2.0]]
    """

    name: ClassVar[str] = "iepf"
    published: ClassVar[dict[str, Any]] = {
        "clusters": "none",
        "threshold": 0.1,
        "proportion": 0.0,
        "noise_factor": 0.0,
        "corner": "beam",
    }

    threshold: float = parameter(0.0, "constant part of the tolerance [m]", low=0)
    proportion: float = parameter(
        0.002, "part of the tolerance that grows with range (Przybyła) [m/m]", low=0
    )
    noise_factor: float = parameter(
        4.0, "part of the tolerance that grows with noise [standard deviations of a range]", low=0
    )
    min_piece: int = parameter(4, "least points of a piece", low=2)
    corner: str = parameter(
        "intersection",
        "whether a corner lies where its lines meet, or on its measurement",
        choices=("intersection", "beam"),
    )

    def __post_init__(self) -> None:
        MethodBase.__post_init__(self)
        if self.threshold == self.proportion == self.noise_factor == 0:
            raise ValueError("threshold, proportion and noise_factor are all 0, expected one > 0")

    def find(self, block: Block, row: int) -> None:
        """Cluster, split, merge and fit."""
        self._part(block, row, self.min_points)
        split(
            block.floats, block.ints, block.noises[row], False, self.threshold, self.proportion,
            self.noise_factor, self.min_piece,
        )  # fmt: skip
        self._settle(block, row, self.unevenness)
        if self.corner == "intersection":
            self._measure(block, row, fit=WEIGHTED, trim=self.corner_trim)
        else:
            self._measure(block, row, fit=TOTAL, sharp=False)

    def _leave(self, block: Block, row: int) -> None:
        """Leave the corners where the pieces meet."""

    @property
    def least_response(self) -> float:
        """What the response of a candidate exceeds where the first search accepts it."""
        return 1.0
