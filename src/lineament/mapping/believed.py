"""Odometry over key frames where the way is lost: whether what was seen there denies it."""

import math
from dataclasses import replace
from itertools import product

import numpy as np

from ..scan import Array
from ..scan.poses import compose, inverse, relative
from ..walls import Records
from .drive_map import KeyFrame
from .evidence import RIGHT_ON_MAP, WRONG_ON_MAP, Says, evidence_of
from .index import MAPPED
from .line_map import LineMap
from .local_map import Query
from .locate import SURE
from .loops import Survey

#: What was seen on so much way after a key frame is compared with that on so much before [m].
_AFTER, _BEFORE = 5.0, 10.0
#: Errors of beams and walls beside their covariances [m].
_TIGHT = 0.04
#: Where the key frame is tried, in deviations of its odometry.
_TRIED = np.array(list(product(range(-2, 3), repeat=3)), np.float64)
#: Of the beams that come to a wall, so many end there and so many pass it, at a right pose over a
#: wrong one [nats]. Those that come to none say nothing: the robot goes where it has not been.
_ENDS, _PASSES = (
    math.log(RIGHT_ON_MAP[k] / WRONG_ON_MAP[k] * (1 - WRONG_ON_MAP[1]) / (1 - RIGHT_ON_MAP[1]))
    for k in (0, 2)
)


def believed(survey: Survey) -> list[KeyFrame]:
    """Return the key frames, without odometry to those where what was seen denies it.

    A robot in a lift, or one that is carried, moves while its wheels stand. Where the way is lost,
    nothing but odometry joins what was seen before and after. It is denied if a wrong pose is
    likelier than any near it (1000 : 1): beams of either side end on walls of the other, or pass
    through them. It is, too, if the way to the lost key frame contradicts it: a scanner that is
    covered seems to stand, and nobody knows for how long.
    """
    frames = list(survey.frames)
    for k, frame in enumerate(frames):
        if k and frame.is_lost and frame.has_odometry:
            torn = [*frames[:k], replace(frame, has_odometry=False), *frames[k + 1 :]]
            if frame.is_contradicted or _odds(replace(survey, frames=torn), k) < -SURE:
                frames = torn
    return frames


def _odds(survey: Survey, k: int) -> float:
    """Log-odds of the motion to key frame k by odometry over a wrong one, at the best pose near."""
    way, here, expected = survey.way, survey.pose(k), survey.frames[k].expected
    before = np.flatnonzero(way >= way[k - 1] - _BEFORE)
    before, after = before[before < k], np.flatnonzero((way >= way[k]) & (way <= way[k] + _AFTER))
    old, new = (survey.walls(here, frames) for frames in (before, after))
    moves = [(x, y, t) for x, y, t in (_TRIED * np.sqrt(np.diag(expected))).tolist()]
    found = -0.5 * np.square(_TRIED).sum(axis=1)
    for q, own, others, by in (
        (int(after[-1]), new, old, moves),
        (k - 1, old, new, [inverse(move) for move in moves]),
    ):
        query = survey.query(q)
        if query is not None and len(others):
            at = relative(here, survey.pose(q))
            poses = np.array([at, *(compose(move, at) for move in by)])
            found = _judged(query, own, others, poses, found)
    return float(found.max())


def _judged(query: Query, own: Records, others: Records, poses: Array, before: Array) -> Array:
    """Add what beams say of poses on the walls of others; the first pose is that on their own.

    Beams that pass through their own walls are left out: those may be glass.
    """
    index = LineMap(own, sigma=MAPPED).index
    passes = [evidence_of(poses[:1], beam[None], index, _TIGHT)[0, 3] for beam in query.beams]
    beams = np.ascontiguousarray(query.beams[np.array(passes) == 0])
    says, index = Says(_ENDS + 0.5, 0.0, _PASSES, opens=True), LineMap(others, sigma=MAPPED).index
    return np.asarray(evidence_of(poses[1:], beams, index, _TIGHT, says, before=before)[:, 0])
