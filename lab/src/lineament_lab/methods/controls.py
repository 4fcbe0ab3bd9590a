"""Controls: what the steps that the rivals share do without a detector, and with that of `liu`."""

import numpy as np

from lineament.kernels import layout as at
from lineament.kernels.corner_operator import RESPONSES
from lineament.kernels.cutting import cut
from lineament.methods.parameters import method, parameter
from lineament.methods.workspace import Block

from .lines import PieceMethod


@method
class BlindCut(PieceMethod):
    """Clusters cut into pieces of equal numbers of points, whatever they show; then settled.

    Examples
    --------
    >>> BlindCut(every=5).every
    5
    """

    name = "blind"

    every: int = parameter(8, "points of a piece", low=2)

    def find(self, block: Block) -> None:
        """Cluster, cut blindly, settle and fit."""
        self.part(block, self.min_points)
        work, pieces = block.work, []
        for first, last in work.clusters[:, : block.counts[at.CLUSTERS]].T.tolist():
            points = np.arange(first, last + 1)
            parts = np.array_split(points, max(len(points) // self.every, 1))
            pieces += [(part[0], part[-1]) for part in parts]
        work.pieces[[at.FIRST, at.LAST], : len(pieces)] = np.reshape(pieces, (-1, 2)).T
        block.counts[at.PIECES] = len(pieces)
        self.finish(block)


@method
class OperatorCut(PieceMethod):
    """Clusters cut where the corner operator of `liu` responds; then settled.

    Not filtered, as in the preset `liu:tuned`; the threshold is chosen like its parameters.

    Examples
    --------
    >>> OperatorCut().threshold
    0.1
    """

    name = "operator"

    support_radius: int = parameter(7, "as in `Liu`", low=1)
    threshold: float = parameter(0.1, "as in `Liu`", low=0)
    response: str = parameter("relative", "as in `Liu`", choices=RESPONSES)

    def find(self, block: Block) -> None:
        """Cluster, cut by the operator, settle and fit."""
        self.part(block, self.min_points)
        kind = RESPONSES[self.response]
        rules = self.support_radius, self.threshold, kind, self.min_points, True, False
        cut(block.floats, block.ints, *rules)
        self.finish(block)
