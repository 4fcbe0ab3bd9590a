"""The steps of method `optimal`, one scan after the other; ``docs/optimal.md`` derives them."""

import math

import numpy as np

from .. import inlined, kernel
from ..arrays import Floats1, Floats2, Ints1
from ...features import records as to
from ..noise import LEAST_SIGMA, fit_noise
from ..writing import write_arc, write_breaks, write_segment
from ..layout import Tables
from . import layout as at
from .arcs import find_arcs
from .clustering import cluster, list_clusters, list_points, opening
from .constants import UNIFORM
from .fits import measure
from .joining import join_all
from .costs import fill_sums
from .merging import clearest_border, merge_lines
from .partition import partition


@kernel
def extract_rows(
    ranges: Floats2,
    rows: Ints1,
    bearings: Floats2,
    given: Floats1,
    settings: tuple[float, float, bool, float, int],
    arrays: at.Work,
    results: Tables,
    noises: Floats2,
    counts: Ints1,
):
    """Find and measure the features of some scans. The last one's stay in the workspace.

    Parameters
    ----------
    ranges : float64 array, shape (m, n)
        One scan a row [m].
    rows : int
        How many of them are scans.
    bearings : float64 array, shape (2, n)
        Cosines and sines of the bearings.
    given : float64 array, shape (5,)
        (sigma, proportional, bearing, quantum, uncertainty), NaN where they are to be estimated.
    settings : (range_min, range_max, circular, evidence, missing)
        Limits of the ranges [m]; whether the beams go around; price of a line; missing beams over
        which a surface goes on.
    arrays, results : tuples of arrays
        As in `layout.Work` and `kernels.layout.Tables`.
    noises : float64 array, shape (m, 5)
        Written: the noise of each scan.
    counts : int64 array, shape (3 or more,)
        Written: measurements, lines and surfaces of the last scan.
    """
    range_min, range_max, circular, evidence, missing = settings
    work, tables = at.Work(*arrays), Tables(*results)
    beams, spans, n, estimated = work.beams, work.spans, ranges.shape[1], math.isnan(given[0])
    limits = range_min, range_max
    for row in range(rows[0]):
        start, closed, lines = np.int64(0), False, np.int64(0)
        count = list_points(work, ranges[row], start, limits, bearings)
        _estimate_noise(work, count, given, noises[row])
        count = cluster(work, count, n, circular, missing)
        if circular and count > 0:
            start, closed = opening(work, count)
        # A full circle without a break is opened anew where two lines differ the most.
        for _ in range(2 if closed else 1):
            if start > 0:
                count = list_points(work, ranges[row], start, limits, bearings)
                count = cluster(work, count, n, circular, missing)
            fill_sums(work.points, count, work.noise[at.CONSTANT], work.noise[at.GROWTH], work.sums)
            lines = partition(work, count, evidence)
            clearest = clearest_border(work, lines) if closed else np.int64(0)
            start = beams[at.BEAM, spans[at.FIRST, clearest]] if clearest > 0 else start
        scan = at.Scan(row, n, count, circular, evidence, missing)
        lines = merge_lines(work, lines, evidence)
        surfaces = measure(work, find_arcs(work, scan, lines), estimated, evidence)
        for table in range(tables.offsets.shape[1]):
            tables.offsets[row + 1, table] = tables.offsets[row, table]
        _write_surfaces(work, tables, scan, surfaces)
        join_all(work, tables, scan, surfaces)
        _write_clusters(work, tables, scan, surfaces)
        counts[0], counts[1], counts[2] = count, lines, surfaces


@inlined
def _estimate_noise(work, count, given, found):
    """Step 1: the noise, as given or estimated, in variances; and as it is `found`."""
    noise = work.noise
    for part in range(len(given)):
        found[part] = given[part]
    if math.isnan(given[0]):
        constant, growth, uncertainty, _ = fit_noise(
            work.points, work.beams[at.BEAM], count, at.TRIPLE, at.HALVES
        )
        noise[at.CONSTANT], noise[at.GROWTH], noise[at.BEARING] = constant, growth, 0.0
        found[0] = math.sqrt(constant) if count > 0 else math.nan
        found[1], found[2], found[3], found[4] = math.sqrt(growth), 0.0, 0.0, uncertainty
        return
    sigma, proportional, bearing, quantum = given[0], given[1], given[2], given[3]
    constant = sigma * sigma + quantum * quantum / UNIFORM
    noise[at.CONSTANT] = max(constant, LEAST_SIGMA * LEAST_SIGMA)
    noise[at.GROWTH], noise[at.BEARING] = proportional * proportional, bearing * bearing


@inlined
def _write_surfaces(work, tables, scan, surfaces):
    """Step 4: write the lines and arcs, which have no corners yet."""
    spans, beam, following = work.spans, work.beams[at.BEAM], tables.offsets[scan.row + 1]
    segments, ints = tables.segments, tables.segments.view(np.int32)
    for k in range(surfaces):
        p, first, last = work.pieces[k], spans[at.FIRST, k], spans[at.LAST, k]
        count, segment = spans[at.COUNT, k], following[to.SEGMENTS]
        spans[at.SEGMENT, k], spans[at.START, k], spans[at.END, k] = segment, 0, 0
        if spans[at.KIND, k] == at.LINE:
            line = p[at.CX], p[at.CY], p[at.UX], p[at.UY], p[at.OO], p[at.OA], p[at.AA], p[at.RMS]
            write_segment(
                work.points, beam, first, last, count, line, p[at.MISFIT], segments, ints, segment
            )
            following[to.SEGMENTS] += 1
        else:
            spread = p[at.XX], p[at.XY], p[at.XR], p[at.YY], p[at.YR], p[at.RR]
            x, y, radius, rms = p[at.CX], p[at.CY], p[at.RADIUS], p[at.RMS]
            first, last, arc = beam[first], beam[last], following[to.ARCS]
            write_arc(x, y, radius, rms, spread, first, last, count, tables.arcs, arc)
            following[to.ARCS] += 1


@inlined
def _write_clusters(work, tables, scan, surfaces):
    """Step 5: write the clusters, which cluster a segment is in, and what is between them."""
    beams, spans, clusters = work.beams, work.spans, tables.clusters[scan.row]
    ints, following = tables.segments.view(np.int32), tables.offsets[scan.row + 1]
    found = list_clusters(beams, scan.count, clusters)
    for k in range(surfaces):
        if spans[at.KIND, k] == at.LINE:
            first = beams[at.BEAM, spans[at.FIRST, k]]
            ints[spans[at.SEGMENT, k], to.S_CLUSTER] = clusters[first]
    # A circle without a break has nothing between clusters.
    parts = found if found > 0 and beams[at.BROKEN, beams[at.CLUSTER_FIRST, 0]] else 0
    following[to.BREAKPOINTS] = write_breaks(
        work.points, beams[at.BEAM], beams[at.CLUSTER_FIRST], beams[at.CLUSTER_LAST],
        parts, scan.circular, scan.missing, scan.beams, tables.breakpoints,
        following[to.BREAKPOINTS],
    )  # fmt: skip
