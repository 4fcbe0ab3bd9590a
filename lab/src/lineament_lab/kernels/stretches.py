"""Lines through stretches of consecutive points, in O(1) by running sums, and runs near a line.

Orthogonal least squares, as K. Pearson, *On lines and planes of closest fit to systems of points in
space*, Philosophical Magazine 2 (1901). What Hough transform, RANSAC and region growing share.
"""

import math

import numpy as np

from lineament.kernels import helper
from lineament.kernels import layout as at
from lineament.kernels.line_fit import range_variance


@helper
def fill_moments(work):
    """Sum x, y, xx, xy, yy over the points of a cluster before each of its points.

    About the first point of the cluster, not the far origin, so that they keep their digits; the
    last two columns are that point.
    """
    x, y, label, moments = work.points[at.X], work.points[at.Y], work.marks[at.LABEL], work.moments
    x0, y0 = 0.0, 0.0
    sx, sy, sxx, sxy, syy = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(work.counts[at.POINTS]):
        if i == 0 or label[i] != label[i - 1]:
            x0, y0 = x[i], y[i]
            sx, sy, sxx, sxy, syy = 0.0, 0.0, 0.0, 0.0, 0.0
        moments[i, 0], moments[i, 1] = sx, sy
        moments[i, 2], moments[i, 3], moments[i, 4] = sxx, sxy, syy
        moments[i, 5], moments[i, 6] = x0, y0
        dx, dy = x[i] - x0, y[i] - y0
        sx += dx
        sy += dy
        sxx += dx * dx
        sxy += dx * dy
        syy += dy * dy


@helper
def prepare(work, noise, epsilon, sigmas):
    """Fill the moments, and how far each point may lie from its line: ``slack + slope |d|``.

    The noise of a range moves a point by σ_r cos ψ = σ_r |d|/ρ off a line at distance d; `sigmas`
    times that, as much of the bearing's, and the misfit `epsilon` [m] are allowed. All points are
    free.
    """
    fill_moments(work)
    rho, slack, slope = work.points[at.RHO], work.points[at.SLACK], work.points[at.SLOPE]
    for i in range(work.counts[at.POINTS]):
        slack[i] = epsilon + sigmas * noise[2] * rho[i]
        slope[i] = sigmas * math.sqrt(range_variance(rho[i], noise)) / rho[i]
        work.marks[at.FREE, i] = 1


@helper
def _sums(work, first, last):
    """Return the sums over the points `first`..`last` (inclusive) of one cluster."""
    a, b = work.moments[first], work.moments[last]
    dx, dy = work.points[at.X, last] - b[5], work.points[at.Y, last] - b[6]
    return (
        b[0] - a[0] + dx,
        b[1] - a[1] + dy,
        b[2] - a[2] + dx * dx,
        b[3] - a[3] + dx * dy,
        b[4] - a[4] + dy * dy,
    )


@helper
def line_of_sums(x0, y0, n, sx, sy, sxx, sxy, syy):
    """Line n · p = d of least squares of orthogonal distances, from sums about (x0, y0).

    Returns nx, ny, d [m] and the sum of the squared distances [m²].
    """
    mx, my = sx / n, sy / n
    sxx -= sx * mx
    sxy -= sx * my
    syy -= sy * my
    half = 0.5 * (sxx - syy)
    root = math.sqrt(half * half + sxy * sxy)
    # Eigenvector of the lesser eigenvalue, in that of its two forms which cancels nothing.
    if half > 0.0:
        nx, ny = -sxy, half + root
    else:
        nx, ny = root - half, -sxy
    norm = math.sqrt(nx * nx + ny * ny)
    if norm > 0.0:
        nx, ny = nx / norm, ny / norm
    else:
        nx, ny = 1.0, 0.0
    d = nx * (x0 + mx) + ny * (y0 + my)
    return nx, ny, d, max(0.5 * (sxx + syy) - root, 0.0)


@helper
def stretch_line(work, first, last):
    """Line through the points `first`..`last` (inclusive) of one cluster, as `line_of_sums`."""
    sx, sy, sxx, sxy, syy = _sums(work, first, last)
    x0, y0 = work.moments[first, 5], work.moments[first, 6]
    return line_of_sums(x0, y0, last - first + 1, sx, sy, sxx, sxy, syy)


@helper
def joint_line(work, first, last, other_first, other_last):
    """Line through two stretches of one cluster, without the points between."""
    ax, ay, axx, axy, ayy = _sums(work, first, last)
    bx, by, bxx, bxy, byy = _sums(work, other_first, other_last)
    n = last - first + 1 + other_last - other_first + 1
    x0, y0 = work.moments[first, 5], work.moments[first, 6]
    return line_of_sums(x0, y0, n, ax + bx, ay + by, axx + bxx, axy + bxy, ayy + byy)


@helper
def longest_run(points, free, first, last, line, margin, max_misses):
    """Find the run of free points near a line n · p = d that has the most of them.

    A run ends at a point that is not free, or where more than `max_misses` points in a row are
    farther from the line than their tolerance and `margin` allow. Returns the number of near
    points, and the first and last of them (0, -1, -1 where there are none).
    """
    x, y, slack, slope = points[at.X], points[at.Y], points[at.SLACK], points[at.SLOPE]
    nx, ny, d = line
    best, best_begin, best_end = np.int64(0), np.int64(-1), np.int64(-1)
    near, begin, end, distance = np.int64(0), first, first, abs(d)
    for i in range(first, last + 1):
        if not free[i] or (near > 0 and i - end > max_misses + 1):
            near = np.int64(0)
        if free[i] and abs(nx * x[i] + ny * y[i] - d) <= slack[i] + slope[i] * distance + margin:
            begin = i if near == 0 else begin
            near, end = near + 1, i
            if near > best:
                best, best_begin, best_end = near, begin, end
    return best, best_begin, best_end


@helper
def refined_run(work, first, last, line, margin, max_misses, passes):
    """Find the longest run near a line; fit a line to it, and find that line's, again and again.

    `margin` is for the first line only, which may be a coarse one. Returns as `longest_run`.
    """
    points, free = work.points, work.marks[at.FREE]
    near, a, b = longest_run(points, free, first, last, line, margin, max_misses)
    for _ in range(passes):
        if near < 3:
            break
        nx, ny, d, _ = stretch_line(work, a, b)
        near, a, b = longest_run(points, free, first, last, (nx, ny, d), 0.0, max_misses)
    return near, a, b


@helper
def is_piece(points, near, first, last, min_points, min_length):
    """Whether a run has enough near points, and is long enough."""
    dx, dy = points[at.X, last] - points[at.X, first], points[at.Y, last] - points[at.Y, first]
    return near >= min_points and math.hypot(dx, dy) >= min_length


@helper
def take_run(work, begin, end):
    """Add a run to the pieces, which stay in beam order, and take its points."""
    first, last, k = work.pieces[at.FIRST], work.pieces[at.LAST], work.counts[at.PIECES]
    for i in range(begin, end + 1):
        work.marks[at.FREE, i] = 0
    while k > 0 and first[k - 1] > begin:
        first[k], last[k] = first[k - 1], last[k - 1]
        k -= 1
    first[k], last[k] = begin, end
    work.counts[at.PIECES] += 1
