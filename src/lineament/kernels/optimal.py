"""The stages of method `optimal`, one scan after the other."""

import math

from . import helper, kernel
from .agglomeration import agglomerate, list_stretches, part_again
from .arcs import find_arcs, fit_arc
from .borders import dissolve, move_border, trim_ends
from .budget import LINK
from .clustering import list_points, part_points
from .inverse_range import fill_sums
from .joining import join
from .layout import (
    ARC_FIRST,
    ARC_LAST,
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
from .sifting import drop_radial, drop_round
from .spikes import drop_spikes
from .straightening import drop_crooked, straighten
from .unevenness import MOST_UNEVEN, wall_unevenness
from .vertices import hold_together

#: Parts that can be left out, to see what each is worth.
SPIKES, GROWTH, BORDERS, DISSOLVING, ARCS_TOO, STRAIGHTENING, UNEVENNESS = 1, 2, 4, 8, 16, 32, 64

#: No scanner sees nearer or farther [m], and the fourth powers of much less or more are no numbers.
_NEAREST, _FARTHEST = 1e-6, 1e6
#: Tangent of the steepest incidence at which a wall is expected to hold together (86°).
_STEEPEST = 14.3
#: The same where it steps: its inverse range changes by so many times what it does on either side.
_STEEP, _UNEVEN = 5.0, 1.4
#: Panels, frames and baseboards stand out by less than that, and part no wall [m].
_LEDGE = 0.15
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
#: By how much more both cost where walls are most uneven.
_DEARER, _ARC_DEARER = 0.3, 0.7
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
            estimate_by_range(floats, bearings, range_min, range_max, parts & GROWTH != 0, noise)
        # What a map leaves out is for its vertices to decide.
        spikes = parts & SPIKES and max_vertices == 0
        apart = 2.0 * _STEEPEST * step if spikes else -math.inf
        drop_spikes(floats, range_min, range_max, noise, apart)
        cluster(floats, ints, counts, bearings, circular, noise, max_missing)
        if max_vertices == 0:
            uneven = cut(floats, ints, counts, noise, unknown, evidence, parts, sums)
            sigma = noise[0]
            noise[0] = math.sqrt(sigma * sigma + uneven)
            join(floats, ints, counts, noise, sums, step)
            noise[0] = sigma
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

    Too far for a surface met at the steepest incidence that is expected, and for the noise. That is
    less steep where the inverse range, which along a wall changes evenly, makes a step.
    """
    n, beam, rho = bearings.shape[1], ints[BEAM], floats[RHO]
    limit, second = floats[DISTANCE_THRESHOLD], floats[DENSITY_THRESHOLD]
    count = list_points(floats, ints, bearings)
    for i in range(count):
        before = i - 1 if i > 0 else count - 1
        a, b = beam[before], beam[i]
        limit[i], second[i] = math.nan, math.nan
        beams = b - a if b > a else b - a + n
        if beams - 1 > max_missing:
            continue
        sine = abs(bearings[0, a] * bearings[1, b] - bearings[1, a] * bearings[0, b])
        near, far = min(rho[before], rho[i]), max(rho[before], rho[i])
        floor = _FLOOR * math.sqrt(2.0 * range_variance(far, noise))
        steepest = _STEEPEST
        if far - near > floor + _LEDGE:
            slope = max(_slope(rho, beam, before, count, n), _slope(rho, beam, i + 1, count, n))
            even = _UNEVEN * slope * beams * near * far
            steepest = _STEEP if far - near - even > floor + _LEDGE else _STEEPEST
        limit[i] = steepest * near * sine + floor
    # A density factor of NaN: nothing is joined by its density.
    part_points(floats, ints, counts, bearings, circular, count, math.nan, 3)
    if counts[CLOSED] and counts[CLASSES] > 0:
        ints[CLASS_LAST, 0] -= 1  # Its first point stands again at the end.


@helper
def _slope(rho, beam, i, count, n):
    """Tell how much the inverse range of a point differs from the one before, over a beam [1/m]."""
    i = i if i < count else 0
    before = i - 1 if i > 0 else count - 1
    beams = max((beam[i] - beam[before]) % n, 1)
    return abs(rho[i] - rho[before]) / (rho[i] * rho[before] * beams)


@helper
def cut(floats, ints, counts, noise, unknown, evidence, parts, sums):
    """Cut the classes into pieces of a line each, and arcs.

    Returns
    -------
    float
        How uneven the walls are, a variance [m²]: so much is added to that of the noise where it is
        decided what is one. `sums` are of the noise alone, for what is measured.
    """
    sigma, ends, uneven = noise[0], ints[BEFORE], 0.0
    _part(floats, ints, counts, noise, evidence, parts, sums, ends)
    if unknown:
        refine_noise(floats, ints, counts, noise, sums)
        fill_sums(floats, ints, counts, noise, sums)
        sigma = noise[0]
    if parts & UNEVENNESS:
        uneven = wall_unevenness(floats, ints, counts, noise, sums, ends)
    share = uneven / (MOST_UNEVEN * MOST_UNEVEN)
    price, arc_price = _PRICE * (1.0 + _DEARER * share), _ARC_PRICE * (1.0 + _ARC_DEARER * share)
    if uneven > 0.0:
        noise[0] = math.sqrt(sigma * sigma + uneven)
        fill_sums(floats, ints, counts, noise, sums)
    n, end = 0, 0
    for c in range(counts[CLASSES]):
        low, start, end = n, end, ends[c]
        for k in range(start, end):
            ints[FIRST, n], ints[LAST, n] = ints[FIRST, k], ints[LAST, k]
            n += 1
        n = _settle(floats, ints, sums, c, low, n, evidence, price, parts)
        if parts & ARCS_TOO:
            n = find_arcs(floats, ints, counts, noise, uneven, sums, c, low, n, evidence, arc_price)
        if parts & STRAIGHTENING:
            n = straighten(floats, ints, noise, sums, c, low, n)
            n = drop_crooked(floats, ints, sums, c, low, n)
        n = drop_round(floats, ints, noise, low, n)
    counts[PIECES] = n
    if uneven > 0.0:
        noise[0] = sigma
        fill_sums(floats, ints, counts, noise, sums)
        for arc in range(counts[ARCS]):
            fit_arc(floats, ints[ARC_FIRST, arc], ints[ARC_LAST, arc], noise, arc)
    drop_radial(floats, ints, counts, sums)
    return uneven


@helper
def _part(floats, ints, counts, noise, evidence, parts, sums, ends):
    """Cut the classes into pieces by merging stretches; those of class c end at ends[c]."""
    fill_sums(floats, ints, counts, noise, sums)
    n = 0
    for c in range(counts[CLASSES]):
        low, n = n, list_stretches(ints, ints[CLASS_FIRST, c], ints[CLASS_LAST, c], _STRETCH, n)
        n = agglomerate(floats, ints, sums, c, low, n, _FIRST_SHARE * evidence)
        for k in range(low + 1, n if parts & BORDERS else low):
            move_border(floats, ints, sums, c, k, _MARGIN, _PRICE)
        n = agglomerate(floats, ints, sums, c, low, n, evidence)
        n = part_again(ints, sums, c, low, n, evidence)
        ends[c] = n
    counts[PIECES], counts[CANDIDATES], counts[ARCS] = n, 0, 0


@helper
def _settle(floats, ints, sums, c, low, high, evidence, price, parts):
    """Put borders where they belong, and merge again what then is one."""
    high = agglomerate(floats, ints, sums, c, low, high, evidence)
    for _ in range(2):
        for k in range(low + 1, high if parts & BORDERS else low):
            move_border(floats, ints, sums, c, k, 3 * _MARGIN, price)
        if parts & DISSOLVING:
            high = dissolve(floats, ints, sums, c, low, high, _SMALL, evidence, price)
            for k in range(low, high):
                trim_ends(floats, ints, sums, c, k, price)
    return agglomerate(floats, ints, sums, c, low, high, evidence)
