"""How good a map is: its poses against true ones, walls that it has twice, scans that contradict.

Relations are nearly blind to a map that is broken (see `relations`): these are not.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from lineament.mapping.consistency import LEAST, agreement
from lineament.scan import Array, LaserScan, Pose
from lineament.scan.poses import compose, relative

from .tracking import MotionErrors

#: Walls within this angle are parallel [rad].
_PARALLEL = math.radians(10.0)
#: Farthest doubled walls are apart [m].
APART = 0.15
#: Scans so near each other look at the same place; again, if so much way lies between them [m]. So
#: many pairs are looked at, at most.
_NEAR, _AGAIN, _PAIRS = 1.0, 10.0, 3000


def alignment(poses: Sequence[Pose], truth: Sequence[Pose]) -> Pose:
    """Pose of the frame of `poses` in that of `truth`: the motion with the least squared distances.

    The angle maximises the sum of a·b cos + a x b sin of the centred places, after Horn.

    Raises
    ------
    ValueError
        If there is not one true pose for each, or none at all.

    Examples
    --------
    >>> x, y, theta = alignment([(0, 0, 0), (1, 0, 0)], [(2, 3, 1.6), (2, 4, 1.6)])
    >>> round(x, 9), round(y, 9), round(theta, 9) == round(math.pi / 2, 9)
    (2.0, 3.0, True)
    """
    if len(poses) != len(truth) or not len(poses):
        raise ValueError(f"there are {len(poses)} poses and {len(truth)} true ones")
    places, true = (np.asarray(of, dtype=np.float64)[:, :2] for of in (poses, truth))
    (a, b), (middle, true_middle) = (places, true), (places.mean(axis=0), true.mean(axis=0))
    a, b = a - middle, b - true_middle
    theta = math.atan2(float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()), float((a * b).sum()))
    x, y, _ = compose((0.0, 0.0, theta), (-float(middle[0]), -float(middle[1]), 0.0))
    return x + float(true_middle[0]), y + float(true_middle[1]), theta


def absolute_errors(poses: Sequence[Pose], truth: Sequence[Pose]) -> MotionErrors:
    """How far poses are from the true ones, once the ways are aligned; ``way_rmse`` is the ATE.

    Raises ValueError as `alignment`.
    """
    frame = alignment(poses, truth)
    moved = (compose(frame, pose) for pose in poses)
    return MotionErrors.of([relative(true, p) for true, p in zip(truth, moved, strict=True)])


def doubled_walls(walls: ArrayLike, apart: float = APART) -> float:
    """Length of wall that a map has twice [m].

    Walls (S, 4) are seen from the left of the way from x1 y1 to x2 y2 [m]. Of two that are parallel
    within 10°, face the same way and lie side by side within `apart`, the length of the shorter one
    that lies beside the longer one counts, once however many walls it lies beside.

    Examples
    --------
    The second wall is 10 cm from the first, the third is the other face of it:

    >>> doubled_walls([[0, 0, 9, 0], [4, 0.1, 6, 0.1], [9, -0.1, 0, -0.1]])
    2.0
    """
    table = np.asarray(walls, dtype=np.float64).reshape(-1, 4)
    lengths = np.hypot(*(table[:, 2:] - table[:, :2]).T)
    order = np.argsort(-lengths, kind="stable")
    table, lengths = table[order], lengths[order]
    along = (table[:, 2:] - table[:, :2]) / lengths[:, np.newaxis]
    total = 0.0
    for k in range(1, len(table)):
        towards = table[:k, :2] - table[k, :2]
        on_ends = np.stack((towards, table[:k, 2:] - table[k, :2])) @ along[k]
        low, high = (
            np.clip(on_ends.min(axis=0), 0, None),
            np.clip(on_ends.max(axis=0), None, lengths[k]),
        )
        # How far the longer wall's line is off, at the middle of what lies beside it.
        middle = table[k, :2] + ((low + high) / 2)[:, np.newaxis] * along[k]
        arm = middle - table[:k, :2]
        off = abs(arm[:, 0] * along[:k, 1] - arm[:, 1] * along[:k, 0])
        beside = (along[:k] @ along[k] > math.cos(_PARALLEL)) & (off <= apart) & (high > low)
        total += _covered(np.column_stack((low, high))[beside])
    return total


def contradicted(
    scans: Sequence[LaserScan], poses: Sequence[Pose], *others: Sequence[Pose]
) -> tuple[int, Array]:
    """Return how many pairs of scans look at a place again, and the share that contradicts there.

    That needs no true poses: scans from the same place look through nothing that the other has
    seen, wherever that place is. A pair is within 1 m by any of the poses, with 10 m of way in
    between by the first. It contradicts if less than 85 % of the ends that both can see are
    explained. There is one share for each of the poses, of the same pairs; people and doors take
    some of them also at true poses.

    Examples
    --------
    A robot leaves a room, and is back; its poses turn by 90° on the way:

    >>> import numpy as np
    >>> from lineament.simulation import SENSORS, room
    >>> true = [(-1.0, 0.0, 0.0), (1.0, 8.0, 0.0), (-1.0, 0.1, 0.0)]
    >>> rng = np.random.default_rng(1)
    >>> scans = [SENSORS["ld19"].scan(room(), pose, rng) for pose in true]
    >>> count, shares = contradicted(scans, true, [*true[:2], (-1.0, 0.1, 1.6)])
    >>> count, shares.tolist()
    (1, [0.0, 1.0])
    """
    from scipy.spatial import cKDTree

    ways = [np.asarray(of, dtype=np.float64) for of in (poses, *others)]
    steps = np.hypot(*np.diff(ways[0][:, :2], axis=0, prepend=ways[0][:1, :2]).T)
    near = [cKDTree(of[:, :2]).query_pairs(_NEAR, output_type="ndarray") for of in ways]
    pairs = np.unique(np.concatenate(near), axis=0)
    pairs = pairs[abs(np.diff(steps.cumsum()[pairs], axis=1)[:, 0]) > _AGAIN]
    pairs = pairs[:: len(pairs) // _PAIRS + 1]
    found = [
        agreement(
            scans[a],
            scans[b],
            [relative(tuple(of[a].tolist()), tuple(of[b].tolist())) for of in ways],
        )
        for a, b in pairs.tolist()
    ]
    shares = np.array(found).reshape(-1, len(ways))
    shares = shares[np.isfinite(shares).all(axis=1)]
    return len(shares), (shares < LEAST).mean(axis=0) if len(shares) else np.full(len(ways), np.nan)


def _covered(intervals: Array) -> float:
    """Length of the union of intervals (m, 2)."""
    total, end = 0.0, -math.inf
    for low, high in intervals[np.argsort(intervals[:, 0])].tolist():
        total += max(0.0, high - max(low, end))
        end = max(end, high)
    return total
