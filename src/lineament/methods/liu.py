"""Liu et al. 2023: bilateral filter, adaptive clustering, corner operator, least-squares lines.

Y. Liu, L. Sui, P. Li, L. Zhang, Q. Wu, J. Du, Y. Liu, H. Yu, *Journal of Sensors* 2023, article
6991467. ``docs/equations.md`` leads from each equation to its function, and says what was chosen
where the paper is open.
"""

from dataclasses import asdict
from typing import Any, Self

import numpy as np

from ..kernels import bind
from ..kernels.bilateral import scratch_shape
from ..kernels.corner_operator import RESPONSES
from ..kernels.layout import FILTERED, RANGE
from ..kernels.line_fit import FITS
from ..kernels.liu import Parameters, extract_rows
from .base import MethodBase
from .parameters import MOST_VERTICES, method, parameter
from .trace import intermediates
from .workspace import Block, budget_scratch


@method
class Liu(MethodBase):
    """The method of Liu et al. 2023, and its parameters; defaults are the paper's numbers.

    1. *Filter* the ranges bilaterally, against noise points (equations 4-9).
    2. *Cluster* neighbouring points on distance and density (equations 10-13).
    3. *Cut* each cluster at its corners: the point farthest from the chord is a primary corner
       (14), and a corner if the corner operator responds (15-22); then both sides in turn.
    4. *Fit* each piece by least squares (23, 24).

    Examples
    --------
    >>> Liu(support_radius=5).threshold
    0.66
    >>> Liu.paper().fit, Liu.figure9().response
    ('y_of_x', 'product_scaled')
    """

    name = "liu"
    presets = ("paper", "figure9", "tuned", "scale_free")

    sigma_d: float = parameter(4.0, "width of the filter along the scan", above=0, unit="beams")
    sigma_r: float = parameter(0.3, "width of the filter in range", above=0, unit="m")
    half_width: int = parameter(
        2, "beams on either side that the filter takes in; not stated", low=0
    )
    spacing_scale: float = parameter(
        6.0,
        "λ of equation 10, not stated: 1/cos of the steepest incidence that holds together (80.4°)",
        above=0,
    )
    noise_floor: float = parameter(
        3.0,
        "added to the distance threshold, in deviations √2 σ of the spacing of two measurements, "
        "so that near walls hold together; not in the paper",
        low=0,
    )
    density_k: float = parameter(3.0, "k of T_K = μ_K + k σ_K (equations 11-13), not stated", low=0)
    min_points: int = parameter(
        3, "clusters of fewer points are noise; pieces are not shorter either", low=2
    )
    support_radius: int = parameter(6, "beams on either side in the corner operator", low=1)
    threshold: float = parameter(
        0.66, "what the response of a corner exceeds, in the unit of `response`", low=0
    )
    response: str = parameter(
        "tangent",
        "equation 22, which is Σd to the tangent [m], or what else the paper may mean: that times "
        "Σd to the chord [m²], Σd over Σ|s| or over the length of the chord [-], or the product "
        "over its square [-]",
        choices=RESPONSES,
    )
    recursion: str = parameter(
        "both",
        "whether both sides of a corner are searched in turn, or that after it alone, which is "
        "step 7 to the letter",
        choices=("both", "after"),
    )
    ends: str = parameter(
        "truncated",
        "whether the support of points near an end of their cluster is cut short, or such points "
        "are no corners; not stated",
        choices=("truncated", "excluded"),
    )
    fit: str = parameter(
        "total",
        "orthogonal least squares; the paper's y = kx + b, with x = ky + b where a wall is steeper "
        "than 45° (`y_of_x`) or to the letter (`slope_intercept`); or maximum likelihood",
        choices=FITS,
    )
    measure: str = parameter(
        "raw",
        "ranges that lines are fitted to; detection is always on filtered ones",
        choices=("raw", "filtered"),
    )
    corner: str = parameter(
        "intersection",
        "whether a corner lies where its lines meet, or on its measurement",
        choices=("intersection", "beam"),
    )
    corner_trim: int = parameter(
        2,
        "measurements next to a corner, itself included, that fits leave out where lines meet: "
        "the filter moves cuts by a beam or two, and these would pull the lines together",
        low=0,
    )
    max_vertices: int = parameter(
        0,
        "pieces are joined or left out until they have no more vertices; 0: any number",
        low=0,
        below=MOST_VERTICES,
    )

    @classmethod
    def paper(cls, **changes: Any) -> Self:
        """Make the paper's own last steps: its fits, filtered ranges, corners on measurements.

        The response is the prose of equation 22, as in `Liu`.
        """
        plain = {"noise_floor": 0.0, "fit": "y_of_x", "measure": "filtered", "corner": "beam"}
        return cls(**{**plain, **changes})

    @classmethod
    def figure9(cls, **changes: Any) -> Self:
        """Make `paper` with the response, of five, that brings Figure 9 nearest.

        It is relative, as is the operator that the paper cites, and has the product that the text
        of the figure names; chosen after the fact, see ``docs/equations.md``.
        """
        return cls.paper(**{"response": "product_scaled", **changes})

    @classmethod
    def tuned(cls, **changes: Any) -> Self:
        """Make the same steps with other numbers, chosen by F1 of corners in simulated scenes.

        The filter is off. The command is ``python benchmarks/tune_liu.py``.
        """
        chosen = {"half_width": 0, "response": "relative", "threshold": 0.5, "support_radius": 7}
        return cls(**{**chosen, "spacing_scale": 8.0, "density_k": 0.0, **changes})

    @classmethod
    def scale_free(cls, **changes: Any) -> Self:
        """Make the response that does not depend on range, with its own threshold.

        In metres, 0.66 finds right angles only farther than some 3 m, less what the filter takes
        away. ``docs/equations.md`` says where the threshold comes from.
        """
        return cls(**{"half_width": 8, "response": "relative", "threshold": 0.25, **changes})

    def own_arrays(self, beams: int) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """Make the parameters as the kernel takes them, and scratch for filter and budget."""
        costs, follow = budget_scratch(beams, self.max_vertices)
        sharp = self.corner == "intersection"
        codes = {
            "response": RESPONSES[self.response],
            "measure": RANGE if self.measure == "raw" else FILTERED,
            "recursion": self.recursion == "both",
            "ends": self.ends == "excluded",
            "fit": FITS[self.fit],
            "corner": sharp,
            "corner_trim": self.corner_trim if sharp else 0,
            "max_vertices": follow.shape[1] - 1,
        }
        filtering = np.empty(scratch_shape(beams, self.half_width), np.float32)
        return tuple(Parameters(**{**asdict(self), **codes})), (filtering, costs, follow)

    def run(self, block: Block) -> None:
        """Filter, cluster, cut and fit the scans of a block."""
        if block.call is None:
            parameters, scratch = block.own
            block.call = bind(
                extract_rows, block.ranges, block.extent, block.bearings, block.sensor, block.noise,
                parameters, block.floats, block.ints, scratch, block.noises, block.tables,
            )  # fmt: skip
        block.call()

    def intermediates(self, block: Block) -> dict[str, Any]:
        """Return what a trace has besides the features of the scan that was run, by name."""
        return intermediates(block, self.threshold)
