"""Where a local map may lie on a plan: corners of both that are alike, and votes for poses."""

import math

import numpy as np
from numpy.typing import NDArray

from ..errors import LineamentError
from ..kernels.mapping.votes import vote
from ..scan import Array
from .walls import Numbers, lengths_of, unit

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
#: Points along walls by which they are found, and pairs of walls that are looked at, at most.
_MOST_POINTS, _MOST_PAIRS = 4_000_000, 5_000_000
#: Corners whose openings differ by more are not the same [rad].
ALIKE = math.radians(12)
#: Ends of walls vote if the wall is so long [m], by this weight; turns count from this vote on.
LONG, OF_ENDS, LEAST_TURN = 0.5, 0.5, 0.3
#: Size of the boxes in which poses are counted [m, rad].
BOX, TURN = 0.6, math.radians(12)


def meetings(walls: NDArray[np.void]) -> NDArray[np.void]:
    """Return where two walls end together, or one ends on the other: records of `MEETING`."""
    pairs = beside(walls)
    u = unit(walls["angle"])
    sine = _cross(u[pairs[:, 0]], u[pairs[:, 1]])
    crossing = np.abs(sine) > LEAST_SINE
    pairs, sine = pairs[crossing], sine[crossing]
    between = walls["start"][pairs[:, 1]] - walls["start"][pairs[:, 0]]
    along = np.column_stack([_cross(between, u[k]) for k in pairs.T[::-1]]) / sine[:, None]
    length = lengths_of(walls)[pairs]
    near = (np.minimum(np.abs(along), np.abs(length - along)) <= REACH).any(axis=1)
    near &= ((along >= -REACH) & (along <= length + REACH)).all(axis=1)
    found = [np.zeros(0, MEETING)]
    for ways in np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)]):
        # An arm leads from the vertex along the wall: to its end, or back to its start.
        arm = np.where(ways > 0, length - along, along)
        k = np.flatnonzero(near & (arm >= np.minimum(ARM, 0.5 * length)).all(axis=1))
        corners, of = np.zeros(len(k), MEETING), pairs[k]
        leads = np.broadcast_to(ways, of.shape)
        # Arms in counter-clockwise order, less than half a turn apart.
        swap = (ways.prod() * sine[k] < 0)[:, None]
        of, leads = np.where(swap, of[:, ::-1], of), np.where(swap, leads[:, ::-1], leads)
        va, vb = (leads[:, [side]] * u[of[:, side]] for side in (0, 1))
        middle = va + vb
        corners["position"] = walls["start"][pairs[k, 0]] + along[k, :1] * u[pairs[k, 0]]
        corners["bisector"] = np.arctan2(middle[:, 1], middle[:, 0])
        corners["opening"] = np.arctan2(_cross(va, vb), (va * vb).sum(axis=1))
        corners["covariance"] = _spread(walls[of], corners["position"])
        # What is seen lies to the left of a wall: between the arms if a leads on and b leads back.
        one_sided = (walls["side"][of] == 1).all(axis=1)
        corners["walls"], corners["solid"] = of, np.where(one_sided, leads[:, 0] < 0, -1)
        found.append(corners[~one_sided | (leads[:, 0] != leads[:, 1])])
    return np.concatenate(found)


def beside(walls: NDArray[np.void]) -> Numbers:
    """Return pairs of walls of which one, a little longer, may pass by an end of the other.

    Rows are sorted, with the lower number first. Points along the walls are listed by cells, and
    each end looks into the nine cells around it: the cost is that of the pairs.
    """
    u, lengths, n = unit(walls["angle"]), lengths_of(walls), len(walls)
    total = float(lengths.sum()) + 2 * REACH * n
    step = max(2 * REACH, total / _MOST_POINTS)
    counts = np.ceil((lengths + 2 * REACH) / step).astype(np.int64)
    wall, first = np.repeat(np.arange(n), counts), np.cumsum(counts) - counts
    along = step * (np.arange(len(wall)) - first[wall] + 0.5) - REACH
    points = walls["start"][wall] + along[:, None] * u[wall]
    ends, of = np.concatenate((walls["start"], walls["end"])), np.tile(np.arange(n), 2)
    low = np.minimum(points.min(axis=0, initial=np.inf), ends.min(axis=0, initial=np.inf))
    size = 1.01 * (REACH + step / 2)
    cells, at = (np.floor((places - low) / size).astype(np.int64) + 1 for places in (points, ends))
    rows = int(max(cells[:, 1].max(initial=0), at[:, 1].max(initial=0))) + 2
    keys = cells @ (rows, 1)
    order = np.argsort(keys, kind="stable")
    keys, wall = keys[order], wall[order]
    # The three cells of a column are one after the other.
    around = (at @ (rows, 1))[:, None] + np.array((-rows, 0, rows))
    begins = np.searchsorted(keys, around.ravel() - 1)
    counts = np.searchsorted(keys, around.ravel() + 1, side="right") - begins
    if (many := int(counts.sum())) > _MOST_PAIRS:
        raise LineamentError(
            f"{many} pairs of {n} walls lie beside each other, expected at most {_MOST_PAIRS}: "
            "are all lines of the plan walls?"
        )
    one = np.repeat(np.repeat(of, 3), counts)
    offsets = np.arange(many) - np.repeat(np.cumsum(counts) - counts, counts)
    other = wall[np.repeat(begins, counts) + offsets]
    found = np.unique(np.minimum(one, other) * n + np.maximum(one, other))
    pairs = np.column_stack((found // max(n, 1), found % max(n, 1)))
    return np.asarray(pairs[pairs[:, 0] != pairs[:, 1]])


def _spread(walls: NDArray[np.void], at: Array) -> Array:
    """Covariances of places (n, 2) where two lines meet, from those of both, (n, 2)."""
    u = unit(walls["angle"])
    lever = np.ones(u.shape)
    lever[:, :, 1] = ((at[:, None] - walls["centroid"]) * u).sum(axis=2)
    variances = np.einsum("nwi,nwij,nwj->nw", lever, walls["covariance"], lever)
    inverse = np.linalg.inv(np.stack((-u[:, :, 1], u[:, :, 0]), axis=-1))
    return np.asarray((inverse * variances[:, None]) @ inverse.transpose(0, 2, 1))


def directions(local: NDArray[np.void], walls: NDArray[np.void]) -> Array:
    """Votes of the walls for each turn of the local map, by degrees, shape (360,), at most 1."""
    spectra = []
    for table in (local, walls):
        lengths = np.minimum(lengths_of(table), 10.0)
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
    names = ("bisector", "solid", "opening")
    tables = [np.column_stack((corners["position"], *(corners[name] for name in names)))]
    long = walls[lengths_of(walls) > LONG]
    for turn, of in ((0.0, long), (math.pi, long[long["side"] == 0])):
        for kind, name in ((2, "start"), (3, "end")):
            rest = of["angle"] + turn, np.full(len(of), 5.0 - kind if turn else kind)
            tables.append(np.column_stack((of[name], *rest, np.zeros(len(of)))))
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
    counts = np.zeros(2, np.int64)
    turns = by_turn, slots, n_slots
    vote(local, plan, unit(plan[:, 2]), turns, settings, boxes, voters, touched, counts)
    found = np.concatenate([boxes[k, touched[k, :count]] for k, count in enumerate(counts)])
    if len(found) > most:
        least = np.partition(found[:, 0], -most)[-most]
        found = found[found[:, 0] >= least]
    return np.asarray(found[np.argsort(-found[:, 0], kind="stable")[:most], 1:])


def _cross(a: Array, b: Array) -> Array:
    product: Array = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return product
