"""Seeded region growing: lines that grow from a few points both ways.

H. Gao, X. Zhang, Y. Fang, J. Yuan, *A line segment extraction algorithm using laser data based on
seeded region growing*, International Journal of Advanced Robotic Systems 15(1), 2018.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.rivals.region_growing import grow_regions
from ..kernels.rivals.stretches import MOMENTS
from .checks import check_choice, check_count, check_number
from .lines import LineMethod
from .stages import FITS
from .workspace import Block

__all__ = ["RegionGrowing"]


class _Scratch(NamedTuple):
    moments: NDArray[np.float64]
    slack: NDArray[np.float64]
    slope: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class RegionGrowing(LineMethod):
    """The method of Gao et al. 2018, its thresholds scaled by the noise.

    1. *Part* the scan at its breakpoints.
    2. *Seed*: `s_num` consecutive points, each near the line fitted to them, and near the point
       where its own beam meets that line.
    3. *Grow* the seed both ways, point by point by the same two tests, fitting anew each time.
    4. *Overlaps* of neighbouring regions: each point goes to the nearer line. Neighbours that one
       line fits are merged, those whose lines meet at their ends have a corner there.

    Parameters
    ----------
    s_num : int
        Points of a seed.
    p_min : int
        Points that a region has at least.
    l_min : float
        Length that a region has at least [m].
    delta : float
        Unevenness along the beam: how far a point may lie from where its beam meets the line [m].
    epsilon : float
        Unevenness: how far a point may lie from the line without noise [m].
    sigmas : float
        Standard deviations of its range noise that a point may lie off besides.
    fit : {"weighted", "total", "y_of_x"}
        How the final lines are fitted: maximum likelihood, orthogonal or axial least squares.
    noise_factor : float
        Of the breakpoint detector that parts the scan first, see `PDBS`.
    reach, grazing_angle, max_missing, max_vertices
        As in `lineament.methods.lines.LineMethod`.

    Raises
    ------
    ValueError
        If a parameter is out of bounds. The message names it and its value.

    Examples
    --------
    >>> import lineament as ln
    >>> bearings = np.radians(np.arange(-40, 41))
    >>> ranges = 2.0 / (np.cos(bearings) + abs(np.sin(bearings)))  # a corner, straight ahead
    >>> corners = ln.extract(ln.LaserScan(ranges, angles=bearings), method="region_growing").corners
    >>> abs(corners["position"]).round(3).tolist(), corners["opening"].round(3).tolist()
    ([[2.0, 0.0]], [1.571])
    """

    name: ClassVar[str] = "region_growing"

    s_num: int = 6
    p_min: int = 6
    l_min: float = 0.0
    epsilon: float = 0.01
    delta: float = 0.1
    sigmas: float = 3.0
    fit: str = "weighted"
    noise_factor: float = 3.0

    def __post_init__(self) -> None:
        for name in ("l_min", "epsilon", "delta", "sigmas", "noise_factor"):
            check_number(name, getattr(self, name), or_equal=True)
        check_count("s_num", self.s_num, least=3)
        check_count("p_min", self.p_min, least=3)
        check_choice("fit", self.fit, FITS)
        self._check_shared()

    def own_arrays(self, beams: int) -> _Scratch:
        """Make room for the running sums and the tolerances."""
        n = beams + 1
        return _Scratch(np.empty((n, MOMENTS)), np.empty(n), np.empty(n))

    def find(self, block: Block, row: int) -> None:
        """Part, seed and grow, settle the overlaps and fit the scan in a block's workspace."""
        own: _Scratch = block.own
        workspace = (block.floats, block.ints, block.counts)
        self._part(block, row, self.s_num, self.noise_factor)
        grow_regions(
            *workspace,
            block.noises[row],
            self.s_num,
            self.p_min,
            self.l_min,
            self.delta,
            self.epsilon,
            self.sigmas,
            *own,
        )
        self._settle_borders(block, row, self.epsilon, own.moments)
        self._finish(block, row, fit=FITS[self.fit])
