"""Which features of a frame are those of another: pairs within gates of their covariances."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..features import Features
from ..features.records import C_COVARIANCE, CORNER, SEGMENT
from ..kernels.tracking.association import associate as kernel
from ..kernels.tracking.association import move
from ..scan import Array
from ..scan.fields import at_least_0, checked_pose

Pairs = NDArray[np.intp]

#: The tables whose features are tracked.
KINDS = ("segments", "corners", "arcs")
#: Words of segments, corners and arcs (see `kernels.records`).
Words = tuple[Array, Array, Array]


class Frame(NamedTuple):
    """The tracked features of a frame, as the kernels take them.

    Attributes
    ----------
    words : Words
        All of them.
    segments, corners : structured arrays
        The same memory as records.
    convex : int8 array
        Whether each corner is convex.
    sides : int32 array, shape (n, 2)
        Indices of the segments of each corner.
    misfits : float64 array, shape (n,)
        Variance that those of its segments give to each corner, in two frames.
    """

    words: Words
    segments: NDArray[np.void]
    corners: NDArray[np.void]
    convex: NDArray[np.int8]
    sides: NDArray[np.int32]
    misfits: Array

    @classmethod
    def of(cls, words: Words) -> Self:
        """Complete the words of a frame."""
        segments, corners = words[0].reshape(-1).view(SEGMENT), words[1].reshape(-1).view(CORNER)
        sides = np.array(corners["segments"], order="C")
        # Walls are off straight lines in both frames, and their corners with them.
        squares = np.append(segments["misfit"] ** 2, 0.0)
        misfits = 2.0 * squares[sides].sum(axis=1)
        return cls(words, segments, corners, corners["convex"].astype(np.int8), sides, misfits)

    def moved(self, motion: tuple[float, float, float]) -> Words:
        """Return the words after a motion, with the misfits in the covariances of the corners."""
        segments, corners, arcs = (of.copy() for of in self.words)
        corners[:, C_COVARIANCE] += self.misfits
        corners[:, C_COVARIANCE + 3] += self.misfits
        move(segments, corners, arcs, *motion)
        return segments, corners, arcs


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
        If the gate is not between 0 and 1, the covariance has another shape, or a number is not
        finite or a roughness negative.

    Examples
    --------
    >>> import lineament as ln
    >>> features = ln.extract(ln.LaserScan([2.0] * 5, angle_min=-0.02, angle_increment=0.01))
    >>> associate(features, features).segments.tolist()
    [[0, 0]]
    """
    gates = chi_square(gate, 2), chi_square(gate, 3)
    spread = np.zeros((3, 3)) if covariance is None else matrix_of(covariance)
    expected, rough = checked_pose(motion, "motion"), at_least_0("roughness", roughness)
    frames = Frame.of(words_of(before)), Frame.of(words_of(now))
    return Matches(before, now, *paired(*frames, expected, spread, gates, rough))


def paired(
    before: Frame,
    now: Frame,
    motion: tuple[float, float, float],
    spread: Array,
    gates: tuple[float, float],
    roughness: float,
) -> tuple[Pairs, Pairs, Pairs]:
    """Find the pairs of segments, corners and arcs; gates are squares of 2 and 3 components."""
    earlier, moved = before.words, now.moved(motion)
    owners = tuple(np.empty(len(table), np.int64) for table in earlier)
    rows = max(map(len, moved))
    columns = max(len(one) + len(other) for one, other in zip(earlier, moved, strict=True))
    floats, ints = np.empty((3, columns + 1)), np.empty((3, columns + 1), np.int64)
    scratch = np.empty((rows, columns)), floats, ints
    convex = before.convex, now.convex
    kernel(earlier, moved, convex, spread, motion[:2], roughness, gates, scratch, owners)
    segments, corners, arcs = map(_pairs, owners)
    return segments, corners, arcs


def words_of(features: Features) -> Words:
    """Copy the tables of tracked features as matrices of words (see `kernels.records`)."""
    segments, corners, arcs = (
        # By way of bytes: numpy copies records field by field, several times slower.
        np.frombuffer(bytearray(table.tobytes())).reshape(len(table), table.itemsize // 8)
        for table in (features.segments, features.corners, features.arcs)
    )
    return segments, corners, arcs


def matrix_of(covariance: ArrayLike) -> Array:
    """Copy a covariance of (x, y, theta); ValueError if it is not (3, 3) and finite."""
    matrix = np.array(covariance, dtype=np.float64, order="C")
    if matrix.shape != (3, 3) or not np.isfinite(matrix).all():
        raise ValueError(f"covariance is {matrix.tolist()}, expected (3, 3), finite")
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
    (before,) = (owners >= 0).nonzero()
    pairs = np.empty((len(before), 2), np.intp)
    pairs[:, 0], pairs[:, 1] = before, owners[before]
    return pairs
