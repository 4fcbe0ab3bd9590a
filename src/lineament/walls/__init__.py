"""Walls and columns: their records, and how they are moved, cut and made of segments."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..features import SEGMENT
from ..kernels.mapping.layout import WALL_COLUMNS
from ..scan import Array, Pose

#: A straight wall. Its covariance is that of (offset along the left normal at the centroid, angle)
#: [m², m·rad, rad²]. `side` is 1 where it was seen from its left alone, 0 where from either side.
WALL = np.dtype(
    [
        ("start", "f8", 2),
        ("end", "f8", 2),
        ("centroid", "f8", 2),
        ("angle", "f8"),
        ("covariance", "f8", (2, 2)),
        ("side", "i4"),
        ("views", "i4"),
    ],
    align=True,
)
#: A round column or a bend: its covariance is that of (x, y, radius) [m²].
COLUMN = np.dtype(
    [("center", "f8", 2), ("radius", "f8"), ("covariance", "f8", (3, 3)), ("views", "i4")],
    align=True,
)
#: Shorter segments show no wall: of a drive; of a plan, or of what is looked for [m].
SHORT, SHORTEST = 0.1, 0.15

Numbers = NDArray[np.int64]
Records = NDArray[np.void]


def walls_of(ends: Array, *, side: int = 0, covariance: ArrayLike = 0.0) -> Records:
    """Make records of walls from both ends of each, shape (n, 2, 2)."""
    if side not in (0, 1):
        raise ValueError(f"side is {side!r}, expected 0 or 1")
    walls = np.zeros(len(ends), WALL)
    walls["start"], walls["end"], walls["centroid"] = ends[:, 0], ends[:, 1], ends.mean(axis=1)
    walls["angle"] = np.arctan2(*(ends[:, 1] - ends[:, 0]).T[::-1])
    walls["covariance"], walls["side"], walls["views"] = covariance, side, 1
    return walls


def segments_of(walls: Records) -> Records:
    """Return walls as segments."""
    segments = shared(walls, SEGMENT)
    segments["length"], segments["n_points"] = lengths_of(walls), walls["views"]
    return segments


def as_walls(segments: Records) -> Records:
    """Return segments as walls that are seen from their left."""
    walls = shared(segments, WALL)
    walls["side"] = walls["views"] = 1
    walls["covariance"] += bent(segments["misfit"] ** 2, segments["length"])
    return walls[segments["length"] > SHORT]


def cut(wall: np.void, first: Array, last: Array) -> Records:
    """Return parts of a wall, so far from its start [m]."""
    parts, (u,) = np.repeat(wall, len(first)), unit(wall["angle"][None])
    for name, along in (("start", first), ("end", last), ("centroid", (first + last) / 2)):
        parts[name] = wall["start"] + along[:, None] * u
    parts["covariance"] = covariance_at(
        parts["covariance"], (parts["centroid"] - wall["centroid"]) @ u
    )
    return parts


def moved(walls: Records, frame: Pose) -> Records:
    """Return walls in another frame, whose pose is given."""
    found, (x, y, theta) = walls.copy(), frame
    c, s = math.cos(theta), math.sin(theta)
    for name in ("start", "end", "centroid"):
        found[name] = (walls[name] - (x, y)) @ np.array([[c, -s], [s, c]])
    found["angle"] = wrapped(walls["angle"] - theta)
    return found


def turned_back(walls: Records) -> Records:
    """Return walls as they are from their other side."""
    found = walls.copy()
    found["start"], found["end"] = walls["end"], walls["start"]
    found["angle"] = wrapped(walls["angle"] + math.pi)
    found["covariance"] *= [[1, -1], [-1, 1]]
    return found


def shared(records: Records, dtype: np.dtype[np.void]) -> Records:
    """Return records of another kind, of which the fields that both have are set."""
    found = np.zeros(len(records), dtype)
    for name in {*(dtype.names or ())} & {*(records.dtype.names or ())}:
        found[name] = records[name]
    return found


def lengths_of(walls: Records) -> Array:
    """Lengths of walls (n,) [m]."""
    return np.asarray(np.linalg.norm(walls["end"] - walls["start"], axis=1))


def rows_of(walls: Records) -> Array:
    """Return walls as the kernels take them, shape (n, WALL_COLUMNS)."""
    rows = np.empty((len(walls), WALL_COLUMNS))
    along = walls["end"] - walls["start"]
    rows[:, :2], rows[:, 4] = walls["start"], np.hypot(along[:, 0], along[:, 1])
    rows[:, 2:4], rows[:, 5] = along / rows[:, 4:5], walls["side"]
    # The covariance is moved along the wall to the middle between its ends.
    arm = 0.5 * (walls["start"] + walls["end"]) - walls["centroid"]
    lever, spread = (arm * rows[:, 2:4]).sum(axis=1), walls["covariance"]
    rows[:, 8] = spread[:, 1, 1]
    rows[:, 7] = spread[:, 0, 1] + lever * rows[:, 8]
    rows[:, 6] = spread[:, 0, 0] + lever * (2 * spread[:, 0, 1] + lever * rows[:, 8])
    return rows


def unit(angles: Array) -> Array:
    """Return unit vectors (..., 2) of these directions."""
    vectors = np.empty((*np.shape(angles), 2))
    vectors[..., 0], vectors[..., 1] = np.cos(angles), np.sin(angles)
    return vectors


def summed(values: Array, at: Numbers, count: int) -> Array:
    """Return the sums (count, ...) of the values (m, ...) of each number."""
    total = np.zeros((count, *values.shape[1:]))
    np.add.at(total, at, values)
    return total


def wrapped(angles: Array) -> Array:
    """Angles in [-π, π)."""
    return np.asarray(np.remainder(angles + math.pi, 2 * math.pi) - math.pi)


def covariance_at(covariances: Array, along: Array) -> Array:
    """Covariances of lines at places so far along them [m]."""
    lever = np.tile(np.eye(2), (len(along), 1, 1))
    lever[:, 0, 1] = along
    return np.asarray(lever @ covariances @ lever.transpose(0, 2, 1))


def bent(variance: Array | float, length: Array) -> Array:
    """Covariances of parts of walls that bow: each lies beside the whole, and is turned."""
    spread = np.zeros((len(length), 2, 2))
    spread[:, 0, 0] = variance
    spread[:, 1, 1] = 4 * variance / np.maximum(length, 0.1) ** 2
    return spread


def rows_shaped(name: str, given: ArrayLike, *shapes: tuple[int, ...]) -> Array:
    """Return numbers of one of some shapes in each row; none is a row of nothing."""
    wanted = " or ".join(str(("n", *shape)).replace("'", "") for shape in shapes)
    try:
        rows = np.array(given, np.float64)
    except (TypeError, ValueError):  # a text, or rows that differ in length
        raise ValueError(f"{name} are {given!r:.60}, expected numbers of shape {wanted}") from None
    if rows.size and rows.shape[1:] not in shapes:
        raise ValueError(f"{name} have shape {rows.shape}, expected {wanted}")
    return rows.reshape(-1, *shapes[0])
