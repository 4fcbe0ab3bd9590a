"""Step 4: how sure lines are of which measurements are theirs."""

import math

from .. import helper, inlined
from . import layout as at
from .constants import FARTHER, LEAST, LEAST_ODDS, ODDS_A, ODDS_B, RARE, TAU
from .costs import cost, solve
from .merging import rise_if_one


@inlined
def soften_borders(work, surfaces, evidence):
    """Add to the covariances what comes of borders that could as well lie elsewhere, or not be.

    With a border that is off by some measurements, both of its lines turn.
    """
    spans, pieces, rho = work.spans, work.pieces, work.points[at.RHO]
    for k in range(1, surfaces):
        border = spans[at.FIRST, k]
        if spans[at.KIND, k - 1] != at.LINE or spans[at.KIND, k] != at.LINE:
            continue
        if work.beams[at.BROKEN, border] or border > spans[at.LAST, k - 1] + 1:
            continue
        ends = spans[at.FIRST, k - 1], border, spans[at.LAST, k] + 1
        variance = work.noise[at.CONSTANT] + work.noise[at.GROWTH] * rho[border - 1] * rho[border]
        share = variance / (variance + TAU * TAU)
        spare = rise_if_one(work, k) - RARE * evidence
        _soften(work.sums, ends, share, spare, pieces[k - 1], pieces[k])


@helper
def _soften(sums, ends, share, spare, before, after):
    """Add to two lines the variance of where the border between them lies.

    It lies elsewhere, farther off by 1, 4, 16 ... measurements, or nowhere, by the odds that noise
    makes up for the rise of χ²; noise is a share of the variance about a surface.
    """
    start, border, end = ends
    least, total = cost(sums, start, border) + cost(sums, border, end), 1.0
    one, other = solve(sums, start, border), solve(sums, border, end)
    of_one, of_other = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if spare < math.inf:
        joint = solve(sums, start, end)
        apart = _apart(sums, start, border, one, joint) + _apart(sums, border, end, other, joint)
        odds = _odds(spare, share * apart)
        of_one = _changed(of_one, before, one, joint, odds)
        of_other = _changed(of_other, after, other, joint, odds)
        total += odds
    for way in (-1, 1):
        step, odds = 1, 1.0
        while odds > LEAST_ODDS:
            i = border + way * step
            if i - start < LEAST or end - i < LEAST:
                break
            rise = cost(sums, start, i) + cost(sums, i, end) - least
            first, second = solve(sums, start, i), solve(sums, i, end)
            low, high = min(i, border), max(i, border)
            apart = _apart(sums, start, low, one, first) + _apart(sums, high, end, other, second)
            changed = (other, first) if way > 0 else (one, second)
            apart += _apart(sums, low, high, changed[0], changed[1])
            odds = _odds(rise, share * apart)
            of_one = _changed(of_one, before, one, first, odds)
            of_other = _changed(of_other, after, other, second, odds)
            total += odds
            step *= FARTHER
    _add(before, of_one, 1.0 / total)
    _add(after, of_other, 1.0 / total)


@helper
def _odds(rise, square):
    """Odds Φ(-z) / Φ(z) that noise makes up for a rise of χ², z of its deviations."""
    if not square > 0.0:
        return 0.0
    z = 0.5 * max(rise, 0.0) / math.sqrt(square)
    return math.exp(-ODDS_A * z - ODDS_B * z * z * z)


@helper
def _apart(sums, i, j, line, other):
    """Sum of the squares by which two lines differ at the measurements i … j - 1."""
    a, b = other[0] - line[0], other[1] - line[1]
    xx, xy, yy = (
        sums[at.WXX, j] - sums[at.WXX, i],
        sums[at.WXY, j] - sums[at.WXY, i],
        sums[at.WYY, j] - sums[at.WYY, i],
    )
    return a * a * xx + 2.0 * a * b * xy + b * b * yy


@helper
def _changed(spread, piece, line, other, odds):
    """Add the square, by its odds, of the change from one line to another at a piece's centroid."""
    ux, uy, cx, cy = piece[at.UX], piece[at.UY], piece[at.CX], piece[at.CY]
    along, across = line[0] * ux + line[1] * uy, line[1] * ux - line[0] * uy
    along_too, across_too = other[0] * ux + other[1] * uy, other[1] * ux - other[0] * uy
    if across * across_too == 0.0:
        return spread
    offset = (1.0 - line[0] * cx - line[1] * cy) / across
    offset -= (1.0 - other[0] * cx - other[1] * cy) / across_too
    angle = math.atan(along_too / across_too) - math.atan(along / across)
    oo, oa, aa = spread
    return oo + odds * offset * offset, oa + odds * offset * angle, aa + odds * angle * angle


@helper
def _add(piece, spread, share):
    """Add a share of a spread to the covariance of a piece."""
    piece[at.OO] += share * spread[0]
    piece[at.OA] += share * spread[1]
    piece[at.AA] += share * spread[2]
