"""Iterative end point fit: a cluster split at the point farthest from its chord, and again.

U. Ramer, *An iterative procedure for the polygonal approximation of plane curves*, Computer
Graphics and Image Processing 1, 1972; R. O. Duda, P. E. Hart, *Pattern Classification and Scene
Analysis*, Wiley 1973. The tolerance that grows with range, and the merging that a joint fit
verifies, are those of M. Przybyła, *Detection and tracking of 2D geometric obstacles from LRF
data*, RoMoCo 2017.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..block import Block
from ..kernels.line_fit import TOTAL, WEIGHTED
from ..kernels.settling import settle
from ..kernels.splitting import CHORD, split
from ..kernels.stretches import MOMENTS
from .base import MethodBase
from .checks import check_choice, check_count, check_number
from .pdbs import check_acute, part
from .steps import limit_vertices, measure

__all__ = ["IEPF"]

_LEAST = {"min_piece": 2, "corner_trim": 0, "max_missing": 0, "min_points": 2, "max_vertices": 0}


class _Scratch(NamedTuple):
    tolerance: NDArray[np.float64]
    moments: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class IEPF(MethodBase):
    """Iterative end point fit.

    1. *Cluster* neighbouring points (breakpoint detector of Borges and Aldon).
    2. *Split* each cluster at the point farthest from the chord of its ends if that distance is
       above its tolerance; then both sides in turn.
    3. *Merge* neighbours that one line fits as well, let each point at a border go to the nearer
       line, and put corners where lines meet.

    The tolerance of a point at range ρ is ``threshold + proportion ρ + noise_factor σ_r``. The
    preset `paper` is the plain method: a fixed tolerance, nothing merged, corners on readings.

    Parameters
    ----------
    threshold : float
        Tolerance that does not depend on range or noise [m].
    proportion : float
        Part of the tolerance that grows with range (Przybyła) [m/m].
    noise_factor : float
        Part of the tolerance that grows with the noise [standard deviations of a range].
    min_piece : int
        Points of the shortest piece that a cluster is split into.
    merge : bool
        Whether step 3 is done.
    corner : {"intersection", "beam"}
        Whether a corner lies where its lines meet, or on its reading.
    unevenness : float
        Of walls [m], root mean square, beside the noise: what two lines may differ by and still
        be merged.
    reach : float
        How many spacings the lines of two pieces may meet from the ends of both: farther off
        there is no corner.
    corner_trim : int
        Readings next to a corner that the last fits leave out.
    grazing_angle : float
        λ of the breakpoint detector that parts the scan into clusters (Borges and Aldon, see
        `PDBS`), in 0..π/2 [rad].
    max_missing : int
        Missing beams in a row over which a cluster goes on.
    min_points : int
        Clusters of fewer points are noise.
    max_vertices : int
        Pieces are joined until they have no more vertices; 0 allows any number.

    Raises
    ------
    ValueError
        If a parameter is out of bounds. The message names it and its value.

    Examples
    --------
    >>> import lineament as ln
    >>> from lineament.simulation import SENSORS, room
    >>> scan = SENSORS["paper"].scan(room(), (0.0, 0.0, 0.0), np.random.default_rng(7))
    >>> ln.extract(scan, method="iepf").corners["position"].round(1).tolist()
    [[1.4, -0.5], [3.0, 2.0]]
    """

    name: ClassVar[str] = "iepf"
    presets: ClassVar[tuple[str, ...]] = ("paper",)

    threshold: float = 0.0
    proportion: float = 0.002
    noise_factor: float = 4.0
    min_piece: int = 4
    merge: bool = True
    corner: str = "intersection"
    unevenness: float = 0.01
    reach: float = 6.0
    corner_trim: int = 1
    grazing_angle: float = math.radians(6.0)
    max_missing: int = 5
    min_points: int = 3
    max_vertices: int = 0

    def __post_init__(self) -> None:
        for name in ("threshold", "proportion", "noise_factor", "unevenness", "reach"):
            check_number(name, getattr(self, name), or_equal=True)
        if self.threshold == self.proportion == self.noise_factor == 0:
            raise ValueError("threshold, proportion and noise_factor are all 0, expected one > 0")
        check_acute("grazing_angle", self.grazing_angle)
        for name, least in _LEAST.items():
            check_count(name, getattr(self, name), least=least)
        if not isinstance(self.merge, bool):
            raise ValueError(f"merge is {self.merge!r}, expected True or False")
        check_choice("corner", self.corner, ("intersection", "beam"))
        self._settle_types()

    @classmethod
    def paper(cls, **changes: Any) -> IEPF:
        """Make the plain method: fixed tolerance, no merging, corners on their readings."""
        return cls(
            **{
                "threshold": 0.1,
                "proportion": 0.0,
                "noise_factor": 0.0,
                "merge": False,
                "corner": "beam",
                **changes,
            }
        )

    def own_arrays(self, beams: int) -> _Scratch:
        """Make scratch for the splitting and the merging."""
        n = beams + 1
        return _Scratch(np.empty(n), np.empty((n, MOMENTS)))

    def find(self, block: Block, row: int) -> None:
        """Cluster, split, merge and fit the scan in a block's workspace."""
        own: _Scratch = block.own
        workspace = (block.floats, block.ints, block.counts, block.noises[row])
        sharp = self.corner == "intersection"
        part(
            block,
            row,
            angle=self.grazing_angle,
            max_missing=self.max_missing,
            min_points=self.min_points,
        )
        split(
            *workspace,
            CHORD,
            self.threshold,
            self.proportion,
            self.noise_factor,
            self.min_piece,
            own.tolerance,
        )
        if self.merge:
            settle(*workspace, self.unevenness, self.reach, own.moments)
        limit_vertices(block, self.max_vertices)
        measure(
            block,
            row,
            fit=WEIGHTED if sharp else TOTAL,
            sharp=sharp,
            trim=self.corner_trim if sharp else 0,
            reach=self.reach,
            gap=self.max_missing + 1.0,
        )

    @property
    def least_response(self) -> float:
        """What the response of a candidate exceeds where the first search accepts it."""
        return 1.0
