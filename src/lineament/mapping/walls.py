"""Walls and columns: their records, the segments that show them, and which of these are one."""

import math
from collections.abc import Iterable, Sequence
from itertools import chain

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..features import SEGMENT
from ..motion.association import chi_square
from ..scan import Array

#: A straight wall. Its covariance is that of (offset along the left normal at the centroid, angle)
#: [m², m·rad, rad²]. `side` is 1 where it was seen from its left alone, 0 where from either side.
WALL = np.dtype(
    [
        ("start", "f8", 2),
        ("end", "f8", 2),
        ("centroid", "f8", 2),
        ("angle", "f8"),
        ("covariance", "f8", (2, 2)),
        ("side", "i4"),
        ("views", "i4"),
    ],
    align=True,
)
#: A round column or a bend: its covariance is that of (x, y, radius) [m²].
COLUMN = np.dtype(
    [("center", "f8", 2), ("radius", "f8"), ("covariance", "f8", (3, 3)), ("views", "i4")],
    align=True,
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
#: Segments that are shorter, or less sure of their direction, make no wall [m, rad].
SHORTEST, LEAST_SURE = 0.15, 0.2
#: Sights are no shorter [m]; beyond so many deviations they count less.
_SHORT, _KERNEL = 0.1, 3.0
#: Where no more than this share of the most sights goes on, a wall ends.
_SHARE = 0.2
#: Lines whose directions differ by more are never one [rad]; share of the parts of a wall that the
#: tests keep together.
_TURN, _GATE = 0.35, 0.99

Numbers = NDArray[np.int64]
Records = NDArray[np.void]


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
    sights["misfit"] = segments["misfit"] ** 2
    noise = np.maximum(segments["rms"] ** 2 - sights["misfit"], 0.0)
    sights["noise"] = noise / np.sqrt(math.pi * np.maximum(segments["n_points"], 1))
    return sights[segments["length"] > _SHORT]


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
    (places, angles), w, lines = placed(sights, poses), sights["wall"], np.zeros(count, WALL)
    sure, firm = (1.0 / sights["covariance"][:, k, k, None] for k in range(2))
    lines["angle"] = np.arctan2(*summed(firm * unit(angles), w, count).T[::-1])
    total = np.maximum(summed(sure, w, count), 1e-12)
    lines["centroid"] = summed(sure * places, w, count) / total
    information = np.linalg.inv(sights["covariance"])
    for _ in range(2):
        off, _, of_wall = errors(sights, poses, lines)
        weighted = of_wall.transpose(0, 2, 1) @ robust(off, information)
        own = summed(weighted @ of_wall, w, count)
        lines["covariance"] = np.linalg.inv(own + 1e-6 * np.eye(2))
        step = lines["covariance"] @ summed(weighted @ off[:, :, None], w, count)
        move(lines, -step[:, :, 0])
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
    sights: Records, poses: Array, lines: Records, gap: float = GAP, views: int = 1
) -> Records:
    """Return walls along their lines, as far as sights lie no farther apart than a gap [m].

    Each part was seen so often. If that is more than once, a wall ends where hardly any sight goes
    on: at a grazing angle, a few cross doorways.
    """
    low, high = extents(sights, poses, lines)
    w, places = np.tile(sights["wall"], 2), np.concatenate((low, high + gap))
    order = np.lexsort((places, w))
    w, places, begins = w[order], places[order], order < len(low)
    cover, most = np.cumsum(np.where(begins, 1, -1)), np.zeros(len(lines))
    np.maximum.at(most, w, cover)
    edges = np.flatnonzero(np.diff(cover > (_SHARE * most[w] if views > 1 else 0), prepend=False))
    seen: Numbers = np.cumsum(begins)[edges[1::2]] - np.cumsum(~begins)[edges[::2]]
    first, last = edges.reshape(-1, 2)[seen >= views].T
    walls: Records = lines[w[first]]
    begin, end = places[first], places[last] - gap
    middle = np.where((begin < 0) & (end > 0), 0.0, (begin + end) / 2)
    u, origin = unit(walls["angle"]), walls["centroid"].copy()
    for name, along in (("start", begin), ("end", end), ("centroid", middle)):
        walls[name] = origin + along[:, None] * u
    walls["covariance"] = _at(walls["covariance"], middle)
    walls["side"], walls["views"] = 1, seen[seen >= views]
    return walls


def merged(sights: Records, poses: Array, lines: Records, apart: float) -> Records:
    """Return the sights with a number for each wall that is the same for those that are one.

    They are one if they face the same way, lie along each other or no farther apart than a gap,
    and the χ² of their common line is within its 99 % quantile; surfaces are off it by their
    misfits and `apart` [m]. The most often seen come first, and of these the longest.
    """
    count, w, points = len(lines), sights["wall"], lines["centroid"]
    first, last = np.full(count, 1e9), np.full(count, -1e9)
    low, high = extents(sights, poses, lines)
    np.minimum.at(first, w, low)
    np.maximum.at(last, w, high)
    views = np.bincount(w, minlength=count)
    bows = misfits(sights, count) + apart**2 / 2
    order, labels, u = np.lexsort((first - last, -views)), np.arange(count), unit(lines["angle"])
    ends = points[:, None] + np.stack((first, last), axis=1)[:, :, None] * u[:, None]
    kept = np.zeros(count, dtype=bool)
    for k in order[views[order] > 0].tolist():
        near = np.flatnonzero(kept & (abs(wrapped(lines["angle"] - lines["angle"][k])) < _TURN))
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
        spread = _at(lines["covariance"][near], shared)
        spread += _at(lines["covariance"][[k]], (arm * u[k]).sum(axis=1))
        shorter = np.minimum(last[near] - first[near], last[k] - first[k])
        spread += bent(bows[near] + bows[k], shorter)
        squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(spread), off)
        if squares.min() < chi_square(_GATE, 2):
            labels[k], kept[k] = near[squares.argmin()], False
    result = sights.copy()
    result["wall"] = np.unique(labels, return_inverse=True)[1][w]
    return result


def misfits(sights: Records, count: int) -> Array:
    """Return the mean squared misfit of each wall [m²], less what noise alone explains."""
    w, views = sights["wall"], np.maximum(np.bincount(sights["wall"], minlength=count), 1)
    return np.maximum(np.bincount(w, sights["misfit"] - sights["noise"], count) / views, 0.0)


def bowed(walls: Records, sights: Records) -> Records:
    """Return walls, whole and in order, whose covariances hold the mean misfit of their sights."""
    walls["covariance"] += bent(misfits(sights, len(walls)), lengths_of(walls))
    return walls


def walls_shown(tables: Sequence[Records]) -> Records:
    """Return the walls that segments in the frame of the map show; parts of one are joined."""
    segments = np.concatenate([np.zeros(0, SEGMENT), *tables])
    with np.errstate(invalid="ignore"):
        sure = segments["covariance"][:, 1, 1] < LEAST_SURE**2
    segments = segments[sure & (segments["length"] >= SHORTEST)]
    if not len(segments):
        return np.zeros(0, WALL)
    sights, before = sights_of([(segments, np.arange(len(segments)))]), -1
    pose = np.zeros((1, 3))
    while (count := int(sights["wall"].max()) + 1) != before:
        lines, before = lines_of(sights, pose, count), count
        sights = merged(sights, pose, lines, 0.0)
    return bowed(walls_along(sights, pose, lines, WHOLE), sights)


def columns_shown(tables: Iterable[Records]) -> Records:
    """Return the columns that arcs in the frame of the map show, by Kalman's update."""
    columns: list[Records] = []
    for arc in chain.from_iterable(tables):
        for column in columns:
            e = np.append(arc["center"] - column["center"], arc["radius"] - column["radius"])
            inverse = np.linalg.inv(column["covariance"] + arc["covariance"])
            if e @ inverse @ e < chi_square(_GATE, 3):
                gain = column["covariance"] @ inverse
                column["center"] += (gain @ e)[:2]
                column["radius"] += (gain @ e)[2]
                column["covariance"] -= gain @ column["covariance"]
                column["views"] += 1
                break
        else:
            columns.append(np.array((arc["center"], arc["radius"], arc["covariance"], 1), COLUMN))
    return np.array(columns, COLUMN)


def walls_of(ends: Array, *, side: int = 0, covariance: ArrayLike = 0.0) -> Records:
    """Make records of walls from both ends of each, shape (n, 2, 2)."""
    walls = np.zeros(len(ends), WALL)
    walls["start"], walls["end"], walls["centroid"] = ends[:, 0], ends[:, 1], ends.mean(axis=1)
    walls["angle"] = np.arctan2(*(ends[:, 1] - ends[:, 0]).T[::-1])
    walls["covariance"], walls["side"], walls["views"] = covariance, side, 1
    return walls


def segments_of(walls: Records) -> Records:
    """Return walls as segments."""
    segments = shared(walls, SEGMENT)
    segments["length"], segments["n_points"] = lengths_of(walls), walls["views"]
    return segments


def as_walls(segments: Records) -> Records:
    """Return segments as walls that are seen from their left."""
    walls = shared(segments, WALL)
    walls["side"] = walls["views"] = 1
    walls["covariance"] += bent(segments["misfit"] ** 2, segments["length"])
    return walls[segments["length"] > _SHORT]


def cut(wall: np.void, first: Array, last: Array) -> Records:
    """Return parts of a wall, so far from its start [m]."""
    parts, (u,) = np.repeat(wall, len(first)), unit(wall["angle"][None])
    for name, along in (("start", first), ("end", last), ("centroid", (first + last) / 2)):
        parts[name] = wall["start"] + along[:, None] * u
    parts["covariance"] = _at(parts["covariance"], (parts["centroid"] - wall["centroid"]) @ u)
    return parts


def shared(records: Records, dtype: np.dtype[np.void]) -> Records:
    """Return records of another kind, of which the fields that both have are set."""
    found = np.zeros(len(records), dtype)
    for name in {*(dtype.names or ())} & {*(records.dtype.names or ())}:
        found[name] = records[name]
    return found


def lengths_of(walls: Records) -> Array:
    """Lengths of walls (n,) [m]."""
    return np.asarray(np.linalg.norm(walls["end"] - walls["start"], axis=1))


def unit(angles: Array) -> Array:
    """Return unit vectors (..., 2) of these directions."""
    return np.stack((np.cos(angles), np.sin(angles)), axis=-1)


def summed(values: Array, at: Numbers, count: int) -> Array:
    """Return the sums (count, ...) of the values (m, ...) of each number."""
    total = np.zeros((count, *values.shape[1:]))
    np.add.at(total, at, values)
    return total


def wrapped(angles: Array) -> Array:
    """Angles in [-π, π)."""
    return np.asarray(np.remainder(angles + math.pi, 2 * math.pi) - math.pi)


def _at(covariances: Array, along: Array) -> Array:
    """Covariances of lines at places so far along them [m]."""
    lever = np.tile(np.eye(2), (len(along), 1, 1))
    lever[:, 0, 1] = along
    return np.asarray(lever @ covariances @ lever.transpose(0, 2, 1))


def bent(variance: Array | float, length: Array) -> Array:
    """Covariances of parts of walls that bow: each lies beside the whole, and is turned."""
    spread = np.zeros((len(length), 2, 2))
    spread[:, 0, 0] = variance
    spread[:, 1, 1] = 4 * variance / np.maximum(length, 0.1) ** 2
    return spread
