"""Many recorded scans on one sheet, with what a method finds in each: to be looked at."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..logs import open_log
from ..output import canvas, drawing
from ..scan import LaserScan
from .contenders import Extract
from .findings import Figure, Setting

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["SHEET", "contact_sheet", "sheet_scans"]

#: Scans that are drawn, by the number that `lineament plot --scan` takes: first those at which
#: faults were seen, then one of each further recording.
SHEET = (
    ("rosbag1/jackal_mocap.bag", 231),
    ("carmen/acapulco-corrected.log.gz", 22),
    ("carmen/acapulco-corrected.log.gz", 200),
    ("text/rplidar_kitchenette/scans_2025-09-04-16-43-09.json", 0),
    ("text/rplidar_kitchenette/scans_2025-09-04-16-51-11.json", 2),
    ("text/dpslam_loop5.log.gz", 200),
    ("carmen/intel-corrected.log.gz", 257),
    ("carmen/intel-corrected.log.gz", 300),
    ("carmen/csail-corrected.log.gz", 100),
    ("carmen/aces-corrected.log.gz", 100),
    ("graph/killian.g2o.zip", 1900),
    ("truth/fr079_graph.npz", 700),
    ("truth/jackal_static_data.npz", 175),
    ("rosbag1/corridor_alternating_beams.bag", 2400),
    ("rosbag1/demo_stationary_simple_environment.bag", 600),
    ("rosbag1/scans_demo.bag", 330),
    ("rosbag1/urg_handheld_v2_old.bag", 180),
    ("rosbag1/urg_v1_2.bag", 60),
    ("rosbag2/ld19", 200),
    ("rosbag2/two_publishers", 250),
    ("text/tinyslam_exp1.dat.gz", 380),
    ("text/lidar01.csv", 0),
)
#: Panels side by side, and the side of each [inch].
_COLUMNS, _SIDE = 4, 4.6
#: A panel shows this share of the measurements along each axis, and a margin of so much about them.
_SHOWN, _MARGIN = 0.95, 0.06
#: Marker, size and colour of each kind of corner.
_MARKERS = {
    "corner": ("D", 4.5, canvas.CORNER_COLOR),
    "slit": ("s", 5.0, "#ee9933"),
    "edge": ("^", 5.0, "#228833"),
}
_LINE_COLOR, _POINT_COLOR = "#0a5fb4", "#8b949e"


def sheet_scans(setting: Setting) -> list[tuple[str, LaserScan]]:
    """Read the scans of the sheet whose recordings are there, each with its title."""
    scans = []
    for file, number in SHEET:
        path = setting.recording(file)
        if path is not None:
            log = open_log(path, keep_going=True)
            found = next(islice(log, number, None), None)
            if found is not None:
                scans.append((f"{file.rpartition('/')[2]} · {number}", found))
    return scans


def contact_sheet(scans: Sequence[tuple[str, LaserScan]], extract: Extract) -> Figure:
    """Draw what is found in each of some scans, one panel each, over the measurements.

    Parameters
    ----------
    scans : sequence of (str, LaserScan)
        At least one, each with its title.
    extract : callable
        Features of a scan.
    """
    columns = min(_COLUMNS, len(scans))
    rows = -(-len(scans) // columns)
    figure = canvas.new_figure(_SIDE * columns, _SIDE * rows)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in panels[len(scans) :]:
        axes.remove()
    for axes, (title, scan) in zip(panels, scans, strict=False):
        _draw(axes, title, scan, extract(scan))
    return Figure(
        "contact-sheet",
        "Recorded scans: measurements (grey), segments (blue, with a mark across each end), arcs "
        "(violet), corners (red), corners across a slit (orange squares), edges at jumps (green "
        "triangles). Title: recording and number of the scan. A panel shows "
        f"{100 * _SHOWN:.0f} % of the measurements along each axis.",
        canvas.figure_bytes(figure, dpi=100),
    )


def _draw(axes: Axes, title: str, scan: LaserScan, features: Features) -> None:
    canvas.style(axes, "")
    axes.set_title(title, fontsize=9, color=canvas.INK).set_parse_math(False)
    points = scan.points[scan.valid]
    axes.plot(*points.T, ".", markersize=2.5, color=_POINT_COLOR, zorder=2)
    drawing.draw_arcs(axes, features.arcs, scan)
    for segment in features.segments:
        ends = np.array([segment["start"], segment["end"]])
        axes.plot(*ends.T, "-", color=_LINE_COLOR, linewidth=1.3, zorder=4)
        across = math.degrees(segment["angle"])
        axes.plot(*ends.T, marker=(2, 0, across), ls="", color=_LINE_COLOR, ms=6, zorder=4)
    for kind, (marker, size, color) in _MARKERS.items():
        positions = features.corners["position"][features.corners["kind"] == kind]
        axes.plot(*positions.T, marker, markersize=size, mfc="none", mec=color, mew=1.2, zorder=5)
    axes.plot(0, 0, "+", color=canvas.INK, markersize=7, zorder=3)
    _frame(axes, points)


def _frame(axes: Axes, points: NDArray[np.float64]) -> None:
    """Show most of the points and the scanner, in a square."""
    rest = 0.5 * (1.0 - _SHOWN)
    ends = np.quantile(points, (rest, 1.0 - rest), axis=0) if len(points) else np.zeros((2, 2))
    low, high = np.minimum(ends[0], 0.0), np.maximum(ends[1], 0.0)
    middle, half = 0.5 * (low + high), (0.5 + _MARGIN) * max(float((high - low).max()), 0.1)
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.set_aspect("equal")
