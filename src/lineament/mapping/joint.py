"""Poses and walls adjusted together, so that the covariance of a wall holds that of the poses."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scan import Array
from .graph import Edges, factorised, normal_equations, wrapped

#: Sights that are off by more than so many deviations count less.
_KERNEL = 3.0
_ROUNDS, _SMALL = 6, 1e-4
#: Walls that were seen so often show how rough surfaces are, up to this [m]; median of χ².
_OFTEN, _ROUGHEST, _MEDIAN = 8, 0.05, 0.4549
#: Walls whose covariances are found at a time.
_BATCH, _DENSE = 200, 6000


@dataclass(slots=True, eq=False)
class Sights:
    """Walls as key frames see them, each in the frame of its sensor.

    Attributes
    ----------
    frames, walls : ndarray of int64, shape (m,)
        Which key frame sees which wall.
    centroids, angles : ndarray, shapes (m, 2) and (m,)
        Of the segment [m, rad].
    covariances : ndarray, shape (m, 2, 2)
        Of its offset along the left normal at the centroid, and of its angle.
    ends : ndarray, shape (m, 2)
        From the centroid back to its start and on to its end, along its direction [m].
    """

    frames: NDArray[np.int64]
    walls: NDArray[np.int64]
    centroids: Array
    angles: Array
    covariances: Array
    ends: Array
    #: How far surfaces are from straight, which is in the covariances [m].
    rough: float = 0.0

    def placed(self, poses: Array) -> tuple[Array, Array]:
        """Centroids (m, 2) and angles (m,) in the frame of the poses."""
        at = poses[self.frames]
        c, s = np.cos(at[:, 2]), np.sin(at[:, 2])
        x, y = self.centroids.T
        moved = np.column_stack((at[:, 0] + c * x - s * y, at[:, 1] + s * x + c * y))
        return moved, at[:, 2] + self.angles


@dataclass(slots=True, eq=False)
class Lines:
    """Lines of walls.

    Attributes
    ----------
    points, angles : ndarray, shapes (w, 2) and (w,)
        A point of each, and its direction; what is seen of it is to its left [m, rad].
    covariances : ndarray, shape (w, 2, 2)
        Of the offset at the point along the left normal, and of the angle.
    """

    points: Array
    angles: Array
    covariances: Array


def lines_of(sights: Sights, poses: Array, count: int) -> Lines:
    """Return the means of the sights of each wall, by their information."""
    places, angles = sights.placed(poses)
    weight = 1.0 / sights.covariances[:, 0, 0]
    total = np.maximum(np.bincount(sights.walls, weight, count), 1e-12)
    points = np.column_stack(
        [np.bincount(sights.walls, weight * places[:, k], count) / total for k in range(2)]
    )
    sure = 1.0 / sights.covariances[:, 1, 1]
    sine = np.bincount(sights.walls, sure * np.sin(angles), count)
    cosine = np.bincount(sights.walls, sure * np.cos(angles), count)
    directions = np.arctan2(sine, cosine)
    # The mean of the centroids says more of the direction than any one sight of a long wall.
    return Lines(points, directions, np.zeros((count, 2, 2)))


def adjust(
    poses: Array, edges: Edges, sights: Sights, count: int, covariances: bool = False
) -> tuple[Array, Lines, Array]:
    """Adjust poses and walls together by Gauss-Newton; the first pose stays.

    Returns the poses, the walls, with covariances that hold those of the poses where they are
    asked for, and the weight of each sight. Walls are eliminated (Schur), so that the
    equations are of the poses alone.
    """
    state, lines = poses.copy(), lines_of(sights, poses, count)
    information = np.linalg.inv(sights.covariances)
    solved, gain, own = None, None, None
    for _ in range(_ROUNDS):
        off, of_pose, of_wall = _linear(sights, state, lines)
        squares = np.einsum("ni,nij,nj->n", off, information, off)
        weights = _KERNEL**2 / np.maximum(squares, _KERNEL**2)
        weighted = information * weights[:, np.newaxis, np.newaxis]
        matrix, gradient = normal_equations(state, edges, np.ones(len(edges.ends)))
        own = np.zeros((count, 2, 2))
        np.add.at(own, sights.walls, np.einsum("nji,njk,nkl->nil", of_wall, weighted, of_wall))
        own += np.diag((1e-6, 1e-6))
        own_inverse: Array = np.asarray(np.linalg.inv(own), np.float64)
        towards = np.zeros((count, 2))
        np.add.at(towards, sights.walls, np.einsum("nji,njk,nk->ni", of_wall, weighted, off))
        by_pose = np.zeros((len(state), 3))
        np.add.at(by_pose, sights.frames, np.einsum("nji,njk,nk->ni", of_pose, weighted, off))
        both = _blocks(np.einsum("nji,njk,nkl->nil", of_pose, weighted, of_wall),
                       sights.frames, sights.walls, len(state), count)  # fmt: skip
        poses_alone = _blocks(np.einsum("nji,njk,nkl->nil", of_pose, weighted, of_pose),
                              sights.frames, sights.frames, len(state), len(state))  # fmt: skip
        numbers = np.arange(count)
        gain = both @ _blocks(own_inverse, numbers, numbers, count, count)
        solved = factorised(matrix + poses_alone - gain @ both.T)
        right = -(gradient + by_pose.ravel()) + gain @ towards.ravel()
        step = solved.solve(right)
        turn = np.einsum("nij,nj->ni", own_inverse, -towards - (both.T @ step).reshape(-1, 2))
        state = state + step.reshape(-1, 3)
        state[:, 2] = wrapped(state[:, 2])
        normals = np.column_stack((-np.sin(lines.angles), np.cos(lines.angles)))
        lines = Lines(
            lines.points + turn[:, :1] * normals, wrapped(lines.angles + turn[:, 1]), own_inverse
        )
        if max(np.abs(step).max(), np.abs(turn).max()) < _SMALL:
            break
    if covariances and solved is not None and gain is not None:
        lines.covariances = _covariances(lines.covariances, gain, solved)
    return state, lines, weights


def roughened(sights: Sights, rough: float) -> Sights:
    """Return the sights of surfaces that are so far from straight [m]."""
    added = rough**2 - sights.rough**2
    covariances = sights.covariances.copy()
    covariances[:, 0, 0] += added
    covariances[:, 1, 1] += 4 * added / np.maximum(np.ptp(sights.ends, axis=1), 0.1) ** 2
    return replace(sights, covariances=covariances, rough=rough)


def roughness(sights: Sights, lines: Lines, poses: Array) -> float:
    """Return how far surfaces are from straight [m], by how far sights are off their walls.

    With it, the median of the squared offsets over their variances is that of χ², of the sights of
    walls that were seen often: of these, the wall itself takes little off.
    """
    off, _, _ = _linear(sights, poses, lines)
    often = np.bincount(sights.walls)[sights.walls] >= _OFTEN
    # Poses and walls take their part of the errors.
    free = 3 * len(poses) + 2 * len(lines.points)
    left = max(1.0 - free / (2 * len(off)), 0.2) if len(off) else 1.0
    squares = off[often, 0] ** 2 / left
    variances = sights.covariances[often, 0, 0] - sights.rough**2
    if not len(squares):
        return sights.rough
    low, high = 0.0, _ROUGHEST
    for _ in range(30):
        middle = (low + high) / 2
        if np.median(squares / (variances + middle**2)) > _MEDIAN:
            low = middle
        else:
            high = middle
    return high


def _linear(sights: Sights, poses: Array, lines: Lines) -> tuple[Array, Array, Array]:
    """Offset and angle of each sight from its wall, and their derivatives by pose and wall."""
    places, angles = sights.placed(poses)
    w = sights.walls
    a, points = lines.angles[w], lines.points[w]
    ux, uy = np.cos(a), np.sin(a)
    arm = places - points
    off = np.column_stack((-uy * arm[:, 0] + ux * arm[:, 1], wrapped(angles - a)))
    lever = places - poses[sights.frames, :2]
    of_pose = np.zeros((len(w), 2, 3))
    of_pose[:, 0, 0], of_pose[:, 0, 1] = -uy, ux
    of_pose[:, 0, 2] = uy * lever[:, 1] + ux * lever[:, 0]
    of_pose[:, 1, 2] = 1.0
    of_wall = np.zeros((len(w), 2, 2))
    of_wall[:, 0, 0], of_wall[:, 1, 1] = -1.0, -1.0
    of_wall[:, 0, 1] = -(ux * arm[:, 0] + uy * arm[:, 1])
    return off, of_pose, of_wall


def _blocks(values: Array, rows: Any, columns: Any, n: int, m: int) -> Any:
    """Sparse matrix of blocks (k, a, b), those at the same place added up."""
    from scipy.sparse import coo_array

    _, a, b = values.shape
    i = np.broadcast_to((a * rows[:, None] + np.arange(a))[:, :, None], values.shape)
    j = np.broadcast_to((b * columns[:, None] + np.arange(b))[:, None, :], values.shape)
    return coo_array((values.ravel(), (i.ravel(), j.ravel())), shape=(a * n, b * m)).tocsc()


def _covariances(own: Array, gain: Any, solved: Any) -> Array:
    """Add to the covariances of walls, were the poses known, those that the poses bring."""
    found, n = own.copy(), gain.shape[0]
    batch = n if n <= _DENSE else _BATCH
    for first in range(0, len(own), batch):
        columns = gain[:, 2 * first : 2 * (first + batch)]
        if n <= _DENSE:
            # One inverse is quicker than a solution for each wall.
            spread = columns.T @ solved.solve(np.eye(n))
        else:
            spread = solved.solve(columns.toarray()).T
        for k in range(columns.shape[1] // 2):
            pair = slice(2 * k, 2 * k + 2)
            found[first + k] += spread[pair] @ columns[:, pair].toarray()
    return found
