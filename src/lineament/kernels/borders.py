"""Borders between pieces put where they cost least; pieces that are none; ends that are off."""

import math

from . import helper
from .inverse_range import line_through, squared_error
from .layout import FIRST, LAST

#: Points that each piece keeps.
_LEAST = 3
#: Ends that a piece may lose.
_ENDS = 2
#: Prices from which on a single reading that is off ends a piece: its line would bend to it.
_GROSS = 8.0


@helper
def move_border(floats, ints, sums, c, k, margin, price):
    """Move the border of a piece and the one before to where χ² to both their lines is least.

    By up to `margin` points. No point costs more than `price`: it may be on neither.
    """
    first, last = ints[FIRST], ints[LAST]
    start, end, border = first[k - 1], last[k], first[k]
    a1, b1, _ = line_through(sums, c, start, last[k - 1])
    a2, b2, _ = line_through(sums, c, border, end)
    low = max(start + _LEAST, last[k - 1] + 1 - margin)
    high = min(end + 1 - _LEAST, border + margin)
    if low > high:
        return
    total, least, at = 0.0, math.inf, low
    for i in range(low, high + 1):
        # `total` is that of a border before point i.
        if total < least:
            least, at = total, i
        total += min(squared_error(floats, a1, b1, i), price)
        total -= min(squared_error(floats, a2, b2, i), price)
    last[k - 1] = _end_on(floats, a1, b1, start + _LEAST - 1, last[k - 1], at - 1, 1, price)
    first[k] = _end_on(floats, a2, b2, end + 1 - _LEAST, first[k], at, -1, price)


@helper
def _end_on(floats, a, b, inner, old, new, way, price):
    """Where a piece ends that goes on to the right (`way` 1) or the left (-1).

    It may go as far as point `new`, and ended at `old`. It keeps the points up to `inner`, and
    gains others until two in a row are off its line, or one far off.
    """
    end = old if way * (new - old) > 0 else new
    while end != inner and squared_error(floats, a, b, end) > price:
        end -= way
    i, off = end, 0
    while i != new and off < 2:
        i += way
        error = squared_error(floats, a, b, i)
        if error <= price:
            end, off = i, 0
        else:
            off += 2 if error > _GROSS * price else 1
    return end


@helper
def dissolve(floats, ints, sums, c, low, high, most, evidence, price):
    """Give the points of small pieces to their neighbours, where these explain them as well.

    As well but for `evidence`; a point that is on neither costs `price`. Returns one more than
    the last piece that is left.
    """
    first, last = ints[FIRST], ints[LAST]
    kept = low
    for k in range(low, high):
        first[kept], last[kept] = first[k], last[k]
        if last[k] - first[k] < most and high - low > 1:
            points = last[k] - first[k] + 1
            _, _, own = line_through(sums, c, first[k], last[k])
            if _share(
                floats,
                ints,
                sums,
                c,
                low,
                high,
                kept,
                k,
                price,
                evidence + min(own, price * points),
            ):
                continue
        kept += 1
    return kept


@helper
def _share(floats, ints, sums, c, low, high, kept, k, price, most):
    """Share the points of a piece between its neighbours, if that costs at most so much.

    A neighbour that ends before is none: the same wall may go on behind a doorway.
    """
    first, last = ints[FIRST], ints[LAST]
    start, end = first[k], last[k]
    a1, b1, a2, b2 = 0.0, 0.0, 0.0, 0.0
    before, after = kept > low, k + 1 < high
    if before:
        a1, b1, _ = line_through(sums, c, first[kept - 1], last[kept - 1])
        inner = last[kept - 1]
        before = _end_on(floats, a1, b1, inner, inner, start - 1, 1, price) >= start - 2
    if after:
        a2, b2, _ = line_through(sums, c, first[k + 1], last[k + 1])
        inner = first[k + 1]
        after = _end_on(floats, a2, b2, inner, inner, end + 1, -1, price) <= end + 2
    total = 0.0
    for i in range(start, end + 1):
        total += min(squared_error(floats, a2, b2, i), price) if after else price
    least, border = total, start
    for i in range(start, end + 1):
        total += min(squared_error(floats, a1, b1, i), price) if before else price
        total -= min(squared_error(floats, a2, b2, i), price) if after else price
        if total < least:
            least, border = total, i + 1
    if least > most:
        return False
    if before:
        inner = last[kept - 1]
        last[kept - 1] = _end_on(floats, a1, b1, inner, inner, border - 1, 1, price)
    if after:
        inner = first[k + 1]
        first[k + 1] = _end_on(floats, a2, b2, inner, inner, border, -1, price)
    return True


@helper
def trim_ends(floats, ints, sums, c, k, price):
    """Leave out ends of a piece that the line through its other points does not explain."""
    first, last = ints[FIRST], ints[LAST]
    start, end = first[k], last[k]
    while last[k] - first[k] > _LEAST and first[k] - start < _ENDS:
        a, b, _ = line_through(sums, c, first[k] + 1, last[k])
        if squared_error(floats, a, b, first[k]) <= price:
            break
        first[k] += 1
    while last[k] - first[k] > _LEAST and end - last[k] < _ENDS:
        a, b, _ = line_through(sums, c, first[k], last[k] - 1)
        if squared_error(floats, a, b, last[k]) <= price:
            break
        last[k] -= 1
