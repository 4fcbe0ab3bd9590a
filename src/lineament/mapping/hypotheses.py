"""Where a local map may lie on a plan: corners of both that are alike, and votes for poses."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import LineamentError
from ..kernels.mapping.corners import CORNER_COLUMNS, meet
from ..kernels.mapping.votes import vote
from ..scan import Array
from ..walls import Numbers, lengths_of, rows_of, unit

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
#: Of so few walls, to look at all pairs is quicker.
_FEW = 150
#: Corners whose openings differ by more are not the same [rad].
ALIKE = math.radians(12)
#: Ends of walls vote if the wall is so long [m], by this weight; turns count from this vote on.
LONG, OF_ENDS, LEAST_TURN = 0.5, 0.5, 0.3
#: Size of the boxes in which poses are counted [m, rad].
BOX, TURN = 0.6, math.radians(12)


def meetings(walls: NDArray[np.void]) -> NDArray[np.void]:
    """Return where two walls end together, or one ends on the other: records of `MEETING`."""
    pairs = beside(walls)
    found = np.empty((4 * len(pairs), CORNER_COLUMNS))
    count = meet(rows_of(walls), pairs, (REACH, LEAST_SINE, ARM), found)
    rows, corners = found[:count], np.zeros(count, MEETING)
    corners["position"], corners["covariance"] = (
        rows[:, :2],
        rows[:, (2, 3, 3, 4)].reshape(-1, 2, 2),
    )
    corners["bisector"], corners["opening"] = rows[:, 5:7].T
    corners["solid"], corners["walls"] = rows[:, 7], rows[:, 8:]
    return corners


def beside(walls: NDArray[np.void]) -> Numbers:
    """Return pairs of walls of which one, a little longer, may pass by an end of the other.

    Rows are sorted, with the lower number first; of few walls they are all. Points along the walls
    are listed by cells, and each end looks into the nine cells around it: the cost is that of the
    pairs.
    """
    u, lengths, n = unit(walls["angle"]), lengths_of(walls), len(walls)
    if n <= _FEW:
        return np.column_stack(np.triu_indices(n, 1))
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
            "do lines lie over each other, or are some no walls?"
        )
    one = np.repeat(np.repeat(of, 3), counts)
    offsets = np.arange(many) - np.repeat(np.cumsum(counts) - counts, counts)
    other = wall[np.repeat(begins, counts) + offsets]
    found = np.unique(np.minimum(one, other) * n + np.maximum(one, other))
    pairs = np.column_stack((found // max(n, 1), found % max(n, 1)))
    return np.asarray(pairs[pairs[:, 0] != pairs[:, 1]])


def spectrum(walls: NDArray[np.void]) -> NDArray[np.complex128]:
    """Fourier transform of the lengths of walls by the degrees of their directions."""
    lengths = np.minimum(lengths_of(walls), 10.0)
    degrees = np.rint(np.degrees(walls["angle"])).astype(np.int64) % 360
    both = walls["side"] == 0
    histogram = np.bincount(degrees, lengths, minlength=360)
    histogram += np.bincount((degrees[both] + 180) % 360, lengths[both], minlength=360)
    return np.asarray(np.fft.rfft(histogram))


def agreement(local: NDArray[np.complex128], walls: NDArray[np.complex128]) -> Array:
    """Votes for each turn of a local map, by degrees (360,), at most 1, by spectra of walls."""
    turned = np.fft.irfft(local.conj() * walls * _SMOOTH, 360)
    return np.asarray(np.maximum(turned / turned.max(initial=1e-12), 0.0))


#: Walls that are a few degrees off each other agree in part.
_SMOOTH = np.fft.rfft(np.roll(np.bincount(np.arange(7), [1, 2, 3, 4, 3, 2, 1], 360), -3))


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


def image_of(anchors: Array) -> Array:
    """Return the anchors of the mirror image: where walls started they end."""
    image = anchors * (1, -1, -1, 1, 1)
    ends = anchors[:, 3] > 1.5
    image[ends, 2] += math.pi
    image[ends, 3] = 5.0 - anchors[ends, 3]
    return image


class Listed(NamedTuple):
    """Anchors by kind, degree and place; their directions as vectors; where each degree begins.

    Those beside each other are, so that their votes are, too.
    """

    anchors: Array
    units: Array
    begins: Numbers


def listed(anchors: Array) -> Listed:
    """List the anchors of a plan."""
    rows = anchors.copy()
    rows[:, 2] %= 2 * math.pi
    degrees = np.minimum(np.degrees(rows[:, 2]).astype(np.int64), 359)
    keys = 360 * (rows[:, 3].astype(np.int64) + 1) + degrees
    order = np.lexsort((rows[:, 1], rows[:, 0], keys))
    begins = np.searchsorted(keys[order], np.arange(5 * 360 + 1))
    return Listed(rows[order], unit(rows[order, 2]), begins)


def hypotheses(local: Array, plan: Listed, by_turn: Array, most: int) -> Array:
    """Return the poses of the local map for which most votes are, shape (n, 3), the best first.

    An anchor of the local map that is like one of the plan votes for the pose that puts it there,
    by how well the walls agree with the turn. Boxes in which votes are counted overlap by half.
    """
    n_turns, places = round(2 * math.pi / TURN), plan.anchors[:, :2]
    if not len(local) or not len(places):
        return np.empty((0, 3))
    reach = np.hypot(*local[:, :2].T).max(initial=0.0) + BOX
    low, high = places.min(axis=0) - reach, places.max(axis=0) + reach
    columns, rows = (np.ceil((high - low) / BOX).astype(int) + 1).tolist()
    settings = (*low.tolist(), BOX, rows, ALIKE, LEAST_TURN, OF_ENDS)
    # Only turns that walls agree with have boxes.
    degrees = np.flatnonzero(by_turn >= LEAST_TURN)[:, None] + np.array([-0.5, 0.5])
    used = np.zeros((2, n_turns), np.int64)
    for k in range(2):
        used[k, np.floor(degrees / 360 * n_turns + 0.5 * k).astype(np.int64) % n_turns] = 1
    boxes = np.zeros((columns * rows, 4))
    found = np.empty((4, min(int(used.sum()) * len(boxes), 2 * len(local) * len(places))))
    scratch, touched = (boxes, np.zeros(len(boxes), np.int64)), np.empty(len(boxes), np.int64)
    count = vote(local, plan, (by_turn, used), settings, scratch, touched, found)
    votes, best = found[0, :count], np.arange(count)
    if count > most:
        best = np.flatnonzero(votes >= np.partition(votes, -most)[-most])
    return found[1:, best[np.argsort(-votes[best], kind="stable")[:most]]].T
