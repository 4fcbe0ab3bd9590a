"""Where a drive lies on a plan: places along the way that are located there, and agree."""

from dataclasses import dataclass

import numpy as np

from ..scan import Pose
from ..scan.poses import compose, inverse
from ..walls import Numbers, wrapped
from .line_map import LineMap
from .locate import MOST_CONTRADICTED, Location, locate
from .loops import Survey

#: Key frames are looked for on a plan from places so far apart [m]; places that agree [m, rad].
PLACES, _AGREE = 3.0, (0.5, 0.05)
#: Places may be off by so many deviations of the way between them.
_OFF = 3.0
#: Errors of a drive on a plan beside that [m, rad]; of its places that are located there or look
#: through walls of the plan, no larger share looks through.
_NEAR, _LOOK_THROUGH = (0.2, 0.05), 0.5
#: So many places agree at least, and so many times as many as are located elsewhere.
FEWEST, _MORE = 3, 3


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """The motion that puts key frames onto a plan.

    `places` are those that were located and agree, by key frame; `others` are located elsewhere.
    """

    move: Pose
    places: dict[int, Location]
    others: int


def surely_on(plan: LineMap, survey: Survey, frames: Numbers, known: float) -> Placement | None:
    """Find some key frames on a plan as `placed_on`; None if they may be elsewhere.

    Enough places agree, and few enough do not, wherever on the plan these are. Where the others are
    looked at there, few look through its walls beside those that are located: the mirror image of a
    floor has places that are alike, but other doors. Places off the plan say nothing.
    """
    found = placed_on(plan, survey, frames, known)
    if found is None or not is_enough(len(found.places), found.others):
        return None
    way, turn = _NEAR
    spread = np.diag((way + known, way + known, turn)) ** 2
    looked = [
        locate(query, plan, compose(found.move, survey.pose(q)), spread)
        for q, query in survey.queries(PLACES, frames)
        if q not in found.places
    ]
    there = len(found.places) + sum(map(bool, looked))
    through = sum(not of and of.evidence.contradicted > MOST_CONTRADICTED for of in looked)
    return found if through <= _LOOK_THROUGH * (through + there) else None


def is_enough(agree: int, others: int) -> bool:
    """Whether that many places that agree are enough, beside others."""
    return agree >= max(FEWEST, _MORE * others)


def placed_on(plan: LineMap, survey: Survey, frames: Numbers, known: float) -> Placement | None:
    """Find the motion that puts some key frames where the plan shows what they saw.

    Places along the way are looked for without a first guess; most of those that are located agree
    on it, as far as they are `known` to each other (one deviation [m]). None if none is located.
    """
    every = ((q, locate(query, plan)) for q, query in survey.queries(PLACES, frames))
    places = {q: where for q, where in every if where}
    if not places:
        return None
    moves = [compose(where.pose, inverse(survey.pose(q))) for q, where in places.items()]
    # Compared where the key frames are, not at their origin.
    x, y = survey.poses[frames, :2].mean(axis=0).tolist()
    ends, turns = np.array([compose(m, (x, y, 0.0)) for m in moves]), np.array(moves)[:, 2]
    agree = np.abs(wrapped(turns[:, None] - turns)) < _AGREE[1]
    agree &= np.linalg.norm(ends[:, None, :2] - ends[:, :2], axis=2) < _AGREE[0] + _OFF * known
    best = int(agree.sum(axis=1).argmax())
    chosen = [q for q, is_one in zip(places, agree[best].tolist(), strict=True) if is_one]
    others = len(places) - len(chosen)
    return Placement(moves[best], {q: places[q] for q in chosen}, others)
