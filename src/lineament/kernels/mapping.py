"""A map of walls: which of them lie near, what a beam meets, and where a local map fits.

A wall is a row of `WALL_COLUMNS` numbers, a local wall one of `LOCAL_COLUMNS`, a beam of
`BEAM_COLUMNS`. The walls near a place are listed by square cells (`grid`): low x, low y and size
[m], columns and rows of cells; `begins` has where the list of each cell begins in `members`.
"""

import math

from . import helper, kernel

#: start x, y; direction x, y; length; whether it is seen from its left alone; variance of its
#: offset at the middle, covariance of offset and angle, variance of the angle.
WALL_COLUMNS = 9
#: centroid x, y; angle; length from the centroid back to the start and on to the end; variance of
#: offset, covariance, variance of angle.
LOCAL_COLUMNS = 8
#: origin x, y; direction x, y; range; variance of the range; weight; covariance xx, xy, yy of the
#: end by the pose.
BEAM_COLUMNS = 10
#: Beyond such a squared deviation a wall does not explain a beam.
GATE = 9.0
#: Beyond such a one, behind a wall, it has passed through it.
THROUGH = 16.0


@kernel
def list_walls(walls, grid, margin, begins, members):
    """Count the walls within a margin of each cell in `begins`, or list them if `members` has room.

    Call it with no members, make `begins` the running sum, and call it again.
    """
    low_x, low_y, cell = grid[0], grid[1], grid[2]
    columns, rows = int(grid[3]), int(grid[4])
    reach = cell * math.sqrt(0.5) + margin
    for k in range(len(walls)):
        px, py, ux, uy, length = walls[k, 0], walls[k, 1], walls[k, 2], walls[k, 3], walls[k, 4]
        qx, qy = px + length * ux, py + length * uy
        first = max(int((min(px, qx) - margin - low_x) / cell), 0)
        last = min(int((max(px, qx) + margin - low_x) / cell), columns - 1)
        lower = max(int((min(py, qy) - margin - low_y) / cell), 0)
        upper = min(int((max(py, qy) + margin - low_y) / cell), rows - 1)
        for i in range(first, last + 1):
            for j in range(lower, upper + 1):
                x = low_x + (i + 0.5) * cell - px
                y = low_y + (j + 0.5) * cell - py
                along = min(max(x * ux + y * uy, 0.0), length)
                if math.hypot(x - along * ux, y - along * uy) > reach:
                    continue
                at = i * rows + j
                if len(members):
                    members[begins[at]] = k
                begins[at] += 1


@helper
def _cell_of(grid, x, y):
    """Return the number of the cell at a place, -1 outside."""
    fi, fj = (x - grid[0]) / grid[2], (y - grid[1]) / grid[2]
    if not (fi >= 0.0 and fj >= 0.0 and fi < grid[3] and fj < grid[4]):
        return -1
    return int(fi) * int(grid[4]) + int(fj)


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
def judge(poses, beams, walls, grid, begins, members, settings, found):
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
            at = _cell_of(grid, ex, ey)
            if at >= 0:
                near = members[begins[at] : begins[at + 1]]
                deviation = _misfit(walls, near, ex, ey, direction, pose, margin, spread)
            if _passes(
                walls, grid, begins, members, (ox, oy), end, direction, pose, shy, spread
            ):
                passes += weight
                total += weight * through
            elif deviation < math.inf:
                hits += weight
                total += weight * max(explained - 0.5 * deviation, short)
            else:
                shorts += weight
                total += weight * short
        found[h, 0], found[h, 1], found[h, 2], found[h, 3] = total, hits, shorts, passes


@helper
def _pair(local, walls, near, place, turned, pose_spread, rough, best, best_d2):
    """Find the wall that fits a local wall best: its number and squared deviation."""
    x, y = place
    ux, uy = turned
    back, on = local[3], local[4]
    for k in near:
        vx, vy, length = walls[k, 2], walls[k, 3], walls[k, 4]
        sine, cosine = vx * uy - vy * ux, vx * ux + vy * uy
        if cosine < 0.0:
            if walls[k, 5] > 0.0:
                continue
            sine, cosine = -sine, -cosine
        if cosine < 0.9 or abs(sine) > 0.4:
            continue
        rx, ry = x - walls[k, 0], y - walls[k, 1]
        along = rx * vx + ry * vy
        same = 1.0 if vx * ux + vy * uy > 0.0 else -1.0
        first, last = along - back, along + on
        if same < 0.0:
            first, last = along - on, along + back
        shared = min(last, length) - max(first, 0.0)
        if shared < 0.5 * min(last - first, length):
            continue
        off, turn = vx * ry - vy * rx, math.atan2(sine, cosine)
        # The deviation of the offset is judged where both are seen.
        a = along - 0.5 * length
        v00, v01, v11 = _joint(local, walls[k], a, same, rough)
        v00 += pose_spread[0]
        v11 += pose_spread[1]
        det = v00 * v11 - v01 * v01
        d2 = (v11 * off * off - 2.0 * v01 * off * turn + v00 * turn * turn) / det
        if d2 < best_d2:
            best, best_d2 = k, d2
    return best, best_d2


@helper
def _joint(local, wall, a, same, rough):
    """Covariance of offset and angle between a local wall and a wall, `a` from its middle."""
    v00 = local[5] + wall[6] + 2.0 * a * wall[7] + a * a * wall[8] + rough * rough
    v01 = same * local[6] + wall[7] + a * wall[8]
    turn = rough / max(local[3] + local[4], 0.1)
    v11 = local[7] + wall[8] + 4.0 * turn * turn
    return v00, v01, v11


@kernel
def refine(poses, local, walls, grid, begins, members, settings, pairs, information):
    """Move poses to where the local walls lie on the walls, by weighted least squares.

    `settings`: deviations of the first poses [m, rad], roughness [m], gate of χ², rounds. `pairs`,
    (h, n), become the walls of the local ones, -1 for none; `information`, (h, 3, 3).
    """
    first_way, first_turn, rough, gate, rounds = settings
    for h in range(len(poses)):
        way, turn = first_way, first_turn
        for _ in range(int(rounds)):
            x, y, theta = poses[h, 0], poses[h, 1], poses[h, 2]
            c, s = math.cos(theta), math.sin(theta)
            hxx = hxy = hyy = hxt = hyt = htt = gx = gy = gt = 0.0
            for i in range(len(local)):
                wall = local[i]
                lx, ly = c * wall[0] - s * wall[1], s * wall[0] + c * wall[1]
                px, py, angle = x + lx, y + ly, theta + wall[2]
                ux, uy = math.cos(angle), math.sin(angle)
                best, best_d2 = -1, gate
                spread = (way * way + turn * turn * (lx * lx + ly * ly), turn * turn)
                for quarter in range(-1, 2):
                    t = 0.5 * quarter * (wall[4] if quarter > 0 else wall[3])
                    at = _cell_of(grid, px + t * ux, py + t * uy)
                    if at >= 0:
                        near = members[begins[at] : begins[at + 1]]
                        best, best_d2 = _pair(
                            wall,
                            walls,
                            near,
                            (px, py),
                            (ux, uy),
                            spread,
                            rough,
                            best,
                            best_d2,
                        )
                pairs[h, i] = best
                if best < 0:
                    continue
                vx, vy, length = walls[best, 2], walls[best, 3], walls[best, 4]
                same = 1.0 if vx * ux + vy * uy > 0.0 else -1.0
                rx, ry = px - walls[best, 0], py - walls[best, 1]
                a = rx * vx + ry * vy - 0.5 * length
                off = vx * ry - vy * rx
                twist = math.atan2(same * (vx * uy - vy * ux), same * (vx * ux + vy * uy))
                v00, v01, v11 = _joint(wall, walls[best], a, same, rough)
                det = v00 * v11 - v01 * v01
                w00, w01, w11 = v11 / det, -v01 / det, v00 / det
                # Derivatives of the offset by x, y and θ; the angle turns with θ.
                nx, ny = -vy, vx
                nt = nx * -ly + ny * lx
                hxx += w00 * nx * nx
                hxy += w00 * nx * ny
                hyy += w00 * ny * ny
                hxt += nx * (w00 * nt + w01)
                hyt += ny * (w00 * nt + w01)
                htt += w00 * nt * nt + 2.0 * w01 * nt + w11
                gx += nx * (w00 * off + w01 * twist)
                gy += ny * (w00 * off + w01 * twist)
                gt += nt * (w00 * off + w01 * twist) + w01 * off + w11 * twist
            info = information[h]
            info[0, 0], info[1, 1], info[2, 2] = hxx, hyy, htt
            info[0, 1] = info[1, 0] = hxy
            info[0, 2] = info[2, 0] = hxt
            info[1, 2] = info[2, 1] = hyt
            # The pose is held where the walls leave it free.
            hold, hold_turn = 1.0 / (first_way * first_way), 1.0 / (first_turn * first_turn)
            a, b, d = hxx + hold, hyy + hold, htt + hold_turn
            m0, m1, m2 = b * d - hyt * hyt, hxt * hyt - hxy * d, hxy * hyt - b * hxt
            det = a * m0 + hxy * m1 + hxt * m2
            m4, m5, m8 = a * d - hxt * hxt, hxy * hxt - a * hyt, a * b - hxy * hxy
            poses[h, 0] -= (m0 * gx + m1 * gy + m2 * gt) / det
            poses[h, 1] -= (m1 * gx + m4 * gy + m5 * gt) / det
            poses[h, 2] -= (m2 * gx + m5 * gy + m8 * gt) / det
            way = min(way, 0.01 + math.sqrt(max(m0, m4) / det))
            turn = min(turn, 0.002 + math.sqrt(m8 / det))


@kernel
def vote(local, plan, turns, settings, shift, boxes, voters, touched):
    """Count votes for poses in boxes: an anchor of the local map has one a box, its first.

    Rows of `boxes` become the votes and the mean pose; returns how many boxes are in `touched`.
    `turns`: votes of the walls by degrees, the slot of each box of turns, how many slots.
    """
    low_x, low_y, size, rows, alike, least, of_ends = settings
    by_turn, slots, n_slots = turns
    full, count, n_turns = 2.0 * math.pi, 0, len(slots)
    width = full / n_turns
    for i in range(len(local)):
        x, y, angle, kind, opening = local[i]
        for j in range(len(plan)):
            other = plan[j, 3]
            if kind > 1.5 or other > 1.5:
                if kind != other:
                    continue
            elif kind * other >= 0.0 and kind != other and kind + other >= 0.0:
                continue
            elif abs(opening - plan[j, 4]) > alike:
                continue
            theta = (plan[j, 2] - angle) % full
            weight = by_turn[int(theta * 180.0 / math.pi + 0.5) % 360]
            if weight < least:
                continue
            if kind > 1.5:
                weight *= of_ends
            c, s = math.cos(theta), math.sin(theta)
            px, py = plan[j, 0] - c * x + s * y, plan[j, 1] - s * x - c * y
            at = int((px - low_x) / size + shift) * rows + int((py - low_y) / size + shift)
            at = at * n_slots + slots[int(theta / width + shift) % n_turns]
            if voters[at] == 0:
                touched[count] = at
                count += 1
            elif voters[at] == i + 1:
                continue
            voters[at] = i + 1
            # The mean of turns in one box: those that are a turn apart are not far from another.
            box = boxes[at]
            if box[0] > 0.0:
                theta = box[3] + (theta - box[3] + 0.5 * full) % full - 0.5 * full
            share = weight / (box[0] + weight)
            box[0] += weight
            box[1] += share * (px - box[1])
            box[2] += share * (py - box[2])
            box[3] += share * (theta - box[3])
    return count


@kernel
def choose(poses, order, way, turn, chosen):
    """Choose poses in an order, each farther from all before than a way or a turn; how many."""
    count = 0
    for k in order:
        is_new = True
        for n in range(count):
            other = chosen[n]
            away = abs((poses[k, 2] - poses[other, 2] + math.pi) % (2.0 * math.pi) - math.pi)
            if away < turn:
                if math.hypot(poses[k, 0] - poses[other, 0], poses[k, 1] - poses[other, 1]) < way:
                    is_new = False
                    break
        if is_new:
            chosen[count] = k
            count += 1
            if count == len(chosen):
                break
    return count
