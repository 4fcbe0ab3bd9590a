"""Pieces that say nothing of a wall: those along a beam, and those around the sensor."""

import math

from . import helper
from .inverse_range import line_and_variance
from .layout import CLASS_LAST, CLASSES, FIRST, LAST, PIECES, RHO
from .line_fit import range_variance

#: Standard deviation of its angle from which on a piece has no direction (11°), and how many of
#: these it may turn to be along its beams.
_VAGUE, _TURNS = 0.2, 1.5
#: Of fewer readings a vague direction is none.
_FEW = 4
#: Pieces of a line each that a polygon around the sensor has at least.
_LEAST_PIECES = 3
#: Deviations that a reading may be off a circle around the sensor.
_NEAR = 4.0


@helper
def drop_radial(floats, ints, counts, sums):
    """Leave out pieces of so vague a direction that they may be along their beams.

    A few readings behind each other, or three anyhow: the line is more noise than wall.
    """
    first, last, kept, k = ints[FIRST], ints[LAST], 0, 0
    for c in range(counts[CLASSES]):
        while k < counts[PIECES] and first[k] <= ints[CLASS_LAST, c]:
            if not _may_be_radial(floats, sums, c, first[k], last[k]):
                first[kept], last[kept] = first[k], last[k]
                kept += 1
            k += 1
    counts[PIECES] = kept


@helper
def _may_be_radial(floats, sums, c, first, last):
    a, b, variance = line_and_variance(sums, c, first, last)
    if variance < _VAGUE * _VAGUE:
        return False
    if last - first + 1 < _FEW:
        return True
    rho = floats[RHO, (first + last) // 2]
    # Of the angle between line and beam: the distance of the line from the sensor, over the range.
    sine = min(1.0 / (math.sqrt(a * a + b * b) * rho), 1.0) if variance < math.inf else 0.0
    return math.asin(sine) <= _TURNS * math.sqrt(variance)


@helper
def drop_round(floats, ints, noise, low, high):
    """Leave out polygons around the sensor. Returns one more than the last piece that is left.

    Runs of pieces on one circle: constant ranges are no walls, nor an arc seen from outside.
    """
    first, last = ints[FIRST], ints[LAST]
    kept, k = low, low
    while k < high:
        end = k
        while end < high and _is_near_circle(floats, ints, noise, k, end):
            end += 1
        if end - k >= _LEAST_PIECES and _is_round(floats, ints, noise, k, end):
            k = end
        else:
            first[kept], last[kept] = first[k], last[k]
            kept += 1
            k += 1
    return kept


@helper
def _is_near_circle(floats, ints, noise, k, q):
    """Whether ends and middle of the q-th piece are on the circle around the sensor of the k-th."""
    rho, first, last = floats[RHO], ints[FIRST, q], ints[LAST, q]
    r = rho[(ints[FIRST, k] + ints[LAST, k]) // 2]
    near = _NEAR * math.sqrt(range_variance(r, noise))
    middle = (first + last) // 2
    return (
        abs(rho[first] - r) <= near and abs(rho[middle] - r) <= near and abs(rho[last] - r) <= near
    )


@helper
def _is_round(floats, ints, noise, k, end):
    """Whether one range explains the readings of the pieces from the k-th on, before `end`."""
    rho = floats[RHO]
    r, total, squares, points = rho[ints[FIRST, k]], 0.0, 0.0, 0.0
    for q in range(k, end):
        for i in range(ints[FIRST, q], ints[LAST, q] + 1):
            off = rho[i] - r
            total += off
            squares += off * off
            points += 1.0
    # As much as an arc may be off its circle.
    return squares - total * total / points < (2.0 * points + 12.0) * range_variance(r, noise)
