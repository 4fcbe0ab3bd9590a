"""From the pieces of scans to their features: fits, corners, breakpoints. For all methods."""

import math

import numpy as np

from . import helper, kernel
from .layout import (
    ARC_FIRST,
    ARC_LAST,
    ARC_R,
    ARC_RMS,
    ARC_RR,
    ARC_X,
    ARC_XR,
    ARC_XX,
    ARC_XY,
    ARC_Y,
    ARC_YR,
    ARC_YY,
    ARCS,
    BEAM,
    BEFORE,
    CLASS_FIRST,
    CLASS_LAST,
    CLASSES,
    CLOSED,
    COST,
    FIRST,
    LABEL,
    LAST,
    LINE_A,
    LINE_B,
    MEASURED_RHO,
    MEASURED_X,
    MEASURED_Y,
    PIECES,
    POINTS,
    RESPONSE,
)
from .line_fit import REFINED, WEIGHTED, excess, fit_line, range_variance, refine_line
from .records import (
    A_CENTER,
    A_COVARIANCE,
    A_FIRST,
    A_LAST,
    A_POINTS,
    A_RADIUS,
    A_RMS,
    B_BEAM,
    B_KIND,
    B_OCCLUDER,
    B_POSITION,
    C_BEAM,
    C_CONVEX,
    C_COVARIANCE,
    C_OPENING,
    C_POSITION,
    C_RESPONSE,
    C_SEGMENTS,
    GAP,
    JUMP,
    KIND_WORDS,
    S_ANGLE,
    S_CENTROID,
    S_CLUSTER,
    S_COVARIANCE,
    S_END,
    S_FIRST,
    S_LAST,
    S_POINTS,
    S_RMS,
    S_START,
    SCAN_END,
)


@kernel
def measure(
    floats,
    ints,
    counts,
    row,
    source,
    bearings,
    circular,
    noise,
    fit,
    sharp,
    trim,
    reach,
    gap,
    segments,
    corners,
    arcs,
    breaks,
    clusters,
    offsets,
):
    """Write the features of a scan behind those of the scans before it.

    Parameters
    ----------
    floats, ints, counts
        See `layout`. The lines by point, by class and by piece are read.
    row : int
        Which scan of the tables this is.
    source : int
        Line of the ranges to measure on: RANGE or FILTERED.
    bearings : float64 array, shape (2, n)
        Cosines and sines.
    circular : bool
    noise : float64 array, shape (4,)
    fit : int
        How lines are fitted, see `line_fit.fit_line`.
    sharp : bool
        Whether a corner is the intersection of its lines; else it is its point.
    trim : int
        Points next to a corner that are left out of the fits: the cut may be a beam or two off,
        so that they lie on the other wall.
    reach : float
        How many spacings an intersection may lie from the point at which the cut was made.
    gap : float
        Beams from one class to the next beyond which their break is a gap.
    segments, corners, arcs, breaks : float64 arrays
        The tables as words, see `records`; with room for n + 1 features of each kind a row.
    clusters : int32 array, shape (m, n)
        Result.
    offsets : int64 array, shape (m + 1, 4)
        Where the rows begin in the tables; the first is 0.
    """
    _place_measured(floats, ints, counts, source, bearings, clusters[row])
    x, y, rho = floats[MEASURED_X], floats[MEASURED_Y], floats[MEASURED_RHO]
    segment_ints, corner_ints = segments.view(np.int32), corners.view(np.int32)
    pieces = counts[PIECES]
    segment, corner = offsets[row, 0], offsets[row, 1]
    for k in range(pieces):
        first, last = ints[FIRST, k], ints[LAST, k]
        a, b = _clear_of_corners(ints[BEFORE], pieces, k, first, last, trim)
        if fit == REFINED:
            line = _refined_line(floats, ints, pieces, k, noise)
        else:
            line = fit_line(x, y, rho, a, b, noise, fit)
        _write_segment(x, y, ints, first, last, line, segments, segment_ints, segment + k)
    for k in range(pieces):
        before = ints[BEFORE, k]
        if before < 0:
            continue
        at = ints[FIRST, k]
        corner_ints[corner, C_BEAM] = ints[BEAM, at]
        corner_ints[corner, C_SEGMENTS] = before
        corner_ints[corner, C_SEGMENTS + 1] = k
        corners[corner, C_RESPONSE] = floats[RESPONSE, k]
        spacing, before = _local_spacing(x, y, at, counts[POINTS]), segment + before
        _write_opening(segments, before, segment + k, corners, corner_ints, corner)
        if not sharp or not _intersect(
            segments, before, segment + k, x[at], y[at], reach * spacing, corners, corner
        ):
            variance = range_variance(rho[at], noise)
            _place_at_beam(x[at], y[at], rho[at], spacing, variance, corners, corner)
        corner += 1
    offsets[row + 1, 0] = segment + pieces
    offsets[row + 1, 1] = corner
    offsets[row + 1, 2] = _write_arcs(floats, ints, counts, arcs, offsets[row, 2])
    offsets[row + 1, 3] = _write_breakpoints(
        floats,
        ints,
        counts,
        circular,
        gap,
        bearings.shape[1],
        breaks,
        breaks.view(np.int32),
        offsets[row, 3],
    )


@helper
def _place_measured(floats, ints, counts, source, bearings, clusters):
    """Place the points where they are measured, and spread their labels over the beams."""
    x, y, rho = floats[MEASURED_X], floats[MEASURED_Y], floats[MEASURED_RHO]
    ranges, beam, label = floats[source], ints[BEAM], ints[LABEL]
    cosines, sines = bearings[0], bearings[1]
    for i in range(len(cosines)):
        clusters[i] = -1
    for i in range(counts[POINTS]):
        b = beam[i]
        clusters[b] = label[i]
        r = ranges[b]
        x[i], y[i], rho[i] = r * cosines[b], r * sines[b], r


@helper
def _clear_of_corners(before, pieces, k, first, last, trim):
    """Leave out the points of a piece next to its corners, if enough are left for a line."""
    after = 0 if k + 1 == pieces else k + 1
    a = first + trim if before[k] >= 0 else first
    b = last - trim if before[after] == k else last
    return (a, b) if b - a >= 2 else (first, last)


@helper
def _refined_line(floats, ints, pieces, k, noise):
    """Fit the line of a piece from what is known of it: LINE_A, LINE_B, COST, and its corners."""
    x, y, rho = floats[MEASURED_X], floats[MEASURED_Y], floats[MEASURED_RHO]
    first, last, a, b = ints[FIRST, k], ints[LAST, k], floats[LINE_A, k], floats[LINE_B, k]
    if a == 0.0 and b == 0.0:  # Points all around: no line is the best.
        return fit_line(x, y, rho, first, last, noise, WEIGHTED)
    # What χ² has too much is the wall's own, along its normal.
    middle = rho[(first + last) // 2]
    square = min(1.0 / ((a * a + b * b) * middle * middle), 1.0)
    uneven = excess(floats[COST, k], last - first + 1) * range_variance(middle, noise) * square
    after = 0 if k + 1 == pieces else k + 1
    cuts = int(ints[BEFORE, k] >= 0) + int(ints[BEFORE, after] == k)
    return refine_line(x, y, rho, first, last, noise, a, b, uneven, cuts)


@helper
def _write_segment(x, y, ints, first, last, line, f, i, k):
    cx, cy, c, s, var_offset, covariance, var_angle, rms = line
    along = c * (x[first] - cx) + s * (y[first] - cy)
    f[k, S_START], f[k, S_START + 1] = cx + along * c, cy + along * s
    along = c * (x[last] - cx) + s * (y[last] - cy)
    f[k, S_END], f[k, S_END + 1] = cx + along * c, cy + along * s
    f[k, S_CENTROID], f[k, S_CENTROID + 1] = cx, cy
    f[k, S_ANGLE], f[k, S_RMS] = math.atan2(s, c), rms
    f[k, S_COVARIANCE], f[k, S_COVARIANCE + 1] = var_offset, covariance
    f[k, S_COVARIANCE + 2], f[k, S_COVARIANCE + 3] = covariance, var_angle
    i[k, S_FIRST], i[k, S_LAST] = ints[BEAM, first], ints[BEAM, last]
    i[k, S_POINTS], i[k, S_CLUSTER] = last - first + 1, ints[LABEL, first]


@helper
def _write_opening(segments, before, after, corners, corner_ints, k):
    """Angle between the arms of a corner, and which way it points."""
    turn = segments[after, S_ANGLE] - segments[before, S_ANGLE]
    if turn > math.pi:
        turn -= 2.0 * math.pi
    elif turn < -math.pi:
        turn += 2.0 * math.pi
    corners[k, C_OPENING] = math.pi - abs(turn)
    # Beams run counter-clockwise around the sensor: a right turn points towards it.
    corner_ints[k, C_CONVEX] = turn < 0.0


@helper
def _intersect(lines, a, b, x, y, near, corners, k):
    """Put a corner on the intersection of its lines, with Σ = A⁻¹ diag(s₁², s₂²) A⁻ᵀ.

    The lines then end there. Refused, and False, where that lies farther than `near` from the
    point (x, y) of the cut: nearly parallel lines meet anywhere.
    """
    n1x, n1y = -math.sin(lines[a, S_ANGLE]), math.cos(lines[a, S_ANGLE])
    n2x, n2y = -math.sin(lines[b, S_ANGLE]), math.cos(lines[b, S_ANGLE])
    determinant = n1x * n2y - n1y * n2x
    if abs(determinant) < 1e-6:
        return False
    d1 = n1x * lines[a, S_CENTROID] + n1y * lines[a, S_CENTROID + 1]
    d2 = n2x * lines[b, S_CENTROID] + n2y * lines[b, S_CENTROID + 1]
    px = (n2y * d1 - n1y * d2) / determinant
    py = (n1x * d2 - n2x * d1) / determinant
    if math.sqrt((px - x) * (px - x) + (py - y) * (py - y)) > near:
        return False
    corners[k, C_POSITION], corners[k, C_POSITION + 1] = px, py
    lines[a, S_END], lines[a, S_END + 1] = px, py
    lines[b, S_START], lines[b, S_START + 1] = px, py
    s1 = _offset_variance(lines, a, px, py) / (determinant * determinant)
    s2 = _offset_variance(lines, b, px, py) / (determinant * determinant)
    covariance = -(n2x * n2y * s1 + n1x * n1y * s2)
    corners[k, C_COVARIANCE] = n2y * n2y * s1 + n1y * n1y * s2
    corners[k, C_COVARIANCE + 1], corners[k, C_COVARIANCE + 2] = covariance, covariance
    corners[k, C_COVARIANCE + 3] = n2x * n2x * s1 + n1x * n1x * s2
    return True


@helper
def _offset_variance(lines, k, px, py):
    """Variance of a line's offset at a point: that at its centroid, with the lever arm."""
    dx, dy = px - lines[k, S_CENTROID], py - lines[k, S_CENTROID + 1]
    t = math.cos(lines[k, S_ANGLE]) * dx + math.sin(lines[k, S_ANGLE]) * dy
    return (
        lines[k, S_COVARIANCE]
        + 2.0 * t * lines[k, S_COVARIANCE + 1]
        + t * t * lines[k, S_COVARIANCE + 3]
    )


@helper
def _local_spacing(x, y, at, count):
    """Tell the larger of the distances of a point to its neighbours."""
    spacing = 0.0
    # A corner at the first point is that of a closed class, whose last point is its first again.
    for k in (at - 1 if at > 0 else count - 2, at + 1):
        dx, dy = x[k] - x[at], y[k] - y[at]
        spacing = max(spacing, math.sqrt(dx * dx + dy * dy))
    return spacing


@helper
def _place_at_beam(x, y, rho, spacing, variance, corners, k):
    """Put a corner on its point: off by up to half a spacing, and by the noise along the beam."""
    across, along, c, s = spacing * spacing / 12.0, variance, x / rho, y / rho
    corners[k, C_POSITION], corners[k, C_POSITION + 1] = x, y
    corners[k, C_COVARIANCE] = across + along * c * c
    corners[k, C_COVARIANCE + 1] = along * c * s
    corners[k, C_COVARIANCE + 2] = along * c * s
    corners[k, C_COVARIANCE + 3] = across + along * s * s


@helper
def _write_arcs(floats, ints, counts, arcs, k):
    arc_ints = arcs.view(np.int32)
    for j in range(counts[ARCS]):
        arcs[k, A_CENTER], arcs[k, A_CENTER + 1] = floats[ARC_X, j], floats[ARC_Y, j]
        arcs[k, A_RADIUS], arcs[k, A_RMS] = floats[ARC_R, j], floats[ARC_RMS, j]
        for i, covariance in enumerate(
            (ARC_XX, ARC_XY, ARC_XR, ARC_XY, ARC_YY, ARC_YR, ARC_XR, ARC_YR, ARC_RR)
        ):
            arcs[k, A_COVARIANCE + i] = floats[covariance, j]
        first, last = ints[ARC_FIRST, j], ints[ARC_LAST, j]
        arc_ints[k, A_FIRST], arc_ints[k, A_LAST] = ints[BEAM, first], ints[BEAM, last]
        arc_ints[k, A_POINTS] = last - first + 1
        k += 1
    return k


@helper
def _write_breakpoints(floats, ints, counts, circular, gap, beams, breaks, break_ints, k):
    """One between each two neighbouring classes, and at the ends of a scan that has ends."""
    first, last, classes = ints[CLASS_FIRST], ints[CLASS_LAST], counts[CLASSES]
    for c in range(1, classes):
        _write_break(floats, ints, last[c - 1], first[c], gap, beams, breaks, break_ints, k)
        k += 1
    if classes == 0 or counts[CLOSED] != 0:
        return k
    before, after = last[classes - 1], first[0]
    if circular:
        _write_break(floats, ints, before, after, gap, beams, breaks, break_ints, k)
        return k + 1
    none, end = np.int64(-1), np.int64(SCAN_END)
    _write_mark(floats, after, none, ints[BEAM, after], end, none, breaks, break_ints, k)
    _write_mark(floats, before, ints[BEAM, before], none, end, none, breaks, break_ints, k + 1)
    return k + 2


@helper
def _write_break(floats, ints, before, after, gap, beams, breaks, break_ints, k):
    """Of a jump the nearer side occludes. Over many missing beams a surface may go on unseen."""
    near = before if floats[MEASURED_RHO, before] <= floats[MEASURED_RHO, after] else after
    beam_before, beam_after = ints[BEAM, before], ints[BEAM, after]
    is_gap = (beam_after - beam_before) % beams > gap
    kind = GAP if is_gap else JUMP
    occluder = -1 if is_gap else ints[BEAM, near]
    _write_mark(floats, near, beam_before, beam_after, kind, occluder, breaks, break_ints, k)


@helper
def _write_mark(floats, at, beam_before, beam_after, kind, occluder, breaks, break_ints, k):
    breaks[k, B_POSITION] = floats[MEASURED_X, at]
    breaks[k, B_POSITION + 1] = floats[MEASURED_Y, at]
    break_ints[k, B_BEAM], break_ints[k, B_BEAM + 1] = beam_before, beam_after
    break_ints[k, B_OCCLUDER] = occluder
    for letter in range(8):
        break_ints[k, B_KIND + letter] = KIND_WORDS[kind, letter]
