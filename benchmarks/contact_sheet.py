"""Many recorded scans on one sheet, with what a method finds in each: to be looked at.

Run: python benchmarks/contact_sheet.py [-m METHOD] -o SHEET.png, with LINEAMENT_DATA.
"""

import argparse
import math
import os
from itertools import islice
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from lineament import Extractor, Features, LaserScan, open_log
from lineament.output import canvas, drawing

DATA = Path(os.environ.get("LINEAMENT_DATA", "../shared/data"))
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("-m", "--method", default="optimal")
    given = parser.parse_args()
    extract, scans = Extractor(given.method), []
    for file, number in SHEET:
        if (DATA / file).exists():
            scan = next(islice(open_log(DATA / file, keep_going=True), number, None))
            scans.append((f"{file.rpartition('/')[2]} · {number}", scan))
    rows = -(-len(scans) // _COLUMNS)
    figure = canvas.new_figure(_SIDE * _COLUMNS, _SIDE * rows)
    panels = figure.subplots(rows, _COLUMNS, squeeze=False).ravel()
    for axes in panels[len(scans) :]:
        axes.remove()
    for axes, (title, scan) in zip(panels, scans, strict=False):
        draw(axes, title, scan, extract(scan))
    given.output.write_bytes(canvas.figure_bytes(figure, dpi=100))


def draw(axes: Axes, title: str, scan: LaserScan, features: Features) -> None:
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
    frame(axes, points)


def frame(axes: Axes, points: np.ndarray) -> None:
    """Show most of the points and the scanner, in a square."""
    rest = 0.5 * (1.0 - _SHOWN)
    ends = np.quantile(points, (rest, 1.0 - rest), axis=0) if len(points) else np.zeros((2, 2))
    low, high = np.minimum(ends[0], 0.0), np.maximum(ends[1], 0.0)
    middle, half = 0.5 * (low + high), (0.5 + _MARGIN) * max(float((high - low).max()), 0.1)
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.set_aspect("equal")


if __name__ == "__main__":
    main()
