"""Bilateral filter of ranges (equations 4-9)."""

import math

import numpy as np

from . import helper, kernel, usable
from .layout import FILTERED, RANGE

F = np.float32
#: Beyond this a range has no neighbours, and would drown theirs in float32 [m].
FARTHEST = 1e6


@kernel
def filter_rows(
    floats, rows, range_min, range_max, sigma_d, sigma_r, half_width, circular, scratch
):
    """Filter the ranges of each row over index distance and range difference.

    ρ̃_i = ρ_i + Σ_j w (ρ_j - ρ_i) / Σ_j w, which is Σ_j w ρ_j / Σ_j w and keeps its digits: the
    sums are in float32 (twice as many fit a register), the result is good to 0.05 mm at the
    default widths. Each weight
    serves both of its beams, so the loops run over offsets outside and beams inside.

    Parameters
    ----------
    floats : float64 array, shape (m, FLOATS, n + 1)
        RANGE is read, FILTERED written: NaN where a range is not usable.
    rows : int
        Rows in use.
    range_min, range_max, sigma_d, sigma_r : float
    half_width : int
    circular : bool
        Whether the window goes over the seam; else it ends at the ends of the scan.
    scratch : float32 array, shape (5, n + 2 half_width)
    """
    n, h = floats.shape[2] - 1, half_width
    r, weight, shift = scratch[0], scratch[1], scratch[2]
    product, weighted = scratch[3], scratch[4]
    # Unusable beams stand so far off that their weight is nothing.
    away = F(-1e4 * sigma_r)
    scale = F(0.5 / (32.0 * sigma_r * sigma_r))
    for row in range(rows):
        ranges, filtered = floats[row, RANGE], floats[row, FILTERED]
        _pad(ranges, n, range_min, range_max, h, circular, away, r)
        for i in range(n + 2 * h):
            weight[i] = F(1.0)
            shift[i] = F(0.0)
        for k in range(1, h + 1):
            last, ratio = n + 2 * h - k, k / sigma_d
            closeness = F(math.exp(-0.5 * ratio * ratio))
            # w = exp(-k²/2σ_d²) exp(-d²/2σ_r²) and w d of all pairs `k` apart (equation 8).
            for i in range(last):
                d = r[i + k] - r[i]
                # exp(-u) = exp(-u/32)^32, the root by its series: within 6e-6 of exp for every u.
                t = scale * d * d
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
            for i in range(last):
                weight[i] += product[i]
                shift[i] += weighted[i]
            for i in range(last):
                weight[i + k] += product[i]
                shift[i + k] -= weighted[i]
        for i in range(n):
            filtered[i] = ranges[i] + shift[h + i] / weight[h + i]
            if r[h + i] == away:
                keep = usable(ranges[i], range_min, range_max)
                filtered[i] = ranges[i] if keep else math.nan


@helper
def _pad(ranges, n, range_min, range_max, h, circular, away, padded):
    """Copy ranges, `away` where not usable, with `h` more from over the seam on either side."""
    for i in range(n):
        near = usable(ranges[i], range_min, range_max) & (ranges[i] < FARTHEST)
        padded[h + i] = F(ranges[i]) if near else away
    for i in range(h):
        padded[i] = padded[n + i] if circular and n > h else away
        padded[n + h + i] = padded[h + i] if circular and n > h else away
