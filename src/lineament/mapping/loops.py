"""Loops: places that were seen before, found by `locate` alone, and walls that are one."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..motion.association import chi_square
from ..scan import Array, Pose
from ..scan.poses import relative
from .drive_map import KeyFrame
from .graph import Edges, wrapped
from .joint import Lines, Sights
from .line_map import LineMap
from .local_map import Query, beams_of, moved_beams, thinned
from .locate import locate
from .walls import GAP, WALL

#: What is looked for is of this way before a key frame; where, of this way around another [m].
_QUERY, _PLAN = 5.0, 5.0
#: Key frames are looked for after so much way; others are at least so much way before them [m].
_EVERY, _BEFORE = 1.0, 12.0
#: Stretches of the way that are looked at for each.
_STRETCHES = 3
#: Errors of a loop beside those that `locate` knows [m, rad].
_FLOOR = np.diag((0.02, 0.02, 0.005)) ** 2
#: Key frames whose beams a query has.
_SCANS = 6
#: Deviations of walls that are one, beside their covariances [m, rad].
_APART = np.diag((0.03, 0.01)) ** 2
#: Where no more than this share of the most sights goes on, a wall ends.
_SHARE = 0.2


def find_loops(
    frames: list[KeyFrame], poses: Array, sights: Sights, lines: Lines, spread: tuple[float, float]
) -> Edges:
    """Look for what was seen before, near where the poses say that it is.

    Parameters
    ----------
    frames : list of KeyFrame
    poses : ndarray, shape (n, 3)
        Of the key frames.
    sights, lines
        The walls, in the frame of the poses.
    spread : (float, float)
        Deviations of the poses from each other [m, rad].
    """
    way = _way(poses)
    covariance = np.diag((spread[0], spread[0], spread[1])) ** 2
    ends, motions, information = [], [], []
    plans: dict[int, LineMap | None] = {}
    reach = 2.0 + 2.0 * spread[0]
    for q in _due(way, _EVERY):
        places = _stretches(poses, way, q, reach)
        query = _query(frames, poses, way, q, sights, lines) if places else None
        if query is None:
            continue
        for j in places:
            if j not in plans:
                near = np.flatnonzero(np.abs(way - way[j]) <= _PLAN)
                walls = walls_at(poses[j], near, sights, lines, poses)
                plans[j] = LineMap(walls) if len(walls) > 3 else None
            plan = plans[j]
            if plan is None:
                continue
            guess = relative(_pose(poses[j]), _pose(poses[q]))
            found = locate(query, plan, guess, covariance)
            if found:
                ends.append((j, q))
                motions.append(found.pose)
                information.append(np.linalg.inv(found.covariance + _FLOOR))
    return Edges(
        np.array(ends, np.int64).reshape(-1, 2),
        np.array(motions).reshape(-1, 3),
        np.array(information).reshape(-1, 3, 3),
        np.ones(len(ends), dtype=bool),
    )


def queries(
    frames: list[KeyFrame], poses: Array, sights: Sights, lines: Lines, every: float
) -> Iterator[tuple[int, Query]]:
    """Return key frames so far apart [m], and what was seen on the last metres before each."""
    way = _way(poses)
    for q in [*_due(way, every)[1:], len(poses) - 1]:
        query = _query(frames, poses, way, q, sights, lines)
        if query is not None:
            yield q, query


def _way(poses: Array) -> Array:
    return np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))))


def _due(way: Array, every: float) -> list[int]:
    """Return the first key frame of each so many metres."""
    due: list[int] = np.flatnonzero(np.diff(np.floor(way / every), prepend=-1)).tolist()
    return due


def _stretches(poses: Array, way: Array, q: int, reach: float) -> list[int]:
    """Return the nearest key frame of each stretch of the way that passed near, the nearest first.

    Numbers are rounded, so that queries that follow each other look at the same plans.
    """
    away = np.hypot(*(poses[:, :2] - poses[q, :2]).T)
    near = np.flatnonzero((away < reach) & (way < way[q] - _BEFORE))
    if not len(near):
        return []
    runs = np.split(near, np.flatnonzero(np.diff(near) > 5) + 1)
    best = sorted((float(away[run].min()), int(run[away[run].argmin()])) for run in runs)
    return [4 * (j // 4) for _, j in best[:_STRETCHES]]


def _query(
    frames: list[KeyFrame], poses: Array, way: Array, q: int, sights: Sights, lines: Lines
) -> Query | None:
    """Return what was seen on the last metres before a key frame, in its frame."""
    last = np.flatnonzero((way <= way[q]) & (way >= way[q] - _QUERY))
    last = last[last <= q]
    walls = walls_at(poses[q], last, sights, lines, poses)
    if len(walls) < 4:
        return None
    beams, here = [], _pose(poses[q])
    for k in np.unique(np.linspace(0, len(last) - 1, _SCANS).astype(int)).tolist():
        frame = frames[last[k]]
        pose = relative(here, _pose(poses[last[k]]))
        beams.append(moved_beams(beams_of(frame.features, frame.scan), pose, np.zeros((3, 3))))
    n = len(walls)
    blocks = np.zeros((n, 2, n, 2))
    blocks[np.arange(n), :, np.arange(n)] = walls["covariance"]
    return Query(walls, blocks.reshape(2 * n, 2 * n), thinned(np.concatenate(beams[::-1])))


def walls_at(
    pose: Array, frames: NDArray[np.intp], sights: Sights, lines: Lines, poses: Array
) -> NDArray[np.void]:
    """Return the walls that some key frames see, in the frame of a pose."""
    chosen = np.isin(sights.frames, frames)
    return _records(pose, chosen, sights, lines, poses, GAP)


def _records(
    pose: Array,
    chosen: NDArray[np.bool_],
    sights: Sights,
    lines: Lines,
    poses: Array,
    gap: float,
    views: int = 1,
) -> NDArray[np.void]:
    """Walls along their lines, each as far as sights lie no farther apart than a gap.

    Where a number of views is asked for, a wall ends where hardly any of its sights go on: at a
    grazing angle, a few cross doorways.
    """
    w, (low, high) = sights.walls[chosen], _extents(sights, lines, poses, chosen)
    found = []
    for number in np.unique(w).tolist():
        own, their = low[w == number], high[w == number]
        for begin, end in _covered(own, their, gap, 0.0):
            of = (own <= end) & (their >= begin)
            parts = [(begin, end)] if views == 1 else _covered(own[of], their[of], gap, _SHARE)
            if of.sum() >= views:
                found += [(number, a, b, of.sum()) for a, b in parts if b - a > 0.1]
    walls = np.zeros(len(found), WALL)
    if not found:
        return walls
    table = np.array(found)
    line = table[:, 0].astype(int)
    x, y, theta = pose
    c, s = math.cos(theta), math.sin(theta)
    turn = np.array([[c, -s], [s, c]])
    u = np.column_stack((np.cos(lines.angles[line]), np.sin(lines.angles[line])))
    middle = (table[:, 1] + table[:, 2]) / 2
    for name, along in (("start", table[:, 1]), ("end", table[:, 2]), ("centroid", middle)):
        walls[name] = (lines.points[line] + along[:, np.newaxis] * u - (x, y)) @ turn
    walls["angle"] = wrapped(lines.angles[line] - theta)
    lever = np.tile(np.eye(2), (len(line), 1, 1))
    lever[:, 0, 1] = middle
    walls["covariance"] = lever @ lines.covariances[line] @ lever.transpose(0, 2, 1)
    walls["side"], walls["views"] = 1, table[:, 3]
    return walls


def _covered(low: Array, high: Array, gap: float, share: float) -> list[tuple[float, float]]:
    """Parts that more than a share of the most stretches cover; short gaps count as covered."""
    places = np.concatenate((low, high + gap))
    order = np.argsort(places, kind="stable")
    cover = np.cumsum(np.repeat((1, -1), len(low))[order])
    edges = np.flatnonzero(np.diff(cover > share * cover.max(), prepend=False))
    ends = places[order][edges].tolist()
    return [(begin, end - gap) for begin, end in zip(ends[::2], ends[1::2], strict=True)]


def _extents(
    sights: Sights, lines: Lines, poses: Array, chosen: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """From where to where along its wall each sight goes, from the wall's point on [m]."""
    places, angles = sights.placed(poses)
    w = sights.walls[chosen]
    u = np.column_stack((np.cos(lines.angles[w]), np.sin(lines.angles[w])))
    along = ((places[chosen] - lines.points[w]) * u).sum(axis=1)
    straight = np.cos(angles[chosen] - lines.angles[w])
    ends = along[:, np.newaxis] + sights.ends[chosen] * straight[:, np.newaxis]
    return ends.min(axis=1), ends.max(axis=1)


def whole_walls(sights: Sights, lines: Lines, poses: Array, views: int) -> NDArray[np.void]:
    """Return all walls that were seen so often, in the frame of the poses."""
    every = np.ones(len(sights.walls), dtype=bool)
    return _records(np.zeros(3), every, sights, lines, poses, GAP, views)


def merged(sights: Sights, lines: Lines, poses: Array) -> NDArray[np.int64]:
    """Return a number for each wall, the same for those that are one.

    They are one if they face the same way, lie along each other or no farther apart than a gap,
    and the χ² of their common line is within its 99 % quantile. The most often seen come first.
    """
    count = len(lines.points)
    every = np.ones(len(sights.walls), dtype=bool)
    low, high = _extents(sights, lines, poses, every)
    first, last = np.full(count, 1e9), np.full(count, -1e9)
    np.minimum.at(first, sights.walls, low)
    np.maximum.at(last, sights.walls, high)
    views = np.bincount(sights.walls, minlength=count)
    labels = np.arange(count)
    order = np.argsort(-views, kind="stable")
    order = order[views[order] > 0]
    u = np.column_stack((np.cos(lines.angles), np.sin(lines.angles)))
    starts, ends = lines.points + first[:, None] * u, lines.points + last[:, None] * u
    kept = np.zeros(count, dtype=bool)
    limit = chi_square(0.99, 2)
    for k in order.tolist():
        near = np.flatnonzero(kept & (np.abs(wrapped(lines.angles - lines.angles[k])) < 0.1))
        at = np.stack((starts[k] - lines.points[near], ends[k] - lines.points[near]))
        along = (at * u[near]).sum(axis=2)
        beside = (along.min(axis=0) < last[near] + GAP) & (along.max(axis=0) > first[near] - GAP)
        near, along = near[beside], along[:, beside]
        if len(near):
            # Where they are nearest to each other, or in the middle of what they share.
            shared = (np.maximum(along.min(axis=0), first[near]) +
                      np.minimum(along.max(axis=0), last[near])) / 2  # fmt: skip
            place = lines.points[near] + shared[:, None] * u[near]
            arm = place - lines.points[k]
            off = arm[:, 0] * u[k, 1] - arm[:, 1] * u[k, 0]
            error = np.column_stack((off, wrapped(lines.angles[k] - lines.angles[near])))
            spread = _at(lines.covariances[near], shared)
            spread += _at(lines.covariances[[k]], (arm * u[k]).sum(axis=1)) + _APART
            squares = np.einsum("ni,nij,nj->n", error, np.linalg.inv(spread), error)
            if squares.min() < limit:
                labels[k] = near[squares.argmin()]
                continue
        kept[k] = True
    return np.unique(labels, return_inverse=True)[1]


def _at(covariances: Array, along: Array) -> Array:
    """Covariances of lines at places so far along them [m]."""
    lever = np.tile(np.eye(2), (len(along), 1, 1))
    lever[:, 0, 1] = along
    result: Any = lever @ covariances @ lever.transpose(0, 2, 1)
    return np.asarray(result)


def _pose(row: Array) -> Pose:
    x, y, theta = row.tolist()
    return x, y, theta
