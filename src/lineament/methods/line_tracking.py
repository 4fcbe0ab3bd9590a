"""Line tracking: a line grown point by point until it no longer predicts the next ones.

The "incremental" algorithm of V. Nguyen, S. Gächter, A. Martinelli, N. Tomatis, R. Siegwart, *A
comparison of line extraction algorithms using 2D range data for indoor mobile robotics*, Autonomous
Robots 23, 2007, after A. Siadat, A. Kaske, S. Klausmann, M. Dufaut, R. Husson, *An optimized
segmentation method for a 2D laser-scanner applied to mobile robot navigation*, SICICA 1997, and
P. Vandorpe, H. Van Brussel, H. Xu, *Exact dynamic map building for a mobile robot using geometrical
primitives produced by a 2D range finder*, ICRA 1996.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ..kernels.line_fit import WEIGHTED
from ..kernels.rivals.line_tracking import track_lines
from ..kernels.rivals.stretches import MOMENTS
from .checks import check_count, check_number
from .lines import LineMethod
from .workspace import Block

__all__ = ["LineTracking"]

_LEAST = {
    "max_misses": 0,
    "min_piece": 3,
    "corner_trim": 0,
    "min_points": 2,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class LineTracking(LineMethod):
    """Line tracking.

    1. *Cluster* neighbouring points (breakpoint detector of Borges and Aldon).
    2. *Track*: three points begin a line. It gains the next point, and is fitted anew by running
       sums, if it predicts it: if the point's distance from it is at most ``threshold`` and
       ``noise_factor`` standard deviations of that distance, in which the noise of the point and
       that of the line count. It ends where it does not predict `max_misses` points in a row and
       one more; there the next line begins.
    3. *Merge* neighbours that one line fits as well, let each point at a border go to the nearer
       line (a tracker runs past corners, where both are near), and put corners where lines meet.

    Parameters
    ----------
    threshold : float
        Distance from its line that a point without noise may have [m].
    noise_factor : float
        Standard deviations of the prediction that are added.
    max_misses : int
        Points in a row that a line passes over as outliers.
    min_piece : int
        Points of the shortest line.
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
    >>> ln.extract(scan, method="line_tracking").corners["position"].round(1).tolist()
    [[1.4, -0.5], [3.0, 2.0]]
    """

    name: ClassVar[str] = "line_tracking"

    threshold: float = 0.0
    noise_factor: float = 3.0
    max_misses: int = 2
    min_piece: int = 3
    unevenness: float = 0.01
    corner_trim: int = 1
    min_points: int = 3

    def __post_init__(self) -> None:
        for name in ("threshold", "unevenness"):
            check_number(name, getattr(self, name), or_equal=True)
        check_number("noise_factor", self.noise_factor)
        for name, least in _LEAST.items():
            check_count(name, getattr(self, name), least=least)
        self._check_shared()

    def own_arrays(self, beams: int) -> NDArray[np.float64]:
        """Make scratch for the merging."""
        return np.empty((beams + 1, MOMENTS))

    def find(self, block: Block, row: int) -> None:
        """Cluster, track, merge and fit the scan in a block's workspace."""
        workspace = (block.floats, block.ints, block.counts, block.noises[row])
        self._part(block, row, self.min_points)
        track_lines(*workspace, self.threshold, self.noise_factor, self.max_misses, self.min_piece)
        self._settle_borders(block, row, self.unevenness, block.own)
        self._finish(block, row, fit=WEIGHTED, trim=self.corner_trim)
