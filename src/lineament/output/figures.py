"""Pictures of what was found: one scan by many methods, one run stage by stage, a whole log."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import astuple
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..scan import Array, LaserScan, Pose
from . import canvas, drawing
from .canvas import ARC_COLOR, CORNER_COLOR, EDGE_COLOR, FAINT, INK, WAY_COLOR, count
from .markers import Markers, markers_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..methods.trace import Trace

PANEL, _STRIP = 5.6, 1.9  # width of a panel, height of a strip of errors [inch]


def plot_scan(
    scan: LaserScan, features_by_method: Mapping[str, Features], path: str | os.PathLike[str]
) -> None:
    """Write the picture that `scan_figure` makes to a ``.png``, ``.svg`` or ``.pdf`` file."""
    canvas.check_ending(path)
    canvas.save(scan_figure(scan, features_by_method), path)


def scan_figure(
    scan: LaserScan,
    features_by_method: Mapping[str, Features],
    errors_by_method: Mapping[str, Array] | None = None,
    *,
    panel: float = PANEL,
    farthest: float = math.inf,
) -> Figure:
    """Draw what some methods found in one scan, one panel a method, side by side.

    Points have the colour of their cluster, noise is a grey cross, and ticks on a ring outside the
    data show where nothing came back. The number beside a corner is its response. Edges are drawn
    lighter than corners, without a number. The similarity errors of the beams (n,) [m], if given,
    are drawn below the panel of the method. Panels are so wide [inch]; narrow ones have no numbers,
    and points beyond `farthest` [m] are not shown.

    Raises a ValueError if there is no method, or features do not have the scan's number of beams.
    """
    if not features_by_method:
        raise ValueError("features_by_method is empty, expected at least one method")
    for method, features in features_by_method.items():
        _check_beams(scan, features.clusters, method)
    n_methods = len(features_by_method)
    columns = min(n_methods, 3 if n_methods <= 9 else 4)
    rows = math.ceil(n_methods / columns)
    height = _height(scan, panel, farthest) + 0.9
    heights = [height] if errors_by_method is None else [height, _STRIP]
    figure = canvas.new_figure(panel * columns, sum(heights) * rows + 0.3)
    grid = figure.subplots(
        len(heights) * rows, columns, squeeze=False, height_ratios=heights * rows
    )
    panels, strips = grid[:: len(heights)].ravel(), grid[1 :: len(heights)].ravel()
    for axes in [*panels[n_methods:], *strips[n_methods:]]:
        axes.remove()
    for k, (method, features) in enumerate(features_by_method.items()):
        shown = drawing.draw_beams(panels[k], scan, features.clusters)
        shown = shown[np.hypot(*shown.T) <= farthest]
        about = _about(features, () if panel >= PANEL else ("segments", "corners", "clusters"))
        canvas.style_plane(panels[k], method, about, shown)
        drawing.draw_features(panels[k], features, scan, _extent(panels[k]))
        if errors_by_method is not None:
            drawing.draw_errors(strips[k], scan, errors_by_method[method])
    canvas.add_legend(figure)
    if panel < PANEL:
        return figure
    canvas.settle(figure)
    for axes, features in zip(panels, features_by_method.values(), strict=False):
        corners = features.corners[features.corners["response"] != 0]  # edges and truth have none
        points = scan.points[scan.valid]
        drawing.label_points(axes, corners["position"], corners["response"], points)
    return figure


def plot_trace(trace: Trace, path: str | os.PathLike[str]) -> None:
    """Draw the stages of one run: filter, spacing against its thresholds, clusters, corners.

    Of a method that examines no candidates, the corners and edges that it found are drawn.
    """
    canvas.check_ending(path)
    scan = trace.scan
    _check_beams(scan, trace.clusters, trace.method)
    height = _height(scan, 6.2)
    figure = canvas.new_figure(13, 4.0 + height + 1.0)
    panels = figure.subplots(2, 2, height_ratios=[3.2, height])
    _draw_filter(panels[0, 0], trace)
    _draw_spacing(panels[0, 1], trace)
    shown = _draw_clusters(panels[1, 0], trace)
    positions = _draw_candidates(panels[1, 1], trace, shown)
    for axes, below in zip(panels.ravel(), (0.13, 0.13, 0.1, 0.1), strict=True):
        if axes.get_legend_handles_labels()[0]:
            axes.legend(
                fontsize=8,
                loc="upper left",
                bbox_to_anchor=(0, -below),
                ncols=5,
                frameon=False,
                borderaxespad=0,
                handletextpad=0.4,
            )
    canvas.settle(figure)
    points = scan.points[scan.valid]
    drawing.label_points(panels[1, 1], positions, trace.candidates["response"], points)
    canvas.save(figure, path)


def _draw_filter(axes: Axes, trace: Trace) -> None:
    """Draw raw and filtered ranges by bearing, and the beams without a return."""
    scan, degrees = trace.scan, np.degrees(trace.scan.angles)
    about = f"{count(int(scan.valid.sum()), 'valid beam')} of {len(scan)}"
    canvas.style(axes, "a  Filter", about, "bearing [°]", "range [m]")
    raw = np.where(scan.valid, scan.ranges, np.nan)
    axes.plot(degrees, raw, ".", color=FAINT, markersize=3.5, label="raw")
    axes.plot(degrees, trace.filtered, color=WAY_COLOR, linewidth=1.0, label="filtered")
    bad = degrees[~scan.valid]
    if len(bad):
        low = np.full(len(bad), 0.015)  # of the height of the panel
        place = axes.get_xaxis_transform()
        axes.plot(bad, low, "|", c=CORNER_COLOR, ms=7, transform=place, label="no return")
    axes.set_ylim(bottom=0)
    axes.margins(x=0.01)


def _draw_spacing(axes: Axes, trace: Trace) -> None:
    """Draw the spacing of the beams, what it was compared with, and where clusters end."""
    beams = np.arange(len(trace.scan))
    labels, used = trace.clusters, np.flatnonzero(trace.scan.valid)
    breaks = used[1:][labels[used[1:]] != labels[used[:-1]]]
    about = count(len(breaks), "break")
    canvas.style(axes, "b  Spacing", about, "beam", "distance to the beam before [m]")
    # A log axis has no place for 0 (two beams that share a point).
    spacing, far, dense = (
        np.where(values > 0, values, np.nan)
        for values in (trace.spacing, trace.distance_threshold, trace.density_threshold)
    )
    if np.isfinite([spacing, far, dense]).any():
        axes.set_yscale("log")
    for i, beam in enumerate(breaks):
        axes.axvline(beam, color="#dbb0b4", linewidth=0.8, zorder=1, label="" if i else "break")
    axes.plot(beams, spacing, ".-", color=INK, markersize=2.5, linewidth=0.5, label="spacing")
    axes.plot(beams, far, color=WAY_COLOR, linewidth=1.2, label="distance threshold")
    axes.plot(beams, dense, ".", color="#bc4c00", markersize=4, label="density threshold")
    axes.margins(x=0.01)


def _draw_clusters(axes: Axes, trace: Trace) -> Array:
    """Draw the beams by cluster; returns the points that both plans show."""
    scan, clusters = trace.scan, trace.clusters
    shown = drawing.draw_beams(axes, scan, clusters)
    n_noise = int((scan.valid & (clusters < 0)).sum())
    about = f"{count(_n_clusters(clusters), 'cluster')} · {count(n_noise, 'noise point')}"
    canvas.style_plane(axes, "c  Clusters", about, shown)
    return shown


def _draw_candidates(axes: Axes, trace: Trace, shown: Array) -> Array:
    """Draw segments and candidates over faint points; returns the positions of the candidates."""
    scan, candidates, accepted = trace.scan, trace.candidates, trace.candidates["accepted"]
    axes.plot(*scan.points[scan.valid].T, ".", markersize=4, color="#c4cad0", mew=0, zorder=2)
    drawing.draw_segments(axes, trace.features.segments)
    drawing.draw_sensor(axes)
    about = (
        f"{count(len(candidates), 'candidate')} · {int(accepted.sum())} accepted · "
        f"threshold {trace.threshold:.4g} · {count(len(trace.features.segments), 'segment')}"
        if len(candidates)
        else _about(trace.features)
    )
    canvas.style_plane(axes, "d  Corners", about, shown)
    if not len(candidates):  # a method that examines none
        drawing.draw_corners(axes, trace.features.corners, _extent(axes))
    # Where the detection saw them: on the filtered ranges.
    beams = candidates["beam"]
    directions = np.column_stack((np.cos(scan.angles[beams]), np.sin(scan.angles[beams])))
    positions: Array = trace.filtered[beams, None] * directions
    for chosen, face, label in (
        (accepted, CORNER_COLOR, "accepted"),
        (~accepted, "white", "rejected"),
    ):
        if chosen.any():
            x, y = positions[chosen].T
            axes.plot(x, y, "o", ms=5.5, mfc=face, mec=CORNER_COLOR, label=label, zorder=5)
    return positions


def plot_map(
    posed: Iterable[tuple[Pose, Features]], path: str | os.PathLike[str], title: str = "Map"
) -> None:
    """Draw segments, corners and arcs of many scans in the world, with the way of the sensor.

    Each scan has the pose of the sensor in the world [m, m, rad] and what was found there, in its
    own frame. Edges are drawn lighter than corners.
    """
    from matplotlib.collections import LineCollection

    canvas.check_ending(path)
    way, found = _in_the_world(posed)
    shown = np.vstack([found.segments.reshape(-1, 2), found.corners, found.edges, way])
    figure = canvas.new_figure(9, canvas.plane_height(shown, 9) + 1.3)
    axes = figure.subplots()
    numbers = {"scans": len(way)} | {
        name: len(getattr(found, name)) for name in ("segments", "corners", "edges", "arcs")
    }
    canvas.style_plane(axes, title, _counts(numbers), shown)
    # Walls that were seen often come out dark, what was seen once stays faint; not so the legend.
    alpha = float(np.clip(60 / max(len(way), 1), 0.08, 0.9))
    for name, strips, color, width in (
        ("segments", list(found.segments), INK, 0.9),
        ("arcs", found.arc_strips(), ARC_COLOR, 0.7),
    ):
        if len(strips) or name == "segments":
            lines = LineCollection(strips, colors=color, linewidths=width, alpha=alpha)
            axes.add_collection(lines)
            axes.plot([], [], color=color, linewidth=1.2, label=name)
    for name, color in (("edges", EDGE_COLOR), ("corners", CORNER_COLOR)):
        points = getattr(found, name)
        axes.plot(*points.T, "o", color=color, ms=2.2, mew=0, alpha=max(alpha, 0.2), zorder=3)
        if len(points) or name == "corners":
            axes.plot([], [], "o", color=color, markersize=4, label=name)
    axes.plot(*way.T, color=WAY_COLOR, linewidth=1.3, label="path of the sensor", zorder=4)
    if len(way):
        axes.plot(*way[0], "o", color=WAY_COLOR, ms=6, mec="white", label="start", zorder=5)
    canvas.add_legend(figure)
    canvas.save(figure, path)


_NOTHING = tuple(np.zeros((0, *shape)) for shape in ((2, 2), (2,), (2,), (5,), (5,)))


def _in_the_world(posed: Iterable[tuple[Pose, Features]]) -> tuple[Array, Markers]:
    """Return the positions (m, 2) of the sensor, and what was found from all of them."""
    way, found = [], [_NOTHING]
    for pose, features in posed:
        way.append(pose[:2])
        with np.errstate(invalid="ignore"):  # what is not finite is not drawn
            found.append(astuple(markers_of(features.transform(*pose))))
    return np.reshape(way, (-1, 2)), Markers(*map(np.concatenate, zip(*found, strict=True)))


def _check_beams(scan: LaserScan, clusters: NDArray[np.int32], method: str) -> None:
    if len(clusters) != len(scan):
        raise ValueError(f"{method}: clusters of {len(clusters)} beams, the scan has {len(scan)}")


def _height(scan: LaserScan, width: float, farthest: float = math.inf) -> float:
    shown = scan.points[scan.valid & (scan.ranges <= farthest)]
    return canvas.plane_height(np.vstack([shown, np.zeros((1, 2))]), width)


def _extent(axes: Axes) -> float:
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    return max(x1 - x0, y1 - y0)


def _n_clusters(clusters: NDArray[np.int32]) -> int:
    return len(np.unique(clusters[clusters >= 0]))


def _about(features: Features, kinds: Iterable[str] = ()) -> str:
    """Write how many features there are of some kinds, or of all."""
    counts = features.counts() | {"clusters": _n_clusters(features.clusters)}
    return _counts({kind: counts[kind] for kind in kinds or counts})


def _counts(counts: dict[str, int]) -> str:
    """Write how many things of each kind there are; edges only if there are some."""
    kept = {name: number for name, number in counts.items() if number or name != "edges"}
    return " · ".join(count(number, name[:-1]) for name, number in kept.items())
