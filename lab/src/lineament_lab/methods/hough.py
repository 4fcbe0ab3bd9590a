"""Hough transform: lines by the votes of points for direction and distance.

R. O. Duda, P. E. Hart, *Use of the Hough transformation to detect lines and curves in pictures*,
Communications of the ACM 15(1), 1972; on the clusters of a scan: V. Nguyen, S. Gächter,
A. Martinelli, N. Tomatis, R. Siegwart, *A comparison of line extraction algorithms using 2D range
data for indoor mobile robotics*, Autonomous Robots 23, 2007.
"""

import math
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from lineament.methods.parameters import method, parameter
from lineament.methods.workspace import Block

from ..kernels.hough import Parameters, find_by_votes
from .lines import NearMethod

_numbers = attrgetter(*Parameters._fields)


@method
class Hough(NearMethod):
    """Lines x cos α + y sin α = d by votes in (α, d), within the clusters of a scan.

    1. *Part* the scan at its breakpoints. In each cluster:
    2. *Vote*: each point for all lines through it, `angles` directions over half a turn from the
       chord of the cluster; d is counted from its middle, in cells of `resolution`, wider where
       the noise or the cluster needs it.
    3. *Peak*: of the cell with the most votes, take the longest run of consecutive points near
       its line, fit a line, take the longest run near that, and again.
    4. Withdraw the run's votes, and look for the next peak, until none has `min_points`.
    5. *Settle* neighbouring pieces: their border is put where both lines fit best; those that
       one line fits are merged, those whose lines meet at their ends have a corner there.
    """

    name = "hough"

    angles: int = parameter(
        180, "directions that are voted for: 180 are 1° apart", low=4, below=3601
    )
    distances: int = parameter(
        256,
        "cells of the accumulator in d; it takes 4 · angles · distances bytes",
        low=4,
        below=8193,
    )
    resolution: float = parameter(
        0.02,
        "width of a cell in d, or two deviations of the noise if these are more",
        above=0,
        unit="m",
    )
    min_points: int = parameter(4, "least points near its line of a piece", low=3)
    min_length: float = parameter(0.0, "least length of a piece", low=0, unit="m")
    max_misses: int = parameter(
        2, "points in a row that may lie off the line without ending a piece", low=0
    )

    def own_arrays(self, beams: int) -> tuple[NDArray[np.int32], NDArray[np.float64]]:  # noqa: ARG002
        """Make the accumulator and its directions."""
        alpha = math.pi / self.angles * np.arange(self.angles)
        votes = np.empty((self.angles, self.distances), np.int32)
        return votes, np.column_stack((np.cos(alpha), np.sin(alpha)))

    def find(self, block: Block) -> None:
        """Part, find by votes, settle the borders and fit."""
        self.part(block, self.min_points, self.noise_factor)
        find_by_votes(*block.workspace, _numbers(self), *block.own)
        self.finish(block)
