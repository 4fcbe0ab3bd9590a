"""Step 1: the noise of the ranges, a variance of constant + growth · ρ².

From what a measurement is off the line through its two neighbours. These three span triangles with
the scanner at the origin: with the cross products c₁ of the first two, c₂ of the last two and c of
the outer ones, the middle range is ρ (c₁ + c₂ - c)/c beyond the line, for any direction of the
line. The square of that has 1.5 times the variance of a range.
"""

import math

from .. import inlined, sums
from ..noise import LEAST_SIGMA, ranked
from . import layout as at
from .constants import MOST_DEVIATION, SIGMAS

#: Square of a deviation of a normal distribution, over that which a third of its squares is below.
_THIRD = 1.0 / 0.4307**2
#: What is cut off at three deviations is 3 % of the variance.
_WHOLE = 1.03
#: Fewer triples say little; of overlapping ones, so many count as one.
_FEWEST, _OVERLAP = 24, 1.94


@inlined
def estimate_noise(work, count, given):
    """Write the noise as (constant, growth, variance of a bearing): as given, or from the triples.

    By the third of them that is least off, as no clutter is; of the nearer and the farther half
    apart: it grows with range where these differ by more than chance.
    """
    points, noise = work.points, work.noise
    least = LEAST_SIGMA * LEAST_SIGMA
    if not math.isnan(given[0]):
        noise[0] = max(given[0] * given[0] + given[3] * given[3] / 12.0, least)
        noise[1], noise[2] = given[1] * given[1], given[2] * given[2]
        return
    noise[0], noise[1], noise[2] = least, 0.0, 0.0
    middle, used = _fill_triples(points, work.beams[at.BEAM], count)
    if used < _FEWEST:
        return
    near, near_square, near_count = _least_third(points, count, 0.0, middle)
    far, far_square, far_count = _least_third(points, count, middle, math.inf)
    constant, growth = (near * near_count + far * far_count) / (near_count + far_count), 0.0
    both = 1.0 / max(near_count, 1.0) + 1.0 / max(far_count, 1.0)
    chance = SIGMAS * math.sqrt(2.0 * _OVERLAP * both)
    if near_count > 0.0 and far > near * (1.0 + chance):
        growth = (far - near) / (far_square - near_square)
        constant = near - growth * near_square
        if constant < least:
            growth = 0.5 * (near / near_square + far / far_square)
    most = MOST_DEVIATION * MOST_DEVIATION
    noise[0] = min(max(constant, least), most)
    if growth > 0.0:
        farthest = 0.0
        for i in range(count):
            farthest = max(farthest, points[at.RHO, i])
        noise[1] = min(growth, (most - noise[0]) / (farthest * farthest))


@sums
def _fill_triples(points, beam, count):
    """Fill `KEY` with the squared error of each range by its neighbours; inf where one is missing.

    Returns the mean square of those ranges, and how many there are.
    """
    x, y, rho, triple = points[at.X], points[at.Y], points[at.RHO], points[at.KEY]
    x1, y1, rho1, x2, y2 = x[1:], y[1:], rho[1:], x[2:], y[2:]
    beam2, triple1 = beam[2:], triple[1:]
    total, used = 0.0, 0.0
    for i in range(count - 2):
        outer = x[i] * y2[i] - y[i] * x2[i]
        inner = x[i] * y1[i] - y[i] * x1[i] + x1[i] * y2[i] - y1[i] * x2[i]
        error = rho1[i] * (inner - outer) / outer
        neighbours = beam2[i] - beam[i] == 2
        triple1[i] = error * error / 1.5 if neighbours else math.inf
        total += rho1[i] * rho1[i] if neighbours else 0.0
        used += 1.0 if neighbours else 0.0
    triple[0] = triple[max(count - 1, 0)] = math.inf
    return total / max(used, 1.0), used


@sums
def _least_third(points, count, low, high):
    """Variance by triples of squared ranges from `low` to `high`, their mean square, and number."""
    rho, triple, kept, n = points[at.RHO], points[at.KEY], points[at.SCRATCH], 0.0
    for i in range(count):
        square = rho[i] * rho[i]
        kept[i] = triple[i] if (low <= square) & (square < high) else math.inf
        n += 1.0 if kept[i] < math.inf else 0.0
    if n == 0.0:
        return 0.0, 0.0, 0.0
    limit = SIGMAS * SIGMAS * _THIRD * ranked(kept, count, int(n) // 3)
    total, squares, used = 0.0, 0.0, 0.0
    for i in range(count):
        within = kept[i] <= limit
        total += kept[i] if within else 0.0
        squares += rho[i] * rho[i] if within else 0.0
        used += 1.0 if within else 0.0
    return _WHOLE * total / used, squares / used, used
