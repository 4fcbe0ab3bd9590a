"""Empty figures: the limits of plans, margins of files, titles as they are given."""

import io

import matplotlib.image
import numpy as np
import pytest
from approved import assert_approved, numbers_of
from handmade import corner, features

from lineament import LaserScan
from lineament.output import canvas, drawing, figures
from lineament.output.markers import FARTHEST, is_drawn

LEVEL, MARGIN = 0.01, 0.04  # of the extent: the least height of a plan, what is free around it


def limits_of(points):
    """Return the lower left and the upper right corner of a plan that shows some points."""
    axes = canvas.new_figure(5, 5).add_subplot()
    canvas.style_plane(axes, "", "", np.array(points, float))
    return np.transpose((axes.get_xlim(), axes.get_ylim()))


@pytest.mark.parametrize("size", [0.02, 1.0, 30.0])
def test_limits_of_a_plan_leave_a_margin_and_grow_with_it(size):
    row, square = [(x, 0.0) for x in np.linspace(-1, 1, 9)], [(-1, 0), (1, 0), (1, 2), (-1, 2)]
    free = 2 * MARGIN
    for points, low, high in (
        (row, (-1 - free, -LEVEL), (1 + free, LEVEL)),
        # As few as eight have no shape: half as high as they are wide.
        (row[1:], (-0.75 - 0.07, -0.4375), (1.07, 0.4375)),
        (square, (-1 - free, -free), (1 + free, 2 + free)),
        ([*row, (np.nan, 9), (9, np.inf), (0, 0.1)], (-1 - free, -0.004), (1 + free, 0.104)),
    ):
        limits = np.array([low, high]) * size
        np.testing.assert_allclose(limits_of(np.array(points) * size), limits, rtol=1e-9)


@pytest.mark.parametrize("points", [[], [(np.nan, 0)]])
def test_a_plan_of_nothing_is_a_square_about_the_sensor(points):
    np.testing.assert_array_equal(limits_of(np.reshape(points, (-1, 2))), [(-1, -1), (1, 1)])
    np.testing.assert_array_equal(limits_of([(3, 4)] * 12), [(2, 3), (4, 5)])


@pytest.mark.parametrize(("dpi", "expected"), [(150, 150), (None, 200)])
def test_a_picture_has_a_margin_of_its_paper(dpi, expected, tmp_path):
    """Of 0.15 inches around a black panel of 2 by 1 inches, however large the figure is."""
    figure = canvas.new_figure(4, 4)
    figure.set_layout_engine("none")
    axes = figure.add_axes((0.25, 0.25, 0.5, 0.25))
    axes.set(xticks=[], yticks=[], facecolor="black")
    for spine in axes.spines.values():
        spine.set_visible(False)
    if dpi:
        canvas.save(figure, tmp_path / "a.png")
        data = (tmp_path / "a.png").read_bytes()
    else:
        data = canvas.figure_bytes(figure)
        assert not figure.axes  # its memory is free
    dark = matplotlib.image.imread(io.BytesIO(data))[..., 0] < 0.5
    for axis, inches in ((0, 2), (1, 1)):
        ink = np.flatnonzero(dark.any(axis=axis))
        assert len(ink) == pytest.approx(inches * expected, abs=1.1)
        margins = [ink[0], dark.shape[1 - axis] - 1 - ink[-1]]
        assert margins == pytest.approx([0.15 * expected] * 2, abs=1.6)


def test_titles_are_shown_as_they_are():
    """Names of files may have dollars, between which matplotlib would see formulas."""
    name = "costs $x^2$"
    axes = canvas.new_figure(5, 5).add_subplot()
    canvas.style(axes, name)
    title = figures.titled(5, 5, name, False).texts[0]
    for text in (axes._left_title, title):
        assert text.get_text() == name
        assert not text.get_parse_math()


def test_what_is_drawn_is_finite_and_nearer_than_the_farthest():
    less = np.nextafter(FARTHEST, 0)
    for values, expected in (
        ([less, -less, FARTHEST, -FARTHEST, np.nan, np.inf], [True, True, *[False] * 4]),
        ([(0, less), (0, FARTHEST), (np.nan, 0)], [True, False, False]),
        ([[(0, 0), (0, 0)], [(0, 0), (-np.inf, 0)]], [True, False]),
        ([], []),
    ):
        np.testing.assert_array_equal(is_drawn(np.array(values, float)), expected)


def test_the_legend_of_a_panel_stands_below_its_left_corner_in_as_few_rows_as_hold_it():
    figure = canvas.new_figure(6, 4)
    figure.set_layout_engine("none")
    cases = ((0, 5, 0), (1, 5, 1), (6, 3, 2), (6, 9, 3), (6, 10, 6), (7, 3, 2), (2, 0.1, 1))
    for count, width, columns in cases:
        axes = figure.add_axes((0.25, 0.25, 0.5, 0.5))
        for k in range(count):
            axes.plot([], [], label=f"{k}: letters")  # of 1.4 inches
        canvas.add_own_legend(axes, width)
        legend = axes.get_legend()
        assert (legend is not None) == (count > 0)
        if count:
            figure.draw_without_rendering()
            anchor = figure.dpi_scale_trans.inverted().transform(legend.get_bbox_to_anchor().p0)
            np.testing.assert_allclose(anchor, (0.25 * 6, 0.25 * 4 - 0.45))
            assert (legend.borderaxespad, legend.get_frame_on()) == (0, False)
            assert legend._ncols == columns


@pytest.mark.parametrize(
    ("sigma", "reach"), [(1e-5, 0.05), (0.01, 0.36), (0.05, 1.8), (1.0, 2.0), (np.nan, 0.5)]
)
def test_surroundings_of_a_corner_are_so_large_that_its_ellipse_is_seen(sigma, reach, monkeypatch):
    found, shown, draw = features(100, corners=[corner(1, 2)]), [], canvas.style_plane

    def style_plane(*given):
        shown.append(given[-1])
        draw(*given)

    monkeypatch.setattr(canvas, "style_plane", style_plane)
    found.corners["covariance"] = np.diag((sigma**2, 0.0))
    figures.corner_figure(LaserScan([3.0] * 100, 0.0, 0.01), found, 0)
    (points,) = shown
    np.testing.assert_allclose(points, [(1 - reach, 2 - reach), (1 + reach, 2 + reach)])


@pytest.mark.parametrize("n", [1, 2, 5])
def test_errors_are_drawn_over_all_bearings(n):
    axes = canvas.new_figure(4, 3).subplots()
    before = axes.get_xlim()
    drawing.draw_errors(axes, LaserScan([1.0] * n, 0.25, 0.125), np.full(n, 0.02))
    if n == 1:
        middle, ends = np.degrees(0.25), axes.get_xlim()
        assert ends[0] < middle < ends[1] != before[1]
    else:
        assert axes.get_xlim() == pytest.approx(np.degrees((0.25, 0.25 + 0.125 * (n - 1))))


def test_what_a_plan_leaves_out_is_as_was_approved():
    """Ever more beams of a hundred, on one side or on all, ever farther out; and what is found."""
    rows, circle = [], 2 * np.pi / 100
    for number in (1, 4, 5, 6, 9, 10, 11, 13, 15, 17):
        for far in np.linspace(2.1, 4.5, 9):
            for beams in (10 + np.arange(number), np.arange(number) * (100 // number)):
                ranges = np.full(100, 2.0)
                ranges[beams] = far
                scan = LaserScan(ranges, -np.pi, circle)
                low, high = scan.points.min(axis=0), scan.points.max(axis=0)
                marks = [high + beyond * (high - low).max() for beyond in (0.04, 0.06, 0.1)]
                for mark in ([], *([corner(*mark)] for mark in marks)):
                    found = [features(100, corners=mark)]
                    points, outside = drawing.points_to_show(scan, found, 4.2)
                    ends = [*points.min(axis=0), *points.max(axis=0)]
                    rows.append([number, float(far), outside, *map(float, ends)])
    assert_approved("figures/shown", numbers_of(rows))


def test_shapes_of_plans_are_as_was_approved():
    """From corridors along y to corridors along x: how large they are drawn, and how high."""
    rows = []
    for shape in np.geomspace(1e-3, 1e3, 31):
        points = np.array([(0, 0), (1, shape)] * 5, float)
        axes = canvas.new_figure(5, 5).add_subplot()
        canvas.style_plane(axes, "", "", points)
        height = canvas.plane_height(points, 4.0)
        rows.append([float(shape), float(axes.get_aspect()), height, axes.get_ylabel()])
    assert_approved("figures/shapes", numbers_of(rows))
