"""Step 4: lines by maximum likelihood on the raw ranges, and how sure they are."""

import math

from .. import helper, sums
from ..line_fit import TOTAL, direction
from ..noise import LEAST_SIGMA
from .constants import SIGMAS, TAU
from .layout import (
    AA, A, B, BROKEN, CX, CY, FIRST, KEY, KIND, LAST, LINE, MISFIT, OA, OO, RHO, RMS,
    SCRATCH, UX, UY, X, Y,
)  # fmt: skip
from .partition import solve

#: Measurements whose errors are averaged to see whether neighbours are off alike.
_TOGETHER = 4
#: Deviation of what lies anywhere between two measurements, in their spacing.
_WITHIN = 0.5 / math.sqrt(12.0)


@sums
def fit_line(points, first, end, a, b, noise, piece):
    """Fit a line to the measurements first … end - 1, from the line a x + b y = 1.

    By maximum likelihood, with the variance σ² cos² ψ + ρ² σ_φ² sin² ψ along the normal (Pfister,
    Roumeliotis, Burdick, ICRA 2003); what is off by more than chance at the scale of the surface
    does not count. The covariance is that of the noise alone. Returns how many count.
    """
    x, y, rho = points[X, first:end], points[Y, first:end], points[RHO, first:end]
    constant, growth, bearing = noise[0], noise[1], noise[2]
    norm = math.sqrt(a * a + b * b)
    distance, nx, ny, x0, y0 = 1.0 / norm, a / norm, b / norm, x[0], y[0]
    total, sx, sy, sxx, sxy, syy, own, used = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(x)):
        across, square = nx * x[i] + ny * y[i], rho[i] * rho[i]
        off, share = across - distance, max(across * across / square, 1e-6)
        variance = (constant + growth * square) * share + bearing * square * (1.0 - share)
        counts = off * off <= SIGMAS * SIGMAS * (variance + TAU * TAU * share)
        w, dx, dy = 1.0 / variance if counts else 0.0, x[i] - x0, y[i] - y0
        total, sx, sy = total + w, sx + w * dx, sy + w * dy
        sxx, sxy, syy = sxx + w * dx * dx, sxy + w * dx * dy, syy + w * dy * dy
        own, used = own + w * variance, used + (1.0 if counts else 0.0)
    sxx, sxy, syy = sxx - sx * sx / total, sxy - sx * sy / total, syy - sy * sy / total
    ux, uy = direction(sxx, sxy, syy, TOTAL)
    if ux * (x[-1] - x0) + uy * (y[-1] - y0) < 0.0:
        ux, uy = -ux, -uy
    cx, cy = x0 + sx / total, y0 + sy / total
    along = ux * ux * sxx + 2.0 * ux * uy * sxy + uy * uy * syy
    mean_square = max(sxx + syy - along, 0.0) / total
    distance = ux * cy - uy * cx
    piece[A], piece[B], piece[CX], piece[CY] = a, b, cx, cy
    if abs(distance) > 0.0:
        piece[A], piece[B] = -uy / distance, ux / distance
    piece[UX], piece[UY] = ux, uy
    piece[OO], piece[OA], piece[AA] = 1.0 / total, 0.0, 1.0 / along
    piece[RMS] = math.sqrt(mean_square)
    piece[MISFIT] = math.sqrt(max(mean_square - (used - 2.0) / total, 0.0))
    return used


@helper
def scatter_of_means(points, spans, pieces, surfaces, noise):
    """Variance of the mean of neighbouring measurements, over that of as many independent ones.

    Scanners smooth their ranges, so that neighbours are off alike. It is 1 for white noise, and
    taken from second differences of means of four, which a wall that bows does not change.
    """
    squares, used = points[KEY], 0
    for k in range(surfaces):
        first, end = spans[FIRST, k], spans[LAST, k] + 1
        if spans[KIND, k] == LINE and end - first >= 3 * _TOGETHER:
            _second_differences(
                points[:, first:end], pieces[k, A], pieces[k, B], noise, points[SCRATCH],
                squares[used:],
            )  # fmt: skip
            used += end - first + 1 - 3 * _TOGETHER
    mean, limit = 1.0, math.inf
    for _ in range(2 if used >= 3 * _TOGETHER else 0):
        total, kept = 0.0, 0
        for i in range(used):
            if squares[i] <= limit:
                total += squares[i]
                kept += 1
        mean = total / kept
        limit = SIGMAS * SIGMAS * mean
    # Nothing is known better than the best scanner measures it.
    return max(mean, LEAST_SIGMA * LEAST_SIGMA / noise[0])


@sums
def _second_differences(points, a, b, noise, error, squares):
    """Square the second differences of means of four errors, in units of those of white noise."""
    x, y, rho = points[X], points[Y], points[RHO]
    for i in range(len(x)):
        variance = noise[0] + noise[1] * rho[i] * rho[i]
        error[i] = (rho[i] - rho[i] / (a * x[i] + b * y[i])) / math.sqrt(variance)
    for i in range(len(x) + 1 - 3 * _TOGETHER):
        first = error[i] + error[i + 1] + error[i + 2] + error[i + 3]
        second = error[i + 4] + error[i + 5] + error[i + 6] + error[i + 7]
        third = error[i + 8] + error[i + 9] + error[i + 10] + error[i + 11]
        difference = first - 2.0 * second + third
        squares[i] = difference * difference / (6.0 * _TOGETHER)


@helper
def soften_borders(beams, spans, pieces, sums, surfaces):
    """Add to the covariances what comes of borders that could as well lie elsewhere.

    A border lies anywhere between two measurements, and where a wall bends, it may move far until
    χ² rises by 1: by one deviation. The lines turn by as much with it.
    """
    for k in range(1, surfaces):
        start, border, end = spans[FIRST, k - 1], spans[FIRST, k], spans[LAST, k] + 1
        if spans[KIND, k - 1] != LINE or spans[KIND, k] != LINE or beams[BROKEN, border]:
            continue
        if border > spans[LAST, k - 1] + 1:
            continue
        low, high = border - 1, border + 1
        _add_change(pieces[k - 1], solve(sums, start, low), solve(sums, start, high))
        _add_change(pieces[k], solve(sums, low, end), solve(sums, high, end))


@helper
def _add_change(piece, line, other):
    """Add a share of the change from one line to another as a deviation of a piece."""
    ux, uy, cx, cy = piece[UX], piece[UY], piece[CX], piece[CY]
    along, across = line[0] * ux + line[1] * uy, line[1] * ux - line[0] * uy
    along_too, across_too = other[0] * ux + other[1] * uy, other[1] * ux - other[0] * uy
    if across * across_too == 0.0:
        return
    offset = (1.0 - line[0] * cx - line[1] * cy) / across
    offset = _WITHIN * (offset - (1.0 - other[0] * cx - other[1] * cy) / across_too)
    angle = _WITHIN * (math.atan(along_too / across_too) - math.atan(along / across))
    piece[OO] += offset * offset
    piece[OA] += offset * angle
    piece[AA] += angle * angle
