"""Point-distance-based segmentation: a scan parted where neighbouring points are far apart.

The rules are those that C. Premebida and U. Nunes collect, *Segmentation and geometric primitives
extraction from 2D laser range data for mobile robot applications*, Robótica 2005; the last is
G. A. Borges and M.-J. Aldon, *Line extraction in 2D range images for mobile robotics*, Journal of
Intelligent and Robotic Systems 40, 2004.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from ..kernels.rivals.pdbs import BORGES_ALDON, DIETMAYER, FIXED, LEE, SANTOS, part_by_distance
from .base import MethodBase
from .checks import check_choice, check_count, check_number
from .steps import measure
from .workspace import Block

__all__ = ["PDBS", "RULES", "check_acute", "part"]

#: Names of the rules.
RULES = {
    "fixed": FIXED,
    "dietmayer": DIETMAYER,
    "santos": SANTOS,
    "lee": LEE,
    "borges_aldon": BORGES_ALDON,
}


@dataclass(frozen=True, slots=True, kw_only=True)
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

    Δφ is the angle between the two readings: where beams between them are missing, the angle over
    all of these and not one step. In a trace, the threshold of Lee's rule is the distance of two
    points with that ratio.

    Parameters
    ----------
    rule : {"borges_aldon", "fixed", "dietmayer", "santos", "lee"}
    distance : float
        D_0 [m].
    c0 : float
        C_0, for the noise of the ranges [m].
    beta : float
        β, the steepest incidence that holds together, in 0..π/2 [rad].
    ratio : float
        r, the largest difference of two ranges over their sum.
    grazing_angle : float
        λ, the least angle between a beam and a surface that holds together, in 0..π/2 [rad]. In
        the paper 10°, which tears many walls that go away from the sensor: preset `paper`.
    noise_factor : float
        Standard deviations of the range that Borges and Aldon add: 3.
    max_missing : int
        Missing beams in a row over which a cluster goes on, if the threshold allows it: over
        more, a doorway would be bridged. Not in the papers.
    min_points : int
        Clusters of fewer points are noise.

    Raises
    ------
    ValueError
        If a parameter is out of bounds. The message names it and its value.

    Examples
    --------
    >>> import lineament as ln
    >>> scan = ln.LaserScan([2.0] * 5 + [2.3] * 5, angle_min=0.0, angle_increment=0.01)
    >>> ln.extract(scan, method="pdbs", rule="fixed", distance=0.2).clusters.tolist()
    [0, 0, 0, 0, 0, 1, 1, 1, 1, 1]
    """

    name: ClassVar[str] = "pdbs"
    presets: ClassVar[tuple[str, ...]] = ("paper",)

    rule: str = "borges_aldon"
    distance: float = 0.3
    c0: float = 0.2
    beta: float = math.radians(80.0)
    ratio: float = 0.05
    grazing_angle: float = math.radians(6.0)
    noise_factor: float = 3.0
    max_missing: int = 5
    min_points: int = 3

    def __post_init__(self) -> None:
        check_choice("rule", self.rule, RULES)
        for name in ("distance", "ratio"):
            check_number(name, getattr(self, name))
        for name in ("c0", "noise_factor"):
            check_number(name, getattr(self, name), or_equal=True)
        for name in ("beta", "grazing_angle"):
            check_acute(name, getattr(self, name))
        check_count("max_missing", self.max_missing, least=0)
        check_count("min_points", self.min_points, least=1)
        self._settle_types()

    @classmethod
    def paper(cls, **changes: Any) -> PDBS:
        """Make the detector of Borges and Aldon with their λ of 10°."""
        return cls(**{"grazing_angle": math.radians(10.0), **changes})

    def find(self, block: Block, row: int) -> None:
        """Part the scan in a block's workspace."""
        constants = {
            "fixed": (self.distance, 0.0),
            "dietmayer": (self.c0, 0.0),
            "santos": (self.c0, self.beta),
            "lee": (self.ratio, 0.0),
            "borges_aldon": (self.noise_factor, self.grazing_angle),
        }
        constant, angle = constants[self.rule]
        part(
            block,
            row,
            rule=RULES[self.rule],
            constant=constant,
            angle=angle,
            max_missing=self.max_missing,
            min_points=self.min_points,
        )
        measure(block, row, gap=self.max_missing + 1.0)


def part(
    block: Block,
    row: int,
    *,
    rule: int = BORGES_ALDON,
    constant: float = 3.0,
    angle: float,
    max_missing: int,
    min_points: int,
) -> None:
    """Part the scan in a block's workspace into clusters: the first step of other methods.

    Parameters
    ----------
    block : Block
        Whose noise is estimated.
    row : int
        Which of its scans that is.
    rule, constant, angle, max_missing, min_points
        As in `kernels.pdbs.part_by_distance`; by default the breakpoint detector of Borges and
        Aldon, with the angle λ and three standard deviations.
    """
    part_by_distance(
        block.floats,
        block.ints,
        block.counts,
        block.bearings,
        block.circular,
        block.range_min,
        block.range_max,
        block.noises[row],
        rule,
        constant,
        angle,
        max_missing,
        min_points,
    )


def check_acute(name: str, angle: float) -> None:
    """Refuse what is not an angle between 0 and π/2."""
    check_number(name, angle)
    if angle >= math.pi / 2:
        raise ValueError(f"{name} is {angle}, expected an angle < π/2")
