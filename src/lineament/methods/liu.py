"""Liu et al. 2023: bilateral filter, adaptive clustering, corner operator, least-squares lines.

Y. Liu, L. Sui, P. Li, L. Zhang, Q. Wu, J. Du, Y. Liu, H. Yu, *Journal of Sensors* 2023, article
6991467. ``docs/equations.md`` leads from each equation to its function, and tells what was chosen
where the paper is open.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.bilateral import scratch_shape
from ..kernels.layout import FILTERED, RANGE
from ..kernels.liu import extract_rows
from .base import MethodBase
from .checks import check_choice, check_count, check_number
from .stages import FITS, RESPONSES
from .steps import budget_scratch
from .workspace import Block

__all__ = ["Liu"]


class _Scratch(NamedTuple):
    filter: NDArray[np.float32]
    costs: NDArray[np.float64]
    follow: NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Liu(MethodBase):
    """The method of Liu et al. 2023, and its parameters; defaults are the paper's numbers.

    1. *Filter* the ranges bilaterally, against noise points (equations 4-9).
    2. *Cluster* neighbouring points on distance and density (equations 10-13).
    3. *Cut* each class at its corners: the point farthest from the chord is a primary corner
       (14), and a corner if the corner operator responds (15-22); then both sides in turn.
    4. *Fit* each piece by least squares (23, 24).

    Parameters
    ----------
    sigma_d : float
        Width of the filter along the scan [beams].
    sigma_r : float
        Width of the filter in range [m].
    half_width : int
        Beams on either side that the filter takes in; not stated in the paper.
    spacing_scale : float
        λ of equation 10, not stated: 1/cos of the steepest incidence that holds together (80.4°).
    noise_floor : float
        Added to the distance threshold, in standard deviations √2 σ of the spacing of two
        readings, so that near walls hold together; not in the paper.
    density_k : float
        k of T_K = μ_K + k σ_K (equations 11-13), not stated.
    min_points : int
        Classes of fewer points are noise; pieces are not shorter either.
    support_radius : int
        Beams on either side in the corner operator.
    threshold : float
        What the response of a corner exceeds, in the unit of `response`.
    response : {"tangent", "product", "relative"}
        Reading of equation 22: Σd to the tangent [m], that times Σd to the chord [m²], or that
        over Σ|s| [-].
    fit : {"total", "y_of_x", "weighted"}
        Orthogonal least squares, the paper's y = kx + b, or maximum likelihood.
    measure : {"raw", "filtered"}
        Ranges that lines are fitted to. Detection is always on filtered ones.
    corner : {"intersection", "beam"}
        Whether a corner lies where its lines meet, or on its reading.
    corner_trim : int
        Readings next to a corner, itself included, that the fits leave out where lines meet: the
        filter moves cuts by a beam or two, and these would pull the lines towards each other.
    max_vertices : int
        Pieces are joined or left out until they have no more vertices; 0 allows any number.

    Raises
    ------
    ValueError
        If a parameter is out of bounds. The message names it and its value.

    Examples
    --------
    >>> Liu(support_radius=5).threshold
    0.66
    >>> Liu.paper().fit
    'y_of_x'
    """

    name: ClassVar[str] = "liu"
    presets: ClassVar[tuple[str, ...]] = ("paper", "scale_free")

    sigma_d: float = 4.0
    sigma_r: float = 0.3
    half_width: int = 8
    spacing_scale: float = 6.0
    noise_floor: float = 3.0
    density_k: float = 3.0
    min_points: int = 3
    support_radius: int = 6
    threshold: float = 0.66
    response: str = "tangent"
    fit: str = "total"
    measure: str = "raw"
    corner: str = "intersection"
    corner_trim: int = 2
    max_vertices: int = 0

    def __post_init__(self) -> None:
        for name in ("sigma_d", "sigma_r", "spacing_scale"):
            check_number(name, getattr(self, name))
        for name in ("noise_floor", "density_k", "threshold"):
            check_number(name, getattr(self, name), or_equal=True)
        check_count("half_width", self.half_width, least=0)
        check_count("min_points", self.min_points, least=2)
        check_count("corner_trim", self.corner_trim, least=0)
        check_count("max_vertices", self.max_vertices, least=0)
        check_count("support_radius", self.support_radius, least=1)
        check_choice("response", self.response, RESPONSES)
        check_choice("fit", self.fit, FITS)
        check_choice("measure", self.measure, ("raw", "filtered"))
        check_choice("corner", self.corner, ("intersection", "beam"))
        self._settle_types()

    @classmethod
    def paper(cls, **changes: Any) -> Liu:
        """Make the paper's literal pipeline: its fits, on filtered ranges, corners on readings."""
        return cls(
            **{
                "noise_floor": 0.0,
                "fit": "y_of_x",
                "measure": "filtered",
                "corner": "beam",
                **changes,
            }
        )

    @classmethod
    def scale_free(cls, **changes: Any) -> Liu:
        """Make the reading of the response that does not depend on range, with its own threshold.

        In metres, 0.66 finds right angles only farther than some 3 m, less what the filter takes
        away. ``docs/equations.md`` tells where the threshold comes from.
        """
        return cls(**{"response": "relative", "threshold": 0.25, **changes})

    def own_arrays(self, beams: int) -> _Scratch:
        """Make scratch for the filter and the budget."""
        return _Scratch(
            np.empty(scratch_shape(beams, self.half_width), np.float32),
            *budget_scratch(beams, self.max_vertices),
        )

    def run(self, block: Block) -> None:
        """Filter, cluster, cut and fit the scans of a block."""
        own: _Scratch = block.own
        sharp = self.corner == "intersection"
        extract_rows(
            block.ranges,
            block.rows,
            block.range_min,
            block.range_max,
            block.bearings,
            block.step,
            block.circular,
            block.noise,
            self.sigma_d,
            self.sigma_r,
            self.half_width,
            self.spacing_scale,
            self.noise_floor,
            self.density_k,
            self.min_points,
            self.support_radius,
            self.threshold,
            RESPONSES[self.response],
            RANGE if self.measure == "raw" else FILTERED,
            FITS[self.fit],
            sharp,
            self.corner_trim if sharp else 0,
            block.floats,
            block.ints,
            block.counts,
            own.follow.shape[1] - 1,
            own.filter,
            own.costs,
            own.follow,
            block.noises,
            block.segments,
            block.corners,
            block.breakpoints,
            block.clusters,
            block.offsets,
        )

    @property
    def least_response(self) -> float:
        """What the response of a candidate exceeds where the first search accepts it."""
        return self.threshold
