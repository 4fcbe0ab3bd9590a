"""Corners: where two walls end together, or one ends on the other."""

import math

from .. import helper, kernel
from ..arrays import Floats2, Ints2

#: position x, y; covariance xx, xy, yy; bisector; opening; solid; both walls.
CORNER_COLUMNS = 10


@helper
def _spread(one, other, sine, found):
    """Write the covariance of the place where two walls meet, so far from the middle of each."""
    (wall_a, lever_a), (wall_b, lever_b) = one, other
    va = wall_a[6] + 2.0 * lever_a * wall_a[7] + lever_a * lever_a * wall_a[8]
    vb = wall_b[6] + 2.0 * lever_b * wall_b[7] + lever_b * lever_b * wall_b[8]
    # Where a wall moves to its left, the corner moves along the other one.
    ax, ay, bx, by = wall_a[2], wall_a[3], wall_b[2], wall_b[3]
    share = 1.0 / (sine * sine)
    found[2] = share * (bx * bx * va + ax * ax * vb)
    found[3] = share * (bx * by * va + ax * ay * vb)
    found[4] = share * (by * by * va + ay * ay * vb)


@kernel
def meet(walls: Floats2, pairs: Ints2, settings: tuple[float, float, float], found: Floats2) -> int:
    """Find the corners of pairs of walls, of which each has up to four; how many.

    `settings`: how far a corner is from the end of a wall, at most; least sine of the angle between
    walls; least length of an arm. A row of `found` has `CORNER_COLUMNS` numbers.
    """
    reach, least_sine, arm = settings
    count = 0
    for ways in range(4):
        way_a, way_b = 1.0 - 2.0 * (ways // 2), 1.0 - 2.0 * (ways % 2)
        for k in range(len(pairs)):
            a, b = pairs[k, 0], pairs[k, 1]
            ax, ay, length_a = walls[a, 2], walls[a, 3], walls[a, 4]
            bx, by, length_b = walls[b, 2], walls[b, 3], walls[b, 4]
            sine = ax * by - ay * bx
            if abs(sine) <= least_sine:
                continue
            dx, dy = walls[b, 0] - walls[a, 0], walls[b, 1] - walls[a, 1]
            along_a, along_b = (dx * by - dy * bx) / sine, (dx * ay - dy * ax) / sine
            if min(along_a, along_b, length_a - along_a, length_b - along_b) < -reach:
                continue
            away_a = min(abs(along_a), abs(length_a - along_a))
            away_b = min(abs(along_b), abs(length_b - along_b))
            if min(away_a, away_b) > reach:
                continue
            # An arm leads from the corner along the wall: to its end, or back to its start.
            arm_a = length_a - along_a if way_a > 0.0 else along_a
            arm_b = length_b - along_b if way_b > 0.0 else along_b
            if arm_a < min(arm, 0.5 * length_a) or arm_b < min(arm, 0.5 * length_b):
                continue
            # Arms in counter-clockwise order, less than half a turn apart.
            first, second, leads, follows = a, b, way_a, way_b
            if way_a * way_b * sine < 0.0:
                first, second, leads, follows = b, a, way_b, way_a
            solid = -1.0
            if walls[a, 5] > 0.0 and walls[b, 5] > 0.0:
                # What is seen lies to the left of a wall: between the arms if the first one leads
                # on and the second one leads back.
                if leads == follows:
                    continue
                solid = 1.0 if leads < 0.0 else 0.0
            ux, uy = leads * walls[first, 2], leads * walls[first, 3]
            vx, vy = follows * walls[second, 2], follows * walls[second, 3]
            row = found[count]
            row[0], row[1] = walls[a, 0] + along_a * ax, walls[a, 1] + along_a * ay
            row[5] = math.atan2(uy + vy, ux + vx)
            row[6], row[7] = math.atan2(ux * vy - uy * vx, ux * vx + uy * vy), solid
            row[8], row[9] = first, second
            one = walls[a], along_a - 0.5 * length_a
            _spread(one, (walls[b], along_b - 0.5 * length_b), sine, row)
            count += 1
    return count
