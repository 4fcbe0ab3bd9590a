"""Scores of a map of polylines against the scan that it was made of, by the benchmark's rules."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import needed_by
from ...scan import Array, LaserScan
from ..counts import rms

#: By how much a ray may pass the end of a segment and still meet it [rad].
_MARGIN = 1e-3


@dataclass(frozen=True, slots=True)
class MapScore:
    """Scores of one map; NaN for what a scan without such beams, or without an outline, has not."""

    #: Vertices of its polylines, in all.
    vertices: int
    #: Root mean square of measured less mapped range, of the returns whose ray meets the map [m].
    rmse: float
    #: Share of the returns whose ray meets the map.
    f: float
    #: Share of the beams without a return whose ray meets nothing.
    fnr: float
    #: (Area of the union - area of the intersection) / true area.
    area_error: float = math.nan
    #: Area of the intersection / area of the union.
    iou: float = math.nan


def score_map(
    polylines: Sequence[Array], scan: LaserScan, outline: Array | None = None
) -> MapScore:
    """Score a map against the scan that it was made of, and against the true outline.

    Parameters
    ----------
    polylines : sequence of arrays, shape (k, 2)
        In the frame of the sensor [m].
    scan : LaserScan
        Its valid beams are the returns.
    outline : array, shape (m, 2), optional
        Vertices of the true polygon around the sensor [m]. It is compared with the polygon of the
        map's vertices, sorted by bearing and made valid; LineamentError without shapely.

    Examples
    --------
    >>> scan = LaserScan([2.0, 2.0, np.nan], angle_min=-0.2, angle_increment=0.2)
    >>> wall = np.array([[2.0, -1.0], [2.0, 0.1]])
    >>> score_map([wall], scan)  # doctest: +ELLIPSIS
    MapScore(vertices=2, rmse=0.0287..., f=1.0, fnr=1.0, area_error=nan, iou=nan)
    """
    mapped, returned = cast_map(polylines, scan.angles), scan.valid
    met = ~np.isnan(mapped)
    return MapScore(
        sum(map(len, polylines)),
        rms((mapped - scan.ranges)[returned & met]),
        _share(met[returned]),
        _share(~met[~returned]),
        *(() if outline is None else _areas(polylines, outline)),
    )


def cast_map(polylines: Sequence[Array], bearings: Array) -> Array:
    """Range [m] at which the ray of each bearing [rad] meets a map; NaN if it meets nothing.

    A ray meets a segment if its bearing lies between those of the ends, or within 10⁻³ rad of
    them, at its intersection with the infinite line. Of several segments the last in order counts.

    Examples
    --------
    >>> cast_map([np.array([[2.0, -1.0], [2.0, 1.0]])], np.array([0.0, 0.8])).tolist()
    [2.0, nan]
    """
    for k, polyline in enumerate(polylines):
        if np.ndim(polyline) != 2 or np.shape(polyline)[1] != 2:
            raise ValueError(f"polylines[{k}] has shape {np.shape(polyline)}, expected (k, 2)")
    parts = [np.column_stack((line[:-1], line[1:])) for line in polylines if len(line) > 1]
    if not parts:
        return np.full(len(bearings), np.nan)
    x1, y1, x2, y2 = np.concatenate(parts).T[:, :, None]
    begin, end = np.arctan2(y1, x1), np.arctan2(y2, x2)
    span = (end - begin + math.pi) % (2 * math.pi) - math.pi
    right = np.where(span < 0, end, begin)
    met = (bearings - right + _MARGIN) % (2 * math.pi) <= np.abs(span) + 2 * _MARGIN
    last = len(met) - 1 - np.argmax(met[::-1], axis=0)
    # The normal of each segment is (y1 - y2, x2 - x1).
    nx, ny = (y1 - y2)[last, 0], (x2 - x1)[last, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = (nx * x1[last, 0] + ny * y1[last, 0]) / (
            nx * np.cos(bearings) + ny * np.sin(bearings)
        )
    return np.where(met.any(axis=0) & np.isfinite(ranges), ranges, np.nan)


def _share(flags: NDArray[np.bool_]) -> float:
    return float(flags.mean()) if len(flags) else math.nan


def _areas(polylines: Sequence[Array], outline: Array) -> tuple[float, float]:
    """Area error and intersection over union of a map and the true outline."""
    with needed_by("areas"):
        import shapely
    true = shapely.make_valid(shapely.Polygon(outline))
    vertices = np.concatenate([np.empty((0, 2)), *polylines])
    if len(vertices) < 3:
        return 1.0, 0.0
    bearings = np.arctan2(vertices[:, 1], vertices[:, 0])
    found = shapely.make_valid(shapely.Polygon(vertices[np.argsort(bearings, kind="stable")]))
    union, common = true.union(found).area, true.intersection(found).area
    return (union - common) / true.area, common / union
