"""Distances, and which found feature is which true one: one to one, by assignment."""

import numpy as np
from numpy.typing import NDArray

from lineament.scan import Array

Indices = NDArray[np.intp]


def match(cost: Array, allowed: NDArray[np.bool_]) -> tuple[Indices, Indices]:
    """Pair rows with columns one to one: as many pairs as possible, then at the least cost.

    Both arguments have the shape (F, T); the pairs come by increasing row. Raises ValueError if
    the shapes differ, or an allowed pair has no finite cost.

    Examples
    --------
    The cheapest pair, 1 with 0, is given up for two pairs:

    >>> cost = np.array([[2.0, 9.0], [1.0, 3.0]])
    >>> rows, columns = match(cost, np.array([[True, False], [True, True]]))
    >>> rows.tolist(), columns.tolist()
    ([0, 1], [0, 1])
    """
    if cost.ndim != 2 or cost.shape != allowed.shape:
        raise ValueError(f"cost has shape {cost.shape}, expected that of allowed, {allowed.shape}")
    rows, columns = np.flatnonzero(allowed.any(axis=1)), np.flatnonzero(allowed.any(axis=0))
    if not len(rows):
        return rows, columns
    within = allowed[np.ix_(rows, columns)]
    excess = cost[np.ix_(rows, columns)]
    excess = excess - excess[within].min()
    most = excess[within].max()
    if not np.isfinite(most):
        raise ValueError(f"cost of an allowed pair is {most} above the least, expected finite")
    from scipy.optimize import linear_sum_assignment

    # All pairs that there can be cost less than a single one that is not allowed.
    barred = min(within.shape) * most + 1.0
    r, c = linear_sum_assignment(np.where(within, excess, barred))
    kept = within[r, c]
    return rows[r[kept]], columns[c[kept]]


def distances(points: Array, others: Array) -> Array:
    """Distance of each point from each of the others, shapes (F, 2) and (T, 2) to (F, T)."""
    difference = points[:, np.newaxis] - others
    return np.asarray(np.hypot(difference[..., 0], difference[..., 1]))


def match_points(
    points: Array, others: Array, gate: float | Array
) -> tuple[Indices, Indices, Array]:
    """Match points by distance, within a gate; the rows, the columns, and the distances (P,)."""
    apart = distances(points, others)
    rows, columns = match(apart, apart <= gate)
    return rows, columns, apart[rows, columns]


def distances_from_segments(points: Array, segments: NDArray[np.void]) -> Array:
    """Distance of points (…, 2) from segments, between their ends [m]; shapes are broadcast."""
    start, arm = segments["start"], segments["end"] - segments["start"]
    square = np.maximum((arm**2).sum(axis=-1), np.finfo(float).tiny)
    along = np.clip(((points - start) * arm).sum(axis=-1) / square, 0.0, 1.0)
    away = points - start - along[..., np.newaxis] * arm
    return np.asarray(np.hypot(away[..., 0], away[..., 1]))
