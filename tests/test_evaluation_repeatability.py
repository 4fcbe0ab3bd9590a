"""Features found again from another place, and corners ranked by a score: worked by hand."""

import math

import numpy as np
import pytest
from handmade import corner, features, segment
from lineament_lab.evaluation import RankedRepeats, Repeatability, ranked_repeats, repeatability
from lineament_lab.evaluation.repeatability import in_sight

import lineament as ln
from lineament.simulation import Sensor, World

# A wall x = 3 and a pillar before its upper half, as the first scanner sees it.
WORLD = World([[3, -3, 3, 3], [1.5, 0.5, 1.5, 1.1]])
QUIET = Sensor("quiet", 361, -math.pi / 4, math.pi / 720, range_max=20.0)
HERE, THERE = (0.0, 0.0, 0.0), (2.0, -1.0, math.pi / 2)
SCAN, OTHER = (QUIET.scan(WORLD, pose, np.random.default_rng(0)) for pose in (HERE, THERE))

#: The first of the turns to which a corner is moved; and the step from one to the next of 24, the
#: last as far from the whole turn.
FIRST = math.radians(11.25)
STEP = (2 * math.pi - 2 * FIRST) / 23


def corners_at(*positions, n=100):
    return features(n, corners=[corner(*p) for p in positions])


def seen_from(pose, found):
    """Features of the world frame in that of a sensor."""
    x, y, theta = pose
    return found.transform(-x, -y, 0).transform(0, 0, -theta)


def ring(pose=(0.0, 0.0, 0.0), beams=720, view=2 * math.pi):
    """Return a scan of a round room of 5 m, over all or half of the circle."""
    return ln.LaserScan([5.0] * beams, -view / 2, math.radians(0.5), pose=pose)


def at(radius, angle):
    return radius * math.cos(angle), radius * math.sin(angle)


def ranked(scores, repeated, chance=0.0):
    chances = np.full(len(scores), chance)
    return RankedRepeats(np.array(scores), np.array(repeated, dtype=bool), chances)


def test_in_sight_by_hand():
    points = {
        (2.0, 0.0): True,  # before the wall
        (3.05, 0.0): True,  # on it
        (3.2, 0.0): False,  # behind it
        (3.0, 1.4): False,  # on it, behind the pillar
        (1.5, 0.8): True,  # on the pillar
        (0.0, 2.0): False,  # outside of the field of view
        (-1.0, 0.0): False,
    }
    assert in_sight(SCAN, np.array(list(points)), 0.1).tolist() == list(points.values())
    # Nothing is known if nothing returned, or beyond the limits.
    blind = ln.LaserScan([np.inf] * 90, -math.pi / 4, math.pi / 180, range_max=20.0)
    assert not in_sight(blind, np.array([[2.0, 0.0]]), 0.1).any()
    short = ln.LaserScan([2.9] * 90, -math.pi / 4, math.pi / 180, range_min=2.0, range_max=3.0)
    apart = np.array([[1.99, 0.0], [2.01, 0.0], [2.99, 0.0], [3.0, 0.0]])
    assert in_sight(short, apart, 0.2).tolist() == [False, True, True, False]
    assert in_sight(ln.LaserScan([], 0.0, 0.1), np.zeros((2, 2)), 0.1).tolist() == [False] * 2


def test_in_sight_around_the_circle():
    n = 360
    around = ln.LaserScan([2.0] * n, math.pi / 3, 2 * math.pi / n, range_max=20.0)
    bearings = np.random.default_rng(0).uniform(-10, 10, 200)
    points = np.column_stack((np.cos(bearings), np.sin(bearings)))
    assert in_sight(around, 1.99 * points, 0.1).all()
    assert not in_sight(around, 2.2 * points, 0.1).any()


def test_repeated_corners_by_hand():
    here = seen_from(HERE, corners_at((3, 0), (3, -1), (3, 0.3)))
    there = corners_at((3, 0.04), (3, -0.5), (3, 1.4), (5, 0), (3, -2.9))
    found = repeatability(SCAN, here, OTHER, seen_from(THERE, there))
    # Found again; not found again; hidden by the pillar; behind the wall; in view, not found.
    assert (found.corners.expected, found.corners.repeated) == (3, 1)
    assert found.corners.rate == 1 / 3
    assert found.corners.rmse == pytest.approx(0.04)
    assert found.segments.expected == 0
    twice = found + found
    assert (twice.corners.expected, twice.corners.repeated) == (6, 2)


@pytest.mark.parametrize(
    ("there", "expected", "repeated"),
    [
        (((3, -2), (3, 0.5)), 1, 1),
        (((3, -2.9), (3, 2.9)), 1, 1),  # longer than what is seen of it from here
        (((3.04, -2), (3.04, 0.5)), 1, 1),
        (((2.85, -2), (2.85, 0.5)), 1, 0),  # too far before it
        (((3, 0.5), (3, -2)), 0, 0),  # its back
        (((3, 1.2), (3, 1.9)), 0, 0),  # hidden
        (((2.7, 0.0), (3.3, 0.6)), 1, 0),  # another direction
        (((3, -2.95), (3, -2.3)), 1, 0),  # a part that is not found here
    ],
)
def test_repeated_segments_by_hand(there, expected, repeated):
    here = features(segments=[segment((3, -2), (3, 1), 0, 50)])
    other = features(segments=[segment(*there, 0, 50)])
    found = repeatability(SCAN, here, OTHER, seen_from(THERE, other))
    assert (found.segments.expected, found.segments.repeated) == (expected, repeated)


def test_pieces_of_one_wall_are_found_again_once():
    here = features(segments=[segment((3, -2), (3, 1), 0, 50)])
    pieces = [segment((3.02, -2), (3.02, -1), 0, 20), segment((3, -0.9), (3, 0.1), 21, 40)]
    found = repeatability(SCAN, here, OTHER, seen_from(THERE, features(segments=pieces)))
    assert found.segments.expected == 2
    np.testing.assert_allclose(found.segments.distances, [0], atol=1e-12)  # the nearer one


@pytest.mark.parametrize(
    ("start", "end", "distance"),
    [
        # Above y = 1 it is behind the pillar, and goes on beyond the segment that is found here.
        ((3.04, -2), (3.04, 2), 0.04),
        # Of its 16 places, 10 cm apart, half are within the gate of the end: one at 5 cm, the
        # others on the segment; the eight beyond count as the gate.
        ((3, -2.9), (3, -1.3), (8 * 0.10 + 0.05) / 16),
    ],
)
def test_the_distance_of_a_segment_is_that_of_its_places_in_sight(start, end, distance):
    here = features(segments=[segment((3, -2), (3, 1), 0, 50)])
    there = features(segments=[segment(start, end, 0, 50)])
    found = repeatability(SCAN, here, OTHER, seen_from(THERE, there))
    assert found.segments.rmse == pytest.approx(distance)


def test_refusals():
    lost, nothing, none = ring(pose=None), features(720), np.ones(0)
    with pytest.raises(ValueError, match="other_scan has no pose"):
        repeatability(ring(), nothing, lost, nothing)
    with pytest.raises(ValueError, match=r"^scan has no pose"):
        ranked_repeats(lost, nothing, ring(), nothing, none)
    with pytest.raises(ValueError, match=r"gate is -1, expected a distance > 0"):
        repeatability(ring(), nothing, ring(), nothing, gate=-1)
    assert math.isnan(repeatability(ring(), nothing, ring(), nothing).corners.rate)
    assert len(ranked_repeats(ring(), nothing, ring(), nothing, none).scores) == 0
    assert Repeatability.total([]).segments.expected == 0


def test_curve_with_chance_taken_off():
    """Of the best 1, 2, 3, 4 are found 1, 1, 2/3, 3/4; with a fifth by chance (r - 0.2)/0.8."""
    ranks = ranked([0.6, 0.9, 0.7, 0.8], [True, True, False, True], 0.2)
    repeated, rates = ranks.curve()
    assert rates == pytest.approx([1, 1, 7 / 12, 11 / 16])
    assert repeated == pytest.approx([1, 2, 7 / 4, 11 / 4])
    assert ranks.rate == pytest.approx(11 / 16)
    # The curve comes back to 0.65 after it was below.
    assert [ranks.count_at(r) for r in (0.8, 0.65, 0.0)] == pytest.approx([2, 11 / 4, 11 / 4])
    # 0.7 is below 0.9 and 0.8, and above 0.6.
    assert ranks.auc == pytest.approx(2 / 3)
    assert ranks.rate_between(0.7, 0.9) == pytest.approx((1 / 2 - 0.2) / 0.8)


def test_equal_scores_come_as_one():
    ranks = ranked([0.5, 0.5, 0.4], [True, False, True])
    repeated, rates = ranks.curve()
    assert (repeated.tolist(), rates.tolist()) == ([1.0, 2.0], pytest.approx([1 / 2, 2 / 3]))
    assert ranks.count_at(0.8) == 0.0
    assert ranks.auc == 0.25  # An equal one is half below; the other is above.


def test_nothing_is_ranked():
    nothing = RankedRepeats()
    assert all(map(math.isnan, (nothing.rate, nothing.auc, ranked([1.0], [True]).auc)))
    assert nothing.count_at(0.8) == 0.0


def test_ranked_corners_of_another_place():
    """The other scanner stands at (1, 0) and looks to the left: its (2, 0) is (1, 2) here."""
    here, there = ring(), ring(pose=(1.0, 0.0, math.pi / 2))
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


@pytest.mark.parametrize(
    ("found", "others", "gate", "repeated"),
    [
        ([(2.01, 0.0)], [(2.0, 0.0), (2.02, 0.0)], 0.1, 1),  # one to one
        ([(2.15, 0.0)], [(2.0, 0.0)], 0.1, 0),
        ([(2.15, 0.0)], [(2.0, 0.0)], 0.2, 1),
    ],
)
def test_ranked_corners_are_matched_one_to_one_within_the_gate(found, others, gate, repeated):
    scan, scores = ring(), np.ones(len(others))
    ranks = ranked_repeats(scan, corners_at(*found), scan, corners_at(*others), scores, gate=gate)
    assert ranks.repeated.sum() == repeated


@pytest.mark.parametrize(
    ("beams", "view", "chance", "turn"),
    [(720, 2 * math.pi, 1 / 24, 0.0), (720, 2 * math.pi, 1 / 24, 1.0), (361, math.pi, 1 / 12, 0.0)],
)
def test_chance_is_the_share_of_turns_in_sight_that_find_something(beams, view, chance, turn):
    """One of 24 turns puts (2, 0) near the second corner; half of them are in half a circle.

    The third corner is at the middle of them, 180°, which is no turn, and the fourth is at one that
    half a circle does not show.
    """
    scan = ring(beams=beams, view=view)
    behind = [] if beams == 720 else [at(2.0, FIRST + 10 * STEP)]
    found = corners_at((2.05, 0.0), at(2.095, FIRST), (-2.0, 0.0), *behind, n=beams)
    others = corners_at((2.0, 0.0), (3.0, 0.0), n=beams)
    found, others = (some.transform(0, 0, turn) for some in (found, others))
    ranks = ranked_repeats(scan, found, scan, others, np.ones(2))
    assert ranks.chance == pytest.approx([chance, 0.0])
    assert ranks.repeated.tolist() == [True, False]
