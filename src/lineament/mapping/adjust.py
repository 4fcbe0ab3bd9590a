"""Poses and walls of a local map, adjusted together: each measurement counts once."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..motion.association import chi_square
from ..motion.odometry import compose_jacobians
from ..scan import Array, Pose
from ..scan.poses import compose
from .walls import WALL

_ROUNDS = 3


def adjust(
    poses: Sequence[Pose],
    motions: Sequence[tuple[Pose, Array]],
    seen: Sequence[tuple[NDArray[np.void], NDArray[np.int64]]],
) -> tuple[list[Pose], Array, NDArray[np.void], Array]:
    """Adjust the poses of scans, and the walls that they saw, in the frame of the last scan.

    Parameters
    ----------
    poses : sequence of (x, y, theta)
        First poses, the last of which stays.
    motions : sequence of (pose, covariance)
        From each scan to the next.
    seen : sequence of (segments, numbers)
        Segments of each scan; those of the same number, from 0, are the same wall.

    Returns
    -------
    poses : list of (x, y, theta)
    covariances : ndarray, shape (n, 3, 3)
        Of the poses.
    walls : structured array of `WALL`
    covariance : ndarray, shape (2m, 2m)
        Of (offset, angle) of all walls.
    """
    segments = np.concatenate([of_scan for of_scan, _ in seen])
    scans = np.repeat(np.arange(len(seen)), [len(of_scan) for of_scan, _ in seen])
    _, first, number = np.unique(
        np.concatenate([numbers for _, numbers in seen])[::-1],
        return_index=True,
        return_inverse=True,
    )
    first, number = len(segments) - 1 - first, number[::-1]
    state = np.array(poses, np.float64)
    # Each wall begins as it was seen last.
    centers, angles = _placed(state[scans[first]], segments[first])
    weights = np.linalg.inv(segments["covariance"] + 1e-12 * np.eye(2))
    share = np.ones(len(segments))
    n_free = 3 * (len(poses) - 1)
    size = n_free + 2 * len(first)
    for step in range(_ROUNDS):
        error, jacobian, at = _errors(state, centers, angles, segments, scans, number, n_free)
        if step:
            d2 = np.einsum("ni,nij,nj->n", error, weights, error)
            share = np.minimum(1.0, chi_square(0.99, 2) / np.maximum(d2, 1e-12))
        weighted = share[:, None, None] * weights @ jacobian
        normal, right = np.zeros((size + 3, size + 3)), np.zeros(size + 3)
        # The last pose stays: what belongs to it goes to three lines that are left out.
        blocks = jacobian.transpose(0, 2, 1) @ weighted
        np.add.at(normal, (at[:, :, None], at[:, None, :]), blocks)
        np.add.at(right, at, (weighted.transpose(0, 2, 1) @ error[:, :, None])[:, :, 0])
        _add_motions(normal, right, state, motions, size)
        inverse = np.asarray(np.linalg.inv(normal[:size, :size]), np.float64)
        change = -inverse @ right[:size]
        state[:-1] += change[:n_free].reshape(-1, 3)
        shift, turn = change[n_free:].reshape(-1, 2).T
        centers += shift[:, None] * np.stack((-np.sin(angles), np.cos(angles)), axis=1)
        angles += turn
    spreads = np.zeros((len(poses), 3, 3))
    for k in range(len(poses) - 1):
        spreads[k] = inverse[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
    covariance = inverse[n_free:, n_free:].copy()
    walls = _walls(state, centers, angles, segments, scans, number)
    # A part of a wall that bows lies beside the whole, and is turned.
    misfit = np.bincount(number, segments["misfit"] ** 2) / walls["views"]
    lengths = np.linalg.norm(walls["end"] - walls["start"], axis=1)
    both = np.stack((misfit, 4 * misfit / lengths**2), axis=1).ravel()
    covariance[np.diag_indices_from(covariance)] += both
    for k in range(len(walls)):
        walls["covariance"][k] = covariance[2 * k : 2 * k + 2, 2 * k : 2 * k + 2]
    return [(x, y, theta) for x, y, theta in state.tolist()], spreads, walls, covariance


def _placed(poses: Array, segments: NDArray[np.void]) -> tuple[Array, Array]:
    """Centroids (n, 2) and angles (n,) of segments, each seen from its pose (n, 3)."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x, y = segments["centroid"].T
    places = poses[:, :2] + np.stack((c * x - s * y, s * x + c * y), axis=1)
    return places, segments["angle"] + poses[:, 2]


def _errors(
    state: Array,
    centers: Array,
    angles: Array,
    segments: NDArray[np.void],
    scans: NDArray[np.int64],
    number: NDArray[np.int64],
    n_free: int,
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Offsets and angles (n, 2) of segments from their walls, by pose and wall (n, 2, 5), where."""
    places, turned = _placed(state[scans], segments)
    angle = angles[number]
    u = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    normal = np.stack((-u[:, 1], u[:, 0]), axis=1)
    lever, between = places - state[scans, :2], places - centers[number]
    error = np.stack(
        (
            (normal * between).sum(axis=1),
            np.remainder(turned - angle + math.pi, 2 * math.pi) - math.pi,
        ),
        axis=1,
    )
    jacobian = np.zeros((len(segments), 2, 5))
    jacobian[:, 0, :2] = normal
    jacobian[:, 0, 2] = normal[:, 1] * lever[:, 0] - normal[:, 0] * lever[:, 1]
    jacobian[:, 0, 3], jacobian[:, 0, 4] = -1.0, -(u * between).sum(axis=1)
    jacobian[:, 1, 2], jacobian[:, 1, 4] = 1.0, -1.0
    at = np.empty((len(segments), 5), np.int64)
    is_last = scans == len(state) - 1
    size = n_free + 2 * len(centers)
    at[:, :3] = np.where(is_last, size, 3 * scans)[:, None] + np.arange(3)
    at[:, 3:] = n_free + 2 * number[:, None] + np.arange(2)
    return error, jacobian, at


def _add_motions(
    normal: Array,
    right: Array,
    state: Array,
    motions: Sequence[tuple[Pose, Array]],
    size: int,
) -> None:
    """Add the motions from each scan to the next."""
    for k, (motion, covariance) in enumerate(motions):
        x, y, theta = state[k].tolist()
        of_pose, of_motion = compose_jacobians((x, y, theta), motion)
        error = state[k + 1] - compose((x, y, theta), motion)
        error[2] = math.remainder(error[2], 2 * math.pi)
        weight = np.linalg.inv(of_motion @ covariance @ of_motion.T)
        jacobian = np.hstack((-of_pose, np.eye(3)))
        after = size if k == len(motions) - 1 else 3 * k + 3
        at = np.concatenate((3 * k + np.arange(3), after + np.arange(3)))
        normal[np.ix_(at, at)] += jacobian.T @ weight @ jacobian
        right[at] += jacobian.T @ weight @ error


def _walls(
    state: Array,
    centers: Array,
    angles: Array,
    segments: NDArray[np.void],
    scans: NDArray[np.int64],
    number: NDArray[np.int64],
) -> NDArray[np.void]:
    """Return the walls, from the first to the last place at which each was seen."""
    walls = np.zeros(len(centers), WALL)
    walls["centroid"], walls["angle"], walls["side"] = centers, angles, 1
    walls["views"] = np.bincount(number)
    u = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    c, s = np.cos(state[scans, 2]), np.sin(state[scans, 2])
    for name, first in (("start", np.inf), ("end", -np.inf)):
        x, y = segments[name].T
        places = state[scans, :2] + np.stack((c * x - s * y, s * x + c * y), axis=1)
        along = ((places - centers[number]) * u[number]).sum(axis=1)
        extreme = np.full(len(centers), first)
        (np.minimum if name == "start" else np.maximum).at(extreme, number, along)
        walls[name] = centers + extreme[:, None] * u
    return walls
