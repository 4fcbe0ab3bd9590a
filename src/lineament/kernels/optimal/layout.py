"""The workspace of method `optimal`: its arrays, and their rows by what indexes them."""

from typing import Any, NamedTuple

from ..arrays import Floats1, Floats2, Ints2

#: Of `points`, by measurement in beam order (on a full circle from any beam on): place and range
#: [m]; of step 1, squared errors, and those of the nearer and the farther half; of step 3, the
#: least energy of the measurements before; that before a line from a candidate, inf while it runs
#: along; by group of candidates, a bound of the energy with a line from any of them to the ends
#: behind the block at hand, and to those of the block; χ² of the block so far; by line, the rise of
#: χ² if it were one with the line before; of step 4, errors off a line, and the squares of their
#: second differences; and from `AHEAD` on, for both candidates that run along, the energies with a
#: line to the next measurements.
X, Y, RHO, TRIPLE, HALVES, ENERGY, BASE, BOUND, NOW, OWN, RISE, ERROR, SQUARE, AHEAD = range(14)
POINTS = 15
#: Of `beams`, by measurement: its beam; whether a break is before it; whether it is a spike; the
#: measurement at which the line that ends before it begins, or -1. By number: the candidates that
#: run along; first and last measurement of each cluster.
BEAM, BROKEN, SPIKE, ORIGIN, RUNNER, CLUSTER_FIRST, CLUSTER_LAST = range(7)
BEAMS = 7
#: Of a row of `pieces`, by surface: the line a x + b y = 1 [1/m]; its centroid, or the centre of an
#: arc [m]; root mean square [m]. Of a line: direction; the covariance of its offset at the centroid
#: and its angle; misfit [m]. Of an arc: radius [m]; six covariances of centre and radius; by how
#: much lines are worse.
A, B, CX, CY, RMS, UX, UY, OO, OA, AA, MISFIT = range(11)
RADIUS, XX, XY, XR, YY, YR, RR, GAIN = range(11, 19)
PIECES = 19
#: Of `spans`, by surface: its first and last measurement, how many of those count, what it is, the
#: number of its segment, whether there is a corner at its start and its end, and the kind of that
#: with the next surface.
FIRST, LAST, COUNT, KIND, SEGMENT, START, END, CORNER = range(8)
SPANS = 8
#: Kinds of surfaces.
LINE, ARC = 0, 1
#: Of `sums`, over all measurements before each one: weights w, times these coordinates.
WXX, WXY, WYY, WX, WY, W = range(6)
SUMS = 6
#: Of `noise`: the variance of a range that is constant, and what grows with its square; that of a
#: bearing.
CONSTANT, GROWTH, BEARING = range(3)
NOISE = 3


class Work(NamedTuple):
    """The arrays of one scan."""

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
