"""Pieces that were found one by one, settled: merged, cut apart, joined at corners.

The merging is that of S. T. Pfister et al., *Weighted line fitting algorithms for mobile robot map
building and efficient data representation*, ICRA 2003: by the χ² of two lines and of one.
"""

import math

import numpy as np

from lineament.kernels import helper
from lineament.kernels import layout as at
from lineament.kernels.arrays import Floats1, Floats2, Ints2
from lineament.kernels.line_fit import normal_variance

from . import kernel
from .stretches import fill_moments, joint_line, stretch_line

#: Two pieces are one if a joint line costs less than this many variances of a point. χ² of two
#: degrees of freedom hardly ever is above 25, but pieces are chosen for being straight.
_SAME = 36.0
#: Points on either side of a cut that may go to the other piece.
_MARGIN = 20
#: Points without a piece over which neighbours are still merged or joined.
_BETWEEN = 3
#: Squares of distances that differ by less are the same [m²], or by this share of them: a vertex
#: lies on both its walls.
_ROUNDING, _ALIKE = 1e-12, 1e-9
#: Sine of the least angle at which lines meet in a corner (2.9°): below, the noise decides where.
_LEAST_SINE = 0.05


@kernel
def settle(
    floats: Floats2,
    ints: Ints2,
    noise: Floats1,
    epsilon: float,
    reach: float,
):
    """Merge, cut apart and join the pieces of a scan.

    Neighbours in a cluster are merged if one line fits both; else their border is put where both
    lines fit best; and where these meet within `reach`, there is a corner.

    From points, and the ends of pieces in beam order, which may overlap. The response of a corner
    is the sine of the angle at which the lines meet.

    Parameters
    ----------
    epsilon : float
        Misfit of surfaces [m].
    reach : float
        How many spacings the lines' intersection may lie from the ends of both pieces.
    """
    work = at.extended(floats, ints)
    pieces, counts = work.pieces, work.counts
    fill_moments(work)
    _merge(work, noise, epsilon)
    for _ in range(2):
        for k in range(1, counts[at.PIECES]):
            if _are_neighbours(work, k):
                _cut(work, k)
    _merge(work, noise, epsilon)
    n, count = counts[at.PIECES], counts[at.POINTS]
    is_ring = counts[at.CLOSED] != 0 and n > 1
    for _ in range(2 if is_ring else 0):
        _leave_opening(work, n)
    for k in range(n):
        pieces[at.BEFORE, k], work.response[k] = -1, math.nan
        if k > 0 and _are_neighbours(work, k):
            _join(work, k - 1, k, reach)
    # A closed cluster may have a corner where it was opened; its last point is its first again.
    if is_ring and pieces[at.FIRST, 0] + count - 1 - pieces[at.LAST, n - 1] <= _BETWEEN + 1:
        _join(work, n - 1, np.int64(0), reach)


@kernel
def merge_alike(
    floats: Floats2,
    ints: Ints2,
    noise: Floats1,
    epsilon: float,
):
    """Merge neighbours that one line fits; those that still touch meet in a corner.

    The second half of split-and-merge, and no more than that.
    """
    work = at.extended(floats, ints)
    fill_moments(work)
    _merge(work, noise, epsilon)
    for k in range(work.counts[at.PIECES]):
        work.pieces[at.BEFORE, k], work.response[k] = -1, math.nan
    for k in range(1, work.counts[at.PIECES]):
        if work.pieces[at.FIRST, k] == work.pieces[at.LAST, k - 1] and _are_neighbours(work, k):
            _join(work, k - 1, k, math.inf)


@kernel
def divide_overlaps(
    floats: Floats2,
    ints: Ints2,
):
    """Part two overlapping neighbours (Gao et al. 2018: each point goes to the nearer line)."""
    work = at.extended(floats, ints)
    fill_moments(work)
    for k in range(1, work.counts[at.PIECES]):
        if work.pieces[at.FIRST, k] <= work.pieces[at.LAST, k - 1]:
            _cut(work, k)


@helper
def _are_neighbours(work, k):
    """Whether a piece goes on, but for a few points, where the one before it ends."""
    first, last, label = work.pieces[at.FIRST, k], work.pieces[at.LAST, k - 1], work.marks[at.LABEL]
    return label[first] == label[last] and first - last <= _BETWEEN + 1


@helper
def _merge(work, noise, epsilon):
    """Merge neighbours that one line fits."""
    points = work.points
    first, last = work.pieces[at.FIRST], work.pieces[at.LAST]
    kept = np.int64(0)
    for k in range(work.counts[at.PIECES]):
        first[kept], last[kept] = first[k], last[k]
        if kept > 0 and _are_neighbours(work, kept):
            a, b, c, d = first[kept - 1], last[kept - 1], first[kept], last[kept]
            c = max(c, b + 1)
            if c > d:
                continue
            _, _, distance, both = joint_line(work, a, b, c, d)
            _, _, _, one = stretch_line(work, a, b)
            _, _, _, other = stretch_line(work, c, d)
            variance = normal_variance(distance, points[at.RHO, b], noise) + epsilon * epsilon
            if both - one - other <= _SAME * variance:
                last[kept - 1] = d
                continue
        kept += 1
    work.counts[at.PIECES] = kept


@helper
def _cut(work, k):
    """Move the border of a piece and the one before it to where the squares off both are least.

    Both lines are fitted anew for each border: those that a wrong border gave would keep it. Both
    keep three points if they can; points between them that had no piece get one. Each keeps two:
    where they have no more, they go on sharing one. The later may begin before the earlier does,
    where that has just been cut itself.
    """
    first, last = work.pieces[at.FIRST], work.pieces[at.LAST]
    a, b, c, d = first[k - 1], last[k - 1], first[k], last[k]
    near, far = max(min(b, c - 1), a + 1), min(max(b, c - 1), d - 2)
    low, high = max(near - _MARGIN, a + 2), min(far + _MARGIN, d - 3)
    if low > high:
        if max(c, near + 1) < d:
            last[k - 1], first[k] = near, max(c, near + 1)
        return
    least, border = math.inf, low
    for i in range(low, high + 1):
        _, _, _, before = stretch_line(work, a, i)
        _, _, _, after = stretch_line(work, i + 1, d)
        if before + after < (1.0 - _ALIKE) * least - _ROUNDING:
            least, border = before + after, i
    last[k - 1], first[k] = border, border + 1


@helper
def _leave_opening(work, n):
    """Leave out the ends of the first and the last piece of a closed cluster on the other's line.

    The cluster was opened at a measurement, a beam or two from the vertex; no piece goes over that.
    """
    first, last = work.pieces[at.FIRST], work.pieces[at.LAST]
    x, y = work.points[at.X], work.points[at.Y]
    a, b, c, d = first[n - 1], last[n - 1], first[0], last[0]
    n1x, n1y, d1, _ = stretch_line(work, a, b)
    n2x, n2y, d2, _ = stretch_line(work, c, d)
    while c < d - 2 and abs(n1x * x[c] + n1y * y[c] - d1) < abs(n2x * x[c] + n2y * y[c] - d2):
        c += 1
    while b > a + 2 and abs(n2x * x[b] + n2y * y[b] - d2) < abs(n1x * x[b] + n1y * y[b] - d1):
        b -= 1
    first[0], last[n - 1] = c, b


@helper
def _join(work, before, after, reach):
    """Join two pieces at a corner if their lines meet near their ends."""
    points, pieces = work.points, work.pieces
    x, y, b, c = points[at.X], points[at.Y], pieces[at.LAST, before], pieces[at.FIRST, after]
    n1x, n1y, d1, _ = stretch_line(work, pieces[at.FIRST, before], b)
    n2x, n2y, d2, _ = stretch_line(work, c, pieces[at.LAST, after])
    sine = n1x * n2y - n1y * n2x
    if abs(sine) < _LEAST_SINE:
        return
    px, py = (n2y * d1 - n1y * d2) / sine, (n1x * d2 - n2x * d1) / sine
    spacing = max(_distance(x, y, b - 1, b), _distance(x, y, b, c), _distance(x, y, c, c + 1))
    ends = max(math.hypot(px - x[b], py - y[b]), math.hypot(px - x[c], py - y[c]))
    if ends <= reach * spacing:
        pieces[at.BEFORE, after], work.response[after] = before, abs(sine)


@helper
def _distance(x, y, i, j):
    return math.hypot(x[j] - x[i], y[j] - y[i])
