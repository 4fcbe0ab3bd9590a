"""What there is to find in a simulated scan, each feature with the bound of its accuracy."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..bounds import LineBound, arc_bound, corner_bound, line_bound
from ..features import Features, make_records
from ..scan import Array, Pose, RangeNoise
from .sensor import Sensor
from .surfaces import View
from .worlds import World

#: A feature by the names of its fields; those that it does not give are 0.
Record = dict[str, Any]

#: Fewer connected beams are noise to every method.
_LEAST_CLUSTER = 3
#: Beams from one cluster to the next beyond which their break is a gap, as in the methods.
_GAP = 6


def truth(world: World, pose: Pose, sensor: Sensor) -> Features:
    """Return the features of a scan as a perfect method would find them.

    Parameters
    ----------
    world : World
        Walls that meet within 1 mm share a vertex; those that go straight on there (within
        1 mrad) are one surface.
    pose : (x, y, theta)
        Pose of the sensor, at rest, in the world frame [m, m, rad].
    sensor : Sensor
        A beam stands for the surface that its axis meets, whatever a mixed pixel, an outlier or
        a drop-out makes of its measurement.

    Returns
    -------
    Features
        In the frame of the sensor, with its `noise`. The covariances are bounds (see
        `lineament.bounds`), NaN for an arc of 2 beams and for a corner with a side of one, whose
        `segments` has -1 there.

        `segments` and `arcs` are runs of neighbouring beams, 2 or more, on one wall or circle.
        A segment goes to a vertex if there is a corner; else to the end of the wall, if the next
        beam passes it by; else half-way to the next beam, which an occluder took; or to the last
        beam of the scan. Its `centroid` is that of the information of its measurements.

        `corners` are the vertices between two neighbouring beams that meet its two walls; `edges`
        are not listed.
        `clusters` are neighbouring beams on surfaces that are connected, 3 or more; `breakpoints`
        lie between neighbouring clusters and at the ends of the scan.

    Examples
    --------
    >>> from lineament.simulation import SENSORS, room
    >>> features = truth(room(), (0.0, 0.0, 0.0), SENSORS["paper"])
    >>> features
    Features(5 segments, 2 corners, 0 edges, 0 arcs, 4 breakpoints, 3 clusters, stamp=0.000)
    >>> features.corners["position"].round(6).tolist(), features.corners["convex"].tolist()
    ([[1.4, -0.5], [3.0, 2.0]], [True, False])
    """
    view = View(world, pose, sensor)
    turn, n_walls = _seam(view), len(view.walls)
    runs = [
        _Run(int(view.surface[beams[0]]), int(beams[0]), int(beams[-1]), len(beams))
        for beams in _parts(view.goes_on, turn)
        if view.surface[beams[0]] >= 0
    ]
    label = np.full(len(view.surface), -1, dtype=np.int32)
    large = [part for part in _parts(_connected(view), turn) if len(part) >= _LEAST_CLUSTER]
    for k, beams in enumerate(large):
        label[beams] = k
    listed = [run for run in runs if run.n_beams >= 2]
    bounds = {r: _line_bound(view, r, sensor.noise) for r in listed if r.surface < n_walls}
    tables = {
        "segments": [_segment(view, r, bound, label) for r, bound in bounds.items()],
        "corners": _corners(view, runs, bounds),
        "edges": [],
        "arcs": [_arc(view, r, sensor.noise) for r in listed if r.surface >= n_walls],
        "breakpoints": _breakpoints(view, label, turn),
    }
    records: dict[str, Any] = {name: make_records(name, rows) for name, rows in tables.items()}
    return Features(**records, clusters=label, frame_id="laser", noise=sensor.noise)


class _Run(NamedTuple):
    """Neighbouring beams on one surface, over the seam if the first is larger than the last."""

    surface: int
    first: int
    last: int
    n_beams: int

    def bearings(self, view: View) -> Array:
        return view.bearings[(self.first + np.arange(self.n_beams)) % len(view.bearings)]

    def beams(self) -> Record:
        return {"first_beam": self.first, "last_beam": self.last, "n_points": self.n_beams}


def _seam(view: View) -> int:
    """Return the beam at which to begin so that nothing connected is cut, if there is one.

    If all is connected around, that is at a corner, or anywhere on a circle.
    """
    if not view.is_full_circle:
        return 0
    for links in (_connected(view), view.goes_on):
        if not links[-1]:
            return 0
        cuts = np.flatnonzero(~links)
        if len(cuts):
            return int(cuts[-1]) + 1
    return 0


def _connected(view: View) -> NDArray[np.bool_]:
    """Whether each beam and the next lie on surfaces that are connected between them."""
    return np.asarray(view.goes_on | ~np.isnan(view.joints[:, 0]))


def _parts(links: NDArray[np.bool_], turn: int) -> list[NDArray[np.int64]]:
    """Part all beams, from beam `turn` around, where one is not linked with the next."""
    order = np.roll(np.arange(len(links)), -turn)
    return np.split(order, np.flatnonzero(~links[order[:-1]]) + 1)


def _line_bound(view: View, run: _Run, noise: RangeNoise) -> LineBound:
    start, end = view.walls[run.surface]
    angle = math.atan2(end[1] - start[1], end[0] - start[0])
    return line_bound(run.bearings(view), start, angle, noise)


def _segment(view: View, run: _Run, bound: LineBound, label: NDArray[np.int32]) -> Record:
    start, end = _extent(view, run, 0), _extent(view, run, 1)
    return run.beams() | {
        "start": start,
        "end": end,
        "length": math.dist(start, end),
        "centroid": bound.centroid,
        "angle": bound.angle,
        "covariance": bound.covariance,
        "cluster": label[run.first],
    }


def _extent(view: View, run: _Run, which: int) -> Array:
    """Return where the visible part of a wall starts (0) or ends (1)."""
    beam, sign = (run.last, 1) if which else (run.first, -1)
    between = beam if which else beam - 1  # Before the first beam is the last.
    vertex: Array = view.joints[between]
    step = float(view.steps[between])
    if not math.isnan(vertex[0]):
        return vertex
    end: Array = view.walls[run.surface, which]
    if step > 0 and sign * view.bearing_from(beam, end) <= step:
        return end
    return view.point_on_wall(view.bearings[beam] + sign * step / 2, run.surface)


def _arc(view: View, run: _Run, noise: RangeNoise) -> Record:
    x, y, radius = view.circles[run.surface - len(view.walls)].tolist()
    covariance: Any = np.nan
    if run.n_beams >= 3:
        covariance = arc_bound(run.bearings(view), (x, y), radius, noise)
    return run.beams() | {"center": (x, y), "radius": radius, "covariance": covariance}


def _corners(view: View, runs: list[_Run], bounds: dict[_Run, LineBound]) -> list[Record]:
    """Each vertex between a run and the next, with the segments of both."""
    index = {run: i for i, run in enumerate(bounds)}
    corners: list[Record] = []
    for before, after in zip(runs, [*runs[1:], *runs[:1]], strict=True):
        vertex = view.joints[before.last]
        if math.isnan(vertex[0]):
            continue
        known = before in bounds and after in bounds
        walls = view.walls[[before.surface, after.surface]]
        (ux, uy), (vx, vy) = walls[:, 1] - walls[:, 0]
        turn = math.atan2(ux * vy - uy * vx, ux * vx + uy * vy)
        nearest = view.bearing_from(before.last, vertex) <= view.steps[before.last] / 2
        corners.append(
            {
                "position": vertex,
                "covariance": corner_bound(bounds[before], bounds[after]) if known else np.nan,
                "opening": math.pi - abs(turn),
                # Beams run counter-clockwise around the sensor: a right turn points towards it.
                "convex": turn < 0,
                "beam": before.last if nearest else after.first,
                "segments": (index.get(before, -1), index.get(after, -1)),
                "quality": 1.0,
                "kind": "corner",
            }
        )
    return corners


def _breakpoints(view: View, label: NDArray[np.int32], turn: int) -> list[Record]:
    """One between each two neighbouring clusters, and at the ends of a scan that has ends."""
    order = np.roll(np.arange(len(label)), -turn)
    order = order[label[order] >= 0]
    if len(order) == 0:
        return []
    ends = np.flatnonzero(np.diff(label[order]))
    breaks = [_break(view, int(order[i]), int(order[i + 1])) for i in ends]
    first, last = int(order[0]), int(order[-1])
    if view.is_full_circle:
        return breaks if _connected(view).all() else [*breaks, _break(view, last, first)]
    for sides, beam in (((-1, first), first), ((last, -1), last)):
        at = _point(view, beam)
        breaks.append({"beam": sides, "position": at, "kind": "scan_end", "occluder": -1})
    return breaks


def _break(view: View, before: int, after: int) -> Record:
    """Of a jump the nearer side occludes. Over many missing beams a surface may go on unseen."""
    near = before if view.ranges[before] <= view.ranges[after] else after
    is_gap = (after - before) % len(view.ranges) > _GAP
    kind, occluder = ("gap", -1) if is_gap else ("jump", near)
    at = _point(view, near)
    return {"beam": (before, after), "position": at, "kind": kind, "occluder": occluder}


def _point(view: View, beam: int) -> tuple[float, float]:
    r, bearing = view.ranges[beam], view.bearings[beam]
    return r * math.cos(bearing), r * math.sin(bearing)
