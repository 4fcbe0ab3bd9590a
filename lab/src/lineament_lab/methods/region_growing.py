"""Seeded region growing: lines that grow from a few points both ways.

H. Gao, X. Zhang, Y. Fang, J. Yuan, *A line segment extraction algorithm using laser data based on
seeded region growing*, International Journal of Advanced Robotic Systems 15(1), 2018.
"""

from operator import attrgetter
from typing import Any, ClassVar

from lineament.methods.parameters import method, parameter
from lineament.methods.workspace import Block

from ..kernels.region_growing import Parameters, grow_regions
from ..kernels.settling import divide_overlaps
from .lines import NearMethod

_numbers = attrgetter(*Parameters._fields)


@method
class RegionGrowing(NearMethod):
    """The method of Gao et al. 2018, its thresholds scaled by the noise.

    1. *Part* the scan at its breakpoints.
    2. *Seed*: `s_num` consecutive points, each near the line fitted to them, and near the point
       where its own beam meets that line.
    3. *Grow* the seed both ways, point by point by the same two tests, fitting again each time.
    4. *Overlaps* of neighbouring regions: parted where both lines fit best. Neighbours that one
       line fits are merged, those whose lines meet at their ends have a corner there.
    """

    name = "region_growing"
    published: ClassVar[dict[str, Any]] = {
        "clusters": "none",
        "epsilon": 0.05,
        "delta": 0.1,
        "sigmas": 0.0,
        "p_min": 10,
        "fit": "total",
    }

    s_num: int = parameter(6, "points of a seed", low=3)
    p_min: int = parameter(6, "least points of a region", low=3)
    l_min: float = parameter(0.0, "least length of a region", low=0, unit="m")
    delta: float = parameter(
        0.1, "the same along the beam: from where the beam meets the line", low=0, unit="m"
    )
    sigmas: float = parameter(
        3.0, "standard deviations of its range noise that a point may lie off besides", low=0
    )

    def find(self, block: Block) -> None:
        """Part, seed and grow, settle the overlaps and fit."""
        self.part(block, self.s_num, self.noise_factor)
        grow_regions(*block.workspace, _numbers(self))
        self.finish(block)

    def leave(self, block: Block) -> None:
        """Divide what two regions share."""
        divide_overlaps(block.floats, block.ints)
        NearMethod.leave(self, block)
