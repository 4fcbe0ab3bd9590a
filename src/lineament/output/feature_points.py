"""The features of a scan as points with named fields: what a PointCloud2 of them holds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..features import Features

if TYPE_CHECKING:
    from ..tracking import Tracks

__all__ = ["ARC_POINT", "CORNER_POINT", "FEATURE_POINT", "SEGMENT_POINT", "feature_points"]

#: What the field `kind` tells.
SEGMENT_POINT, CORNER_POINT, ARC_POINT = range(3)

#: The fields: those that are filled together, their type, their names.
_FIELDS = (
    ("position", "<f4", ("x", "y", "z")),
    ("kind", "<u4", ("kind",)),
    ("track", "<i4", ("track",)),
    ("start", "<f4", ("start_x", "start_y")),
    ("end", "<f4", ("end_x", "end_y")),
    ("angle", "<f4", ("angle",)),
    ("radius", "<f4", ("radius",)),
    ("opening", "<f4", ("opening",)),
    ("convex", "<f4", ("convex",)),
    ("rms", "<f4", ("rms",)),
    ("covariance", "<f4", ("c00", "c01", "c02", "c11", "c12", "c22")),
    ("beams", "<i4", ("first_beam", "last_beam")),
    ("n_points", "<i4", ("n_points",)),
    ("segments", "<i4", ("segment_a", "segment_b")),
)

#: One feature, in 25 fields of four bytes: position (centroid of a segment, position of a corner,
#: centre of an arc; z = 0) [m], kind (0 segment, 1 corner, 2 arc), track (-1 without tracking),
#: ends [m] and angle [rad] of a segment, radius of an arc [m], opening [rad] and convexity (0 or 1)
#: of a corner, rms of a segment or arc [m], upper triangle of the covariance (segment: offset,
#: angle; corner: x, y; arc: x, y, radius), beams (a corner has its own in both), number of points,
#: and segments of a corner. A field that a kind does not fill is NaN, or -1 where it is an integer.
FEATURE_POINT = np.dtype([(name, form) for _, form, names in _FIELDS for name in names])

#: The same bytes, with the fields that are filled together as one.
_GROUPED = np.dtype(
    [(name, form, (len(fields),) if len(fields) > 1 else ()) for name, form, fields in _FIELDS]
)
#: A feature of which nothing is told but that z is 0.
_NOTHING = np.zeros((), _GROUPED)
for _name, _form, _ in _FIELDS[2:]:
    _NOTHING[_name] = -1 if "i" in _form else np.nan


@np.errstate(over="ignore")  # What is too large for single precision is infinite.
def feature_points(features: Features, tracks: Tracks | None = None) -> NDArray[np.void]:
    """Make one record a feature: the segments, then the corners, then the arcs of a scan.

    Segments come first, so that the segments of a corner are also the indices of their records.

    Parameters
    ----------
    features : Features
        Of one scan.
    tracks : Tracks, optional
        The numbers that its features have from frame to frame, from `lineament.tracking`.

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
    >>> scan = ln.LaserScan([2.0, 2.0, 2.0], angle_min=-0.01, angle_increment=0.01)
    >>> point = feature_points(ln.extract(scan))[0]
    >>> [point[name].item() for name in ("kind", "n_points", "radius", "track")]
    [0, 3, nan, -1]
    """
    tables = features.segments, features.corners, features.arcs
    points = np.full(sum(map(len, tables)), _NOTHING)
    first_corner = len(features.segments)
    first_arc = first_corner + len(features.corners)
    _fill_segments(points[:first_corner], features.segments)
    _fill_corners(points[first_corner:first_arc], features.corners)
    _fill_arcs(points[first_arc:], features.arcs)
    if tracks is not None:
        numbers = tracks.segments, tracks.corners, tracks.arcs
        if [*map(len, numbers)] != [*map(len, tables)]:
            raise ValueError(
                f"tracks have {_counts(numbers)} segments, corners and arcs, expected "
                f"{_counts(tables)}, as the features"
            )
        points["track"] = np.concatenate(numbers)
    return points.view(FEATURE_POINT)


def _fill_segments(points: NDArray[np.void], segments: NDArray[np.void]) -> None:
    points["kind"] = SEGMENT_POINT
    points["position"][:, :2] = segments["centroid"]
    for name in ("start", "end", "angle", "rms", "n_points"):
        points[name] = segments[name]
    _fill_triangle(points, segments["covariance"])
    points["beams"][:, 0], points["beams"][:, 1] = segments["first_beam"], segments["last_beam"]


def _fill_corners(points: NDArray[np.void], corners: NDArray[np.void]) -> None:
    points["kind"] = CORNER_POINT
    points["position"][:, :2] = corners["position"]
    for name in ("opening", "convex", "segments"):
        points[name] = corners[name]
    _fill_triangle(points, corners["covariance"])
    points["beams"] = corners["beam"][:, None]


def _fill_arcs(points: NDArray[np.void], arcs: NDArray[np.void]) -> None:
    points["kind"] = ARC_POINT
    points["position"][:, :2] = arcs["center"]
    for name in ("radius", "rms", "n_points"):
        points[name] = arcs[name]
    _fill_triangle(points, arcs["covariance"])
    points["beams"][:, 0], points["beams"][:, 1] = arcs["first_beam"], arcs["last_beam"]


def _fill_triangle(points: NDArray[np.void], covariances: NDArray[np.float64]) -> None:
    """Fill the upper triangle, row by row, with covariances (n, 2, 2) or (n, 3, 3)."""
    triangles, size = points["covariance"], covariances.shape[1]
    for row, at in zip(range(size), (0, 3, 5), strict=False):  # where the diagonal is
        triangles[:, at : at + size - row] = covariances[:, row, row:]


def _counts(tables: tuple[NDArray[Any], ...]) -> str:
    return ", ".join(str(len(table)) for table in tables)
