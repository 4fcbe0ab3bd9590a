"""How well a pose explains what was seen: beams explained against beams contradicted."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..kernels.mapping.beams import judge
from ..scan import Array
from .index import Index

#: Shares of the beams that end on a wall of the plan, before one (furniture, people), and behind
#: one, where the pose is right; and where it is one of those that corners suggest, but wrong.
RIGHT, WRONG = (0.70, 0.28, 0.02), (0.30, 0.40, 0.30)
#: Beams near each other fall on the same things: one in so many counts.
TOGETHER = 3.0
#: A wall explains beams past its end, and lets them pass so near to it [m].
MARGIN, SHY = 0.05, 0.15
#: Gate of the kernel, and what a beam at the wall itself says more than one at the gate's mean.
_EXPLAINED, _SHORT, _THROUGH = (
    math.log(right / wrong) for right, wrong in zip(RIGHT, WRONG, strict=True)
)


@dataclass(frozen=True, slots=True)
class Evidence:
    """What the beams say of a pose.

    Attributes
    ----------
    log_odds : float
        Logarithm of the likelihood of the beams at this pose over that at a wrong one, less that of
        the number of poses that the plan has room for: below 0 chance does as well.
    explained, short, contradicted : float
        Shares of the beams that end on a wall of the plan; before one, on something that the plan
        does not have; and that have passed through a wall of the plan.
    beams : int
        Number of beams.
    """

    log_odds: float
    explained: float
    short: float
    contradicted: float
    beams: int


def evidence_of(
    poses: Array,
    beams: Array,
    index: Index,
    spread: float,
    through: float = _THROUGH,
    *,
    before: ArrayLike = 0.0,
    best: float = -math.inf,
    apart: float = math.inf,
) -> Array:
    """Judge poses (n, 3) by beams: log-likelihood ratios and the shares of the beams, (n, 4).

    `spread` is a deviation [m] that is added to those of beams and walls; `through`, what a beam
    says that passes through a wall [nats]; `before`, what is known of each pose already. The ratio
    is -inf where it cannot come as near to the `best`, of those and those before it, as `apart`.
    """
    found = np.zeros((len(poses), 4))
    found[:, 0] = before
    if not len(beams):
        return found
    found[:, 0] *= TOGETHER
    of_beams = (_EXPLAINED + 0.5, _SHORT, through, spread**2, MARGIN + spread, SHY + spread)
    settings = (*of_beams, best * TOGETHER, apart * TOGETHER)
    judge(np.ascontiguousarray(poses), beams, *index, settings, found)
    found[:, 0] /= TOGETHER
    found[:, 1:] /= max(beams[:, 6].sum(), 1e-12)
    return found
