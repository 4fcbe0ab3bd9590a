"""Features as points of words of four bytes, in the order of `FEATURE_POINT` (output)."""

import numpy as np

from . import helper, kernel
from ..features.records import (
    A_CENTER,
    A_COVARIANCE,
    A_FIRST,
    A_LAST,
    A_POINTS,
    A_RADIUS,
    A_RMS,
    C_BEAM,
    C_CONVEX,
    C_COVARIANCE,
    C_KIND,
    C_OPENING,
    C_POSITION,
    C_QUALITY,
    C_SEGMENTS,
    CORNER_WORDS,
    S_ANGLE,
    S_CENTROID,
    S_COVARIANCE,
    S_END,
    S_FIRST,
    S_LAST,
    S_MISFIT,
    S_POINTS,
    S_RMS,
    S_START,
)

SEGMENT, CORNER, ARC = range(3)  # What the word KIND tells.
# Words of a point: of those that belong together, the first.
X, Y, Z, KIND, TRACK, START, END = 0, 1, 2, 3, 4, 5, 7
ANGLE, RADIUS, OPENING, CONVEX, RMS, MISFIT, QUALITY, COVARIANCE = 9, 10, 11, 12, 13, 14, 15, 16
BEAMS, POINTS, SEGMENTS, CORNER_KIND = 22, 24, 25, 27


@kernel
def fill_points(segments, segment_ints, corners, corner_ints, arcs, arc_ints, points, point_ints):
    """Fill a row of `points` for each feature: segments, then corners, then arcs.

    Records and points are given twice, as words of floats and of integers. What is too large for
    single precision is infinite.
    """
    k = 0
    for i in range(len(segments)):
        row, ints, point = segments[i], segment_ints[i], points[k]
        _begin(point, point_ints[k], SEGMENT, row[S_CENTROID], row[S_CENTROID + 1])
        for at in range(2):
            point[START + at], point[END + at] = row[S_START + at], row[S_END + at]
        point[ANGLE], point[RMS], point[MISFIT] = row[S_ANGLE], row[S_RMS], row[S_MISFIT]
        _put_triangle(point, row, S_COVARIANCE, 2)
        _put_beams(point_ints[k], ints[S_FIRST], ints[S_LAST], ints[S_POINTS])
        k += 1
    for i in range(len(corners)):
        row, ints, point = corners[i], corner_ints[i], points[k]
        _begin(point, point_ints[k], CORNER, row[C_POSITION], row[C_POSITION + 1])
        point[OPENING], point[QUALITY] = row[C_OPENING], row[C_QUALITY]
        point[CONVEX] = (ints[C_CONVEX] & 0xFF) != 0  # the rest of the word is padding
        _put_triangle(point, row, C_COVARIANCE, 2)
        _put_beams(point_ints[k], ints[C_BEAM], ints[C_BEAM], -1)
        for at in range(2):
            point_ints[k, SEGMENTS + at] = ints[C_SEGMENTS + at]
        for kind in range(len(CORNER_WORDS)):
            if ints[C_KIND] == CORNER_WORDS[kind, 0]:  # their first letters differ
                point_ints[k, CORNER_KIND] = kind
        k += 1
    for i in range(len(arcs)):
        row, ints, point = arcs[i], arc_ints[i], points[k]
        _begin(point, point_ints[k], ARC, row[A_CENTER], row[A_CENTER + 1])
        point[RADIUS], point[RMS] = row[A_RADIUS], row[A_RMS]
        _put_triangle(point, row, A_COVARIANCE, 3)
        _put_beams(point_ints[k], ints[A_FIRST], ints[A_LAST], ints[A_POINTS])
        k += 1


@helper
def _begin(point, ints, kind, x, y):
    """Tell what every feature has; of the rest nothing yet: NaN, or -1."""
    point[:] = np.nan
    point[X], point[Y], point[Z] = x, y, 0.0
    ints[KIND], ints[TRACK] = kind, -1
    ints[SEGMENTS:] = -1


@helper
def _put_beams(ints, first, last, n):
    ints[BEAMS], ints[BEAMS + 1], ints[POINTS] = first, last, n


@helper
def _put_triangle(point, row, at, size):
    """Put the upper triangle of a covariance, line by line, each from the diagonal on."""
    for line in range(size):
        for column in range(line, size):
            to = COVARIANCE + line * (5 - line) // 2 + column
            point[to] = row[at + size * line + column]
