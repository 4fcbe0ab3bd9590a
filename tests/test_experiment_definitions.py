"""The pictures of the definitions: what is drawn is what was computed, and where it is."""

import numpy as np
import pytest
from lineament_lab.reproduce import definitions, machine
from panels import assert_legible, beside, drawn, notes, texts_of


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
