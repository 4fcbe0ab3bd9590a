"""Lines grown point by point along the clusters."""

import math

import numpy as np

from .. import helper, kernel
from ..layout import (
    BEFORE,
    CLASS_FIRST,
    CLASS_LAST,
    CLASSES,
    FIRST,
    LAST,
    PIECES,
    RESPONSE,
    RHO,
    X,
    Y,
)
from ..line_fit import normal_variance
from .stretches import line_of_sums


@kernel
def track_lines(floats, ints, counts, noise, threshold, noise_factor, max_misses, min_points):
    """Grow lines along the clusters of a scan.

    A line begins with three points. The next point is one of its points if the line predicts it:
    if it is no farther off than its noise and the line's own allow. The line is fitted anew with
    every point that it gains, and ends with the last of them where more than `max_misses` points
    in a row are not predicted; there the next line begins. A line of too few points is given up,
    and the search goes on at the point after its first.

    Parameters
    ----------
    floats, ints, counts
        See `layout`. The lines by point are read; those by piece are written, and PIECES. No
        pieces are joined: BEFORE is -1.
    noise : float64 array, shape (4,)
    threshold : float
        Distance from its line that a point without noise may have [m].
    noise_factor : float
        Standard deviations of the prediction that are added.
    max_misses : int
        Points in a row that a line passes over.
    min_points : int
        Points of the shortest piece, three or more.
    """
    x, y, rho, first, last = floats[X], floats[Y], floats[RHO], ints[FIRST], ints[LAST]
    n = np.int64(0)
    for c in range(counts[CLASSES]):
        begin, end = ints[CLASS_FIRST, c], ints[CLASS_LAST, c]
        while begin <= end:
            reached = _track(x, y, rho, begin, end, noise, threshold, noise_factor, max_misses)
            if reached - begin + 1 < min_points:
                begin += 1
                continue
            first[n], last[n] = begin, reached
            ints[BEFORE, n], floats[RESPONSE, n] = -1, math.nan
            n += 1
            begin = reached + 1
    counts[PIECES] = n


@helper
def _track(x, y, rho, first, last, noise, threshold, noise_factor, max_misses):
    """Grow a line from the point `first` on. Returns the last point that it gained."""
    # Sums about the first point, not the far origin, keep their digits.
    x0, y0 = x[first], y[first]
    n, end = np.int64(0), first
    sx, sy, sxx, sxy, syy = 0.0, 0.0, 0.0, 0.0, 0.0
    nx, ny, d, scatter = 0.0, 0.0, 0.0, 0.0
    for i in range(first, last + 1):
        dx, dy = x[i] - x0, y[i] - y0
        if n >= 3:
            variance = normal_variance(d, rho[i], noise)
            # Along the line from its centroid: the lever of the error of its direction.
            lever = nx * (dy - sy / n) - ny * (dx - sx / n)
            spread = lever * lever / scatter if scatter > 0.0 else 0.0
            deviation = math.sqrt(variance * (1.0 + 1.0 / n + spread))
            if abs(nx * x[i] + ny * y[i] - d) > threshold + noise_factor * deviation:
                if i - end > max_misses:
                    break
                continue
        n, end = n + 1, i
        sx += dx
        sy += dy
        sxx += dx * dx
        sxy += dx * dy
        syy += dy * dy
        nx, ny, d, squares = line_of_sums(x0, y0, n, sx, sy, sxx, sxy, syy)
        scatter = sxx + syy - (sx * sx + sy * sy) / n - squares
    return end
