"""Maps of polylines: made of features or of points alone, and scored by the benchmark's rules."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from lineament.extractor import Extractor
from lineament.features import Features
from lineament.methods import get_method
from lineament.scan import Array, LaserScan

from ..counts import rms

#: Makes the polylines of a scan, arrays of shape (k, 2) [m], with at most so many vertices in all.
MapMaker = Callable[[LaserScan, int], Sequence[Array]]

#: By how much a ray may pass the end of a segment and still meet it [rad].
_MARGIN = 1e-3
#: A line steeper than this to the ray is not followed to where the ray would meet it.
_LEAST_COSINE = 0.1
#: Error of a return that the map does not explain, and the most that any counts [m].
_WORST = 0.3
#: Errors below this are of rounding [m].
_LEAST = 1e-12


def method_map(method: str) -> MapMaker:
    """Make maps with a method of the registry, given the number of vertices as its budget.

    Raises ValueError if there is no such method, or it has no parameter ``max_vertices``.

    Examples
    --------
    >>> bearings = np.radians(np.arange(-40, 41))
    >>> ranges = 2.0 / (np.cos(bearings) + np.abs(np.sin(bearings)))  # a corner, straight ahead
    >>> make = method_map("iepf")
    >>> [len(polyline) for polyline in make(LaserScan(ranges, angles=bearings), 10)]
    [3]
    """
    get_method(method, max_vertices=1)

    @cache
    def extractor(max_vertices: int) -> Extractor:
        return Extractor(method, max_vertices=max_vertices)

    return lambda scan, max_vertices: polylines_of(extractor(max_vertices)(scan), scan)


def sparing_map(method: str) -> MapMaker:
    """Make maps with a method of the registry, of as many vertices as there is evidence for.

    Of the maps with 2, 3, … vertices that of the least n ln(E/n) + v (2 ln(n/v) + 5), where v is
    the budget, n the number of returns, and E the sum of their squared range errors: the penalty
    of E. Lebarbier, *Detecting multiple change-points in the mean of Gaussian process by model
    selection*, Signal Processing 85, 2005, with the noise taken from what is left of E.

    Examples
    --------
    >>> bearings = np.radians(np.arange(-40, 41))
    >>> ranges = 2.0 / (np.cos(bearings) + np.abs(np.sin(bearings)))  # a corner, straight ahead
    >>> ranges += np.random.default_rng(7).normal(0.0, 0.01, len(ranges))
    >>> polylines = sparing_map("optimal")(LaserScan(ranges, angles=bearings), 10)
    >>> [len(polyline) for polyline in polylines]
    [3]
    """
    make = method_map(method)

    def make_sparingly(scan: LaserScan, max_vertices: int) -> Sequence[Array]:
        maps = {v: make(scan, v) for v in range(2, max_vertices + 1)}
        penalised = {v: _penalised(polylines, scan, v) for v, polylines in maps.items()}
        return maps[min(penalised, key=penalised.__getitem__)] if maps else []

    return make_sparingly


def _penalised(polylines: Sequence[Array], scan: LaserScan, vertices: int) -> float:
    """How ill a map explains a scan, and what its vertices cost."""
    ranges, n = scan.ranges[scan.valid], max(int(scan.valid.sum()), 1)
    errors = np.nan_to_num(cast_map(polylines, scan.angles[scan.valid]) - ranges, nan=_WORST)
    squares = max(float(np.sum(np.minimum(errors**2, _WORST**2))), n * _LEAST**2)
    return n * math.log(squares / n) + vertices * (2.0 * math.log(n / vertices) + 5.0)


def polylines_of(features: Features, scan: LaserScan) -> list[Array]:
    """Connect the segments of a scan at its corners.

    Segments that a corner joins share one vertex, midway between the end of the first and the
    start of the second: that is the corner itself if it lies on both lines. Elsewhere a segment
    goes on to the rays of its first and last beam. A closed outline ends in its first vertex.
    Polylines are in beam order, of shape (k, 2) [m] in the frame of the sensor.

    Examples
    --------
    >>> import lineament as ln
    >>> scan = LaserScan([2.0, 2.0, 2.0], angle_min=-0.01, angle_increment=0.01)
    >>> polylines_of(ln.extract(scan, method="iepf"), scan)[0].round(2).tolist()
    [[2.0, -0.02], [2.0, 0.02]]
    """
    segments, angles = features.segments, scan.angles
    joints = {a: (b, c) for c, (a, b) in enumerate(features.corners["segments"].tolist())}
    joints = {a: (b, c) for a, (b, c) in joints.items() if a >= 0 and b >= 0}
    open_ones = set(range(len(segments))) - {b for b, _ in joints.values()}
    polylines, drawn = [], set[int]()
    # A closed outline has no segment to begin with: its are those to which no open one leads.
    for k in [*sorted(open_ones), *range(len(segments))]:
        if k in drawn:
            continue
        first = segments[k]
        vertices = [_on_ray(first, "start", angles[first["first_beam"]])] if k in open_ones else []
        while k in joints and k not in drawn:
            drawn.add(k)
            after, corner = joints[k]
            bend = angles[features.corners["beam"][corner]]
            vertices.append(_shared_vertex(segments[k], segments[after], angles, bend))
            k = after
        if k in drawn:
            vertices.insert(0, vertices[-1])
        else:
            drawn.add(k)
            vertices.append(_on_ray(segments[k], "end", angles[segments[k]["last_beam"]]))
        polylines.append(np.array(vertices))
    return polylines


def _shared_vertex(before: np.void, after: np.void, angles: Array, bend: float) -> Array:
    """Vertex of two segments, midway between their ends.

    Nearly parallel lines may meet behind the beams of both, and the map would turn back on
    itself: then midway between them on the ray of the bend.
    """
    vertex = np.asarray((before["end"] + after["start"]) / 2)
    right, left = angles[before["first_beam"]], angles[after["last_beam"]]
    turn = math.atan2(vertex[1], vertex[0]) - right
    if turn % (2 * math.pi) <= (left - right) % (2 * math.pi):
        return vertex
    return (_on_ray(before, "end", bend) + _on_ray(after, "start", bend)) / 2


def _on_ray(segment: np.void, end: str, bearing: float) -> Array:
    """Where a ray meets the line of a segment; its end if it hardly meets the line."""
    normal = np.array([-math.sin(segment["angle"]), math.cos(segment["angle"])])
    ray = np.array([math.cos(bearing), math.sin(bearing)])
    cosine = normal @ ray
    if abs(cosine) < _LEAST_COSINE:
        return np.array(segment[end])
    return np.asarray((normal @ segment["centroid"]) / cosine * ray)


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
    """Score a map against the scan that it was made of, whose valid beams are the returns.

    Polylines (k, 2) and the true polygon around the sensor, the outline (m, 2), are in the frame of
    the sensor [m]. The outline is compared with the polygon of the map's vertices, sorted by
    bearing and made valid.

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
    import shapely

    true = shapely.make_valid(shapely.Polygon(outline))
    vertices = np.concatenate([np.empty((0, 2)), *polylines])
    if len(vertices) < 3:
        return 1.0, 0.0
    bearings = np.arctan2(vertices[:, 1], vertices[:, 0])
    found = shapely.make_valid(shapely.Polygon(vertices[np.argsort(bearings, kind="stable")]))
    union, common = true.union(found).area, true.intersection(found).area
    return (union - common) / true.area, common / union
