"""What beams say of a pose: whether they end on a wall, before one, or have passed through one."""

import math

from .. import helper, kernel
from ..arrays import Floats1, Floats2, Ints1
from .layout import cell_of

#: Beyond such a squared deviation a wall does not explain a beam.
GATE = 9.0
#: Beyond such a one, behind a wall, it has passed through it.
THROUGH = 16.0


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
        if off * off < GATE * total:
            least = min(least, off * off / total + math.log(total / spread))
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
    """Whether a beam passes through a wall: the cells along it are looked at in turn."""
    ox, oy = origin
    ex, ey = end
    low_x, low_y, cell = grid[0], grid[1], grid[2]
    columns, rows = int(grid[3]), int(grid[4])
    i, j = math.floor((ox - low_x) / cell), math.floor((oy - low_y) / cell)
    i_end, j_end = math.floor((ex - low_x) / cell), math.floor((ey - low_y) / cell)
    dx, dy = ex - ox, ey - oy
    step_i, step_j = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
    per_i = abs(cell / dx) if dx != 0.0 else math.inf
    per_j = abs(cell / dy) if dy != 0.0 else math.inf
    next_i, next_j = math.inf, math.inf
    if dx != 0.0:
        next_i = (low_x + (i + (dx > 0.0)) * cell - ox) / dx
    if dy != 0.0:
        next_j = (low_y + (j + (dy > 0.0)) * cell - oy) / dy
    for _ in range(abs(i_end - i) + abs(j_end - j) + 1):
        if 0 <= i < columns and 0 <= j < rows:
            at = i * rows + j
            near = members[begins[at] : begins[at + 1]]
            if _stops(walls, near, origin, end, direction, pose, shy, spread):
                return True
        if next_i < next_j:
            i += step_i
            next_i += per_i
        else:
            j += step_j
            next_j += per_j
    return False


@kernel
def judge(
    poses: Floats2,
    beams: Floats2,
    walls: Floats2,
    grid: Floats1,
    begins: Ints1,
    members: Ints1,
    settings: tuple[float, float, float, float, float, float],
    found: Floats2,
):
    """Sum up the evidence of beams for poses.

    Rows of `found` become the log-likelihood ratio, and the weights of the beams that are
    explained, short, and passing through a wall.

    `settings`: log-likelihood ratio of a beam explained, short, and passing through; variance that
    is added to all; how far past a wall's end it explains, and how near to it a beam may pass [m].
    """
    explained, short, through, spread, margin, shy = settings
    for h in range(len(poses)):
        x, y, c, s = poses[h, 0], poses[h, 1], math.cos(poses[h, 2]), math.sin(poses[h, 2])
        total = hits = shorts = passes = 0.0
        for b in range(len(beams)):
            ox = x + c * beams[b, 0] - s * beams[b, 1]
            oy = y + s * beams[b, 0] + c * beams[b, 1]
            dx, dy = c * beams[b, 2] - s * beams[b, 3], s * beams[b, 2] + c * beams[b, 3]
            r, variance, weight = beams[b, 4], beams[b, 5], beams[b, 6]
            ex, ey = ox + r * dx, oy + r * dy
            # The covariance of the end, turned with the pose.
            xx, xy, yy = beams[b, 7], beams[b, 8], beams[b, 9]
            half, twice, mean = 0.5 * (xx - yy), 2.0 * c * s, 0.5 * (xx + yy)
            even = (c * c - s * s) * half - twice * xy
            pose = (mean + even, twice * half + (c * c - s * s) * xy, mean - even)
            direction, end = (dx, dy, variance), (ex, ey)
            deviation = math.inf
            at = cell_of(grid, ex, ey)
            if at >= 0:
                near = members[begins[at] : begins[at + 1]]
                deviation = _misfit(walls, near, ex, ey, direction, pose, margin, spread)
            if _passes(walls, grid, begins, members, (ox, oy), end, direction, pose, shy, spread):
                passes += weight
                total += weight * through
            elif deviation < math.inf:
                hits += weight
                total += weight * max(explained - 0.5 * deviation, short)
            else:
                shorts += weight
                total += weight * short
        found[h, 0], found[h, 1], found[h, 2], found[h, 3] = total, hits, shorts, passes
