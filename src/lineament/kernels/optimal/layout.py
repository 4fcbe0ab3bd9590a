"""The workspace of method `optimal`: its arrays, and their rows by what indexes them."""

from typing import Any, NamedTuple

from ..arrays import Floats1, Floats2, Ints2

#: Of `points`, by measurement in beam order (on a full circle from any beam on): place and range
#: [m]; least energy of the measurements before; that before a line from a candidate, inf while it
#: runs along; by group of candidates, a bound of the energy with a line from any of them to the
#: ends behind the block at hand, and to those of the block; two rows of scratch; and from `AHEAD`
#: on, for both candidates that run along, the energies with a line to the next measurements.
X, Y, RHO, ENERGY, BASE, BOUND, NOW, KEY, SCRATCH, AHEAD = range(10)
POINTS = 11
#: Of `beams`, by measurement: its beam; whether a break is before it; the measurement at which the
#: line that ends before it begins, or -1; first and last measurement of each cluster.
BEAM, BROKEN, ORIGIN, CLUSTER_FIRST, CLUSTER_LAST = range(5)
BEAMS = 5
#: The candidates that run along; before, whether a measurement is a spike.
RUNNER, SPIKE = CLUSTER_FIRST, CLUSTER_FIRST
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
