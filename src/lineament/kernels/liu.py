"""The steps of Liu et al. 2023, one scan after the other."""

from collections import namedtuple

from . import kernel
from . import layout as at
from .bilateral import filter_ranges
from .budget import LINK, WORST, limit_pieces
from .clustering import cluster
from .cutting import cut
from .measuring import measure
from .noise import estimate_noise


#: Those of `methods.liu.Liu`; choices as the numbers that the kernels of the steps take.
Parameters = namedtuple(
    "Parameters",
    "sigma_d sigma_r half_width spacing_scale noise_floor density_k min_points support_radius "
    "threshold response recursion ends fit measure corner corner_trim max_vertices",
)


@kernel
def extract_rows(
    ranges, rows, bearings, sensor, given_noise, parameters, floats, ints, scratch, noises, tables
):
    """Filter, cluster, cut and measure the first `rows` scans of `ranges`, shape (m, n).

    What a scan leaves in the workspace stays there until the next.

    Parameters
    ----------
    sensor : tuple
        (range_min, range_max, step, circular).
    given_noise : float64 array, shape (5,)
        See `noise.estimate_noise`.
    parameters : tuple
        See `Parameters`.
    scratch : tuple
        That of `bilateral.filter_ranges`, and the two arrays of `budget.limit_pieces`.
    noises : float64 array, shape (m, 5)
        Result: the noise of each scan.
    tables : tuple
        See `measuring.measure`.
    """
    p, line = Parameters(*parameters), at.beams_of(floats)[at.RANGE]
    range_min, range_max, step, circular = sensor
    filter_scratch, costs, follow = scratch
    options = p.measure, p.fit, p.corner, p.corner_trim, 0.5 * p.support_radius, p.spacing_scale
    for row in range(rows):
        for i in range(ranges.shape[1]):
            line[i] = ranges[row, i]
        noise = noises[row]
        estimate_noise(floats, ints, bearings, range_min, range_max, given_noise, noise)
        filter_ranges(
            floats, range_min, range_max, p.sigma_d, p.sigma_r, p.half_width, circular,
            filter_scratch,
        )  # fmt: skip
        cluster(
            floats, ints, bearings, step, circular, noise, p.spacing_scale, p.noise_floor,
            p.density_k, p.min_points,
        )  # fmt: skip
        cut(
            floats, ints, p.support_radius, p.threshold, p.response, p.min_points, p.recursion,
            p.ends,
        )  # fmt: skip
        if p.max_vertices > 0:
            limit_pieces(floats, ints, bearings, p.max_vertices, LINK, WORST, costs, follow)
        measure(floats, ints, row, bearings, circular, noise, options, tables)
