"""Where a local map may lie on a plan: corners of both that are alike, and votes for poses."""

import math

import numpy as np
from numpy.typing import NDArray

from ..kernels.mapping.votes import vote
from ..scan import Array

#: Two walls that end together. `bisector` looks between them, `opening` is the angle between them
#: there, below π; `solid` is 1 where that is inside a wall, 0 where it is free, -1 if not known.
MEETING = np.dtype(
    [
        ("position", "f8", 2),
        ("covariance", "f8", (2, 2)),
        ("bisector", "f8"),
        ("opening", "f8"),
        ("solid", "i4"),
        ("walls", "i4", 2),
    ],
    align=True,
)

#: Walls meet if the place is no farther from the end of each [m], and they differ in direction.
REACH, LEAST_SINE = 0.35, 0.35
#: An arm of a corner is at least so long [m].
ARM = 0.08
#: Corners whose openings differ by more are not the same [rad].
ALIKE = math.radians(12)
#: Ends of walls vote if the wall is so long [m], by this weight; turns count from this vote on.
LONG, OF_ENDS, LEAST_TURN = 0.5, 0.5, 0.3
#: Size of the boxes in which poses are counted [m, rad].
BOX, TURN = 0.6, math.radians(12)


def meetings(walls: NDArray[np.void], reach: float = REACH) -> NDArray[np.void]:
    """Return where two walls end together, or one ends on the other: records of `MEETING`."""
    if not len(walls):
        return np.zeros(0, MEETING)
    ends = np.stack((walls["start"], walls["end"]), axis=1)
    low, high = ends.min(axis=1) - reach, ends.max(axis=1) + reach
    # Only walls whose boxes overlap can meet.
    beside = (low[:, None, 0] <= high[:, 0]) & (low[:, 0] <= high[:, None, 0])
    beside &= (low[:, None, 1] <= high[:, 1]) & (low[:, 1] <= high[:, None, 1])
    i, j = np.nonzero(np.triu(beside, 1))
    u = np.stack((np.cos(walls["angle"]), np.sin(walls["angle"])), axis=1)
    sine = _cross(u[i], u[j])
    crossing = np.abs(sine) > LEAST_SINE
    i, j, sine = i[crossing], j[crossing], sine[crossing]
    between = walls["start"][j] - walls["start"][i]
    along_i, along_j = _cross(between, u[j]) / sine, _cross(between, u[i]) / sine
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    found = []
    for way_i in (1, -1):
        for way_j in (1, -1):
            # An arm leads from the vertex along the wall: to its end, or back to its start.
            arm_i = length[i] - along_i if way_i > 0 else along_i
            arm_j = length[j] - along_j if way_j > 0 else along_j
            near_i = np.minimum(np.abs(along_i), np.abs(length[i] - along_i)) <= reach
            near_j = np.minimum(np.abs(along_j), np.abs(length[j] - along_j)) <= reach
            inside_i = (along_i >= -reach) & (along_i <= length[i] + reach)
            inside_j = (along_j >= -reach) & (along_j <= length[j] + reach)
            good = (arm_i >= np.minimum(ARM, 0.5 * length[i])) & inside_i & inside_j
            good &= (arm_j >= np.minimum(ARM, 0.5 * length[j])) & (near_i | near_j)
            # The vertex is at the near end of a wall, unless the other ends on it.
            k = np.flatnonzero(good)
            at = walls["start"][i[k]] + along_i[k, None] * u[i[k]]
            found.append(_records(walls, u, i[k], j[k], way_i, way_j, at))
    joined: NDArray[np.void] = np.concatenate(found)
    return joined


def _records(
    walls: NDArray[np.void],
    u: Array,
    i: NDArray[np.intp],
    j: NDArray[np.intp],
    way_i: int,
    way_j: int,
    at: Array,
) -> NDArray[np.void]:
    """Make the records of corners whose arms lead `way` along their walls."""
    corners = np.zeros(len(i), MEETING)
    # Arms in counter-clockwise order, less than half a turn apart.
    swap = _cross(way_i * u[i], way_j * u[j]) < 0
    a, b = np.where(swap, j, i), np.where(swap, i, j)
    way_a, way_b = np.where(swap, way_j, way_i), np.where(swap, way_i, way_j)
    va, vb = way_a[:, None] * u[a], way_b[:, None] * u[b]
    middle = va + vb
    corners["position"], corners["walls"] = at, np.stack((a, b), axis=1)
    corners["bisector"] = np.arctan2(middle[:, 1], middle[:, 0])
    corners["opening"] = np.arctan2(_cross(va, vb), (va * vb).sum(axis=1))
    # What is seen lies to the left of a wall: between the arms if a leads on and b leads back.
    free = np.where(way_a > 0, 0, 1), np.where(way_b > 0, 1, 0)
    one_sided = walls["side"][a] * walls["side"][b] == 1
    corners["solid"] = np.where(one_sided, free[0], -1)
    corners["covariance"] = _spread(walls, u, a, b, at)
    agreed: NDArray[np.void] = corners[~one_sided | (free[0] == free[1])]
    return agreed


def _spread(
    walls: NDArray[np.void], u: Array, a: NDArray[np.intp], b: NDArray[np.intp], at: Array
) -> Array:
    """Covariance of the place where two lines meet, from those of both."""
    normals = np.stack((-u[:, 1], u[:, 0]), axis=1)
    inverse = np.linalg.inv(np.stack((normals[a], normals[b]), axis=1))
    variances = np.zeros((len(a), 2, 2))
    for row, wall in enumerate((a, b)):
        lever = ((at - walls["centroid"][wall]) * u[wall]).sum(axis=1)
        (v00, v01), (_, v11) = walls["covariance"][wall].transpose(1, 2, 0)
        variances[:, row, row] = v00 + 2 * lever * v01 + lever**2 * v11
    return np.asarray(inverse @ variances @ inverse.transpose(0, 2, 1))


def directions(local: NDArray[np.void], walls: NDArray[np.void]) -> Array:
    """Votes of the walls for each turn of the local map, by degrees, shape (360,), at most 1."""
    spectra = []
    for table in (local, walls):
        lengths = np.minimum(np.linalg.norm(table["end"] - table["start"], axis=1), 10.0)
        degrees = np.rint(np.degrees(table["angle"])).astype(np.int64) % 360
        histogram = np.bincount(degrees, lengths, minlength=360)
        both = table["side"] == 0
        histogram += np.bincount((degrees[both] + 180) % 360, lengths[both], minlength=360)
        spectra.append(np.fft.rfft(histogram))
    smooth = np.roll(np.bincount(np.arange(7), [1, 2, 3, 4, 3, 2, 1], 360), -3)
    turned = np.fft.irfft(spectra[0].conj() * spectra[1] * np.fft.rfft(smooth), 360)
    return np.asarray(np.maximum(turned / turned.max(initial=1e-12), 0.0))


def anchors(walls: NDArray[np.void], corners: NDArray[np.void]) -> Array:
    """Return what votes: corners and ends of long walls, rows of x, y, direction, kind, opening.

    Kinds are 0 and 1 for corners that are free or solid, -1 where that is not known, and 2 and 3
    for the starts and ends of walls.
    """
    table = np.zeros((len(corners), 5))
    table[:, :2], table[:, 2] = corners["position"], corners["bisector"]
    table[:, 3], table[:, 4] = corners["solid"], corners["opening"]
    long = walls[np.linalg.norm(walls["end"] - walls["start"], axis=1) > LONG]
    tables = [table]
    for turn, of in ((0.0, long), (math.pi, long[long["side"] == 0])):
        for kind, name in ((2, "start"), (3, "end")):
            table = np.zeros((len(of), 5))
            table[:, :2], table[:, 2] = of[name], of["angle"] + turn
            table[:, 3] = kind if not turn else 5 - kind
            tables.append(table)
    return np.concatenate(tables)


def hypotheses(local: Array, plan: Array, by_turn: Array, most: int) -> Array:
    """Return the poses of the local map for which most votes are, shape (n, 3), the best first.

    An anchor of the local map that is like one of the plan votes for the pose that puts it there,
    by how well the walls agree with the turn. Boxes in which votes are counted overlap by half.
    """
    n_turns = round(2 * math.pi / TURN)
    reach = np.hypot(*local[:, :2].T).max(initial=0.0) + BOX
    low, high = plan[:, :2].min(axis=0) - reach, plan[:, :2].max(axis=0) + reach
    columns, rows = np.ceil((high - low) / BOX).astype(int) + 1
    settings = (*low.tolist(), BOX, int(rows), ALIKE, LEAST_TURN, OF_ENDS)
    # Only turns that walls agree with have boxes.
    degrees = np.flatnonzero(by_turn >= LEAST_TURN)[:, None] + np.array([-0.5, 0.5])
    slots = np.full((2, n_turns), -1)
    for k in range(2):
        used = np.unique(np.floor(degrees / 360 * n_turns + 0.5 * k).astype(np.int64) % n_turns)
        slots[k, used] = np.arange(len(used))
    n_slots = int(slots.max(initial=-1)) + 1
    boxes = np.zeros((2, columns * rows * n_slots, 4))
    voters = np.zeros(boxes.shape[:2], np.int32)
    touched = np.empty(boxes.shape[:2], np.int64)
    counts = vote(local, plan, (by_turn, slots, n_slots), settings, boxes, voters, touched)
    found = np.concatenate([boxes[k, touched[k, :count]] for k, count in enumerate(counts)])
    if len(found) > most:
        least = np.partition(found[:, 0], -most)[-most]
        found = found[found[:, 0] >= least]
    return np.asarray(found[np.argsort(-found[:, 0], kind="stable")[:most], 1:])


def _cross(a: Array, b: Array) -> Array:
    product: Array = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return product
