"""What there is to find in a simulated scan, each feature with the bound of its accuracy."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..bounds import LineBound, arc_bound, corner_bound, line_bound
from ..features import ARC, BREAKPOINT, CORNER, SEGMENT, Features
from ..scan import Array, Pose, RangeNoise
from .sensor import Sensor
from .surfaces import View
from .worlds import World

__all__ = ["truth"]

#: A feature as the fields of its dtype.
Record = tuple[object, ...]

#: Fewer connected beams are noise to every method.
_LEAST_CLUSTER = 3
#: Beams from one cluster to the next beyond which their break is a gap, as in the methods.
_GAP = 6


def truth(world: World, pose: Pose, sensor: Sensor) -> Features:
    """Tell the features of a scan as a perfect method would find them.

    Parameters
    ----------
    world : World
        What there is to see. Walls that meet within 1 mm share a vertex; those that go straight
        on there (within 1 mrad) are one surface.
    pose : (x, y, theta)
        Pose of the sensor, at rest, in the world frame [m, m, rad].
    sensor : Sensor
        Its beams, range limits and noise. A beam stands for the surface that its axis meets,
        whatever a mixed pixel, an outlier or a drop-out makes of its reading.

    Returns
    -------
    Features
        In the frame of the sensor. `noise` is the sensor's.

        `segments` are runs of neighbouring beams, 2 or more, on one wall. `start` and `end` are
        its visible extent: a vertex where there is a corner; else the end of the wall, if the
        next beam passes it by; else half-way to the next beam, which an occluder took. They end
        at the last beam where the scan ends. `covariance` is the bound, `centroid` that of the
        readings' information, `rms` and `misfit` 0.

        `corners` are the vertices between two neighbouring beams that meet its two walls.
        `segments` has -1 for a side of one beam, and `covariance` is then NaN. `response`
        is 0, `quality` 1, `kind` "corner".

        `arcs` are runs of neighbouring beams, 2 or more, on one circle; the covariance of 2 is
        NaN.

        `clusters` are neighbouring beams on surfaces that are connected: on the same one, or
        across a corner; fewer than 3 are none, -1. `breakpoints` lie between neighbouring
        clusters and at the ends of the scan.

    See Also
    --------
    lineament.bounds : the bounds.

    Examples
    --------
    >>> from lineament.simulation import SENSORS, room
    >>> features = truth(room(), (0.0, 0.0, 0.0), SENSORS["paper"])
    >>> features
    Features(5 segments, 2 corners, 0 arcs, 4 breakpoints, 3 clusters, stamp=0.000)
    >>> features.corners["position"].round(6).tolist(), features.corners["convex"].tolist()
    ([[1.4, -0.5], [3.0, 2.0]], [True, False])
    """
    view = View(world, pose, sensor)
    turn = _seam(view)
    runs = _runs(view, turn)
    label = _clusters(view, turn)
    listed, n_walls = [run for run in runs if run.n_beams >= 2], len(view.walls)
    bounds = {r: _line_bound(view, r, sensor.noise) for r in listed if r.surface < n_walls}
    arcs = [_arc(view, r, sensor.noise) for r in listed if r.surface >= n_walls]
    return Features(
        _table([_segment(view, r, bound, label) for r, bound in bounds.items()], SEGMENT),
        _table(_corners(view, runs, bounds), CORNER),
        _table(arcs, ARC),
        label,
        _table(_breakpoints(view, label, turn), BREAKPOINT),
        frame_id="laser",
        noise=sensor.noise,
    )


@dataclass(frozen=True, slots=True)
class _Run:
    """Neighbouring beams on one surface, over the seam where the first is larger than the last."""

    surface: int
    first: int
    last: int
    n_beams: int

    def beams(self, n: int) -> NDArray[np.int64]:
        """Tell its beams in order, of a scan of n."""
        return (self.first + np.arange(self.n_beams)) % n


def _seam(view: View) -> int:
    """Tell the beam at which to begin so that nothing connected is cut, if there is one.

    Where all is connected around, that is at a corner, or anywhere on a circle.
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
    connected: NDArray[np.bool_] = view.goes_on | ~np.isnan(view.joints[:, 0])
    return connected


def _parts(links: NDArray[np.bool_], turn: int) -> list[NDArray[np.int64]]:
    """Part all beams, from beam `turn` around, where one is not linked with the next."""
    order = np.roll(np.arange(len(links)), -turn)
    return np.split(order, np.flatnonzero(~links[order[:-1]]) + 1)


def _runs(view: View, turn: int) -> list[_Run]:
    return [
        _Run(int(view.surface[beams[0]]), int(beams[0]), int(beams[-1]), len(beams))
        for beams in _parts(view.goes_on, turn)
        if view.surface[beams[0]] >= 0
    ]


def _clusters(view: View, turn: int) -> NDArray[np.int32]:
    label, count = np.full(len(view.surface), -1, dtype=np.int32), 0
    for beams in _parts(_connected(view), turn):
        if len(beams) >= _LEAST_CLUSTER:
            label[beams] = count
            count += 1
    return label


def _line_bound(view: View, run: _Run, noise: RangeNoise) -> LineBound:
    start, end = view.walls[run.surface]
    angle = math.atan2(end[1] - start[1], end[0] - start[0])
    return line_bound(view.bearings[run.beams(len(view.bearings))], start, angle, noise)


def _segment(view: View, run: _Run, bound: LineBound, label: NDArray[np.int32]) -> Record:
    return (
        _extent(view, run, 0),
        _extent(view, run, 1),
        bound.centroid,
        bound.angle,
        bound.covariance,
        run.first,
        run.last,
        run.n_beams,
        0.0,
        0.0,
        label[run.first],
    )


def _extent(view: View, run: _Run, which: int) -> Array:
    """Tell where the visible part of a wall starts (0) or ends (1)."""
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
    bearings = view.bearings[run.beams(len(view.bearings))]
    known = run.n_beams >= 3
    covariance = arc_bound(bearings, (x, y), radius, noise) if known else _unknown(3)
    return ((x, y), radius, covariance, run.first, run.last, run.n_beams, 0.0)


def _corners(view: View, runs: list[_Run], bounds: dict[_Run, LineBound]) -> list[Record]:
    """Each vertex between a run and the next, with the segments of both."""
    index = {run: i for i, run in enumerate(bounds)}
    corners: list[Record] = []
    for before, after in zip(runs, [*runs[1:], *runs[:1]], strict=True):
        vertex = view.joints[before.last]
        if math.isnan(vertex[0]):
            continue
        known = before in bounds and after in bounds
        covariance = corner_bound(bounds[before], bounds[after]) if known else _unknown(2)
        turn = _turn(view, before.surface, after.surface)
        # Beams run counter-clockwise around the sensor: a right turn points towards it.
        shape = (math.pi - abs(turn), turn < 0)
        nearest = view.bearing_from(before.last, vertex) <= view.steps[before.last] / 2
        beam = before.last if nearest else after.first
        sides = (index.get(before, -1), index.get(after, -1))
        corners.append((vertex, covariance, *shape, beam, 0.0, sides, 1.0, "corner"))
    return corners


def _turn(view: View, before: int, after: int) -> float:
    """Turn from one wall to the next, in the order of the beams, in (-π, π) [rad]."""
    (ux, uy), (vx, vy) = (view.walls[k, 1] - view.walls[k, 0] for k in (before, after))
    return math.atan2(ux * vy - uy * vx, ux * vx + uy * vy)


def _breakpoints(view: View, label: NDArray[np.int32], turn: int) -> list[Record]:
    """One between each two neighbouring clusters, and at the ends of a scan that has ends."""
    order = np.roll(np.arange(len(label)), -turn)
    order = order[label[order] >= 0]
    if len(order) == 0:
        return []
    last_beams = np.flatnonzero(np.diff(label[order]))
    breaks = [_break(view, int(order[i]), int(order[i + 1])) for i in last_beams]
    first, last = int(order[0]), int(order[-1])
    if not view.is_full_circle:
        start = ((-1, first), _point(view, first), "scan_end", -1)
        end = ((last, -1), _point(view, last), "scan_end", -1)
        return [*breaks, start, end]
    return breaks if _connected(view).all() else [*breaks, _break(view, last, first)]


def _break(view: View, before: int, after: int) -> Record:
    """Of a jump the nearer side occludes. Over many missing beams a surface may go on unseen."""
    near = before if view.ranges[before] <= view.ranges[after] else after
    is_gap = (after - before) % len(view.ranges) > _GAP
    kind, occluder = ("gap", -1) if is_gap else ("jump", near)
    return ((before, after), _point(view, near), kind, occluder)


def _point(view: View, beam: int) -> tuple[float, float]:
    r, bearing = view.ranges[beam], view.bearings[beam]
    return r * math.cos(bearing), r * math.sin(bearing)


def _unknown(n: int) -> Array:
    return np.full((n, n), np.nan)


def _table(records: list[Record], dtype: np.dtype[np.void]) -> NDArray[np.void]:
    """Make a read-only table of records."""
    table = np.array(records, dtype)
    table.flags.writeable = False
    return table
