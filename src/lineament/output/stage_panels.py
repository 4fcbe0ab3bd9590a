"""The stages of one run, a panel each."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from . import canvas, drawing
from .canvas import CORNER_COLOR, FAINT, INK, count

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..methods.trace import Trace


def draw_filter(axes: Axes, trace: Trace) -> None:
    """Draw raw and filtered ranges by bearing, and the beams without a return."""
    scan, degrees = trace.scan, np.degrees(trace.scan.angles)
    raw = np.where(scan.valid, scan.ranges, np.nan)
    canvas.style(axes, "a  Filter", f"{count(int(scan.valid.sum()), 'valid beam')} of {len(scan)}")
    axes.plot(degrees, raw, ".", color=FAINT, markersize=3.5, label="raw")
    axes.plot(degrees, trace.filtered, color="#0969da", linewidth=1.0, label="filtered")
    bad = degrees[~scan.valid]
    if len(bad):
        axes.plot(
            bad,
            np.full(len(bad), 0.015),
            "|",
            color=CORNER_COLOR,
            markersize=7,
            transform=axes.get_xaxis_transform(),
            label="no return",
        )
    axes.set_xlabel("bearing [°]", fontsize=9, color="#57606a")
    axes.set_ylabel("range [m]", fontsize=9, color="#57606a")
    axes.set_ylim(bottom=0)
    axes.margins(x=0.01)


def draw_spacing(axes: Axes, trace: Trace) -> None:
    """Draw the spacing of the beams, what it was compared with, and where clusters end."""
    beams = np.arange(len(trace.scan))
    labels, used = trace.clusters, np.flatnonzero(trace.scan.valid)
    breaks = used[1:][labels[used[1:]] != labels[used[:-1]]]
    canvas.style(axes, "b  Spacing", count(len(breaks), "break"))
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
    axes.plot(beams, far, color="#0969da", linewidth=1.2, label="distance threshold")
    axes.plot(beams, dense, ".", color="#bc4c00", markersize=4, label="density threshold")
    axes.set_xlabel("beam", fontsize=9, color="#57606a")
    axes.set_ylabel("distance to the beam before [m]", fontsize=9, color="#57606a")
    axes.margins(x=0.01)


def draw_candidates(axes: Axes, trace: Trace) -> NDArray[np.float64]:
    """Draw segments and candidates over faint points; gives the positions of the candidates."""
    scan, candidates = trace.scan, trace.candidates
    axes.plot(*scan.points[scan.valid].T, ".", markersize=4, color="#c4cad0", mew=0, zorder=2)
    drawing.draw_segments(axes, trace.features.segments)
    drawing.draw_sensor(axes)
    # Where the detection saw them: on the filtered ranges.
    directions = np.column_stack((np.cos(scan.angles), np.sin(scan.angles)))
    seen = trace.filtered[:, None] * directions
    positions: NDArray[np.float64] = seen[candidates["beam"]]
    accepted = candidates["accepted"]
    for chosen, face, label in (
        (accepted, CORNER_COLOR, "accepted"),
        (~accepted, "white", "rejected"),
    ):
        axes.plot(
            *positions[chosen].T,
            "o",
            markersize=5.5,
            markerfacecolor=face,
            markeredgecolor=CORNER_COLOR,
            label=label if chosen.any() else "",
            zorder=5,
        )
    return positions
