"""Where the fields of feature records lie, so that kernels can write them as plain numbers.

Numba can write records, but takes half a minute to compile it. So a table of records is seen as a
matrix of float64, or of int32, over the same memory, and each field by its column there.
"""

import numpy as np
from numpy.typing import NDArray

from ..features import ARC, BREAKPOINT, CORNER, SEGMENT

KIND_NAMES = ("jump", "gap", "scan_end")
JUMP, GAP, SCAN_END = 0, 1, 2
#: The kinds of breakpoints as the int32 words of a field of type U8, and those of corners.
KIND_WORDS = np.array(KIND_NAMES, "U8").view(np.int32).reshape(3, 8)
CORNER_KINDS = ("corner", "slit", "edge")
SHARP, SLIT, EDGE = 0, 1, 2
CORNER_WORDS = np.array(CORNER_KINDS, "U6").view(np.int32).reshape(3, 6)


def words(records: NDArray[np.void]) -> NDArray[np.float64]:
    """See an array of records as its float64 words, two int32 words each."""
    return records.view(np.float64).reshape(len(records), records.dtype.itemsize // 8)


def _float(dtype, name):
    return dtype.fields[name][1] // 8


def _int(dtype, name):
    return dtype.fields[name][1] // 4


S_START, S_END, S_CENTROID, S_ANGLE, S_COVARIANCE, S_RMS, S_MISFIT = (
    _float(SEGMENT, name)
    for name in ("start", "end", "centroid", "angle", "covariance", "rms", "misfit")
)
S_FIRST, S_LAST, S_POINTS, S_CLUSTER = (
    _int(SEGMENT, name) for name in ("first_beam", "last_beam", "n_points", "cluster")
)
C_POSITION, C_COVARIANCE, C_OPENING, C_RESPONSE, C_QUALITY = (
    _float(CORNER, name) for name in ("position", "covariance", "opening", "response", "quality")
)
C_CONVEX, C_BEAM, C_SEGMENTS, C_KIND = (
    _int(CORNER, name) for name in ("convex", "beam", "segments", "kind")
)
B_POSITION = _float(BREAKPOINT, "position")
B_BEAM, B_KIND, B_OCCLUDER = (_int(BREAKPOINT, name) for name in ("beam", "kind", "occluder"))
A_CENTER, A_RADIUS, A_COVARIANCE, A_RMS = (
    _float(ARC, name) for name in ("center", "radius", "covariance", "rms")
)
A_FIRST, A_LAST, A_POINTS = (_int(ARC, name) for name in ("first_beam", "last_beam", "n_points"))
