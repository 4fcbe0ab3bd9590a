"""The stages of method `optimal`, one scan after the other."""

import math

from . import helper, kernel
from .agglomeration import agglomerate, list_stretches
from .arcs import find_arcs
from .borders import dissolve, move_border, trim_ends
from .budget import LINK
from .clustering import list_points, part_points
from .inverse_range import fill_sums
from .joining import join
from .layout import (
    ARCS,
    BEAM,
    BEFORE,
    CANDIDATES,
    CLASS_FIRST,
    CLASS_LAST,
    CLASSES,
    CLOSED,
    DENSITY_THRESHOLD,
    DISTANCE_THRESHOLD,
    FIRST,
    LAST,
    PIECES,
    RANGE,
    RHO,
)
from .line_fit import REFINED, WEIGHTED, range_variance
from .measuring import measure
from .noise import estimate_by_range
from .polylines import fit_polylines
from .residual_noise import refine_noise
from .spikes import drop_spikes
from .straightening import drop_crooked, straighten
from .vertices import hold_together

#: Parts that can be left out, to see what each is worth.
SPIKES, GROWTH, BORDERS, DISSOLVING, ARCS_TOO, STRAIGHTENING = 1, 2, 4, 8, 16, 32

#: No scanner sees nearer or farther [m], and the fourth powers of much less or more are no numbers.
_NEAREST, _FARTHEST = 1e-6, 1e6
#: Tangent of the steepest incidence at which a wall is expected to hold together (86°).
_STEEPEST = 14.3
#: Deviations of the distance of two readings that are added to the spacing of a surface.
_FLOOR = 5.0
#: Points of the stretches that pieces are made of.
_STRETCH = 4
#: Pieces of up to so many points may dissolve.
_SMALL = 32
#: Points that a border is moved by at first, and when the pieces are settled.
_MARGIN = 5
#: Share of the evidence that the first merging asks for, before the borders are moved.
_FIRST_SHARE = 0.3
#: χ² from which on a reading is on no line, and what an arc costs in lines.
_PRICE, _ARC_PRICE = 14.0, 1.5
#: Error of a range from which on a point is better left out of a map [m], and how many spacings the
#: fitted lines may meet from a vertex of it for their covariance to be that of the vertex.
_WORST, _NEAR = 0.31, 2.0


@kernel
def extract_rows(
    ranges,
    rows,
    range_min,
    range_max,
    bearings,
    step,
    circular,
    given_noise,
    evidence,
    max_missing,
    parts,
    max_vertices,
    floats,
    ints,
    counts,
    sums,
    map_costs,
    map_follow,
    noises,
    segments,
    corners,
    arcs,
    breaks,
    clusters,
    offsets,
):
    """Find and measure the features of the first `rows` scans of `ranges`, shape (m, n).

    `parts` are those of the method that are not left out. What a scan leaves in `floats`, `ints`
    and `counts` stays there until the next.
    """
    line, fit, reach = floats[RANGE], REFINED, math.inf
    range_min, range_max = max(range_min, _NEAREST), min(range_max, _FARTHEST)
    for row in range(rows):
        for i in range(ranges.shape[1]):
            line[i] = ranges[row, i]
        noise = noises[row]
        for part in range(4):
            noise[part] = given_noise[part]
        unknown = math.isnan(given_noise[0])
        if unknown:
            noise[2], noise[3] = 0.0, 0.0
            estimate_by_range(floats, range_min, range_max, parts & GROWTH != 0, noise)
        # What a map leaves out is for its vertices to decide.
        spikes = parts & SPIKES and max_vertices == 0
        apart = 2.0 * _STEEPEST * step if spikes else -math.inf
        drop_spikes(floats, range_min, range_max, noise, apart)
        cluster(floats, ints, counts, bearings, circular, noise, max_missing)
        if max_vertices == 0:
            cut(floats, ints, counts, noise, unknown, evidence, parts, sums)
            join(floats, ints, counts, noise, sums, step)
        else:
            fit_polylines(
                floats,
                ints,
                counts,
                bearings,
                max_vertices,
                max_missing,
                LINK,
                _WORST,
                map_costs,
                map_follow,
            )
            fit, reach = WEIGHTED, _NEAR
        measure(
            floats,
            ints,
            counts,
            row,
            RANGE,
            bearings,
            circular,
            noise,
            fit,
            True,
            0,
            reach,
            max_missing + 0.0,
            segments,
            corners,
            arcs,
            breaks,
            clusters,
            offsets,
        )
        if max_vertices > 0:
            hold_together(floats, ints, counts, row, segments, corners, offsets)


@helper
def cluster(floats, ints, counts, bearings, circular, noise, max_missing):
    """Part the points where more than `max_missing` beams are missing, or they are too far apart.

    Too far for a surface met at the steepest incidence that is expected, and for the noise.
    """
    n, beam, rho = bearings.shape[1], ints[BEAM], floats[RHO]
    limit, second = floats[DISTANCE_THRESHOLD], floats[DENSITY_THRESHOLD]
    count = list_points(floats, ints, bearings)
    for i in range(count):
        before = i - 1 if i > 0 else count - 1
        a, b = beam[before], beam[i]
        limit[i], second[i] = math.nan, math.nan
        if (b - a - 1) % n > max_missing:
            continue
        sine = abs(bearings[0, a] * bearings[1, b] - bearings[1, a] * bearings[0, b])
        near, far = min(rho[before], rho[i]), max(rho[before], rho[i])
        floor = _FLOOR * math.sqrt(2.0 * range_variance(far, noise))
        limit[i] = _STEEPEST * near * sine + floor
    # A density factor of NaN: nothing is joined by its density.
    part_points(floats, ints, counts, bearings, circular, count, math.nan, 3)
    if counts[CLOSED] and counts[CLASSES] > 0:
        ints[CLASS_LAST, 0] -= 1  # Its first point stands again at the end.


@helper
def cut(floats, ints, counts, noise, unknown, evidence, parts, sums):
    """Cut the classes into pieces of a line each, and arcs."""
    fill_sums(floats, ints, counts, noise, sums)
    n, ends = 0, ints[BEFORE]
    for c in range(counts[CLASSES]):
        low, n = n, list_stretches(ints, ints[CLASS_FIRST, c], ints[CLASS_LAST, c], _STRETCH, n)
        n = agglomerate(floats, ints, sums, c, low, n, _FIRST_SHARE * evidence)
        for k in range(low + 1, n if parts & BORDERS else low):
            move_border(floats, ints, sums, c, k, _MARGIN, _PRICE)
        n = agglomerate(floats, ints, sums, c, low, n, evidence)
        ends[c] = n
    counts[PIECES], counts[CANDIDATES], counts[ARCS] = n, 0, 0
    if unknown:
        refine_noise(floats, ints, counts, noise, sums)
        fill_sums(floats, ints, counts, noise, sums)
    n, end = 0, 0
    for c in range(counts[CLASSES]):
        low, start, end = n, end, ends[c]
        for k in range(start, end):
            ints[FIRST, n], ints[LAST, n] = ints[FIRST, k], ints[LAST, k]
            n += 1
        n = _settle(floats, ints, sums, c, low, n, evidence, parts)
        if parts & ARCS_TOO:
            n = find_arcs(floats, ints, counts, noise, sums, c, low, n, evidence, _ARC_PRICE)
        if parts & STRAIGHTENING:
            n = straighten(floats, ints, noise, sums, c, low, n)
            n = drop_crooked(floats, ints, sums, c, low, n)
    counts[PIECES] = n


@helper
def _settle(floats, ints, sums, c, low, high, evidence, parts):
    """Put borders where they belong, and merge again what then is one."""
    high = agglomerate(floats, ints, sums, c, low, high, evidence)
    for _ in range(2):
        for k in range(low + 1, high if parts & BORDERS else low):
            move_border(floats, ints, sums, c, k, 3 * _MARGIN, _PRICE)
        if parts & DISSOLVING:
            high = dissolve(floats, ints, sums, c, low, high, _SMALL, evidence, _PRICE)
            for k in range(low, high):
                trim_ends(floats, ints, sums, c, k, _PRICE)
    return agglomerate(floats, ints, sums, c, low, high, evidence)
