"""Step 4: lines by maximum likelihood on the raw ranges, and how sure they are."""

import math

from .. import helper, inlined, sums
from ..line_fit import GRAZING, direction_along_beams, second_order
from ..noise import LEAST_SIGMA, expected_variance
from . import layout as at
from .borders import soften_borders
from .constants import LEAST, OVERLAP, SIGMAS, TAU, TOGETHER
from .costs import solve
from .geometry import along, surface_variance


@inlined
def measure(work, surfaces, estimated, evidence):
    """Fit the lines, with their covariances. Returns how many surfaces are left.

    A line whose centroid is not between its ends, or that is shorter than the spacing of its
    beams, runs along them, and is left out; so is one that too few measurements are near.
    """
    spans, pieces, kept = work.spans, work.pieces, 0
    x, y, rho = work.points[at.X], work.points[at.Y], work.points[at.RHO]
    for k in range(surfaces):
        first, last, p = spans[at.FIRST, k], spans[at.LAST, k], pieces[kept]
        for row in (at.FIRST, at.LAST, at.KIND, at.COUNT):
            spans[row, kept] = spans[row, k]
        if spans[at.KIND, k] == at.LINE:
            first, last, count = _fit_between(work, first, last, p)
            spans[at.FIRST, kept], spans[at.LAST, kept], spans[at.COUNT, kept] = first, last, count
            begins, ends = along(p, x[first], y[first]), along(p, x[last], y[last])
            spacing = abs(x[first] * y[first + 1] - y[first] * x[first + 1]) / rho[first]
            long = begins < 0.0 < ends and ends - begins > spacing
            if not (long and count > 1 and last - first + 1 >= LEAST):
                continue
        else:
            for i in range(at.PIECES):
                p[i] = pieces[k, i]
        kept += 1
    if estimated:
        scale = _scatter_of_means(work, kept)
        for k in range(kept):
            if spans[at.KIND, k] == at.LINE:
                pieces[k, at.OO] *= scale
                pieces[k, at.AA] *= scale
    soften_borders(work, kept, evidence)
    for k in range(kept):
        _to_second_order(spans, pieces[k], k)
    return kept


@helper
def _to_second_order(spans, p, k):
    """Raise the covariance of a line to what its errors are where these are not small."""
    if spans[at.KIND, k] == at.LINE:
        first_order = p[at.OO], p[at.OA], p[at.AA]
        p[at.OO], p[at.OA], p[at.AA] = second_order(
            first_order, p[at.CX], p[at.CY], p[at.UX], p[at.UY]
        )


@inlined
def _fit_between(work, first, last, piece):
    """Fit a line that ends where it was measured. Returns its ends, and how many count.

    A wall that bends may end beside the line, where it does not count.
    """
    points, noise, begins, ends, count = work.points, work.noise, last, first, 0.0
    while begins != first or ends != last:
        begins, ends = first, last
        a, b = solve(work.sums, first, last + 1)
        count = fit_line(points, first, last + 1, a, b, noise, piece)
        while first < last and not _is_near(points, first, noise, piece):
            first += 1
        while first < last and not _is_near(points, last, noise, piece):
            last -= 1
    return first, last, count


@helper
def _is_near(points, i, noise, piece):
    """Whether a line passes a measurement as near as by chance, at the scale of the surface."""
    dx, dy = points[at.X, i] - piece[at.CX], points[at.Y, i] - piece[at.CY]
    off = piece[at.UX] * dy - piece[at.UY] * dx
    return off * off <= SIGMAS * SIGMAS * surface_variance(points, i, noise)


@sums
def fit_line(points, first, end, a, b, noise, piece):
    """Fit a line to the measurements first … end - 1, from the line a x + b y = 1.

    By maximum likelihood, with the variance σ² cos² ψ + ρ² σ_φ² sin² ψ along the normal (Pfister,
    Roumeliotis, Burdick, ICRA 2003); what is off by more than chance at the scale of the surface
    does not count. The covariance is that of the noise alone. Returns how many count.
    """
    x, y, rho = points[at.X, first:end], points[at.Y, first:end], points[at.RHO, first:end]
    constant, growth, bearing = noise[at.CONSTANT], noise[at.GROWTH], noise[at.BEARING]
    norm = math.sqrt(a * a + b * b)
    distance, nx, ny, x0, y0 = 1.0 / norm, a / norm, b / norm, x[0], y[0]
    total, sx, sy, sxx, sxy, syy, used = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(x)):
        across, square = nx * x[i] + ny * y[i], rho[i] * rho[i]
        # The variance and its scale times ρ², so that one number is divided.
        off, near = across - distance, max(across * across, GRAZING * square)
        spread = (constant + growth * square) * near + bearing * square * (square - near)
        counts = off * off * square <= SIGMAS * SIGMAS * (spread + TAU * TAU * near)
        w, dx, dy = square / spread if counts else 0.0, x[i] - x0, y[i] - y0
        total, sx, sy = total + w, sx + w * dx, sy + w * dy
        sxx, sxy, syy = sxx + w * dx * dx, sxy + w * dx * dy, syy + w * dy * dy
        used += 1.0 if counts else 0.0
    sxx, sxy, syy = sxx - sx * sx / total, sxy - sx * sy / total, syy - sy * sy / total
    cx, cy = x0 + sx / total, y0 + sy / total
    ux, uy = direction_along_beams(sxx, sxy, syy, cx, cy)
    if ux * (x[len(x) - 1] - x0) + uy * (y[len(y) - 1] - y0) < 0.0:
        ux, uy = -ux, -uy
    lengthwise = ux * ux * sxx + 2.0 * ux * uy * sxy + uy * uy * syy
    mean_square = max(sxx + syy - lengthwise, 0.0) / total
    distance = ux * cy - uy * cx
    piece[at.A], piece[at.B], piece[at.CX], piece[at.CY] = a, b, cx, cy
    if abs(distance) > 0.0:
        piece[at.A], piece[at.B] = -uy / distance, ux / distance
    piece[at.UX], piece[at.UY] = ux, uy
    piece[at.OO], piece[at.OA], piece[at.AA] = 1.0 / total, 0.0, 1.0 / lengthwise
    piece[at.RMS] = math.sqrt(mean_square)
    piece[at.MISFIT] = math.sqrt(max(mean_square - (used - 2.0) / total, 0.0))
    return used


@inlined
def _scatter_of_means(work, surfaces):
    """Variance of the mean of neighbouring measurements, over that of as many independent ones.

    Scanners smooth their ranges, so that neighbours are off alike. It is 1 for white noise, and
    taken from second differences of means of four, which a wall that bows does not change. Where
    most lines are too short for these, the others may be corners that pass for lines.
    """
    points, pieces, squares, used = work.points, work.pieces, work.points[at.SQUARE], 0
    long, short = 0, 0
    for k in range(surfaces):
        first, end = work.spans[at.FIRST, k], work.spans[at.LAST, k] + 1
        if work.spans[at.KIND, k] != at.LINE:
            continue
        if end - first < 3 * TOGETHER:
            short += end - first
        else:
            long += end - first
            a, b, error = pieces[k, at.A], pieces[k, at.B], points[at.ERROR]
            _second_differences(points, first, end, a, b, work.noise, error, squares[used:])
            used += end - first + 1 - 3 * TOGETHER
    if long <= short:
        return 1.0
    mean = _mean_within(squares, used, math.inf)
    mean = _mean_within(squares, used, SIGMAS * SIGMAS * mean)
    mean, _ = expected_variance(mean, used / OVERLAP, 1.0)
    # Nothing is known better than the best scanner measures it.
    return max(mean, LEAST_SIGMA * LEAST_SIGMA / work.noise[at.CONSTANT])


@sums
def _mean_within(squares, count, limit):
    """Return the mean of those of the first `count` squares that are within a limit."""
    total, kept = 0.0, 0.0
    for i in range(count):
        within = squares[i] <= limit
        total += squares[i] if within else 0.0
        kept += 1.0 if within else 0.0
    return total / kept


@sums
def _second_differences(points, first, end, a, b, noise, error, squares):
    """Square the second differences of means of four errors, in units of those of white noise."""
    x, y, rho = points[at.X, first:end], points[at.Y, first:end], points[at.RHO, first:end]
    constant, growth = noise[at.CONSTANT], noise[at.GROWTH]
    for i in range(len(x)):
        across, deviation = a * x[i] + b * y[i], math.sqrt(constant + growth * rho[i] * rho[i])
        error[i] = rho[i] * (across - 1.0) / (across * deviation)
    # In place: the sum of four from each one on.
    error1, error2, error3 = error[1:], error[2:], error[3:]
    for i in range(len(x) + 1 - TOGETHER):
        error[i] = error[i] + error1[i] + error2[i] + error3[i]
    second, third = error[TOGETHER:], error[2 * TOGETHER :]
    for i in range(len(x) + 1 - 3 * TOGETHER):
        difference = error[i] - 2.0 * second[i] + third[i]
        squares[i] = difference * difference / (6.0 * TOGETHER)
