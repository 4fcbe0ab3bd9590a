"""Point-distance-based segmentation: a scan parted where neighbouring points are far apart.

The rules are those that C. Premebida and U. Nunes collect, *Segmentation and geometric primitives
extraction from 2D laser range data for mobile robot applications*, Robótica 2005; the last is
G. A. Borges and M.-J. Aldon, *Line extraction in 2D range images for mobile robotics*, Journal of
Intelligent and Robotic Systems 40, 2004.
"""

import math
from typing import Any, Self

from lineament.kernels import breakpoints
from lineament.methods.base import MethodBase
from lineament.methods.parameters import method, parameter
from lineament.methods.workspace import Block

#: Names of the rules.
RULES = {
    name: getattr(breakpoints, name.upper())
    for name in ("fixed", "dietmayer", "santos", "lee", "borges_aldon")
}


@method
class PDBS(MethodBase):
    """Clusters of neighbouring points, and the breakpoints between them.

    A partition and no more: it gives neither segments nor corners. Point i begins a new cluster
    where its distance to point i-1 exceeds a threshold, by one of these rules:

    - ``fixed``: `distance`, D_0.
    - ``dietmayer``: C_0 + C_1 min(ρ_i, ρ_{i-1}), with C_1 = √(2 (1 - cos Δφ)) and `c0`.
    - ``santos``: C_0 + C_1 min(ρ_i, ρ_{i-1}) / (cot β (cos Δφ/2 - sin Δφ/2)), with `beta`.
    - ``lee``: not a distance, but a ratio, (ρ_i - ρ_{i-1}) / (ρ_i + ρ_{i-1}), whose size is
      compared with `ratio`.
    - ``borges_aldon``: ρ_{i-1} sin Δφ / sin(λ - Δφ) + 3σ, with `grazing_angle` λ and
      `noise_factor` 3. No surface at λ or more to the beam has a greater spacing.

    Δφ is the angle between the two beams: where beams between them are missing, the angle over
    all of these and not one step. In a trace, the threshold of Lee's rule is the distance of two
    points with that ratio.

    Examples
    --------
    >>> import lineament as ln
    >>> scan = ln.LaserScan([2.0] * 5 + [2.3] * 5, angle_min=0.0, angle_increment=0.01)
    >>> ln.extract(scan, method="pdbs", rule="fixed", distance=0.2).clusters.tolist()
    [0, 0, 0, 0, 0, 1, 1, 1, 1, 1]
    """

    name = "pdbs"
    presets = ("paper",)

    rule: str = parameter("borges_aldon", "the rule", choices=RULES)
    distance: float = parameter(0.3, "D_0", above=0, unit="m")
    c0: float = parameter(0.2, "C_0, for the noise of the ranges", low=0, unit="m")
    beta: float = parameter(
        math.radians(80.0),
        "β, steepest incidence of a surface",
        above=0,
        below=math.pi / 2,
        unit="rad",
    )
    ratio: float = parameter(0.05, "r, largest difference of two ranges over their sum", above=0)
    grazing_angle: float = parameter(
        math.radians(6.0),
        "λ, least angle between a beam and a surface; the paper's 10° (preset `paper`) tear many "
        "walls that go away from the sensor",
        above=0,
        below=math.pi / 2,
        unit="rad",
    )
    noise_factor: float = parameter(
        3.0, "standard deviations of the range that Borges and Aldon add", low=0
    )
    max_missing: int = parameter(
        5,
        "missing beams in a row over which a cluster goes on, if the threshold allows it: over "
        "more, it would go on over a doorway; not in the papers",
        low=0,
    )
    min_points: int = parameter(3, "clusters of fewer points are noise", low=1)

    @classmethod
    def paper(cls, **changes: Any) -> Self:
        """Make the detector of Borges and Aldon with their λ of 10°."""
        return cls(**{"grazing_angle": math.radians(10.0), **changes})

    def find(self, block: Block) -> None:
        """Part the scan in a block's workspace."""
        constants = {
            "fixed": (self.distance, 0.0),
            "dietmayer": (self.c0, 0.0),
            "santos": (self.c0, self.beta),
            "lee": (self.ratio, 0.0),
            "borges_aldon": (self.noise_factor, self.grazing_angle),
        }
        rule = RULES[self.rule], *constants[self.rule]
        block.part(rule, self.max_missing, self.min_points)
        block.measure(gap=self.max_missing + 1.0)
