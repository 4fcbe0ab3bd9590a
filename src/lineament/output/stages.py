"""The picture of the stages of one run of a method: those that it has, and what came out."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from ..methods.trace import Trace
from ..scan import Array
from . import canvas, drawing
from .canvas import count, theme_of
from .figures import about, check_beams, extent_of, n_clusters, note_outside, numbered, titled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Height of the panels of the stages by beam, and width of the plans below them [inch].
_ABOVE, _PLAN = 3.4, 6.5
#: Marks of what is decided by evidence.
_DECIDED = {"segments": "_", "corners": "D", "arcs": "o"}


def plot_trace(
    trace: Trace, path: str | os.PathLike[str], *, title: str = "", dark: bool = False
) -> None:
    """Draw the stages of one run that its method has, and what came out.

    They are the ranges, filtered or not; the spacing of the beams against its thresholds; what
    decides on corners and segments; the clusters; and the features, with the candidates for
    corners where the method examines such.
    """
    canvas.check_ending(path)
    canvas.save(trace_figure(trace, title=title, dark=dark), path)


def trace_figure(trace: Trace, *, title: str = "", dark: bool = False) -> Figure:
    """Draw the picture that `plot_trace` writes."""
    scan, features = trace.scan, trace.features
    check_beams(scan, trace.clusters, trace.method)
    shown, outside = drawing.points_to_show(scan, [features])
    height = canvas.plane_height(shown, _PLAN) + 1.1
    strips = [_draw_ranges, _draw_spacing]
    if np.isfinite(trace.candidates["response"]).any() or any(map(len, trace.evidence.values())):
        strips.append(_draw_decisions)
    figure = titled(2 * _PLAN, _ABOVE + height, title, dark)
    grid = figure.add_gridspec(2, 6, height_ratios=[_ABOVE, height])
    width = 6 // len(strips)
    for k, draw in enumerate(strips):
        draw(figure.add_subplot(grid[0, k * width : (k + 1) * width]), trace)
    plans = [figure.add_subplot(grid[1, :3]), figure.add_subplot(grid[1, 3:])]
    _draw_clusters(plans[0], trace, shown)
    _draw_found(plans[1], trace, shown)
    for axes in plans:
        note_outside(axes, outside)
    for axes in figure.axes:
        canvas.add_own_legend(axes, _PLAN if axes in plans else 2 * _PLAN / len(strips))
    canvas.settle(figure)
    corners = numbered(features)
    points = scan.points[scan.valid]
    drawing.label_points(plans[1], corners["position"], corners["quality"], points)
    return figure


def _draw_ranges(axes: Axes, trace: Trace) -> None:
    """Draw ranges by bearing, filtered ones where they differ, and beams without a return."""
    scan, theme, degrees = trace.scan, theme_of(axes), np.degrees(trace.scan.angles)
    subtitle = f"{count(int(scan.valid.sum()), 'valid beam')} of {len(scan)}"
    raw = np.where(scan.valid, scan.ranges, np.nan)
    is_filtered = bool((np.abs(trace.filtered - raw) > 1e-9).any())  # NaN is not
    name = "Filter" if is_filtered else "Ranges"
    canvas.style(axes, name, subtitle, "bearing [°]", "range [m]")
    color = theme.faint if is_filtered else theme.ink
    axes.plot(degrees, raw, ".", color=color, markersize=3.5, label="measured")
    if is_filtered:
        axes.plot(degrees, trace.filtered, color=theme.way, linewidth=1.0, label="filtered")
    bad = degrees[~scan.valid]
    if len(bad):
        low = np.full(len(bad), 0.015)  # of the height of the panel
        place = axes.get_xaxis_transform()
        axes.plot(bad, low, "|", c=theme.corner, ms=7, transform=place, label="no return")
    axes.set_ylim(bottom=0)
    axes.margins(x=0.01)


def _draw_spacing(axes: Axes, trace: Trace) -> None:
    """Draw the spacing of the beams, what it was compared with, and where clusters end."""
    beams, theme = np.arange(len(trace.scan)), theme_of(axes)
    labels, used = trace.clusters, np.flatnonzero(trace.scan.valid)
    breaks = used[1:][labels[used[1:]] != labels[used[:-1]]]
    canvas.style(
        axes, "Spacing", count(len(breaks), "break"), "beam", "distance to the beam before [m]"
    )
    for i, beam in enumerate(breaks):
        label = "" if i else "break"
        axes.axvline(beam, color=theme.edge, linewidth=0.8, zorder=1, label=label)
    drawn = False
    for values, label, line in (
        (trace.spacing, "spacing", {"marker": ".", "ms": 2.5, "lw": 0.5, "c": theme.ink}),
        (trace.distance_threshold, "distance threshold", {"lw": 1.2, "c": theme.way}),
        (trace.density_threshold, "density threshold", {"marker": ".", "ls": "", "c": theme.arc}),
    ):
        shown = np.where(values > 0, values, np.nan)  # a log axis has no place for 0
        if np.isfinite(shown).any():
            drawn = True
            axes.plot(beams, shown, label=label, **line)
    if drawn:
        axes.set_yscale("log")
    axes.margins(x=0.01)


def _draw_decisions(axes: Axes, trace: Trace) -> None:
    """Draw by beam what features rest on: responses of candidates, or evidence, and its limit."""
    theme, features, n = theme_of(axes), trace.features, len(trace.scan)
    marks = []
    for name, values in trace.evidence.items():
        table = getattr(features, name)
        if name == "corners":
            beams, color = table["beam"], theme.corner
        else:
            first, last = table["first_beam"], table["last_beam"]
            beams, color = (first + (last - first) % n / 2) % n, theme.ink
            color = theme.arc if name == "arcs" else color
        marks.append((beams, values, name[:-1], _DECIDED[name], color, "none"))
    candidates = trace.candidates
    for label, chosen, face in (
        ("accepted candidate", candidates["accepted"], theme.corner),
        ("rejected candidate", ~candidates["accepted"], "none"),
    ):
        found = candidates[chosen]
        marks.append((found["beam"], found["response"], label, "o", theme.corner, face))
    for beams, values, label, marker, color, face in marks:
        shown = np.isfinite(values) & (values > 0)
        if shown.any():
            points = beams[shown], values[shown]
            axes.plot(*points, marker, ms=5, mec=color, mfc=face, label=label)
    if trace.evidence:
        canvas.style(axes, "Evidence", "rise of χ² without the feature", "beam", "rise of χ²")
    else:
        accepted = int(candidates["accepted"].sum())
        subtitle = f"{count(len(candidates), 'candidate')} · {accepted} accepted"
        canvas.style(axes, "Candidates for corners", subtitle, "beam", "response")
    if trace.threshold > 0:
        label = f"threshold {trace.threshold:.4g}"
        axes.axhline(trace.threshold, color=theme.way, linewidth=1.2, label=label)
    if axes.lines:
        axes.set_yscale("log")
    axes.set_xlim(-0.01 * n - 1, 1.01 * n)


def _draw_clusters(axes: Axes, trace: Trace, shown: Array) -> None:
    """Draw the beams by cluster."""
    scan, clusters = trace.scan, trace.clusters
    noise = int((scan.valid & (clusters < 0)).sum())
    subtitle = f"{count(n_clusters(clusters), 'cluster')} · {count(noise, 'noise point')}"
    canvas.style_plane(axes, "Clusters", subtitle, shown)
    drawing.draw_beams(axes, scan, clusters)


def _draw_found(axes: Axes, trace: Trace, shown: Array) -> None:
    """Draw features, and the candidates where the detection saw them, over faint points."""
    scan, theme, candidates = trace.scan, theme_of(axes), trace.candidates
    canvas.style_plane(axes, "Features", about(trace.features), shown)
    points = scan.points[scan.valid]
    axes.plot(*points.T, ".", markersize=4, color=theme.faint, mew=0, alpha=0.6, zorder=2)
    drawing.draw_sensor(axes)
    drawing.draw_features(axes, trace.features, scan, extent_of(axes))
    beams = candidates["beam"]
    directions = np.column_stack((np.cos(scan.angles[beams]), np.sin(scan.angles[beams])))
    positions = trace.filtered[beams, None] * directions
    for chosen, face, label in (
        (candidates["accepted"], theme.corner, "accepted candidate"),
        (~candidates["accepted"], theme.paper, "rejected candidate"),
    ):
        if chosen.any():
            x, y = positions[chosen].T
            axes.plot(x, y, "o", ms=3.5, mfc=face, mec=theme.corner, label=label, zorder=4.8)
