"""Figures: files of the right kind with the right panels, for kind and hostile input."""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from matplotlib.collections import EllipseCollection
from matplotlib.colors import to_rgb
from test_tables import random_features

import lineament as ln
from lineament import LineamentError
from lineament.features import ARC, BREAKPOINT, CORNER, SEGMENT, Features
from lineament.methods.trace import CANDIDATE, Trace
from lineament.output import canvas, drawing, figures

CORNER_RGB = np.array([0xD1, 0x24, 0x2F]) / 255


def room() -> tuple[ln.LaserScan, Features]:
    """Two walls that meet at (2, 2), a hole in the first, a noise point."""
    angles = np.radians(np.arange(5.0, 86.0))
    ranges = 2 / np.maximum(np.cos(angles), np.sin(angles))
    ranges[10:15] = np.nan
    ranges[60] = 1.0
    scan = ln.LaserScan(ranges, angles=angles)
    clusters = np.where(scan.valid, 0, -1).astype(np.int32)
    clusters[60] = -1
    segments, corners = np.zeros(2, SEGMENT), np.zeros(1, CORNER)
    segments["start"], segments["end"] = [scan.points[0], [2, 2]], [[2, 2], scan.points[-1]]
    corners["position"], corners["response"], corners["beam"] = [2, 2], 12.5, 40
    corners["covariance"] = np.diag([1e-2, 1e-3])
    arcs, breakpoints = np.zeros(1, ARC), np.zeros(2, BREAKPOINT)
    arcs["center"], arcs["radius"], arcs["last_beam"] = [1, 1], 0.3, 8
    breakpoints["position"] = scan.points[[0, -1]]
    return scan, Features(segments, corners, arcs, clusters, breakpoints)


def trace_of(scan: ln.LaserScan, features: Features) -> Trace:
    n = len(scan)
    used = np.flatnonzero(scan.valid)
    spacing = np.full(n, np.nan)
    spacing[used[1:]] = np.hypot(*np.diff(scan.points[used], axis=0).T)
    candidates = np.zeros(min(n, 3), CANDIDATE)
    candidates["beam"] = np.array([40, 20, 12])[: len(candidates)] % max(n, 1)
    candidates["response"], candidates["accepted"] = 12.5, [True, False, False][: len(candidates)]
    return Trace(
        scan=scan,
        method="liu",
        features=features,
        filtered=np.where(scan.valid, scan.ranges, np.nan),
        spacing=spacing,
        distance_threshold=np.full(n, 0.2),
        density_threshold=np.full(n, np.nan),
        clusters=features.clusters,
        candidates=candidates,
        threshold=10.0,
        cuts=np.zeros(0, np.int32),
    )


def hostile() -> dict[str, tuple[ln.LaserScan, Features]]:
    def nothing(n):
        return random_features(0, n_beams=n, counts=(0, 0, 0, 0))

    scan, features = room()
    for table in (features.segments, features.corners, features.arcs, features.breakpoints):
        for name in table.dtype.names:
            if table[name].dtype.kind == "f":
                table[name] = np.nan
    odd, found = room()
    found.corners["covariance"] = [[np.inf, 0], [0, -1]]
    found.arcs["first_beam"], found.arcs["last_beam"] = 12, 12  # an invalid beam
    cases = {
        "empty": (ln.LaserScan([], 0.0, 0.1), nothing(0)),
        "one": (ln.LaserScan([1.0], 0.0, 0.1), nothing(1)),
        "invalid": (ln.LaserScan([np.nan, np.inf, 0.0] * 9, 0.0, 0.1), nothing(27)),
        "nan": (scan, features),
        "odd": (odd, found),
    }
    for _, case in cases.values():
        case.clusters = np.minimum(case.clusters, 0)
    return cases


def pixels(path) -> np.ndarray:
    image = matplotlib.image.imread(path)[..., :3]
    assert image.std() > 0.01, "blank"
    return image


def count_panels(image: np.ndarray) -> int:
    """Count the panels side by side by the frames' left and right edges."""
    edge = np.abs(image - np.array([0xD0, 0xD7, 0xDE]) / 255).max(axis=2) < 0.05
    columns = np.flatnonzero(edge.sum(axis=0) > 0.4 * len(image))
    return int((np.diff(columns, prepend=-9) > 3).sum()) // 2


@pytest.mark.parametrize("n", [1, 3])
def test_scan_has_one_panel_a_method(tmp_path, n):
    scan, features = room()
    methods = {f"method {i}": features for i in range(n)}
    figures.plot_scan(scan, methods, tmp_path / "a.png")
    image = pixels(tmp_path / "a.png")
    assert count_panels(image) == n
    red = np.abs(image - CORNER_RGB).max(axis=2) < 0.05
    assert red.sum() > 20 * n  # corners
    blue = np.abs(image - np.array([0x44, 0x77, 0xAA]) / 255).max(axis=2) < 0.05
    assert blue.sum() > 100 * n  # points of the first cluster


def test_endings(tmp_path):
    _, features = room()
    for ending, start in ((".png", b"\x89PNG"), (".svg", b"<?xml"), (".PDF", b"%PDF")):
        path = tmp_path / f"a{ending}"
        figures.plot_map([((0.0, 0.0, 0.0), features)], path)
        first = path.read_bytes()
        assert first.startswith(start)
        figures.plot_map([((0.0, 0.0, 0.0), features)], path)
        assert path.read_bytes() == first
    assert len(list(tmp_path.iterdir())) == 3
    for name in ("a.gif", "a"):
        with pytest.raises(LineamentError, match=r"expected one of \.png, \.svg, \.pdf"):
            figures.plot_map([], tmp_path / name)
    with pytest.raises(LineamentError, match="does not exist"):
        figures.plot_map([], tmp_path / "no" / "a.png")


def test_svg_tells_what_is_drawn(tmp_path, monkeypatch):
    written = []
    monkeypatch.setattr(canvas, "save", lambda figure, _: written.append(figure))
    scan, features = room()
    figures.plot_scan(scan, {"a $x": features}, tmp_path / "a.png")
    (axes,) = written[0].axes
    assert axes.get_title(loc="left") == "a $x"
    texts = {text.get_text() for text in axes.texts}
    assert texts == {"2 segments · 1 corner · 1 arc · 2 breakpoints · 1 cluster", "12.5"}
    names = {text.get_text() for text in written[0].legends[0].get_texts()}
    expected = {"no return", "noise", "sensor", "arc", "segment", "breakpoint", "corner"}
    assert names == {*expected, "3 σ of a corner"}
    assert axes.get_aspect() == 1
    rim = next(c for c in axes.collections if c.get_label() == "no return")
    assert len(rim.get_segments()) == 5


def test_many_corners_have_no_labels(tmp_path, monkeypatch):
    written = []
    monkeypatch.setattr(canvas, "save", lambda figure, _: written.append(figure))
    scan, features = room()
    features.corners = np.repeat(features.corners, drawing.MAX_LABELS + 1)
    figures.plot_scan(scan, {"a": features}, tmp_path / "a.png")
    assert len(written[0].axes[0].texts) == 1


def test_labels_do_not_lie_on_each_other(tmp_path, monkeypatch):
    written = []
    monkeypatch.setattr(canvas, "save", lambda figure, _: written.append(figure))
    scan, features = room()
    features.corners = np.repeat(features.corners, 8)
    features.corners["position"] += np.linspace(0, 0.1, 8)[:, None]
    figures.plot_scan(scan, {"a": features}, tmp_path / "a.png")
    (axes,) = written[0].axes
    boxes = [t.get_window_extent() for t in axes.texts if t.get_text() == "12.5"]
    assert len(boxes) == 8
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])


@pytest.mark.parametrize("case", list(hostile()))
def test_hostile_scans_are_drawn(tmp_path, case, monkeypatch):
    monkeypatch.setattr(canvas, "DPI", 50)  # quicker
    scan, features = hostile()[case]
    figures.plot_scan(scan, {"liu": features}, tmp_path / "a.png")
    pixels(tmp_path / "a.png")
    if case != "one":
        figures.plot_trace(trace_of(scan, features), tmp_path / "a.png")
        pixels(tmp_path / "a.png")
    if case in ("nan", "odd"):
        figures.plot_map([((0.0, 0.0, 0.0), features)], tmp_path / "a.png")
        pixels(tmp_path / "a.png")


def test_trace_has_four_panels(tmp_path):
    figures.plot_trace(trace_of(*room()), tmp_path / "a.png")
    image = pixels(tmp_path / "a.png")
    middle = len(image) // 2
    assert count_panels(image[:middle]) == 2
    assert count_panels(image[middle:]) == 2


def test_trace_without_candidates_shows_corners_and_edges(tmp_path, monkeypatch):
    written = []
    monkeypatch.setattr(canvas, "save", lambda figure, _: written.append(figure))
    scan, features = room()
    features.corners = np.repeat(features.corners, 2)
    features.corners["kind"][1] = "edge"
    trace = replace(trace_of(scan, features), candidates=np.zeros(0, CANDIDATE))
    figures.plot_trace(trace, tmp_path / "a.png")
    panel = written[0].axes[3]
    assert {"corner", "edge"} <= {line.get_label() for line in panel.get_lines()}
    assert any("1 corner · 1 edge" in text.get_text() for text in panel.texts)


def test_map_moves_features_by_their_poses(tmp_path, monkeypatch):
    written = []
    monkeypatch.setattr(canvas, "save", lambda figure, _: written.append(figure))
    _, features = room()
    poses = [(0.0, 0.0, 0.0), (10.0, 0.0, math.pi / 2)]
    figures.plot_map(((pose, features) for pose in poses), tmp_path / "a.png", "Here")
    (axes,) = written[0].axes
    lines = axes.collections[0].get_segments()
    assert len(lines) == 4
    np.testing.assert_allclose(lines[2][1], [8, 2], atol=1e-12)
    arcs = 2 * len(features.arcs)
    said = f"2 scans · 4 segments · 2 corners · {canvas.count(arcs, 'arc')}"
    assert said in {text.get_text() for text in axes.texts}
    circles = [part for part in axes.collections if isinstance(part, EllipseCollection)]
    assert [len(circle.get_offsets()) for circle in circles] == [arcs]
    monkeypatch.undo()
    figures.plot_map([], tmp_path / "empty.png")
    pixels(tmp_path / "empty.png")


def test_edges_are_lighter_than_corners_and_have_no_number(tmp_path, monkeypatch):
    written = []
    monkeypatch.setattr(canvas, "save", lambda figure, _: written.append(figure))
    scan, features = room()
    features.corners = np.repeat(features.corners, 2)
    features.corners["kind"] = ["corner", "edge"]
    features.corners["position"][1], features.corners["response"][1] = scan.points[0], 0.0
    figures.plot_map([((0.0, 0.0, 0.0), features)], tmp_path / "a.png")
    for figure, plural in ((figures.scan_figure(scan, {"a": features}), ""), (written[0], "s")):
        (axes,) = figure.axes
        drawn = {line.get_label(): line for line in axes.get_lines()}
        corner, edge = drawn[f"corner{plural}"], drawn[f"edge{plural}"]
        # The same hue, nearer to the white of the paper.
        colors = [to_rgb(line.get_markeredgecolor()) for line in (corner, edge)]
        assert colors[0] == pytest.approx(CORNER_RGB)
        assert sum(colors[1]) > sum(colors[0]) + 0.5
        texts = {text.get_text() for text in axes.texts}
        assert any("1 corner · 1 " in text and "1 edge" in text for text in texts)
        assert "0" not in texts
        assert f"edge{plural}" in {text.get_text() for text in figure.legends[0].get_texts()}


def test_wrong_arguments(tmp_path):
    scan, features = room()
    with pytest.raises(ValueError, match="at least one method"):
        figures.plot_scan(scan, {}, tmp_path / "a.png")
    features.clusters = features.clusters[1:]
    with pytest.raises(ValueError, match="clusters of 80 beams, the scan has 81"):
        figures.plot_scan(scan, {"liu": features}, tmp_path / "a.png")


def test_no_global_state_of_matplotlib(tmp_path):
    code = f"""
import sys
from test_figures import room
from lineament.output.figures import plot_scan
scan, features = room()
plot_scan(scan, {{"liu": features}}, {str(tmp_path / "a.png")!r})
sys.exit("matplotlib.pyplot" in sys.modules)
"""
    subprocess.run([sys.executable, "-c", code], check=True, cwd=Path(__file__).parent)
