"""Fields of a scan that is another one's: in another unit, of some beams, or in reverse."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .fields import DEGREES, FINEST, Array, finite, irregular_bearings

#: Sectors of bearings [rad], each counter-clockwise from its first one to its second.
Mask = tuple[tuple[float, float], ...]
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


def checked_mask(mask: Any) -> Mask:
    """Check sectors of bearings [rad], each of less than a turn."""
    try:
        sectors = tuple((finite("mask", low), finite("mask", high)) for low, high in mask)
    except TypeError:
        raise ValueError(f"mask is {mask!r}, expected pairs of bearings [rad]") from None
    except ValueError as error:
        raise ValueError(f"mask is {mask!r}, expected pairs of bearings [rad]: {error}") from None
    for low, high in sectors:
        if max(abs(low), abs(high)) > 2 * math.pi:
            raise ValueError(f"mask has {low:g} to {high:g} rad, more than a turn{DEGREES}")
        if abs(math.remainder(high - low, 2 * math.pi)) < FINEST:
            raise ValueError(
                f"mask has {low:g} to {high:g} rad, expected two bearings, less than a turn apart"
            )
    return sectors


def in_mask(bearings: Array, mask: Mask) -> NDArray[np.bool_]:
    """Whether each bearing is in a sector."""
    turn, inside = 2 * math.pi, np.zeros(len(bearings), bool)
    for low, high in mask:
        # A bearing that is the end of a sector may differ from it by rounding.
        inside |= (bearings - low + FINEST) % turn <= (high - low) % turn + 2 * FINEST
    return inside


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
