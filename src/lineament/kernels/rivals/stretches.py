"""Lines through stretches of consecutive points by running sums, each in O(1)."""

import math

from .. import helper
from ..line_fit import range_variance

#: Columns of the moments of a point.
MOMENTS = 7


@helper
def fill_moments(x, y, label, count, moments):
    """Sum x, y, xx, xy, yy over the points of a class before each of its points.

    About the first point of the class, not the far origin, so that they keep their digits; the
    last two columns are that point.
    """
    x0, y0 = 0.0, 0.0
    sx, sy, sxx, sxy, syy = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(count):
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
def stretch_sums(x, y, moments, first, last):
    """Take the sums over the points `first`..`last` (inclusive) of one class."""
    a, b = moments[first], moments[last]
    dx, dy = x[last] - b[5], y[last] - b[6]
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

    Returns
    -------
    nx, ny, d : float
        Unit normal, and distance of the sensor from the line along it [m].
    squares : float
        Sum of the squared distances [m²].
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
def stretch_line(x, y, moments, first, last):
    """Line through the points `first`..`last` (inclusive) of one class, as of `line_of_sums`."""
    sx, sy, sxx, sxy, syy = stretch_sums(x, y, moments, first, last)
    x0, y0 = moments[first, 5], moments[first, 6]
    return line_of_sums(x0, y0, last - first + 1, sx, sy, sxx, sxy, syy)


@helper
def joint_line(x, y, moments, first, last, other_first, other_last):
    """Line through two stretches of one class, without the points between."""
    ax, ay, axx, axy, ayy = stretch_sums(x, y, moments, first, last)
    bx, by, bxx, bxy, byy = stretch_sums(x, y, moments, other_first, other_last)
    n = last - first + 1 + other_last - other_first + 1
    x0, y0 = moments[first, 5], moments[first, 6]
    return line_of_sums(x0, y0, n, ax + bx, ay + by, axx + bxx, axy + bxy, ayy + byy)


@helper
def fill_tolerances(rho, count, noise, epsilon, sigmas, slack, slope):
    """Prepare how far each point may lie from its line: ``slack + slope |d|``.

    The noise of a range moves a point by σ_r cos ψ = σ_r |d|/ρ off a line at distance d; `sigmas`
    times that, as much of the bearing's, and the unevenness `epsilon` [m] are allowed.
    """
    for i in range(count):
        slack[i] = epsilon + sigmas * noise[2] * rho[i]
        slope[i] = sigmas * math.sqrt(range_variance(rho[i], noise)) / rho[i]
