"""The constants of method `optimal`: each with its unit and what it means.

``docs/results.md`` has a table of what happens where one is halved or doubled. Lengths of the
world are `TAU`, `REACH`, `MOST_DEVIATION` and `ARC_RADIUS`; all else is in units of the noise, of
the beams, or a ratio.
"""

import math

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
#: A face that joins two lines is seen in half a beam at least, and at most in so many more than lie
#: between: its ends are half a beam off on either side, and so is the depth that was measured.
FACE_LEAST, FACE_MORE = 0.5, 3.0
#: Square of the width of a uniform distribution, over its variance.
UNIFORM = 12.0
