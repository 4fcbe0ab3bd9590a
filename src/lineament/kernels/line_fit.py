"""Least-squares lines through points, and the covariance of their offset and angle.

Equations 23 and 24 of Liu et al. 2023; the weights of S. T. Pfister, S. I. Roumeliotis,
J. W. Burdick, *Weighted line fitting algorithms for mobile robot map building and efficient data
representation*, ICRA 2003.
"""

import math

from . import as_covariance, helper, sums
from .noise import LEAST_SIGMA

#: How a line is fitted (equations 23, 24, and what is better).
TOTAL, Y_OF_X, WEIGHTED, SLOPE_INTERCEPT = range(4)
FITS = {
    "total": TOTAL,
    "y_of_x": Y_OF_X,
    "weighted": WEIGHTED,
    "slope_intercept": SLOPE_INTERCEPT,
}

#: Least normal, over what points in all directions have: less is rounding, of points on one beam.
_ALONG = 1e-9
#: Least square of the cosine of an incidence.
GRAZING = 1e-6
#: Variance of an angle that may be any [rad²].
_ANY_ANGLE = math.pi**2 / 12.0


@sums
def fit_line(x, y, rho, first, last, noise, kind):
    """Fit a line to the points `first`..`last` (inclusive, two or more), `rho` from the sensor.

    Parameters
    ----------
    kind : int
        TOTAL: least orthogonal distances. Y_OF_X: y = kx + b, or x = ky + b where the points are
        steeper than 45° (equations 23, 24). SLOPE_INTERCEPT: y = kx + b of every line, also of
        the steepest; k = 0 of a line x = const. WEIGHTED: maximum likelihood by Pfister's weights.

    Returns
    -------
    cx, cy : float
        (Weighted) centroid [m].
    c, s : float
        Direction from the first to the last point, a unit vector.
    var_offset, covariance, var_angle : float
        Of the offset at the centroid along the left normal, and the angle.
    rms : float
        Root mean square of the orthogonal distances [m].
    """
    # Slices, as numba need not look for negative indices where a loop begins at 0.
    span = slice(first, last + 1)
    x, y, rho = x[span], y[span], rho[span]
    cx, cy, c, s, weighted = x[0], y[0], 1.0, 0.0, False
    for iteration in range(3 if kind == WEIGHTED else 1):
        weighted = iteration > 0
        cx, cy, c, s = _line(x, y, rho, noise, c, s, weighted, kind)
    end = len(x) - 1
    if c * (x[end] - x[0]) + s * (y[end] - y[0]) < 0.0:
        c, s = -c, -s
    # To first order the offset is Σwe/W and the angle Σwte/S, with t along the line from the
    # centroid, so their covariance is that of these sums, whatever the weights.
    w_sum, t_sum, oo, oa, aa, squares = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(x)):
        dx, dy = x[i] - cx, y[i] - cy
        t, e = c * dx + s * dy, c * dy - s * dx
        variance = normal_variance(c * y[i] - s * x[i], rho[i], noise)
        w = 1.0 / variance if weighted else 1.0
        squares += e * e
        w_sum += w
        t_sum += w * t * t
        oo += w * w * variance
        oa += w * w * variance * t
        aa += w * w * variance * t * t
    if weighted:
        oa = 0.0  # At their own centroid these are independent, but for the last iteration.
    var_offset, rms = oo / (w_sum * w_sum), math.sqrt(squares / len(x))
    if kind == TOTAL:
        t_sum -= squares  # The angle of the larger eigenvalue goes by how much larger it is.
    if not t_sum > 0.0:
        # Points that coincide have no direction: any angle is as good.
        return cx, cy, c, s, var_offset, 0.0, _ANY_ANGLE, rms
    first_order = var_offset, oa / (w_sum * t_sum), aa / (t_sum * t_sum)
    var_offset, covariance, var_angle = second_order(first_order, cx, cy, c, s)
    return cx, cy, c, s, var_offset, covariance, var_angle, rms


@sums
def _line(x, y, rho, noise, c, s, weighted, kind):
    """Centroid and direction of least squares, of orthogonal or axial distances.

    Weighted by the normal variances to a line of direction (c, s), or not at all.
    """
    # Sums about the first point, not the far origin, keep their digits.
    x0, y0 = x[0], y[0]
    total, sx, sy, sxx, sxy, syy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(x)):
        dx, dy, w = x[i] - x0, y[i] - y0, 1.0
        if weighted:
            w = 1.0 / normal_variance(c * y[i] - s * x[i], rho[i], noise)
        total += w
        sx += w * dx
        sy += w * dy
        sxx += w * dx * dx
        sxy += w * dx * dy
        syy += w * dy * dy
    sxx -= sx * sx / total
    sxy -= sx * sy / total
    syy -= sy * sy / total
    cx, cy = x0 + sx / total, y0 + sy / total
    if kind == WEIGHTED:
        c, s = direction_along_beams(sxx, sxy, syy, cx, cy)
    else:
        c, s = direction(sxx, sxy, syy, kind)
    return cx, cy, c, s


@helper
def direction(sxx, sxy, syy, kind):
    """Return the unit vector along a line, from the second moments of its points."""
    if kind in (Y_OF_X, SLOPE_INTERCEPT):
        swaps = kind == Y_OF_X and sxx < syy
        u, v = (sxy, syy) if swaps else (sxx, sxy)
    else:
        # That of the larger eigenvalue: at half the angle of (sxx - syy, 2 sxy).
        difference = sxx - syy
        reach = abs(difference) + math.sqrt(difference * difference + 4.0 * sxy * sxy)
        u, v = (reach, 2.0 * sxy) if difference >= 0.0 else (2.0 * sxy, reach)
    norm = math.sqrt(u * u + v * v)
    return (u / norm, v / norm) if norm > 0.0 else (1.0, 0.0)


@helper
def direction_along_beams(sxx, sxy, syy, cx, cy):
    """Return the direction of the line a x + b y = 1 of least squares, from second moments.

    These, C, are about the centroid c. The normal is C⁻¹c but for its length: 1 - a x - b y is the
    error of a range over that of the line, whatever the line's direction. Where all points lie on
    one beam, it is that of the larger eigenvalue.
    """
    u, v = sxy * cx - sxx * cy, syy * cx - sxy * cy
    norm, reach = math.sqrt(u * u + v * v), (sxx + syy) * (abs(cx) + abs(cy))
    if not norm > _ALONG * reach:
        return direction(sxx, sxy, syy, TOTAL)
    return u / norm, v / norm


@helper
def second_order(first_order, cx, cy, c, s):
    """(Co)variances of a line's offset and angle from those of the first order, which are less.

    Ranges give the slope m = tan ψ across the beams, ψ the incidence, with a variance that does
    not depend on it. The first order v of an angle f(m) = atan m is taken at an estimate, which is
    off as well: its NEES is 1 + v (15/4 f₂² - 2 f₁ f₃)/f₁⁴ = 1 + (4 + 3 m²) v, by derivatives of
    f. That of the offset, cos ψ times an error along the beams, is 1 + (1 + m²) v.
    """
    var_offset, covariance, v = first_order
    square, distance = cx * cx + cy * cy, c * cy - s * cx
    steep = square / max(distance * distance, GRAZING * square)  # 1 + m²
    var_offset, var_angle = var_offset * (1.0 + steep * v), v * (1.0 + (1.0 + 3.0 * steep) * v)
    var_angle = min(var_angle, _ANY_ANGLE)
    return var_offset, as_covariance(covariance, var_offset, var_angle), var_angle


@helper
def normal_variance(distance, rho, noise):
    """Variance of a point along a line's normal, b = σ_r² cos²ψ + ρ² σ_φ² sin²ψ.

    cos ψ is the distance of the origin from the line over the range; ψ is kept 0.06° short of
    grazing so that no point gets all the weight.
    """
    square = max(rho * rho, 1e-300)  # Not 0 for the least of ranges.
    near = max(distance * distance, GRAZING * square)
    return range_variance(rho, noise) * near / square + noise[2] * noise[2] * (square - near)


@helper
def range_variance(rho, noise):
    """σ_r² = σ² + (proportional ρ)² + quantum²/12, at least that of the best scanner."""
    grown = noise[1] * rho
    constant = noise[0] * noise[0] + noise[3] * noise[3] * (1.0 / 12.0)
    return max(constant + grown * grown, LEAST_SIGMA * LEAST_SIGMA)
