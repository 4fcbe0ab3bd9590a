"""Line tracking: a line grown point by point until it no longer predicts the next ones.

The "incremental" algorithm of V. Nguyen, S. Gächter, A. Martinelli, N. Tomatis, R. Siegwart, *A
comparison of line extraction algorithms using 2D range data for indoor mobile robotics*, Autonomous
Robots 23, 2007, after A. Siadat, A. Kaske, S. Klausmann, M. Dufaut, R. Husson, *An optimized
segmentation method for a 2D laser-scanner applied to mobile robot navigation*, SICICA 1997, and
P. Vandorpe, H. Van Brussel, H. Xu, *Exact dynamic map building for a mobile robot using geometrical
primitives produced by a 2D range finder*, ICRA 1996.
"""

from typing import Any, ClassVar

from lineament.methods.parameters import method, parameter
from lineament.methods.workspace import Block

from ..kernels.line_tracking import track_lines
from .lines import PieceMethod


@method
class LineTracking(PieceMethod):
    """Line tracking.

    1. *Cluster* neighbouring points (breakpoint detector of Borges and Aldon).
    2. *Track*: three points begin a line. It gains the next point, and is fitted again by running
       sums, if it predicts it: if the point's distance from it is at most ``threshold`` and
       ``noise_factor`` standard deviations of that distance, in which the noise of the point and
       that of the line count. It ends where it does not predict `max_misses` points in a row and
       one more; there the next line begins.
    3. *Merge* neighbours that one line fits as well, put borders where both lines fit best
       (a tracker runs past corners), and corners where lines meet.
    """

    name = "line_tracking"
    published: ClassVar[dict[str, Any]] = {
        "clusters": "fixed",
        "noise_factor": 5.0,
        "max_misses": 0,
    }

    threshold: float = parameter(
        0.0, "distance from its line that a point without noise may have", low=0, unit="m"
    )
    noise_factor: float = parameter(
        3.0, "standard deviations of the prediction that are added", above=0
    )
    max_misses: int = parameter(2, "points in a row that a line passes over as outliers", low=0)
    min_piece: int = parameter(3, "least points of a line", low=3)

    def find(self, block: Block) -> None:
        """Cluster, track, merge and fit."""
        self.part(block, self.min_points)
        track_lines(
            *block.workspace, self.threshold, self.noise_factor, self.max_misses, self.min_piece
        )
        self.finish(block)
