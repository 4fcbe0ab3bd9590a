"""The steps of Liu et al. 2023, one scan after the other."""

from typing import NamedTuple

from . import kernel
from .arrays import Floats1, Floats2, Floats3, Ints1, Ints2, Singles2
from .layout import Sensor, Tables
from . import layout as at
from .bilateral import filter_ranges
from .budget import LINK, WORST, limit_pieces
from .clustering import cluster
from .cutting import cut
from .measuring import measure
from .noise import estimate_noise


class Parameters(NamedTuple):
    """Those of `methods.liu.Liu`; choices as the numbers that the kernels of the steps take."""

    sigma_d: float
    sigma_r: float
    half_width: int
    spacing_scale: float
    noise_floor: float
    density_k: float
    min_points: int
    support_radius: int
    threshold: float
    response: int
    recursion: bool
    ends: bool
    fit: int
    measure: int
    corner: bool
    corner_trim: int
    max_vertices: int


@kernel
def extract_rows(
    ranges: Floats2,
    rows: Ints1,
    bearings: Floats2,
    sensor: Sensor,
    given_noise: Floats1,
    parameters: Parameters,
    floats: Floats2,
    ints: Ints2,
    scratch: tuple[Singles2, Floats3, Ints2],
    noises: Floats2,
    tables: Tables,
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
    for row in range(rows[0]):
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
