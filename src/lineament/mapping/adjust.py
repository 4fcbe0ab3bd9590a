"""Poses, motions between them, and the walls seen from them: one sparse least squares."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import needed_by
from ..progress import Track, untracked
from ..scan import Array, Pose
from ..walls import Numbers, Records, summed, wrapped
from ..walls.sights import (
    GATE_3,
    SIGHT,
    WHOLE,
    bowed,
    count_of,
    errors,
    lines_of,
    move,
    robust,
    sights_of,
    walls_along,
)

#: A motion between two poses: their indices, the second in the frame of the first [m, m, rad], its
#: inverse covariance, and whether it may be wrong: a loop.
EDGE = np.dtype(
    [("ends", "i8", 2), ("motion", "f8", 3), ("information", "f8", (3, 3)), ("loop", "?")]
)

#: Loops that are off by more than so many deviations count less; at first, by so many times more,
#: which takes so many more rounds.
_KERNEL, _WIDE, _WIDER = 3.0, 256.0, 4
_ROUNDS, _SMALL = 4, 1e-4
#: Information of the pose that is held: 3 µm and 3 µrad are far below the deviations of walls.
_HELD = 1e11
#: Walls whose covariances are found at a time; of larger matrices no inverse is made.
_BATCH, _DENSE = 200, 6000


def edges_of(ends: Any, motions: Any, covariances: Any, loop: bool = False) -> Records:
    """Make records of `EDGE`."""
    edges = np.zeros(len(ends), EDGE)
    if len(ends):
        edges["ends"], edges["motion"], edges["loop"] = ends, motions, loop
        edges["information"] = np.linalg.inv(covariances)
    return edges


def errors_of_motions(edges: Records, poses: Array) -> tuple[Array, Array, Array]:
    """How far poses are off, in the first frame (m, 3), and its derivatives by both poses."""
    a, b = poses[edges["ends"][:, 0]], poses[edges["ends"][:, 1]]
    c, s = np.cos(a[:, 2]), np.sin(a[:, 2])
    dx, dy, turn = (b - a).T
    off = np.column_stack((c * dx + s * dy, -s * dx + c * dy, turn)) - edges["motion"]
    off[:, 2] = wrapped(off[:, 2])
    of_b = np.zeros((len(a), 3, 3))
    of_b[:, 0, 0], of_b[:, 0, 1], of_b[:, 1, 0], of_b[:, 1, 1], of_b[:, 2, 2] = c, s, -s, c, 1.0
    of_a = -of_b
    of_a[:, 0, 2], of_a[:, 1, 2] = -s * dx + c * dy, -c * dx - s * dy
    return off, of_a, of_b


@dataclass(slots=True, eq=False)
class Adjusted:
    """Poses (n, 3), lines of walls as if the poses were known, and which edges are right.

    `gain` holds how the walls follow the poses; `matrix` is that of the equations of the poses.
    """

    poses: Array
    lines: Records
    right: NDArray[np.bool_]
    gain: Any
    matrix: Any

    def solver(self) -> Callable[[Array], Array]:
        """Return what multiplies columns (3n, k) by the covariance of the poses."""
        return _solver(self.matrix)

    def with_poses(self, sights: Records, track: Track = untracked) -> Records:
        """Return the lines with covariances that hold those of the poses.

        Walls whose sights contradict each other are less sure, by their χ² (Birge).
        """
        lines, is_small = self.lines.copy(), self.matrix.shape[0] <= _DENSE
        off, w = errors(sights, self.poses, lines)[0], sights["wall"]
        sure = robust(off, np.linalg.inv(sights["covariance"]))
        squares = np.bincount(w, np.einsum("ni,nij,nj->n", off, sure, off), len(lines))
        freedom = 2.0 * np.maximum(np.bincount(w, minlength=len(lines)) - 1, 1)
        lines["covariance"] *= np.maximum(squares / freedom, 1.0)[:, None, None]
        # One inverse is quicker than a solution for each wall.
        solve = _inverse_of(self.matrix) if is_small else _solver(self.matrix)
        batches = range(0, len(lines), _BATCH)
        for first in track(batches, "covariances of walls", batches):
            gain = self.gain[:, 2 * first : 2 * (first + _BATCH)]
            columns = gain.toarray()
            by_wall = columns.reshape(len(columns), -1, 2)
            solved = solve(gain if is_small else columns).reshape(by_wall.shape)
            spread = np.einsum("iwa,iwb->wab", by_wall, solved)
            lines["covariance"][first : first + _BATCH] += spread
        return lines


def optimise(
    poses: Array,
    edges: Records,
    sights: Records | None = None,
    *,
    held: int | Numbers = 0,
    rounds: int = _ROUNDS,
    dense: bool = False,
) -> Adjusted:
    """Adjust poses (n, 3) and the lines of walls by Gauss-Newton; some poses are held.

    Sights beyond 3 deviations count less. Loops have a weight of k⁴ / (k² + e²)², with e² their
    square (Geman and McClure), which is 1 where they are right and 0 where they are wrong; k comes
    down to 3 from round to round, so that at first none is left out. A loop is right if its square
    is within the quantile of 99 % of χ². Walls are eliminated (Schur), so that the equations are of
    the poses alone. Without rounds, the poses stay: what is returned is how they are known.
    """
    sights = np.zeros(0, SIGHT) if sights is None else sights
    state, n, count = poses.copy(), len(poses), count_of(sights)
    lines, (a, b) = lines_of(sights, poses, count), edges["ends"].T
    information = np.linalg.inv(sights["covariance"])
    w, frames, every, here = sights["wall"], sights["frame"], np.arange(count), np.atleast_1d(held)
    kernel = _KERNEL * (_WIDE if edges["loop"].any() else 1.0)
    for _ in range(max(rounds, 1) + _WIDER * (kernel > _KERNEL)):
        off, of_pose, of_wall = errors(sights, state, lines)
        weighted = robust(off, information)
        by_pose = of_pose.transpose(0, 2, 1) @ weighted
        by_wall = of_wall.transpose(0, 2, 1) @ weighted
        apart, of_a, of_b = errors_of_motions(edges, state)
        squares = np.einsum("ni,nij,nj->n", apart, edges["information"], apart)
        weights = np.where(edges["loop"], kernel**4 / (kernel**2 + squares) ** 2, 1.0)
        sure = edges["information"] * weights[:, None, None]
        by_a, by_b = of_a.transpose(0, 2, 1) @ sure, of_b.transpose(0, 2, 1) @ sure
        gradient = summed((by_pose @ off[:, :, None])[:, :, 0], frames, n)
        gradient += summed((by_a @ apart[:, :, None])[:, :, 0], a, n)
        gradient += summed((by_b @ apart[:, :, None])[:, :, 0], b, n)
        towards = summed((by_wall @ off[:, :, None])[:, :, 0], w, count)
        own = _inverse(summed(by_wall @ of_wall, w, count) + 1e-6 * np.eye(2))
        blocks = [(by_a @ of_b, a, b), (by_b @ of_a, b, a), (by_a @ of_a, a, a)]
        blocks += [(by_b @ of_b, b, b), (by_pose @ of_pose, frames, frames)]
        blocks.append((np.tile(_HELD * np.eye(3), (len(here), 1, 1)), here, here))
        both = _matrix([(by_pose @ of_wall, frames, w)], n, count, dense)
        gain = both @ _matrix([(own, every, every)], count, count, dense)
        matrix = _matrix(blocks, n, n, dense) - gain @ both.T
        if not rounds:
            break
        step = _solver(matrix)(gain @ towards.ravel() - gradient.ravel())
        turn = (own @ (-towards - (both.T @ step).reshape(-1, 2))[:, :, None])[:, :, 0]
        state = state + step.reshape(-1, 3)
        state[:, 2] = wrapped(state[:, 2])
        lines["covariance"] = own
        move(lines, turn)
        if kernel <= _KERNEL and max(abs(step).max(), abs(turn).max(initial=0)) < _SMALL:
            break
        kernel = max(kernel / 4, _KERNEL)
    return Adjusted(state, lines, ~edges["loop"] | (squares < GATE_3), gain, matrix)


def adjust(
    poses: Sequence[Pose],
    motions: Sequence[tuple[Pose, Array]],
    seen: Sequence[tuple[Records, Numbers]],
    rough: float = 0.0,
) -> tuple[list[Pose], Array, Records, Array]:
    """Adjust the poses of a few scans, the last of which stays, and the walls that they saw.

    There is a motion with its covariance from each scan to the next, and segments of each scan with
    the number of the wall of each; their surfaces are `rough` [m]. Returns the poses, their
    covariances (n, 3, 3), the walls, and the covariance (2m, 2m) of (offset, angle) of all walls.
    """
    n, sights = len(poses), sights_of(seen, rough)
    names, sights["wall"] = np.unique(sights["wall"], return_inverse=True)
    m, pairs = len(names), [(k, k + 1) for k in range(n - 1)]
    chain = edges_of(pairs, [motion for motion, _ in motions], [spread for _, spread in motions])
    found = optimise(np.array(poses), chain, sights, held=n - 1, rounds=3, dense=True)
    inverse, every = _inverse(found.matrix), np.arange(m)
    walls = bowed(walls_along(sights, found.poses, found.lines, WHOLE), sights)
    covariance = (found.gain.T @ inverse @ found.gain).reshape(m, 2, m, 2)
    covariance[every, :, every] += walls["covariance"]
    walls["covariance"] = covariance[every, :, every]
    spreads = inverse.reshape(n, 3, n, 3)[np.arange(n), :, np.arange(n)]
    return found.poses.tolist(), spreads, walls, covariance.reshape(2 * m, 2 * m)


def _matrix(blocks: list[tuple[Array, Any, Any]], n: int, m: int, dense: bool) -> Any:
    """Matrix of blocks (k, a, b) at their places, those at the same place added up."""
    _, a, b = blocks[0][0].shape
    if dense:
        full = np.zeros((n, m, a, b))
        for values, rows, columns in blocks:
            np.add.at(full, (rows, columns), values)
        return full.transpose(0, 2, 1, 3).reshape(a * n, b * m)
    with needed_by("mapping"):
        from scipy.sparse import coo_array

    entries = []
    for values, rows, columns in blocks:
        i = a * rows[:, None, None] + np.arange(a)[:, None]
        j = b * columns[:, None, None] + np.arange(b)
        entries.append([x.ravel() for x in np.broadcast_arrays(values, i, j)])
    values, i, j = map(np.concatenate, zip(*entries, strict=True))
    return coo_array((values, (i, j)), shape=(a * n, b * m)).tocsc()


def _inverse(matrices: Array) -> Array:
    return np.asarray(np.linalg.inv(matrices), np.float64)


def _inverse_of(matrix: Any) -> Callable[[Array], Array]:
    """Return what multiplies by the inverse of a positive definite matrix, by Cholesky."""
    from scipy.linalg.lapack import dpotrf, dpotri

    lower = dpotri(dpotrf(matrix.toarray(), lower=1)[0], lower=1)[0]
    inverse = lower + lower.T
    np.fill_diagonal(inverse, lower.diagonal())
    # It is its own transpose, of whose rows none is copied.
    return lambda right: (right.T @ inverse).T


def _solver(matrix: Any) -> Callable[[Array], Array]:
    """Return what solves equations with a symmetric, positive definite matrix."""
    if isinstance(matrix, np.ndarray):
        inverse = _inverse(matrix)
        return lambda right: inverse @ right
    from scipy.sparse.linalg import splu

    options = {"SymmetricMode": True}
    solve: Callable[[Array], Array] = splu(
        matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options
    ).solve
    return solve
