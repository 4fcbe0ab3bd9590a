"""The features of a scan as points with named fields: what a PointCloud2 of them holds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..features import Features

if TYPE_CHECKING:
    from ..motion import Tracks

__all__ = ["ARC_POINT", "CORNER_POINT", "FEATURE_POINT", "SEGMENT_POINT", "feature_points"]

#: What the field `kind` tells.
SEGMENT_POINT, CORNER_POINT, ARC_POINT = range(3)

#: The fields in their order: names, with their type before them.
_FIELDS = (
    ("<f4", "x", "y", "z"),
    ("<u4", "kind"),
    ("<i4", "track"),
    ("<f4", "start_x", "start_y", "end_x", "end_y", "angle", "radius", "opening", "convex", "rms"),
    ("<f4", "misfit", "quality"),
    ("<f4", "c00", "c01", "c02", "c11", "c12", "c22"),
    ("<i4", "first_beam", "last_beam", "n_points", "segment_a", "segment_b", "corner"),
)

#: One feature, in 28 fields of four bytes: position (centroid of a segment, position of a corner,
#: centre of an arc; z = 0) [m], kind (0 segment, 1 corner, 2 arc), track (-1 without tracking),
#: ends [m] and angle [rad] of a segment, radius of an arc [m], opening [rad] and convexity (0 or 1)
#: of a corner, rms of a segment or arc [m], misfit of a segment [m], quality of a corner (0 to 1),
#: upper triangle of the covariance (segment: offset, angle; corner: x, y; arc: x, y, radius), beams
#: (a corner has its own in both), number of points, segments of a corner and its kind (0 corner,
#: 1 slit, 2 edge). A field that a kind does not fill is NaN, or -1 where it is an integer.
FEATURE_POINT = np.dtype([(name, form) for form, *names in _FIELDS for name in names])


def feature_points(features: Features, tracks: Tracks | None = None) -> NDArray[np.void]:
    """Make one record a feature: the segments, then the corners, then the arcs of a scan.

    Segments come first, so that the segments of a corner are also the indices of their records.

    Parameters
    ----------
    features : Features
        Of one scan.
    tracks : Tracks, optional
        The numbers that its features have from frame to frame, from `lineament.motion`.

    Returns
    -------
    structured array of dtype `FEATURE_POINT`, shape (n,)
        In the frame of the features. Those that are not finite are there too: indices stay.

    Raises
    ------
    ValueError
        If the tracks are those of other features.

    Examples
    --------
    >>> import lineament as ln
    >>> scan = ln.LaserScan([2.0] * 5, angle_min=-0.02, angle_increment=0.01)
    >>> point = feature_points(ln.extract(scan))[0]
    >>> [point[name].item() for name in ("kind", "n_points", "radius", "track")]
    [0, 5, nan, -1]
    """
    from ..kernels.feature_words import fill_points  # Numba takes long to import.

    tables = features.segments, features.corners, features.arcs
    words = np.empty((sum(map(len, tables)), FEATURE_POINT.itemsize // 4), "<f4")
    forms = [form for table in tables for form in _forms(table)]
    with np.errstate(over="ignore"):  # What no float32 holds is infinite, whether compiled or not.
        fill_points(*forms, words, words.view("<i4"))
    points = words.view(FEATURE_POINT).reshape(len(words))
    if tracks is not None:
        numbers = tracks.segments, tracks.corners, tracks.arcs
        if [*map(len, numbers)] != [*map(len, tables)]:
            raise ValueError(
                f"tracks have {_counts(numbers)} segments, corners and arcs, expected "
                f"{_counts(tables)}, as the features"
            )
        points["track"] = np.concatenate(numbers)
    return points


def _forms(table: NDArray[np.void]) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Give the words of records as kernels take them: as floats, and as integers half as long."""
    n, size = len(table), table.itemsize
    data = table.tobytes()  # A copy has no gaps, and is always of the type the kernel is made for.
    return np.ndarray((n, size // 8), np.float64, data), np.ndarray((n, size // 4), np.int32, data)


def _counts(tables: tuple[NDArray[Any], ...]) -> str:
    return ", ".join(str(len(table)) for table in tables)
