"""What beams say of a pose: whether they end on a wall, before one, or have passed through one."""

import math

from .. import helper, kernel
from ..arrays import Floats1, Floats2, Ints1
from .layout import cell_of

#: Beyond such a squared deviation a wall does not explain a beam.
GATE = 9.0
#: Beyond such a one, behind a wall, it has passed through it.
THROUGH = 16.0
#: Beams are looked at in so many laps: those beside each other say the same.
_LAPS = 8
#: By so much of a cell, places along a beam are rounded, and far less.
_ROUNDED = 1e-6
#: Views end with how far they have looked in each octant.
_OCTANTS = 8


@helper
def _variance(wall, along, direction, pose):
    """Variance of a beam's end across a wall, by range, pose, and wall."""
    dx, dy, variance = direction
    xx, xy, yy = pose
    ux, uy, a = wall[2], wall[3], along - 0.5 * wall[4]
    towards = ux * dy - uy * dx
    total = variance * towards * towards + uy * uy * xx - 2.0 * ux * uy * xy + ux * ux * yy
    return total + wall[6] + 2.0 * a * wall[7] + a * a * wall[8]


@helper
def _misfit(walls, near, x, y, direction, pose, margin, spread):
    """Return how far a beam's end is from the walls near it: -2 log of the density, inf if none.

    The density is that of the end across the wall, over that of one with the variance `spread`.
    """
    dx, dy, _ = direction
    least = math.inf
    for k in near:
        ux, uy, length = walls[k, 2], walls[k, 3], walls[k, 4]
        rx, ry = x - walls[k, 0], y - walls[k, 1]
        along = rx * ux + ry * uy
        if along < -margin or along > length + margin:
            continue
        if walls[k, 5] > 0.0 and ux * dy - uy * dx >= 0.0:
            continue
        off = ux * ry - uy * rx
        total = spread + _variance(walls[k], along, direction, pose)
        square = off * off / total
        if square < GATE and square < least:
            least = min(least, square + math.log(total / spread))
    return least


@helper
def _stops(walls, near, origin, end, direction, pose, shy, spread):
    """Whether a beam passes through one of the walls near it, away from the wall's ends."""
    ox, oy = origin
    ex, ey = end
    for k in near:
        px, py, ux, uy, length = walls[k, 0], walls[k, 1], walls[k, 2], walls[k, 3], walls[k, 4]
        before = ux * (oy - py) - uy * (ox - px)
        after = ux * (ey - py) - uy * (ex - px)
        if before * after >= 0.0:
            continue
        share = before / (before - after)
        x, y = ox + share * (ex - ox) - px, oy + share * (ey - oy) - py
        along = x * ux + y * uy
        edge = min(shy, 0.25 * length)
        if along < edge or along > length - edge:
            continue
        total = spread + _variance(walls[k], along, direction, pose)
        if after * after > THROUGH * total:
            return True
    return False


@helper
def _passes(walls, grid, begins, members, origin, end, direction, pose, shy, spread):
    """Whether a beam passes through a wall that crosses one of the cells along it.

    In each column of cells, those are beside each other, and their walls follow each other.
    """
    cell, columns, rows = grid[2], int(grid[3]), int(grid[4])
    x, y = (origin[0] - grid[0]) / cell, (origin[1] - grid[1]) / cell
    x_end, y_end = (end[0] - grid[0]) / cell, (end[1] - grid[1]) / cell
    low, high = min(x, x_end), max(x, x_end)
    slope = (y_end - y) / (x_end - x) if high > low else 0.0
    least, most = max(math.floor(low), 0), min(math.floor(high), columns - 1)
    for i in range(int(least), int(most) + 1):
        one, other = y, y_end
        if high > low:
            one, other = y + (max(low, i) - x) * slope, y + (min(high, i + 1.0) - x) * slope
        first = max(math.floor(min(one, other) - _ROUNDED), 0)
        last = min(math.floor(max(one, other) + _ROUNDED), rows - 1)
        if first > last:
            continue
        at = rows * (columns + i)
        near = members[begins[at + int(first)] : begins[at + int(last) + 1]]
        if _stops(walls, near, origin, end, direction, pose, shy, spread):
            return True
    return False


@helper
def _was_seen(views, x, y, near):
    """Whether a place lies before the end of a beam of one of the views, or so near behind it."""
    bearings = views.shape[1] - 4 - _OCTANTS
    for k in range(len(views)):
        dx, dy, c, s = x - views[k, 0], y - views[k, 1], views[k, 2], views[k, 3]
        ahead, left, far = c * dx + s * dy, c * dy - s * dx, math.sqrt(dx * dx + dy * dy)
        # Most places are farther than all that the view has seen in their octant.
        octant = 4 * (left < 0.0) + 2 * (ahead < 0.0) + (abs(left) > abs(ahead))
        if far < views[k, 4 + bearings + octant] + near:
            at = int(math.atan2(left, ahead) / (2.0 * math.pi) % 1.0 * bearings) % bearings
            if far < views[k, 4 + at] + near:
                return True
    return False


@kernel
def judge(
    poses: Floats2,
    beams: Floats2,
    walls: Floats2,
    grid: Floats1,
    begins: Ints1,
    members: Ints1,
    settings: tuple[float, float, float, float, float, float, float, float, float],
    opens: bool,
    views: Floats2,
    every: Ints1,
    found: Floats2,
):
    """Sum up the evidence of beams for poses.

    Rows of `found`, of which the first column is what is known before, become the log-likelihood
    ratio, and the weights of the beams that are explained, short, and passing through a wall. It is
    -inf for poses that cannot come as near to the best one so far as `apart` any more.

    `settings`: log-likelihood ratio of a beam explained, short, and passing through; variance that
    is added to all; how far past a wall's end it explains, and how near to it a beam may pass [m];
    the best one before; `apart`; how far walls go on where nobody has looked [m]. `opens` is
    whether walls may be seen through: a beam that ends on a wall is then explained, whatever it has
    passed.

    `views` are rows of x, y, cos and sin of a pose from which the plan was seen, how far, by
    bearing, and by octant at most; without any, all was seen. A beam that ends where none has
    looked is of no weight: it says nothing, unless it ends where one of `every` wall goes on, for
    the pose.
    """
    explained, short, through, spread, margin, shy, best, apart, reach = settings
    most, count = max(explained, short, through), len(beams)
    weights = 0.0
    for b in range(count):
        weights += beams[b, 6]
    for h in range(len(poses)):
        x, y, c, s = poses[h, 0], poses[h, 1], math.cos(poses[h, 2]), math.sin(poses[h, 2])
        cc, cs, ss = c * c, c * s, s * s
        total, rest, hits, shorts, passes = found[h, 0], weights, 0.0, 0.0, 0.0
        lap, b = -1, count
        for _ in range(count):
            if total + most * rest < best - apart:
                total = -math.inf
                break
            b += _LAPS
            if b >= count:
                lap += 1
                b = lap
            ox = x + c * beams[b, 0] - s * beams[b, 1]
            oy = y + s * beams[b, 0] + c * beams[b, 1]
            dx, dy = c * beams[b, 2] - s * beams[b, 3], s * beams[b, 2] + c * beams[b, 3]
            r, variance, weight = beams[b, 4], beams[b, 5], beams[b, 6]
            ex, ey = ox + r * dx, oy + r * dy
            # The covariance of the end, turned with the pose.
            xx, xy, yy = beams[b, 7], beams[b, 8], beams[b, 9]
            pose = (
                cc * xx - 2.0 * cs * xy + ss * yy,
                cs * (xx - yy) + (cc - ss) * xy,
                ss * xx + 2.0 * cs * xy + cc * yy,
            )
            direction, end = (dx, dy, variance), (ex, ey)
            rest -= weight
            deviation, at = math.inf, cell_of(grid, ex, ey)
            if at >= 0:
                near = members[begins[at] : begins[at + 1]]
                deviation = _misfit(walls, near, ex, ey, direction, pose, margin, spread)
            start, is_there = (ox, oy), deviation < math.inf
            if not (is_there and opens) and _passes(
                walls, grid, begins, members, start, end, direction, pose, shy, spread
            ):
                passes += weight
                total += weight * through
            elif is_there:
                hits += weight
                total += weight * max(explained - 0.5 * deviation, short)
            elif len(views) and not _was_seen(views, ex, ey, margin):
                deviation = _misfit(walls, every, ex, ey, direction, pose, reach, spread)
                total += weight * max(explained - 0.5 * deviation, 0.0)
            else:
                shorts += weight
                total += weight * short
        best = max(best, total)
        found[h, 0], found[h, 1], found[h, 2], found[h, 3] = total, hits, shorts, passes


@kernel
def count_passes(
    beams: Floats2, walls: Floats2, settings: tuple[float, float, float], passes: Ints1
):
    """Count the beams that pass through each wall, away from its ends, and end far behind.

    `walls` have both ends in a row. `settings`: how far from an end, by length and by share; how
    far behind [m].
    """
    edge, share, far = settings
    for w in range(len(walls)):
        px, py, qx, qy = walls[w, 0], walls[w, 1], walls[w, 2], walls[w, 3]
        length = max(math.hypot(qx - px, qy - py), 1e-9)
        margin, count = min(edge / length, share), 0
        for b in range(len(beams)):
            ux, uy, r = beams[b, 2], beams[b, 3], beams[b, 4]
            # How far the start and the end lie to the left of the beam, its end behind the wall.
            start, end = ux * py - uy * px, ux * qy - uy * qx
            out = margin * (end - start)
            if start < -out and end > out and r * (end - start) + qx * py - qy * px > far * length:
                count += 1
        passes[w] = count
