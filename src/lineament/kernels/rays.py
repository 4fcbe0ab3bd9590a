"""Inverse-range regression, 1/ρ = A cos φ + B sin φ: lines of the least squared errors of ranges.

The residual of an inverse range times ρ² is the error of the range.
"""

from . import helper


@helper
def turn(bearings, b, to):
    """Cosine and sine of the angle from the ray of one beam to that of another."""
    c = bearings[0, b] * bearings[0, to] + bearings[1, b] * bearings[1, to]
    return c, bearings[0, b] * bearings[1, to] - bearings[1, b] * bearings[0, to]


@helper
def add_ray(sums, c, s, rho):
    """Add a range to the sums w (cc, cs, ss, uc, us, uu) with u = 1/ρ and w = ρ⁴.

    Bearings are best taken from the first point of a line: the sums are well conditioned anywhere.
    """
    cc, cs, ss, uc, us, uu = sums
    w, u = rho**4, 1.0 / rho
    cc, cs, ss = cc + w * c * c, cs + w * c * s, ss + w * s * s
    return cc, cs, ss, uc + w * u * c, us + w * u * s, uu + w * u * u


@helper
def least_squares(sums):
    """Least sum of squared errors of the ranges, by the sums."""
    cc, cs, ss, uc, us, uu = sums
    return uu - (ss * uc * uc - 2.0 * cs * uc * us + cc * us * us) / (cc * ss - cs * cs)
