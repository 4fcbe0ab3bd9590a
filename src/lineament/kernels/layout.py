"""The lines of a scan's workspace: where the kernels keep what they pass on to each other.

The workspace of a scan of n beams is ``floats`` (FLOATS, n + 1), ``ints`` (INTS, n + 1) and
``counts`` (COUNTS,): a line for each quantity. Three arrays and not twenty: numba takes a fifth of
a microsecond to pass one. Scans take turns in it, so that it stays in the nearest cache.
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
# By point: what is measured [m].
MEASURED_X, MEASURED_Y, MEASURED_RHO = 11, 12, 13
SPARE = 14  # for whoever needs it, until the next
# By piece of a map: pivot, right side and cross term of its normal equations, and the inverse range
# of the line before each vertex and after it [1/m].
PIVOT, RIGHT, CROSS, U_BEFORE, U_AFTER = 15, 16, 17, 18, 19
FLOATS = 20

# Lines of ints, by point.
BEAM, LABEL = 0, 1  # beam; class, -1 for noise
# By class: first and last point.
CLASS_FIRST, CLASS_LAST = 2, 3
# By piece: first and last point (a corner belongs to both its pieces), and the piece that a corner
# at its first point joins it to, or -1.
FIRST, LAST, BEFORE = 4, 5, 6
CANDIDATE = 7  # by candidate: its point
STACK_FIRST, STACK_LAST = 8, 9  # by piece that waits for its search: first and last point
INTS = 10

# Counts.
POINTS, CLOSED, CLASSES, PIECES, CANDIDATES = 0, 1, 2, 3, 4
COUNTS = 5
