"""The project's own method: evidence in place of thresholds.

The stages are those of Liu et al. 2023: denoise, cluster, cut at corners, fit. Each decides by
χ², in units of the noise of the scan and of the spacing of its beams; ``docs/methods.md`` tells the
story of each step, and ``docs/results.md`` what each is worth.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..block import Block
from ..kernels import layout
from ..kernels.inverse_range import SUMS
from ..kernels.optimal import (
    ARCS_TOO,
    BORDERS,
    DISSOLVING,
    GROWTH,
    SPIKES,
    STRAIGHTENING,
    UNEVENNESS,
    extract_rows,
)
from ..kernels.polylines import PLANES
from .base import MethodBase
from .checks import check_choice, check_count, check_number

__all__ = ["PARTS", "Optimal"]

#: Parts of the method that can be left out.
PARTS = {
    "spikes": SPIKES,
    "growth": GROWTH,
    "borders": BORDERS,
    "dissolving": DISSOLVING,
    "arcs": ARCS_TOO,
    "straightening": STRAIGHTENING,
    "unevenness": UNEVENNESS,
}


class _Scratch(NamedTuple):
    parts: int
    sums: NDArray[np.float64]
    costs: NDArray[np.float64]
    follow: NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Optimal(MethodBase):
    """Lines, corners and arcs by how much evidence there is for them.

    1. *Noise*: the lattice of the ranges, the constant part and that which grows with range are
       estimated, first from what readings are off the line through their neighbours, then from
       what they are off the lines of pieces, but for those through clutter. Spikes are left out.
    2. *Cluster*: neighbours part where too many beams are missing, or where they are farther
       apart than readings of one surface can be, almost edge-on.
    3. *Cut*: stretches of four readings are merged, the cheapest pair first, while one line
       through both costs less than `evidence` more in χ² (bottom-up, by running sums of the
       inverse-range regression, each in O(1)). Borders are moved to where χ² is least; small
       pieces that neighbours explain dissolve, and readings that are on neither side (mixed
       pixels) are left out. Runs of pieces that one circle explains better are arcs, with
       their steep ends. Neighbours at a shallow angle are one wall: real walls bow. Where they are
       more uneven than the noise, that is added to it for all that is decided from then on.
    4. *Fit* each line by maximum likelihood to the raw ranges. What χ² has too much is put down
       to the wall, and added to its covariance. Neighbours that meet between their readings make
       a corner where they meet; where they do not, and an edge hides what is behind it, the
       cluster ends with the surface.

    Parameters
    ----------
    evidence : float
        How much χ² must rise, if two pieces are taken for one, for them to be two. The response
        of a corner is this rise. More finds less.
    max_missing : int
        Missing beams in a row over which a surface goes on.
    max_vertices : int
        If not 0, a map instead of features: polylines of at most so many vertices in all, such
        that their range error is the least. Their vertices are the corners, and `evidence` and
        `without` do not matter.
    without : tuple of str
        Parts of `PARTS` that are left out, to see what they are worth.

    Raises
    ------
    ValueError
        If a parameter is out of bounds. The message names it and its value.

    Examples
    --------
    >>> import lineament as ln
    >>> from lineament.simulation import SENSORS, room
    >>> scan = SENSORS["paper"].scan(room(), (0.0, 0.0, 0.0), np.random.default_rng(7))
    >>> ln.extract(scan, method="optimal").corners["position"].round(2).tolist()
    [[1.4, -0.5], [3.0, 2.0]]
    """

    name: ClassVar[str] = "optimal"

    evidence: float = 25.0
    max_missing: int = 6
    max_vertices: int = 0
    without: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_number("evidence", self.evidence)
        check_count("max_missing", self.max_missing, least=0)
        check_count("max_vertices", self.max_vertices, least=0)
        if not isinstance(self.without, tuple):
            raise ValueError(f"without is {self.without!r}, expected a tuple of names")
        for part in self.without:
            check_choice("without", part, PARTS)
        self._settle_types()

    def own_arrays(self, beams: int) -> _Scratch:
        """Make room for running sums, and for the vertices of a map."""
        shape = (beams + 2, min(self.max_vertices, beams + 1) + 1)
        return _Scratch(
            sum(bit for part, bit in PARTS.items() if part not in self.without),
            np.empty((2 * beams + 4, SUMS)),
            np.empty((PLANES, *shape)),
            np.empty(shape, np.int64),
        )

    def run(self, block: Block) -> None:
        """Find and measure the features of the scans of a block."""
        own: _Scratch = block.own
        extract_rows(
            block.ranges,
            block.rows,
            block.range_min,
            block.range_max,
            block.bearings,
            block.step,
            block.circular,
            block.noise,
            self.evidence,
            self.max_missing,
            own.parts,
            own.follow.shape[1] - 1,
            block.floats,
            block.ints,
            block.counts,
            own.sums,
            own.costs,
            own.follow,
            block.noises,
            block.segments,
            block.corners,
            block.arcs,
            block.breakpoints,
            block.clusters,
            block.offsets,
        )

    @property
    def least_response(self) -> float:
        """What the response of a candidate exceeds: the evidence that is asked for."""
        return self.evidence

    def report_evidence(self, block: Block) -> dict[str, NDArray[np.float64]]:
        """Tell how much χ² would rise without each feature of the last scan.

        Of a corner, if its two segments were one; of a segment, if it were one with the neighbour
        that it is most like (inf without neighbours); of an arc, if lines were in its place.
        """
        if self.max_vertices:
            return {}
        pieces = block.counts[layout.PIECES]
        rise = np.append(block.floats[layout.RISE, :pieces], np.inf)
        return {
            "segments": np.minimum(rise[:-1], rise[1:]),
            "corners": block.written()[1]["response"],
            "arcs": block.floats[layout.ARC_GAIN, : block.counts[layout.ARCS]].copy(),
        }
