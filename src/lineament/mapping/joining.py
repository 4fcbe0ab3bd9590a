"""Loops of a drive, and what follows a lost key frame put where it was seen before."""

from functools import partial
from itertools import pairwise

import numpy as np

from ..progress import Track, untracked
from ..scan.poses import compose, inverse, relative
from ..walls import Numbers, Records
from .adjust import Adjusted, edges_of, errors_of_motions, optimise
from .drive_map import KeyFrame
from .line_map import LineMap
from .locate import Location, locate
from .loops import FLOOR, Survey
from .parts import between
from .placing import PLACES

#: Loops are looked for so far off at first; once those are closed, so much farther than the graph
#: says [m, rad]. Before, in bare corridors, it knows so little that wrong ones are found.
_SPREADS = (0.8, 0.12), (0.3, 0.06)
#: Places agree if they are off the way between them by less, squared over its covariance and over
#: that of a map that is not adjusted yet [m, m, rad].
_AGREE, _BENT = 16.0, np.diag((0.1, 0.1, 0.02)) ** 2
#: So many places agree at least, and so many times as many as are located elsewhere. One alone may
#: be a place that looks alike.
_FEWEST, _MORE = 2, 3


def closed(
    frames: list[KeyFrame],
    chain: Records,
    found: Adjusted,
    sights: Records,
    track: Track = untracked,
) -> tuple[Adjusted, Records, Records]:
    """Return the poses with their loops closed, these loops, and those that contradict them."""
    loops = refused = edges_of([], [], [])
    for k, spread in enumerate(_SPREADS):
        if k:
            found = joined(frames, found, np.append(chain, loops), sights, track)
        known = partial(between, found.poses, solve=found.solver()) if k else None
        near = Survey(frames, found.poses, sights, found.lines).loops(spread, known, track)
        if len(near):
            found = optimise(found.poses, np.append(chain, near), sights)
            right = found.right[len(chain) :]
            loops, refused = near[right], near[~right]
    return found, loops, refused


def joined(
    frames: list[KeyFrame],
    found: Adjusted,
    edges: Records,
    sights: Records,
    track: Track = untracked,
) -> Adjusted:
    """Return the poses, with what follows each lost key frame where most of its places are.

    Places on the map of what came before agree as far as the way between them is known, in pairs.
    What was not seen before is looked for once more, on all the rest.
    """
    every = np.arange(len(frames))
    lost = [k for k, frame in enumerate(frames) if frame.is_torn]
    spans = list(pairwise([*lost, len(frames)]))
    for is_again in (False, True):
        for first, last in spans.copy():
            survey, here = Survey(frames, found.poses, sights, found.lines), every[first:last]
            rest = np.setdiff1d(every, here) if is_again else every[:first]
            places = _located(survey, here, rest, track)
            chosen, at = _agreeing(places, found)
            if len(chosen) >= max(_FEWEST, _MORE * (len(places) - len(chosen))):
                q = list(places)[at]
                move = compose(places[q].pose, inverse(survey.pose(q)))
                moved = here if is_again else every[first:]
                poses = found.poses.copy()
                poses[moved] = [compose(move, survey.pose(k)) for k in moved.tolist()]
                edges = np.append(edges, _ties(survey, {q: places[q] for q in chosen}, rest))
                found = optimise(poses, edges, sights)
                spans.remove((first, last))
    return found


def _located(survey: Survey, frames: Numbers, others: Numbers, track: Track) -> dict[int, Location]:
    """Return the key frames that are located on the walls that others see."""
    walls = survey.walls((0.0, 0.0, 0.0), others)
    if not len(walls):
        return {}
    plan = LineMap(walls)
    every = ((q, locate(query, plan)) for q, query in survey.queries(PLACES, frames, track))
    return {q: where for q, where in every if where}


def _agreeing(places: dict[int, Location], found: Adjusted) -> tuple[list[int], int]:
    """Return the places that agree with the one with which most do, and its index."""
    if not places:
        return [], 0
    every, n = np.array(list(places)), len(places)
    a, b = np.triu_indices(n, 1)
    agree, pairs = np.eye(n, dtype=bool), np.column_stack((every[a], every[b]))
    if n > 1:
        at = [where.pose for where in places.values()]
        motions = [relative(at[i], at[j]) for i, j in zip(a.tolist(), b.tolist(), strict=True)]
        spreads = between(found.poses, pairs, found.solver()) + _BENT
        edges = edges_of(pairs, motions, spreads)
        off = errors_of_motions(edges, found.poses)[0]
        squares = np.einsum("ni,nij,nj->n", off, edges["information"], off)
        agree[a, b] = agree[b, a] = squares < _AGREE
    best = int(agree.sum(axis=1).argmax())
    return every[agree[best]].tolist(), best


def _ties(survey: Survey, places: dict[int, Location], others: Numbers) -> Records:
    """Return places as loops to the nearest of other key frames."""
    ends, motions = [], []
    for q, where in places.items():
        away = np.hypot(*(survey.poses[others, :2] - where.pose[:2]).T)
        ends.append((int(others[away.argmin()]), q))
        motions.append(relative(survey.pose(ends[-1][0]), where.pose))
    spreads = [where.covariance + FLOOR for where in places.values()]
    return edges_of(ends, motions, spreads, loop=True)
