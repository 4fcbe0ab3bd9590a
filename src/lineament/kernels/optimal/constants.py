"""The constants of method `optimal`: each with its unit and what it means.

``docs/notebook.md`` says what happens where one of the first is halved or doubled. Lengths of the
world are `TAU`, `REACH`, `MOST_DEVIATION` and `ARC_RADIUS`; all else is in units of the noise, of
the beams, or a ratio.
"""

import math

import numpy as np

# What is a surface, and where one ends.

#: Scale of the surface [m]: what walls are off straight lines (plaster, panels, frames, bow).
TAU = 0.03
#: Price of a measurement that is on no surface, in units of the evidence for one.
CLUTTER = 0.5
#: Measurements of a line, at least.
LEAST = 4
#: Deviations beyond which two quantities differ.
SIGMAS = 3.0
#: Tangent of the steepest incidence at which a surface is expected to be seen (86°).
STEEPEST = 14.3
#: Cosine of the turn below which two lines may be one wall that bends (20°).
BEND = math.cos(math.radians(20.0))
#: Evidence, in units of that for a surface, against what buildings seldom have: a corner as
#: shallow as that, or a round wall that goes on as a straight one.
RARE = 8.0
#: Distance of a corner from the measurements on both its sides [m], at most.
REACH = 0.3
#: Standard deviation of a corner, and of the radius of an arc [m], at most; that of the noise is as
#: large at most, see `noise.MOST_SIGMA`.
MOST_DEVIATION = 0.1
#: Radius of an arc [m], at most, and the turn that it shows [rad], at least.
ARC_RADIUS, ARC_TURN = 1.5, 0.7
#: Price of an arc, in units of the evidence: it has three parameters where a line has two.
ARC_PRICE = 1.5
#: Measurements of a cluster, at least.
LEAST_CLUSTER = 3
#: Beams that see a face which joins two lines: at least, and at most more than lie between. About
#: as many as lie between: it begins and ends within a beam.
FACE_LEAST, FACE_MORE = 0.5, 3.0

# What is looked at at all: wider, these cost time and find hardly more.

#: Deviations of a step of the range, and of a measurement off a circle through three others, all of
#: which err.
STEP_SIGMAS = 2.0 * SIGMAS
#: Share of the turn of an arc that the chord of a run of lines shows, at least.
LEAST_CHORD = 0.5
#: Lines that a half circle of the largest radius is cut into: each is off by τ.
MOST_LINES = 8
#: Steps of Gauss and Newton from the algebraic circle, to see whether there is one and to fit it.
SEED_STEPS, ARC_STEPS = np.int64(1), np.int64(3)
#: Candidates that are evaluated at once, a power of two.
GROUP = 32
#: Candidates that run along. As many as in a `GROUP`, they change the time, not the result;
#: `_part_block` names both.
RUNNERS = 2

# How sure lines are.

#: Measurements whose errors are averaged to see whether neighbours are off alike.
TOGETHER = 4
#: Of overlapping second differences of their means, so many count as one.
OVERLAP = 3.4
#: Borders are looked for elsewhere as far as the odds are at least these, each time so many times
#: farther off.
LEAST_ODDS, FARTHER = 1e-6, 4
#: Of z deviations the odds Φ(-z) / Φ(z) are exp(-a z - b z³).
ODDS_A, ODDS_B = 1.6, 0.07

# Of numbers.

#: Determinant of a matrix over the product of its diagonal, up to which it is rounding: of
#: measurements on one beam; of the moments of measurements on one line, which are no circle.
SINGULAR, STRAIGHT = 1e-12, 1e-9
#: Square of the width of a uniform distribution, over its variance.
UNIFORM = 12.0
#: The largest whole number; infinity as a whole number.
LARGEST, BITS_OF_INFINITY = 2**63 - 1, 0x7FF0000000000000
