"""From the pieces of scans to their features, for all methods but `optimal`."""

import math

import numpy as np

from . import helper, kernel
from .layout import (
    BEAM, BEFORE, CLASS_FIRST, CLASS_LAST, CLASSES, CLOSED, FIRST, LABEL, LAST, MEASURED_RHO,
    MEASURED_X, MEASURED_Y, PIECES, POINTS, RESPONSE,
)  # fmt: skip
from .line_fit import fit_line, normal_variance, range_variance
from ..features.records import (
    C_BEAM,
    C_COVARIANCE,
    C_POSITION,
    C_RESPONSE,
    C_SEGMENTS,
    S_CLUSTER,
    SHARP,
)
from .writing import grade_corner, intersect, write_breaks, write_opening, write_segment


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
    segments, corners, breaks : float64 arrays
        The tables as words, see `records`; with room for n + 1 features of each kind a row.
    clusters : int32 array, shape (m, n)
        Result.
    offsets : int64 array, shape (m + 1, 4)
        Where the rows begin in the tables; the first is 0.
    """
    _place_measured(floats, ints, counts, source, bearings, clusters[row])
    places, beam = floats[MEASURED_X : MEASURED_RHO + 1], ints[BEAM]
    x, y, rho = places[0], places[1], places[2]
    segment_ints, corner_ints = segments.view(np.int32), corners.view(np.int32)
    pieces = counts[PIECES]
    segment, corner = offsets[row, 0], offsets[row, 1]
    for k in range(pieces):
        first, last, n = ints[FIRST, k], ints[LAST, k], segment + k
        a, b = _clear_of_corners(ints[BEFORE], pieces, k, first, last, trim)
        line = fit_line(x, y, rho, a, b, noise, fit)
        count = last - first + 1
        misfit = _misfit(line, rho[(first + last) // 2], count, noise)
        write_segment(places, beam, first, last, count, line, misfit, segments, segment_ints, n)
        segment_ints[n, S_CLUSTER] = ints[LABEL, first]
    for k in range(pieces):
        before = ints[BEFORE, k]
        if before < 0:
            continue
        at = ints[FIRST, k]
        corner_ints[corner, C_BEAM] = beam[at]
        corner_ints[corner, C_SEGMENTS] = before
        corner_ints[corner, C_SEGMENTS + 1] = k
        corners[corner, C_RESPONSE] = floats[RESPONSE, k]
        spacing = _local_spacing(x, y, at, counts[POINTS])
        arms = ints[LAST, before] - ints[FIRST, before] + 1, ints[LAST, k] - at + 1
        before += segment
        write_opening(segments, before, segment + k, corners, corner_ints, corner)
        grade_corner(corners, corner_ints, corner, np.int64(SHARP), arms[0], arms[1])
        if not sharp or not intersect(
            segments, before, segment + k, x[at], y[at], reach * spacing, corners, corner
        ):
            variance = range_variance(rho[at], noise)
            _place_at_beam(x[at], y[at], rho[at], spacing, variance, corners, corner)
        corner += 1
    offsets[row + 1, 0] = segment + pieces
    offsets[row + 1, 1] = corner
    offsets[row + 1, 2] = offsets[row, 2]
    n, first, last, beams = counts[CLASSES], ints[CLASS_FIRST], ints[CLASS_LAST], bearings.shape[1]
    if counts[CLOSED]:
        n = 0  # All around, nothing ends.
    offsets[row + 1, 3] = write_breaks(
        places, beam, first, last, n, circular, gap, beams, breaks, offsets[row, 3]
    )


@helper
def _misfit(line, rho, count, noise):
    """Estimate what a surface is off a straight line, beyond the noise [m]."""
    cx, cy, c, s, _, _, _, rms = line
    scatter = normal_variance(s * cx - c * cy, rho, noise) * (1.0 - 2.0 / count)
    return math.sqrt(max(rms * rms - scatter, 0.0))


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
