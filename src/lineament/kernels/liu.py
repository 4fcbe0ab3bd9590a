"""The stages of method `liu`, one scan after the other."""

from . import kernel
from .bilateral import filter_ranges
from .budget import LINK, WORST, limit_pieces
from .clustering import cluster
from .cutting import cut
from .layout import RANGE
from .measuring import measure
from .noise import estimate_noise


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
    sigma_d,
    sigma_r,
    half_width,
    scale,
    floor,
    density_k,
    min_points,
    radius,
    threshold,
    reading,
    source,
    fit,
    sharp,
    trim,
    floats,
    ints,
    counts,
    max_vertices,
    filter_scratch,
    budget_costs,
    budget_follow,
    noises,
    segments,
    corners,
    breaks,
    clusters,
    offsets,
):
    """Filter, cluster, cut and measure the first `rows` scans of `ranges`, shape (m, n).

    The other parameters are those of the stages. What a scan leaves in `floats`, `ints` and
    `counts` stays there until the next.
    """
    line = floats[RANGE]
    for row in range(rows):
        for i in range(ranges.shape[1]):
            line[i] = ranges[row, i]
        noise = noises[row]
        estimate_noise(floats, range_min, range_max, given_noise, noise)
        filter_ranges(
            floats, range_min, range_max, sigma_d, sigma_r, half_width, circular, filter_scratch
        )
        cluster(
            floats,
            ints,
            counts,
            bearings,
            step,
            circular,
            noise,
            scale,
            floor,
            density_k,
            min_points,
        )
        cut(floats, ints, counts, radius, threshold, reading, min_points)
        limit_pieces(
            floats,
            ints,
            counts,
            bearings,
            max_vertices,
            LINK,
            WORST,
            budget_costs,
            budget_follow,
        )
        measure(
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
            0.5 * radius,
            scale,
            segments,
            corners,
            breaks,
            clusters,
            offsets,
        )
