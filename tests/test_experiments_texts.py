"""What the page says follows from its figures, and its pictures can be compared."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lineament import LaserScan
from lineament.evaluation import Counts, FeatureScores, Scores, SimilarityScores
from lineament.evaluation.consistency import NormalisedErrors
from lineament.output import canvas, drawing
from lineament.reproduce import all_methods, layered, similarity, two_corners


@pytest.mark.parametrize(
    ("largest", "told"),
    [(0.009, "0.01 m: the claim holds here."), (0.5, "0.50 m: the claim does not hold here, as")],
)
def test_claim_of_figure_12_holds_or_does_not(largest, told):
    true, liu = (SimilarityScores(np.array([0.0, error]), 2) for error in (0.03, largest))
    text = similarity._text(true, liu)
    assert told in text[-1]
    assert "50 % of the points are farther than 0.01 m" in text[1]


def test_mean_nees_is_told_with_its_interval():
    """Two corners, each off by one σ along x: the mean NEES of four components is a half."""
    off = NormalisedErrors(np.array([[1.0, 0.0], [1.0, 0.0]]))
    scored = all_methods._Result(
        Scores(1, replace(FeatureScores.none("corners"), consistency=off)), 1e-5
    )
    told = all_methods._consistency({"lms181": {"liu": scored, "pdbs": scored}})
    # Quantiles of chi-square with 4 degrees of freedom, 0.484 and 11.143, over 4.
    assert "For corners this is 0.12 to 2.79 where most are right, 0.12 to 2.79 where" in told
    assert told.endswith("1 of the 1 rows lie in theirs.")
    assert "segments" not in told


def test_methods_with_arcs_are_named():
    nothing = all_methods._Result(Scores(), 1e-5)
    two = all_methods._Result(
        Scores(1, arcs=replace(FeatureScores.none("arcs"), by_gate={0.1: Counts(1, 2, 2)})), 1e-5
    )
    sensors = {"lms181": {"liu": nothing, "optimal": nothing}}
    assert all_methods._arcs(sensors).startswith("Arcs are found by none of the methods.")
    sensors["ld19"] = {"liu": nothing, "optimal": two}
    assert all_methods._arcs(sensors).startswith("Arcs are found by optimal.")


def test_less_is_written_with_a_minus_sign():
    cell = two_corners._place_cell(np.array([two_corners.DISTANCE - 0.0125] * 2), 4)
    assert cell == "−12.5 ± 0.0 (50 %)"


def test_paper_is_compared_with_its_literal_pipeline_too():
    assert similarity.PAPER[similarity.FILTERED] == similarity.PAPER[similarity.LIU_PAPER]
    assert layered.PAPER["liu:paper"] == layered.PAPER["liu"]


@pytest.mark.parametrize("errors", [[0.0, 0.02, np.nan], [3.0, 0.1, 0.1], [np.nan] * 3])
def test_axis_of_errors_is_the_same_for_all_methods(errors):
    axes = canvas.new_figure(4, 3).subplots()
    drawing.draw_errors(axes, LaserScan([1.0, 1.0, 1.0], 0.0, 0.1), np.array(errors))
    assert axes.get_ylim() == (1e-4, 10.0)
    drawn = axes.lines[0].get_ydata()
    np.testing.assert_array_equal(drawn, np.maximum(errors, drawing.LEAST_ERROR))
