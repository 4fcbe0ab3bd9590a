"""The pictures of the experiments: what is drawn is what was computed, and where it is."""

import math

import numpy as np
import pytest
from handmade import features
from small_experiments import PAPER

import lineament as ln
from lineament.output import canvas
from lineament.reproduce import arena, definitions, grid, layers, museum, noise, real, repetition
from lineament.reproduce.two_corners import POSES, WORLD, A, B, _figure, draw_place
from lineament.scan.poses import compose
from lineament.simulation import World, truth


@pytest.fixture
def shown(monkeypatch):
    """The figures that are made, in place of their bytes."""
    figures = []
    monkeypatch.setattr(canvas, "figure_bytes", figures.append)
    return figures


def drawn(axes):
    """The points of each line of a panel, without those that cross all of it."""
    return [np.array(line.get_xydata(), float) for line in axes.lines]


def notes(axes):
    """The texts of a panel that point at a place, and the place."""
    return [(t.get_text(), t.xy) for t in axes.texts if getattr(t, "xycoords", "") == "data"]


def texts_of(axes):
    return " ".join(text.get_text() for text in axes.texts)


def by_label(axes):
    return {line.get_label(): np.array(line.get_xydata(), float) for line in axes.lines}


def beside(vectors, direction):
    """How far vectors lead to the left of a direction."""
    return np.asarray(vectors) @ (-direction[1], direction[0])


def angle_of(points):
    return np.degrees(np.arctan2(*np.transpose(points)[::-1]))


# Definitions


def test_figures_have_the_names_of_the_paper_and_the_place_of_the_scanner():
    for draw, name, has_scanner in (
        (definitions._scan, "Figure 1", True),
        (definitions._spacing, "Figure 4", True),
        (definitions._chords, "Figure 6", False),
        (definitions._parabolas, "Figure 7", False),
        (definitions._tangent, "Figure 8", False),
    ):
        axes = draw()[2].axes[0]
        assert axes.get_title(loc="left").startswith(name)
        assert ([[0.0, 0.0]] in [points.tolist() for points in drawn(axes)]) == has_scanner


def test_figure_1_has_the_field_of_view_and_one_beam_with_its_coordinates():
    _, _, figure, _ = definitions._scan()
    (axes,) = figure.axes
    first, last, fan, beam, down, across, _, _, turn = drawn(axes)[:9]
    for side, bearing in ((first, -80), (last, 80)):
        assert side[0].tolist() == [0, 0]
        assert angle_of(side[1]) == pytest.approx(bearing)
    for arc, begin, end in ((fan, -80, 80), (turn, 0, angle_of(beam[1]))):
        assert np.ptp(np.hypot(*arc.T)) == pytest.approx(0)
        assert angle_of(arc[[0, -1]]) == pytest.approx((begin, end))
    x, y = beam[1]
    assert beam[0].tolist() == [0, 0]
    np.testing.assert_allclose(down, [(x, 0), (x, y)])
    np.testing.assert_allclose(across, [(0, y), (x, y)])
    places = {}
    for text, place in notes(axes):
        places.setdefault(text, []).append(place)
    assert places["corner"] == [(3.0, -1.6)]
    np.testing.assert_allclose(by_label(axes)["corner"], places["corner"], atol=0.01)
    assert len(by_label(axes)["breakpoint"]) >= 3
    assert places["breakpoint"] == [(2.3, 0.5), (1.8, 2.2), (0.7, -1.75)]
    (noisy,) = places["noise point"]
    assert math.hypot(*noisy) == pytest.approx(3.7)
    assert places[r"$(x_i, y_i)$"] == [(x, y)]


def test_figure_4_has_the_spacing_of_neighbours_on_a_wall():
    plan, curves = definitions._spacing()[2].axes
    points = next(points for points in drawn(plan) if len(points) > 2)
    steps = np.hypot(*np.diff(points, axis=0).T)
    along = np.array((5.4, 1.6)) - (0.4, -0.75)
    assert beside(points - (0.4, -0.75), along) == pytest.approx(0, abs=1e-9)
    rays = [line for line in drawn(plan) if len(line) == 2][: len(points)]
    assert [ray.tolist() for ray in rays] == [[[0, 0], point] for point in points.tolist()]
    assert angle_of(points)[1:] == pytest.approx(angle_of(points)[:-1] + 5)
    (first, at_first), (last, at_last) = notes(plan)
    assert (first, last) == (f"{steps[0]:.2f} m", f"{steps[-1]:.2f} m")
    np.testing.assert_allclose(at_first, points[:2].mean(axis=0))
    np.testing.assert_allclose(at_last, points[-2:].mean(axis=0))
    spacing, least, limit = by_label(curves).values()
    assert (np.diff(spacing[:, 0]) >= 0).all()
    np.testing.assert_allclose(least[:, 1], least[:, 0] * math.radians(1 / 3))
    # A wall at an angle is never nearer than that, but for the noise; neighbours are connected.
    assert np.median(spacing[:, 1] / least[:, 1]) > 1
    assert (limit[:, 1] > least[:, 1]).all()


def test_figure_6_has_the_farthest_point_from_each_chord():
    panels = definitions._chords()[2].axes
    found, ends = [], None
    for k, axes in enumerate(panels, 1):
        cluster, branch, chord, height, at, marked = drawn(axes)
        ends = ends or [cluster[0].tolist(), cluster[-1].tolist()]
        np.testing.assert_array_equal(chord, branch[[0, -1]])
        np.testing.assert_array_equal(marked, chord)
        assert all(end in ends for end in chord.tolist())
        direction = (chord[1] - chord[0]) / np.hypot(*(chord[1] - chord[0]))
        away = abs(beside(branch - chord[0], direction))
        (vertex,), foot = at, height[1]
        np.testing.assert_array_equal(height[0], vertex)
        np.testing.assert_array_equal(branch[away.argmax()], vertex)
        assert beside(foot - chord[0], direction) == pytest.approx(0, abs=1e-12)
        assert (foot - vertex) @ direction == pytest.approx(0, abs=1e-12)
        texts = dict(notes(axes))
        assert f"d = {away.max():.2f} m" in texts
        np.testing.assert_array_equal((texts["first"], texts["last"]), chord)
        assert f"step {k}: " in texts_of(axes)
        if "accepted" in texts_of(axes):
            found.append(vertex.tolist())
            ends.append(vertex.tolist())
    assert len(found) == 2


def test_figure_7_has_the_distances_of_two_parabolas_and_their_sums():
    plan, sums = definitions._parabolas()[2].axes
    curve = max(drawn(sums), key=len)
    dots = [line[0] for line in drawn(sums) if len(line) == 1]
    parabolas = [points for points in drawn(plan) if len(points) == 2 * definitions.RADIUS + 1]
    assert len(dots) == len(parabolas) == 2
    for points, dot, stems in zip(parabolas, dots, plan.collections, strict=True):
        x, y = points.T
        bend = y[0] / x[0] ** 2
        np.testing.assert_allclose(y, bend * x**2, atol=1e-12)
        np.testing.assert_allclose(dot, (2 * bend, y.sum()))
        assert np.interp(dot[0], *curve.T) == pytest.approx(dot[1])
        for (base, tip), point in zip(stems.get_segments(), points, strict=True):
            np.testing.assert_allclose((base, tip), [(point[0], 0), point])
        along = [line for line in drawn(plan) if np.allclose(line[:, 1], bend * line[:, 0] ** 2)]
        assert [len(line) > 50 for line in along] == [True, False]
    at = {text.get_text(): text.get_position() for text in plan.texts}
    assert at["A"][0] == pytest.approx(parabolas[0][definitions.RADIUS + 4, 0])
    assert at["B"][0] == pytest.approx(parabolas[0][definitions.RADIUS + 5, 0])


def test_figure_8_has_the_fits_by_arc_length_and_the_distances_to_the_tangent():
    _, _, figure, numbers = definitions._tangent()
    support_at, *by_arc, last = figure.axes
    cluster, support, (target,) = drawn(support_at)
    assert len(support) == 2 * definitions.RADIUS + 1
    np.testing.assert_array_equal(support[definitions.RADIUS], target)
    # Of all points it is the one nearest to the vertex.
    off = np.hypot(*(cluster - (3.0, 1.0)).T)
    np.testing.assert_array_equal(cluster[off.argmin()], target)
    slopes = []
    for k, (plain, fit) in enumerate(((by_arc[0], by_arc[2]), (by_arc[1], by_arc[3]))):
        (arc, at), (arc_again, _, curve, tangent) = drawn(plain), drawn(fit)
        np.testing.assert_array_equal(arc, arc_again)
        np.testing.assert_array_equal(arc[:, 1], support[:, k])
        np.testing.assert_allclose(np.diff(arc[:, 0]), np.hypot(*np.diff(support, axis=0).T))
        assert at.tolist() == [[0, target[k]]]
        for line in (curve, tangent):
            assert np.interp(0, *line.T) == pytest.approx(target[k], abs=1e-3)
        (slope,) = set(np.round(np.diff(tangent[:, 1]) / np.diff(tangent[:, 0]), 6))
        assert np.interp(0, curve[1:, 0], np.gradient(curve[:, 1], curve[:, 0])[1:]) == (
            pytest.approx(slope, abs=0.02)
        )
        assert f"{slope:.2f}" in texts_of(fit)
        slopes.append(slope)
    direction = np.array(slopes) / np.hypot(*slopes)
    _, support_again, _, line, *stems = drawn(last)
    np.testing.assert_array_equal(support_again, support)
    np.testing.assert_allclose(line.mean(axis=0), target)
    assert beside(line[1] - line[0], direction) == pytest.approx(0, abs=1e-6)
    for stem, point in zip(stems, support, strict=True):
        np.testing.assert_array_equal(stem[0], point)
        assert beside(stem[1] - target, direction) == pytest.approx(0, abs=1e-6)
        assert (stem[1] - point) @ direction == pytest.approx(0, abs=1e-6)
    lengths = [np.hypot(*(stem[1] - stem[0])) for stem in stems]
    assert sum(lengths) == pytest.approx(numbers["sum"])
    assert numbers["stage"] == pytest.approx(numbers["sum"])


# Other pictures


def test_figures_2_and_3_have_raw_and_filtered_points_and_their_spacing(shown):
    noise._figure(0)
    plan, spacing = shown[0].axes
    raw, filtered, noisy = (by_label(plan)[name] for name in ("raw", "filtered", "noise point"))
    assert angle_of(raw) == pytest.approx(np.linspace(-30, 30, 181))
    np.testing.assert_allclose(angle_of(filtered), angle_of(raw))
    assert 0 < len(noisy) < 20
    assert {tuple(point) for point in noisy.tolist()} < {tuple(point) for point in raw.tolist()}
    # What is no noise point is on one of the three walls, to six deviations of 1 cm.
    good = [tuple(point) not in set(map(tuple, noisy.tolist())) for point in raw.tolist()]
    depths = raw[good, 0]
    assert np.min([abs(depths - x) for x in (2.6, 3.0, 4.0)], axis=0).max() < 0.1
    curves = by_label(spacing)
    np.testing.assert_allclose(curves["raw"][:, 0], angle_of(raw))
    steps = np.hypot(*np.diff(raw, axis=0).T)
    np.testing.assert_allclose(curves["raw"][1:, 1], steps, atol=1e-9)
    steps = np.hypot(*np.diff(filtered, axis=0).T)
    np.testing.assert_allclose(curves["filtered"][1:, 1], steps, atol=1e-9)


def test_figure_5_counts_the_clusters(shown):
    scan = ln.LaserScan([2.0] * 9, -0.4, 0.1)
    found = {name: features(9, clusters=c) for name, c in (
        ("two", [0, 0, 0, -1, -1, 1, 1, 1, 1]), ("one", [0] * 9))}  # fmt: skip
    layers._clusters(scan, found)
    titles = [(axes.get_title(loc="left"), texts_of(axes)) for axes in shown[0].axes]
    assert titles == [("two", "2 clusters"), ("one", "1 cluster")]


def test_figure_9_has_the_median_and_the_range_of_the_seeds(shown):
    """AR is the radius over 100, and 0.1, 0.2, 0.5 more by the seed; at another threshold 0."""
    grids = [
        {
            grid.Parameters(form, half_width, radius, threshold): {
                "of_actual": (threshold == grid.THRESHOLD) * (radius / 100 + more)
            }
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
    assert len(by_radius) == len(by_threshold) == len(grid.HALF_WIDTHS)
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


def in_frame(pose, points):
    """World coordinates of points of a scan, rounded."""
    return [tuple(np.round(compose(pose, (*point, 0.0))[:2], 6)) for point in points]


def test_figure_13_has_the_room_the_places_and_both_corners_in_each(shown):
    rng = np.random.default_rng(0)
    views = [(PAPER.scan(WORLD, pose, rng), truth(WORLD, pose, PAPER)) for pose in POSES]
    _figure(views)
    room, *panels = shown[0].axes
    marks = notes(room)
    assert [text for text, _ in marks] == ["A", "B", "1", "2", "3", "4", "5"]
    np.testing.assert_allclose([at for _, at in marks[:2]], (A, B))
    np.testing.assert_allclose([at for _, at in marks[2:]], [pose[:2] for pose in POSES])
    corners = [tuple(np.round(corner, 6)) for corner in (A, B)]
    for arrow, (x, y, theta) in zip(room.patches, POSES, strict=True):
        tip = max(arrow.get_xy(), key=lambda point, x=x, y=y: math.dist(point, (x, y)))
        assert angle_of([np.subtract(tip, (x, y))]) == pytest.approx(math.degrees(theta), abs=0.1)
    for k, (axes, pose) in enumerate(zip(panels, POSES, strict=True), 1):
        assert axes.get_title(loc="left") == f"Place {k}"
        assert in_frame(pose, [at for text, at in notes(axes) if text in "AB"]) == corners


def test_the_name_of_a_corner_stands_before_it_on_the_line_of_sight():
    axes = canvas.new_figure(4, 4).subplots()
    scan = ln.LaserScan([5.0] * 9, -0.4, 0.1)
    draw_place(axes, 3, scan, features(9), np.array((4.0, 3.0)), np.array((0.0, -2.0)))
    names = {text.get_text(): text for text in axes.texts}
    for name, toward in (("A", (-0.8, -0.6)), ("B", (0.0, 1.0))):
        off = np.array(names[name].xyann)
        assert 5 < np.hypot(*off) < 40  # points
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
    known = arena.Arena([], [], walls, np.array([(4.0, 0.0)]))
    some = {"recall": 0.5, "false": 0.25}
    scores = {f"m{k}": (some, np.array([(4.0, 0.1 * k)])) for k in range(1, 6)}
    figure = arena.arena_figure("arena, static", known, scores | {"none": (some, np.empty((0, 2)))})
    assert figure.name == "arena-static"
    assert [axes.get_title(loc="left") for axes in shown[0].axes] == list(scores)
    for axes, (_, found) in zip(shown[0].axes, scores.values(), strict=True):
        assert "found 50 %, false 25 %" in texts_of(axes)
        *drawn_walls, real_corners, positions = drawn(axes)
        assert [wall.tolist() for wall in drawn_walls] == walls.segments.reshape(-1, 2, 2).tolist()
        assert real_corners.tolist() == [[4, 0]]
        np.testing.assert_array_equal(positions, found)
