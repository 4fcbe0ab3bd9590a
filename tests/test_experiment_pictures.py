"""The pictures of the experiments: what is drawn is what was computed, and where it is."""

import math

import numpy as np
import pytest
from handmade import features
from lineament_lab.evaluation.arena import Arena
from lineament_lab.reproduce import grid, layers, museum, noise, real, repetition, similarity
from lineament_lab.reproduce.findings import dot_chart, log_axis
from lineament_lab.reproduce.two_corners import POSES, WORLD, A, B, _figure, draw_place
from panels import angle_of, assert_apart, assert_legible, drawn, notes, texts_of
from small_experiments import PAPER

import lineament as ln
from lineament.output import canvas
from lineament.scan.poses import compose
from lineament.simulation import World, truth


@pytest.fixture
def shown(monkeypatch):
    """The figures that are made, in place of their bytes."""
    figures = []
    monkeypatch.setattr(canvas, "figure_bytes", figures.append)
    return figures


def test_figures_2_and_3_are_legible(shown):
    noise._figure(0)
    assert_legible(shown[0])


def test_figure_5_counts_the_clusters(shown):
    scan = ln.LaserScan([2.0] * 9, -0.4, 0.1)
    found = {name: features(9, clusters=c) for name, c in (
        ("two", [0, 0, 0, -1, -1, 1, 1, 1, 1]), ("one", [0] * 9))}  # fmt: skip
    layers._clusters(scan, found)
    titles = [(axes.get_title(loc="left"), texts_of(axes)) for axes in shown[0].axes]
    assert titles == [("two", "2 clusters"), ("one", "1 cluster")]
    for figure in shown:
        assert_legible(figure)


def test_figure_9_has_the_median_and_the_range_of_the_seeds(shown):
    """AR is the radius over 100, and 0.1, 0.2, 0.5 more by the seed; at another threshold 0."""
    grids = [
        {
            grid.Parameters(form, half_width, radius, threshold): dict.fromkeys(
                grid.CRITERIA, (threshold == grid.THRESHOLD) * (radius / 100 + more)
            )
            for form in grid.FORMS
            for half_width in grid.HALF_WIDTHS
            for radius in (5, 6, 8)
            for threshold in (0.5, grid.THRESHOLD)
        }
        for more in (0.2, 0.5, 0.1)
    ]
    repetition._figure(grids, "support_radius", "fig9a", "x", "")
    repetition._figure(grids, "threshold", "fig9b", "x", "")
    by_radius, by_threshold = ([of for of in figure.axes if of.lines] for figure in shown)
    assert len(by_radius) == len(by_threshold) == 2 * len(grid.HALF_WIDTHS)
    for axes in by_radius:
        peak, *curves = drawn(axes)
        assert set(peak[:, 0]) == {grid.RADIUS}
        for curve in curves:
            np.testing.assert_allclose(curve, [(5, 0.25), (6, 0.26), (8, 0.28)])
        for band in axes.collections:
            x, y = band.get_paths()[0].vertices.T
            assert (x.min(), x.max()) == (5, 8)
            assert (y.min(), y.max()) == pytest.approx((0.15, 0.58))
    for axes in by_threshold:
        peak, *curves = drawn(axes)
        assert set(peak[:, 0]) == {grid.THRESHOLD}
        for curve in curves:
            np.testing.assert_allclose(curve, [(0.5, 0), (grid.THRESHOLD, 0.26)])
        assert axes.get_xscale() == "log"
    for figure in shown:
        assert_legible(figure)


class _Ranked:
    """Corners of which so many and such a share are repeated, as less certain ones come."""

    def __init__(self, n):
        self.n = n

    def curve(self):
        return np.arange(1, self.n + 1), 1 / np.arange(1, self.n + 1)


@pytest.mark.parametrize("logs", [1, 2, 3])
def test_curves_of_repeated_corners_begin_where_they_do_not_scatter(shown, logs):
    assert real._curves({}) == []
    (figure,) = real._curves(
        {f"log {k}": {"a": _Ranked(20), "b": _Ranked(30)} for k in range(logs)}
    )
    assert len(shown[0].axes) == logs
    assert f"from the {real.FIRST + 1}th on" in figure.caption
    for k, axes in enumerate(shown[0].axes):
        assert axes.get_title(loc="left") == f"log {k}"
        for curve, n in zip(drawn(axes), (20, 30), strict=True):
            count = np.arange(real.FIRST + 1, n + 1)
            np.testing.assert_allclose(curve, np.column_stack((count, 100 / count)))
    for figure in shown:
        assert_legible(figure)


def in_frame(pose, points):
    """World coordinates of points of a scan, rounded."""
    return [tuple(np.round(compose(pose, (*point, 0.0))[:2], 6)) for point in points]


def test_figure_13_has_the_room_the_places_and_both_corners_in_each(shown):
    rng = np.random.default_rng(0)
    views = [(PAPER.scan(WORLD, pose, rng), truth(WORLD, pose, PAPER)) for pose in POSES]
    _figure(views)
    room, *panels = shown[0].axes
    marks = [(text.strip(), at) for text, at in notes(room)]
    assert [text for text, _ in marks] == ["A", "B", "1", "2", "3", "4", "5"]
    np.testing.assert_allclose([at for _, at in marks[:2]], (A, B))
    np.testing.assert_allclose([at for _, at in marks[2:]], [pose[:2] for pose in POSES])
    corners = [tuple(np.round(corner, 6)) for corner in (A, B)]
    for arrow, (x, y, theta) in zip(room.collections, POSES, strict=True):
        assert arrow.XY.tolist() == [[x, y]]
        assert angle_of([(arrow.U[0], arrow.V[0])]) == pytest.approx(math.degrees(theta))
    for k, (axes, pose) in enumerate(zip(panels, POSES, strict=True), 1):
        assert axes.get_title(loc="left") == f"Place {k}"
        assert in_frame(pose, [at for text, at in notes(axes) if text in "AB"]) == corners
    for figure in shown:
        assert_legible(figure)


def test_the_name_of_a_corner_stands_before_it_on_the_line_of_sight():
    axes = canvas.new_figure(4, 4).subplots()
    scan = ln.LaserScan([5.0] * 9, -0.4, 0.1)
    draw_place(axes, 3, scan, features(9), np.array((4.0, 3.0)), np.array((0.0, -2.0)))
    names = {text.get_text(): text for text in axes.texts}
    for name, toward in (("A", (-0.8, -0.6)), ("B", (0.0, 1.0))):
        off = np.array(names[name].xyann)
        assert np.hypot(*off) == pytest.approx(30)  # points
        np.testing.assert_allclose(off / np.hypot(*off), toward, atol=1e-12)


def test_the_museums_places_are_at_equal_parts_of_the_way(shown):
    scan = ln.LaserScan([5.0] * 9, -0.4, 0.1)
    places = {7: (np.array((4.0, 3.0)), True), 9: (np.array((0.0, -2.0)), False)}
    views = [museum.View(scan, features(9), way, places) for way in np.linspace(0, 4, 9)]
    museum._places(views, 7, 9)
    titles = [axes.get_title(loc="left") for axes in shown[0].axes]
    assert titles == [f"Place {k}" for k in range(1, 6)]
    for axes in shown[0].axes:
        marks = {text: at for text, at in notes(axes) if text in "AB"}
        assert marks == {"A": (4.0, 3.0), "B": (0.0, -2.0)}


def test_corners_of_the_arena_are_drawn_for_each_method_that_found_some(shown):
    walls = World([[0, 0, 4, 0], [4, 0, 4, 3]])
    known = Arena([], [], walls, np.array([(4.0, 0.0)]))
    some = {"recall": 0.5, "false": 0.25}
    scores = {f"m{k}": (some, np.array([(4.0, 0.1 * k)])) for k in range(1, 6)}
    figure = real.arena_figure("arena, static", known, scores | {"none": (some, np.empty((0, 2)))})
    assert figure.name == "arena-static"
    assert [axes.get_title(loc="left") for axes in shown[0].axes] == list(scores)
    for axes, (_, found) in zip(shown[0].axes, scores.values(), strict=True):
        assert "found 50 %, false 25 %" in texts_of(axes)
        *drawn_walls, real_corners, positions = drawn(axes)
        assert [wall.tolist() for wall in drawn_walls] == walls.segments.reshape(-1, 2, 2).tolist()
        assert real_corners.tolist() == [[4, 0]]
        np.testing.assert_array_equal(positions, found)
    for figure in shown:
        assert_legible(figure)


@pytest.mark.parametrize(("count", "columns", "rows"), [(0, 4, 1), (1, 1, 1), (3, 3, 1), (4, 3, 2)])
def test_panels_are_as_many_as_asked_for_and_as_wide_as_high(count, columns, rows):
    figure, panels = canvas.new_panels(count, columns)
    assert list(panels) == figure.axes
    assert len(panels) == count
    assert figure.get_size_inches().tolist() == [9, 9 * rows / columns]


def test_errors_of_methods_are_strips_with_one_axis_below(monkeypatch):
    scan = ln.LaserScan([5.0, 5.0, math.nan], -0.1, 0.1)
    errors = iter([[0.02, 0.5, math.nan], [0.02, math.nan, math.nan]])
    monkeypatch.setattr(similarity, "similarity_errors", lambda *_: np.array(next(errors)))
    figure = similarity.error_strips(scan, {"a": features(3), "b": features(3)})
    assert [axes.get_title(loc="right") for axes in figure.axes] == [
        *("a: 100 % explained", "b: 50 % explained")]  # fmt: skip
    assert [axes.get_xlabel() for axes in figure.axes] == ["", "bearing [°]"]
    for axes in figure.axes:
        _, paper = drawn(axes)
        assert set(paper[:, 1]) == {0.01}
        labels = [(label.get_position()[1], label.get_text()) for label in axes.get_yticklabels()]
        assert labels == [(0.001, "1 mm"), (0.01, "1 cm"), (0.1, "0.1 m"), (1.0, "1 m")]
    assert_legible(figure)


def test_rows_of_a_chart_are_legible():
    rows = {f"method {k}, shared steps": {"f1": k / 40, "t": 2.0**k} for k in range(40)}
    figure = dot_chart({"one": rows, "other": rows}, {"F1": "f1", "time": "t"}, ["time"])
    assert_legible(figure)
    assert_apart(figure.axes[0].get_yticklabels())


@pytest.mark.parametrize(("high", "numbers"), [(150, [2, 5, 10, 20, 50, 100]),
                                               (200, [10, 100])])  # fmt: skip
def test_a_log_axis_has_numbers_at_1_2_and_5_while_these_are_few(high, numbers):
    axes = canvas.new_figure(4, 3).subplots()
    axes.set_xlim(2, high)
    log_axis(axes.xaxis)
    assert axes.get_xscale() == "log"
    assert [x for x in axes.get_xticks() if 2 <= x <= high] == pytest.approx(numbers)
    assert not len(axes.get_xticks(minor=True))
    assert axes.xaxis.get_major_formatter()(0.5, 0) == "0.5"
