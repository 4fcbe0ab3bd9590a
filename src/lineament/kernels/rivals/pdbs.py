"""Point-distance-based segmentation: clusters that end where neighbours are too far apart."""

import math

from .. import helper, kernel, usable
from ..clustering import list_points, part_points
from ..layout import (
    BEAM,
    CANDIDATES,
    DENSITY_THRESHOLD,
    DISTANCE_THRESHOLD,
    FILTERED,
    PIECES,
    RANGE,
    RHO,
)
from ..line_fit import range_variance

#: What the distance of two neighbouring points is compared with.
FIXED, DIETMAYER, SANTOS, LEE, BORGES_ALDON = 0, 1, 2, 3, 4


@kernel
def part_by_distance(
    floats,
    ints,
    counts,
    bearings,
    circular,
    range_min,
    range_max,
    noise,
    rule,
    constant,
    angle,
    max_missing,
    min_points,
):
    """Part the usable beams of a scan into classes, by their distances alone.

    Parameters
    ----------
    floats, ints, counts
        See `layout`. RANGE is read; FILTERED (the usable ranges, as measured), the lines by
        point, SPACING and the thresholds are written (DENSITY_THRESHOLD is NaN), and the
        classes. PIECES and CANDIDATES are 0.
    bearings : float64 array, shape (2, n)
        Cosines and sines.
    circular : bool
        Whether the last class may go on in the first.
    range_min, range_max : float
    noise : float64 array, shape (4,)
    rule : int
    constant, angle : float
        As in `distance_threshold`.
    max_missing : int
        Missing beams in a row over which a class goes on.
    min_points : int
        Smaller classes are noise.
    """
    n, cosines, sines = bearings.shape[1], bearings[0], bearings[1]
    measured, ranges = floats[RANGE], floats[FILTERED]
    limit, second = floats[DISTANCE_THRESHOLD], floats[DENSITY_THRESHOLD]
    rho, beam = floats[RHO], ints[BEAM]
    for i in range(n):
        r = measured[i]
        ranges[i] = r if usable(r, range_min, range_max) else math.nan
    count = list_points(floats, ints, bearings)
    for i in range(count):
        second[i] = math.nan
        before = i - 1 if i > 0 else count - 1
        a, b = beam[before], beam[i]
        if (b - a - 1) % n > max_missing:
            limit[i] = math.nan
            continue
        # Of the angle between the two beams, however many are missing between them.
        cosine = cosines[a] * cosines[b] + sines[a] * sines[b]
        sine = cosines[a] * sines[b] - sines[a] * cosines[b]
        limit[i] = distance_threshold(
            rho[before], rho[i], cosine, sine, noise, rule, constant, angle
        )
    # A density factor of NaN: nothing is joined by its density.
    part_points(floats, ints, counts, bearings, circular, count, math.nan, min_points)
    counts[PIECES], counts[CANDIDATES] = 0, 0


@helper
def distance_threshold(before, rho, cosine, sine, noise, rule, constant, angle):
    """Distance of two neighbouring points up to which they lie on one surface [m].

    FIXED: D_0. DIETMAYER: C_0 + C_1 min(ρ_i, ρ_{i-1}), C_1 = sqrt(2 (1 - cos Δφ)). SANTOS: the
    same, with C_1 over cot β (cos Δφ/2 - sin Δφ/2). LEE: |ρ_i - ρ_{i-1}| / (ρ_i + ρ_{i-1}) ≤ r.
    BORGES_ALDON: ρ_{i-1} sin Δφ / sin(λ - Δφ) + k σ.

    Lee's ratio is one of ranges, and the threshold the distance of two points that have it: with
    S = ρ_i + ρ_{i-1} and D = ρ_i - ρ_{i-1}, the cosine rule gives d² = D² cos² Δφ/2 + S² sin² Δφ/2,
    so that |D| ≤ r S and d² ≤ S² (r² cos² Δφ/2 + sin² Δφ/2) say the same.

    Parameters
    ----------
    before, rho : float
        ρ_{i-1} and ρ_i [m].
    cosine, sine : float
        Of the angle Δφ between their beams.
    noise : float64 array, shape (4,)
    rule : int
    constant : float
        D_0 or C_0 [m], r, or k.
    angle : float
        β or λ [rad].

    Returns
    -------
    float
        NaN where the rule knows no surface that both beams meet.
    """
    if rule == FIXED:
        return constant
    half_sine = math.sqrt(max(0.5 * (1.0 - cosine), 0.0))
    half_cosine = math.sqrt(max(0.5 * (1.0 + cosine), 0.0))
    if rule == LEE:
        return (before + rho) * math.hypot(constant * half_cosine, half_sine)
    if rule == BORGES_ALDON:
        # sin(λ - Δφ); not above 0 where a surface at λ to the one beam misses the other.
        opposite = math.sin(angle) * cosine - math.cos(angle) * sine
        noise_floor = constant * math.sqrt(range_variance(before, noise))
        return before * sine / opposite + noise_floor if opposite > 0.0 else math.nan
    # C_1 = sqrt(2 (1 - cos Δφ)) = 2 sin Δφ/2.
    reach = 2.0 * half_sine * min(before, rho)
    if rule == DIETMAYER:
        return constant + reach
    steep = half_cosine - half_sine
    return constant + reach * math.tan(angle) / steep if steep > 0.0 else math.nan
