"""What figures are made of: beams, segments, corners, arcs, breakpoints, and texts beside them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..scan import Array, LaserScan
from .canvas import ARC_COLOR, BREAK_COLOR, CORNER_COLOR, EDGE_COLOR, FAINT, INK, PALETTE, style
from .markers import arc_span, ellipses_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Smaller similarity errors are drawn as this one [m]: a log axis has no place for 0.
LEAST_ERROR = 2e-4
#: Share of the errors of a corner that lie within three deviations.
THREE_SIGMA = 1 - math.exp(-4.5)
#: Half axes of drawn ellipses are cut at this length [m].
LARGEST_ELLIPSE = 0.5
#: More positions than this get no texts.
MAX_LABELS = 29


def draw_beams(axes: Axes, scan: LaserScan, clusters: NDArray[np.int32]) -> Array:
    """Draw points by cluster, noise, invalid beams at the rim, and the sensor.

    Returns the points (n, 2) that the panel must show.
    """
    known, noise = scan.valid & (clusters >= 0), scan.valid & (clusters < 0)
    rim = _draw_rim(axes, scan)
    x, y = scan.points[known].T
    axes.scatter(x, y, s=13, c=PALETTE[clusters[known] % len(PALETTE)], linewidths=0, zorder=3)
    _draw_points(axes, scan.points[noise], "noise", marker="x", ms=3.8, c="#868e96", mew=0.8)
    draw_sensor(axes)
    return np.vstack([scan.points[scan.valid], rim, np.zeros((1, 2))])


def _draw_points(axes: Axes, points: Array, label: str, **style: Any) -> None:
    """Draw the finite of some points; without one the legend has no line for them."""
    points = points[np.isfinite(points).all(axis=1)]
    if len(points):
        axes.plot(*points.T, ls="none", label=label, **{"zorder": 3} | style)


def draw_sensor(axes: Axes) -> None:
    """Draw a triangle at the origin that looks along the x axis."""
    _draw_points(
        axes, np.zeros((1, 2)), "sensor", marker=(3, 0, -90), markersize=9, color=INK, zorder=6
    )


def _draw_rim(axes: Axes, scan: LaserScan) -> Array:
    """Draw faint ticks just outside the data in the directions from which nothing came back.

    Returns their outer ends (m, 2).
    """
    from matplotlib.collections import LineCollection

    invalid = ~scan.valid
    if not invalid.any():
        return np.zeros((0, 2))
    rim, gap = _rim(scan)
    directions = np.column_stack((np.cos(scan.angles), np.sin(scan.angles)))[invalid]
    inner = (rim[invalid] + gap)[:, None] * directions
    outer: Array = inner + 0.6 * gap * directions
    ticks = LineCollection(
        list(np.stack((inner, outer), axis=1)), colors=FAINT, linewidths=0.7, label="no return"
    )
    axes.add_collection(ticks, autolim=False)
    return outer


def _rim(scan: LaserScan) -> tuple[Array, float]:
    """Return the distance of what each beam's neighbourhood saw, and a gap to keep from it [m]."""
    ranges = np.where(scan.valid, scan.ranges, 0.0)
    if not ranges.any():
        return np.ones(len(scan)), 0.08
    bins = np.floor(np.degrees(scan.angles) / 8).astype(int)
    bins -= bins.min()
    farthest = np.zeros(bins.max() + 3)
    for shift in range(3):  # with both neighbours, so that a tick never lies between points
        np.maximum.at(farthest, bins + shift, ranges)
    known = np.flatnonzero(farthest)
    return np.interp(bins + 1, known, farthest[known]), 0.05 * float(ranges.max())


def draw_segments(axes: Axes, segments: NDArray[np.void]) -> None:
    """Draw lines with a short mark across each end."""
    label = "segment"
    for start, end in zip(segments["start"], segments["end"], strict=True):
        if not np.isfinite([start, end]).all():
            continue
        if label:
            axes.plot([], [], color=INK, linewidth=1.0, label=label)  # without the marks
            label = ""
        across = math.degrees(math.atan2(end[1] - start[1], end[0] - start[0]))
        ends = np.column_stack((start, end))
        axes.plot(*ends, color=INK, lw=1.0, marker=(2, 0, across), ms=6, mew=1.0, zorder=4)


def draw_corners(axes: Axes, corners: NDArray[np.void], extent: float) -> None:
    """Draw corners, with 3 σ ellipses where they can be seen in a plan of some extent [m].

    Edges are smaller and lighter than corners, and have no ellipse.
    """
    from matplotlib.patches import Ellipse

    is_edge = corners["kind"] == "edge"
    for drawn, size, color, name in (
        (corners[is_edge], 4.0, EDGE_COLOR, "edge"),
        (corners[~is_edge], 5.5, CORNER_COLOR, "corner"),
    ):
        shape = {"marker": "D", "ms": size, "mfc": "none", "mec": color, "mew": size / 4}
        _draw_points(axes, drawn["position"], name, **shape, zorder=5)
    corners = corners[~is_edge]
    label = f"3 σ of a corner, at most {LARGEST_ELLIPSE} m"
    for x, y, a, b, turn in ellipses_of(corners["position"], corners["covariance"], THREE_SIGMA):
        if a > 0.012 * extent:  # else hidden by the marker
            a, b = min(a, LARGEST_ELLIPSE), min(b, LARGEST_ELLIPSE)
            shape = {"facecolor": CORNER_COLOR + "22", "edgecolor": CORNER_COLOR, "linewidth": 0.8}
            turned = math.degrees(turn)
            axes.add_patch(
                Ellipse((x, y), 2 * a, 2 * b, angle=turned, label=label, zorder=4.5, **shape)
            )
            label = ""


def draw_breakpoints(axes: Axes, breakpoints: NDArray[np.void]) -> None:
    """Draw small rings where surfaces end."""
    shape = {"marker": "o", "ms": 3.6, "mfc": "white", "mec": BREAK_COLOR, "mew": 0.9}
    _draw_points(axes, breakpoints["position"], "breakpoint", **shape, zorder=4.2)


def draw_arcs(axes: Axes, arcs: NDArray[np.void], scan: LaserScan) -> None:
    """Draw the part of each circle that was seen and, thinly, the whole of it."""
    label = "arc"
    for arc in arcs[np.isfinite(arcs["center"]).all(axis=1) & np.isfinite(arcs["radius"])]:
        for span, name, line in (
            ((0.0, 2 * math.pi), "", {"linewidth": 0.5, "linestyle": (0, (2, 3)), "zorder": 4.05}),
            (arc_span(arc, scan), label, {"linewidth": 2.0, "zorder": 4.1}),
        ):
            turn = np.linspace(*span, 181)
            circle = np.column_stack((np.cos(turn), np.sin(turn)))
            axes.plot(*(arc["center"] + arc["radius"] * circle).T, c=ARC_COLOR, label=name, **line)
        label = ""


def draw_features(axes: Axes, features: Features, scan: LaserScan, extent: float) -> None:
    """Draw all features of a scan, over its beams."""
    draw_arcs(axes, features.arcs, scan)
    draw_segments(axes, features.segments)
    draw_breakpoints(axes, features.breakpoints)
    draw_corners(axes, features.corners, extent)


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
    axes.plot(bearings, np.maximum(errors, LEAST_ERROR), ".", markersize=3, color=INK)
    axes.set_yscale("log")
    axes.set_ylim(1e-4, 10.0)
    if len(scan) > 1:
        axes.set_xlim(*bearings[[0, -1]])


def label_points(axes: Axes, positions: Array, values: Array, obstacles: Array) -> None:
    """Write a number beside each position, where it hides the fewest points and no other number.

    The axes must have their final limits and place in the figure. Many positions get no numbers.
    """
    from matplotlib.patheffects import withStroke

    finite = np.isfinite(positions).all(axis=1)
    positions, texts = positions[finite], [f"{value:.3g}" for value in values[finite]]
    if len(positions) > MAX_LABELS:
        return
    figure = axes.get_figure(root=True)
    assert figure is not None

    def on_paper(points: Array) -> Array:
        return np.asarray(axes.transData.transform(points)) * 72 / figure.dpi

    here, hidden = on_paper(positions), on_paper(obstacles[np.isfinite(obstacles).all(axis=1)])
    panel = np.reshape(axes.get_window_extent().extents, (2, 2)) * 72 / figure.dpi
    placed = np.zeros((0, 2, 2))  # the middle and half the size of each text
    for k, text in enumerate(texts):
        half = np.array([4.6 * len(text), 9.0]) / 2  # of a text of 7 points
        offsets = _DIRECTIONS * (half + 6 * _RINGS[:, None])
        tried = here[k] + offsets
        cost = 4 * _RINGS + _hits(tried, half, hidden) + 12 * _hits(tried, half, here)
        cost += 60 * _hits(tried, half + placed[:, 1], placed[:, 0])
        cost += 100 * (np.abs(tried - panel.mean(axis=0)) + half > np.ptp(panel, axis=0) / 2).any(1)
        best = int(cost.argmin())
        placed = np.append(placed, [[tried[best], half]], axis=0)
        axes.annotate(
            text,
            tuple(positions[k]),
            xytext=tuple(offsets[best]),
            textcoords="offset points",
            fontsize=7,
            color=CORNER_COLOR,
            ha="center",
            va="center",
            zorder=7,
            path_effects=[withStroke(linewidth=2.2, foreground="white")],
        )


#: Where a text is tried: in twelve directions, ever farther away.
_RINGS, _TURNS = np.repeat([1.0, 1.7, 2.6, 4.0, 6.0], 12), np.tile(np.arange(12) * math.pi / 6, 5)
_DIRECTIONS = np.column_stack((np.cos(_TURNS), np.sin(_TURNS)))


def _hits(middles: Array, half: Array, points: Array) -> NDArray[np.int64]:
    """Return how many of some points lie in the box about each middle, of half this size."""
    return np.asarray((np.abs(middles[:, None] - points) < half).all(axis=2).sum(axis=1))
