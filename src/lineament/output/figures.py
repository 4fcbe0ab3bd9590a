"""Pictures of what was found: one scan by many methods, many scans, a whole log."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import astuple
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..scan import Array, LaserScan, Pose
from ..scan.fields import date_of
from . import canvas, drawing
from .canvas import count
from .markers import Markers, markers_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PANEL, _STRIP = 5.6, 1.9  # width of a panel, height of a strip of errors [inch]
_ALONE = 8.0  # width of a panel that has no neighbour [inch]
_NOTE = "Beside a corner: its quality, the share of such corners found again from another place."
#: Colour, width and dashes of the parts of a way.
_WAYS: dict[str, tuple[str, float, str]] = {
    "way": ("way", 1.0, "-"),
    "not sure": ("corner", 3.0, "-"),
    "located": ("way", 1.6, "-"),
    "direction unobserved": ("arc", 3.0, "-"),
    "not located": ("corner", 1.8, ":"),
}


def scan_title(log: str | os.PathLike[str], index: int, scan: LaserScan, topic: str = "") -> str:
    """Return a title of a picture: log, scan, its topic if given, and the time of the scan."""
    parts = [Path(str(log).rstrip("/")).name, f"scan {index}", *([topic] if topic else [])]
    if scan.stamp:
        parts.append(date_of(scan.stamp) or f"{scan.stamp:.2f} s")
    return " · ".join(parts)


def plot_scan(
    scan: LaserScan,
    features_by_method: Mapping[str, Features],
    path: str | os.PathLike[str],
    **shown: Any,
) -> None:
    """Write the picture that `scan_figure` makes to a ``.png``, ``.svg`` or ``.pdf`` file."""
    canvas.check_ending(path)
    canvas.save(scan_figure(scan, features_by_method, **shown), path)


def plot_walls(
    lines: Array,
    columns: NDArray[np.void],
    path: str | os.PathLike[str],
    *,
    title: str = "",
    dark: bool = False,
    about: str = "",
    ways: Mapping[str, Array] | None = None,
    spots: Mapping[str, Array] | None = None,
) -> None:
    """Draw walls (n, 2, 2) and round columns, by `center` and `radius`, of a plan [m] as a picture.

    `about` is a line above it; `ways` are steps of a way (n, 2, 2) by the names in `_WAYS`, and
    `spots` its ends (2,), by what they are called.
    """
    from matplotlib.collections import LineCollection
    from matplotlib.patches import Circle

    canvas.check_ending(path)
    points = np.concatenate((lines.reshape(-1, 2), columns["center"]))
    wide = canvas.PAGE_WIDTH
    figure = canvas.new_figure(wide, canvas.plane_height(points, wide), dark=dark)
    axes = figure.subplots()
    counts = f"{count(len(lines), 'wall')}, {count(len(columns), 'column')}"
    canvas.style_plane(axes, title, about or counts, points)
    theme = canvas.theme_of(axes)
    axes.add_collection(LineCollection(list(lines), colors=theme.ink, linewidths=0.8))
    for name, steps in (ways or {}).items():
        if len(steps):
            color, width, dashes = _WAYS[name]
            drawn = {"colors": getattr(theme, color), "linewidths": width, "linestyles": dashes}
            axes.add_collection(LineCollection(list(steps), label=name, zorder=3, **drawn))
    for mark, (name, spot) in zip("os", (spots or {}).items(), strict=False):
        axes.plot(*spot, mark, color=theme.way, ms=7, mec=theme.paper, label=name, zorder=4)
    if axes.get_legend_handles_labels()[0]:
        canvas.add_legend(figure)
    for column in columns:
        axes.add_patch(Circle(column["center"], column["radius"], fill=False, color=theme.arc))
    canvas.save(figure, path)


def scan_figure(
    scan: LaserScan,
    features_by_method: Mapping[str, Features],
    errors_by_method: Mapping[str, Array] | None = None,
    *,
    title: str = "",
    dark: bool = False,
    panel: float | None = None,
    farthest: float = math.inf,
) -> Figure:
    """Draw what some methods found in one scan, one panel a method, side by side.

    Points have the colour of their cluster, noise is a grey cross, and nothing came back from
    shaded sectors. The number beside a corner is its quality. Edges are drawn lighter than corners,
    without a number. A few beams that lie far out are left out, and counted at the axis. The
    similarity errors of the beams (n,) [m], if given, are drawn below the panel of the method.
    Panels are so wide [inch]; narrow ones have no numbers, and points beyond `farthest` [m] are not
    shown.

    Raises a ValueError if there is no method, or features do not have the scan's number of beams.
    """
    if not features_by_method:
        raise ValueError("features_by_method is empty, expected at least one method")
    for method, features in features_by_method.items():
        check_beams(scan, features.clusters, method)
    points, outside = drawing.points_to_show(scan, features_by_method.values(), farthest)
    kinds = ("segments", "corners", "clusters") if panel else ()
    shots = [
        Shot(name, about(found, kinds), scan, found, points, outside)
        for name, found in features_by_method.items()
    ]
    errors = None if errors_by_method is None else [errors_by_method[shot.title] for shot in shots]
    return _shots_figure(shots, errors, title, dark, panel)


def scans_figure(
    scans: Iterable[tuple[str, LaserScan, Features]], *, title: str = "", dark: bool = False
) -> Figure:
    """Draw several scans, one panel each with its title, as `scan_figure` does."""
    shots = [
        Shot(name, about(found), scan, found, *drawing.points_to_show(scan, [found]))
        for name, scan, found in scans
    ]
    return _shots_figure(shots, None, title, dark, None)


class Shot(NamedTuple):
    """A panel: title, subtitle, what is drawn in it, points it shows, how many it does not."""

    title: str
    about: str
    scan: LaserScan
    features: Features
    points: Array
    outside: int


def _shots_figure(
    shots: list[Shot], errors: list[Array] | None, title: str, dark: bool, panel: float | None
) -> Figure:
    number, is_wide = len(shots), panel is None
    panel = panel or (PANEL if number > 1 else _ALONE)
    columns = min(number, 3 if number <= 9 else 4)
    rows = math.ceil(number / columns)
    height = float(np.median([canvas.plane_height(shot.points, panel) for shot in shots])) + 1.1
    heights = [height] if errors is None else [height, _STRIP]
    figure = titled(panel * columns, sum(heights) * rows + 0.5, title, dark)
    grid = figure.subplots(
        len(heights) * rows, columns, squeeze=False, height_ratios=heights * rows
    )
    panels, strips = grid[:: len(heights)].ravel(), grid[1 :: len(heights)].ravel()
    for axes in [*panels[number:], *strips[number:]]:
        axes.remove()
    for k, shot in enumerate(shots):
        canvas.style_plane(panels[k], shot.title, shot.about, shot.points)
        note_outside(panels[k], shot.outside)
        drawing.draw_beams(panels[k], shot.scan, shot.features.clusters)
        drawing.draw_features(panels[k], shot.features, shot.scan, extent_of(panels[k]))
        if errors is not None:
            drawing.draw_errors(strips[k], shot.scan, errors[k])
    corners = [numbered(shot.features) for shot in shots]
    canvas.add_legend(figure, _NOTE if is_wide and any(map(len, corners)) else "")
    if is_wide:
        canvas.settle(figure)
        for axes, shot, shown in zip(panels, shots, corners, strict=False):
            points = shot.scan.points[shot.scan.valid]
            drawing.label_points(axes, shown["position"], shown["quality"], points)
    return figure


def titled(width: float, height: float, title: str, dark: bool) -> Figure:
    """Make a figure with a title above all panels, if it has one."""
    if not title:
        return canvas.new_figure(width, height, dark=dark)
    figure = canvas.new_figure(width, height + 0.4, dark=dark)
    color = canvas.theme_of(figure).ink
    size = canvas.fitting(title, 13, width)
    text = figure.suptitle(title, x=0.01, ha="left", fontsize=size, color=color)
    text.set_parse_math(False)
    return figure


def note_outside(axes: Axes, outside: int) -> None:
    """Write at the x axis of a panel how many beams lie outside of it."""
    if outside:
        note = f"{count(outside, 'beam')} farther out not shown"
        axes.set_xlabel(f"{axes.get_xlabel()} · {note}")


def numbered(features: Features) -> NDArray[np.void]:
    """Return the corners that have a number: not those of methods without quality."""
    kept: NDArray[np.void] = features.corners[np.isfinite(features.corners["quality"])]
    return kept


def corner_figure(
    scan: LaserScan, features: Features, corner: int, *, title: str = "", dark: bool = False
) -> Figure:
    """Draw the surroundings of a corner, by its index, so large that its ellipse can be seen."""
    x, y = features.corners["position"][corner].tolist()
    sigma = math.sqrt(max(float(np.trace(features.corners["covariance"][corner])), 0.0))
    reach = float(np.clip(36 * sigma, 0.05, 2.0)) if math.isfinite(sigma) else 0.5
    points = np.array([(x - reach, y - reach), (x + reach, y + reach)])
    name, error = f"Corner at ({x:.3f}, {y:.3f}) m", f"1 σ of its position: {1e3 * sigma:.1f} mm"
    return _shots_figure([Shot(name, error, scan, features, points, 0)], None, title, dark, None)


def map_figure(
    posed: Iterable[tuple[Pose, Features]], title: str = "Map", *, dark: bool = False
) -> Figure:
    """Draw segments, corners and arcs of many scans in the world, with the way of the sensor.

    Each scan has the pose of the sensor in the world [m, m, rad] and what was found there, in its
    own frame. Edges are drawn lighter than corners.
    """
    from matplotlib.collections import LineCollection

    way, found = _in_the_world(posed)
    shown = np.vstack([found.segments.reshape(-1, 2), found.corners, found.edges, way])
    figure = canvas.new_figure(9, canvas.plane_height(shown, 9) + 1.6, dark=dark)
    axes, theme = figure.subplots(), canvas.theme_of(figure)
    numbers = {"scans": len(way)} | {
        name: len(getattr(found, name)) for name in ("segments", "corners", "edges", "arcs")
    }
    canvas.style_plane(axes, title, _counts(numbers), shown)
    # Walls that were seen often come out dark, what was seen once stays faint; not so the legend.
    alpha = float(np.clip(60 / max(len(way), 1), 0.08, 0.9))
    for name, strips, color, width in (
        ("segments", list(found.segments), theme.ink, 0.9),
        ("arcs", found.arc_strips(), theme.arc, 0.7),
    ):
        if len(strips) or name == "segments":
            lines = LineCollection(strips, colors=color, linewidths=width, alpha=alpha)
            axes.add_collection(lines)
            axes.plot([], [], color=color, linewidth=1.2, label=name)
    for name, color in (("edges", theme.edge), ("corners", theme.corner)):
        points = getattr(found, name)
        axes.plot(*points.T, "o", color=color, ms=2.2, mew=0, alpha=max(alpha, 0.2), zorder=3)
        if len(points) or name == "corners":
            axes.plot([], [], "o", color=color, markersize=4, label=name)
    axes.plot(*way.T, color=theme.way, linewidth=1.3, label="path of the sensor", zorder=4)
    if len(way):
        axes.plot(*way[0], "o", color=theme.way, ms=6, mec=theme.paper, label="start", zorder=5)
    canvas.add_legend(figure)
    return figure


_NOTHING = tuple(np.zeros((0, *shape)) for shape in ((2, 2), (2,), (2,), (5,), (5,)))


def _in_the_world(posed: Iterable[tuple[Pose, Features]]) -> tuple[Array, Markers]:
    """Return the positions (m, 2) of the sensor, and what was found from all of them."""
    way, found = [], [_NOTHING]
    for pose, features in posed:
        way.append(pose[:2])
        with np.errstate(invalid="ignore"):  # what is not finite is not drawn
            found.append(astuple(markers_of(features.transform(*pose))))
    return np.reshape(way, (-1, 2)), Markers(*map(np.concatenate, zip(*found, strict=True)))


def check_beams(scan: LaserScan, clusters: NDArray[np.int32], method: str) -> None:
    """Raise a ValueError if clusters are not those of a scan."""
    if len(clusters) != len(scan):
        raise ValueError(f"{method}: clusters of {len(clusters)} beams, the scan has {len(scan)}")


def extent_of(axes: Axes) -> float:
    """Return the longer side of what a plan shows [m]."""
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    return max(x1 - x0, y1 - y0)


def n_clusters(clusters: NDArray[np.int32]) -> int:
    """Return the number of clusters, noise apart."""
    return len(np.unique(clusters[clusters >= 0]))


def about(features: Features, kinds: Iterable[str] = ()) -> str:
    """Write how many features there are of some kinds, or of all."""
    counts = features.counts() | {"clusters": n_clusters(features.clusters)}
    return _counts({kind: counts[kind] for kind in kinds or counts})


def _counts(counts: dict[str, int]) -> str:
    """Write how many things of each kind there are; edges only if there are some."""
    kept = {name: number for name, number in counts.items() if number or name != "edges"}
    return " · ".join(count(number, name[:-1]) for name, number in kept.items())
