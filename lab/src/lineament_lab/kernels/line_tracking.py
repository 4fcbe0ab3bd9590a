"""Lines grown point by point along the clusters.

V. Nguyen et al., *A comparison of line extraction algorithms using 2D range data for indoor mobile
robotics* (2007), the "incremental" algorithm; A. Siadat et al. (1997).
"""

import math

import numpy as np

from lineament.kernels import helper
from lineament.kernels import layout as at
from lineament.kernels.arrays import Floats1, Floats2, Ints2
from lineament.kernels.line_fit import normal_variance

from . import kernel
from .stretches import line_of_sums


@kernel
def track_lines(
    floats: Floats2,
    ints: Ints2,
    noise: Floats1,
    threshold: float,
    noise_factor: float,
    max_misses: int,
    min_points: int,
):
    """Grow lines along the clusters of a scan.

    A line begins with three points. The next point is one of its points if the line predicts it:
    if it is no farther off than its noise and the line's own allow. The line is fitted again with
    every point that it gains, and ends with the last of them where more than `max_misses` points
    in a row are not predicted; there the next line begins. A line of too few points is given up,
    and the search goes on at the point after its first.

    From points and clusters, the ends of pieces.

    Parameters
    ----------
    threshold : float
        Distance from its line that a point without noise may have [m].
    noise_factor : float
        Standard deviations of the prediction that are added.
    max_misses : int
        Points in a row that a line passes over.
    min_points : int
        Points of the shortest piece, three or more.
    """
    work = at.named(floats, ints)
    n = np.int64(0)
    for c in range(work.counts[at.CLUSTERS]):
        begin, end = work.clusters[at.FIRST, c], work.clusters[at.LAST, c]
        while begin <= end:
            reached = _track(work.points, begin, end, noise, threshold, noise_factor, max_misses)
            if reached - begin + 1 < min_points:
                begin += 1
                continue
            work.pieces[at.FIRST, n], work.pieces[at.LAST, n] = begin, reached
            n += 1
            begin = reached + 1
    work.counts[at.PIECES] = n


@helper
def _track(points, first, last, noise, threshold, noise_factor, max_misses):
    """Grow a line from the point `first` on. Returns the last point that it gained."""
    x, y, rho = points[at.X], points[at.Y], points[at.RHO]
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
