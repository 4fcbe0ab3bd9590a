"""Readings that stand alone: spikes on a surface that goes on behind them."""

import math

from . import helper, usable
from .layout import FILTERED, RANGE
from .line_fit import range_variance

#: Deviations by which a spike is off its neighbours.
_OFF = 6.0


@helper
def drop_spikes(floats, range_min, range_max, noise, reach):
    """Copy the usable ranges to FILTERED, without spikes; NaN for the others.

    A spike is off the mean of its two neighbours, that are usable and agree: they are less apart
    than two readings of a surface may be, which is `reach` times their range.
    """
    ranges, kept = floats[RANGE], floats[FILTERED]
    n = len(ranges) - 1
    for i in range(n):
        value = ranges[i]
        kept[i] = value if usable(value, range_min, range_max) else math.nan
    for i in range(1, n - 1):
        before, value, after = ranges[i - 1], kept[i], ranges[i + 1]
        if not usable(before, range_min, range_max) or not usable(after, range_min, range_max):
            continue
        apart, sigma = abs(before - after), math.sqrt(range_variance(value, noise))
        if (
            abs(value - 0.5 * (before + after)) > _OFF * sigma + 0.5 * apart
            and apart <= reach * min(before, after) + 4.0 * sigma
        ):
            kept[i] = math.nan
