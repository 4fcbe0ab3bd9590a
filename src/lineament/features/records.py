"""Where the fields of feature records lie, so that kernels can write them as plain numbers.

Numba can write records, but takes half a minute to compile it. So a table of records is seen as a
matrix of float64, or of int32, over the same memory, and each field by its column there.
"""

import numpy as np
from numpy.typing import NDArray

#: A straight piece of a surface. `covariance` is that of (offset at the centroid along the left
#: normal of the direction [m], angle [rad]), of what is random: the noise. `misfit` is what the
#: surface itself is off a straight line, a root mean square [m], the same in every scan. Beams run
#: from `first_beam` to `last_beam`, over the seam of a full circle where the first is larger.
SEGMENT = np.dtype(
    [
        ("start", "f8", 2),
        ("end", "f8", 2),
        ("centroid", "f8", 2),
        ("angle", "f8"),
        ("covariance", "f8", (2, 2)),
        ("first_beam", "i4"),
        ("last_beam", "i4"),
        ("n_points", "i4"),
        ("rms", "f8"),
        ("misfit", "f8"),
        ("cluster", "i4"),
    ],
    align=True,
)

#: A vertex between two segments. `opening` is the angle between its two arms [rad], `convex` says
#: that it points towards the sensor, `segments` are indices into the scan's segments or -1.
#: `quality` is the share of such corners that are found again from another place. `kind` is
#: "corner", "slit" (the segments end beside a hole at their vertex) or "edge" (a segment ends, and
#: few measurements show its face, before a jump).
CORNER = np.dtype(
    [
        ("position", "f8", 2),
        ("covariance", "f8", (2, 2)),
        ("opening", "f8"),
        ("convex", "?"),
        ("beam", "i4"),
        ("response", "f8"),
        ("segments", "i4", 2),
        ("quality", "f8"),
        ("kind", "U6"),
    ],
    align=True,
)

#: A circular piece of a surface; `covariance` is that of (x, y, radius).
ARC = np.dtype(
    [
        ("center", "f8", 2),
        ("radius", "f8"),
        ("covariance", "f8", (3, 3)),
        ("first_beam", "i4"),
        ("last_beam", "i4"),
        ("n_points", "i4"),
        ("rms", "f8"),
    ],
    align=True,
)

#: Where a surface ends without a corner. `beam` are the valid beams on either side (-1 past an end
#: of the scan), `kind` is "jump" (depth changes between them: `occluder` is the beam of the nearer
#: side, whose point is `position`), "gap" (no valid beam between them where surfaces could go on)
#: or "scan_end".
BREAKPOINT = np.dtype(
    [
        ("beam", "i4", 2),
        ("position", "f8", 2),
        ("kind", "U8"),
        ("occluder", "i4"),
    ],
    align=True,
)


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


def _float(dtype: np.dtype[np.void], name: str) -> int:
    return dtype.fields[name][1] // 8  # type: ignore[index]


def _int(dtype: np.dtype[np.void], name: str) -> int:
    return dtype.fields[name][1] // 4  # type: ignore[index]


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
