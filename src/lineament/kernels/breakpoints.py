"""Point-distance-based segmentation: clusters that end where neighbours are too far apart.

The rules that C. Premebida, U. Nunes, *Segmentation and geometric primitives extraction from 2D
laser range data for mobile robot applications* (2005) collect, and that of G. A. Borges,
M.-J. Aldon, *Line extraction in 2D range images for mobile robotics* (2004).
"""

import math

from . import LARGEST, helper, kernel, usable
from .arrays import Floats1, Floats2, Ints2
from .layout import Sensor
from . import layout as at
from .clustering import list_points, part_points
from .line_fit import range_variance

#: What the distance of two neighbouring points is compared with.
FIXED, DIETMAYER, SANTOS, LEE, BORGES_ALDON = range(5)


@kernel
def part_by_distance(
    floats: Floats2,
    ints: Ints2,
    bearings: Floats2,
    sensor: Sensor,
    noise: Floats1,
    rule: tuple[int, float, float],
    max_missing: int,
    min_points: int,
):
    """Part the usable beams of a scan into clusters, by their distances alone.

    From RANGE, FILTERED (the usable ranges, as measured), the points with their thresholds
    (DENSITY_THRESHOLD is NaN), and the clusters. There are no pieces and no candidates.

    Parameters
    ----------
    sensor : tuple
        (range_min, range_max, step, circular); `circular`: whether the last cluster may go on in
        the first.
    rule : tuple
        (rule, constant, angle), as in `distance_threshold`.
    max_missing : int
        Missing beams in a row over which a cluster goes on.
    min_points : int
        Smaller clusters are noise.
    """
    work, n = at.named(floats, ints), bearings.shape[1]
    range_min, range_max, _, circular = sensor
    measured, ranges, points = work.beams[at.RANGE], work.beams[at.FILTERED], work.points
    limit, second = points[at.DISTANCE_THRESHOLD], points[at.DENSITY_THRESHOLD]
    rho, beam, cosines, sines = points[at.RHO], work.marks[at.BEAM], bearings[0], bearings[1]
    least, most = max(range_min, 1.0 / LARGEST), min(range_max, LARGEST)
    for i in range(n):
        r = measured[i]
        ranges[i] = r if usable(r, least, most) else math.nan
    count = list_points(work.beams, points, work.marks, bearings)
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
        limit[i] = distance_threshold(rho[before], rho[i], cosine, sine, noise, rule)
    # A density factor of NaN: nothing is joined by its density.
    part_points(work, bearings, circular, count, math.nan, min_points)
    work.counts[at.PIECES], work.counts[at.CANDIDATES] = 0, 0


@helper
def distance_threshold(before, rho, cosine, sine, noise, rule):
    """Distance of two neighbouring points up to which they lie on one surface [m].

    FIXED: D_0. DIETMAYER: C_0 + C_1 min(ρ_i, ρ_{i-1}), C_1 = sqrt(2 (1 - cos Δφ)). SANTOS: the
    same, with C_1 over cot β (cos Δφ/2 - sin Δφ/2). LEE: |ρ_i - ρ_{i-1}| / (ρ_i + ρ_{i-1}) ≤ r.
    BORGES_ALDON: ρ_{i-1} sin Δφ / sin(λ - Δφ) + k σ.

    Lee's ratio is one of ranges, and the threshold the distance of two points that have it: with
    S = ρ_i + ρ_{i-1} and D = ρ_i - ρ_{i-1}, the cosine rule gives d² = D² cos² Δφ/2 + S² sin² Δφ/2,
    so that |D| ≤ r S and d² ≤ S² (r² cos² Δφ/2 + sin² Δφ/2) are the same.

    `before` and `rho` are ρ_{i-1} and ρ_i [m], `cosine` and `sine` those of Δφ, and `rule` is
    (rule, constant, angle): D_0 or C_0 [m], r, or k; β or λ [rad]. NaN where by the rule no surface
    meets both beams.
    """
    kind, constant, angle = rule
    if kind == FIXED:
        return constant
    half_sine = math.sqrt(max(0.5 * (1.0 - cosine), 0.0))
    half_cosine = math.sqrt(max(0.5 * (1.0 + cosine), 0.0))
    if kind == LEE:
        return (before + rho) * math.hypot(constant * half_cosine, half_sine)
    if kind == BORGES_ALDON:
        # sin(λ - Δφ); not above 0 where a surface at λ to the one beam misses the other.
        opposite = math.sin(angle) * cosine - math.cos(angle) * sine
        noise_floor = constant * math.sqrt(range_variance(before, noise))
        return before * sine / opposite + noise_floor if opposite > 0.0 else math.nan
    # C_1 = sqrt(2 (1 - cos Δφ)) = 2 sin Δφ/2.
    reach = 2.0 * half_sine * min(before, rho)
    if kind == DIETMAYER:
        return constant + reach
    steep = half_cosine - half_sine
    return constant + reach * math.tan(angle) / steep if steep > 0.0 else math.nan
