"""Figures: what is drawn, where, for kind and hostile input."""

import math
import sys
from dataclasses import replace

import matplotlib.image
import matplotlib.text
import numpy as np
import pytest
from approved import assert_approved, figure_lines, numbers_of
from handmade import features as features_of
from handmade import segment
from matplotlib.colors import to_hex, to_rgb

import lineament as ln
from lineament import LineamentError
from lineament.features import ARC, BREAKPOINT, CORNER, EDGE, SEGMENT, Features
from lineament.methods.trace import CANDIDATE, Trace
from lineament.output import canvas, drawing, figures, stages


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
    segments, corners, edges = np.zeros(2, SEGMENT), np.zeros(1, CORNER), np.zeros(1, EDGE)
    segments["start"], segments["end"] = [scan.points[0], [2, 2]], [[2, 2], scan.points[-1]]
    corners["position"], corners["kind"], corners["quality"] = [2, 2], "corner", 0.875
    corners["response"], corners["beam"] = 9.84e4, 40
    edges["position"], edges["side"], edges["quality"] = scan.points[0], "start", 0.5
    corners["covariance"] = edges["covariance"] = np.diag([1e-2, 4e-2])
    arcs, breakpoints = np.zeros(1, ARC), np.zeros(2, BREAKPOINT)
    arcs["center"], arcs["radius"], arcs["last_beam"] = [1, 1], 0.3, 8
    breakpoints["position"] = scan.points[[0, -1]]
    tables = {"segments": segments, "corners": corners, "edges": edges, "arcs": arcs}
    return scan, Features(**tables, breakpoints=breakpoints, clusters=clusters)


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


@pytest.mark.parametrize(
    ("ending", "start"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".PDF", b"%PDF")]
)
def test_endings(tmp_path, ending, start):
    path, files = tmp_path / f"a{ending}", []
    for _ in range(2):
        canvas.save(figures.map_figure([((0.0, 0.0, 0.0), room()[1])]), path)
        files.append(path.read_bytes())
    assert files[0].startswith(start)
    assert files[0] == files[1]
    assert list(tmp_path.iterdir()) == [path]


def arena(width, height, x=0.0, y=0.0, n=720, noise=0.003) -> ln.LaserScan:
    """Scan a room of some size [m] from a place in it."""
    angles = np.linspace(-math.pi, math.pi, n, endpoint=False)
    toward = np.column_stack((np.cos(angles), np.sin(angles)))
    sides = np.sign(toward) * np.array([width, height]) / 2 - (x, y)
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = np.nanmin(np.where(toward == 0, np.inf, sides / toward), axis=1)
    ranges += noise * np.random.default_rng(1).normal(size=n)
    return ln.LaserScan(ranges, angles[0], angles[1] - angles[0], range_max=300.0, stamp=12.5)


def lone(n_valid) -> ln.LaserScan:
    ranges = np.full(360, np.nan)
    ranges[40 : 40 + n_valid] = 2.0
    return ln.LaserScan(ranges, -math.pi, math.radians(1))


#: A segment that rises as it runs.
SLOPE = segment((-0.1, -0.1), (0.1, 0.1), 1, 100)
EXTREMES = {
    "cupboard": arena(0.6, 1.0),
    "room": arena(7.0, 5.0, x=1.0),
    "corridor along x": arena(200.0, 2.4, x=-60.0),
    "corridor along y": arena(2.4, 200.0, y=40.0),
    "one beam": lone(1),
    "no beam": lone(0),
}


def texts_drawn(figure):
    """Return the texts of a figure that are drawn: those of ticks beyond the axes are not."""
    texts, draw = [], matplotlib.text.Text.draw

    def record(text, renderer):
        if text.get_visible() and text.get_text().strip():
            texts.append(text)
        draw(text, renderer)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(matplotlib.text.Text, "draw", record)
        figure.draw_without_rendering()
    return texts


@pytest.mark.slow
@pytest.mark.parametrize("name", EXTREMES)
def test_every_scan_fills_its_panel_and_no_text_covers_another(name, tmp_path):
    scan, shown = EXTREMES[name], {"optimal": "optimal", "liu:scale_free": "liu:scale_free"}
    found = {label: ln.extract(scan, method=method) for label, method in shown.items()}
    title = figures.scan_title("logs/a.bag", 7, scan)
    long = f"{'a_long_name' * 12}.bag · scan 40"
    for figure in (
        figures.scans_figure([(long, scan, found["optimal"])] * 4, title=long),
        figures.scan_figure(scan, found, title=title),
        figures.scan_figure(scan, found, dark=True),
        stages.trace_figure(ln.trace(scan), title=title),
        stages.trace_figure(ln.trace(scan, method="liu"), title=title),
    ):
        canvas.save(figure, tmp_path / "a.png")
        boxes = [text.get_window_extent() for text in texts_drawn(figure)]
        assert len(boxes) > 20
        assert all(box.x0 >= 0 and box.x1 <= figure.bbox.width for box in boxes)
        for i, box in enumerate(boxes):
            for other in boxes[:i]:
                assert not box.padded(-1.5).overlaps(other.padded(-1.5))
        plans = [axes for axes in figure.axes if axes.get_xlabel().startswith("x [m]")]
        for axes in plans:
            width, height = axes.get_window_extent().size / figure.dpi
            assert height > 1.7
            assert width > 4
            points = scan.points[scan.valid]
            if len(points) < 2:
                continue
            extent = np.ptp(points, axis=0)
            share = extent / np.ptp([axes.get_xlim(), axes.get_ylim()], axis=1)
            assert share.max() > 0.75
            assert share.min() > 0.2


def test_a_plan_is_drawn_larger_by_the_round_factor_that_just_fills_it():
    shapes = [(1.0, 0.4 / 2.9), (1.0, 0.08), (1.0, 0.081), (1.0, 7.0), (1.0, 6.9)]
    assert [canvas._aspect(np.array(shape)) for shape in shapes] == [1, 5, 2, 1 / 5, 1 / 2]


@pytest.mark.parametrize(
    ("stamp", "time"),
    [
        (0.0, ""),
        (12.345, " · 12.35 s"),
        (1_500_000_000.0, " · 2017-07-14 02:40:00 UTC"),
        (1e12, " · 1000000000000.00 s"),
    ],
)
def test_titles_have_log_scan_and_time(stamp, time, drawn):
    scan = ln.LaserScan([1.0], 0.0, 0.1, stamp=stamp)
    title = figures.scan_title("some/where/a.bag", 40, scan)
    assert title == f"a.bag · scan 40{time}"
    figure = drawn(figures.plot_scan, scan, {"a": features_of(1)}, title=title)
    assert figure.get_suptitle() == title


def test_dark_figures_have_light_marks(drawn):
    scan, features = room()
    for dark, theme in ((False, canvas.LIGHT), (True, canvas.DARK)):
        for figure in (
            drawn(figures.plot_scan, scan, {"a": features}, title="A", dark=dark),
            drawn(stages.plot_trace, trace_of(scan, features), title="A", dark=dark),
            figures.map_figure([((0.0, 0.0, 0.0), features)], "A", dark=dark),
        ):
            assert to_hex(figure.get_facecolor()) == theme.paper
            for axes in figure.axes:
                assert to_hex(axes.get_facecolor()) == theme.paper
            for text in figure.findobj(matplotlib.text.Text):
                if text.get_text():
                    assert contrast(text.get_color(), theme.paper) > 3, text


#: What people without one kind of cone see: Machado et al. 2009, in linear RGB, severity 1.
CONES = {
    "all": np.eye(3),
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
               [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
               [-0.011820, 0.042940, 0.968881]],
    "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
               [0.004733, 0.691367, 0.303900]],
}  # fmt: skip


def linear(color) -> np.ndarray:
    rgb = np.array(to_rgb(color))
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def contrast(a, b) -> float:
    """Contrast of two colours, 1 to 21 (WCAG 2)."""
    light = sorted(linear(color) @ (0.2126, 0.7152, 0.0722) + 0.05 for color in (a, b))
    return float(light[1] / light[0])


def lab(color, cones) -> np.ndarray:
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    seen = np.clip(np.asarray(cones) @ linear(color), 0, 1)
    x, y, z = np.cbrt(np.maximum(np.array(to_xyz) @ seen / (0.9505, 1, 1.089), 0.009))
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("cones", CONES)
@pytest.mark.parametrize("theme", [canvas.LIGHT, canvas.DARK])
def test_colours_stay_apart_for_every_eye(theme, cones):
    neighbours = [*zip(theme.palette, np.roll(theme.palette, 1), strict=True)]
    marks = [(theme.corner, theme.ink), (theme.corner, theme.way), (theme.arc, theme.ink),
             (theme.corner, theme.edge), (theme.way, theme.ink)]  # fmt: skip
    for a, b in [*neighbours, *marks]:
        assert np.linalg.norm(lab(a, CONES[cones]) - lab(b, CONES[cones])) > 25, (a, b)
    for color in [*theme.palette, theme.corner, theme.arc, theme.way, theme.ink]:
        far = np.linalg.norm(lab(color, CONES[cones]) - lab(theme.paper, CONES[cones]))
        assert far > 25, color


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
    ranges[50:61] = 25.0
    scan = ln.LaserScan(ranges, angles=scan.angles, range_max=30.0)
    wide, narrow = (
        figures.scan_figure(scan, {"a": features}, **given).axes[0]
        for given in ({}, {"panel": 3.0, "farthest": 10.0})
    )
    assert [text.get_text() for text in narrow.texts] == ["2 segments · 1 corner · 2 clusters"]
    assert max(*wide.get_xlim(), *wide.get_ylim()) > 15
    assert max(*narrow.get_xlim(), *narrow.get_ylim()) < 11


def labels(positions, obstacles):
    """Texts beside the positions in a panel whose unit is a point of the paper."""
    axes = canvas.new_figure(4, 4).add_axes((0.25, 0.25, 0.5, 0.5), xlim=(-72, 72), ylim=(-72, 72))
    values = np.full(len(positions), 0.125)
    drawing.label_points(axes, np.array(positions, float), values, np.reshape(obstacles, (-1, 2)))
    return axes.texts


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
    assert text.get_text() == "0.12"
    if isinstance(offset, str):
        is_near = (np.abs(text.get_position()) < (15.3, 10.6)).all()
        assert is_near == (offset == "near")
    else:
        assert text.get_position() == pytest.approx(offset, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("case", list(hostile()))
def test_hostile_scans_are_drawn(tmp_path, case, monkeypatch):
    monkeypatch.setattr(canvas, "DPI", 50)  # quicker
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)  # has a global state: not used
    scan, features = hostile()[case]
    path = tmp_path / "a.png"
    for plot in (
        lambda: figures.plot_scan(scan, {"liu": features}, path),
        lambda: stages.plot_trace(trace_of(scan, features), path),
        lambda: canvas.save(figures.map_figure([((0.0, 0.0, 0.0), features)]), path),
        lambda: canvas.save(figures.map_figure([]), path),
    ):
        plot()
        assert matplotlib.image.imread(path)[..., :3].std() > 0.01, "blank"
        path.unlink()


def test_wrong_arguments(tmp_path):
    scan, features = room()
    few = replace(features, clusters=features.clusters[1:])
    path, beams = tmp_path / "a.png", "clusters of 80 beams, the scan has 81"
    for plot, arguments, message in (
        (figures.plot_scan, (scan, {}, path), "at least one method"),
        (figures.plot_scan, (scan, {"liu": few}, path), beams),
        (stages.plot_trace, (trace_of(scan, few), path), beams),
    ):
        with pytest.raises(ValueError, match=message):
            plot(*arguments)
    # The ending is known in any case.
    ending = r"the ending '\.gif' is not known, expected one of \.png, \.svg, \.pdf"
    for name, problem in (("a.gif", ending), ("a", "has no ending"), ("no/a.png", "not exist")):
        with pytest.raises(LineamentError, match=problem):
            figures.plot_scan(scan, {"a": features}, tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["scan", "scans", "corner", "map", "stages", "evidence"])
def test_figures_show_what_was_approved(name):
    """Where all parts are, their sizes, colours and order, and texts."""
    scan, features = room()
    features.edges = np.repeat(features.edges, 2)
    features.edges["position"][1] = (0.25, 1.5)
    unsure = replace(features, corners=features.corners.copy())
    unsure.corners["covariance"] = np.nan
    errors = {name: np.linspace(0, 0.03, 81) * k for k, name in enumerate("ab")}
    far, title = EXTREMES["corridor along x"], f"{'a long name' * 9} · scan 7"
    candidates = np.zeros(3, CANDIDATE)
    candidates["beam"], candidates["accepted"] = [40, 20, 30], [True, False, False]
    candidates["response"] = [12.5, 3.25, 1.125]
    stages_of = {"filtered": 0.5 * scan.ranges, "candidates": candidates, "threshold": 10.0}
    found = {
        "scan": lambda: [
            figures.scan_figure(scan, dict.fromkeys(errors, features), errors, title="A"),
            figures.scan_figure(scan, dict.fromkeys("ab", unsure), panel=3.0, farthest=2.1),
            figures.scan_figure(far, {"a": features_of(len(far), segments=[SLOPE])}, dark=True),
            figures.scan_figure(lone(0), dict.fromkeys("abcdefghij", features_of(360)), panel=2.0),
        ],
        "scans": lambda: [figures.scans_figure([("a", scan, features)] * 2, title=title)],
        "corner": lambda: [figures.corner_figure(scan, of, 0) for of in (features, unsure)],
        "map": lambda: [
            figures.map_figure([((2.0, k, k / 2), features) for k in range(n)], dark=n == 0)
            for n in (0, 2, 100)
        ],
        "stages": lambda: [stages.trace_figure(trace_of(scan, features, **stages_of), title="A")],
        "evidence": lambda: [stages.trace_figure(ln.trace(EXTREMES["room"]), dark=True)],
    }[name]()
    lines = [line for figure in found for line in figure_lines(figure)]
    assert_approved(f"figures/{name}", lines)


def test_numbers_stand_where_was_approved():
    """Thirty in a row among points: near, far or none, by what they would hide."""
    rng = np.random.default_rng(7)
    crowd = rng.normal(0, 1, (150, 2)) * (20, 30) - (30, 0)
    places = [text.get_position() for text in labels([(4 * k - 60, k) for k in range(30)], crowd)]
    assert 8 < len(places) < 30
    assert_approved("figures/numbers", numbers_of([[*map(float, place)] for place in places]))
