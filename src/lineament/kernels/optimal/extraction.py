"""The steps of method `optimal`, one scan after the other."""

import math

import numpy as np

from .. import helper, kernel
from ...features.records import S_CLUSTER
from ..writing import write_arc, write_breaks, write_segment
from .arcs import find_arcs
from .clustering import cluster, list_clusters, list_points, opening
from .fits import fit_line, scatter_of_means, soften_borders
from .joining import add_edge, are_near, cross, join
from .layout import (
    AA, BEAM, BROKEN, CLUSTER_FIRST, CLUSTER_LAST, COUNT, CX, CY, END, FIRST, KEY, KIND, LAST,
    LINE, MISFIT, OA, OO, RADIUS, RHO, RMS, RR, SEGMENT, START, UX, UY, X, XR, XX, XY, Y, YR, YY,
)  # fmt: skip
from .noise import estimate_noise
from .partition import fill_sums, joint_cost, merge_lines, partition, solve


@kernel
def extract_rows(
    ranges, rows, range_min, range_max, bearings, circular, given_noise, evidence, missing,
    points, beams, spans, pieces, sums, noise, noises, segments, corners, arcs, breaks, clusters,
    offsets, counts,
):  # fmt: skip
    """Find and measure the features of the first `rows` scans of `ranges`, shape (m, n).

    What a scan leaves in the workspace stays there until the next.
    """
    n, estimated = ranges.shape[1], math.isnan(given_noise[0])
    for row in range(rows):
        scan, start, closed, lines = ranges[row], np.int64(0), False, np.int64(0)
        count = list_points(scan, start, range_min, range_max, bearings, points, beams)
        estimate_noise(points, beams, count, given_noise, noise)
        count = cluster(points, beams, count, n, circular, noise, missing)
        if circular and count > 0:
            start, closed = opening(points, beams, count)
        # A full circle without a break is opened anew where two lines differ the most.
        for _ in range(2 if closed else 1):
            if start > 0:
                count = list_points(scan, start, range_min, range_max, bearings, points, beams)
                count = cluster(points, beams, count, n, circular, noise, missing)
            fill_sums(points, count, noise[0], noise[1], sums)
            lines = partition(points, beams, spans, count, sums, evidence)
            clearest = _clearest_border(spans, sums, lines) if closed else np.int64(0)
            start = beams[BEAM, spans[FIRST, clearest]] if clearest > 0 else start
        lines = merge_lines(points, beams, spans, points[KEY], sums, lines, noise, evidence)
        surfaces = find_arcs(points, beams, spans, pieces, sums, lines, count, noise, evidence)
        surfaces = _measure(points, beams, spans, pieces, sums, surfaces, noise, estimated)
        _write_surfaces(points, beams, spans, pieces, surfaces, row, segments, arcs, offsets)
        offsets[row + 1, 1] = _write_corners(
            points, beams, spans, pieces, sums, surfaces, count, n, circular, closed, missing,
            noise, segments, corners, offsets[row, 1], offsets[row, 0], evidence,
        )  # fmt: skip
        found = list_clusters(beams, count, clusters[row])
        for k in range(surfaces):
            if spans[KIND, k] == LINE:
                ints = segments.view(np.int32)
                ints[spans[SEGMENT, k], S_CLUSTER] = clusters[row, beams[BEAM, spans[FIRST, k]]]
        offsets[row + 1, 3] = write_breaks(
            points, beams[BEAM], beams[CLUSTER_FIRST], beams[CLUSTER_LAST],
            found if not closed or beams[BROKEN, 0] or found > 1 else 0, circular, missing, n,
            breaks, offsets[row, 3],
        )  # fmt: skip
        for part in range(4):
            noises[row, part] = 0.0 if estimated else given_noise[part]
        if estimated:
            noises[row, 0] = math.sqrt(noise[0]) if count > 0 else math.nan
            noises[row, 1] = math.sqrt(noise[1])
        counts[0], counts[1], counts[2] = count, lines, surfaces


@helper
def _write_corners(
    points, beams, spans, pieces, sums, surfaces, count, n, circular, closed, missing, noise,
    segments, corners, row, base, evidence,
):  # fmt: skip
    """Write the corners where surfaces meet, and the edges where they end.

    The scan's own segments begin at row `base`. Returns the number of the next row of `corners`.
    """
    for k in range(surfaces):
        m = (k + 1) % surfaces
        if m > k or (closed and m < k):
            row = join(
                points, beams, spans, pieces, sums, k, m, count, n, missing, noise, segments,
                corners, row, base, evidence,
            )  # fmt: skip
    # Through a slit, a surface behind may show between two lines.
    for k in range(surfaces):
        m = (k + 2) % surfaces
        both_end = (m > k or (closed and m != k)) and spans[END, k] == spans[START, m] == 0
        if both_end and are_near(points, spans, k, m):
            _, row = cross(
                points, beams, spans, pieces, sums, k, m, count, noise, segments, corners, row,
                base, evidence,
            )  # fmt: skip
    for k in range(surfaces):
        for way in (-1, 1):
            if spans[KIND, k] == LINE and not spans[END if way > 0 else START, k]:
                row = add_edge(
                    points, beams, spans, pieces, k, way, count, n, circular, missing, noise,
                    segments, corners, row, base,
                )  # fmt: skip
    return row


@helper
def _clearest_border(spans, sums, lines):
    """Return the line that χ² rises the most by if it and the one before become one; 0 if none."""
    found, largest = np.int64(0), -1.0
    for k in range(1, lines):
        before = spans[FIRST, k - 1], spans[LAST, k - 1] + 1
        rise = joint_cost(sums, before[0], before[1], spans[FIRST, k], spans[LAST, k] + 1)
        if rise > largest:
            found, largest = k, rise
    return found


@helper
def _measure(points, beams, spans, pieces, sums, surfaces, noise, estimated):
    """Fit the lines, and say how sure they are. Returns how many surfaces are left.

    A line whose centroid is not between its ends, or that is shorter than the spacing of its beams,
    runs along them: it is none.
    """
    kept = 0
    for k in range(surfaces):
        first, last = spans[FIRST, k], spans[LAST, k]
        spans[FIRST, kept], spans[LAST, kept], spans[KIND, kept] = first, last, spans[KIND, k]
        spans[COUNT, kept] = spans[COUNT, k]
        if spans[KIND, k] == LINE:
            a, b = solve(sums, first, last + 1)
            p = pieces[kept]
            spans[COUNT, kept] = fit_line(points, first, last + 1, a, b, noise, p)
            x, y = points[X], points[Y]
            begins = p[UX] * (x[first] - p[CX]) + p[UY] * (y[first] - p[CY])
            ends = p[UX] * (x[last] - p[CX]) + p[UY] * (y[last] - p[CY])
            spacing = abs(x[first] * y[first + 1] - y[first] * x[first + 1]) / points[RHO, first]
            if not (begins < 0.0 < ends and ends - begins > spacing):
                continue
        else:
            for column in range(len(pieces[k])):
                pieces[kept, column] = pieces[k, column]
        kept += 1
    surfaces = kept
    if estimated:
        scale = scatter_of_means(points, spans, pieces, surfaces, noise)
        for k in range(surfaces):
            if spans[KIND, k] == LINE:
                pieces[k, OO], pieces[k, AA] = scale * pieces[k, OO], scale * pieces[k, AA]
    soften_borders(beams, spans, pieces, sums, surfaces)
    return surfaces


@helper
def _write_surfaces(points, beams, spans, pieces, surfaces, row, segments, arcs, offsets):
    segment, arc, beam = offsets[row, 0], offsets[row, 2], beams[BEAM]
    ints = segments.view(np.int32)
    for k in range(surfaces):
        p, first, last, count = pieces[k], spans[FIRST, k], spans[LAST, k], spans[COUNT, k]
        spans[SEGMENT, k], spans[START, k], spans[END, k] = segment, 0, 0
        if spans[KIND, k] == LINE:
            line = p[CX], p[CY], p[UX], p[UY], p[OO], p[OA], p[AA], p[RMS]
            write_segment(
                points, beam, first, last, count, line, p[MISFIT], segments, ints, segment
            )
            segment += 1
        else:
            covariance = p[XX], p[XY], p[XR], p[YY], p[YR], p[RR]
            write_arc(
                p[CX], p[CY], p[RADIUS], p[RMS], covariance, beam[first], beam[last], count, arcs,
                arc,
            )  # fmt: skip
            arc += 1
    offsets[row + 1, 0], offsets[row + 1, 2] = segment, arc
