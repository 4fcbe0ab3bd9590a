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
        value = kept[i]
        if math.isnan(value):
            continue
        # A beam without a reading beside it is passed over.
        a, b = i - 1, i + 1
        if a > 0 and not usable(ranges[a], range_min, range_max):
            a -= 1
        if b < n - 1 and not usable(ranges[b], range_min, range_max):
            b += 1
        before, after = ranges[a], ranges[b]
        if not usable(before, range_min, range_max) or not usable(after, range_min, range_max):
            continue
        apart = abs(before - after)
        off = abs(value - 0.5 * (before + after)) - 0.5 * apart
        if off <= 0.0:
            continue
        variance = range_variance(value, noise)
        if off * off > _OFF * _OFF * variance:
            most = reach * 0.5 * (b - a) * min(before, after) + 4.0 * math.sqrt(variance)
            if apart <= most:
                kept[i] = math.nan
