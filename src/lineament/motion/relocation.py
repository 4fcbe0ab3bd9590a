"""Where the sensor is after a pause: the one motion by which most walls are where they were."""

import math
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from ..scan import Array, Pose

#: An expected motion, and the deviations of x, y [m] and theta [rad].
Expected = tuple[Pose, Array]

#: The longest walls of a frame, so many, decide.
_MOST = 10
#: A wall is found again within these of its line [m, rad], beside half of the shorter one.
_NEAR, _TURNED, _BESIDE = 0.1, 0.06, 0.5
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

Mask = NDArray[np.bool_]


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
    earlier, later = _Walls(before), _Walls(now)
    motions = np.concatenate(([pose for pose, _ in expected], _motions(earlier, later)))
    costs = np.array([_surprise(motions, *one) for one in expected])
    kept = costs.min(axis=0) < math.inf
    motions, costs = _refined(earlier, later, motions[kept]), costs[:, kept]
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
    share, _ = _found_again(_Walls(before), _Walls(now), np.array([motion]))
    return bool(share[0] < _CONTRADICTED)


class _Walls:
    """The longest segments of a frame, as columns."""

    def __init__(self, segments: NDArray[np.void]) -> None:
        lengths = np.hypot(*(segments["end"] - segments["start"]).T)
        kept = np.argsort(-lengths, kind="stable")[:_MOST]
        self.lengths, self.angles = lengths[kept], segments["angle"][kept]
        self.start, self.end = segments["start"][kept], segments["end"][kept]
        self.centroid = segments["centroid"][kept]

    def crossings(self, pairs: list[tuple[int, int]]) -> tuple[Array, Array, Array]:
        """Where pairs of walls cross (n, 2), half way between their directions, and the turn."""
        i, j = np.array(pairs, int).reshape(-1, 2).T
        turn = _wrapped(self.angles[j] - self.angles[i])
        kept = np.abs(np.sin(turn)) > _CROSSING
        i, j, turn = i[kept], j[kept], turn[kept]
        c, s = np.cos(self.angles), np.sin(self.angles)
        x, y = (self.centroid[j] - self.centroid[i]).T
        along = (x * s[j] - y * c[j]) / np.sin(turn)
        points = self.centroid[i] + along[:, None] * np.column_stack((c[i], s[i]))
        return points, self.angles[i] + turn / 2, turn


def _motions(before: _Walls, now: _Walls) -> Array:
    """Motions (n, 3) by which two crossing walls are two of before."""
    ordered, both = ([*permutations(range(len(of.angles)), 2)] for of in (before, now))
    points, directions, turns = before.crossings([pair for pair in ordered if pair[0] < pair[1]])
    others, now_directions, now_turns = now.crossings(both)
    i, j = np.nonzero(np.abs(turns[:, None] - now_turns) < 2 * _TURNED)
    theta = _wrapped(directions[i] - now_directions[j])
    c, s, (x, y) = np.cos(theta), np.sin(theta), others[j].T
    place = points[i] - np.column_stack((c * x - s * y, s * x + c * y))
    return np.column_stack((place, theta))


def _surprise(motions: Array, pose: Pose, deviations: Array) -> Array:
    """-2 log of the density of motions (n, 3), but for a constant; inf for those too far off."""
    square = ((_off(motions, pose) / deviations) ** 2).sum(axis=1)
    return np.where(square < _FAR**2, square + 2 * np.log(deviations).sum(), math.inf)


def _refined(before: _Walls, now: _Walls, motions: Array) -> Array:
    """Motions (n, 3) nearer to where all walls that are about right lie on those of before."""
    shorter = np.minimum(before.lengths[:, None], now.lengths)
    turn, off, beside = _compared(before, now, motions)
    weight = (beside & (np.abs(turn) < 2 * _TURNED) & (np.abs(off) < 3 * _NEAR)) * shorter
    total = np.maximum(weight.sum(axis=(1, 2)), 1e-9)
    motions = motions.copy()
    motions[:, 2] -= (weight * turn).sum(axis=(1, 2)) / total
    _, off, _ = _compared(before, now, motions)
    normals = np.column_stack((-np.sin(before.angles), np.cos(before.angles)))
    outer = np.einsum("mab,ai,aj->mij", weight, normals, normals)
    pull = np.einsum("mab,mab,ai->mi", weight, off, normals)
    outer += 0.01 * total[:, None, None] * np.eye(2)  # parallel walls do not move along
    motions[:, :2] -= np.linalg.solve(outer, pull[:, :, None])[:, :, 0]
    return motions


def _found_again(before: _Walls, now: _Walls, motions: Array) -> tuple[Array, NDArray[np.int64]]:
    """Share of the later walls, by length, that lie along an earlier one; and their number."""
    turn, off, beside = _compared(before, now, motions)
    found = (beside & (np.abs(turn) < _TURNED) & (np.abs(off) < _NEAR)).any(axis=1)
    return found @ now.lengths / max(now.lengths.sum(), 1e-9), found.sum(axis=1)


def _compared(before: _Walls, now: _Walls, motions: Array) -> tuple[Array, Array, Mask]:
    """Turn and offset of each later wall from each earlier one, and whether they are side by side.

    All of shape (motions, before, now).
    """
    x, y, theta = motions.T[:, :, None, None]
    c, s = np.cos(theta), np.sin(theta)
    tx, ty = np.cos(before.angles)[:, None], np.sin(before.angles)[:, None]

    def seen(points: Array) -> tuple[Array, Array]:
        """Place along and off each earlier wall."""
        px, py = points.T
        dx = c * px - s * py + x - before.start[:, 0, None]
        dy = s * px + c * py + y - before.start[:, 1, None]
        return dx * tx + dy * ty, dy * tx - dx * ty

    (first, _), (last, _), (_, off) = seen(now.start), seen(now.end), seen(now.centroid)
    length = before.lengths[:, None]
    shared = np.minimum(np.maximum(first, last), length) - np.maximum(np.minimum(first, last), 0)
    turn = _wrapped(now.angles + theta - before.angles[:, None])
    return turn, off, shared > _BESIDE * np.minimum(length, now.lengths)


def _off(motions: Array, pose: Pose | Array) -> Array:
    """Differences (n, 3) of motions from one."""
    off: Array = motions - np.asarray(pose)
    off[:, 2] = _wrapped(off[:, 2])
    return off


def _wrapped(angles: Array) -> Array:
    wrapped: Array = np.remainder(angles + math.pi, 2 * math.pi) - math.pi
    return wrapped
