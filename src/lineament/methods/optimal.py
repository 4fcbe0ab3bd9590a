"""The project's own method: one energy, minimised exactly.

Where Liu et al. 2023 cluster, cut and fit by thresholds, one energy decides here.
``docs/optimal.md`` leads from the model of a scan to the recurrence that finds its minimum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..kernels.line_fit import WEIGHTED
from ..kernels.optimal import layout
from ..kernels.optimal.extraction import extract_rows
from ..kernels.polylines import PLANES, fit_polylines
from ..kernels.vertices import hold_together
from ..scan import LaserScan
from .base import MethodBase
from .optimal_trace import evidence_of, trace_of
from .parameters import documented, parameter
from .steps import measure, part
from .trace import Trace
from .workspace import Block

__all__ = ["Optimal"]

#: Error of a range beyond which a measurement is better left out of a map [m]; distance of
#: neighbours beyond which no line of a map joins them [m]; spacings from a vertex of a map within
#: which its fitted lines meet, for their covariance to be that of the vertex.
_WORST, _LINK, _NEAR = 0.31, 1.0, 2.0
#: Angle of the steepest incidence that parts the scan for a map, from the beam [rad].
_GRAZING = math.radians(4.0)


class Workspace(NamedTuple):
    """Arrays of one scan: as in `kernels.optimal.layout.Work`, and those of maps."""

    arrays: tuple[NDArray[Any], ...]
    costs: NDArray[np.float64]
    follow: NDArray[np.int64]


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Optimal(MethodBase):
    """Lines, corners and arcs: the partition of a scan that has the least energy.

    1. *Noise*: the constant part and that which grows with range, from what measurements are off
       the line through their neighbours.
    2. *Cluster*: a surface breaks where more than `max_missing` beams are missing, or where the
       range steps by more than a surface met at 86° and the noise allow.
    3. *Partition*: each measurement is on a line or on none. A line costs `evidence` and the χ² of
       its measurements, a measurement on no line costs half of `evidence`. The partition that costs
       the least is found exactly, by dynamic programming (Jackson et al. 2005). Neighbouring lines
       that turn by less than 20° and meet are one wall that bends; runs of lines that one circle
       explains for less are arcs.
    4. *Fit* each line by maximum likelihood to the ranges.
    5. *Join* neighbouring lines at a corner where they meet between their measurements.

    References
    ----------
    B. Jackson et al., "An algorithm for optimal partitioning of data on an interval", *IEEE Signal
    Processing Letters* 12 (2005).

    Examples
    --------
    >>> import lineament as ln
    >>> from lineament.simulation import SENSORS, room
    >>> scan = SENSORS["paper"].scan(room(), (0.0, 0.0, 0.0), np.random.default_rng(7))
    >>> corners = ln.extract(scan, method="optimal").corners
    >>> corners["position"][corners["kind"] == "corner"].round(2).tolist()
    [[1.4, -0.5], [3.0, 2.0]]
    """

    name: ClassVar[str] = "optimal"

    evidence: float = parameter(
        12.0,
        "price of a line, β: by so much χ² must rise where two lines are taken for one; more finds "
        "less",
        above=0,
    )
    max_missing: int = parameter(6, "missing beams in a row over which a surface goes on", low=0)
    max_vertices: int = parameter(
        0,
        "if not 0, a map instead of features: polylines of at most so many vertices in all, with "
        "the least range error; their vertices are the corners, and `evidence` does not matter",
        low=0,
    )

    def own_arrays(self, beams: int) -> Workspace:
        """Make the workspace of a scan."""
        n, vertices = beams + 2, min(self.max_vertices, beams + 1) + 1
        return Workspace(
            (
                np.zeros((layout.POINTS, n)),
                np.zeros((layout.BEAMS, n), np.int64),
                np.zeros((layout.SPANS, n), np.int64),
                np.zeros((n, layout.PIECES)),
                np.zeros((n, layout.SUMS)),
                np.zeros(3),
            ),
            np.empty((PLANES, n, vertices)),
            np.empty((n, vertices), np.int64),
        )

    def run(self, block: Block) -> None:
        """Find and measure the features of the scans of a block."""
        if self.max_vertices:
            MethodBase.run(self, block)
            return
        own: Workspace = block.own
        # Plain tuples: named ones take numba a microsecond to recognise.
        extract_rows(
            block.ranges,
            block.rows,
            block.bearings,
            block.noise,
            (block.range_min, block.range_max, block.circular, self.evidence, self.max_missing),
            own.arrays,
            (
                block.segments,
                block.corners,
                block.arcs,
                block.breakpoints,
                block.clusters,
                block.offsets,
            ),
            block.noises,
            block.counts,
        )

    def find(self, block: Block, row: int) -> None:
        """Lay the polylines of a map through the scan in a block's workspace."""
        own: Workspace = block.own
        floats, ints = block.floats, block.ints
        part(block, row, angle=_GRAZING, max_missing=self.max_missing, min_points=3)
        fit_polylines(
            floats, ints, block.bearings, own.follow.shape[1] - 1, self.max_missing, _LINK,
            _WORST, own.costs, own.follow,
        )  # fmt: skip
        measure(block, row, fit=WEIGHTED, reach=_NEAR, gap=float(self.max_missing))
        hold_together(floats, ints, row, block.segments, block.corners, block.offsets)

    @property
    def least_response(self) -> float:
        """Least response of a corner: the price of a line."""
        return self.evidence

    def trace(self, scan: LaserScan, features: Features, noise: NDArray[np.float64]) -> Trace:
        """Run again on a scan of which these features came, and keep every intermediate.

        It has no candidates: all partitions are compared.
        """
        if self.max_vertices:
            return MethodBase.trace(self, scan, features, noise)
        block = Block(scan, noise, 1, self.own_arrays(len(scan)))
        block.load(scan.ranges)
        self.run(block)
        return trace_of(block, self, scan, features)

    def report_evidence(self, block: Block) -> dict[str, NDArray[np.float64]]:
        """Rise of χ² without each feature of the last scan.

        Of a corner, if its two segments were one; of a segment, if it were one with the neighbour
        that it is most like (inf without neighbours); of an arc, if lines were in its place.
        """
        return {} if self.max_vertices else evidence_of(block)
