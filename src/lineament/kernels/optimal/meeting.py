"""Step 5: how two lines meet: where they cross, not over a hole, or by a face between them."""

import math

import numpy as np

from .. import helper, inlined
from ...features import records as to
from . import layout as at
from .constants import BEND, FACE_LEAST, FACE_MORE, LEAST, REACH, SIGMAS, TAU
from .costs import joint_cost
from .geometry import along, around, crossing, distance, gap, over, surface_variance

#: Kind of the corner of two surfaces that have none.
NO_CORNER = -1


@inlined
def meet(work, scan, k, m):
    """Whether two lines are one surface, and the kind of their corner.

    They meet if they are no farther apart between their facing measurements than by chance, and
    have no hole there. If they do not, a face may join them.
    """
    points, broken, p, q = work.points, work.beams[at.BROKEN], work.pieces[k], work.pieces[m]
    i, j = work.spans[at.LAST, k], work.spans[at.FIRST, m]
    error_i = SIGMAS * math.sqrt(surface_variance(points, i, work.noise))
    error_j = SIGMAS * math.sqrt(surface_variance(points, j, work.noise))
    error, between = max(error_i, error_j), around(j - i, scan.count) - 1
    hole = _is_hole(points, scan.count, i, j, p, q, error)
    step = gap(points, i, j, p[at.A] - q[at.A], p[at.B] - q[at.B])
    meets = between < LEAST and not hole and step * step <= error * error
    length, length_too = _length(work, k), _length(work, m)
    reach_i = max(min(REACH, length), _apart(points, i - 1, i) + error_i)
    reach_j = max(min(REACH, length_too), _apart(points, j, j + 1) + error_j)
    crosses = _is_cross(points, i, j, p, q, reach_i, reach_j)
    joined = meets and _apart(points, i, j) <= reach_i + reach_j
    if not (joined or hole):
        joined = _is_face(points, broken, scan.count, i, j, p, q, between)
    kind = np.int64(NO_CORNER)
    if crosses and _is_turn(p, q, length, length_too) and response(work, k, m) >= scan.evidence:
        kind = np.int64(to.SHARP if meets else to.SLIT)
    return joined, kind


@helper
def _is_cross(points, i, j, p, q, reach_i, reach_j):
    """Whether two lines, seen up to i and from j on, cross where a corner may lie.

    That is near the measurements on both sides, no farther than these have seen of their lines, or
    within their spacing and its error; beyond the centroid of the one, before that of the other.
    """
    x, y = crossing(p, q)
    near = distance(x - points[at.X, i], y - points[at.Y, i]) <= reach_i and (
        distance(x - points[at.X, j], y - points[at.Y, j]) <= reach_j
    )
    return near and along(p, x, y) > 0.0 and along(q, x, y) < 0.0


@helper
def _is_hole(points, count, i, j, p, q, error):
    """Whether a measurement between two lines went on behind both, so that they do not meet."""
    t = around(i + 1, count)
    while t != j:
        behind = min(over(p, points, t), over(q, points, t))
        if points[at.RHO, t] * (behind - 1.0) > error * behind:
            return True
        t = around(t + 1, count)
    return False


@helper
def _is_face(points, broken, count, i, j, p, q, between):
    """Whether a face at right angles to the nearer of two lines joins them without a break.

    It is as deep as what was measured behind that line, up to the other one. The beams graze it:
    it is a face if about as many beams would see it as lie between.
    """
    x, y, rho = points[at.X], points[at.Y], points[at.RHO]
    nearer, end, other, way = (p, i, j, 1.0) if rho[i] <= rho[j] else (q, j, i, -1.0)
    depth, t = max(0.0, over(nearer, points, other) - 1.0), i
    while t != j:
        t = around(t + 1, count)
        if broken[t]:
            return False
        depth = max(depth, over(nearer, points, t) - 1.0) if t != j else depth
    square = nearer[at.A] * nearer[at.A] + nearer[at.B] * nearer[at.B]
    bx, by = x[end] + depth * nearer[at.A] / square, y[end] + depth * nearer[at.B] / square
    face = way * (x[end] * by - y[end] * bx) / (rho[end] * distance(bx, by))
    beam = (x[i] * y[j] - y[i] * x[j]) / (rho[i] * rho[j] * (between + 1.0))
    return FACE_LEAST * beam <= face <= (between + FACE_MORE) * beam


@helper
def _is_turn(p, q, length, length_too):
    """Whether a corner turns by much, or stands out of the line through both by more than walls."""
    turn = abs(p[at.UX] * q[at.UY] - p[at.UY] * q[at.UX])
    height = turn * length * length_too / (length + length_too)
    return height > SIGMAS * TAU or not p[at.UX] * q[at.UX] + p[at.UY] * q[at.UY] > BEND


@helper
def response(work, k, m):
    """Rise of χ² if two lines were one."""
    first, last = work.spans[at.FIRST], work.spans[at.LAST]
    return joint_cost(work.sums, first[k], last[k] + 1, first[m], last[m] + 1)


@helper
def _length(work, k):
    """Distance between the first and the last measurement of a line [m]."""
    return _apart(work.points, work.spans[at.FIRST, k], work.spans[at.LAST, k])


@helper
def _apart(points, i, j):
    """Distance of two measurements [m]."""
    return distance(points[at.X, i] - points[at.X, j], points[at.Y, i] - points[at.Y, j])
