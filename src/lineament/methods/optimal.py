"""The project's own method: one energy, minimised exactly.

Where Liu et al. 2023 cluster, cut and fit by thresholds, one energy decides here.
``docs/optimal.md`` leads from the model of a scan to the recurrence that finds its minimum.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..features.records import CORNERS, SEGMENTS
from ..kernels import bind
from ..kernels.breakpoints import BORGES_ALDON
from ..kernels.line_fit import WEIGHTED
from ..kernels.optimal import layout as at
from ..kernels.optimal.constants import STEEPEST, STEP_SIGMAS, TAU
from ..kernels.optimal.extraction import extract_rows
from ..kernels.polylines import PLANES, fit_polylines
from ..kernels.vertices import hold_together
from .base import MethodBase
from .parameters import MOST_VERTICES, method, parameter
from .trace import CANDIDATE, intermediates
from .workspace import Block

Array = NDArray[np.float64]

#: Error of a range beyond which a measurement is better left out of a map [m]; distance of
#: neighbours beyond which no line of a map joins them [m]; spacings from a vertex of a map within
#: which its fitted lines meet, for their covariance to be that of the vertex.
_WORST, _LINK, _NEAR = 0.31, 1.0, 2.0
#: Angle of the steepest incidence that parts the scan for a map, from the beam [rad].
_GRAZING = math.radians(4.0)


@method
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
    >>> corners["position"].round(2).tolist()
    [[1.4, -0.5], [3.0, 2.0]]
    """

    name = "optimal"

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
        below=MOST_VERTICES,
    )

    def own_arrays(self, beams: int) -> tuple[tuple[NDArray[Any], ...], Array, NDArray[np.int64]]:
        """Make the workspace of a scan, see `kernels.optimal.layout.Work`, and the two of maps."""
        n, vertices = beams + 2, min(self.max_vertices, beams + 1) + 1
        arrays = (
            np.zeros((at.POINTS, n)),
            np.zeros((at.BEAMS, n), np.int64),
            np.zeros((at.SPANS, n), np.int64),
            np.zeros((n, at.PIECES)),
            np.zeros((at.SUMS, n)),
            np.zeros(at.NOISE),
        )
        return arrays, np.empty((PLANES, n, vertices)), np.empty((n, vertices), np.int64)

    def run(self, block: Block) -> None:
        """Find and measure the features of the scans of a block."""
        if self.max_vertices:
            MethodBase.run(self, block)
            return
        if block.call is None:
            limits = block.range_min, block.range_max, block.circular
            block.call = bind(
                extract_rows, block.ranges, block.extent, block.bearings, block.noise,
                (*limits, self.evidence, self.max_missing), block.own[0], block.tables,
                block.noises, block.counts,
            )  # fmt: skip
        block.call()

    def find(self, block: Block) -> None:
        """Lay the polylines of a map through the scan that a block has taken."""
        _, costs, follow = block.own
        block.part((BORGES_ALDON, 3.0, _GRAZING), self.max_missing, 3)
        limits = follow.shape[1] - 1, self.max_missing, _LINK, _WORST
        fit_polylines(block.floats, block.ints, block.bearings, *limits, costs, follow)
        block.measure(fit=WEIGHTED, reach=_NEAR, gap=float(self.max_missing))
        tables = block.features[SEGMENTS], block.features[CORNERS], block.offsets
        hold_together(block.floats, block.ints, block.row, *tables)

    def intermediates(self, block: Block) -> dict[str, Any]:
        """Return what a trace has besides the features of the scan that was run, by name.

        It has no candidates: all partitions are compared. The evidence is by how much χ² would
        rise: of a corner, if its two segments were one; of a segment, if it were one with the
        neighbour that it is most like (inf without neighbours); of an arc, if lines were in its
        place.
        """
        if self.max_vertices:
            return intermediates(block, self.evidence)
        work, count, n = at.Work(*block.own[0]), int(block.counts[0]), block.beams
        order = np.argsort(work.beams[at.BEAM, :count])
        beam, rho = work.beams[at.BEAM, order], work.points[at.RHO, order]
        filtered, spacing, limit = (np.full(n, np.nan) for _ in range(3))
        filtered[beam] = rho
        before = np.roll(np.arange(count), 1)
        xy = work.points[at.X : at.Y + 1, order]
        spacing[beam] = np.hypot(*(xy - xy[:, before]))
        missing = (beam - beam[before]) % n - 1 > self.max_missing
        limit[beam] = np.where(missing, np.nan, _largest_spacing(xy, rho, before, work.noise))
        if not block.circular and count:
            spacing[beam[0]] = limit[beam[0]] = np.nan
        corners = block.written()[CORNERS]
        return {
            "filtered": filtered,
            "spacing": spacing,
            "distance_threshold": limit,
            "density_threshold": np.full(n, np.nan),
            "candidates": np.zeros(0, CANDIDATE),
            "threshold": self.evidence,
            "cuts": np.sort(corners["beam"]),
            "evidence": _evidence(work, int(block.counts[2])) | {"corners": corners["response"]},
            "scale": TAU,
        }


def _largest_spacing(xy: Array, rho: Array, before: NDArray[np.intp], noise: Array) -> Array:
    """Largest distance of each point from the one before at which a surface goes on [m]."""
    near, far = np.minimum(rho, rho[before]), np.maximum(rho, rho[before])
    cross = np.abs(xy[0, before] * xy[1] - xy[1, before] * xy[0])
    dot = xy[0, before] * xy[0] + xy[1, before] * xy[1]
    step = STEEPEST * cross / far + STEP_SIGMAS * np.sqrt(
        noise[at.CONSTANT] + noise[at.GROWTH] * far**2
    )
    return np.asarray(np.sqrt(step**2 + 2 * np.maximum(near * far - dot, 0)))


def _evidence(work: at.Work, surfaces: int) -> dict[str, Array]:
    """Rise of χ² without each segment and each arc of the last scan."""
    kind, first, end = work.spans[at.KIND, :surfaces], work.spans[at.FIRST], work.spans[at.LAST] + 1
    rise = np.full(surfaces + 1, np.inf)
    for k in range(1, surfaces):
        if kind[k - 1] == kind[k] == at.LINE:
            sums = [work.sums[:, end[m]] - work.sums[:, first[m]] for m in (k - 1, k)]
            rise[k] = _chi_square(sums[0] + sums[1]) - sum(map(_chi_square, sums))
    return {
        "segments": np.minimum(rise[:-1], rise[1:])[kind == at.LINE],
        "arcs": work.pieces[:surfaces, at.GAIN][kind == at.ARC].copy(),
    }


def _chi_square(sums: Array) -> float:
    """Least χ² of a line, by sums of w (xx, xy, yy, x, y, 1)."""
    xx, xy, yy, x, y, s = sums
    line = np.linalg.lstsq([[xx, xy], [xy, yy]], [x, y], rcond=None)[0]
    return float(max(s - line @ [x, y], 0.0))
