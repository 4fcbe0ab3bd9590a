"""Walls that are seen again: which of them are one, as far as the places are known."""

import math
from collections.abc import Callable
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from ..scan import Array
from ..scan.poses import relative
from ..walls import Numbers, Records
from ..walls.sights import count_of, renumbered, same
from .adjust import Adjusted, optimise
from .consistency import LEAST, agreement
from .loops import Survey
from .parts import between

#: Surfaces that are so much off a common line are one wall [m].
APART = 0.015
#: Walls are one only if the places that they are seen from are known so well across them [m].
#: Where poses are off by more, another surface lies there: the other side of a recess, a wall of
#: the next room on nearly the same line.
_KNOWN = 0.1
#: From places that are so near each other, what was seen can be compared: if it agrees, they are
#: known as well [m].
_NEAR = 1.0
#: What is one ties the poses, by which more places are known: so many times.
_ROUNDS = 3

Pair = tuple[int, int]


def tied(survey: Survey, edges: Records, chain: Records, held: Numbers) -> Survey:
    """Return a survey with one number for walls that are one, and the poses that this ties.

    `edges` are all that is known of the poses beside the walls, loops included; `chain` what they
    are adjusted by, of which some are held.
    """
    for _ in range(_ROUNDS):
        graph = optimise(survey.poses, edges, survey.sights, held=held, rounds=0)
        sights = renumbered(survey.sights, _one(survey, graph))
        found = optimise(survey.poses, chain, sights, held=held, rounds=2)
        survey = Survey(survey.frames, found.poses, sights, found.lines)
    return survey


def _one(survey: Survey, graph: Adjusted) -> Numbers:
    """Return pairs of walls (m, 2) that are the `same`, and are seen from known places."""
    sights, solve = survey.sights, graph.solver()
    right, wrong = set[Pair](), set[Pair]()
    order = np.argsort(sights["wall"], kind="stable")
    begins = np.searchsorted(sights["wall"][order], np.arange(1, count_of(sights)))
    seen_from = [np.unique(of) for of in np.split(sights["frame"][order], begins)]
    while True:
        pairs = same(sights, survey.poses, graph.lines, APART, wrong)
        new = [(k, j) for k, j in pairs.tolist() if (k, j) not in right]
        nearest = [_nearest(survey.poses, seen_from[k], seen_from[j]) for k, j in new]
        angles = graph.lines["angle"][[j for _, j in new]]
        known = _known(survey, solve, nearest, angles)
        if known.all():
            return pairs
        right.update(compress(new, known))
        wrong.update(compress(new, ~known))


def _nearest(poses: Array, some: Numbers, others: Numbers) -> Pair:
    """Return those of two sets of key frames that are nearest to each other, in order."""
    away = np.hypot(*(poses[some, None, :2] - poses[others, :2]).transpose(2, 0, 1))
    i, k = np.unravel_index(away.argmin(), away.shape)
    first, last = sorted((int(some[i]), int(others[k])))
    return first, last


def _known(
    survey: Survey, solve: Callable[[Array], Array], nearest: list[Pair], angles: Array
) -> NDArray[np.bool_]:
    """Return whether two key frames each know where the other is, across a wall at an angle."""
    frames, known = survey.frames, np.zeros(len(nearest), bool)
    for k, (a, b) in enumerate(nearest):
        motion = relative(survey.pose(a), survey.pose(b))
        is_near = math.hypot(*motion[:2]) < _NEAR
        agree = is_near and agreement(frames[a].scan, frames[b].scan, [motion])[0] >= LEAST
        known[k] = a == b or agree
    pairs = np.array(nearest, np.int64).reshape(-1, 2)[~known]
    spreads = between(survey.poses, pairs, solve)[:, :2, :2]
    across = angles[~known] - survey.poses[pairs[:, 0], 2]
    normals = np.column_stack((-np.sin(across), np.cos(across)))
    known[~known] = np.einsum("ni,nij,nj->n", normals, spreads, normals) < _KNOWN**2
    return known
