"""The pose of a local map on a plan by its walls, with its covariance."""

import math

import numpy as np
from numpy.typing import NDArray

from ..kernels.mapping.refining import refine as kernel
from ..motion.association import chi_square
from ..scan import Array
from .line_map import Index
from .local_map import Query

#: First deviations of a pose that corners suggest, and of one that was refined [m, rad].
COARSE, FINE = (0.25, 0.07), (0.06, 0.02)
#: How far walls are from straight where they are compared [m].
ROUGH = 0.01
_ROUNDS = 6
#: Squared deviation beyond which a pair is left out.
GATE = chi_square(0.999, 2)


def refined(
    poses: Array, query: Query, index: Index, first: tuple[float, float] = COARSE
) -> tuple[Array, NDArray[np.int64], Array]:
    """Return poses (n, 3) at the walls, the walls of the plan of each local one, and information.

    The numbers (n, w) of the walls are -1 where there is none.
    """
    found = np.ascontiguousarray(poses, np.float64).copy()
    pairs = np.full((len(found), len(query.walls)), -1, np.int64)
    information = np.zeros((len(found), 3, 3))
    settings = (*first, ROUGH, GATE, float(_ROUNDS))
    kernel(found, query.table, *index, settings, pairs, information)
    found[:, 2] = np.remainder(found[:, 2] + math.pi, 2 * math.pi) - math.pi
    return found, pairs, information


def adjusted(
    pose: Array, pairs: NDArray[np.int64], query: Query, index: Index
) -> tuple[Array, Array]:
    """Return a pose and its information (3, 3) by pairs of walls, with all their covariances.

    Pairs beyond the gate are left out: furniture in front of a wall is not the wall.
    """
    used = np.flatnonzero((pairs >= 0) & (pairs < len(index.walls)))
    information = np.zeros((3, 3))
    for step in range(3):
        if not len(used):
            break
        walls, local = index.walls[pairs[used]], query.walls[used]
        rows = np.ravel(2 * used[:, None] + np.arange(2))
        error, jacobian, same, a = _errors(pose, local, walls)
        # Signs are those of the plan's walls.
        sign = np.stack((same, np.ones(len(same))), axis=1).ravel()
        spread = query.covariance[np.ix_(rows, rows)] * np.outer(sign, sign)
        spread[np.diag_indices_from(spread)] += 1e-10
        _add_walls(spread, walls, pairs[used], a)
        weighted = np.linalg.solve(spread, jacobian)
        information = jacobian.T @ weighted
        held = information + np.diag((1e-2, 1e-2, 1e-2))
        change = np.linalg.solve(held, weighted.T @ error)
        pose = pose - change
        if step < 2:
            left = (error - jacobian @ change).reshape(-1, 2)
            k = np.arange(len(used))
            own = spread.reshape(len(used), 2, len(used), 2)[k, :, k]
            d2 = np.einsum("ni,nij,nj->n", left, np.linalg.inv(own), left)
            used = used[d2 <= max(GATE, np.sort(d2)[len(d2) // 2])]
    return pose, information


def _add_walls(spread: Array, walls: Array, numbers: NDArray[np.int64], a: Array) -> None:
    """Add the covariances of the plan's walls; the same wall has the same error."""
    lever = np.tile(np.eye(2), (len(walls), 1, 1))
    lever[:, 0, 1] = a
    for k in np.unique(numbers):
        at = np.flatnonzero(numbers == k)
        own = np.array([[walls[at[0], 6], walls[at[0], 7]], [walls[at[0], 7], walls[at[0], 8]]])
        whole = lever[at].reshape(-1, 2)
        rows = (2 * at[:, None] + np.arange(2)).ravel()
        spread[np.ix_(rows, rows)] += whole @ own @ whole.T


def _errors(
    pose: Array, local: NDArray[np.void], walls: Array
) -> tuple[Array, Array, Array, Array]:
    """Offsets and angles (2n,) of local walls from the plan's, with derivatives (2n, 3).

    Also whether both lead the same way (1, -1), and the places from the middle of the plan's.
    """
    x, y, theta = pose
    c, s = math.cos(theta), math.sin(theta)
    lever = local["centroid"] @ np.array([[c, s], [-s, c]])
    v, angle = walls[:, 2:4], theta + local["angle"]
    r = lever + np.array((x, y)) - walls[:, :2]
    cosine = v[:, 0] * np.cos(angle) + v[:, 1] * np.sin(angle)
    sine = v[:, 0] * np.sin(angle) - v[:, 1] * np.cos(angle)
    same = np.where(cosine >= 0, 1.0, -1.0)
    normal = np.stack((-v[:, 1], v[:, 0]), axis=1)
    error, jacobian = np.zeros((len(local), 2)), np.zeros((len(local), 2, 3))
    error[:, 0], error[:, 1] = (normal * r).sum(axis=1), np.arctan2(same * sine, same * cosine)
    jacobian[:, 0, :2] = normal
    jacobian[:, 0, 2] = normal[:, 1] * lever[:, 0] - normal[:, 0] * lever[:, 1]
    jacobian[:, 1, 2] = 1.0
    along = (v * r).sum(axis=1) - 0.5 * walls[:, 4]
    return error.ravel(), jacobian.reshape(-1, 3), same, along
