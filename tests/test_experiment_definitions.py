"""The pictures of the definitions: what is drawn is what was computed, and where it is."""

import math

import numpy as np
import pytest
from lineament_lab.reproduce import definitions, machine
from panels import angle_of, assert_legible, beside, by_label, drawn, notes, texts_of


def test_figures_have_the_names_of_the_paper_and_the_place_of_the_scanner():
    for draw, name, has_scanner in (
        (definitions._scan, "Figure 1", True),
        (definitions._spacing, "Figure 4", True),
        (definitions._chords, "Figure 6", False),
        (definitions._parabolas, "Figure 7", False),
        (definitions._tangent, "Figure 8", False),
    ):
        figure = draw()[1]
        assert_legible(figure)
        axes = figure.axes[0]
        assert axes.get_title(loc="left").startswith(name)
        assert ([[0.0, 0.0]] in [points.tolist() for points in drawn(axes)]) == has_scanner


def test_figure_1_has_the_field_of_view_and_one_beam_with_its_coordinates():
    _, figure, _ = definitions._scan()
    (axes,) = figure.axes
    noisy_point, sensor, view, beam, down, across, x_axis, y_axis, turn = drawn(axes)[:9]
    assert sensor.tolist() == view[[0]].tolist() == view[[-1]].tolist() == [[0, 0]]
    assert x_axis.tolist() == [[0, 0], [1, 0]]
    assert y_axis.tolist() == [[0, 0], [0, 1]]
    for arc, begin, end in ((view[1:-1], -80, 80), (turn, 0, angle_of(beam[1]))):
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
    assert noisy_point.tolist() == [list(place) for place in places["noise point"]]
    assert np.hypot(*noisy_point.T) == pytest.approx(3.7)
    at = {text.get_text().strip(): np.array(text.get_position()) for text in axes.texts}
    np.testing.assert_allclose(at[r"$\rho_i$"], beam[1] / 2)
    np.testing.assert_allclose(at["$(x_i, y_i)$"], (x, y))
    for name, arc, bearing in (("160°", view, 0), (r"$\theta_1 = -80°$", view, -80),
                               (r"$\theta_i$", turn, 15)):  # fmt: skip
        assert np.hypot(*(arc - at[name]).T).min() == 0
        assert angle_of(at[name]) == pytest.approx(bearing, abs=0.5)


def test_figure_4_has_the_spacing_of_neighbours_on_a_wall():
    plan, curves = definitions._spacing()[1].axes
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
    panels = definitions._chords()[1].axes
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
        texts = {text.strip(): place for text, place in notes(axes)}
        assert f"step {k}: d = {away.max():.2f} m" in texts_of(axes)
        np.testing.assert_array_equal((texts["first"], texts["last"]), chord)
        if "accepted" in texts_of(axes):
            found.append(vertex.tolist())
            ends.append(vertex.tolist())
    assert len(found) == 2


def test_figure_7_has_the_distances_of_two_parabolas_and_their_sums():
    plan, sums = definitions._parabolas()[1].axes
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
        assert [len(line) for line in along] == [50, len(points)]
        assert along[0][[0, -1], 0].tolist() == points[[0, -1], 0].tolist()
    marks = [line[0].tolist() for line in drawn(plan) if len(line) == 1]
    at = {text.get_text().strip(): list(text.get_position()) for text in plan.texts}
    assert [at["A"], at["B"]] == marks
    assert marks == [[parabolas[0][definitions.RADIUS + k, 0], 0] for k in (4, 5)]


def test_figure_7_says_how_far_the_operator_is_off_where_it_is_worst(monkeypatch):
    exact = definitions.corner_response
    off = iter(np.linspace(0.0, 0.5, 17))
    monkeypatch.setattr(definitions, "corner_response", lambda *a, **k: exact(*a, **k) + next(off))
    assert definitions._parabolas()[2]["off"] == pytest.approx(0.5)


def test_figure_8_has_the_fits_by_arc_length_and_the_distances_to_the_tangent():
    _, figure, numbers = definitions._tangent()
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
        (legend,) = fit.get_legend().get_texts()
        assert f"'(0) = {slope:.2f}" in legend.get_text()
        assert [line[[0, -1], 0].tolist() for line in (curve, tangent)] == [[*arc[[0, -1], 0]]] * 2
        slopes.append(slope)
    direction = np.array(slopes) / np.hypot(*slopes)
    _, support_again, _, line, *stems = drawn(last)
    np.testing.assert_array_equal(support_again, support)
    assert beside(line - target, direction) == pytest.approx(0, abs=1e-6)
    np.testing.assert_array_equal(line, [stems[0][1], stems[-1][1]])
    assert beside(line[1] - line[0], direction) == pytest.approx(0, abs=1e-6)
    for stem, point in zip(stems, support, strict=True):
        np.testing.assert_array_equal(stem[0], point)
        assert beside(stem[1] - target, direction) == pytest.approx(0, abs=1e-6)
        assert (stem[1] - point) @ direction == pytest.approx(0, abs=1e-6)
    lengths = [np.hypot(*(stem[1] - stem[0])) for stem in stems]
    assert sum(lengths) == pytest.approx(numbers["sum"])
    assert f"Σ d = {sum(lengths):.2f} m" in texts_of(last)
    assert numbers["stage"] == pytest.approx(numbers["sum"])


def test_table_1_has_the_memory_of_this_machine(monkeypatch):
    sizes = {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 2**21}
    monkeypatch.setattr(machine.os, "sysconf", sizes.__getitem__, raising=False)
    rows = {name: cells for name, *cells in machine.machines().rows}
    assert rows["memory"] == ["8 GB", "8 GiB"]
