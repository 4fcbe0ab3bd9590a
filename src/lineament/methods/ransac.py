"""RANSAC: the line on which most points agree, then that of the rest, and so on.

M. A. Fischler, R. C. Bolles, *Random sample consensus*, Communications of the ACM 24(6), 1981; on
the clusters of a scan: V. Nguyen, S. Gächter, A. Martinelli, N. Tomatis, R. Siegwart,
*A comparison of line extraction algorithms using 2D range data for indoor mobile robotics*,
Autonomous Robots 23, 2007.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.rivals.ransac import PERIOD, find_by_consensus
from ..kernels.rivals.stretches import MOMENTS
from .checks import check_choice, check_count, check_number
from .lines import LineMethod
from .stages import FITS
from .workspace import Block

__all__ = ["Ransac"]


class _Scratch(NamedTuple):
    moments: NDArray[np.float64]
    slack: NDArray[np.float64]
    slope: NDArray[np.float64]
    free: NDArray[np.int64]
    left: NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ransac(LineMethod):
    """Random sample consensus within the clusters of a scan.

    1. *Part* the scan at its breakpoints. In each cluster, until no piece is long enough:
    2. *Sample* pairs of near points, and take the line through the pair whose longest run of
       consecutive points near it has the most; two runs of the same number: the earlier pair.
    3. *Fit* a line to that run, take the longest run near it, and again.
    4. *Settle* neighbouring pieces: about their border each point goes to the nearer line; those
       that one line fits are merged, those whose lines meet at their ends have a corner there.

    The numbers are drawn by an own generator that begins anew with each scan: the same scan has
    the same features, whatever comes before it.

    Parameters
    ----------
    trials : int
        Pairs that are drawn for a piece.
    window : int
        Points over which a pair is drawn: one from the points that are left, the other from those
        after it.
    min_points : int
        Points near its line that a piece has at least.
    min_length : float
        Length that a piece has at least [m].
    max_misses : int
        Points in a row that may lie off the line without ending a piece.
    epsilon : float
        Unevenness: how far a point may lie from the line without noise [m].
    sigmas : float
        Standard deviations of its range noise that a point may lie off besides.
    seed : int
        Where the generator begins, 1 … 2³¹ - 2.
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
    >>> corners = ln.extract(ln.LaserScan(ranges, angles=bearings), method="ransac").corners
    >>> abs(corners["position"]).round(3).tolist(), corners["opening"].round(3).tolist()
    ([[2.0, 0.0]], [1.571])
    """

    name: ClassVar[str] = "ransac"

    trials: int = 30
    window: int = 30
    min_points: int = 4
    min_length: float = 0.0
    max_misses: int = 2
    epsilon: float = 0.01
    sigmas: float = 2.5
    seed: int = 1
    fit: str = "weighted"
    noise_factor: float = 3.0

    def __post_init__(self) -> None:
        for name in ("min_length", "epsilon", "sigmas", "noise_factor"):
            check_number(name, getattr(self, name), or_equal=True)
        check_count("min_points", self.min_points, least=3)
        check_count("max_misses", self.max_misses, least=0)
        check_count("trials", self.trials, least=1)
        check_count("window", self.window, least=1)
        check_count("seed", self.seed, least=1)
        if self.seed >= PERIOD:
            raise ValueError(f"seed is {self.seed}, expected a whole number < {PERIOD}")
        check_choice("fit", self.fit, FITS)
        self._check_shared()

    def own_arrays(self, beams: int) -> _Scratch:
        """Make room for the running sums, the tolerances, and the points that are left."""
        n = beams + 1
        return _Scratch(
            np.empty((n, MOMENTS)),
            np.empty(n),
            np.empty(n),
            np.empty(n, np.int64),
            np.empty(n, np.int64),
        )

    def find(self, block: Block, row: int) -> None:
        """Part, find by consensus, settle the borders and fit the scan in a block's workspace."""
        own: _Scratch = block.own
        workspace = (block.floats, block.ints, block.counts)
        self._part(block, row, self.min_points, self.noise_factor)
        find_by_consensus(
            *workspace,
            block.noises[row],
            self.trials,
            self.window,
            self.min_points,
            self.min_length,
            self.max_misses,
            self.epsilon,
            self.sigmas,
            self.seed,
            *own,
        )
        self._settle_borders(block, row, self.epsilon, own.moments)
        self._finish(block, row, fit=FITS[self.fit])
