"""How good a map is: its poses against true ones, and walls that it has twice.

Relations are nearly blind to a map that is broken (see `relations`): these are not.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from lineament.scan import Array, Pose
from lineament.scan.poses import compose, relative

from .tracking import MotionErrors

#: Walls within this angle are parallel [rad].
_PARALLEL = math.radians(10.0)
#: Farthest doubled walls are apart [m].
APART = 0.15


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


def _covered(intervals: Array) -> float:
    """Length of the union of intervals (m, 2)."""
    total, end = 0.0, -math.inf
    for low, high in intervals[np.argsort(intervals[:, 0])].tolist():
        total += max(0.0, high - max(low, end))
        end = max(end, high)
    return total
