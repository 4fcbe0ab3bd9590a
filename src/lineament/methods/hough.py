"""Hough transform: lines by the votes of points for direction and distance.

R. O. Duda, P. E. Hart, *Use of the Hough transformation to detect lines and curves in pictures*,
Communications of the ACM 15(1), 1972; on the clusters of a scan: V. Nguyen, S. Gächter,
A. Martinelli, N. Tomatis, R. Siegwart, *A comparison of line extraction algorithms using 2D range
data for indoor mobile robotics*, Autonomous Robots 23, 2007.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.rivals.hough import find_by_votes
from ..kernels.rivals.stretches import MOMENTS
from .checks import check_choice, check_count, check_number
from .lines import LineMethod
from .stages import FITS
from .workspace import Block

__all__ = ["Hough"]


class _Scratch(NamedTuple):
    moments: NDArray[np.float64]
    slack: NDArray[np.float64]
    slope: NDArray[np.float64]
    free: NDArray[np.int64]
    votes: NDArray[np.int32]
    normals: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Hough(LineMethod):
    """Lines x cos α + y sin α = d by votes in (α, d), within the clusters of a scan.

    1. *Part* the scan at its breakpoints. In each cluster:
    2. *Vote*: each point for all lines through it, `angles` directions over half a turn; d is
       counted from the middle of the cluster, in cells of `resolution`, wider where the noise or
       the cluster asks for it.
    3. *Peak*: of the cell with the most votes, take the longest run of consecutive points near
       its line, fit a line, take the longest run near that, and again.
    4. Withdraw the run's votes, and look for the next peak, until none has `min_points`.
    5. *Settle* neighbouring pieces: about their border each point goes to the nearer line; those
       that one line fits are merged, those whose lines meet at their ends have a corner there.

    Parameters
    ----------
    angles : int
        Directions that are voted for: 180 are 1° apart.
    distances : int
        Cells of the accumulator in d. It takes 4 · `angles` · `distances` bytes, 184 kB.
    resolution : float
        Width of a cell in d [m], or two standard deviations of the noise if these are more; in
        clusters wider than `distances` cells it is as wide as needed.
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
    >>> corners = ln.extract(ln.LaserScan(ranges, angles=bearings), method="hough").corners
    >>> abs(corners["position"]).round(3).tolist(), corners["opening"].round(3).tolist()
    ([[2.0, 0.0]], [1.571])
    """

    name: ClassVar[str] = "hough"

    angles: int = 180
    distances: int = 256
    resolution: float = 0.02
    min_points: int = 4
    min_length: float = 0.0
    max_misses: int = 2
    epsilon: float = 0.01
    sigmas: float = 2.5
    fit: str = "weighted"
    noise_factor: float = 3.0

    def __post_init__(self) -> None:
        check_number("resolution", self.resolution)
        check_count("angles", self.angles, least=4)
        check_count("distances", self.distances, least=4)
        for name in ("min_length", "epsilon", "sigmas", "noise_factor"):
            check_number(name, getattr(self, name), or_equal=True)
        check_count("min_points", self.min_points, least=3)
        check_count("max_misses", self.max_misses, least=0)
        check_choice("fit", self.fit, FITS)
        self._check_shared()

    def own_arrays(self, beams: int) -> _Scratch:
        """Make the accumulator, its directions, and room for running sums and tolerances."""
        n, alpha = beams + 1, math.pi / self.angles * np.arange(self.angles)
        return _Scratch(
            np.empty((n, MOMENTS)),
            np.empty(n),
            np.empty(n),
            np.empty(n, np.int64),
            np.empty((self.angles, self.distances), np.int32),
            np.column_stack((np.cos(alpha), np.sin(alpha))),
        )

    def find(self, block: Block, row: int) -> None:
        """Part, find by votes, settle the borders and fit the scan in a block's workspace."""
        own: _Scratch = block.own
        workspace = (block.floats, block.ints, block.counts)
        self._part(block, row, self.min_points, self.noise_factor)
        find_by_votes(
            *workspace,
            block.noises[row],
            self.resolution,
            self.min_points,
            self.min_length,
            self.max_misses,
            self.epsilon,
            self.sigmas,
            *own,
        )
        self._settle_borders(block, row, self.epsilon, own.moments)
        self._finish(block, row, fit=FITS[self.fit])
