"""The workspace of one scan: its arrays, named by what indexes them, and their rows.

All floats of a workspace share one array and all whole numbers another, as each array that Python
passes to a kernel costs time. A kernel names their parts by `named`. Scans take turns in a
workspace, so that it stays in the nearest cache.
"""

from collections import namedtuple
from typing import NamedTuple

import numpy as np

from . import jitable
from .arrays import Floats1, Floats2, Ints1, Ints2, Shorts2

#: Rows of `beams`: ranges as measured, and those that the partition is made on (NaN where not
#: usable) [m].
RANGE, FILTERED = range(2)
#: Rows of `points`, in beam order [m]: where the partition is made; the spacing before a point and
#: what it is compared with (by usable beam, from the first on); where features are measured; how
#: far a point may be off a line, ``slack + slope |d|``; scratch. On a full circle the points may
#: begin at any beam, so that the seam cuts no cluster; where all are one cluster (CLOSED), the
#: first point is repeated at the end.
(
    X, Y, RHO, SPACING, DISTANCE_THRESHOLD, DENSITY_THRESHOLD, MEASURED_X, MEASURED_Y, MEASURED_RHO,
    SLACK, SLOPE, SPARE,
) = range(12)  # fmt: skip
#: Rows of `marks`, by point: its beam; its cluster, -1 for noise; whether it is in no piece yet;
#: points in no piece yet.
BEAM, LABEL, FREE, LEFT = range(4)
#: Rows of `clusters`, `pieces` and `waiting`: first and last point (a corner belongs to both its
#: pieces); of `pieces`, the piece that a corner at its first point joins it to, or -1.
FIRST, LAST, BEFORE = range(3)
#: Rows of `candidates`, in the order of examination: point, distance from the chord of its piece,
#: response.
POINT, CHORD_DISTANCE, RESPONSE = range(3)
#: Rows of `vertices`, of a map: point, and how its lines are joined; and of `rays`, by vertex: the
#: inverse range of the line before it and of the line after it [1/m], and pivot, right side and
#: cross term of their normal equations.
AT, KIND = range(2)
U_BEFORE, U_AFTER, PIVOT, RIGHT, CROSS = range(5)
#: Entries of `counts`.
POINTS, CLOSED, CLUSTERS, PIECES, CANDIDATES = range(5)

#: Columns of `moments`: sums over the points of a cluster before a point, of x, y, xx, xy, yy about
#: its first point, and that point.
MOMENTS = 7
#: Columns beyond the number of beams: for the point that is repeated, and enough for `counts`.
EXTRA = 5


class Workspace(NamedTuple):
    """Arrays of one scan, with `EXTRA` columns more than beams."""

    beams: Floats2
    points: Floats2
    candidates: Floats2
    response: Floats1  # by piece: of the corner at its first point
    marks: Ints2
    clusters: Ints2
    pieces: Ints2
    waiting: Ints2  # by piece that is to be searched
    counts: Ints1


#: What is known of a sensor: range_min, range_max, step, whether the beams go around.
Sensor = tuple[float, float, float, bool]


class Tables(NamedTuple):
    """The words of the features of all scans, and by scan the clusters of its beams.

    `offsets` has a row a scan, and a column a table: where its records begin; while a scan is
    written, the row behind it has where the next record goes.
    """

    segments: Floats2
    corners: Floats2
    edges: Floats2
    arcs: Floats2
    breakpoints: Floats2
    clusters: Shorts2
    offsets: Ints2


#: A workspace with `moments`, by point, of the methods that fit lines by running sums, and with
#: `rays` and `vertices`, of maps.
Extended = namedtuple("Extended", (*Workspace._fields, "moments", "rays", "vertices"))


def workspace(beams: int) -> tuple[Floats2, Ints2]:
    """Make the floats and the whole numbers of a workspace for scans of so many beams."""
    return np.zeros((30, beams + EXTRA)), np.zeros((14, beams + EXTRA), np.int64)


@jitable
def named(floats: Floats2, ints: Ints2) -> Workspace:
    """Name the parts of a workspace, which are views."""
    return Workspace(*_parts(floats, ints))


@jitable
def extended(floats: Floats2, ints: Ints2) -> Extended:
    """Name also the parts that only some methods need: a view takes 5 ns."""
    moments = floats[18:25].reshape(-1, MOMENTS)
    return Extended(*(_parts(floats, ints) + (moments, floats[25:30], ints[12:14])))  # noqa: RUF005


@jitable
def _parts(floats, ints):
    return (
        floats[0:2], floats[2:14], floats[14:17], floats[17], ints[0:4], ints[4:6], ints[6:9],
        ints[9:11], ints[11],
    )  # fmt: skip


@jitable
def beams_of(floats: Floats2) -> Floats2:
    """Return `beams` alone: a view costs 5 ns."""
    return floats[0:2]
