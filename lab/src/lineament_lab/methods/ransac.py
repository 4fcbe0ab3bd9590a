"""RANSAC: the line on which most points agree, then that of the rest, and so on.

M. A. Fischler, R. C. Bolles, *Random sample consensus*, Communications of the ACM 24(6), 1981; on
the clusters of a scan: V. Nguyen, S. Gächter, A. Martinelli, N. Tomatis, R. Siegwart,
*A comparison of line extraction algorithms using 2D range data for indoor mobile robotics*,
Autonomous Robots 23, 2007.
"""

from operator import attrgetter

from lineament.methods.parameters import method, parameter
from lineament.methods.workspace import Block

from ..kernels.ransac import PERIOD, Parameters, find_by_consensus
from .lines import NearMethod

_numbers = attrgetter(*Parameters._fields)


@method
class Ransac(NearMethod):
    """Random sample consensus within the clusters of a scan.

    1. *Part* the scan at its breakpoints. In each cluster, until no piece is long enough:
    2. *Sample* pairs of near points, and take the line through the pair whose longest run of
       consecutive points near it has the most; two runs of the same number: the earlier pair.
    3. *Fit* a line to that run, take the longest run near it, and again.
    4. *Settle* neighbouring pieces: their border is put where both lines fit best; those that
       one line fits are merged, those whose lines meet at their ends have a corner there.

    The generator of the numbers that are drawn starts again with each scan: the same scan has the
    same features, whatever comes before it.
    """

    name = "ransac"

    trials: int = parameter(30, "pairs that are drawn for a piece", low=1, below=10001)
    window: int = parameter(
        30, "points over which a pair is drawn: one of those left, and one of those after it", low=1
    )
    min_points: int = parameter(4, "least points near its line of a piece", low=3)
    min_length: float = parameter(0.0, "least length of a piece", low=0, unit="m")
    max_misses: int = parameter(
        2, "points in a row that may lie off the line without ending a piece", low=0
    )
    seed: int = parameter(1, "where the generator starts", low=1, below=PERIOD)

    def find(self, block: Block) -> None:
        """Part, find by consensus, settle the borders and fit."""
        self.part(block, self.min_points, self.noise_factor)
        find_by_consensus(*block.workspace, _numbers(self))
        self.finish(block)
