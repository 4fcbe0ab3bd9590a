"""Repeated corners ranked by a score, and what chance repeats: cases worked by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from handmade import corner, features

from lineament import LaserScan
from lineament.evaluation import RankedRepeats, ranked_repeats

#: The first of the turns to which a corner is moved.
FIRST = math.radians(11.25)
#: From one to the next of 24 turns, the last as far from the whole turn.
STEP = (2 * math.pi - 2 * FIRST) / 23


def ranked(scores, repeated, chance=0.0):
    return RankedRepeats(
        np.array(scores), np.array(repeated, dtype=bool), np.full(len(scores), chance)
    )


def ring(pose=(0.0, 0.0, 0.0), beams=720, view=2 * math.pi):
    """Return a scan of a round room of 5 m, over all or half of the circle."""
    step = math.radians(0.5)
    return LaserScan([5.0] * beams, angle_min=-view / 2, angle_increment=step, pose=pose)


def corners_at(*positions, n=720):
    return features(n=n, corners=[corner(x, y) for x, y in positions])


def turned(radius, angle):
    return radius * math.cos(angle), radius * math.sin(angle)


def test_curve_with_chance_taken_off():
    """Of the best 1, 2, 3, 4 are found 1, 1, 2/3, 3/4; with a fifth by chance (r - 0.2)/0.8."""
    ranks = ranked([0.6, 0.9, 0.7, 0.8], [True, True, False, True], 0.2)
    repeated, rates = ranks.curve()
    assert rates == pytest.approx([1, 1, 7 / 12, 11 / 16])
    assert repeated == pytest.approx([1, 2, 7 / 4, 11 / 4])
    assert ranks.rate == pytest.approx(11 / 16)
    assert ranks.count_at(0.8) == pytest.approx(2)
    # The curve comes back to 0.65 after it was below.
    assert ranks.count_at(0.65) == pytest.approx(11 / 4)
    assert ranks.count_at(0.0) == pytest.approx(11 / 4)
    # 0.7 is below 0.9 and 0.8, and above 0.6.
    assert ranks.auc == pytest.approx(2 / 3)


def test_equal_scores_come_as_one():
    ranks = ranked([0.5, 0.5, 0.4], [True, False, True])
    repeated, rates = ranks.curve()
    assert (repeated.tolist(), rates.tolist()) == ([1.0, 2.0], pytest.approx([1 / 2, 2 / 3]))
    assert ranks.count_at(0.8) == 0.0
    assert ranks.auc == 0.25  # An equal one is half below; the other is above.


def test_nothing_is_ranked():
    nothing = RankedRepeats()
    assert math.isnan(nothing.rate)
    assert math.isnan(nothing.auc)
    assert nothing.count_at(0.8) == 0.0
    assert math.isnan(ranked([1.0], [True]).auc)


def test_corners_of_another_place():
    """The other scanner stands at (1, 0) and looks to the left: its (2, 0) is (1, 2) here."""
    here, there = ring(), ring((1.0, 0.0, math.pi / 2))
    ranks = ranked_repeats(
        here,
        corners_at((1.0, 2.09), (-1.0, 0.0)),
        there,
        corners_at((2.0, 0.0), (0.0, 3.0), (-6.0, 0.0), (0.0, 2.0)),
        np.array([0.9, 0.5, 0.7, 0.4]),
    )
    # The third is behind the wall; of the others (-2, 0) is not found, (-1, 0) is.
    assert ranks.scores.tolist() == [0.9, 0.5, 0.4]
    assert ranks.repeated.tolist() == [True, False, True]


def test_matched_one_to_one():
    scan = ring()
    twice = corners_at((2.0, 0.0), (2.02, 0.0))
    ranks = ranked_repeats(scan, corners_at((2.01, 0.0)), scan, twice, np.ones(2))
    assert ranks.repeated.sum() == 1


@pytest.mark.parametrize(
    ("beams", "view", "chance"), [(720, 2 * math.pi, 1 / 24), (361, math.pi, 1 / 12)]
)
def test_chance_is_the_share_of_turns_in_sight_that_find_something(beams, view, chance):
    """One of 24 turns puts (2, 0) near the second corner; half of them are in half a circle.

    The third corner is at the middle of them, 180°, which is no turn, and the fourth is at one that
    half a circle does not show.
    """
    scan = ring(beams=beams, view=view)
    behind = corners_at() if beams == 720 else corners_at(turned(2.0, FIRST + 10 * STEP))
    found = corners_at((2.05, 0.0), turned(2.095, FIRST), (-2.0, 0.0), n=beams)
    found.corners = np.concatenate((found.corners, behind.corners))
    others = corners_at((2.0, 0.0), (3.0, 0.0), n=beams)
    ranks = ranked_repeats(scan, found, scan, others, np.ones(2))
    assert ranks.chance == pytest.approx([chance, 0.0])
    assert ranks.repeated.tolist() == [True, False]


def test_gate():
    scan = ring()
    for gate, again in ((0.1, False), (0.2, True)):
        ranks = ranked_repeats(
            scan, corners_at((2.15, 0.0)), scan, corners_at((2.0, 0.0)), np.ones(1), gate=gate
        )
        assert ranks.repeated.tolist() == [again]


def test_without_poses():
    nothing = corners_at()
    with pytest.raises(ValueError, match="other_scan has no pose"):
        ranked_repeats(ring(), nothing, ring(pose=None), nothing, np.ones(0))
    with pytest.raises(ValueError, match=r"^scan has no pose"):
        ranked_repeats(ring(pose=None), nothing, ring(), nothing, np.ones(0))
    assert len(ranked_repeats(ring(), nothing, ring(), nothing, np.ones(0)).scores) == 0
