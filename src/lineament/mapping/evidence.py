"""How well a pose explains what was seen: beams explained against beams contradicted."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..kernels.mapping.beams import judge
from ..scan import Array
from .index import Index
from .views import NO_VIEWS

#: Shares of the beams that end on a wall of the plan, before one (furniture, people), and behind
#: one, where the pose is right; and where it is one of those that corners suggest, but wrong.
RIGHT, WRONG = (0.70, 0.28, 0.02), (0.30, 0.40, 0.30)
#: The same shares on maps that scans made: what stood there once is passed through, walls bow. Then
#: those at the best of all poses on the map of another building. ``benchmarks/evidence.py --fit``
#: counts both, on the first halves of three real logs.
RIGHT_ON_MAP, WRONG_ON_MAP = (0.84, 0.13, 0.03), (0.19, 0.43, 0.38)
OF_MAPS = (0.80, 0.17, 0.03), (0.39, 0.33, 0.28)
#: At a wrong pose, so many of the beams end near a wall, for each metre across it [1/m].
DENSITY = 0.3
#: Beams near each other fall on the same things: one in so many counts.
TOGETHER = 3.0
#: A wall explains beams past its end, and lets them pass so near to it [m].
MARGIN, SHY = 0.05, 0.15
#: Where nobody has looked, walls go on so far [m]; beams that end elsewhere there say nothing.
#: Those that say something count as this share of all, or more.
GOES_ON, _LEAST = 4.0, 0.2
#: Gate of the kernel, and what a beam at the wall itself says more than one at the gate's mean.
_EXPLAINED, _SHORT, _THROUGH = (
    math.log(right / wrong) for right, wrong in zip(RIGHT, WRONG, strict=True)
)


class Says(NamedTuple):
    """What each beam says [nats]: one that ends at a wall, before one, and that passed through one.

    `opens` is whether walls may be seen through, and stand where a door was: a beam that ends on a
    wall is then explained, whatever it has passed.
    """

    at_wall: float
    short: float
    through: float
    opens: bool = False


ON_DRAWING = Says(_EXPLAINED + 0.5, _SHORT, _THROUGH)


@dataclass(frozen=True, slots=True)
class Evidence:
    """What the beams say of a pose.

    Attributes
    ----------
    log_odds : float
        Logarithm of the likelihood of the beams at this pose over that at a wrong one, less that of
        the number of poses that the plan has room for; on a map that scans made, over that at the
        best pose on a map of another place, unless it was located as on a drawing. Of a scan of a
        `Follower` it is over that at a wrong pose alone. Below 0 chance does as well.
    explained, short, contradicted : float
        Shares of the beams that end on a wall of the plan; before one, on something that the plan
        does not have; and that have passed through a wall of the plan, on a map that scans made
        without ending on another.
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
    says: Says = ON_DRAWING,
    *,
    before: ArrayLike = 0.0,
    best: float = -math.inf,
    apart: float = math.inf,
    views: Array = NO_VIEWS,
) -> Array:
    """Judge poses (n, 3) by beams: log-likelihood ratios and the shares of the beams, (n, 4).

    `spread` is a deviation [m] that is added to those of beams and walls; `says`, what
    beams say [nats]; `before`, what is known of each pose already. The ratio
    is -inf where it cannot come as near to the `best`, of those and those before it, as `apart`.
    With `views` of the plan (see `views_of`), shares are of the beams that end where these look.
    """
    found = np.zeros((len(poses), 4))
    found[:, 0] = before
    if not len(beams):
        return found
    found[:, 0] *= TOGETHER
    of_beams = (*says[:3], spread**2, MARGIN + spread, SHY + spread)
    settings = (*of_beams, best * TOGETHER, apart * TOGETHER, GOES_ON)
    every = np.arange(len(index.walls) if len(views) else 0)
    judge(np.ascontiguousarray(poses), beams, *index, settings, says.opens, views, every, found)
    found[:, 0] /= TOGETHER
    whole = max(beams[:, 6].sum(), 1e-12)
    seen = np.maximum(found[:, 1:].sum(axis=1), _LEAST * whole) if len(views) else whole
    found[:, 1:] /= np.reshape(seen, (-1, 1))
    return found


def on_map(spread: float) -> Says:
    """Return what beams say on a map of scans, where `spread` [m] is added to their errors."""
    at_wall = math.log(RIGHT_ON_MAP[0] / (DENSITY * math.sqrt(2 * math.pi) * spread))
    short, through = (math.log(RIGHT_ON_MAP[k] / WRONG_ON_MAP[k]) for k in (1, 2))
    return Says(at_wall, short, through, opens=True)


def over_chance(shares: tuple[float, float, float], beams: int) -> float:
    """Log-odds of shares of beams on a map: of the right pose over the best on another's map."""
    parts = zip(shares, *OF_MAPS, strict=True)
    return beams / TOGETHER * sum(of * math.log(right / chance) for of, right, chance in parts)
