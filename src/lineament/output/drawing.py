"""What the figures are made of: beams, segments, corners, arcs, breakpoints."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..scan import LaserScan
from .canvas import ARC_COLOR, BREAK_COLOR, CORNER_COLOR, EDGE_COLOR, FAINT, INK, colors_of, style
from .markers import arc_span

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

#: Smaller similarity errors are drawn as this one [m]: a log axis has no place for 0.
LEAST_ERROR = 2e-4


def draw_beams(axes: Axes, scan: LaserScan, clusters: NDArray[np.int32]) -> Array:
    """Points by cluster, noise, invalid beams at the rim, the sensor; gives what must be seen."""
    valid, points = scan.valid, scan.points
    known, noise = valid & (clusters >= 0), valid & (clusters < 0)
    rim = draw_rim(axes, scan)
    x, y = points.T
    axes.scatter(x[known], y[known], s=13, c=colors_of(clusters[known]), linewidths=0, zorder=3)
    if noise.any():
        axes.plot(
            x[noise],
            y[noise],
            "x",
            markersize=3.8,
            color="#868e96",
            markeredgewidth=0.8,
            zorder=3,
            label="noise",
        )
    draw_sensor(axes)
    return np.vstack([points[valid], rim, np.zeros((1, 2))])


def draw_sensor(axes: Axes) -> None:
    """Draw a triangle at the origin that looks along the x axis."""
    axes.plot(
        [0],
        [0],
        marker=(3, 0, -90),
        markersize=9,
        color=INK,
        linestyle="none",
        label="sensor",
        zorder=6,
    )


def draw_rim(axes: Axes, scan: LaserScan) -> Array:
    """Faint ticks just outside the data, in the directions from which nothing came back."""
    from matplotlib.collections import LineCollection

    invalid = ~scan.valid
    if not invalid.any():
        return np.zeros((0, 2))
    rim, length = _rim(scan)
    directions = np.column_stack((np.cos(scan.angles), np.sin(scan.angles)))[invalid]
    ticks = np.stack((rim[invalid, None] * directions, (rim[invalid, None] + length) * directions))
    axes.add_collection(
        LineCollection(
            list(ticks.swapaxes(0, 1)),
            colors=FAINT,
            linewidths=0.7,
            label="no return",
            zorder=1,
        ),
        autolim=False,
    )
    ends: Array = ticks[1]
    return ends


def _rim(scan: LaserScan) -> tuple[Array, float]:
    """Distance of a ring around what each beam's neighbourhood saw, and the length of a tick."""
    ranges = np.where(scan.valid, scan.ranges, 0.0)
    if not ranges.any():
        return np.ones(len(scan)), 0.05
    gap = 0.05 * float(ranges.max())
    bins = np.floor(np.degrees(scan.angles) / 8).astype(int)
    bins -= bins.min()
    farthest = np.zeros(bins.max() + 3)
    np.maximum.at(farthest, bins + 1, ranges)
    # With both neighbours, so that a tick never lies between points.
    farthest = np.maximum(farthest[1:-1], np.maximum(farthest[:-2], farthest[2:]))
    known = np.flatnonzero(farthest)
    outline = np.interp(np.arange(len(farthest)), known, farthest[known])
    return outline[bins] + gap, 0.6 * gap


def draw_segments(axes: Axes, segments: NDArray[np.void]) -> None:
    """Lines with a short mark across each end."""
    from matplotlib.collections import LineCollection

    lines = np.stack((segments["start"], segments["end"]), axis=1)
    lines = lines[np.isfinite(lines).all(axis=(1, 2))]
    if not len(lines):
        return
    axes.add_collection(
        LineCollection(
            list(lines), colors=INK, linewidths=1.0, capstyle="round", label="segment", zorder=4
        ),
        autolim=False,
    )
    for start, end in lines:
        across = math.degrees(math.atan2(end[1] - start[1], end[0] - start[0]))
        axes.plot(
            *np.array([start, end]).T,
            marker=(2, 0, across),
            markersize=6,
            markeredgewidth=1.0,
            color=INK,
            linestyle="none",
            zorder=4,
        )


def draw_corners(axes: Axes, corners: NDArray[np.void], extent: float) -> None:
    """Markers, with 3 σ ellipses where they can be seen in a plan of some extent [m].

    Edges are smaller and lighter than corners, and have no ellipse.
    """
    from matplotlib.patches import Ellipse

    finite = np.isfinite(corners["position"]).all(axis=1)
    corners = corners[finite]
    is_edge = corners["kind"] == "edge"
    corners, edges = corners[~is_edge], corners[is_edge]
    for drawn, size, color, name in (
        (edges, 4.0, EDGE_COLOR, "edge"),
        (corners, 5.5, CORNER_COLOR, "corner"),
    ):
        if len(drawn):
            axes.plot(
                *drawn["position"].T,
                marker="D",
                markersize=size,
                markerfacecolor="none",
                markeredgecolor=color,
                markeredgewidth=size / 4,
                linestyle="none",
                label=name,
                zorder=5,
            )
    label = "3 σ of a corner"
    for corner in corners[np.isfinite(corners["covariance"]).all(axis=(1, 2))]:
        variances, axes_of = np.linalg.eigh(corner["covariance"])
        half = 3 * np.sqrt(np.maximum(variances, 0))
        if not 0.012 * extent < half[1] < extent:  # hidden by the marker, or no knowledge at all
            continue
        axes.add_patch(
            Ellipse(
                tuple(corner["position"]),
                2 * half[1],
                2 * half[0],
                angle=math.degrees(math.atan2(axes_of[1, 1], axes_of[0, 1])),
                facecolor=CORNER_COLOR + "22",
                edgecolor=CORNER_COLOR,
                linewidth=0.8,
                label=label,
                zorder=4.5,
            )
        )
        label = ""


def draw_breakpoints(axes: Axes, breakpoints: NDArray[np.void]) -> None:
    """Small markers where surfaces end."""
    positions = breakpoints["position"]
    positions = positions[np.isfinite(positions).all(axis=1)]
    if len(positions):
        axes.plot(
            *positions.T,
            marker="o",
            markersize=3.6,
            markerfacecolor="white",
            markeredgecolor=BREAK_COLOR,
            markeredgewidth=0.9,
            linestyle="none",
            label="breakpoint",
            zorder=4.2,
        )


def draw_arcs(axes: Axes, arcs: NDArray[np.void], scan: LaserScan) -> None:
    """Draw the part of each circle that was seen and, thinly, the whole of it."""
    label = "arc"
    for arc in arcs[np.isfinite(arcs["center"]).all(axis=1) & np.isfinite(arcs["radius"])]:
        whole = _circle(arc, 0.0, 2 * math.pi)
        seen = _circle(arc, *arc_span(arc, scan))
        axes.plot(*whole, color=ARC_COLOR, linewidth=0.5, linestyle=(0, (2, 3)), zorder=4.05)
        axes.plot(*seen, color=ARC_COLOR, linewidth=2.0, label=label, zorder=4.1)
        label = ""


def _circle(arc: np.void, first: float, last: float) -> tuple[Array, Array]:
    turn = np.linspace(first, last, 181)
    x, y = arc["center"]
    return x + arc["radius"] * np.cos(turn), y + arc["radius"] * np.sin(turn)


def draw_features(axes: Axes, features: Features, scan: LaserScan, extent: float) -> None:
    """All features of a scan, over its beams."""
    draw_arcs(axes, features.arcs, scan)
    draw_segments(axes, features.segments)
    draw_breakpoints(axes, features.breakpoints)
    draw_corners(axes, features.corners, extent)


def draw_errors(axes: Axes, scan: LaserScan, errors: Array) -> None:
    """Distance of each point from its own line, by bearing, on a scale that all methods share."""
    known = errors[np.isfinite(errors)]
    told = (
        f"similarity error: mean {1e3 * known.mean():.1f} mm, largest {1e3 * known.max():.0f} mm"
        if len(known)
        else "no lines, no similarity error"
    )
    style(axes, "", told)
    bearings = np.degrees(scan.angles)
    axes.plot(bearings, np.maximum(errors, LEAST_ERROR), ".", markersize=3, color=INK)
    axes.set_yscale("log")
    axes.set_ylim(1e-4, 10.0)
    axes.set_xlabel("bearing [°]", fontsize=9, color="#57606a")
    axes.set_ylabel("error [m]", fontsize=9, color="#57606a")
    if len(scan) > 1:
        axes.set_xlim(*bearings[[0, -1]])
