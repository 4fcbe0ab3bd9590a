"""What figures are made of: beams, segments, corners, arcs, breakpoints, and texts beside them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..scan import Array, LaserScan
from .canvas import style, theme_of
from .markers import arc_span, ellipses_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Smaller similarity errors are drawn as this one [m]: a log axis has no place for 0.
LEAST_ERROR = 2e-4
#: Share of the errors of a corner that lie within three deviations.
THREE_SIGMA = 1 - math.exp(-4.5)
#: Half axes of drawn ellipses are cut at this length [m].
LARGEST_ELLIPSE = 0.5
#: A plan leaves out beams that lie far out, of which this share may be on each side of each axis
#: and `FEW` in all, where its area is so many times smaller without them.
FEW_BEYOND, FEW, SMALLER = 0.05, 0.1, 1.5
#: What keeps a text away from a place: less than this is another corner or some points.
_COLLISION = 60


def points_to_show(
    scan: LaserScan, found: Iterable[Features], farthest: float = math.inf
) -> tuple[Array, int]:
    """Return the points (n, 2) that a plan of a scan shows, and how many of its beams it does not.

    It shows the sensor and what was found, and leaves out a few beams that lie far from it, and
    those beyond `farthest` [m]. What was found outside of all beams does not count.
    """
    sensor = np.zeros((1, 2))
    valid = scan.points[scan.valid]
    points = valid[scan.ranges[scan.valid] <= farthest]
    everything = np.vstack([points, sensor])
    low, high = everything.min(axis=0), everything.max(axis=0)
    marks = [sensor]
    for features in found:
        segments, corners, edges = features.segments, features.corners, features.edges
        marks += [segments["start"], segments["end"], corners["position"], edges["position"]]
    known = np.vstack(marks)
    pad = 0.05 * (high - low).max()
    known = known[((known >= low - pad) & (known <= high + pad)).all(axis=1)]
    if len(points):
        known = np.vstack([known, np.quantile(points, [FEW_BEYOND, 1 - FEW_BEYOND], axis=0)])
    core_low, core_high = known.min(axis=0), known.max(axis=0)
    pad = 0.05 * (core_high - core_low).max()
    core_low, core_high = core_low - pad, core_high + pad
    extents = np.array([high - low, core_high - core_low])
    whole, core = np.prod(np.maximum(extents, 0.1 * extents.max(axis=1, keepdims=True)), axis=1)
    inside = ((points >= core_low) & (points <= core_high)).all(axis=1)
    if whole > SMALLER * core and (~inside).sum() <= FEW * len(points):
        points = points[inside]
    return np.vstack([points, known]), len(valid) - len(points)


def draw_beams(axes: Axes, scan: LaserScan, clusters: NDArray[np.int32]) -> Array:
    """Draw points by cluster, noise, the sensor, and where nothing came back to it.

    Returns the points (n, 2) of all that came back, and of the sensor.
    """
    known, noise = scan.valid & (clusters >= 0), scan.valid & (clusters < 0)
    theme = theme_of(axes)
    _draw_gaps(axes, scan)
    x, y = scan.points[known].T
    colors = theme.palette[clusters[known] % len(theme.palette)]
    axes.scatter(x, y, s=13, c=colors, linewidths=0, zorder=3)
    _draw_points(axes, scan.points[noise], "noise", marker="x", ms=3.8, c=theme.faint, mew=0.8)
    draw_sensor(axes)
    return np.vstack([scan.points[scan.valid], np.zeros((1, 2))])


def _draw_points(axes: Axes, points: Array, label: str, **style: Any) -> None:
    """Draw the finite of some points; without one the legend has no line for them."""
    points = points[np.isfinite(points).all(axis=1)]
    if len(points):
        axes.plot(*points.T, ls="none", label=label, **{"zorder": 3} | style)


def draw_sensor(axes: Axes) -> None:
    """Draw a triangle at the origin that looks along the x axis."""
    shape = {"marker": (3, 0, -90), "markersize": 9, "color": theme_of(axes).ink, "zorder": 6}
    _draw_points(axes, np.zeros((1, 2)), "sensor", **shape)


def _draw_gaps(axes: Axes, scan: LaserScan) -> None:
    """Draw faint wedges from the sensor in the directions from which nothing came back."""
    from matplotlib.collections import PolyCollection

    invalid = np.flatnonzero(~scan.valid)
    if not len(invalid):
        return
    reach, half = _reach(scan), abs(scan.angle_increment) / 2
    wedges = []
    for run in np.split(invalid, np.flatnonzero(np.diff(invalid) > 1) + 1):
        first, last = run[0], run[-1]
        bearings = np.concatenate(([scan.angles[first] - half], scan.angles[run],
                                   [scan.angles[last] + half]))  # fmt: skip
        ranges = reach[np.concatenate(([first], run, [last]))]
        rim = ranges[:, None] * np.column_stack((np.cos(bearings), np.sin(bearings)))
        wedges.append(np.vstack((np.zeros((1, 2)), rim)))
    color = theme_of(axes).gap
    shapes = PolyCollection(wedges, facecolor=color, linewidths=0, zorder=0.6, label="no return")
    axes.add_collection(shapes, autolim=False)


def _reach(scan: LaserScan) -> Array:
    """Return the distance of what each beam's neighbourhood saw [m]; 1 where nothing was seen."""
    ranges = np.where(scan.valid, scan.ranges, 0.0)
    if not ranges.any():
        return np.ones(len(scan))
    bins = np.floor(np.degrees(scan.angles) / 8).astype(int)
    bins -= bins.min()
    farthest = np.zeros(bins.max() + 3)
    for shift in range(3):  # with both neighbours
        np.maximum.at(farthest, bins + shift, ranges)
    known = np.flatnonzero(farthest)
    return np.asarray(np.interp(bins + 1, known, farthest[known]))


def draw_name(axes: Axes, name: str, at: Array, viewer: Array, color: str) -> None:
    """Write the name of a place on the line of sight to it, where no wall can be."""
    axes.annotate(
        name,
        (float(at[0]), float(at[1])),
        xytext=tuple(30 * (viewer - at) / math.dist(viewer, at)),
        textcoords="offset points",
        ha="left" if viewer[0] > at[0] else "right",
        va="center",
        color=color,
        arrowprops={"arrowstyle": "-", "color": color},
    )


def draw_segments(axes: Axes, segments: NDArray[np.void]) -> None:
    """Draw lines with a short mark across each end."""
    label, ink = "segment", theme_of(axes).ink
    aspect = axes.get_aspect()
    larger = 1.0 if isinstance(aspect, str) else aspect  # y than x
    for start, end in zip(segments["start"], segments["end"], strict=True):
        if not np.isfinite([start, end]).all():
            continue
        if label:
            axes.plot([], [], color=ink, linewidth=1.0, label=label)  # without the marks
            label = ""
        across = math.degrees(math.atan2(larger * (end[1] - start[1]), end[0] - start[0]))
        ends = np.column_stack((start, end))
        axes.plot(*ends, color=ink, lw=1.0, marker=(2, 0, across), ms=6, mew=1.0, zorder=4)


def draw_points(axes: Axes, features: Features, extent: float) -> None:
    """Draw edges and corners, with 3 σ ellipses where they can be seen in a plan of an extent [m].

    Edges are smaller and lighter than corners, and have no ellipse.
    """
    from matplotlib.patches import Ellipse

    theme, corners = theme_of(axes), features.corners
    for drawn, size, color, name in (
        (features.edges, 4.0, theme.edge, "edge"),
        (corners, 5.5, theme.corner, "corner"),
    ):
        shape = {"marker": "D", "ms": size, "mfc": "none", "mec": color, "mew": size / 4}
        _draw_points(axes, drawn["position"], name, **shape, zorder=5)
    label = f"3 σ of a corner, at most {LARGEST_ELLIPSE} m"
    for x, y, a, b, turn in ellipses_of(corners["position"], corners["covariance"], THREE_SIGMA):
        if a > 0.012 * extent:  # else hidden by the marker
            a, b = min(a, LARGEST_ELLIPSE), min(b, LARGEST_ELLIPSE)
            shape = {"facecolor": theme.corner + "22", "edgecolor": theme.corner, "linewidth": 0.8}
            turned = math.degrees(turn)
            axes.add_patch(
                Ellipse((x, y), 2 * a, 2 * b, angle=turned, label=label, zorder=4.5, **shape)
            )
            label = ""


def draw_breakpoints(axes: Axes, breakpoints: NDArray[np.void]) -> None:
    """Draw small rings where surfaces end."""
    theme = theme_of(axes)
    shape = {"marker": "o", "ms": 3.6, "mfc": theme.paper, "mec": theme.breakpoint, "mew": 0.9}
    _draw_points(axes, breakpoints["position"], "breakpoint", **shape, zorder=4.2)


def draw_arcs(axes: Axes, arcs: NDArray[np.void], scan: LaserScan) -> None:
    """Draw the part of each circle that was seen and, thinly, the whole of it."""
    label, color = "arc", theme_of(axes).arc
    for arc in arcs[np.isfinite(arcs["center"]).all(axis=1) & np.isfinite(arcs["radius"])]:
        for span, name, line in (
            ((0.0, 2 * math.pi), "", {"linewidth": 0.5, "linestyle": ":", "zorder": 4.05}),
            (arc_span(arc, scan), label, {"linewidth": 2.0, "zorder": 4.1}),
        ):
            turn = np.linspace(*span, 181)
            circle = np.column_stack((np.cos(turn), np.sin(turn)))
            axes.plot(*(arc["center"] + arc["radius"] * circle).T, c=color, label=name, **line)
        label = ""


def draw_features(axes: Axes, features: Features, scan: LaserScan, extent: float) -> None:
    """Draw all features of a scan, over its beams."""
    draw_arcs(axes, features.arcs, scan)
    draw_segments(axes, features.segments)
    draw_breakpoints(axes, features.breakpoints)
    draw_points(axes, features, extent)


def draw_errors(axes: Axes, scan: LaserScan, errors: Array) -> None:
    """Draw the distance of each point from its line, by bearing, on a scale that never changes."""
    known = errors[np.isfinite(errors)]
    about = (
        f"similarity error: mean {1e3 * known.mean():.1f} mm, largest {1e3 * known.max():.0f} mm"
        if len(known)
        else "no lines, no similarity error"
    )
    style(axes, "", about, "bearing [°]", "error [m]")
    bearings = np.degrees(scan.angles)
    axes.plot(
        bearings, np.maximum(errors, LEAST_ERROR), ".", markersize=3, color=theme_of(axes).ink
    )
    axes.set_yscale("log")
    axes.set_ylim(1e-4, 10.0)
    if len(scan) > 1:
        axes.set_xlim(*bearings[[0, -1]])


def label_points(axes: Axes, positions: Array, values: Array, obstacles: Array) -> None:
    """Write a number beside each position, where it hides the fewest points and no other number.

    The axes must have their final limits and place in the figure. A position without a number
    (NaN) or without room for it, or outside of the axes, gets none.
    """
    from matplotlib.patheffects import withStroke

    figure, theme = axes.get_figure(root=True), theme_of(axes)
    assert figure is not None

    def on_paper(points: Array) -> Array:
        return np.asarray(axes.transData.transform(points)) * 72 / figure.dpi

    panel = np.reshape(axes.get_window_extent().extents, (2, 2)) * 72 / figure.dpi
    is_there = np.isfinite(positions).all(axis=1) & np.isfinite(values)
    here, hidden = on_paper(positions), on_paper(obstacles[np.isfinite(obstacles).all(axis=1)])
    is_there &= ((here > panel[0]) & (here < panel[1])).all(axis=1)
    positions, here, values = positions[is_there], here[is_there], values[is_there]
    placed = np.zeros((0, 2, 2))  # the middle and half the size of each text
    for k in np.argsort(-values, kind="stable"):
        text = f"{values[k]:.2f}"
        half = np.array([4.6 * len(text), 9.0]) / 2  # of a text of 7 points
        offsets = _DIRECTIONS * (half + 6 * _RINGS[:, None])
        tried = here[k] + offsets
        cost = 4 * _RINGS + _hits(tried, half, hidden) + 12 * _hits(tried, half, here)
        cost += _COLLISION * 100 * _hits(tried, half + placed[:, 1], placed[:, 0])
        outside = np.abs(tried - panel.mean(axis=0)) + half > np.ptp(panel, axis=0) / 2
        cost += _COLLISION * 100 * outside.any(axis=1)
        best = int(cost.argmin())
        if cost[best] > _COLLISION:
            continue
        placed = np.append(placed, [[tried[best], half]], axis=0)
        axes.annotate(
            text,
            tuple(positions[k]),
            xytext=tuple(offsets[best]),
            textcoords="offset points",
            fontsize=7,
            color=theme.corner,
            ha="center",
            va="center",
            zorder=7,
            path_effects=[withStroke(linewidth=2.2, foreground=theme.paper)],
        )


#: Where a text is tried: in twelve directions, ever farther away.
_RINGS, _TURNS = np.repeat([1.0, 1.7, 2.6, 4.0, 6.0], 12), np.tile(np.arange(12) * math.pi / 6, 5)
_DIRECTIONS = np.column_stack((np.cos(_TURNS), np.sin(_TURNS)))


def _hits(middles: Array, half: Array, points: Array) -> NDArray[np.int64]:
    """Return how many of some points lie in the box about each middle, of half this size."""
    return np.asarray((np.abs(middles[:, None] - points) < half).all(axis=2).sum(axis=1))
