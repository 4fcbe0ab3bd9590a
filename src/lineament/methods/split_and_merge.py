"""Split-and-merge: a cluster split where it is not the line fitted to it, and alike lines merged.

V. Nguyen, S. Gächter, A. Martinelli, N. Tomatis, R. Siegwart, *A comparison of line extraction
algorithms using 2D range data for indoor mobile robotics*, Autonomous Robots 23, 2007. The weights
of the points and the χ² test of the merging follow S. T. Pfister, S. I. Roumeliotis, J. W. Burdick,
*Weighted line fitting algorithms for mobile robot map building and efficient data representation*,
ICRA 2003.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.line_fit import WEIGHTED
from ..kernels.rivals.splitting import LINE, split
from ..kernels.rivals.stretches import MOMENTS
from .checks import check_count, check_number
from .lines import LineMethod
from .workspace import Block

__all__ = ["SplitAndMerge"]

_LEAST = {"min_piece": 2, "corner_trim": 0, "min_points": 2}


class _Scratch(NamedTuple):
    tolerance: NDArray[np.float64]
    moments: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class SplitAndMerge(LineMethod):
    """Split-and-merge.

    1. *Cluster* neighbouring points (breakpoint detector of Borges and Aldon).
    2. *Split* each cluster that is not straight: if two neighbouring points lie off the weighted
       line fitted to it, on one side and by more than their tolerances. One alone is an outlier.
       It is split at the point farthest from the chord of its ends, as what is farthest from the
       fitted line may be an end: that of an L is. Then both sides in turn.
    3. *Merge* neighbours whose joint fit costs no more in χ² than chance allows, let each point at
       a border go to the nearer line, and put corners where lines meet.

    The tolerance of a point at range ρ is ``threshold + noise_factor σ_r``.

    Parameters
    ----------
    threshold : float
        Tolerance that does not depend on range or noise [m].
    noise_factor : float
        Part of the tolerance that grows with the noise [standard deviations of a range].
    min_piece : int
        Points of the shortest piece that a cluster is split into.
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
    >>> ln.extract(scan, method="split_and_merge").corners["position"].round(1).tolist()
    [[1.4, -0.5], [3.0, 2.0]]
    """

    name: ClassVar[str] = "split_and_merge"

    threshold: float = 0.0
    noise_factor: float = 2.0
    min_piece: int = 4
    unevenness: float = 0.01
    corner_trim: int = 1
    min_points: int = 3

    def __post_init__(self) -> None:
        for name in ("threshold", "noise_factor", "unevenness"):
            check_number(name, getattr(self, name), or_equal=True)
        if self.threshold == self.noise_factor == 0:
            raise ValueError("threshold and noise_factor are both 0, expected one > 0")
        for name, least in _LEAST.items():
            check_count(name, getattr(self, name), least=least)
        self._check_shared()

    def own_arrays(self, beams: int) -> _Scratch:
        """Make scratch for the splitting and the merging."""
        n = beams + 1
        return _Scratch(np.empty(n), np.empty((n, MOMENTS)))

    def find(self, block: Block, row: int) -> None:
        """Cluster, split, merge and fit the scan in a block's workspace."""
        own: _Scratch = block.own
        workspace = (block.floats, block.ints, block.counts, block.noises[row])
        self._part(block, row, self.min_points)
        split(
            *workspace,
            LINE,
            self.threshold,
            0.0,
            self.noise_factor,
            self.min_piece,
            own.tolerance,
        )
        self._settle_borders(block, row, self.unevenness, own.moments)
        self._finish(block, row, fit=WEIGHTED, trim=self.corner_trim)

    @property
    def least_response(self) -> float:
        """What the response of a candidate exceeds where the first search accepts it."""
        return 1.0
