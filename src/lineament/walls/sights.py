"""Sights: the segments that show walls, the lines that they lie on, and which of these are one."""

import math
from collections.abc import Collection, Iterable, Sequence
from itertools import chain

import numpy as np

from ..features import SEGMENT
from ..kernels.mapping.lines import SUMS, fit_lines
from ..scan import Array
from . import (
    COLUMN,
    SHORT,
    SHORTEST,
    WALL,
    Numbers,
    Records,
    bent,
    covariance_at,
    lengths_of,
    shared,
    unit,
    wrapped,
)

#: A segment as a key frame sees it, in the frame of the sensor: the numbers of both, its ends along
#: it from its centroid [m], its squared misfit, and how much of that noise alone explains [m²].
SIGHT = np.dtype(
    [("frame", "i8"), ("wall", "i8"), ("centroid", "f8", 2), ("angle", "f8"),
     ("covariance", "f8", (2, 2)), ("ends", "f8", 2), ("misfit", "f8"),
     ("noise", "f8")]
)  # fmt: skip

#: Walls on one line are one wall if no more lies between them [m]: a door is wider; whole ones.
GAP, WHOLE = 0.2, 1e4
#: Segments that are less sure of their direction make no wall of a plan [rad].
LEAST_SURE = 0.2
#: Sights beyond so many deviations count less.
_KERNEL = 3.0
#: Where no more than this share of the most sights goes on, a wall ends.
_SHARE = 0.2
#: Lines whose directions differ by more are never one [rad].
_TURN = 0.35
#: Quantiles of 99 % of χ² with two degrees of freedom and with three: so many of the parts of a
#: wall, and of a column, stay together; so many loops that are right count as such.
_GATE, GATE_3 = -2.0 * math.log1p(-0.99), 11.344866730144371
#: Where sights are placed already.
_HERE = np.zeros((1, 3))


def sights_of(seen: Sequence[tuple[Records, Numbers]], rough: float = 0.0) -> Records:
    """Return records of `SIGHT` of the segments of key frames, with the number of each's wall.

    Their surfaces are `rough` [m], each time elsewhere; the shortest are left out.
    """
    segments = np.concatenate([of_frame for of_frame, _ in seen], dtype=SEGMENT)
    sights = shared(segments, SIGHT)
    sights["frame"] = np.repeat(np.arange(len(seen)), [len(walls) for _, walls in seen])
    sights["wall"] = np.concatenate([walls for _, walls in seen])
    sights["covariance"] += bent(rough**2, segments["length"]) + 1e-18 * np.eye(2)
    for k, name in enumerate(("start", "end")):
        arm = segments[name] - segments["centroid"]
        sights["ends"][:, k] = (arm * unit(segments["angle"])).sum(axis=1)
    sights["misfit"], sights["noise"] = squared_misfits(segments)
    return sights[segments["length"] > SHORT]


def squared_misfits(segments: Records) -> tuple[Array, Array]:
    """Squared misfits of segments, and how much of them noise alone explains [m²]."""
    misfit = segments["misfit"] ** 2
    noise = np.maximum(segments["rms"] ** 2 - misfit, 0.0)
    return misfit, noise / np.sqrt(math.pi * np.maximum(segments["n_points"], 1))


def count_of(sights: Records) -> int:
    """Return the number of walls that sights have."""
    return int(sights["wall"].max(initial=-1)) + 1


def placed(sights: Records, poses: Array) -> tuple[Array, Array]:
    """Centroids (m, 2) and angles (m,) in the frame of the poses (n, 3)."""
    at = poses[sights["frame"]]
    (c, s), (x, y) = unit(at[:, 2]).T, sights["centroid"].T
    moved = np.column_stack((at[:, 0] + c * x - s * y, at[:, 1] + s * x + c * y))
    return moved, at[:, 2] + sights["angle"]


def errors(sights: Records, poses: Array, lines: Records) -> tuple[Array, Array, Array]:
    """Offsets and angles (m, 2) off the walls, and their derivatives by pose and wall."""
    (places, angles), line = placed(sights, poses), lines[sights["wall"]]
    u, arm = unit(line["angle"]), places - line["centroid"]
    of_pose, of_wall = np.zeros((len(u), 2, 3)), np.zeros((len(u), 2, 2))
    of_pose[:, 0, 0], of_pose[:, 0, 1], of_pose[:, 1, 2] = -u[:, 1], u[:, 0], 1.0
    of_pose[:, 0, 2] = (u * (places - poses[sights["frame"], :2])).sum(axis=1)
    of_wall[:, 0, 0] = of_wall[:, 1, 1] = -1.0
    of_wall[:, 0, 1] = -(u * arm).sum(axis=1)
    offsets = u[:, 0] * arm[:, 1] - u[:, 1] * arm[:, 0]
    return np.column_stack((offsets, wrapped(angles - line["angle"]))), of_pose, of_wall


def extents(sights: Records, poses: Array, lines: Records) -> tuple[Array, Array]:
    """From where to where along its wall each sight goes, from the wall's centroid on [m]."""
    (places, angles), line = placed(sights, poses), lines[sights["wall"]]
    along = ((places - line["centroid"]) * unit(line["angle"])).sum(axis=1)
    ends = along[:, None] + sights["ends"] * np.cos(angles - line["angle"])[:, None]
    return ends.min(axis=1), ends.max(axis=1)


def lines_of(sights: Records, poses: Array, count: int) -> Records:
    """Return the line of each wall, a `WALL` without ends, as if the poses were known.

    From the mean of its sights on, by robust least squares.
    """
    lines, words = np.zeros(count, WALL), np.ascontiguousarray(sights).view(np.float64)
    rows = words.reshape(len(sights), SIGHT.itemsize // 8)
    of_lines, most = lines.view(np.float64).reshape(count, WALL.itemsize // 8), _KERNEL**2
    poses = np.ascontiguousarray(poses, np.float64)
    fit_lines(rows, rows.view(np.int64), poses, most, of_lines, np.zeros((count, SUMS)))
    return lines


def move(lines: Records, steps: Array) -> None:
    """Move lines by offsets and turns (w, 2)."""
    u = unit(lines["angle"])
    lines["centroid"] += steps[:, :1] * np.column_stack((-u[:, 1], u[:, 0]))
    lines["angle"] = wrapped(lines["angle"] + steps[:, 1])


def robust(off: Array, information: Array) -> Array:
    """Information of errors (m, k), of which those beyond 3 deviations count less."""
    squares = np.einsum("ni,nij,nj->n", off, information, off)
    share: Array = _KERNEL**2 / np.maximum(squares, _KERNEL**2)
    return information * share[:, None, None]


def walls_along(
    sights: Records,
    poses: Array,
    lines: Records,
    gap: float = GAP,
    views: int = 1,
    everywhere: int = 1,
) -> Records:
    """Return walls along their lines, as far as sights lie no farther apart than a gap [m].

    Each part was seen so often, and so often everywhere along it. If `views` is more than 1, a wall
    ends where hardly any sight goes on: at a grazing angle, a few cross doorways.
    """
    low, high = extents(sights, poses, lines)
    runs = stretches(sights["wall"], low, high, gap, views, everywhere)
    return on_lines(lines, *runs)


def stretches(
    w: Numbers, low: Array, high: Array, gap: float = GAP, views: int = 1, everywhere: int = 1
) -> tuple[Numbers, Array, Array, Numbers]:
    """Return what parts of each wall w (m,), from low to high [m], cover together.

    These are the wall, from where to where, and how many parts, in the order of walls and places;
    limits are those of `walls_along`.
    """
    w, places = np.tile(w, 2), np.concatenate((low, high + gap))
    order = np.lexsort((places, w))
    w, places, begins = w[order], places[order], order < len(low)
    cover, most = np.cumsum(np.where(begins, 1, -1)), np.zeros(int(w.max(initial=-1)) + 1)
    np.maximum.at(most, w, cover)
    least = np.maximum(_SHARE * most[w] if views > 1 else 0, everywhere - 1)
    edges = np.flatnonzero(np.diff(cover > least, prepend=False))
    seen: Numbers = np.cumsum(begins)[edges[1::2]] - np.cumsum(~begins)[edges[::2]]
    first, last = edges.reshape(-1, 2)[seen >= views].T
    return w[first], places[first], places[last] - gap, seen[seen >= views]


def on_lines(lines: Records, w: Numbers, begin: Array, end: Array, views: Numbers) -> Records:
    """Return walls along lines w (m,), from where to where from their centroids on [m]."""
    walls: Records = lines[w]
    middle = np.where((begin < 0) & (end > 0), 0.0, (begin + end) / 2)
    u, origin = unit(walls["angle"]), walls["centroid"].copy()
    for name, along in (("start", begin), ("end", end), ("centroid", middle)):
        walls[name] = origin + along[:, None] * u
    walls["covariance"] = covariance_at(walls["covariance"], middle)
    walls["side"], walls["views"] = 1, views
    return walls


def renumbered(sights: Records, pairs: Numbers) -> Records:
    """Return the sights with new numbers of walls, of which pairs (m, 2) are one."""
    labels, result = np.arange(count_of(sights)), sights.copy()
    labels[pairs[:, 0]] = pairs[:, 1]
    result["wall"] = np.unique(labels, return_inverse=True)[1][sights["wall"]]
    return result


def same(
    sights: Records,
    poses: Array,
    lines: Records,
    apart: float,
    denied: Collection[tuple[int, int]] = (),
) -> Numbers:
    """Return pairs of walls (m, 2) that are one: a part, and the wall that it is a part of.

    They are one if they face the same way, lie along each other or no farther apart than a gap,
    and the χ² of their common line is within its 99 % quantile; surfaces are off it by their
    misfits and `apart` [m]. The most often seen come first, and of these the longest. Some pairs
    are `denied`.
    """
    count, w, points = len(lines), sights["wall"], lines["centroid"]
    first, last = np.full(count, 1e9), np.full(count, -1e9)
    low, high = extents(sights, poses, lines)
    np.minimum.at(first, w, low)
    np.maximum.at(last, w, high)
    views = np.bincount(w, minlength=count)
    bows = misfits(sights, count) + apart**2 / 2
    order, u = np.lexsort((first - last, -views)), unit(lines["angle"])
    ends = points[:, None] + np.stack((first, last), axis=1)[:, :, None] * u[:, None]
    kept, found = np.zeros(count, dtype=bool), []
    # Twice around, so that those of nearly the same angle follow each other.
    ranked = np.tile(np.argsort(lines["angle"]), 2)
    turned = lines["angle"][ranked] + np.repeat((0.0, 2 * math.pi), count)
    least = np.where(lines["angle"] - _TURN < -math.pi, 2 * math.pi, 0.0) + lines["angle"]
    begins, ends_at = (np.searchsorted(turned, least + turn) for turn in (-_TURN, _TURN))
    for k in order[views[order] > 0].tolist():
        near = np.sort(ranked[begins[k] : ends_at[k]])
        near = near[kept[near]]
        along = ((ends[k] - points[near, None]) * u[near, None]).sum(axis=2)
        begin, end = along.min(axis=1), along.max(axis=1)
        beside = (begin < last[near] + GAP) & (end > first[near] - GAP)
        near, begin, end = near[beside], begin[beside], end[beside]
        kept[k] = True
        if not len(near):
            continue
        # The middle of what they share, or of what is between them.
        shared = (np.maximum(begin, first[near]) + np.minimum(end, last[near])) / 2
        arm = points[near] + shared[:, None] * u[near] - points[k]
        off = np.column_stack((arm[:, 0] * u[k, 1] - arm[:, 1] * u[k, 0],
                               wrapped(lines["angle"][k] - lines["angle"][near])))  # fmt: skip
        spread = covariance_at(lines["covariance"][near], shared)
        spread += covariance_at(lines["covariance"][[k]], (arm * u[k]).sum(axis=1))
        shorter = np.minimum(last[near] - first[near], last[k] - first[k])
        spread += bent(bows[near] + bows[k], shorter)
        squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(spread), off)
        likely = near[np.argsort(squares)[: (squares < _GATE).sum()]].tolist()
        one = next(((k, j) for j in likely if (k, j) not in denied), None)
        if one:
            found.append(one)
            kept[k] = False
    return np.array(found, np.int64).reshape(-1, 2)


def misfits(sights: Records, count: int) -> Array:
    """Return the mean squared misfit of each wall [m²], less what noise alone explains."""
    w, views = sights["wall"], np.maximum(np.bincount(sights["wall"], minlength=count), 1)
    return np.maximum(np.bincount(w, sights["misfit"] - sights["noise"], count) / views, 0.0)


def bowed(walls: Records, sights: Records) -> Records:
    """Return walls, whole and in order, whose covariances hold the mean misfit of their sights."""
    walls["covariance"] += bent(misfits(sights, len(walls)), lengths_of(walls))
    return walls


def joined(sights: Records, apart: float = 0.0, poses: Array = _HERE) -> tuple[Records, Records]:
    """Return sights with the numbers of their walls, until none are the `same`, and the lines.

    There is at least one sight; without poses, they are in the frame of the walls.
    """
    before = -1
    while (count := count_of(sights)) != before:
        lines, before = lines_of(sights, poses, count), count
        sights = renumbered(sights, same(sights, poses, lines, apart))
    return sights, lines


def walls_shown(tables: Sequence[Records]) -> Records:
    """Return the walls that segments in the frame of the map show; parts of one are joined."""
    segments = np.concatenate([np.zeros(0, SEGMENT), *tables])
    with np.errstate(invalid="ignore"):
        sure = segments["covariance"][:, 1, 1] < LEAST_SURE**2
    segments = segments[sure & (segments["length"] >= SHORTEST)]
    if not len(segments):
        return np.zeros(0, WALL)
    sights, lines = joined(sights_of([(segments, np.arange(len(segments)))]))
    return bowed(walls_along(sights, _HERE, lines, WHOLE), sights)


def columns_shown(tables: Iterable[Records]) -> Records:
    """Return the columns that arcs in the frame of the map show, by Kalman's update."""
    arcs = list(chain.from_iterable(tables))
    columns: list[Records] = []
    places, spreads = np.empty((len(arcs), 3)), np.empty(len(arcs))
    for arc in arcs:
        place, n = np.append(arc["center"], arc["radius"]), len(columns)
        # The χ² is at least the squared distance over the trace of the covariance.
        squares = np.square(places[:n] - place).sum(axis=1)
        spread = np.trace(arc["covariance"])
        for k in np.flatnonzero(squares < GATE_3 * (spreads[:n] + spread)).tolist():
            column, e = columns[k], place - places[k]
            inverse = np.linalg.inv(column["covariance"] + arc["covariance"])
            if e @ inverse @ e < GATE_3:
                gain = column["covariance"] @ inverse
                column["center"] += (gain @ e)[:2]
                column["radius"] += (gain @ e)[2]
                column["covariance"] -= gain @ column["covariance"]
                column["views"] += 1
                break
        else:
            k = n
            columns.append(np.array((arc["center"], arc["radius"], arc["covariance"], 1), COLUMN))
        places[k] = *columns[k]["center"], columns[k]["radius"]
        spreads[k] = np.trace(columns[k]["covariance"])
    return np.array(columns, COLUMN)
