"""Beams of one turn of a scanner, in whatever order and unit a file lists them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["one_turn"]

#: Bearings [rad] that go farther than a turn, and some rounding, are degrees.
_RADIANS = 2 * math.pi + 0.1


def one_turn(
    angles: NDArray[np.float64], *, degrees: bool | None = None
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Order beams by bearing; of several with one bearing, keep the first.

    Parameters
    ----------
    angles : ndarray, shape (n,)
        Bearings.
    degrees : bool, optional
        Whether they are degrees; if None, they are where one is beyond ±2π.

    Returns
    -------
    order : ndarray, shape (m,)
        Indices of the beams, by bearing.
    angles : ndarray, shape (m,)
        Their bearings [rad], increasing.

    Raises
    ------
    ValueError
        If a bearing is not finite.

    Examples
    --------
    >>> order, angles = one_turn(np.array([90.0, 0.0, 90.0]))
    >>> order.tolist(), angles.round(3).tolist()
    ([1, 0], [0.0, 1.571])
    """
    bad = np.flatnonzero(~np.isfinite(angles))
    if len(bad):
        raise ValueError(f"bearing {bad[0] + 1} is {angles[bad[0]]}, expected a finite one")
    if degrees or (degrees is None and np.abs(angles).max(initial=0.0) > _RADIANS):
        angles = np.radians(angles)
    increasing, order = np.unique(angles, return_index=True)
    return order, increasing
