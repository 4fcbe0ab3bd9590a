"""A drive on a plan that is there already: in its frame, and one map with it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import NothingFoundError
from ..scan import Array, Pose
from ..scan.poses import compose, inverse, relative
from ..walls import (
    SHORT,
    Numbers,
    Records,
    bent,
    covariance_at,
    lengths_of,
    moved,
    segments_of,
    turned_back,
    unit,
)
from ..walls.sights import joined, on_lines, sights_of, stretches
from .adjust import Adjusted, edges_of, optimise
from .again import APART
from .chain import TWICE, loosened, unseen
from .gone import along_lines, keys_of, looked_through, pieces_of, standing
from .index import MAPPED
from .line_map import LineMap
from .loops import FLOOR, Survey
from .making import VIEWS, DriveMap, as_known, single
from .parts import beside, boxes_of
from .placing import FEWEST, PLACES, Placement, is_enough, surely_on

#: Walls that are one are looked for so often, poses and walls adjusted in between.
_ROUNDS = 3
#: Walls along each other (45°); others are farther than any [m].
_ALONG, _FAR = 0.7, 1e6


@dataclass(frozen=True, slots=True, eq=False)
class Merged:
    """A drive and a plan as one map, in the frame of the plan.

    How many walls the plan had, and how many of these were seen again; what of them the drive
    looked through [m].
    """

    made: DriveMap
    before: int
    again: int
    gone: float

    def __str__(self) -> str:
        return (
            f"{self.again} of the {self.before} walls of the plan seen again, "
            f"{self.gone:.1f} m of them looked through and left out"
        )


def placements(made: DriveMap, plan: LineMap) -> list[Placement | None]:
    """Find each part of a map on a plan without a first guess; None where that is not sure.

    NothingFoundError if none is found.
    """
    found = [
        surely_on(plan, made.survey, made.parts.frames(k), known)
        for k, known in enumerate(made.parts.deviations.tolist())
    ]
    if not any(found):
        raise NothingFoundError(
            "the drive is not on the plan, or the plan does not say where: expected "
            f"{FEWEST} places along the way, {PLACES:g} m from each other, that agree"
        )
    return found


def onto_plan(made: DriveMap, plan: LineMap, found: list[Placement | None]) -> DriveMap:
    """Move each part of a map into the frame of a plan; those not found lie beside the plan."""
    count, of_scans = made.parts.count, made.parts.numbers[made.frame_of]
    located = tuple(k for k, where in enumerate(found) if where is not None)
    moves = [(0.0, 0.0, 0.0) if where is None else where.move for where in found]
    if len(located) < count:
        ends = [_ends(made, k, move) for k, move in enumerate(moves)]
        points, sizes = np.concatenate((plan.ends.reshape(-1, 2), *ends)), map(len, ends)
        labels = np.repeat(np.arange(count + 1), [2 * len(plan.ends), *sizes])
        shifts = beside(boxes_of(points, labels), np.append(0, np.array(located) + 1))[1:]
        moves = [
            compose((x, y, 0.0), of) for (x, y), of in zip(shifts.tolist(), moves, strict=True)
        ]
    poses = [compose(moves[k], pose) for k, pose in zip(of_scans, made.poses, strict=True)]
    walls = [moved(made.map.walls[made.walls_of == k], inverse(moves[k])) for k in range(count)]
    return replace(
        made,
        map=LineMap(np.concatenate(walls), sigma=MAPPED),
        walls_of=np.repeat(np.arange(count), [len(of) for of in walls]),
        poses=poses,
        located=located,
    )


def _ends(made: DriveMap, part: int, move: Pose) -> Array:
    """Return ends of walls and places of key frames of a part that is moved, (n, 2) [m]."""
    walls = moved(made.map.walls[made.walls_of == part], inverse(move))
    poses = made.survey.poses[made.parts.frames(part)].tolist()
    places = [compose(move, (x, y, theta))[:2] for x, y, theta in poses]
    return np.concatenate((walls["start"], walls["end"], places))


def merge_onto(made: DriveMap, plan: LineMap, found: list[Placement | None]) -> Merged:
    """Make one map of a plan and a drive that was found on it.

    The plan is one more key frame, at the origin, that saw all its walls. From there, loops lead to
    the places that were located; poses and walls are adjusted together, and walls that are one by
    χ² are merged. What the drive looked through, and did not see, is left out; so are parts that
    were not found. NothingFoundError if the places contradict each other once they are adjusted.
    """
    placed = onto_plan(made, plan, found)
    old, loose, is_drawn = _seen_before(plan)
    adjusted, sights = _adjusted(placed, loose, found)
    label, known = np.full(len(old), -1), lengths_of(loose) > SHORT
    lines, is_new = adjusted.with_poses(sights), sights["frame"] < len(made.survey.frames)
    label[known] = sights["wall"][~is_new]
    _add_common(lines, ~is_drawn & np.isin(label, sights["wall"][is_new]), label, old)
    survey = Survey(placed.survey.frames, adjusted.poses, sights, lines)
    is_sure = placed.parts.is_sure & np.isin(placed.parts.numbers, placed.located)
    walls, again, gone = _united(survey, old, label, is_sure)
    frames = zip(made.frame_of.tolist(), made.poses, strict=True)
    poses = [compose(survey.pose(k), relative(made.survey.pose(k), pose)) for k, pose in frames]
    united = LineMap(walls, plan.columns, sigma=MAPPED)
    return Merged(replace(placed, map=united, poses=poses), len(plan.walls), again, gone)


def _seen_before(plan: LineMap) -> tuple[Records, Records, NDArray[np.bool_]]:
    """Return the walls of a plan, then those that may be seen from either side turned back.

    As they are, and as they are beside the walls around them: known to `MAPPED`, also those of
    drawings, which say nothing of it; and which these are.
    """
    old = np.append(plan.walls, turned_back(plan.walls[plan.walls["side"] == 0]))
    is_drawn = np.asarray(~old["covariance"].any(axis=(1, 2)))
    old["covariance"][is_drawn] = bent(MAPPED**2, lengths_of(old))[is_drawn]
    loose = old.copy()
    loose["covariance"] /= np.maximum(old["covariance"][:, :1, :1] / MAPPED**2, 1.0)
    return old, loose, is_drawn


def _add_common(lines: Records, again: NDArray[np.bool_], label: Numbers, old: Records) -> None:
    """Add to the covariances of lines what the walls of a map are off together.

    What a drive sees on a map is known beside the walls around it. Those of the map hold what they
    are all off; any other line has that of the nearest along it that was seen again. Walls of
    drawings are each off by themselves.
    """
    at = np.flatnonzero(again)
    if not len(at):
        return
    near = old[at]
    away = np.linalg.norm(lines["centroid"][:, None] - near["centroid"], axis=2)
    facing = np.cos(lines["angle"][:, None] - near["angle"])
    best = (away + np.where(abs(facing) < _ALONG, _FAR, 0.0)).argmin(axis=1)
    best[label[at]] = np.arange(len(at))
    side = np.sign(facing[np.arange(len(lines)), best])
    arm = ((lines["centroid"] - near["centroid"][best]) * unit(lines["angle"])).sum(axis=1)
    spread = near["covariance"][best]
    spread[:, [0, 1], [1, 0]] *= side[:, None]
    lines["covariance"] += covariance_at(spread, arm)


def _adjusted(
    placed: DriveMap, loose: Records, found: list[Placement | None]
) -> tuple[Adjusted, Records]:
    """Adjust the poses of a drive, the last of which is the plan, and the walls of both."""
    parts, sights, n = placed.parts, placed.survey.sights, len(placed.survey.frames)
    sights = sights[np.isin(parts.numbers[sights["frame"]], placed.located)]
    of_plan = sights_of([(segments_of(loose), np.arange(len(loose)))])
    of_plan["frame"], of_plan["wall"] = n, of_plan["wall"] + sights["wall"].max() + 1
    sights = np.append(sights, of_plan)
    sights["wall"] = np.unique(sights["wall"], return_inverse=True)[1]
    places = {q: where for of in found if of is not None for q, where in of.places.items()}
    spreads = [where.covariance + FLOOR for where in places.values()]
    motions = [where.pose for where in places.values()]
    ties = edges_of([(n, q) for q in places], motions, spreads, loop=True)
    apart = np.setdiff1d(np.arange(parts.count), placed.located)
    poses = np.array([*(placed.poses[of.index] for of in placed.survey.frames), (0.0, 0.0, 0.0)])
    held = np.append(parts.roots[apart], n)
    edges = np.append(placed.chain, ties)
    adjusted = optimise(poses, edges, sights, held=held)
    right, of_ties = adjusted.right[-len(ties) :], parts.numbers[ties["ends"][:, 1]]
    for k in placed.located:
        if not is_enough(*(int((of_ties == k)[of].sum()) for of in (right, ~right))):
            raise NothingFoundError("places of the drive on the plan contradict each other")
    ties = ties[right]
    ties["information"], ties["loop"] = ties["information"] / TWICE, False
    edges = np.append(placed.chain, ties)
    for _ in range(_ROUNDS):
        sights, _ = joined(sights, APART, adjusted.poses)
        adjusted = optimise(adjusted.poses, edges, sights, held=held, rounds=2)
    loose = loosened(edges, unseen(placed.survey.frames))
    return as_known(adjusted, loose, sights, held), sights


def _united(
    survey: Survey, old: Records, label: Numbers, is_sure: NDArray[np.bool_]
) -> tuple[Records, int, float]:
    """Return the walls of both, how many of the old ones were seen again, and the length gone [m].

    The last pose of the survey is that of the plan; `label` is the line of each old wall.
    """
    is_new = survey.sights["frame"] < len(survey.frames)
    own = replace(survey, sights=survey.sights[is_new])
    new, begin, end, counts = standing(own, min(VIEWS, len(own.frames)), is_sure)
    is_again = np.isin(label, new)
    is_left, either = _again(old, is_again)
    pieces, of = pieces_of(old)
    along = along_lines(survey.lines[label[of]], pieces)
    is_gone = looked_through(own, pieces, label[of], is_sure)
    both, left = is_again[of] & ~is_gone, is_left[of] & ~is_gone
    # Where both saw a wall, it goes as far as either did.
    at, first, last, _ = stretches(
        np.append(new, label[of][both]),
        np.append(begin, along[both, 0]),
        np.append(end, along[both, 1]),
    )
    seen = np.zeros(len(at), np.int64)
    np.add.at(
        seen, np.searchsorted(keys_of(at, first), keys_of(new, begin), side="right") - 1, counts
    )
    walls = on_lines(survey.lines, at, first, last, np.maximum(seen, 1))
    by_wall = along_lines(old[of], pieces)[left]
    at, first, last, _ = stretches(of[left], by_wall[:, 0], by_wall[:, 1], gap=1e-6)
    rest = on_lines(old, at, first, last, old["views"][at])
    rest["side"] = old["side"][at]
    is_one = rest["side"] == 1
    walls = np.append(single(np.append(walls, rest[is_one])), rest[~is_one])
    gone = lengths_of(pieces[is_gone & (is_left | is_again)[of]]).sum()
    return walls, either, float(gone)


def _again(old: Records, is_again: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], int]:
    """Return which old walls stay as they are, and how many were seen again.

    Of one that may be seen from either side, only the sides that were seen count, if any was.
    """
    is_both = old["side"] == 0
    m = len(old) - int(is_both.sum()) // 2
    either, is_left = is_again[:m].copy(), np.zeros(len(old), bool)
    either[is_both[:m]] |= is_again[m:]
    is_left[:m] = ~either
    return is_left, int(either.sum())
