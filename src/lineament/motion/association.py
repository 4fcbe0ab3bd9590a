"""Which features of a frame are those of another: pairs within gates of their covariances."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..features import Features
from ..features.records import C_COVARIANCE
from ..kernels.tracking.association import associate as kernel
from ..kernels.tracking.association import move
from ..scan import Array

Pairs = NDArray[np.intp]

#: The tables whose features are tracked.
KINDS = ("segments", "corners", "arcs")
#: Words of segments, corners and arcs (see `kernels.records`).
Words = tuple[Array, Array, Array]


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """Features of two frames, and which of them are the same.

    Attributes
    ----------
    before, now : Features
        The features of either frame, each in its sensor's frame.
    segments, corners, arcs : ndarray of int, shape (m, 2)
        Indices into the tables of `before` and of `now`.
    """

    before: Features
    now: Features
    segments: Pairs
    corners: Pairs
    arcs: Pairs

    def __len__(self) -> int:
        return sum(len(getattr(self, kind)) for kind in KINDS)

    def same_as(self, other: "Matches") -> bool:
        """Whether the pairs are those of another association."""
        return all(np.array_equal(getattr(self, kind), getattr(other, kind)) for kind in KINDS)


def associate(
    before: Features,
    now: Features,
    motion: tuple[float, float, float] = (0.0, 0.0, 0.0),
    covariance: ArrayLike | None = None,
    *,
    gate: float = 0.99,
    roughness: float = 0.0,
) -> Matches:
    """Find the features that two frames share.

    The later ones are moved by the expected motion into the earlier frame. A pair is possible
    where d² = e'S⁻¹e is within the quantile `gate` of its χ² distribution, with S the sum of both
    covariances, that of the motion, the misfits, and the roughness: for corners of the same
    convexity, e is their distance (2 degrees); for arcs, that of their centres and radii (3); for
    segments, the offset from the earlier line and the angle (2), if they lie side by side along
    half of the shorter one. The pairs are one to one and at the least total cost, where to leave a
    feature alone costs as much as the gate. Edges have no pair: they may be silhouettes, which move
    with the sensor.

    Parameters
    ----------
    before, now : Features
        Each in its sensor's frame.
    motion : (x, y, theta)
        Expected pose of the later sensor in the frame of the earlier [m, m, rad].
    covariance : array_like, shape (3, 3), optional
        How well the motion is known [m, m, rad]; exactly where it is not given.
    gate : float
        Share of the right pairs that are within the gates.
    roughness : float
        How far surfaces are from straight and round [m].

    Raises
    ------
    ValueError
        If the gate is not between 0 and 1, or the covariance has another shape.

    Examples
    --------
    >>> import lineament as ln
    >>> features = ln.extract(ln.LaserScan([2.0] * 5, angle_min=-0.02, angle_increment=0.01))
    >>> associate(features, features).segments.tolist()
    [[0, 0]]
    """
    gates = chi_square(gate, 2), chi_square(gate, 3)
    spread = np.zeros((3, 3)) if covariance is None else matrix_of(covariance)
    x, y, theta = map(float, motion)
    earlier, moved = words_of(before), words_of(now)
    # Walls are off straight lines in both frames, and their corners with them.
    squares = np.append(now.segments["misfit"] ** 2, 0.0)
    both = 2.0 * squares[now.corners["segments"]].sum(axis=1)
    moved[1][:, C_COVARIANCE] += both
    moved[1][:, C_COVARIANCE + 3] += both
    move(*moved, x, y, theta)
    sides = before.corners["convex"].astype(np.int8), now.corners["convex"].astype(np.int8)
    owners = tuple(np.empty(len(table), np.int64) for table in earlier)
    rows = max(map(len, moved))
    columns = max(len(one) + len(other) for one, other in zip(earlier, moved, strict=True))
    floats, ints = np.empty((3, columns + 1)), np.empty((3, columns + 1), np.int64)
    scratch = np.empty((rows, columns)), floats, ints
    kernel(earlier, moved, sides, spread, (x, y), float(roughness), gates, scratch, owners)
    return Matches(before, now, *map(_pairs, owners))


def words_of(features: Features) -> Words:
    """Copy the tables of tracked features as matrices of words (see `kernels.records`)."""
    segments, corners, arcs = (
        # By way of bytes: numpy copies records field by field, several times slower.
        np.frombuffer(bytearray(table.tobytes())).reshape(len(table), table.itemsize // 8)
        for table in (features.segments, features.corners, features.arcs)
    )
    return segments, corners, arcs


def matrix_of(covariance: ArrayLike) -> Array:
    """Copy a covariance of (x, y, theta); ValueError if it has another shape than (3, 3)."""
    matrix = np.array(covariance, dtype=np.float64, order="C")
    if matrix.shape != (3, 3):
        raise ValueError(f"covariance is {matrix.tolist()}, expected (3, 3), of (x, y, theta)")
    return matrix


@lru_cache
def chi_square(probability: float, degrees: int) -> float:
    """Quantile of the χ² distribution of 2 or 3 degrees of freedom; ValueError outside (0, 1)."""
    if not 0 < probability < 1:
        raise ValueError(f"gate is {probability}, expected a share between 0 and 1")
    if degrees == 2:
        return -2.0 * math.log1p(-probability)
    low, high = 0.0, 100.0
    while low < (middle := 0.5 * (low + high)) < high:
        beyond = math.erfc(math.sqrt(middle / 2))
        beyond += math.sqrt(2 * middle / math.pi) * math.exp(-middle / 2)
        low, high = (middle, high) if beyond > 1 - probability else (low, middle)
    return high


def _pairs(owners: NDArray[np.int64]) -> Pairs:
    """List the earlier features that are seen later, and what they are then, shape (m, 2)."""
    before = np.flatnonzero(owners >= 0)
    pairs = np.empty((len(before), 2), np.intp)
    pairs[:, 0], pairs[:, 1] = before, owners[before]
    return pairs
