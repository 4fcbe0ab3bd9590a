"""Local walls on the walls of a map: pairs by χ², and the pose by weighted least squares."""

import math

from .. import helper, kernel
from ..arrays import Floats1, Floats2, Floats3, Ints1, Ints2
from .layout import cell_of

#: Once a round moves a pose, and what is known of it, by less, the next does not move it [m, rad].
_STILL = 1e-7


@helper
def _pair(local, walls, near, place, turned, pose_spread, rough, best, best_d2):
    """Find the wall that fits a local wall best: its number and squared deviation."""
    x, y = place
    ux, uy = turned
    back, on = local[4], local[5]
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
        # The deviation of the offset is judged where both are seen; with the turn, it is no less.
        off, a = vx * ry - vy * rx, along - 0.5 * length
        v00, v01, v11 = _joint(local, walls[k], a, same, rough)
        v00 += pose_spread[0]
        if off * off >= best_d2 * v00:
            continue
        v11 += pose_spread[1]
        turn = math.atan2(sine, cosine)
        det = v00 * v11 - v01 * v01
        d2 = (v11 * off * off - 2.0 * v01 * off * turn + v00 * turn * turn) / det
        if d2 < best_d2:
            best, best_d2 = k, d2
    return best, best_d2


@helper
def _joint(local, wall, a, same, rough):
    """Covariance of offset and angle between a local wall and a wall, `a` from its middle."""
    v00 = local[6] + wall[6] + 2.0 * a * wall[7] + a * a * wall[8] + rough * rough
    v01 = same * local[7] + wall[7] + a * wall[8]
    turn = rough / max(local[4] + local[5], 0.1)
    v11 = local[8] + wall[8] + 4.0 * turn * turn
    return v00, v01, v11


@kernel
def refine(
    poses: Floats2,
    local: Floats2,
    walls: Floats2,
    grid: Floats1,
    begins: Ints1,
    members: Ints1,
    settings: tuple[float, float, float, float, float],
    pairs: Ints2,
    information: Floats3,
):
    """Move poses to where the local walls lie on the walls, by weighted least squares.

    `settings`: deviations of the first poses [m, rad], roughness [m], gate of χ², rounds. `pairs`,
    (h, n), become the walls of the local ones, -1 for none; `information`, (h, 3, 3).
    """
    first_way, first_turn, rough, gate, rounds = settings
    for h in range(len(poses)):
        way, turn = first_way, first_turn
        for lap in range(int(rounds)):
            x, y, theta = poses[h, 0], poses[h, 1], poses[h, 2]
            c, s = math.cos(theta), math.sin(theta)
            hxx = hxy = hyy = hxt = hyt = htt = gx = gy = gt = 0.0
            for i in range(len(local)):
                wall = local[i]
                lx, ly = c * wall[0] - s * wall[1], s * wall[0] + c * wall[1]
                ux, uy = c * wall[2] - s * wall[3], s * wall[2] + c * wall[3]
                px, py, best, best_d2, before = x + lx, y + ly, -1, gate, -1
                spread = (way * way + turn * turn * (lx * lx + ly * ly), turn * turn)
                for quarter in range(-1, 2):
                    t = 0.5 * quarter * (wall[5] if quarter > 0 else wall[4])
                    at = cell_of(grid, px + t * ux, py + t * uy)
                    if at < 0 or at == before:
                        continue
                    before, near = at, members[begins[at] : begins[at + 1]]
                    best, best_d2 = _pair(
                        wall, walls, near, (px, py), (ux, uy), spread, rough, best, best_d2
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
                if lap == 0:  # Of pairs that may be wrong, far ones turn a pose the most.
                    v00 += spread[0]
                    v11 += spread[1]
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
            steps = (
                (m0 * gx + m1 * gy + m2 * gt) / det,
                (m1 * gx + m4 * gy + m5 * gt) / det,
                (m2 * gx + m5 * gy + m8 * gt) / det,
            )
            poses[h, 0] -= steps[0]
            poses[h, 1] -= steps[1]
            poses[h, 2] -= steps[2]
            before_way, before_turn = way, turn
            way = min(way, 0.01 + math.sqrt(max(m0, m4) / det))
            turn = min(turn, 0.002 + math.sqrt(m8 / det))
            change = max(before_way - way, before_turn - turn)
            for step in steps:
                change = max(change, abs(step))
            if change < _STILL:
                break
