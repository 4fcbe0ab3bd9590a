"""The last step of all methods but `optimal`: from the pieces of a scan to its features."""

import math
from typing import NamedTuple

import numpy as np

from ..features import records as col
from . import helper, kernel
from .arrays import Floats1, Floats2, Ints2
from .layout import Tables
from . import layout as at
from .line_fit import fit_line, normal_variance, range_variance
from .writing import (
    grade_corner,
    intersect,
    write_breaks,
    write_opening,
    write_place,
    write_segment,
)


#: Ends that are no farther apart, over what they are from the sensor, are one place.
_ROUNDING = 1e-12


class Options(NamedTuple):
    """How features are measured."""

    source: int  # row of `beams` with the ranges to measure on
    fit: int  # how lines are fitted, see `line_fit.fit_line`
    sharp: bool  # whether a corner is the intersection of its lines; else it is its point
    trim: int  # points next to a corner that fits leave out, as the cut may be a beam or two off
    reach: float  # spacings that an intersection may lie from the point of the cut
    gap: float  # beams from one cluster to the next beyond which their break is a gap


@kernel
def measure(
    floats: Floats2,
    ints: Ints2,
    row: int,
    bearings: Floats2,
    circular: bool,
    noise: Floats1,
    options: Options,
    tables: Tables,
):
    """Write the features of a scan, from points, clusters and pieces.

    They come behind those of the scans before it. A piece whose line has no length is no segment:
    the list of pieces keeps those that are, and corners join only these.

    Parameters
    ----------
    row : int
        Which scan of the tables this is.
    options : tuple
        See `Options`.
    tables : tuple of arrays
        Results. ``segments, corners, edges, arcs, breaks`` as words, see `records`, with room for
        n + 1 features of each kind a row; ``clusters``, int32, shape (m, n); ``offsets``, int64,
        shape (m + 1, 5), where the rows begin in the tables: the first is 0.
    """
    work, how = at.named(floats, ints), Options(*options)
    segments, corners, _, _, breaks, labels, offsets = tables
    counts, cut = work.counts, work.pieces
    _join_clusters(work)
    _place_measured(work.beams[how.source], work.points, work.marks, counts, bearings, labels[row])
    places, beam = work.points[at.MEASURED_X : at.MEASURED_RHO + 1], work.marks[at.BEAM]
    x, y, rho = places[0], places[1], places[2]
    segment_ints, corner_ints = segments.view(np.int32), corners.view(np.int32)
    pieces, kept, number = counts[at.PIECES], np.int64(0), work.waiting[at.FIRST]
    segment, corner = offsets[row, col.SEGMENTS], offsets[row, col.CORNERS]
    for k in range(pieces):
        first, last, n = cut[at.FIRST, k], cut[at.LAST, k], segment + kept
        # The first point of a ring is repeated at its end, and counts once.
        last -= counts[at.CLOSED] != 0 and last - first + 1 == counts[at.POINTS]
        a, b = _clear_of_corners(cut[at.BEFORE], pieces, k, first, last, how.trim)
        line = fit_line(x, y, rho, a, b, noise, how.fit)
        count = last - first + 1
        misfit = _misfit(line, rho[(first + last) // 2], count, noise)
        write_segment(places, beam, first, last, count, line, misfit, segments, segment_ints, n)
        segment_ints[n, col.S_CLUSTER] = work.marks[at.LABEL, first]
        number[k] = kept if _has_length(segments[n]) else -1
        kept += number[k] >= 0
    if kept < pieces:
        _keep_numbered(cut, work.response, number, pieces)
        pieces = counts[at.PIECES] = kept
    for k in range(pieces):
        before = cut[at.BEFORE, k]
        if before < 0:
            continue
        i = cut[at.FIRST, k]
        corner_ints[corner, col.C_BEAM] = beam[i]
        corner_ints[corner, col.C_SEGMENTS] = before
        corner_ints[corner, col.C_SEGMENTS + 1] = k
        corners[corner, col.C_RESPONSE] = work.response[k]
        spacing = _local_spacing(x, y, i, counts[at.POINTS])
        arms = cut[at.LAST, before] - cut[at.FIRST, before] + 1, cut[at.LAST, k] - i + 1
        before += segment
        write_opening(segments, before, segment + k, corners, corner_ints, corner)
        grade_corner(corners, corner_ints, corner, np.int64(col.SHARP), arms[0], arms[1])
        if not how.sharp or not intersect(
            segments, before, segment + k, x[i], y[i], how.reach * spacing, corners, corner
        ):
            variance = range_variance(rho[i], noise)
            _place_at_beam(x[i], y[i], rho[i], spacing, variance, corners, corner)
        corner += 1
    offsets[row + 1, col.SEGMENTS] = segment + pieces
    offsets[row + 1, col.CORNERS] = corner
    for table in (col.EDGES, col.ARCS):
        offsets[row + 1, table] = offsets[row, table]
    clusters = 0 if counts[at.CLOSED] else counts[at.CLUSTERS]  # All around, nothing ends.
    first, last = work.clusters[at.FIRST], work.clusters[at.LAST]
    offsets[row + 1, col.BREAKPOINTS] = write_breaks(
        places, beam, first, last, clusters, circular, how.gap, bearings.shape[1], breaks,
        offsets[row, col.BREAKPOINTS],
    )  # fmt: skip


@helper
def _join_clusters(work):
    """Join the clusters that a piece runs over: no surface ends within a line.

    The pieces of a map go over jumps, and over points that are in no cluster.
    """
    label, clusters, cut = work.marks[at.LABEL], work.clusters, work.pieces
    inside = True
    for k in range(work.counts[at.PIECES]):
        own = label[cut[at.FIRST, k]]
        inside = inside and own >= 0 and own == label[cut[at.LAST, k]]
    if inside:
        return
    before, n, piece, reached = np.int64(-1), np.int64(0), np.int64(0), np.int64(-1)
    for i in range(work.counts[at.POINTS]):
        own, goes_on = label[i], i <= reached or (label[i] >= 0 and label[i] == before)
        while piece < work.counts[at.PIECES] and cut[at.FIRST, piece] <= i:
            reached = max(reached, cut[at.LAST, piece])
            piece += 1
        before = own
        if own < 0 and i > reached:
            continue
        if not goes_on:
            clusters[at.FIRST, n] = i
            n += 1
        label[i], clusters[at.LAST, n - 1] = n - 1, i
    work.counts[at.CLUSTERS] = n


@helper
def _has_length(row):
    """Whether a segment's ends are apart: of measurements along their beams, they may not be."""
    x1, y1, x2, y2 = row[col.S_START], row[col.S_START + 1], row[col.S_END], row[col.S_END + 1]
    return row[col.S_LENGTH] > _ROUNDING * (abs(x1) + abs(y1) + abs(x2) + abs(y2))


@helper
def _keep_numbered(cut, response, number, pieces):
    """Keep the pieces that have a number, in place; a corner with one that has none is no more."""
    for k in range(pieces):
        n, before = number[k], cut[at.BEFORE, k]
        if n >= 0:
            cut[at.FIRST, n], cut[at.LAST, n], response[n] = (
                cut[at.FIRST, k],
                cut[at.LAST, k],
                response[k],
            )
            cut[at.BEFORE, n] = number[before] if before >= 0 else -1


@helper
def _misfit(line, rho, count, noise):
    """Estimate what a surface is off a straight line, beyond the noise [m]."""
    cx, cy, c, s, _, _, _, rms = line
    scatter = normal_variance(s * cx - c * cy, rho, noise) * (1.0 - 2.0 / count)
    return math.sqrt(max(rms * rms - scatter, 0.0))


@helper
def _place_measured(ranges, points, marks, counts, bearings, clusters):
    """Place the points where they are measured, and spread their labels over the beams."""
    x, y, rho = points[at.MEASURED_X], points[at.MEASURED_Y], points[at.MEASURED_RHO]
    beam, label, cosines, sines = marks[at.BEAM], marks[at.LABEL], bearings[0], bearings[1]
    for i in range(len(cosines)):
        clusters[i] = -1
    for i in range(counts[at.POINTS]):
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
def _local_spacing(x, y, i, count):
    """Return the larger of the distances of a point to its neighbours."""
    spacing = 0.0
    # A corner at the first point is that of a closed cluster, whose last point is its first again.
    for k in (i - 1 if i > 0 else count - 2, i + 1):
        dx, dy = x[k] - x[i], y[k] - y[i]
        spacing = max(spacing, math.sqrt(dx * dx + dy * dy))
    return spacing


@helper
def _place_at_beam(x, y, rho, spacing, variance, corners, k):
    """Put a corner on its point: off by up to half a spacing, and by the noise along the beam."""
    across, c, s = spacing * spacing / 12.0, x / rho, y / rho
    write_place(corners, k, x, y, across + variance, c, s, across, -s, c)
