"""Classes cut into straight pieces at the corners that the operator finds."""

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
    CLASS_FIRST,
    CLASS_LAST,
    CLASSES,
    CLOSED,
    FIRST,
    LAST,
    PIECES,
    POINTS,
    RESPONSE,
    X,
    Y,
)


@kernel
def cut(floats, ints, counts, radius, threshold, reading, min_points):
    """Cut the classes of a scan at the corners that the operator finds.

    Parameters
    ----------
    floats, ints, counts
        See `layout`. The lines by point and by class are read; those by candidate and by piece
        are written, CANDIDATES and PIECES.
    radius, threshold, reading, min_points
        As in `corner_operator.primary_corners`.
    """
    x, y = floats[X], floats[Y]
    far, strong, candidate = floats[CHORD_DISTANCE], floats[CANDIDATE_RESPONSE], ints[CANDIDATE]
    count, classes, closed = counts[POINTS], counts[CLASSES], counts[CLOSED] != 0
    found, first = np.int64(0), np.int64(0)
    if closed and classes > 0:
        # The point at which a closed class was opened is examined first.
        candidate[0], far[0] = 0, 0.0
        strong[0] = corner_response(x, y, first, first, count - 1, radius, reading, closed)
        found += 1
    for c in range(classes):
        found = primary_corners(
            floats,
            ints,
            ints[CLASS_FIRST, c],
            ints[CLASS_LAST, c],
            closed,
            radius,
            threshold,
            reading,
            min_points,
            found,
        )
    counts[CANDIDATES] = found
    response = floats[RESPONSE]
    for i in range(count):
        response[i] = math.nan
    for k in range(found):
        if strong[k] > threshold:
            response[candidate[k]] = strong[k]
    list_pieces(floats, ints, counts)


@helper
def list_pieces(floats, ints, counts):
    """List the pieces of the classes between the corners: the points whose RESPONSE is not NaN.

    Their responses move from their points to the pieces that begin there.
    """
    response, first, last, before = floats[RESPONSE], ints[FIRST], ints[LAST], ints[BEFORE]
    n, opened = np.int64(0), counts[CLOSED] != 0
    for c in range(counts[CLASSES]):
        a, b = ints[CLASS_FIRST, c], ints[CLASS_LAST, c]
        # Never behind its point: there are no more pieces than points before it.
        first[n], before[n], response[n] = a, -1, response[a]
        for i in range(a + 1, b):
            if not math.isnan(response[i]):
                last[n] = i
                n += 1
                first[n], before[n], response[n] = i, n - 1, response[i]
        last[n] = b
        n += 1
    if opened and n == 1:
        n = 0  # A ring without corners has no straight piece.
    if opened and n > 1 and not math.isnan(response[0]):
        before[0] = n - 1
    counts[PIECES] = n
