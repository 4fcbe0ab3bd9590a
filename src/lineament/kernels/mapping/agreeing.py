"""How many ends of beams another scan explains, and how many it has looked through."""

import math

from .. import helper, kernel
from ..arrays import Floats2


@helper
def _first(seen, bearing):
    """Return the first of the beams, by bearing, that is not before this one."""
    low, high = 0, len(seen)
    while low < high:
        middle = (low + high) // 2
        if seen[middle, 1] < bearing:
            low = middle + 1
        else:
            high = middle
    return low


@helper
def _count(ends, pose, seen, near, turned):
    """Return how many ends of beams from a pose are explained, and how many contradicted."""
    x, y, c, s = pose
    explained, contradicted = 0, 0
    for k in range(len(ends)):
        ex, ey = x + c * ends[k, 0] - s * ends[k, 1], y + s * ends[k, 0] + c * ends[k, 1]
        far, bearing = math.sqrt(ex * ex + ey * ey), math.atan2(ey, ex) % (2.0 * math.pi)
        least, most = math.inf, -math.inf
        for at in range(_first(seen, bearing - turned), len(seen)):
            if seen[at, 1] >= bearing + turned:
                break
            least, most = min(least, seen[at, 0]), max(most, seen[at, 0])
        if far <= least - near:
            contradicted += least < math.inf
        elif far < most + near:
            explained += 1
    return explained, contradicted


@kernel
def agree(
    ends_then: Floats2,
    ends_now: Floats2,
    seen_then: Floats2,
    seen_now: Floats2,
    motions: Floats2,
    settings: tuple[float, float, float],
    counts: Floats2,
):
    """Fill how many ends of two scans are explained and contradicted, of each motion.

    `ends` are x and y of beams, `seen` range and bearing of all of them, by bearings that go on for
    a turn before and after. `settings`: how far beams end from those of the other scan [m], how far
    they are turned [rad], and the growth of both with the motion.
    """
    near, turned, growth = settings
    for k in range(len(motions)):
        x, y, theta = motions[k, 0], motions[k, 1], motions[k, 2]
        c, s = math.cos(theta), math.sin(theta)
        turn = theta - 2.0 * math.pi * math.floor(theta / (2.0 * math.pi) + 0.5)
        far, wide = near + growth * math.sqrt(x * x + y * y), turned + growth * abs(turn)
        back = (-c * x - s * y, s * x - c * y, c, -s)
        one, none = _count(ends_now, (x, y, c, s), seen_then, far, wide)
        other, nothing = _count(ends_then, back, seen_now, far, wide)
        counts[k, 0], counts[k, 1] = one + other, none + nothing
