"""The pose of a local map on a plan by its walls, with its covariance."""

import math

import numpy as np
from numpy.typing import NDArray

from ..kernels.mapping.refining import refine as kernel
from ..motion.association import chi_square
from ..scan import Array, Pose
from ..walls import wrapped
from .index import Index
from .local_map import Query

#: First deviations of a pose that corners suggest, and of one that was refined [m, rad].
COARSE, FINE = (0.25, 0.07), (0.06, 0.02)
#: How far walls are from straight where they are compared [m].
ROUGH = 0.01
_ROUNDS = 6
#: Squared deviation beyond which a pair is left out.
GATE = chi_square(0.999, 2)
#: What is known of the pose before: 10 m and 10 rad.
WEAK = 1e-2 * np.eye(3)


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
    found[:, 2] = wrapped(found[:, 2])
    return found, pairs, information


def adjusted(
    pose: Array, pairs: NDArray[np.int64], query: Query, index: Index
) -> tuple[Array, Array]:
    """Return a pose and its information (3, 3) by pairs of walls, with all their covariances.

    Pairs that contradict the others, as furniture in front of a wall does, are left out by data
    snooping (Baarda 1968): one by one, that which is the farthest from where the others expect it.
    """
    error, jacobian, spread = _equations(pose, pairs, query, index)
    weights = np.linalg.inv(spread)
    by_pose = weights @ jacobian
    left = weights - by_pose @ np.linalg.inv(jacobian.T @ by_pose + WEAK) @ by_pose.T
    least = 1e-9 * np.diag(weights)
    while n := len(error) // 2:
        own = (left + np.diag(least)).reshape(n, 2, n, 2)[np.arange(n), :, np.arange(n)]
        off = (left @ error).reshape(n, 2)
        squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(own), off)
        worst = int(squares.argmax())
        if squares[worst] <= GATE:
            break
        rest, out = np.arange(2 * n) // 2 != worst, slice(2 * worst, 2 * worst + 2)
        left -= left[:, out] @ np.linalg.inv(own[worst]) @ left[out]
        weights -= weights[:, out] @ np.linalg.inv(weights[out, out]) @ weights[out]
        left, weights = left[rest][:, rest], weights[rest][:, rest]
        error, jacobian, least = error[rest], jacobian[rest], least[rest]
    by_pose = weights @ jacobian
    information = jacobian.T @ by_pose
    return pose - np.linalg.solve(information + WEAK, by_pose.T @ error), information


def combined(known: tuple[Pose, Array], other: tuple[Pose, Array]) -> tuple[Pose, Array]:
    """Combine two poses, each with its covariance, whose errors may be the same ones.

    Covariance intersection (Julier and Uhlmann 1997): of the weighted means that never claim too
    much, that of the least determinant.
    """
    of_known, of_other = np.linalg.inv(known[1]), np.linalg.inv(other[1])
    weights = np.linspace(0.0, 1.0, 21)[:, None, None]
    sums = (1 - weights) * of_known + weights * of_other
    best = int(np.linalg.det(sums).argmax())
    covariance = np.linalg.inv(sums[best])
    off = np.subtract(other[0], known[0])
    off[2] = math.remainder(off[2], 2 * math.pi)
    x, y, theta = (known[0] + weights[best, 0, 0] * covariance @ of_other @ off).tolist()
    return (x, y, math.remainder(theta, 2 * math.pi)), covariance


def _equations(
    pose: Array, pairs: NDArray[np.int64], query: Query, index: Index
) -> tuple[Array, Array, Array]:
    """Return how far the n local walls that have a pair are off it, by offset and angle (2n,).

    Then the derivatives by the pose (2n, 3), and the covariance (2n, 2n).
    """
    used = np.flatnonzero(pairs >= 0)
    n, walls, local = len(used), index.walls[pairs[used]], query.walls[used]
    v, angle = walls[:, 2:4], pose[2] + local["angle"]
    normal = np.column_stack((-v[:, 1], v[:, 0]))
    u = np.column_stack((np.cos(angle), np.sin(angle)))
    c, s = np.cos(pose[2]), np.sin(pose[2])
    arm = local["centroid"] @ np.array([[c, s], [-s, c]])
    off = arm + pose[:2] - walls[:, :2]
    # Signs are those of the plan's walls: the local ones may lead the other way.
    same = np.where((u * v).sum(axis=1) >= 0, 1.0, -1.0)
    turn = np.arctan2(same * (u * normal).sum(axis=1), same * (u * v).sum(axis=1))
    slopes = np.zeros((n, 2, 3))
    slopes[:, 0, :2], slopes[:, 1, 2] = normal, 1.0
    slopes[:, 0, 2] = normal[:, 1] * arm[:, 0] - normal[:, 0] * arm[:, 1]
    # All pairs with a wall of the plan have its error.
    lever = np.tile(np.eye(2), (n, 1, 1))
    lever[:, 0, 1] = (v * off).sum(axis=1) - 0.5 * walls[:, 4]
    shared = lever @ walls[:, (6, 7, 7, 8)].reshape(-1, 2, 2)
    whole = shared[:, None] @ lever.transpose(0, 2, 1)
    whole[pairs[used, None] != pairs[used]] = 0.0
    rows = (2 * used[:, None] + np.arange(2)).ravel()
    sign = np.column_stack((same, np.ones(n))).ravel()
    spread = query.covariance[np.ix_(rows, rows)] * np.outer(sign, sign) + 1e-14 * np.eye(2 * n)
    spread += whole.transpose(0, 2, 1, 3).reshape(2 * n, 2 * n)
    error = np.column_stack(((normal * off).sum(axis=1), turn)).ravel()
    return error, slopes.reshape(-1, 3), spread
