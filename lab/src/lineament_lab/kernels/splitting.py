"""Clusters split where they are not straight, by the iterative end point fit and split-and-merge.

U. Ramer, *An iterative procedure for the polygonal approximation of plane curves* (1972); V. Nguyen
et al., *A comparison of line extraction algorithms using 2D range data for indoor mobile robotics*
(2007), the first half of split-and-merge.
"""

import math

import numpy as np

from lineament.kernels import helper
from lineament.kernels import layout as at
from lineament.kernels.arrays import Floats1, Floats2, Ints2
from lineament.kernels.cutting import add_candidate, add_side, list_pieces, next_candidate
from lineament.kernels.line_fit import WEIGHTED, fit_line, range_variance

from . import kernel


@kernel
def split(
    floats: Floats2,
    ints: Ints2,
    noise: Floats1,
    by_line: bool,
    threshold: float,
    proportion: float,
    noise_factor: float,
    min_points: int,
):
    """Split the clusters of a scan into straight pieces that meet at points.

    A piece is split at the point farthest from the chord of its ends if it is not straight, and
    both its parts are searched in turn. It is not straight if that distance is above the tolerance
    of the point, or, `by_line`, if two neighbouring points are off the line fitted to the piece, on
    one side of it and by more than their tolerances: one alone is an outlier.

    Also where the fitted line decides, the split is at the point farthest from the *chord*: what
    is farthest from the line fitted to the two arms of an L is one of its ends, at which nothing
    can be split.

    From points and clusters, candidates and pieces. The response of a candidate, and of the corner
    that it becomes, is the distance that decided over its tolerance: the piece is split if that is
    above 1.

    Parameters
    ----------
    by_line : bool
    threshold, proportion, noise_factor : float
        The tolerance of a point at range ρ is threshold + proportion ρ + noise_factor σ_r [m].
    min_points : int
        No piece gets shorter.
    """
    work = at.named(floats, ints)
    points, counts, tolerance = work.points, work.counts, work.points[at.SLACK]
    found = np.int64(0)
    for i in range(counts[at.POINTS]):
        sigma = math.sqrt(range_variance(points[at.RHO, i], noise))
        tolerance[i] = threshold + proportion * points[at.RHO, i] + noise_factor * sigma
    for c in range(counts[at.CLUSTERS]):
        depth = add_side(work.waiting, 0, work.clusters[at.FIRST, c], work.clusters[at.LAST, c])
        while depth > 0:
            depth, a, b, i, distance = next_candidate(points, work.waiting, depth, min_points)
            if i < 0:
                continue
            excess = _off_line(points, a, b, noise) if by_line else distance / tolerance[i]
            found = add_candidate(work.candidates, found, i, distance, excess)
            if excess > 1.0:
                depth = add_side(work.waiting, depth, i, b)
                depth = add_side(work.waiting, depth, a, i)
    if counts[at.CLOSED]:
        found = _split_seam(points, work.candidates, counts[at.POINTS], found)
    list_pieces(work, found, 1.0)


@helper
def _off_line(points, first, last, noise):
    """By how many tolerances two neighbours are off one side of the line of a piece."""
    x, y, tolerance = points[at.X], points[at.Y], points[at.SLACK]
    cx, cy, c, s, _, _, _, _ = fit_line(x, y, points[at.RHO], first, last, noise, WEIGHTED)
    most, before = 0.0, 0.0
    for i in range(first, last + 1):
        off = (c * (y[i] - cy) - s * (x[i] - cx)) / tolerance[i]
        if off * before > 0.0:
            most = max(most, min(abs(off), abs(before)))
        before = off
    return most


@helper
def _split_seam(points, candidates, count, found):
    """Examine the point at which a ring was opened: its distance from the chord over it.

    That chord leads from the last split to the first. Returns the number of candidates.
    """
    after, before = count, -1
    for k in range(found):
        if candidates[at.RESPONSE, k] > 1.0:
            after = min(after, int(candidates[at.POINT, k]))
            before = max(before, int(candidates[at.POINT, k]))
    if after == count:
        return found
    x, y = points[at.X], points[at.Y]
    cx, cy = x[after] - x[before], y[after] - y[before]
    px, py = x[0] - x[before], y[0] - y[before]
    chord = math.sqrt(cx * cx + cy * cy)
    distance = abs(cx * py - cy * px) / chord if chord > 0.0 else math.sqrt(px * px + py * py)
    return add_candidate(candidates, found, 0, distance, distance / points[at.SLACK, 0])
