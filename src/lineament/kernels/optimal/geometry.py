"""Places about the line a x + b y = 1 of a piece; variances; beams around a full circle."""

import math

from .. import helper
from . import layout as at
from .constants import TAU


@helper
def distance(dx, dy):
    """Length of a vector: lengths here need not the care of `math.hypot`, a call."""
    return math.sqrt(dx * dx + dy * dy)


@helper
def around(i, n):
    """Return the number from 0 to n - 1 of what is at most once around more, or less."""
    if i < 0:
        return i + n
    return i - n if i >= n else i


@helper
def missing(before, after, n):
    """Return how many beams are between two in this order, of n that may go around."""
    return around(after - before, n) - 1


@helper
def range_variance(points, i, noise):
    """Variance of the range of a measurement."""
    rho = points[at.RHO, i]
    return noise[at.CONSTANT] + noise[at.GROWTH] * rho * rho


@helper
def surface_variance(points, i, noise):
    """Variance of a measurement about the line of its surface."""
    rho = points[at.RHO, i]
    return TAU * TAU + noise[at.CONSTANT] + noise[at.GROWTH] * rho * rho


@helper
def over(line, points, i):
    """Range of a measurement over that of a line in its direction: more than 1 behind the line."""
    return line[at.A] * points[at.X, i] + line[at.B] * points[at.Y, i]


@helper
def along(piece, x, y):
    """Place along a line, from its centroid [m]."""
    return (x - piece[at.CX]) * piece[at.UX] + (y - piece[at.CY]) * piece[at.UY]


@helper
def variance_at(piece, x, y):
    """Variance of the offset of a line at a place: that at its centroid, with the lever arm."""
    t = along(piece, x, y)
    return piece[at.OO] + 2.0 * t * piece[at.OA] + t * t * piece[at.AA]


@helper
def crossing(p, q):
    """Return the place where two lines cross, NaN of parallel ones."""
    determinant = p[at.A] * q[at.B] - q[at.A] * p[at.B]
    inverse = 1.0 / determinant if determinant != 0.0 else math.nan
    return (q[at.B] - p[at.B]) * inverse, (p[at.A] - q[at.A]) * inverse


@helper
def gap(points, i, j, a, b):
    """Range by which one line is before another at the beams of i and j, the lesser of both [m].

    The lines differ by a x + b y in ρ over their ranges; 0 where they cross between those beams,
    less than 0 where the first is behind.
    """
    here = (a * points[at.X, i] + b * points[at.Y, i]) * points[at.RHO, i]
    there = (a * points[at.X, j] + b * points[at.Y, j]) * points[at.RHO, j]
    if here * there <= 0.0:
        return 0.0
    return here if abs(here) < abs(there) else there
