"""Fields of a scan that is another one's: in another unit, of some beams, or in reverse."""

import math
from typing import Any

import numpy as np

from .fields import Array, finite, irregular_bearings

#: No limit of a scanner is farther [m].
_LONGEST = 1000.0


def check_scale(scale: object) -> float:
    """Check what ranges are to be multiplied by."""
    factor = finite("scale", scale)
    if factor <= 0:
        raise ValueError(f"scale is {scale}, expected > 0: 0.001 for ranges in millimetres")
    return factor


def in_metres(ranges: Array, scale: object, range_max: float = 0.0) -> Array:
    """Ranges times a scale; `range_max` is in metres already."""
    factor = check_scale(scale)
    if _LONGEST < range_max < math.inf:
        raise ValueError(
            f"range_max is {range_max:g} m: scale is for the ranges alone, limits are in metres"
        )
    with np.errstate(over="ignore"):  # Infinitely far is no range.
        made = factor * ranges
    made.setflags(write=False)
    return made


def part_of(scan: Any, kept: range) -> dict[str, Any]:
    """Fields of the scan of some beams."""
    beams = slice(kept.start, kept.stop, kept.step)
    own: dict[str, Any] = {"ranges": scan.ranges[beams]}
    if scan.intensities is not None:
        own["intensities"] = scan.intensities[beams]
    if scan.is_regular:
        own["angle_min"] = scan.angle_min + kept.start * scan.angle_increment
        own["angle_increment"] = scan.angle_increment * kept.step
    else:
        own["angles"] = scan.angles[beams]
        own["angle_min"], own["angle_increment"] = irregular_bearings(own["angles"])
    own["stamp_beam"] = (scan.stamp_beam - kept.start) / kept.step
    own["time_increment"] = scan.time_increment * kept.step
    return own


def in_reverse(scan: Any) -> dict[str, Any]:
    """Fields of a scan whose beams run the other way round, but for its bearings."""
    intensities = scan.intensities
    return {
        "ranges": scan.ranges[::-1],
        "intensities": None if intensities is None else intensities[::-1],
        "stamp_beam": len(scan) - 1 - scan.stamp_beam,
        "scan_time": -scan.scan_time,
        "time_increment": -scan.time_increment,
    }
