"""Classes cut into straight pieces at their corners, row by row."""

import math

import numpy as np

from . import helper, kernel
from .corner_operator import corner_response, primary_corners
from .layout import (
    BEFORE,
    CANDIDATE,
    CANDIDATE_RESPONSE,
    CANDIDATES,
    CHORD_DISTANCE,
    CLOSED,
    FIRST,
    LABEL,
    LAST,
    PIECES,
    POINTS,
    RESPONSE,
    X,
    Y,
)


@kernel
def cut_rows(floats, ints, counts, rows, radius, threshold, reading, min_points, stack):
    """Cut the classes of each row at the corners that the operator finds.

    Parameters
    ----------
    floats, ints, counts
        See `layout`. The lines by point are read; those by candidate and by piece are written,
        CANDIDATES and PIECES.
    rows : int
        Rows in use.
    radius, threshold, reading, min_points
        As in `corner_operator.primary_corners`.
    stack : int64 array, shape (n + 1, 2)
        Scratch.
    """
    for row in range(rows):
        x, y, label = floats[row, X], floats[row, Y], ints[row, LABEL]
        far, strong = floats[row, CHORD_DISTANCE], floats[row, CANDIDATE_RESPONSE]
        candidate = ints[row, CANDIDATE]
        count, closed = counts[row, POINTS], counts[row, CLOSED] != 0
        found, first = np.int64(0), np.int64(0)
        if closed and label[0] >= 0:
            # The point at which a closed class was opened is examined first.
            candidate[0], far[0] = 0, 0.0
            strong[0] = corner_response(x, y, first, first, count - 1, radius, reading, closed)
            found += 1
        for last in range(count):
            if last + 1 < count and label[last + 1] == label[first]:
                continue
            if label[first] >= 0:
                found = primary_corners(
                    x,
                    y,
                    first,
                    last,
                    closed,
                    radius,
                    threshold,
                    reading,
                    min_points,
                    stack,
                    candidate,
                    far,
                    strong,
                    found,
                )
            first = last + 1
        counts[row, CANDIDATES] = found
        response = floats[row, RESPONSE]
        for i in range(count):
            response[i] = math.nan
        for k in range(found):
            if strong[k] > threshold:
                response[candidate[k]] = strong[k]
        counts[row, PIECES] = list_pieces(
            label, count, closed, response, ints[row, FIRST], ints[row, LAST], ints[row, BEFORE]
        )


@helper
def list_pieces(label, count, closed, response, first, last, before):
    """List the pieces between the corners: the points whose response is not NaN.

    Their responses move from their points to the pieces that begin there. Returns the number of
    pieces.
    """
    n = np.int64(0)
    for i in range(count):
        if label[i] < 0:
            continue
        begins = i == 0 or label[i] != label[i - 1]
        ends = i + 1 == count or label[i + 1] != label[i]
        is_corner = not begins and not ends and not math.isnan(response[i])
        if is_corner or ends:
            last[n] = i
            n += 1
        if begins or is_corner:
            # Never behind its point: there are no more pieces than points before it.
            first[n], response[n] = i, response[i]
            before[n] = n - 1 if is_corner else -1
    if closed and n == 1:
        return 0  # A ring without corners has no straight piece.
    if closed and n > 1 and not math.isnan(response[0]):
        before[0] = n - 1
    return n
