"""The lines of a block: where its kernels keep what they pass on to each other.

A block of m scans of n beams is ``floats`` (m, FLOATS, n + 1), ``ints`` (m, INTS, n + 1) and
``counts`` (m, COUNTS): a row for each scan, in it a line for each quantity. Two arrays and not
twenty: numba takes a fifth of a microsecond to pass one.
"""

# Lines of floats, by beam.
RANGE = 0  # as measured [m]
FILTERED = 1  # that the partition is made on [m]; NaN where not usable
# By point, in beam order. On a full circle the points may begin at any beam, so that no class is
# torn by the seam; where all are one class (CLOSED), the first point stands again at the end.
X, Y, RHO = 2, 3, 4  # on which the partition is made [m]
RESPONSE = 5  # by piece: of the corner at its first point
# By usable beam, not turned: of the first, over the seam.
SPACING, DISTANCE_THRESHOLD, DENSITY_THRESHOLD = 6, 7, 8  # [m]
# By candidate, in the order of examination.
CHORD_DISTANCE, CANDIDATE_RESPONSE = 9, 10
FLOATS = 11

# Lines of ints, by point.
BEAM, LABEL = 0, 1  # beam; class, -1 for noise
# By piece: first and last point (a corner belongs to both its pieces), and the piece that a corner
# at its first point joins it to, or -1.
FIRST, LAST, BEFORE = 2, 3, 4
CANDIDATE = 5  # by candidate: its point
INTS = 6

# Counts.
POINTS, CLOSED, PIECES, CANDIDATES = 0, 1, 2, 3
COUNTS = 4

# Lines of scratch, shared by all rows: what is measured, by point.
MEASURED_X, MEASURED_Y, MEASURED_RHO, SPARE = 0, 1, 2, 3
SCRATCH = 4
