"""Walls of an occupancy grid: the borders between free and occupied cells, cut into lines."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import LineamentError
from ..limits import Limits
from ..scan import Array
from ..walls import Numbers, Records, bent, unit, walls_of
from .grids import Grid

#: Variance of a place that is anywhere within a cell, and of cells that noise moves [cells²].
_UNIFORM, _NOISE = 1 / 12, 0.04
#: Variance that is left of walls in however many rows of cells: no map is better [cells²].
_MAPPED = 0.01
#: Price of a line, and of each border on none; what cells alone explain of χ² counts so little.
_EVIDENCE, _CLUTTER, _CELLS = 8.0, 4.0, 0.1
#: Fewest borders of a line; how much of its way a line goes on, which a thin wall's end does not.
_FEWEST, _ONWARD = 3, 0.4
#: A line begins at one of so many turns of the outline before its end, at most.
_TURNS = 1000
#: Lines meet in a corner if they turn by so much (sine), so near to where one ends [cells].
_BEND, _NEAR = 0.35, 2.0
#: A border is of a line if it goes on with it so far (cosine); those at its ends that do not, say
#: how thick the wall is.
_ALONG = 0.5
#: Shorter lines are no walls [cells, m].
_SHORT, _SHORTEST = 3.0, 0.15
_STEPS = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])


class Outline(NamedTuple):
    """Corners of cells along a border, shape (n + 1, 2), and whether the last is the first."""

    corners: Array
    closed: bool


def walls_of_grid(grid: Grid, limits: Limits) -> Records:
    """Return the faces of what is occupied that are seen from free space, on their left.

    Where no cell is free, what is unknown counts as free. A LineamentError without a wall, or with
    more borders of cells than the limit of ``entities``.
    """
    occupied, free = grid.occupied, grid.free
    borders = outlines(occupied, free if free.any() else ~occupied)
    many = sum(len(outline.corners) - 1 for outline in borders)
    limits.check("entities", many, LineamentError)
    found = [_lines(outline) for outline in borders]
    ends = np.concatenate([np.zeros((0, 2, 2)), *(lines for lines, _ in found)])
    rows = np.concatenate([np.zeros(0), *(rows for _, rows in found)])
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    long = lengths >= max(_SHORT, _SHORTEST / grid.resolution)
    if not long.any():
        n = int(occupied.sum())
        raise LineamentError(f"has no walls: {n} of {occupied.size} cells are occupied")
    walls = walls_of(grid.placed(ends[long]), side=1)
    # Cells of one row are off alike, those of another in their own way.
    variance = (_UNIFORM + _NOISE) / rows[long] + _MAPPED
    walls["covariance"] = bent(variance, lengths[long])
    walls["covariance"][:, 0, 0] *= grid.resolution**2
    return walls


def outlines(occupied: NDArray[np.bool_], free: NDArray[np.bool_]) -> list[Outline]:
    """Return where free cells lie beside occupied ones, with the free ones on the left.

    Occupied cells that touch at a corner are one thing.
    """
    occupied, free = np.pad(occupied, 1), np.pad(free, 1)
    # Beams that graze a wall leave cells before it unknown, between others that are free.
    beside = free.copy()
    beside[1:-1, 1:-1] |= free[2:, 1:-1] | free[:-2, 1:-1] | free[1:-1, 2:] | free[1:-1, :-2]
    free = beside & ~occupied
    sides = (
        (free[1:], occupied[:-1], (0, 1)),  # free above: to the right
        (free[:, :-1], occupied[:, 1:], (1, 0)),
        (free[:-1], occupied[1:], (1, 1)),
        (free[:, 1:], occupied[:, :-1], (1, 1)),
    )
    parts = [np.argwhere(one & other)[:, ::-1] + shift for one, other, shift in sides]
    way = np.repeat(np.arange(4), [len(part) for part in parts])
    tails = np.concatenate(parts)
    ordered = _chained(tails, tails + _STEPS[way], way, free.shape[1] + 1)
    found = []
    for chain, closed in ordered:
        corners = np.concatenate((tails[chain], tails[chain[-1:]] + _STEPS[way[chain[-1:]]]))
        found.append(Outline(corners - 1.0, closed))
    return found


def areas(cells: NDArray[np.bool_]) -> list[list[Array]]:
    """Return the polygons of cells that hang together by their sides, in cells.

    Each is its outer ring, counter-clockwise, then the rings of its holes; the last corner of a
    ring is its first.
    """
    inside = np.pad(cells, 1)
    rings = [outline.corners - 1.0 for outline in outlines(~inside, inside)]
    upright = [np.zeros((0, 3))]
    for k, ring in enumerate(rings):
        at = np.flatnonzero(ring[1:, 0] == ring[:-1, 0])
        low = np.minimum(ring[at, 1], ring[at + 1, 1])
        upright.append(np.column_stack((low, ring[at, 0], np.full(len(at), k))))
    rows = np.concatenate(upright)
    rows = rows[np.lexsort((rows[:, 1], rows[:, 0]))]
    of = rows[:, 2].astype(np.int64)
    # What lies to the left of a hole is the ring around it, or another hole in that ring.
    leftmost = np.lexsort((rows[:, 1], of))[np.searchsorted(np.sort(of), np.arange(len(rings)))]
    around = np.where(_turn(rings) > 0, np.arange(len(rings)), of[leftmost - 1])
    while (around != around[around]).any():
        around = around[around]
    found: dict[int, list[Array]] = {}
    for k in np.lexsort((_turn(rings) < 0, around)).tolist():
        steps = np.diff(rings[k], axis=0)
        bends = np.any(steps != np.roll(steps, 1, axis=0), axis=1)
        corners = rings[k][:-1][bends]
        found.setdefault(int(around[k]), []).append(np.concatenate((corners, corners[:1])))
    return list(found.values())


def _turn(rings: list[Array]) -> Array:
    """Return the areas within rings, negative where these are clockwise."""
    return np.array([(r[:-1, 0] * np.diff(r[:, 1])).sum() for r in rings])


def _chained(tails: Numbers, heads: Numbers, way: Numbers, wide: int) -> list[tuple[Numbers, bool]]:
    """Return the borders that follow each other, as numbers, and whether they come back."""
    n, keys = len(way), (tails @ (1, wide)) * 4 + way
    order = np.argsort(keys)
    keys, following = keys[order], np.full(n, -1)
    for turn in (1, 0, 3):  # to the left first, around the same free cell
        wanted = (heads @ (1, wide)) * 4 + (way + turn) % 4
        at = np.minimum(np.searchsorted(keys, wanted), n - 1)
        there = (keys[at] == wanted) & (following < 0) if n else following < 0
        following[there] = order[at[there]]
    before = np.full(n, -1)
    before[following[following >= 0]] = np.flatnonzero(following >= 0)
    lost = (following >= 0) & (before[following] != np.arange(n))
    following[lost] = -1
    follow, done, found = following.tolist(), bytearray(n), []
    for first in (*np.flatnonzero(before < 0).tolist(), *range(n)):
        chain, k = [], first
        while k >= 0 and not done[k]:
            done[k] = 1
            chain.append(k)
            k = follow[k]
        if chain:
            found.append((np.array(chain), k == first))
    return found


def _lines(outline: Outline) -> tuple[Array, Array]:
    """Return the lines of an outline, within what is occupied, shape (n, 2, 2) [cells].

    And in how many rows of cells each lies, like a flight of stairs.
    """
    corners, closed = outline
    # Around a line of three cells there are eight borders.
    pieces = partition(corners) if len(corners) > (8 if closed else 3) else []
    if closed and pieces:  # opened anew, where a line begins
        first = pieces[-1][0]
        corners = np.concatenate((corners[first:-1], corners[: first + 1]))
        pieces = partition(corners)
    sums, base = _sums(corners)
    lines, rows = np.zeros((len(pieces), 2, 2)), np.ones(len(pieces))
    for k, (i, j) in enumerate(pieces):
        u, (i, j) = _trimmed(corners, sums, i, j)
        _, center, _, _ = _fit(sums[j] - sums[i])
        # A robot sees hits, which are anywhere within the cells; borders lie so far before them.
        middle = center + base + np.array((u[1], -u[0])) * abs(u).sum() / 2
        along = (corners[[i, j]] - middle) @ u
        lines[k] = middle + along[:, None] * u
        rows[k] += np.any(np.diff(corners[i : j + 1], 2, axis=0), axis=1).sum() // 2
    for k in range(0 if closed else 1, len(pieces)):
        begins, end = pieces[k][0], pieces[k - 1][1]
        if begins == end or (begins == 0 and end == len(corners) - 1):
            _meet(lines[k - 1], lines[k], corners[begins])
    return lines, rows


def _trimmed(corners: Array, sums: Array, i: int, j: int) -> tuple[Array, tuple[int, int]]:
    """Return the direction of a piece of an outline, and the piece without borders across it."""
    for _ in range(2):
        u, onward = unit(_fit(sums[j] - sums[i])[3]), corners[j] - corners[i]
        u = -u if onward @ u < 0 else u
        along = np.flatnonzero(np.diff(corners[i : j + 1], axis=0) @ u > _ALONG)
        if len(along):
            i, j = i + int(along[0]), i + int(along[-1]) + 1
    return u, (i, j)


def _meet(before: Array, after: Array, corner: Array) -> None:
    """Let two lines end where they meet, if that is near where one piece ends and one begins."""
    (p, q), (r, s) = before, after
    a, b = (q - p) / max(math.dist(p, q), 1e-9), (s - r) / max(math.dist(r, s), 1e-9)
    sine = a[0] * b[1] - a[1] * b[0]
    if abs(sine) < _BEND:
        return
    arm = r - p
    at = p + (arm[0] * b[1] - arm[1] * b[0]) / sine * a
    if math.dist(at, corner) < _NEAR and (at - p) @ a > 0 and (s - at) @ b > 0:
        before[1] = after[0] = at


def partition(corners: Array) -> list[tuple[int, int]]:
    """Cut an outline into lines: the first and the last corner of each.

    As of a scan by `optimal`, it is the partition of the least energy, exactly: each line has its
    price and its χ², each border on no line a price. Lines begin and end where the outline turns.
    What cells alone explain of χ², of lines that are askew, hardly counts: else each would be a
    flight of stairs.
    """
    steps = np.diff(corners, axis=0)
    turns = np.flatnonzero(np.any(steps[1:] != steps[:-1], axis=1)) + 1
    at = np.concatenate(([0], turns, [len(steps)]))
    sums, energy, origin = _sums(corners)[0][at], np.zeros(len(at)), np.full(len(at), -1)
    places = corners[at]
    for j in range(1, len(at)):
        low = max(0, j - _TURNS)
        n, _, square, _ = _fit(sums[j] - sums[low:j])
        beyond = np.maximum(square - _UNIFORM * n, 0.0)
        cost = _EVIDENCE + (beyond + _CELLS * square) / (_UNIFORM + _NOISE)
        onward = np.linalg.norm(places[j] - places[low:j], axis=1)
        cost[(n < _FEWEST) | (onward < _ONWARD * n)] = math.inf
        cost += energy[low:j]
        best = int(cost.argmin())
        none = energy[j - 1] + _CLUTTER * (at[j] - at[j - 1])
        energy[j] = min(cost[best], none)
        origin[j] = low + best if cost[best] < none else -1
    pieces, j = [], len(at) - 1
    while j > 0:
        if origin[j] >= 0:
            pieces.append((int(at[origin[j]]), int(at[j])))
        j = origin[j] if origin[j] >= 0 else j - 1
    return pieces[::-1]


def _sums(corners: Array) -> tuple[Array, Array]:
    """Return sums of 1, x, y, xx, xy, yy of the borders before each corner, and their origin."""
    middles, base = (corners[1:] + corners[:-1]) / 2, corners.mean(axis=0)
    x, y = (middles - base).T
    rows = np.stack((np.ones(len(x)), x, y, x * x, x * y, y * y), axis=1)
    return np.concatenate((np.zeros((1, 6)), np.cumsum(rows, axis=0))), base


def _fit(sums: Array) -> tuple[Array, Array, Array, Array]:
    """Return number, middle, sum of squares and direction of lines of least squares, by sums."""
    n, x, y, xx, xy, yy = np.moveaxis(sums, -1, 0)
    xx, xy, yy = xx - x * x / n, xy - x * y / n, yy - y * y / n
    square = np.maximum((xx + yy) / 2 - np.hypot((xx - yy) / 2, xy), 0.0)
    return n, np.stack((x / n, y / n), axis=-1), square, np.arctan2(2 * xy, xx - yy) / 2
