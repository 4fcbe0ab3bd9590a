"""Iterative end point fit: a cluster split at the point farthest from its chord, and again.

U. Ramer, *An iterative procedure for the polygonal approximation of plane curves*, Computer
Graphics and Image Processing 1, 1972; R. O. Duda, P. E. Hart, *Pattern Classification and Scene
Analysis*, Wiley 1973. The tolerance that grows with range, and the merging that a joint fit
verifies, are those of M. Przybyła, *Detection and tracking of 2D geometric obstacles from LRF
data*, RoMoCo 2017.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.line_fit import TOTAL, WEIGHTED
from ..kernels.rivals.splitting import CHORD, split
from ..kernels.rivals.stretches import MOMENTS
from .checks import check_choice, check_count, check_number
from .lines import LineMethod
from .workspace import Block

__all__ = ["IEPF"]

_LEAST = {"min_piece": 2, "corner_trim": 0, "min_points": 2}


class _Scratch(NamedTuple):
    tolerance: NDArray[np.float64]
    moments: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class IEPF(LineMethod):
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
    corner_trim : int
        Readings next to a corner that the last fits leave out.
    min_points : int
        Clusters of fewer points are noise.
    reach, grazing_angle, max_missing, max_vertices
        As in `lineament.methods.lines.LineMethod`.

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
    corner_trim: int = 1
    min_points: int = 3

    def __post_init__(self) -> None:
        for name in ("threshold", "proportion", "noise_factor", "unevenness"):
            check_number(name, getattr(self, name), or_equal=True)
        if self.threshold == self.proportion == self.noise_factor == 0:
            raise ValueError("threshold, proportion and noise_factor are all 0, expected one > 0")
        for name, least in _LEAST.items():
            check_count(name, getattr(self, name), least=least)
        if not isinstance(self.merge, bool):
            raise ValueError(f"merge is {self.merge!r}, expected True or False")
        check_choice("corner", self.corner, ("intersection", "beam"))
        self._check_shared()

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
        self._part(block, row, self.min_points)
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
            self._settle_borders(block, row, self.unevenness, own.moments)
        self._finish(
            block,
            row,
            fit=WEIGHTED if sharp else TOTAL,
            sharp=sharp,
            trim=self.corner_trim if sharp else 0,
        )

    @property
    def least_response(self) -> float:
        """What the response of a candidate exceeds where the first search accepts it."""
        return 1.0
