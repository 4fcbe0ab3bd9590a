"""Votes of corners and ends of walls for poses, and poses that are apart."""

import math

from .. import helper, kernel
from ..arrays import Floats1, Floats2, Floats3, Ints1, Ints2, Shorts2


@helper
def _is_alike(anchor, other, alike):
    """Whether two anchors may be the same: ends of walls, or corners with equal openings."""
    kind, kind_of_other = anchor[3], other[3]
    if kind > 1.5 or kind_of_other > 1.5:
        return kind == kind_of_other
    if kind != kind_of_other and kind >= 0.0 and kind_of_other >= 0.0:
        return False
    return abs(anchor[4] - other[4]) <= alike


@helper
def _count(box, weight, x, y, theta):
    """Count a vote; turns are from those in the box, which are never far from it."""
    full = 2.0 * math.pi
    if box[0] > 0.0:
        theta = box[3] + (theta - box[3] + 0.5 * full) % full - 0.5 * full
    share = weight / (box[0] + weight)
    box[0] += weight
    box[1] += share * (x - box[1])
    box[2] += share * (y - box[2])
    box[3] += share * (theta - box[3])


@kernel
def vote(
    local: Floats2,
    plan: Floats2,
    units: Floats2,
    turns: tuple[Floats1, Ints2, int],
    settings: tuple[float, float, float, int, float, float, float],
    boxes: Floats3,
    voters: Shorts2,
    touched: Ints2,
    counts: Ints1,
):
    """Count votes for poses in boxes: an anchor of the local map has one a box, its first.

    There are two sets of boxes, which overlap by half. Rows of `boxes`, (2, n, 4), become the votes
    and the mean pose; `touched` lists those of each set that have votes, and `counts`, which are 0
    before, how many. `units` are the directions of the plan's anchors. `turns`: votes of the walls
    by degrees, the slot of each box of turns in either set, how many slots.
    """
    low_x, low_y, size, rows, alike, least, of_ends = settings
    by_turn, slots, n_slots = turns
    full, n_turns = 2.0 * math.pi, slots.shape[1]
    for i in range(len(local)):
        x, y, angle = local[i, 0], local[i, 1], local[i, 2]
        cosine, sine = math.cos(angle), math.sin(angle)
        share = of_ends if local[i, 3] > 1.5 else 1.0
        for j in range(len(plan)):
            if not _is_alike(local[i], plan[j], alike):
                continue
            theta = plan[j, 2] - angle
            theta -= full * math.floor(theta / full)
            weight = by_turn[int(theta * 360.0 / full + 0.5) % 360]
            if weight < least:
                continue
            ux, uy = units[j, 0], units[j, 1]
            c, s = ux * cosine + uy * sine, uy * cosine - ux * sine
            px, py = plan[j, 0] - c * x + s * y, plan[j, 1] - s * x - c * y
            for k in range(2):
                shift = 0.5 * k
                at = int((px - low_x) / size + shift) * rows + int((py - low_y) / size + shift)
                at = at * n_slots + slots[k, int(theta * n_turns / full + shift) % n_turns]
                if voters[k, at] == i + 1:
                    continue
                if voters[k, at] == 0:
                    touched[k, counts[k]] = at
                    counts[k] += 1
                voters[k, at] = i + 1
                _count(boxes[k, at], share * weight, px, py, theta)


@kernel
def choose(poses: Floats2, order: Ints1, way: float, turn: float, chosen: Ints1) -> int:
    """Choose poses in an order, each farther from all before than a way or a turn; how many."""
    count = 0
    for k in order:
        is_new = True
        for n in range(count):
            other = chosen[n]
            away = abs((poses[k, 2] - poses[other, 2] + math.pi) % (2.0 * math.pi) - math.pi)
            between = math.hypot(poses[k, 0] - poses[other, 0], poses[k, 1] - poses[other, 1])
            is_new &= away >= turn or between >= way
        if is_new:
            chosen[count] = k
            count += 1
            if count == len(chosen):
                break
    return count
