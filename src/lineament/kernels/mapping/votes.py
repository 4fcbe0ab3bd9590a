"""Votes of corners and ends of walls for poses, and poses that are apart."""

import math

from .. import helper, kernel
from ..arrays import Floats1, Floats2, Ints1, Ints2


DEGREE = math.pi / 180.0


@helper
def _may_be(kind, other):
    """Whether anchors of two kinds may be the same: -1 may be a corner of either."""
    return kind == other or (min(kind, other) < 0.0 and max(kind, other) < 1.5)


@helper
def _fill(number, anchor, plan, turn, by_turn, settings, scratch, touched):
    """Count the votes of an anchor for poses of a turn; how many boxes then have votes.

    The numbers of anchors count from 1. `turn` is the least of its box, and how wide that is; how
    far the boxes of places are shifted; and how many have votes.
    """
    anchors, units, begins = plan
    low_x, low_y, size, rows, alike, least, of_ends = settings
    boxes, voters = scratch
    least_turn, wide, shift, count = turn
    x, y, angle, kind = anchor[0], anchor[1], anchor[2], anchor[3]
    cosine, sine = math.cos(angle), math.sin(angle)
    share, first = of_ends if kind > 1.5 else 1.0, (angle + least_turn) / DEGREE
    for of in range(5):
        if not _may_be(kind, of - 1.0):
            continue
        for n in range(math.floor(first - 1e-6), math.floor(first + wide / DEGREE + 1e-6) + 1):
            at = 360 * of + n % 360
            for j in range(begins[at], begins[at + 1]):
                more = anchors[j, 2] - angle - least_turn
                more -= 2.0 * math.pi * math.floor(more / (2.0 * math.pi))
                voted = by_turn[math.floor((least_turn + more) / DEGREE + 0.5) % 360]
                if voted < least or more >= wide or abs(anchors[j, 4] - anchor[4]) > alike:
                    continue
                c = units[j, 0] * cosine + units[j, 1] * sine
                s = units[j, 1] * cosine - units[j, 0] * sine
                px, py = anchors[j, 0] - c * x + s * y, anchors[j, 1] - s * x - c * y
                at_box = int((px - low_x) / size + shift) * rows
                at_box += int((py - low_y) / size + shift)
                if voters[at_box] == number:
                    continue
                if voters[at_box] == 0:
                    touched[count] = at_box
                    count += 1
                voters[at_box] = number
                box, weight = boxes[at_box], share * voted
                box[0] += weight
                box[1] += weight * px
                box[2] += weight * py
                box[3] += weight * more
    return count


@kernel
def vote(
    local: Floats2,
    plan: tuple[Floats2, Floats2, Ints1],
    turns: tuple[Floats1, Ints2],
    settings: tuple[float, float, float, int, float, float, float],
    scratch: tuple[Floats2, Ints1],
    touched: Ints1,
    found: Floats2,
) -> int:
    """Count votes for poses in boxes: an anchor of the local map has one a box, its first.

    There are two sets of boxes, which overlap by half; those of one turn are filled at a time.
    Columns of `found` become the votes and the mean pose of each that has some; how many is
    returned.

    `plan`: anchors by kind and degree, unit vectors of their directions, and where those of each
    degree begin. `turns`: votes of the walls by degrees, and which boxes of turns are used in
    either set. `scratch`, of 0, has the sums of each box of places, and who voted for it last;
    `touched` is for those that have votes.
    """
    (by_turn, used), (boxes, voters), total = turns, scratch, 0
    wide = 2.0 * math.pi / used.shape[1]
    for k in range(2):
        for turn in range(used.shape[1]):
            if not used[k, turn]:
                continue
            count, least_turn = 0, (turn - 0.5 * k) * wide
            for i in range(len(local)):
                box = (least_turn, wide, 0.5 * k, count)
                count = _fill(i + 1, local[i], plan, box, by_turn, settings, scratch, touched)
            for at in touched[:count]:
                votes = boxes[at, 0]
                found[0, total] = votes
                found[1, total], found[2, total] = boxes[at, 1] / votes, boxes[at, 2] / votes
                found[3, total] = least_turn + boxes[at, 3] / votes
                for column in range(4):
                    boxes[at, column] = 0.0
                voters[at] = 0
                total += 1
    return total


@kernel
def choose(poses: Floats2, order: Ints1, way: float, turn: float, chosen: Ints1) -> int:
    """Choose poses in an order, each farther from all before than a way or a turn; how many."""
    count = 0
    for k in order:
        is_new = True
        for other in chosen[:count]:
            dx, dy = poses[k, 0] - poses[other, 0], poses[k, 1] - poses[other, 1]
            if dx * dx + dy * dy >= way * way:
                continue
            away = abs((poses[k, 2] - poses[other, 2] + math.pi) % (2.0 * math.pi) - math.pi)
            if away < turn:
                is_new = False
                break
        if is_new:
            chosen[count] = k
            count += 1
            if count == len(chosen):
                break
    return count
