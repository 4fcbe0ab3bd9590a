"""The pictures of the experiments: they are legible; what is drawn, if no approved text has it."""

import math
from itertools import combinations

import numpy as np
import pytest
from handmade import features
from lineament_lab.evaluation.arena import Arena
from lineament_lab.reproduce import definitions, grid, layers, noise, real, repetition, similarity
from lineament_lab.reproduce.findings import dot_chart, log_axis
from lineament_lab.reproduce.two_corners import POSES, WORLD, _figure
from matplotlib.text import Text
from small_experiments import PAPER

import lineament as ln
from lineament.output import canvas
from lineament.simulation import World, truth


@pytest.fixture
def shown(monkeypatch):
    """The figures that are made, in place of their bytes: each is to be legible."""
    figures = []
    monkeypatch.setattr(canvas, "figure_bytes", figures.append)
    yield figures
    for figure in figures:
        assert_legible(figure)


def drawn(axes):
    """The points of each line of a panel."""
    return [np.array(line.get_xydata(), float) for line in axes.lines]


def assert_legible(figure):
    """Panels are of a size to see; their texts lie on no other text, and names within panels."""
    canvas.settle(figure)
    width, height = figure.get_size_inches()
    assert 0.2 < height / width < 1.5
    for axes in figure.axes:
        panel = axes.get_window_extent()
        assert panel.width > 1.2 * figure.dpi
        assert panel.height > 0.8 * figure.dpi
        for text in axes.texts:
            if getattr(text, "xycoords", "data") == "data":
                box = Text.get_window_extent(text)  # without the arrow
                assert panel.x0 < box.x0, text
                assert panel.x1 > box.x1, text
                assert panel.y0 < box.y0, text
                assert panel.y1 > box.y1, text
    parts = [part for axes in figure.axes for part in axes.get_children()]
    assert_apart(part for part in parts if isinstance(part, Text))


def assert_apart(texts):
    """No text lies on another one."""
    texts = [text for text in texts if text.get_text().strip()]
    boxes = [Text.get_window_extent(text).shrunk(0.9, 0.7) for text in texts]
    for (one, box), (other, more) in combinations(zip(texts, boxes, strict=True), 2):
        assert not box.overlaps(more), (one, other)


@pytest.mark.parametrize("name", ["scan", "spacing", "chords", "parabolas", "tangent"])
def test_figures_of_definitions_are_legible(name):
    assert_legible(getattr(definitions, f"_{name}")()[1])


def test_figures_2_3_and_13_are_legible(shown):
    noise._figure(0)
    rng = np.random.default_rng(0)
    _figure([(PAPER.scan(WORLD, pose, rng), truth(WORLD, pose, PAPER)) for pose in POSES])
    assert len(shown) == 2


def test_figure_7_says_how_far_the_operator_is_off_where_it_is_worst(monkeypatch):
    exact = definitions.corner_response
    off = iter(np.linspace(0.0, 0.5, 17))
    monkeypatch.setattr(definitions, "corner_response", lambda *a, **k: exact(*a, **k) + next(off))
    assert definitions._parabolas()[2]["off"] == pytest.approx(0.5)


def test_a_method_that_finds_no_corner_of_the_arena_has_no_panel(shown):
    known = Arena([], [], World([[0, 0, 4, 0], [4, 0, 4, 3]]), np.array([(4.0, 0.0)]))
    rates = {"recall": 0.5, "false": 0.25}
    some = {f"m{k}": (rates, np.array([(4.0, 0.1 * k)])) for k in range(1, 6)}
    figure = real.arena_figure("arena, static", known, some | {"none": (rates, np.empty((0, 2)))})
    assert figure.name == "arena-static"
    assert [axes.get_title(loc="left") for axes in shown[0].axes] == list(some)


def test_strips_of_errors_are_legible(monkeypatch):
    scan = ln.LaserScan([5.0, 5.0, math.nan], -0.1, 0.1)
    monkeypatch.setattr(similarity, "similarity_errors", lambda *_: np.array([0.02, 0.5, math.nan]))
    assert_legible(similarity.error_strips(scan, {"a": features(3), "b": features(3)}))


def test_figure_5_counts_the_clusters(shown):
    scan = ln.LaserScan([2.0] * 9, -0.4, 0.1)
    found = {name: features(9, clusters=c) for name, c in (
        ("two", [0, 0, 0, -1, -1, 1, 1, 1, 1]), ("one", [0] * 9))}  # fmt: skip
    layers._clusters(scan, found)
    titles = [(axes.get_title(loc="left"), axes.texts[0].get_text()) for axes in shown[0].axes]
    assert titles == [("two", "2 clusters"), ("one", "1 cluster")]


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


@pytest.mark.parametrize(("count", "columns", "rows"), [(0, 4, 1), (1, 1, 1), (3, 3, 1), (4, 3, 2)])
def test_panels_are_as_many_as_asked_for_and_as_wide_as_high(count, columns, rows):
    figure, panels = canvas.new_panels(count, columns)
    assert list(panels) == figure.axes
    assert len(panels) == count
    assert figure.get_size_inches().tolist() == [9, 9 * rows / columns]


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
