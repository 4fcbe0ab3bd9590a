"""The workspace of method `optimal`: its arrays, and their rows by what indexes them."""

from typing import Any, NamedTuple

from ..arrays import Floats1, Floats2, Ints2

#: Of `points`, by measurement in beam order (on a full circle from any beam on): place and range
#: [m]; least energy of the measurements before; by group, the least energy with a line from one of
#: its candidates to the anchor; that before a line from a candidate, inf while it runs along; by
#: block, χ² of the blocks before; two rows of scratch, by measurement or by group; one by row of
#: groups; and from `AHEAD` on, for each of the three candidates that run along, the energies with
#: a line from it to the next measurements.
X, Y, RHO, ENERGY, LOWEST, BASE, BLOCKS, KEY, SCRATCH, ROW_KEY, AHEAD = range(11)
POINTS = 13
#: Of `beams`, by measurement: its beam; whether a break is before it; the measurement at which the
#: line that ends before it begins, or -1; first and last measurement of each cluster.
BEAM, BROKEN, ORIGIN, CLUSTER_FIRST, CLUSTER_LAST = range(5)
BEAMS = 5
#: The candidates that run along; the anchor of each group of candidates; before, whether a
#: measurement is a spike.
RUNNER, ANCHOR, SPIKE = CLUSTER_FIRST, CLUSTER_LAST, CLUSTER_FIRST
#: Of a row of `pieces`, by surface: the line a x + b y = 1 [1/m]; its centroid [m] and direction;
#: the covariance of its offset there and its angle; root mean square and misfit [m]. Of an arc:
#: centre, radius [m], six covariances, root mean square [m], and by how much lines are worse.
A, B, CX, CY, UX, UY, OO, OA, AA, RMS, MISFIT = range(11)
RADIUS, XX, XY, XR, YY, YR, RR, GAIN = UX, UY, OO, OA, AA, A, B, MISFIT
PIECES = 11
#: Of `spans`, by surface: its first and last measurement, how many of those count, what it is, the
#: number of its segment, and whether there is a corner at its start and its end.
FIRST, LAST, COUNT, KIND, SEGMENT, START, END, CORNER = range(8)
SPANS = 8
#: Kinds of surfaces.
LINE, ARC = 0, 1
#: Rows of the running sums: w (xx, xy, yy, x, y, 1).
SUMS = 6


class Work(NamedTuple):
    """The arrays of one scan: noise is (constant, growth, variance of a bearing, uncertainty)."""

    points: Floats2
    beams: Ints2
    spans: Ints2
    pieces: Floats2
    sums: Floats2
    noise: Floats1


class Scan(NamedTuple):
    """What is known of the scan at hand: its number, beams, measurements, and the parameters."""

    row: Any
    beams: Any
    count: Any
    circular: Any
    evidence: Any
    missing: Any
