"""The walls of two frames, under many motions at once."""

import math

from .. import helper, kernel
from ..arrays import Floats2
from .association import turned

#: Columns of a wall: length [m]; direction [rad], its cosine and sine; start, end, centroid [m].
LENGTH, ANGLE, COS, SIN, START, END, CENTROID = 0, 1, 2, 3, 4, 6, 8
COLUMNS = 10
#: A wall is found again within these of its line [m, rad], beside half of the shorter one.
_NEAR, TURNED, _BESIDE = 0.1, 0.06, 0.5
#: Walls within so many times these are about right.
_NEARLY, _NEARLY_TURNED = 3.0, 2.0
#: Share of the weight of walls that holds a motion where it is: parallel walls do not.
_HELD = 0.01
_LEAST = 1e-9


@kernel
def refine(before: Floats2, now: Floats2, motions: Floats2, weights: Floats2):
    """Move motions (x, y, theta) nearer to where the walls that are about right are on others.

    `weights` is scratch, of a row for each earlier wall and a column for each later one.
    """
    for k in range(len(motions)):
        motion = motions[k]
        total, turns = 0.0, 0.0
        c, s = math.cos(motion[2]), math.sin(motion[2])
        for i in range(len(before)):
            for j in range(len(now)):
                weights[i, j] = 0.0
                turn = turned(now[j, ANGLE] + motion[2] - before[i, ANGLE])
                if abs(turn) < _NEARLY_TURNED * TURNED:
                    off = _off(before[i], now[j], motion, c, s)
                    if abs(off) < _NEARLY * _NEAR and _is_beside(before[i], now[j], motion, c, s):
                        weight = min(before[i, LENGTH], now[j, LENGTH])
                        weights[i, j] = weight
                        total += weight
                        turns += weight * turn
        total = max(total, _LEAST)
        motion[2] -= turns / total
        c, s = math.cos(motion[2]), math.sin(motion[2])
        xx = yy = _HELD * total
        xy, x, y = 0.0, 0.0, 0.0
        for i in range(len(before)):
            p, q = -before[i, SIN], before[i, COS]
            for j in range(len(now)):
                weight = weights[i, j]
                if weight > 0.0:
                    off = weight * _off(before[i], now[j], motion, c, s)
                    x, y = x + off * p, y + off * q
                    xx, xy, yy = xx + weight * p * p, xy + weight * p * q, yy + weight * q * q
        determinant = xx * yy - xy * xy
        motion[0] -= (yy * x - xy * y) / determinant
        motion[1] -= (xx * y - xy * x) / determinant


@kernel
def find_again(before: Floats2, now: Floats2, motions: Floats2, found: Floats2):
    """Fill, for each motion, the share of the later walls, by length, and their number.

    Those count that lie along an earlier one.
    """
    total = 0.0
    for j in range(len(now)):
        total += now[j, LENGTH]
    for k in range(len(motions)):
        motion = motions[k]
        c, s = math.cos(motion[2]), math.sin(motion[2])
        length, count = 0.0, 0
        for j in range(len(now)):
            for i in range(len(before)):
                turn = turned(now[j, ANGLE] + motion[2] - before[i, ANGLE])
                if (
                    abs(turn) < TURNED
                    and abs(_off(before[i], now[j], motion, c, s)) < _NEAR
                    and _is_beside(before[i], now[j], motion, c, s)
                ):
                    length += now[j, LENGTH]
                    count += 1
                    break
        found[k, 0], found[k, 1] = length / max(total, _LEAST), count


@helper
def _off(a, b, motion, c, s):
    """Offset of the centroid of a later wall from the line of an earlier one."""
    p, q = b[CENTROID], b[CENTROID + 1]
    x = c * p - s * q + motion[0] - a[START]
    y = s * p + c * q + motion[1] - a[START + 1]
    return y * a[COS] - x * a[SIN]


@helper
def _is_beside(a, b, motion, c, s):
    """Whether a later wall is beside half of an earlier one, or half of it is."""
    # Ends of the later wall along the earlier one.
    begin = (motion[0] - a[START]) * a[COS] + (motion[1] - a[START + 1]) * a[SIN]
    ux, uy = c * a[COS] + s * a[SIN], c * a[SIN] - s * a[COS]
    first = begin + ux * b[START] + uy * b[START + 1]
    last = begin + ux * b[END] + uy * b[END + 1]
    shared = min(max(first, last), a[LENGTH]) - max(min(first, last), 0.0)
    return shared > _BESIDE * min(a[LENGTH], b[LENGTH])
