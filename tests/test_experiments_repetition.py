"""Figure 9: average repetition over the grid of readings, radii and thresholds."""

from __future__ import annotations

import json

import pytest

from lineament.evaluation import Counts
from lineament.reproduce import Setting, repetition
from lineament.reproduce.repetition_grid import (
    Parameters,
    Repetition,
    best_parameters,
    largest,
    repetition_grid,
    repetition_scenes,
)
from lineament.reproduce.repetition_grid import repetition as measure


def silent(about: str) -> None:
    assert about


def made(of_actual: float, among_found: float = 0.5) -> Repetition:
    return Repetition(of_actual, among_found, 1.0, Counts(1, 2, 3))


@pytest.fixture
def grid() -> dict[Parameters, Repetition]:
    """Every reading at three radii and three thresholds; the tangent as the paper has it."""
    ar = {("tangent", 6, 0.66): 0.9, ("product", 8, 0.66): 0.7, ("product", 6, 0.5): 0.6}
    return {
        Parameters(*key): made(ar.get(key, 0.0 if key[0] == "relative" else 0.1), 1 - key[2])
        for reading in ("tangent", "product", "relative")
        for radius in (5, 6, 8)
        for threshold in (0.5, 0.66, 0.8)
        for key in [(reading, radius, threshold)]
    }


def test_largest_is_among_those_asked_for(grid):
    assert largest(grid, "of_actual") == Parameters("tangent", 6, 0.66)
    assert largest(grid, "of_actual", "product") == Parameters("product", 8, 0.66)
    assert largest(grid, "of_actual", "product", radius=6) == Parameters("product", 6, 0.5)
    assert largest(grid, "among_found", threshold=0.8).threshold == 0.8
    assert largest(grid, "among_found").threshold == 0.5


def test_page_says_whether_the_figure_is_reproduced(grid):
    assert repetition._verdict(grid) == "Reproduced by the reading tangent."
    grid[Parameters("tangent", 8, 0.66)] = made(0.95)
    told = repetition._verdict(grid)
    assert told.startswith("Not reproduced")
    assert "tangent at radius 8 (threshold 0.66) and at threshold 0.66 (radius 6)" in told
    assert "product at radius 8 (threshold 0.66) and at threshold 0.5 (radius 6)" in told
    assert "relative finds none at 0.66" in told
    assert "two separate optima" in told
    assert told.endswith("At an end of the grid: 8, 0.5; the optimum may lie beyond.")


def test_optimum_inside_the_grid_is_not_told_to_be_at_its_end():
    assert repetition._at_an_end({6, 8}, {5, 6, 8, 10}) == []
    assert repetition._at_an_end({0.66, 0.05, 1.0}, {0.05, 0.66, 1.0}) == ["0.05", "1"]


def test_table_of_peaks_has_the_paper_beside_and_invents_nothing(grid):
    table = repetition._peaks(grid)
    assert table.columns[2:] == ("paper", "here, tangent", "here, product", "here, relative")
    assert table.rows[0][2:] == (6, 6, 8, None)
    assert table.rows[1][2:] == ("lost", 0.9, 0.7, 0.0)
    assert table.rows[2][2:] == (0.66, 0.66, 0.5, 0.5)


def test_everything_a_corner_repeats_well_and_is_wrong():
    everywhere = measure(Parameters("tangent", 6, 0.0), range(1))
    assert everywhere.among_found > 0.9
    assert everywhere.counts.precision < 0.1
    assert everywhere.corners_per_view > 100


def test_nothing_found_repeats_nothing():
    nothing = measure(Parameters("relative", 6, 5.0), range(1))
    assert (nothing.of_actual, nothing.among_found, nothing.corners_per_view) == (0.0, 0.0, 0.0)
    assert nothing.counts.true > 0


def test_parameters_are_chosen_on_scenes_that_are_not_reported():
    setting = Setting(frames=50, seed=3)
    chosen_on, reported = (repetition_scenes(setting, reported=r) for r in (False, True))
    assert len(chosen_on) == len(reported) == 100
    assert not set(chosen_on) & set(reported)
    assert not set(reported) & set(repetition_scenes(Setting(frames=50, seed=4), reported=False))


@pytest.mark.slow
def test_run_gives_tables_figures_and_the_best_of_its_grid():
    setting, said = Setting(frames=1), []
    findings = repetition.run(setting, said.append)
    assert len(said) > 20
    best = best_parameters(setting, silent)
    measured = repetition_grid(setting, silent)
    assert measured[best].of_actual == max(r.of_actual for r in measured.values())
    assert findings.numbers["best"]["threshold"] == best.threshold
    assert [figure.name for figure in findings.figures] == ["fig9a", "fig9b"]
    assert all(figure.png.startswith(b"\x89PNG") for figure in findings.figures)
    # The same setting, the same numbers.
    measure.cache_clear()
    again = repetition.run(setting, silent)
    assert json.dumps(again.to_dict()) == json.dumps(findings.to_dict())
