"""Pieces that were found one by one, settled: merged, cut apart, joined at corners."""

import math

import numpy as np

from .. import helper, kernel
from ..layout import BEFORE, CLOSED, FIRST, LABEL, LAST, PIECES, POINTS, RESPONSE, RHO, X, Y
from ..line_fit import normal_variance
from .stretches import fill_moments, joint_line, stretch_line

#: Two pieces are one if a joint line costs less than this many variances of a point. χ² of two
#: degrees of freedom hardly ever is above 25, but pieces are chosen for being straight.
_SAME = 36.0
#: Points on either side of a cut that may go to the other piece.
_MARGIN = 20
#: Points without a piece over which neighbours are still merged or joined.
_BETWEEN = 3
#: Squares of distances that differ by less are the same [m²]: a vertex lies on both its walls.
_ROUNDING = 1e-12
#: Sine of the least angle at which lines meet in a corner (2.9°): below, the noise decides where.
_LEAST_SINE = 0.05


@kernel
def settle(floats, ints, counts, noise, epsilon, reach, moments):
    """Merge, cut apart and join the pieces of a scan.

    Neighbours in a class are merged if one line fits both; else each point about their border goes
    to the nearer line, so far as the beams' order allows; and where their lines meet within
    `reach`, there is a corner.

    Parameters
    ----------
    floats, ints, counts
        See `layout`. The lines by point and pieces in beam order (FIRST, LAST, PIECES), that may
        overlap, are read; the lines by piece and PIECES are written. RESPONSE is the sine of the
        angle at which the lines meet.
    noise : float64 array, shape (4,)
    epsilon : float
        Unevenness of surfaces [m].
    reach : float
        How many spacings the lines' intersection may lie from the ends of both pieces.
    moments : float64 array, shape (n + 1, MOMENTS)
        Scratch.
    """
    x, y, rho, label = floats[X], floats[Y], floats[RHO], ints[LABEL]
    first, last = ints[FIRST], ints[LAST]
    fill_moments(x, y, label, counts[POINTS], moments)
    n = counts[PIECES]
    n = merge(x, y, rho, label, moments, noise, epsilon, first, last, n)
    for _ in range(2):
        for k in range(1, n):
            if _are_neighbours(label, first, last, k):
                cut(x, y, moments, first, last, k)
    n = merge(x, y, rho, label, moments, noise, epsilon, first, last, n)
    before, response = ints[BEFORE], floats[RESPONSE]
    is_ring = counts[CLOSED] != 0 and n > 1
    for _ in range(2 if is_ring else 0):
        _leave_opening(x, y, moments, first, last, n)
    join(x, y, label, moments, reach, first, last, n, before, response)
    if is_ring:
        count = counts[POINTS]
        _join_around(x, y, moments, reach, count, first, last, n, before, response)
    counts[PIECES] = n


@helper
def _are_neighbours(label, first, last, k):
    """Whether a piece goes on, but for a few points, where the one before it ends."""
    return label[first[k]] == label[last[k - 1]] and first[k] - last[k - 1] <= _BETWEEN + 1


@helper
def merge(x, y, rho, label, moments, noise, epsilon, first, last, n):
    """Merge neighbours that one line fits. Returns the number of pieces that are left."""
    kept = np.int64(0)
    for k in range(n):
        first[kept], last[kept] = first[k], last[k]
        if kept > 0 and _are_neighbours(label, first, last, kept):
            a, b, c, d = first[kept - 1], last[kept - 1], first[kept], last[kept]
            c = max(c, b + 1)
            _, _, distance, both = joint_line(x, y, moments, a, b, c, d)
            _, _, _, one = stretch_line(x, y, moments, a, b)
            _, _, _, other = stretch_line(x, y, moments, c, d)
            variance = normal_variance(distance, rho[b], noise) + epsilon * epsilon
            if both - one - other <= _SAME * variance:
                last[kept - 1] = d
                continue
        kept += 1
    return kept


@helper
def cut(x, y, moments, first, last, k):
    """Move the border of a piece and the one before it to where least squares to both lines are.

    Both keep three points if they can; points between them that had no piece get one. The later
    may begin before the earlier does, where that has just been cut itself.
    """
    a, b, c, d = first[k - 1], last[k - 1], first[k], last[k]
    near, far = max(min(b, c - 1), a + 1), max(b, c - 1)
    low, high = max(near - _MARGIN, a + 2), min(far + _MARGIN, d - 3)
    if low > high:
        last[k - 1], first[k] = near, max(c, near + 1)
        return
    n1x, n1y, d1, _ = stretch_line(x, y, moments, a, near)
    n2x, n2y, d2, _ = stretch_line(x, y, moments, far + 1, d)
    total, least, border = 0.0, 0.0, low
    for i in range(low + 1, high + 1):
        e1, e2 = n1x * x[i] + n1y * y[i] - d1, n2x * x[i] + n2y * y[i] - d2
        total += e1 * e1 - e2 * e2
        if total < least - _ROUNDING:
            least, border = total, i
    last[k - 1], first[k] = border, border + 1


@helper
def join(x, y, label, moments, reach, first, last, n, before, response):
    """Find the corners between neighbours."""
    for k in range(n):
        before[k], response[k] = -1, math.nan
        if k > 0 and _are_neighbours(label, first, last, k):
            sine = _meet(x, y, moments, reach, first[k - 1], last[k - 1], first[k], last[k])
            if sine > 0.0:
                before[k], response[k] = k - 1, sine


@helper
def _leave_opening(x, y, moments, first, last, n):
    """Leave out the ends of the first and the last piece of a closed class on the other's line.

    The class was opened at a reading, a beam or two from the vertex; no piece goes over that.
    """
    a, b, c, d = first[n - 1], last[n - 1], first[0], last[0]
    n1x, n1y, d1, _ = stretch_line(x, y, moments, a, b)
    n2x, n2y, d2, _ = stretch_line(x, y, moments, c, d)
    while c < d - 2 and abs(n1x * x[c] + n1y * y[c] - d1) < abs(n2x * x[c] + n2y * y[c] - d2):
        c += 1
    while b > a + 2 and abs(n2x * x[b] + n2y * y[b] - d2) < abs(n1x * x[b] + n1y * y[b] - d1):
        b -= 1
    first[0], last[n - 1] = c, b


@helper
def _join_around(x, y, moments, reach, count, first, last, n, before, response):
    """Find the corner at which a closed class was opened; its last point is its first again."""
    if first[0] + count - 1 - last[n - 1] <= _BETWEEN + 1:
        sine = _meet(x, y, moments, reach, first[n - 1], last[n - 1], first[0], last[0])
        if sine > 0.0:
            before[0], response[0] = n - 1, sine


@helper
def _meet(x, y, moments, reach, a, b, c, d):
    """Sine of the angle at which the lines of two pieces meet; 0 if not near their ends."""
    n1x, n1y, d1, _ = stretch_line(x, y, moments, a, b)
    n2x, n2y, d2, _ = stretch_line(x, y, moments, c, d)
    sine = n1x * n2y - n1y * n2x
    if abs(sine) < _LEAST_SINE:
        return 0.0
    px, py = (n2y * d1 - n1y * d2) / sine, (n1x * d2 - n2x * d1) / sine
    spacing = max(_distance(x, y, b - 1, b), _distance(x, y, b, c), _distance(x, y, c, c + 1))
    ends = max(math.hypot(px - x[b], py - y[b]), math.hypot(px - x[c], py - y[c]))
    return abs(sine) if ends <= reach * spacing else 0.0


@helper
def _distance(x, y, i, j):
    return math.hypot(x[j] - x[i], y[j] - y[i])
