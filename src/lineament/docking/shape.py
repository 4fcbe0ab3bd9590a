"""`Shape`: the outline of a thing that a robot docks to, and its pose."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from ..drawings import read_drawing
from ..errors import LineamentError
from ..limits import LIMITS
from ..scan import Array, Pose

#: A shape is no smaller and no larger [m], and has no more straight pieces.
SMALLEST, LARGEST, MOST_PIECES = 0.1, 10.0, 200


class ShapePose(NamedTuple):
    """The pose of a shape in the frame of the scan.

    Attributes
    ----------
    pose : (x, y, theta)
        Of the frame in which the shape is given [m, m, rad].
    covariance : ndarray, shape (3, 3)
        Of the pose [m, m, rad].
    seen : float
        Share of the beams to the shape, as it stands, that have reached it.
    """

    pose: Pose
    covariance: Array
    seen: float


@dataclass(frozen=True, eq=False, repr=False)
class Shape:
    """An outline of straight pieces, in its own frame: x points away from whoever docks.

    The scanner stands at negative x, so that a row of feet is not taken for its other side.

    Parameters
    ----------
    polylines : sequence of array_like, shape (n, 2)
        Vertices of each line [m]. Two lines that end at one point meet there; where a line
        ends alone, the thing ends.

    Raises
    ------
    ValueError
        If it is smaller than 0.1 m or larger than 10 m, has more than 200 pieces, or is one
        straight line without ends that could be seen.

    Examples
    --------
    Three feet of a pallet, seen from the front:

    >>> Shape([[(0, y), (0, y + 0.1)] for y in (-0.6, -0.05, 0.5)])
    Shape(3 pieces, 0.00 m x 1.20 m, 6 ends)
    """

    ends: Array
    free: Array

    def __init__(self, polylines: Iterable[ArrayLike]) -> None:
        lines = [np.asarray(line, np.float64).reshape(-1, 2) for line in polylines]
        pieces = [pair for line in lines for pair in pairwise(line) if not np.equal(*pair).all()]
        ends = np.array(pieces, np.float64).reshape(-1, 2, 2)
        if not 0 < len(ends) <= MOST_PIECES or not np.isfinite(ends).all():
            raise ValueError(
                f"a shape has {len(ends)} pieces, expected 1 to {MOST_PIECES} with finite vertices"
            )
        size = float(np.ptp(ends.reshape(-1, 2), axis=0).max())
        if not SMALLEST <= size <= LARGEST:
            raise ValueError(f"a shape is {size:g} m large, expected {SMALLEST} to {LARGEST:g} m")
        object.__setattr__(self, "ends", ends)
        object.__setattr__(self, "free", _free(ends))

    def __repr__(self) -> str:
        x, y = np.ptp(self.ends.reshape(-1, 2), axis=0)
        free = int(self.free.sum())
        return f"Shape({len(self.ends)} pieces, {x:.2f} m x {y:.2f} m, {free} ends)"

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        layers: Sequence[str] | None = None,
        *,
        units: str | None = None,
    ) -> Self:
        """Read a shape that is drawn in a DXF, whose origin is that of its frame.

        LineamentError if it cannot be read, or is no shape. `layers` and `units` as of
        `LineMap.read`.
        """
        drawn = read_drawing(path, layers, units, LIMITS)
        try:
            return cls(drawn.lines)
        except ValueError as error:
            raise LineamentError(f"{path}: {error}") from None

    def placed(self, pose: Pose) -> Array:
        """Return the ends of its pieces where the shape has a pose, shape (n, 2, 2)."""
        x, y, theta = pose
        c, s = np.cos(theta), np.sin(theta)
        return np.asarray(self.ends @ np.array([[c, s], [-s, c]]) + (x, y))


def _free(ends: Array) -> Array:
    """Which ends of pieces (n, 2) are those of no other one."""
    points = np.round(ends.reshape(-1, 2), 6)
    _, which, counts = np.unique(points, axis=0, return_inverse=True, return_counts=True)
    return np.asarray(counts[which.ravel()].reshape(-1, 2) == 1)
