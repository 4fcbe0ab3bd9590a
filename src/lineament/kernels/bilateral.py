"""Step 1 of Liu et al. 2023: the bilateral filter of ranges (equations 4-9)."""

import math

import numpy as np

from . import LARGEST, contracted, helper, kernel
from .arrays import Floats2, Singles2
from . import layout as at

F = np.float32
#: Beyond this a range has no neighbours, and would drown theirs in float32 [m].
FARTHEST = 1e6
#: Loops over a multiple of this many float32 leave nothing over for a slower loop.
LANES = 32


def scratch_shape(beams: int, half_width: int) -> tuple[int, int]:
    """Return the shape of the float32 scratch of `filter_ranges`."""
    half_width = min(half_width, beams)
    padded = -(-(beams + 2 * half_width) // LANES) * LANES
    return 5, padded + half_width


@kernel
def filter_ranges(
    floats: Floats2,
    range_min: float,
    range_max: float,
    sigma_d: float,
    sigma_r: float,
    half_width: int,
    circular: bool,
    scratch: Singles2,
):
    """Filter the ranges of a scan over index distance and range difference.

    ρ̃_i = ρ_i + Σ_j w (ρ_j - ρ_i) / Σ_j w, which is Σ_j w ρ_j / Σ_j w and keeps its digits: the
    sums are in float32 (twice as many fit a register), the result is good to 0.05 mm at the
    default widths.

    From RANGE, FILTERED: NaN where not usable. The window goes over the seam of a full circle; else
    it ends at the ends of the scan. `scratch` is a float32 array, see `scratch_shape`.
    """
    n, beams = floats.shape[1] - at.EXTRA, at.beams_of(floats)
    # Wider than the scan, the window takes in all of it, once.
    h, wraps = min(half_width, n), circular and n > half_width
    least, away = max(range_min, 1.0 / LARGEST), F(-1e4 * sigma_r)
    most, ranges, filtered = min(range_max, LARGEST), beams[at.RANGE], beams[at.FILTERED]
    _pad(ranges, n, least, min(range_max, FARTHEST), h, wraps, away, scratch[0])
    _sum_up(sigma_d, sigma_r, h, scratch)
    near, weight, shift = scratch[0, h:], scratch[1, h:], scratch[2, h:]
    for i in range(n):
        value = ranges[i]
        moved = value + shift[i] / weight[i] if near[i] != away else value
        filtered[i] = moved if (value >= least) & (value < most) else math.nan


@helper
def _pad(ranges, n, least, farthest, h, wraps, away, padded):
    """Copy ranges, so far `away` where not usable that their weight is 0.

    `h` more stand on either side, from over the seam of a full circle if it `wraps`.
    """
    inside = padded[h:]
    for i in range(n):
        value = ranges[i]
        inside[i] = F(value) if (value >= least) & (value < farthest) else away
    for i in range(h):
        padded[i] = padded[n + i] if wraps else away
        inside[n + i] = inside[i] if wraps else away
    for i in range(n + 2 * h, len(padded)):
        padded[i] = away


@contracted
def _sum_up(sigma_d, sigma_r, h, scratch):
    """Σ_j w and Σ_j w (ρ_j - ρ_i) of each range, with w of equation 8.

    Each weight serves both of its beams, so the loops run over offsets outside and beams inside.
    """
    r, weight, shift = scratch[0], scratch[1], scratch[2]
    size = len(r) - h
    for i in range(size):
        weight[i] = F(1.0)
        shift[i] = F(0.0)
    scale = F(0.125 / sigma_r)
    # With `h` zeros in front, for the pairs with those before.
    product, weighted = scratch[3, h:], scratch[4, h:]
    for i in range(h):
        scratch[3, i] = F(0.0)
        scratch[4, i] = F(0.0)
    for k in range(1, h + 1):
        ratio = k / sigma_d
        closeness = F(math.exp(-0.5 * ratio * ratio))
        right = r[k:]
        for i in range(size):
            d = right[i] - r[i]
            # exp(-u) = exp(-u/32)^32, the root by its series: within 6e-6 of exp for every u.
            t = scale * d
            t = t * t
            t = t if t < F(1.25) else F(1.25)
            e = F(1.0) - t * (F(1.0) - t * (F(0.5) - t * F(1.0 / 6.0)))
            e = e * e
            e = e * e
            e = e * e
            e = e * e
            e = e * e
            w = closeness * e
            product[i] = w
            weighted[i] = w * d
        product_before, weighted_before = scratch[3, h - k :], scratch[4, h - k :]
        for i in range(size):
            weight[i] += product[i] + product_before[i]
            shift[i] += weighted[i] - weighted_before[i]
