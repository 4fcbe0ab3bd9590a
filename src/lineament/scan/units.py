"""What speaks against metres and radians: numbers that no 2-D scanner gives in these units."""

from typing import Any

import numpy as np

from ..errors import warn
from .fields import Array

#: Half of the ranges of a scan are never beyond this [m]. The scanners that reach farthest see a
#: white wall at 80 to 250 m, but most of what is around them is nearer: the median of a scan is 24
#: m at most in the recordings that this was tried on. In millimetres it is 20 cm.
FAR = 200.0
#: What is beyond this is no distance, in millimetres neither, but a code for no return [m].
CODES = 1e6
#: Limits that no scanner has: it is blind up to this range, or beyond this one [m].
_BLIND, _SHORT = 10.0, 0.1
#: Scanners have no more codes, and of a ring of sonars no more are equal by chance.
FEW = 8
#: No surface is at one range to the last digit over so much [rad]: a wall at 1 m varies by 3 cm.
_ROUND = 0.5


def warn_of_units(
    ranges: Array, scan: Any, is_empty: bool, largest: float = 0.0, equal: float = 0.0
) -> bool:
    """Warn of a `doubt`, or of `no_return`, where there can be one; return whether there is.

    `largest` is the largest range below the limit, and `equal` how many ranges are just that,
    where the limit is beyond `FAR`.
    """
    message = ""
    if is_empty or largest > FAR:
        message = doubt(ranges, scan.range_min, scan.range_max)
    if not is_empty and not message:
        message = no_return(largest, equal, scan.angle_increment)
    if message:
        warn(message)
    return bool(message)


def warn_of_whole_numbers(ranges: object) -> None:
    """Warn of integers, of which some differ: in metres, ranges have fractions.

    Near a wall, ranges in millimetres could be metres by their size.
    """
    given = np.asarray(ranges)
    if given.dtype.kind in "iu" and len(np.unique(given)) > FEW:
        warn(
            "ranges are whole numbers: are they in millimetres? "
            "(scale=0.001; or as floats, if they are in metres)"
        )


def why_invalid(ranges: Array, range_min: float, range_max: float) -> str:
    """Return what is wrong with ranges of which none is valid; "" if no beam returned anything."""
    finite, problem = ranges[(ranges > 0) & (ranges < CODES)], doubt(ranges, range_min, range_max)
    if problem or not len(finite):
        return problem
    return (
        f"they are {finite.min():g} to {finite.max():g} m, outside of the limits of "
        f"{range_min:g} to {range_max:g} m; scale=... where that is another unit"
    )


def doubt(ranges: Array, range_min: float, range_max: float) -> str:
    """Return what speaks against ranges in metres, with the way out; "" if nothing does.

    A scanner that sees nothing gives NaN, inf, 0 or one number for all beams: none of them counts.

    Examples
    --------
    >>> doubt(np.array([2490.0, 2500.0, 2510.0]), 0.0, 30.0)
    'all ranges are beyond range_max = 30 m: are they in millimetres? (scale=0.001)'
    >>> doubt(np.array([30.0, np.inf, 0.0]), 0.0, 30.0)
    ''
    """
    finite = ranges[(ranges > 0) & (ranges < CODES)]
    if not len(finite):
        other = np.unique(ranges[np.isfinite(ranges) & (ranges != 0)])
        if len(other) <= FEW:
            return ""
        return (
            f"all ranges are negative or beyond {CODES:g} m, expected metres: is their type right?"
        )
    least, median, largest = finite.min(), np.median(finite), finite.max()
    valid = finite[(finite >= range_min) & (finite < range_max)]
    if len(valid):
        if np.median(valid) <= FAR:
            return ""
        return (
            f"half of the ranges are beyond {FAR:g} m, where no 2-D scanner sees them: are they in "
            "millimetres? (scale=0.001; or range_max=..., if they stand for no return)"
        )
    if range_min >= _BLIND and largest < range_min:
        return f"all ranges are below range_min = {range_min:g} m: is it in metres?"
    if range_max <= _SHORT and least >= range_max:
        return f"all ranges are beyond range_max = {range_max:g} m: is it in metres?"
    if least >= range_max and median > FAR and largest > least:
        return (
            f"all ranges are beyond range_max = {range_max:g} m: are they in millimetres? "
            "(scale=0.001)"
        )
    return ""


def no_return(largest: float, equal: float, step: float) -> str:
    """Return what the largest of ranges stands for, with the way out; "" if it is a distance.

    So many are equal to it. A scanner to which nothing comes back along a beam may give the
    farthest that it sees, of which many beams would be a round wall.

    Examples
    --------
    >>> no_return(30.0, 90, 0.0175)
    'many beams have exactly the largest range, 30 m: do they stand for no return? (range_max=30)'
    """
    if equal <= FEW or equal * step < _ROUND:
        return ""
    return (
        f"many beams have exactly the largest range, {largest:.9g} m: do they stand for no "
        f"return? (range_max={largest:.9g})"
    )
