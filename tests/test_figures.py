"""Figures: what is drawn, where, for kind and hostile input."""

import math
import sys
from dataclasses import replace

import matplotlib.image
import numpy as np
import pytest
from handmade import features as features_of
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex, to_rgb
from matplotlib.patches import Ellipse

import lineament as ln
from lineament import LineamentError
from lineament.features import ARC, BREAKPOINT, CORNER, SEGMENT, Features
from lineament.methods.trace import CANDIDATE, Trace
from lineament.output import canvas, drawing, figures


@pytest.fixture
def drawn(tmp_path, monkeypatch):
    """Call a function that writes a picture, and return the figure in place of the file."""
    saved = []

    def draw(plot, *arguments, **named):
        plot(*arguments, tmp_path / "a.png", **named)
        return saved.pop()

    monkeypatch.setattr(canvas, "save", lambda figure, _: saved.append(figure))
    return draw


def room() -> tuple[ln.LaserScan, Features]:
    """Two walls that meet at (2, 2), a hole in the first, a noise point, an arc, an edge."""
    angles = np.radians(np.arange(5.0, 86.0))
    ranges = 2 / np.maximum(np.cos(angles), np.sin(angles))
    ranges[10:15] = np.nan
    ranges[60] = 1.0
    scan = ln.LaserScan(ranges, angles=angles)
    clusters = np.where(scan.valid, np.arange(81) // 41, -1).astype(np.int32)
    clusters[60] = -1
    segments, corners = np.zeros(2, SEGMENT), np.zeros(2, CORNER)
    segments["start"], segments["end"] = [scan.points[0], [2, 2]], [[2, 2], scan.points[-1]]
    corners["position"], corners["kind"] = [[2, 2], scan.points[0]], ["corner", "edge"]
    corners["response"], corners["beam"] = [12.5, 0], [40, 0]
    corners["covariance"] = np.diag([1e-2, 4e-2])
    arcs, breakpoints = np.zeros(1, ARC), np.zeros(2, BREAKPOINT)
    arcs["center"], arcs["radius"], arcs["last_beam"] = [1, 1], 0.3, 8
    breakpoints["position"] = scan.points[[0, -1]]
    return scan, Features(segments, corners, arcs, clusters, breakpoints)


def trace_of(scan: ln.LaserScan, features: Features, **stages) -> Trace:
    """Stages of a run of liu, which is said to have found these features."""
    trace = ln.Extractor("liu").trace(scan)
    return replace(trace, features=features, clusters=features.clusters, **stages)


def hostile() -> dict[str, tuple[ln.LaserScan, Features]]:
    def nothing(n):
        return features_of(n, clusters=[-1] * n)

    scan, features = room()
    for table in (features.segments, features.corners, features.arcs, features.breakpoints):
        for name in table.dtype.names:
            if table[name].dtype.kind == "f":
                table[name] = np.nan
    odd, found = room()
    found.corners["covariance"] = [[np.inf, 0], [0, -1]]
    found.arcs["first_beam"], found.arcs["last_beam"] = 12, 12  # an invalid beam
    return {
        "empty": (ln.LaserScan([], 0.0, 0.1), nothing(0)),
        "one": (ln.LaserScan([1.0], 0.0, 0.1), nothing(1)),
        "invalid": (ln.LaserScan([np.nan, np.inf, 0.0] * 9, 0.0, 0.1), nothing(27)),
        "nan": (scan, features),
        "odd": (odd, found),
    }


def by_label(axes) -> dict:
    artists = [*axes.lines, *axes.collections, *axes.patches]
    return {artist.get_label(): artist for artist in artists}


def texts_of(axes) -> set[str]:
    return {text.get_text() for text in axes.texts}


@pytest.mark.parametrize(
    ("ending", "start"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".PDF", b"%PDF")]
)
def test_endings(tmp_path, ending, start):
    path, files = tmp_path / f"a{ending}", []
    for _ in range(2):
        figures.plot_map([((0.0, 0.0, 0.0), room()[1])], path)
        files.append(path.read_bytes())
    assert files[0].startswith(start)
    assert files[0] == files[1]
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(("n", "columns"), [(1, 1), (4, 3), (10, 4)])
def test_one_panel_a_method_with_its_errors_below(n, columns):
    scan, features = room()
    names = [f"method $x {i}" for i in range(n)]
    errors = {name: np.full(81, 0.001 * (i + 1)) for i, name in enumerate(names)}
    figure = figures.scan_figure(scan, dict.fromkeys(names, features), errors)
    panels = [axes for axes in figure.axes if axes.get_title(loc="left")]
    strips = [axes for axes in figure.axes if axes not in panels]
    assert [axes.get_title(loc="left") for axes in panels] == names
    assert len(strips) == n
    places = np.array([axes.get_position().bounds[:2] for axes in panels])
    assert len(np.unique(places[:, 0].round(2))) == columns
    for k, (panel, strip) in enumerate(zip(panels, strips, strict=True)):
        (left, bottom, *_), below = panel.get_position().bounds, strip.get_position()
        assert below.x0 <= left <= below.x1
        assert 0 < bottom - below.y1 < 0.5 * panel.get_position().height
        assert f"mean {k + 1}.0 mm" in texts_of(strip).pop()
    without = figures.scan_figure(scan, dict.fromkeys(names, features))
    assert len(without.axes) == n
    assert without.get_figheight() < figure.get_figheight() - 1.5


def test_scan_and_its_features(drawn):
    scan, features = room()
    figure = drawn(figures.plot_scan, scan, {"a": features})
    (axes,) = figure.axes
    counts = "2 segments · 1 corner · 1 edge · 1 arc · 2 breakpoints · 2 clusters"
    assert texts_of(axes) == {counts, "12.5"}  # the edge has no number
    labels = {"no return", "noise", "sensor", "arc", "segment", "breakpoint", "corner", "edge"}
    labels.add("3 σ of a corner, at most 0.5 m")
    assert {t.get_text() for t in figure.legends[0].get_texts()} == labels
    assert axes.get_aspect() == 1
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [m]", "y [m]")
    shown = by_label(axes)
    assert shown["sensor"].get_marker() == (3, 0, -90)  # a triangle that looks along x
    for label, expected in (
        ("noise", scan.points[60:61]),
        ("sensor", [[0, 0]]),
        ("corner", [[2, 2]]),
        ("edge", scan.points[:1]),
        ("breakpoint", scan.points[[0, -1]]),
    ):
        np.testing.assert_allclose(shown[label].get_xydata(), expected, err_msg=label)
    (points,) = [c for c in axes.collections if len(c.get_offsets()) > 1]
    known = features.clusters >= 0
    np.testing.assert_allclose(points.get_offsets(), scan.points[known])
    colors = [to_hex(color) for color in points.get_facecolors()]
    assert colors == canvas.PALETTE[features.clusters[known]].tolist()
    walls = [line.get_xydata() for line in axes.lines if line.get_marker() == (2, 0, 90.0)]
    np.testing.assert_allclose(walls, [[features.segments["start"][0], [2, 2]]])
    # Three deviations, the longer along y, cut.
    (ellipse,) = [patch for patch in axes.patches if isinstance(patch, Ellipse)]
    size = (ellipse.width, ellipse.height, ellipse.angle % 180)
    assert size == pytest.approx((1.0, 0.6, 90))
    seen = shown["arc"].get_xydata() - (1, 1)
    np.testing.assert_allclose(np.hypot(*seen.T), 0.3)
    # The same hue as a corner, nearer to the white of the paper.
    colors = [to_rgb(shown[label].get_markeredgecolor()) for label in ("corner", "edge")]
    assert to_hex(colors[0]) == canvas.CORNER_COLOR
    assert sum(colors[1]) > sum(colors[0]) + 0.5


def test_beams_without_return_are_ticks_outside_what_was_seen(drawn):
    ranges = np.full(90, 2.0)
    ranges[40:48] = 8.0
    ranges[[10, 36, 50, 80]] = np.nan  # Two of them are at most 8 degrees from what is far.
    scan = ln.LaserScan(ranges, angle_min=0.0, angle_increment=math.radians(1))
    axes = drawn(figures.plot_scan, scan, {"a": features_of(90)}).axes[0]
    ticks = np.array(by_label(axes)["no return"].get_segments())
    expected = [[2.4, 2.64], [8.4, 8.64], [8.4, 8.64], [2.4, 2.64]]
    np.testing.assert_allclose(np.linalg.norm(ticks, axis=2), expected)
    angles = np.arctan2(ticks[..., 1], ticks[..., 0])
    np.testing.assert_allclose(np.degrees(angles), [[10, 10], [36, 36], [50, 50], [80, 80]])
    counts = "0 segments · 0 corners · 0 arcs · 0 breakpoints · 1 cluster"  # not: 0 edges
    assert texts_of(axes) == {counts}
    (low, high) = np.transpose([axes.get_xlim(), axes.get_ylim()])
    for points in (ticks[:, 1], scan.points[scan.valid], [(0, 0)]):
        assert (points > low).all()
        assert (points < high).all()


@pytest.mark.parametrize(
    ("size", "widths"), [(0.004, []), (0.3, [0.6]), (50.0, [2 * drawing.LARGEST_ELLIPSE])]
)
def test_ellipses_are_drawn_where_they_can_be_seen_and_are_cut(size, widths):
    scan, features = room()
    features.corners["covariance"] = np.diag([(size / 3) ** 2, 1e-8])
    (axes,) = figures.scan_figure(scan, {"a": features}).axes
    assert [patch.width for patch in axes.patches] == pytest.approx(widths)


def test_narrow_panels_say_less_and_leave_out_what_is_far():
    scan, features = room()
    ranges = scan.ranges.copy()
    ranges[60] = 25.0
    scan = ln.LaserScan(ranges, angles=scan.angles, range_max=30.0)
    wide, narrow = (
        figures.scan_figure(scan, {"a": features}, **given).axes[0]
        for given in ({}, {"panel": 3.0, "farthest": 10.0})
    )
    assert texts_of(narrow) == {"2 segments · 1 corner · 2 clusters"}
    assert max(*wide.get_xlim(), *wide.get_ylim()) > 15
    assert max(*narrow.get_xlim(), *narrow.get_ylim()) < 11


def test_numbers_do_not_lie_on_each_other_nor_outside(drawn):
    scan, features = room()
    features.corners = np.repeat(features.corners[:1], 8)
    features.corners["position"] += np.linspace(0, 0.1, 8)[:, None]
    axes = drawn(figures.plot_scan, scan, {"a": features}).axes[0]
    boxes = [t.get_window_extent() for t in axes.texts if t.get_text() == "12.5"]
    assert len(boxes) == 8
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
    panel = axes.get_window_extent()
    assert all(panel.containsx(x) for box in boxes for x in (box.x0, box.x1))


def labels(positions, obstacles):
    """Texts beside the positions in a panel whose unit is a point of the paper."""
    axes = canvas.new_figure(4, 4).add_axes((0.25, 0.25, 0.5, 0.5), xlim=(-72, 72), ylim=(-72, 72))
    values = np.full(len(positions), 12.25)
    drawing.label_points(axes, np.array(positions, float), values, np.reshape(obstacles, (-1, 2)))
    return axes.texts


def test_numbers_stay_away_from_other_corners():
    positions = np.array([(0, 0), (15, 0)])
    for text, position in zip(labels(positions, []), positions, strict=True):
        apart = np.abs(position + text.get_position() - positions)
        assert (apart >= (9.2, 4.5)).any(axis=1).all()


@pytest.mark.parametrize(
    ("place", "hidden", "offset"),
    [
        # A text of four letters is 18.4 by 9 points, and the nearest place 6 points beside it.
        ((0, 0), [], (15.2, 0)),
        ((0, 0), [(15, 0), (15, 6)], (0, 10.5)),
        # A few points are hidden rather than gone far away, a crowd is not.
        ((0, 0), [(15 * math.cos(t), 15 * math.sin(t)) for t in np.arange(24) / 3.82], "near"),
        ((0, 0), [(x, y) for x in range(-40, 9, 2) for y in range(-40, 41, 2)], "far"),
        ((71, 0), [], (15.2 * math.cos(math.radians(150)), 5.25)),  # at the edge of the panel
    ],
)
def test_number_stands_where_it_hides_least(place, hidden, offset):
    (text,) = labels([place, (np.nan, 0)], [*hidden, (np.nan, 0)])
    assert text.get_text() == "12.2"
    if isinstance(offset, str):
        is_near = (np.abs(text.get_position()) < (15.3, 10.6)).all()
        assert is_near == (offset == "near")
    else:
        assert text.get_position() == pytest.approx(offset, abs=1e-9)


@pytest.mark.parametrize(("width", "height"), [(1, 40), (40, 1), (4, 3)])
def test_figures_have_the_shape_of_the_scan_within_reason(width, height):
    x, y = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]).T * [[width / 2], [height / 2]]
    scan = ln.LaserScan(np.hypot(x, y), angles=np.arctan2(y, x))
    figure = figures.scan_figure(scan, {"a": features_of(4)})
    inches = figure.get_figheight() - 1.2  # without titles
    assert inches == pytest.approx(5.6 * {40: 1.4, 1: 0.4, 3: 0.86 * 3.32 / 4.32}[height])


@pytest.mark.parametrize("more", [0, 1])
def test_many_corners_have_no_numbers(more):
    scan, features = room()
    features.corners = np.repeat(features.corners[:1], drawing.MAX_LABELS + more)
    (axes,) = figures.scan_figure(scan, {"a": features}).axes
    assert len(axes.texts) == 1 + (0 if more else drawing.MAX_LABELS)


def test_stages_of_a_trace(drawn):
    scan, features = room()
    candidates = np.zeros(3, CANDIDATE)
    candidates["beam"], candidates["accepted"] = [40, 20, 30], [True, False, False]
    candidates["response"] = [12.5, 3.25, 1.125]
    filtered = np.where(scan.valid, 0.5 * scan.ranges, np.nan)
    trace = trace_of(scan, features, filtered=filtered, candidates=candidates, threshold=10.0)
    trace.spacing[5] = 0.0  # a log axis has no place for it
    figure = drawn(figures.plot_trace, trace)
    filter_, spacing, clusters, corners = figure.axes
    assert texts_of(filter_) == {f"{scan.valid.sum()} valid beams of 81"}
    lines = by_label(filter_)
    np.testing.assert_array_equal(lines["filtered"].get_ydata(), trace.filtered)
    np.testing.assert_array_equal(
        lines["raw"].get_ydata(), np.where(scan.valid, scan.ranges, np.nan)
    )
    np.testing.assert_allclose(lines["no return"].get_xdata(), np.arange(15, 20))
    # A new cluster begins at beam 41, noise at 60, and what follows is no noise.
    breaks = [line.get_xdata()[0] for line in spacing.lines if line.get_color() == "#dbb0b4"]
    assert breaks == [41, 60, 61]
    assert texts_of(spacing) == {"3 breaks"}
    assert spacing.get_yscale() == "log"
    expected = np.where(trace.spacing > 0, trace.spacing, np.nan)
    np.testing.assert_array_equal(by_label(spacing)["spacing"].get_ydata(), expected)
    assert texts_of(clusters) == {"2 clusters · 1 noise point"}
    about = "3 candidates · 1 accepted · threshold 10 · 2 segments"
    assert texts_of(corners) == {about, "12.5", "3.25", "1.12"}
    shown = by_label(corners)
    np.testing.assert_allclose(shown["accepted"].get_xydata(), [[1, 1]])  # on filtered ranges
    np.testing.assert_allclose(shown["rejected"].get_xydata(), scan.points[[20, 30]] / 2)
    for axes in figure.axes:
        box = axes.get_legend().get_window_extent()
        assert box.y1 <= axes.get_window_extent().y0  # below its panel
        assert box.height < 0.1 * axes.get_window_extent().height  # in one row
    assert clusters.get_xlim() == corners.get_xlim()


def test_trace_without_candidates_shows_corners_and_edges(drawn):
    trace = trace_of(*room(), candidates=np.zeros(0, CANDIDATE))
    panel = drawn(figures.plot_trace, trace).axes[3]
    assert {"corner", "edge"} <= set(by_label(panel))
    assert any("1 corner · 1 edge" in text for text in texts_of(panel))


def test_map_moves_features_by_their_poses(drawn):
    scan, features = room()
    poses = [(0.0, 0.0, 0.0), (10.0, 0.0, math.pi / 2)]
    figure = drawn(figures.plot_map, ((pose, features) for pose in poses), title="Here")
    (axes,) = figure.axes
    assert axes.get_title(loc="left") == "Here"
    assert texts_of(axes) == {"2 scans · 4 segments · 2 corners · 2 edges · 2 arcs"}
    lines, circles = (c.get_segments() for c in axes.collections if isinstance(c, LineCollection))
    np.testing.assert_allclose([lines[0][1], lines[2][1]], [[2, 2], [8, 2]], atol=1e-12)
    np.testing.assert_allclose([c.mean(axis=0) for c in circles], [[1, 1], [9, 1]], atol=0.02)
    shown = by_label(axes)
    np.testing.assert_allclose(shown["path of the sensor"].get_xydata(), [[0, 0], [10, 0]])
    np.testing.assert_allclose(shown["start"].get_xydata(), [[0, 0]])
    points = {
        to_hex(line.get_color()): line.get_xydata() for line in axes.lines if line.get_alpha()
    }
    np.testing.assert_allclose(points[canvas.CORNER_COLOR], [[2, 2], [8, 2]], atol=1e-12)
    x, y = scan.points[0]
    np.testing.assert_allclose(points[canvas.EDGE_COLOR], [[x, y], [10 - y, x]], atol=1e-12)
    named = {text.get_text() for text in figure.legends[0].get_texts()}
    assert named == {"segments", "corners", "edges", "arcs", "path of the sensor", "start"}
    # Walls seen by many scans come out dark by lying on each other.
    few, many = (
        drawn(figures.plot_map, [((0.0, 0.0, 0.0), features)] * n).axes[0] for n in (2, 120)
    )
    assert few.collections[0].get_alpha() == pytest.approx(0.9)
    assert many.collections[0].get_alpha() == pytest.approx(0.5)


@pytest.mark.parametrize("case", list(hostile()))
def test_hostile_scans_are_drawn(tmp_path, case, monkeypatch):
    monkeypatch.setattr(canvas, "DPI", 50)  # quicker
    scan, features = hostile()[case]
    path = tmp_path / "a.png"
    for plot in (
        lambda: figures.plot_scan(scan, {"liu": features}, path),
        lambda: figures.plot_trace(trace_of(scan, features), path),
        lambda: figures.plot_map([((0.0, 0.0, 0.0), features)], path),
        lambda: figures.plot_map([], path),
    ):
        plot()
        assert matplotlib.image.imread(path)[..., :3].std() > 0.01, "blank"
        path.unlink()
    assert "matplotlib.pyplot" not in sys.modules  # which has a global state


def test_wrong_arguments(tmp_path):
    scan, features = room()
    few = replace(features, clusters=features.clusters[1:])
    path, beams = tmp_path / "a.png", "clusters of 80 beams, the scan has 81"
    for plot, arguments, message in (
        (figures.plot_scan, (scan, {}, path), "at least one method"),
        (figures.plot_scan, (scan, {"liu": few}, path), beams),
        (figures.plot_trace, (trace_of(scan, few), path), beams),
    ):
        with pytest.raises(ValueError, match=message):
            plot(*arguments)
    # The ending is known in any case.
    ending = r"the ending '\.gif' is not known, expected one of \.png, \.svg, \.pdf"
    for name, problem in (("a.gif", ending), ("a", "has no ending"), ("no/a.png", "not exist")):
        with pytest.raises(LineamentError, match=problem):
            figures.plot_map([], tmp_path / name)
    assert not list(tmp_path.iterdir())
