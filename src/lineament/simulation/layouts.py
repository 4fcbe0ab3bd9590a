"""How storeys are laid out: corridors, rows of rooms along them, and the walls between."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..scan import Array

#: Thickness of the walls along a corridor, and of those between rooms [m].
THICK, THIN = 0.2, 0.14
#: Width of a doorway, and how far a closed door stands back from the corridor [m].
DOOR, RECESS = 0.9, 0.1

Box = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Room:
    """A room: its free rectangle, its door, and the corner that is cut off.

    Attributes
    ----------
    low, high : (x, y)
        Corners of the free rectangle [m].
    door : float
        Where the middle of its door is along x [m].
    up : bool
        Whether the door is in the wall of larger y.
    cut : float
        Length that is cut off one corner of the wall across from the door [m]; 0 for none.
    """

    low: tuple[float, float]
    high: tuple[float, float]
    door: float
    up: bool
    cut: float = 0.0


def corridors_of(size: tuple[float, float], rng: np.random.Generator) -> tuple[Array, Array]:
    """Free rectangles of the corridors along x, from low to high, and of those that join them."""
    wide, deep = size
    count, joins = max(2, round(deep / 13)), max(2, round(wide / 25))
    widths = rng.uniform(1.6, 2.6, count)
    # One row of rooms before each corridor, and one after it.
    middles = (np.arange(count) + 0.5) * deep / count + rng.uniform(-0.3, 0.3, count)
    level = np.column_stack(
        (
            np.full(count, 0.3),
            middles - widths / 2,
            np.full(count, wide - 0.3),
            middles + widths / 2,
        )
    )
    at = np.linspace(0.1, 0.9, joins) * wide + rng.uniform(-0.05, 0.05, joins) * wide
    half = rng.uniform(0.8, 1.2, joins)
    low, high = np.full(joins, level[0, 1]), np.full(joins, level[-1, 3])
    return level, np.column_stack((at - half, low, at + half, high))


def rows_of(
    size: tuple[float, float], level: Array, upright: Array
) -> list[tuple[float, float, bool, list[tuple[float, float]]]]:
    """Rows of rooms: low and high y, whether the doors are up, and the spans in x they fill."""
    left, right = 0.3 - THIN / 2, size[0] - 0.3 + THIN / 2
    cuts = [left, *(x for low, _, high, _ in upright for x in (low - 0.13, high + 0.13)), right]
    between = list(zip(cuts[::2], cuts[1::2], strict=True))
    rows = []
    for k, (_, low, _, high) in enumerate(level.tolist()):
        under = 0.3 if k == 0 else (level[k - 1, 3] + low) / 2 + THIN / 2
        over = size[1] - 0.3 if k == len(level) - 1 else (high + level[k + 1, 1]) / 2 - THIN / 2
        outer, last = [(left, right)], len(level) - 1
        rows.append((float(under), low - THICK, True, outer if k == 0 else between))
        rows.append((high + THICK, float(over), False, outer if k == last else between))
    return rows


def pilasters_of(
    level: Array, rooms: list[Room], closed: list[Box], upright: Array, rng: np.random.Generator
) -> list[Box]:
    """Pilasters along some corridors, where there are neither doors nor crossings."""
    found = []
    for low_x, low_y, high_x, high_y in level.tolist():
        if rng.random() < 0.4:
            continue
        doors = [
            r.door for r in rooms if low_y - 1 < (r.high[1] if r.up else r.low[1]) < high_y + 1
        ]
        doors += [
            (x1 + x2) / 2 for x1, y1, x2, y2 in closed if low_y - 1 < (y1 + y2) / 2 < high_y + 1
        ]
        crossings = [x for low, _, high, _ in upright for x in (low, (low + high) / 2, high)]
        kept_off = np.array([*doors, *crossings, low_x, high_x])
        for x in np.arange(low_x, high_x, rng.uniform(3.0, 7.0)) + rng.uniform(0.5, 2.0):
            wide, deep = rng.uniform(0.3, 0.6), rng.uniform(0.1, 0.3)
            if np.abs(kept_off - x).min() > 1.2:
                y, inner = (low_y, low_y + deep) if rng.random() < 0.5 else (high_y, high_y - deep)
                found.append(box_of((x - wide / 2, y), (x + wide / 2, inner)))
    return found


def box_of(one: tuple[float, float], other: tuple[float, float]) -> Box:
    """Return the box between two opposite corners."""
    (x1, y1), (x2, y2) = one, other
    return min(x1, x2), min(y1, y2), max(x1, x2), max(y1, y2)


def narrowed(room: Room, side: int, by: float) -> Room:
    """Move the left, the right or the back wall inwards, where the door leaves room for it."""
    (low_x, low_y), (high_x, high_y) = room.low, room.high
    if side == 0 and room.door - DOOR / 2 > low_x + by + 0.1:
        return replace(room, low=(low_x + by, low_y))
    if side == 1 and room.door + DOOR / 2 < high_x - by - 0.1:
        return replace(room, high=(high_x - by, high_y))
    if room.up:
        return replace(room, low=(low_x, low_y + by))
    return replace(room, high=(high_x, high_y - by))


def walls_of(rooms: list[Room], corridors: Array, solids: Array) -> Array:
    """Walls (S, 4) between what is free, rooms, doorways and corridors, and what is not.

    On the lattice of all edges, a wall is where a free cell lies beside one that is not.
    """
    free = [(*room.low, *room.high) for room in rooms]
    for room in rooms:
        y = (room.high[1], room.high[1] + THICK) if room.up else (room.low[1] - THICK, room.low[1])
        free.append((room.door - DOOR / 2, y[0], room.door + DOOR / 2, y[1]))
    # The recess of a closed door is free, a pilaster is not: it lies within a corridor.
    inside = [bool(_within(corridors, box).any()) for box in solids]
    free += [tuple(box) for box, solid in zip(solids.tolist(), inside, strict=True) if not solid]
    boxes = np.vstack((np.array(free).reshape(-1, 4), corridors))
    taken = solids[inside] if len(solids) else solids
    edges = np.vstack((boxes, taken)).round(6)
    xs, ys = np.unique(edges[:, 0::2]), np.unique(edges[:, 1::2])
    is_free = np.zeros((len(xs) + 1, len(ys) + 1))
    for kind, value in ((boxes, True), (taken, False)):
        for low_x, low_y, high_x, high_y in kind.round(6):
            i, k = (
                np.searchsorted(xs, (low_x, high_x)) + 1,
                np.searchsorted(ys, (low_y, high_y)) + 1,
            )
            is_free[slice(*i), slice(*k)] = value
    walls = [(x1, ys[k], x2, ys[k]) for k, x1, x2 in _runs(np.diff(is_free.T, axis=0)[:, 1:-1], xs)]
    walls += [(xs[k], y2, xs[k], y1) for k, y1, y2 in _runs(np.diff(is_free, axis=0)[:, 1:-1], ys)]
    return _cut_corners(np.array(walls), [room for room in rooms if room.cut])


def _within(corridors: Array, box: Array) -> Array:
    """Whether a box lies within each of the corridors."""
    inside = (corridors[:, :2] <= box[:2] + 1e-9) & (corridors[:, 2:] >= box[2:] - 1e-9)
    return np.asarray(inside.all(axis=1))


def _runs(steps: Array, at: Array) -> list[tuple[int, float, float]]:
    """List runs of the same step along each row: its number, and from where to where.

    A step to free (1) runs forwards, one from free (-1) backwards: the free side is to the left of
    walls along x, and to the right of those along y.
    """
    found = []
    for k, row in enumerate(steps):
        ends = np.flatnonzero(np.diff(row, prepend=0, append=0))
        for first, after in pairwise(ends.tolist()):
            if row[first]:
                run = (float(at[first]), float(at[after]))
                found.append((k, *(run if row[first] > 0 else run[::-1])))
    return found


def _cut_corners(walls: Array, rooms: list[Room]) -> Array:
    """Cut a corner off each of the rooms: of the wall across from the door, far from the door."""
    added = []
    for room in rooms:
        y = room.low[1] if room.up else room.high[1]
        x = room.low[0] if room.door > (room.low[0] + room.high[0]) / 2 else room.high[0]
        corner = np.round((x, y), 6)
        (one,) = np.flatnonzero((walls[:, 2:] == corner).all(axis=1))
        (two,) = np.flatnonzero((walls[:, :2] == corner).all(axis=1))
        before = corner + room.cut * np.sign(walls[one, :2] - corner)
        after = corner + room.cut * np.sign(walls[two, 2:] - corner)
        walls[one, 2:], walls[two, :2] = before, after
        added.append((*before, *after))
    return np.vstack((walls, np.array(added).reshape(-1, 4)))


def way_along(
    level: Array, upright: Array, rooms: list[Room], visits: float, rng: np.random.Generator
) -> Array:
    """Waypoints along every corridor between crossings, back to the first, rooms visited once.

    From each crossing the corridor that was driven the least is taken; then the shortest way back.
    """
    xs, ys = (upright[:, 0] + upright[:, 2]) / 2, (level[:, 1] + level[:, 3]) / 2
    waiting = [room for room in rooms if rng.random() < visits]
    here, way = (0, 0), [(float(xs[0]), float(ys[0]))]
    driven: dict[frozenset[tuple[int, int]], int] = {}
    legs = len(ys) * (len(xs) - 1) + len(xs) * (len(ys) - 1)
    while len(driven) < legs or here != (0, 0):
        i, k = here
        there = [(i + 1, k), (i, k + 1), (i - 1, k), (i, k - 1)]
        there = [(a, b) for a, b in there if 0 <= a < len(xs) and 0 <= b < len(ys)]
        if len(driven) == legs:
            there = [(a, b) for a, b in there if a + b < i + k]
        chance = rng.random(len(there)).tolist()
        ranked = [
            (driven.get(frozenset((here, to)), 0), luck, to)
            for to, luck in zip(there, chance, strict=True)
        ]
        to = min(ranked)[2]
        driven[frozenset((here, to))] = driven.get(frozenset((here, to)), 0) + 1
        if to[1] == k:
            way += _visits((float(xs[i]), float(xs[to[0]])), level[k], waiting)
        way.append((float(xs[to[0]]), float(ys[to[1]])))
        here = to
    return np.array(way)


def _visits(
    leg: tuple[float, float], corridor: Array, waiting: list[Room]
) -> list[tuple[float, float]]:
    """Waypoints into the rooms that wait along a leg, and out again; takes them off the list."""
    start = leg[0]
    y = (corridor[1] + corridor[3]) / 2
    near = [
        room
        for room in waiting
        if min(leg) < room.door < max(leg)
        and abs((room.high[1] if room.up else room.low[1]) - y) < corridor[3] - corridor[1]
    ]
    way = []
    for room in sorted(near, key=lambda room: abs(room.door - start)):
        waiting.remove(room)
        deep = (room.low[1] + room.high[1]) / 2
        way += [(room.door, float(y)), (room.door, deep), (room.door, float(y))]
    return way
