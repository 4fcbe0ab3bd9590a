"""The intermediates of method `optimal`, read from its workspace after a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..kernels.layout import FILTERED
from ..kernels.optimal.constants import SIGMAS, STEEPEST, TAU
from ..kernels.optimal.layout import ARC, BEAM, FIRST, GAIN, KIND, LAST, LINE, RHO, Work, X, Y
from ..scan import LaserScan
from .trace import CANDIDATE, Trace
from .workspace import Block

if TYPE_CHECKING:
    from .optimal import Optimal

__all__ = ["evidence_of", "trace_of"]

Array = NDArray[np.float64]


def trace_of(block: Block, method: Optimal, scan: LaserScan, features: Features) -> Trace:
    """Make the trace of the scan that `optimal` has just run on."""
    own, count, n = Work(*block.own.arrays), int(block.counts[0]), len(scan)
    order = np.argsort(own.beams[BEAM, :count])
    beam, rho = own.beams[BEAM, order], own.points[RHO, order]
    filtered, spacing, limit = (np.full(n, np.nan) for _ in range(3))
    filtered[beam] = rho
    before = np.roll(np.arange(count), 1)
    xy = own.points[X : Y + 1, order]
    spacing[beam] = np.hypot(*(xy - xy[:, before]))
    missing = (beam - beam[before]) % n - 1 > method.max_missing
    limit[beam] = np.where(missing, np.nan, _largest_spacing(xy, rho, before, own.noise))
    if not block.circular and count:
        spacing[beam[0]] = limit[beam[0]] = np.nan
    block.floats[FILTERED, :n] = filtered
    return Trace(
        scan=scan,
        method=method.name,
        features=features,
        filtered=filtered,
        spacing=spacing,
        distance_threshold=limit,
        density_threshold=np.full(n, np.nan),
        clusters=features.clusters,
        candidates=np.zeros(0, CANDIDATE),
        threshold=method.evidence,
        cuts=np.sort(features.corners["beam"][features.corners["kind"] != "edge"]),
        evidence=evidence_of(block),
        scale=TAU,
    )


def _largest_spacing(xy: Array, rho: Array, before: NDArray[np.intp], noise: Array) -> Array:
    """Largest distance of each point from the one before at which a surface goes on [m]."""
    near, far = np.minimum(rho, rho[before]), np.maximum(rho, rho[before])
    cross = np.abs(xy[0, before] * xy[1] - xy[1, before] * xy[0])
    dot = xy[0, before] * xy[0] + xy[1, before] * xy[1]
    step = STEEPEST * cross / far + 2 * SIGMAS * np.sqrt(noise[0] + noise[1] * far**2)
    return np.asarray(np.sqrt(step**2 + 2 * np.maximum(near * far - dot, 0)))


def evidence_of(block: Block) -> dict[str, Array]:
    """Rise of χ² without each feature of the last scan, by table."""
    own, surfaces = Work(*block.own.arrays), int(block.counts[2])
    kind, first, end = own.spans[KIND, :surfaces], own.spans[FIRST], own.spans[LAST] + 1
    rise = np.full(surfaces + 1, np.inf)
    for k in range(1, surfaces):
        if kind[k - 1] == kind[k] == LINE:
            sums = [own.sums[end[m]] - own.sums[first[m]] for m in (k - 1, k)]
            rise[k] = _chi_square(sums[0] + sums[1]) - sum(map(_chi_square, sums))
    return {
        "segments": np.minimum(rise[:-1], rise[1:])[kind == LINE],
        "corners": block.written()[1]["response"],
        "arcs": own.pieces[:surfaces, GAIN][kind == ARC].copy(),
    }


def _chi_square(sums: Array) -> float:
    """Least χ² of a line, by sums of w (xx, xy, yy, x, y, 1)."""
    xx, xy, yy, x, y, s = sums
    line = np.linalg.lstsq([[xx, xy], [xy, yy]], [x, y], rcond=None)[0]
    return float(max(s - line @ [x, y], 0.0))
