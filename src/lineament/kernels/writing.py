"""Rows of the tables of features, written by the kernels of all methods."""

import math

import numpy as np

from . import as_covariance, helper
from ..features import records as at

#: Spread of a corner at which half are found again from another place, and how fast that falls;
#: fitted by ``benchmarks/quality.py``.
_SPREAD, _FALL = 0.78, 2.4
#: The same of an edge at a jump, by its prominence, and how fast that rises.
_PROMINENCE, _RISE = 130.0, 0.38


@helper
def write_segment(places, beam, first, last, count, line, misfit, segments, ints, k):
    """Write the segment of a line from the measurement `first` to `last`, `count` of them on it.

    `places` are x and y by measurement, `beam` is their beam; `line` is as of `line_fit.fit_line`.
    """
    x, y = places[0], places[1]
    cx, cy, c, s, var_offset, covariance, var_angle, rms = line
    row = segments[k]
    if c * (x[last] - x[first]) + s * (y[last] - y[first]) < 0.0:
        # The fit has left out measurements at the ends.
        c, s, covariance = -c, -s, -covariance
    along = c * (x[first] - cx) + s * (y[first] - cy)
    row[at.S_START], row[at.S_START + 1] = cx + along * c, cy + along * s
    along = c * (x[last] - cx) + s * (y[last] - cy)
    write_end(segments, k, at.S_END, cx + along * c, cy + along * s)
    row[at.S_CENTROID], row[at.S_CENTROID + 1], row[at.S_ANGLE] = cx, cy, math.atan2(s, c)
    row[at.S_COVARIANCE], row[at.S_COVARIANCE + 1] = var_offset, covariance
    row[at.S_COVARIANCE + 2], row[at.S_COVARIANCE + 3] = covariance, var_angle
    row[at.S_RMS], row[at.S_MISFIT] = rms, misfit
    ints[k, at.S_FIRST], ints[k, at.S_LAST], ints[k, at.S_POINTS] = beam[first], beam[last], count


@helper
def write_end(segments, k, end, x, y):
    """Write where a segment starts or ends: `S_START` or `S_END`. Its length follows."""
    row = segments[k]
    row[end], row[end + 1] = x, y
    dx, dy = row[at.S_END] - row[at.S_START], row[at.S_END + 1] - row[at.S_START + 1]
    row[at.S_LENGTH] = math.sqrt(dx * dx + dy * dy)


@helper
def write_opening(segments, before, after, corners, corner_ints, k):
    """Write the angle between the arms of a corner, and which way it points."""
    turn = segments[after, at.S_ANGLE] - segments[before, at.S_ANGLE]
    if turn > math.pi:
        turn -= 2.0 * math.pi
    elif turn < -math.pi:
        turn += 2.0 * math.pi
    corners[k, at.C_OPENING] = math.pi - abs(turn)
    # Beams run counter-clockwise around the sensor: a right turn points towards it.
    corner_ints[k, at.C_CONVEX] = turn < 0.0


@helper
def intersect(lines, a, b, x, y, near, corners, k):
    """Put a corner on the intersection of its lines, with Σ = A⁻¹ diag(s₁², s₂²) A⁻ᵀ.

    The lines then end there. Refused, and False, where that lies farther than `near` from the
    point (x, y) of the cut, for nearly parallel lines meet anywhere; and where it is not after the
    start and the centroid of the one, and before those of the other, which would be reversed.
    """
    n1x, n1y = -math.sin(lines[a, at.S_ANGLE]), math.cos(lines[a, at.S_ANGLE])
    n2x, n2y = -math.sin(lines[b, at.S_ANGLE]), math.cos(lines[b, at.S_ANGLE])
    determinant = n1x * n2y - n1y * n2x
    if abs(determinant) < 1e-6:
        return False
    d1 = n1x * lines[a, at.S_CENTROID] + n1y * lines[a, at.S_CENTROID + 1]
    d2 = n2x * lines[b, at.S_CENTROID] + n2y * lines[b, at.S_CENTROID + 1]
    px = (n2y * d1 - n1y * d2) / determinant
    py = (n1x * d2 - n2x * d1) / determinant
    if math.sqrt((px - x) * (px - x) + (py - y) * (py - y)) > near:
        return False
    start = _place_along(lines, a, n1y, -n1x, lines[a, at.S_START], lines[a, at.S_START + 1])
    end = _place_along(lines, b, n2y, -n2x, lines[b, at.S_END], lines[b, at.S_END + 1])
    along_a = _place_along(lines, a, n1y, -n1x, px, py)
    along_b = _place_along(lines, b, n2y, -n2x, px, py)
    if not (along_a > max(start, 0.0) and along_b < min(end, 0.0)):
        return False
    write_end(lines, a, at.S_END, px, py)
    write_end(lines, b, at.S_START, px, py)
    s1 = _offset_variance(lines, a, along_a) / (determinant * determinant)
    s2 = _offset_variance(lines, b, along_b) / (determinant * determinant)
    write_place(corners, k, px, py, s1, n2y, -n2x, s2, n1y, -n1x)
    return True


@helper
def write_place(corners, k, x, y, first, ax, ay, second, bx, by):
    """Write where a corner is, with variances along two unit vectors: Σ = v₁ a aᵀ + v₂ b bᵀ.

    Also of an edge: both tables begin with these fields.
    """
    corners[k, at.C_POSITION], corners[k, at.C_POSITION + 1] = x, y
    xx, yy = ax * ax * first + bx * bx * second, ay * ay * first + by * by * second
    xy = as_covariance(ax * ay * first + bx * by * second, xx, yy)
    corners[k, at.C_COVARIANCE], corners[k, at.C_COVARIANCE + 1] = xx, xy
    corners[k, at.C_COVARIANCE + 2], corners[k, at.C_COVARIANCE + 3] = xy, yy


@helper
def _offset_variance(lines, k, along):
    """Variance of a line's offset at a place along it: that at its centroid, with the lever arm."""
    return (
        lines[k, at.S_COVARIANCE]
        + 2.0 * along * lines[k, at.S_COVARIANCE + 1]
        + along * along * lines[k, at.S_COVARIANCE + 3]
    )


@helper
def _place_along(lines, k, c, s, px, py):
    """Place of a point along a line of direction (c, s), from its centroid."""
    dx, dy = px - lines[k, at.S_CENTROID], py - lines[k, at.S_CENTROID + 1]
    return c * dx + s * dy


@helper
def grade_corner(corners, ints, k, kind, n, m):
    """Write the kind of a corner between segments of n and m measurements, and its quality.

    That is the share of such corners found again, by how their position spreads: √(1/n + 1/m) over
    the sine of their turn.
    """
    spread = math.sqrt(1.0 / n + 1.0 / m) / max(math.sin(corners[k, at.C_OPENING]), 1e-9)
    corners[k, at.C_QUALITY] = 1.0 / (1.0 + (spread / _SPREAD) ** _FALL)
    for letter in range(6):
        ints[k, at.C_KIND + letter] = at.CORNER_WORDS[kind, letter]


@helper
def write_edge(beam, segment, side, prominence, edges, ints, k):
    """Write which end of which segment an edge is, its beam, and its quality.

    That goes by its prominence: the measurements of its segment, times the jump in deviations of
    the edge, times the cosine of incidence.
    """
    edges[k, at.E_QUALITY] = 1.0 / (1.0 + (_PROMINENCE / prominence) ** _RISE)
    ints[k, at.E_BEAM], ints[k, at.E_SEGMENT] = beam, segment
    for letter in range(5):
        ints[k, at.E_SIDE + letter] = at.SIDE_WORDS[side, letter]


@helper
def write_breaks(places, beam, first, last, clusters, circular, gap, beams, breaks, k):
    """Write a breakpoint between each two neighbouring clusters, and at the ends of an open scan.

    `places` are x, y and range by measurement, `first` and `last` those of the clusters. Returns
    the number of the next row.
    """
    ints = breaks.view(np.int32)
    for c in range(1, clusters):
        _write_break(places, beam, last[c - 1], first[c], gap, beams, breaks, ints, k)
        k += 1
    if clusters == 0:
        return k
    before, after = last[clusters - 1], first[0]
    if circular:
        _write_break(places, beam, before, after, gap, beams, breaks, ints, k)
        return k + 1
    none, end = np.int64(-1), np.int64(at.SCAN_END)
    _write_mark(places, after, none, beam[after], end, none, breaks, ints, k)
    _write_mark(places, before, beam[before], none, end, none, breaks, ints, k + 1)
    return k + 2


@helper
def _write_break(places, beam, before, after, gap, beams, breaks, ints, k):
    """Of a jump the nearer side occludes. Over many missing beams a surface may go on unseen."""
    near = before if places[2, before] <= places[2, after] else after
    apart = beam[after] - beam[before]
    is_gap = apart + (beams if apart < 0 else 0) > gap
    kind = np.int64(at.GAP if is_gap else at.JUMP)
    occluder = np.int64(-1) if is_gap else beam[near]
    _write_mark(places, near, beam[before], beam[after], kind, occluder, breaks, ints, k)


@helper
def _write_mark(places, i, beam_before, beam_after, kind, occluder, breaks, ints, k):
    breaks[k, at.B_POSITION], breaks[k, at.B_POSITION + 1] = places[0, i], places[1, i]
    ints[k, at.B_BEAM], ints[k, at.B_BEAM + 1] = beam_before, beam_after
    ints[k, at.B_OCCLUDER] = occluder
    for letter in range(8):
        ints[k, at.B_KIND + letter] = at.KIND_WORDS[kind, letter]


@helper
def write_arc(center_x, center_y, radius, rms, covariance, first, last, count, arcs, k):
    """Write an arc; `covariance` are (xx, xy, xr, yy, yr, rr)."""
    ints = arcs.view(np.int32)
    arcs[k, at.A_CENTER], arcs[k, at.A_CENTER + 1] = center_x, center_y
    arcs[k, at.A_RADIUS], arcs[k, at.A_RMS] = radius, rms
    xx, xy, xr, yy, yr, rr = covariance
    for i, value in enumerate((xx, xy, xr, xy, yy, yr, xr, yr, rr)):
        arcs[k, at.A_COVARIANCE + i] = value
    ints[k, at.A_FIRST], ints[k, at.A_LAST], ints[k, at.A_POINTS] = first, last, count
