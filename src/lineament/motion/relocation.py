"""Where the sensor is after a pause: the one motion by which most walls are where they were."""

import math
from functools import lru_cache
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray

from ..features.records import S_ANGLE, S_CENTROID, S_END, S_START
from ..kernels.tracking import walls as at
from ..kernels.tracking.walls import TURNED, find_again, refine
from ..scan import Array, Pose

#: An expected motion, and the deviations of x, y [m] and theta [rad].
Expected = tuple[Pose, Array]

#: The longest walls of a frame, so many, decide.
_MOST = 10
#: Walls cross if the sine between them is larger.
_CROSSING = 0.3
#: Motions farther apart than this are different ones [m, m, rad].
_SAME = np.array((0.3, 0.3, 0.15))
#: Share of the walls, by length, that must be found again; what a share of 1 is worth in -2 log.
_LEAST, _WORTH = 0.5, 100.0
#: A motion is contradicted where a smaller share is found again.
_CONTRADICTED = 0.3
#: A motion by which all walls are found again is sure where others cost so much more, 99 to 1;
#: where some are missing, so much more, and what these cost by this factor.
_SURE, _MISSING = 9.2, 0.5
#: Motions beyond so many deviations of what is expected are left out.
_FAR = 4.0
#: Two walls agree by chance: a motion that is not expected needs so many, and so does any doubt.
_ENOUGH = 3


def relocated(
    before: NDArray[np.void], now: NDArray[np.void], expected: list[Expected]
) -> Pose | None:
    """Find the motion between two frames where little is known of it, by their segments.

    Each two walls that cross, taken for two of the earlier frame at the same angle, give a motion.
    Its cost is -2 log of what is expected, a mixture of normal distributions (the widest first),
    and a penalty for the share of the walls that are nowhere near one of before.

    Returns
    -------
    (x, y, theta) or None
        The motion of least cost, to some centimetres; None if another one costs hardly more, or if
        too few of the walls are found again.

    Examples
    --------
    >>> from lineament.simulation import SENSORS, room, truth
    >>> before, now = (
    ...     truth(room(), (x, 1.0, 0.5), SENSORS["utm30lx"]).segments for x in (0.0, 1.0))
    >>> motion = relocated(before, now, [((0.0, 0.0, 0.0), np.array((2.0, 2.0, 1.0)))])
    >>> [round(value, 3) + 0.0 for value in motion]
    [0.878, -0.479, 0.0]
    """
    earlier, later = _walls(before), _walls(now)
    motions = np.concatenate(([pose for pose, _ in expected], _motions(earlier, later)))
    costs = np.array([_surprise(motions, *one) for one in expected])
    kept = costs.min(axis=0) < math.inf
    motions, costs = motions[kept], costs[:, kept]
    refine(earlier, later, motions, np.empty((len(earlier), len(later))))
    share, count = _found_again(earlier, later, motions)
    cost = costs.min(axis=0) + _WORTH * (1.0 - share)
    best = int(np.argmin(cost))
    is_other = (np.abs(_off(motions, motions[best])) > _SAME).any(axis=1)
    margin = _SURE + _MISSING * _WORTH * (1.0 - share[best])
    is_sure = cost[is_other].min(initial=math.inf) >= cost[best] + margin
    is_enough = count[best] >= _ENOUGH or costs[1:, best].min(initial=math.inf) < math.inf
    if not (is_sure and is_enough and share[best] >= _LEAST):
        return None
    x, y, theta = motions[best].tolist()
    return x, y, theta


def is_contradicted(motion: Pose, before: NDArray[np.void], now: NDArray[np.void]) -> bool:
    """Whether by this motion hardly any of the walls of a frame are where they were before."""
    if min(len(before), len(now)) < _ENOUGH:
        return False
    share, _ = _found_again(_walls(before), _walls(now), np.array([motion], np.float64))
    return bool(share[0] < _CONTRADICTED)


def _walls(segments: NDArray[np.void]) -> Array:
    """Return the longest segments of a frame as the kernels take them."""
    # As words: numpy takes records field by field, several times slower.
    words = np.ascontiguousarray(segments).view(np.float64)
    words = words.reshape(len(segments), segments.dtype.itemsize // 8)
    along = words[:, S_END : S_END + 2] - words[:, S_START : S_START + 2]
    lengths = np.hypot(along[:, 0], along[:, 1])
    kept = np.argsort(-lengths, kind="stable")[:_MOST]
    words, walls = words[kept], np.empty((len(kept), at.COLUMNS))
    walls[:, at.LENGTH], walls[:, at.ANGLE] = lengths[kept], words[:, S_ANGLE]
    walls[:, at.COS], walls[:, at.SIN] = np.cos(words[:, S_ANGLE]), np.sin(words[:, S_ANGLE])
    for place, word in ((at.START, S_START), (at.END, S_END), (at.CENTROID, S_CENTROID)):
        walls[:, place : place + 2] = words[:, word : word + 2]
    return walls


@lru_cache
def _pairs(count: int, ordered: bool) -> NDArray[np.int64]:
    """List the pairs of so many walls, shape (2, n), either way round or one."""
    pairs = permutations(range(count), 2) if ordered else combinations(range(count), 2)
    return np.array([*pairs], np.int64).reshape(-1, 2).T


def _crossings(walls: Array, pairs: NDArray[np.int64]) -> tuple[Array, Array, Array]:
    """Where pairs of walls cross (n, 2), half way between their directions, and the turn."""
    i, j = pairs
    angles, c, s = walls[:, at.ANGLE], walls[:, at.COS], walls[:, at.SIN]
    centroids = walls[:, at.CENTROID : at.CENTROID + 2]
    turn = wrapped(angles[j] - angles[i])
    sine = np.sin(turn)
    kept = np.abs(sine) > _CROSSING
    i, j, turn, sine = i[kept], j[kept], turn[kept], sine[kept]
    x, y = (centroids[j] - centroids[i]).T
    along = (x * s[j] - y * c[j]) / sine
    points = centroids[i] + along[:, None] * np.column_stack((c[i], s[i]))
    return points, angles[i] + turn / 2, turn


def _motions(before: Array, now: Array) -> Array:
    """Motions (n, 3) by which two crossing walls are two of before."""
    points, directions, turns = _crossings(before, _pairs(len(before), ordered=False))
    others, now_directions, now_turns = _crossings(now, _pairs(len(now), ordered=True))
    i, j = np.nonzero(np.abs(turns[:, None] - now_turns) < 2 * TURNED)
    theta = wrapped(directions[i] - now_directions[j])
    c, s, (x, y) = np.cos(theta), np.sin(theta), others[j].T
    place = points[i] - np.column_stack((c * x - s * y, s * x + c * y))
    return np.column_stack((place, theta))


def _surprise(motions: Array, pose: Pose, deviations: Array) -> Array:
    """-2 log of the density of motions (n, 3), but for a constant; inf for those too far off."""
    square = ((_off(motions, pose) / deviations) ** 2).sum(axis=1)
    return np.where(square < _FAR**2, square + 2 * np.log(deviations).sum(), math.inf)


def _found_again(before: Array, now: Array, motions: Array) -> tuple[Array, Array]:
    """Share of the later walls, by length, that lie along an earlier one; and their number."""
    found = np.empty((len(motions), 2))
    find_again(before, now, motions, found)
    return found[:, 0], found[:, 1]


def _off(motions: Array, pose: Pose | Array) -> Array:
    """Differences (n, 3) of motions from one."""
    off: Array = motions - np.asarray(pose)
    off[:, 2] = wrapped(off[:, 2])
    return off


def wrapped(angles: Array) -> Array:
    """Angles in [-π, π)."""
    return np.asarray(np.remainder(angles + math.pi, 2 * math.pi) - math.pi)
