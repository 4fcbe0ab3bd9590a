"""Pictures of what was found: one scan by many methods, one run stage by stage, a whole log."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..features import TABLES, Features
from ..scan import LaserScan, Pose
from . import canvas, drawing, stage_panels
from .canvas import ARC_COLOR, CORNER_COLOR, EDGE_COLOR, INK, count
from .labels import label_points

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..methods.trace import Trace

__all__ = ["plot_map", "plot_scan", "plot_trace", "scan_figure"]

_PANEL, _STRIP = 5.6, 1.9  # width of a panel, height of a strip of errors [inch]


def plot_scan(
    scan: LaserScan, features_by_method: Mapping[str, Features], path: str | os.PathLike[str]
) -> None:
    """Draw what some methods found in one scan into a file: see `scan_figure`.

    Parameters
    ----------
    scan, features_by_method
        As of `scan_figure`.
    path : path-like
        A file that ends in ``.png``, ``.svg`` or ``.pdf``.

    Raises
    ------
    LineamentError
        If the ending is not known or the file cannot be written.
    ValueError
        As `scan_figure`.
    """
    canvas.check_ending(path)
    canvas.save(scan_figure(scan, features_by_method), path)


def scan_figure(
    scan: LaserScan,
    features_by_method: Mapping[str, Features],
    errors_by_method: Mapping[str, NDArray[np.float64]] | None = None,
) -> Figure:
    """Draw what some methods found in one scan, one panel a method, side by side.

    Points have the colour of their cluster, noise is a grey cross, and ticks on a ring outside the
    data tell where nothing came back. The number beside a corner is its response. Edges are drawn
    lighter than corners, without a number.

    Parameters
    ----------
    scan : LaserScan
        The scan.
    features_by_method : mapping of str to Features
        Title of each panel, and what to draw in it.
    errors_by_method : mapping of str to ndarray, shape (n,), optional
        Similarity error of each beam [m], drawn below the panel of the method.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ValueError
        If there is no method, or features do not have the scan's number of beams.
    """
    if not features_by_method:
        raise ValueError("features_by_method is empty, expected at least one method")
    for method, features in features_by_method.items():
        _check_beams(scan, features.clusters, method)
    n_methods, has_strips = len(features_by_method), errors_by_method is not None
    columns = min(n_methods, 3 if n_methods <= 9 else 4)
    rows = math.ceil(n_methods / columns)
    height = canvas.plane_size(np.vstack([scan.points[scan.valid], np.zeros((1, 2))]), _PANEL)
    heights = [height + 0.9, _STRIP] if has_strips else [height + 0.9]
    figure = canvas.new_figure(_PANEL * columns, sum(heights) * rows + 0.3)
    grid = figure.subplots(
        len(heights) * rows, columns, squeeze=False, height_ratios=heights * rows
    )
    panels, strips = grid[:: len(heights)].ravel(), grid[1 :: len(heights)].ravel()
    for axes in [*panels[n_methods:], *strips[n_methods:]]:
        axes.remove()
    for axes, (method, features) in zip(panels, features_by_method.items(), strict=False):
        shown = drawing.draw_beams(axes, scan, features.clusters)
        canvas.style_plane(axes, method, _counts(features), shown)
        drawing.draw_features(axes, features, scan, _extent(axes))
    if errors_by_method is not None:
        for axes, method in zip(strips, features_by_method, strict=False):
            drawing.draw_errors(axes, scan, errors_by_method[method])
    _legend(figure)
    canvas.settle(figure)
    for axes, features in zip(panels, features_by_method.values(), strict=False):
        corners = features.corners[features.corners["response"] != 0]  # edges, the truth
        texts = [f"{response:.3g}" for response in corners["response"]]
        label_points(axes, corners["position"], texts, scan.points[scan.valid])
    return figure


def plot_trace(trace: Trace, path: str | os.PathLike[str]) -> None:
    """Draw the stages of one run: filter, spacing against its thresholds, classes, corners.

    Of a method that examines no candidates, the corners and edges that it found are drawn.

    Parameters
    ----------
    trace : Trace
        Every intermediate of the run.
    path : path-like
        A file that ends in ``.png``, ``.svg`` or ``.pdf``.

    Raises
    ------
    LineamentError
        If the ending is not known or the file cannot be written.
    ValueError
        If the classes do not have the scan's number of beams.
    """
    canvas.check_ending(path)
    scan, candidates = trace.scan, trace.candidates
    _check_beams(scan, trace.clusters, trace.method)
    height = canvas.plane_size(np.vstack([scan.points[scan.valid], np.zeros((1, 2))]), 6.2)
    figure = canvas.new_figure(13, 4.0 + height + 1.0)
    panels = figure.subplots(2, 2, height_ratios=[3.2, height])
    stage_panels.draw_filter(panels[0, 0], trace)
    stage_panels.draw_spacing(panels[0, 1], trace)

    shown = drawing.draw_beams(panels[1, 0], scan, trace.clusters)
    n_classes = len(np.unique(trace.clusters[trace.clusters >= 0]))
    n_noise = int((scan.valid & (trace.clusters < 0)).sum())
    about = f"{count(n_classes, 'class', 'classes')} · {count(n_noise, 'noise point')}"
    canvas.style_plane(panels[1, 0], "c  Classes", about, shown)

    positions = stage_panels.draw_candidates(panels[1, 1], trace)
    n_accepted = int(candidates["accepted"].sum())
    about = (
        f"{count(len(candidates), 'candidate')} · {n_accepted} accepted · "
        f"threshold {trace.threshold:.4g} · {count(len(trace.features.segments), 'segment')}"
    )
    if not len(candidates):  # a method that examines none
        about = _counts(trace.features)
    canvas.style_plane(panels[1, 1], "d  Corners", about, shown)
    if not len(candidates):
        drawing.draw_corners(panels[1, 1], trace.features.corners, _extent(panels[1, 1]))
    for axes in panels.ravel():
        if axes.get_legend_handles_labels()[0]:
            axes.legend(
                fontsize=8,
                loc="upper left",
                bbox_to_anchor=(0, -0.13 if axes in panels[0] else -0.1),
                ncols=5,
                frameon=False,
                borderaxespad=0,
                handletextpad=0.4,
            )
    canvas.settle(figure)
    texts = [f"{response:.3g}" for response in candidates["response"]]
    label_points(panels[1, 1], positions, texts, scan.points[scan.valid])
    canvas.save(figure, path)


def plot_map(
    posed: Iterable[tuple[Pose, Features]], path: str | os.PathLike[str], title: str = "Map"
) -> None:
    """Draw segments, corners and arcs of many scans in the world, with the way of the sensor.

    Edges are drawn lighter than corners.

    Parameters
    ----------
    posed : iterable of ((x, y, theta), Features)
        Pose of the sensor in the world [m, m, rad], and what was found there, in its own frame.
    path : path-like
        A file that ends in ``.png``, ``.svg`` or ``.pdf``.
    title : str
        Title of the picture.

    Raises
    ------
    LineamentError
        If the ending is not known or the file cannot be written.
    """
    from matplotlib.collections import EllipseCollection, LineCollection

    canvas.check_ending(path)
    way, lines, corners, edges, arcs = _in_the_world(posed)
    shown = np.vstack([lines.reshape(-1, 2), corners, edges, way])
    figure = canvas.new_figure(9, canvas.plane_size(shown, 9) + 1.3)
    axes = figure.subplots()
    # Walls that were seen often come out dark, what was seen once stays faint.
    alpha = float(np.clip(60 / max(len(way), 1), 0.08, 0.9))
    counts = [count(len(way), "scan"), count(len(lines), "segment"), count(len(corners), "corner")]
    counts += [count(len(edges), "edge")] if len(edges) else []
    about = " · ".join([*counts, count(len(arcs), "arc")])
    canvas.style_plane(axes, title, about, shown)
    axes.add_collection(LineCollection(list(lines), colors=INK, linewidths=0.9, alpha=alpha))
    axes.plot([], [], color=INK, linewidth=1.2, label="segments")  # for the legend, not faint
    for points, color, name in ((edges, EDGE_COLOR, "edges"), (corners, CORNER_COLOR, "corners")):
        x, y = points.T
        axes.plot(x, y, "o", markersize=2.2, color=color, alpha=max(alpha, 0.2), mew=0, zorder=3)
        if len(points) or points is corners:
            axes.plot([], [], "o", markersize=4, color=color, label=name)
    if len(arcs):
        radius = arcs[:, 2]
        circles = EllipseCollection(
            2 * radius, 2 * radius, 0 * radius, units="xy", offsets=arcs[:, :2],
            offset_transform=axes.transData, facecolors="none", edgecolors=ARC_COLOR,
            linewidths=0.7, alpha=alpha,
        )  # fmt: skip
        axes.add_collection(circles)
        axes.plot([], [], color=ARC_COLOR, linewidth=1.2, label="arcs")
    axes.plot(*way.T, color="#0969da", linewidth=1.3, label="way of the sensor", zorder=4)
    if len(way):
        axes.plot(*way[0], "o", color="#0969da", markersize=6, mec="white", label="start", zorder=5)
    _legend(figure)
    canvas.save(figure, path)


def _in_the_world(
    posed: Iterable[tuple[Pose, Features]],
) -> tuple[NDArray[np.float64], ...]:
    """Positions (m, 2) of the sensor, lines (l, 2, 2), corners, edges (k, 2), arcs x y r (a, 3).

    Only what is finite.
    """
    way, lines, arcs = [np.zeros((0, 2))], [np.zeros((0, 2, 2))], [np.zeros((0, 3))]
    corners, edges = [np.zeros((0, 2))], [np.zeros((0, 2))]
    for pose, features in posed:
        with np.errstate(invalid="ignore"):  # what is not finite is not drawn
            moved = features.transform(*pose)
        way.append(np.array([pose[:2]], dtype=np.float64))
        lines.append(np.stack((moved.segments["start"], moved.segments["end"]), axis=1))
        is_edge = moved.corners["kind"] == "edge"
        corners.append(moved.corners["position"][~is_edge])
        edges.append(moved.corners["position"][is_edge])
        arcs.append(np.column_stack((moved.arcs["center"], moved.arcs["radius"])))
    line = np.concatenate(lines)
    corner, edge, arc = (np.concatenate(parts) for parts in (corners, edges, arcs))
    return (
        np.concatenate(way),
        line[np.isfinite(line).all(axis=(1, 2))],
        *(points[np.isfinite(points).all(axis=1)] for points in (corner, edge, arc)),
    )


def _check_beams(scan: LaserScan, clusters: NDArray[np.int32], method: str) -> None:
    if len(clusters) != len(scan):
        raise ValueError(f"{method}: clusters of {len(clusters)} beams, the scan has {len(scan)}")


def _extent(axes: Axes) -> float:
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    return max(x1 - x0, y1 - y0)


def _legend(figure: Figure) -> None:
    """One legend for all panels, below them."""
    handles: dict[str, Artist] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(str(label), handle)
    figure.legend(
        handles=list(handles.values()),
        labels=list(handles),
        loc="outside lower center",
        ncols=8,
        fontsize=9,
        frameon=False,
    )


def _counts(features: Features) -> str:
    n_clusters = len(np.unique(features.clusters[features.clusters >= 0]))
    numbers = {name[:-1]: len(getattr(features, name)) for name in TABLES}
    n_edges = int((features.corners["kind"] == "edge").sum())
    numbers["corner"] -= n_edges
    counts = [count(number, name) for name, number in numbers.items()]
    if n_edges:
        counts.insert(2, count(n_edges, "edge"))
    return " · ".join([*counts, count(n_clusters, "cluster")])
