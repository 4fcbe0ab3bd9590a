"""Poses of key frames by the motions between them, some of which may be wrong."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import needed_by
from ..scan import Array

#: A loop that is off by more than so many of its deviations counts less and less.
_KERNEL = 3.0
_ROUNDS, _SMALL = 60, 1e-6


@dataclass(slots=True, eq=False)
class Edges:
    """Motions between poses.

    Attributes
    ----------
    ends : ndarray of int64, shape (m, 2)
        Indices of both poses.
    motions : ndarray, shape (m, 3)
        The second pose in the frame of the first [m, m, rad].
    information : ndarray, shape (m, 3, 3)
        Inverse covariances.
    robust : ndarray of bool, shape (m,)
        Whether a motion may be wrong: a loop.
    """

    ends: NDArray[np.int64]
    motions: Array
    information: Array
    robust: NDArray[np.bool_]

    def together(self, other: "Edges") -> "Edges":
        """Return these edges, then others."""
        return Edges(
            np.concatenate((self.ends, other.ends)),
            np.concatenate((self.motions, other.motions)),
            np.concatenate((self.information, other.information)),
            np.concatenate((self.robust, other.robust)),
        )

    def errors(self, poses: Array) -> Array:
        """How far the poses are off each motion, in its first frame, shape (m, 3)."""
        a, b = poses[self.ends[:, 0]], poses[self.ends[:, 1]]
        c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
        dx, dy = b[:, 0] - a[:, 0], b[:, 1] - a[:, 1]
        off = np.column_stack((c * dx + s * dy, -s * dx + c * dy, b[:, 2] - a[:, 2])) - self.motions
        off[:, 2] = wrapped(off[:, 2])
        return off

    def squares(self, poses: Array) -> Array:
        """Squares of the errors in deviations, shape (m,)."""
        off = self.errors(poses)
        return np.asarray(np.einsum("ni,nij,nj->n", off, self.information, off))

    def jacobians(self, poses: Array) -> tuple[Array, Array]:
        """Return the derivatives of the errors by both poses, shape (m, 3, 3) each."""
        a, b = poses[self.ends[:, 0]], poses[self.ends[:, 1]]
        c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
        dx, dy = b[:, 0] - a[:, 0], b[:, 1] - a[:, 1]
        of_b = np.zeros((len(a), 3, 3))
        of_b[:, 0, 0], of_b[:, 0, 1], of_b[:, 1, 0], of_b[:, 1, 1] = c, s, -s, c
        of_b[:, 2, 2] = 1.0
        of_a = -of_b
        of_a[:, 0, 2], of_a[:, 1, 2] = -s * dx + c * dy, -c * dx - s * dy
        return of_a, of_b


def optimise(poses: Array, edges: Edges) -> tuple[Array, Array]:
    """Return the poses (n, 3) with the least squared errors, and the weight of each edge.

    Levenberg-Marquardt; the first pose stays. Edges that may be wrong have a weight of
    k² / (k² + e²)² · k², with e² their square and k of 3 deviations (Geman and McClure), which is
    1 where they are right and 0 where they are wrong; k comes down from round to round, so that at
    first none is left out.
    """
    state, damping = poses.copy(), 1e-6
    kernel = 100.0 * _KERNEL
    for _ in range(_ROUNDS):
        squares = edges.squares(state)
        weights = np.where(edges.robust, kernel**4 / (kernel**2 + squares) ** 2, 1.0)
        cost = _cost(squares, edges.robust, kernel)
        matrix, gradient = normal_equations(state, edges, weights)
        while True:
            diagonal = matrix.diagonal()
            damped = matrix.copy()
            damped.setdiag(diagonal * (1 + damping) + 1e-9)
            step = factorised(damped).solve(-gradient).reshape(-1, 3)
            moved = state + step
            moved[:, 2] = wrapped(moved[:, 2])
            if _cost(edges.squares(moved), edges.robust, kernel) <= cost * (1 + 1e-9):
                damping = max(damping / 10, 1e-9)
                break
            damping *= 10
            if damping > 1e6:
                moved = state
                break
        state = moved
        if kernel <= _KERNEL and np.abs(step).max() < _SMALL:
            break
        kernel = max(kernel / 2, _KERNEL)
    return state, weights


def factorised(matrix: Any) -> Any:
    """Factorise a sparse, symmetric, positive definite matrix: `solve` is its method."""
    with needed_by("map", "mapping"):
        from scipy.sparse.linalg import splu

    return splu(
        matrix.tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )


def _cost(squares: Array, robust: NDArray[np.bool_], kernel: float) -> float:
    k = kernel**2
    return float(np.where(robust, k * squares / (k + squares), squares).sum())


def normal_equations(poses: Array, edges: Edges, weights: Array) -> tuple[Any, Array]:
    """Sparse matrix (3n, 3n) and gradient (3n,) of the squared errors; the first pose is held."""
    from scipy.sparse import coo_array

    off, (of_a, of_b) = edges.errors(poses), edges.jacobians(poses)
    weighted = edges.information * weights[:, np.newaxis, np.newaxis]
    n = len(poses)
    gradient = np.zeros((n, 3))
    rows, columns, values = [], [], []
    sides = ((edges.ends[:, 0], of_a), (edges.ends[:, 1], of_b))
    three = np.arange(3)
    for i, one in sides:
        np.add.at(gradient, i, np.einsum("nji,njk,nk->ni", one, weighted, off))
        for k, other in sides:
            block = np.einsum("nji,njk,nkl->nil", one, weighted, other)
            rows.append(np.broadcast_to((3 * i[:, None] + three)[:, :, None], block.shape).ravel())
            columns.append(np.broadcast_to((3 * k[:, None] + three)[:, None], block.shape).ravel())
            values.append(block.ravel())
    rows.append(three)
    columns.append(three)
    values.append(np.full(3, 1e9))
    at = np.concatenate(rows), np.concatenate(columns)
    matrix = coo_array((np.concatenate(values), at), shape=(3 * n, 3 * n)).tocsc()
    return matrix, gradient.ravel()


def wrapped(angles: Array) -> Array:
    """Angles in [-π, π)."""
    return np.asarray(np.remainder(angles + math.pi, 2 * math.pi) - math.pi)
