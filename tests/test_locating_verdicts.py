"""Verdicts of `locate` by the odds of the best pose over chance, others and the mirror image."""

import math
import sys
from dataclasses import replace

import numpy as np
import pytest
from small_room import RING, plan_of, query_at

from lineament import LaserScan
from lineament.mapping import LineMap, Query, locate
from lineament.mapping.evidence import Evidence
from lineament.mapping.following import Whereabouts, follow
from lineament.mapping.hypotheses import BOX, TURN
from lineament.mapping.index import MAPPED
from lineament.mapping.locate import (
    LEAD,
    UNKNOWN,
    VERDICTS,
    Location,
    _anywhere,
    _judged,
    _mixture,
    _near,
    distinct,
    located_near,
    squares_off,
)
from lineament.mapping.refine import adjusted

POSE, PLAN = (0.3, -0.2, 0.7), plan_of(RING)
SURE, ROOM = math.log(1000), 500.0
LOCATED, AMBIGUOUS, UNOBSERVED, LOST = VERDICTS
ALL = Evidence(50.0, 1.0, 0.0, 0.0, 100)
#: The package has the function under this name.
MODULE = sys.modules["lineament.mapping.locate"]


@pytest.mark.parametrize(
    ("odds", "other", "contradicted", "verdict"),
    [
        (SURE + 0.1, -9.0, 0.0, LOCATED),
        (SURE - 0.1, -9.0, 0.0, LOST),
        (SURE + 50, -9.0, 0.049, LOCATED),
        (SURE + 50, -9.0, 0.051, LOST),
        (SURE + 50, 50 - 0.1, 0.0, LOCATED),
        (SURE + 50, 50 + 0.1, 0.0, AMBIGUOUS),
    ],
)
def test_the_best_pose_is_a_thousand_times_likelier_than_chance_and_others(
    odds, other, contradicted, verdict
):
    chance, poses = math.log(ROOM), np.array([POSE, (1.0, 1.0, 1.0)])
    found = np.array([(odds + chance, 0.8, 0.2, contradicted), (other + chance, 0.5, 0.5, 0.0)])
    where = _judged(poses, found, query_at(POSE, PLAN), PLAN, ROOM)
    assert where.verdict == verdict
    assert where.evidence.log_odds == pytest.approx(odds)
    assert (where.evidence.explained, where.evidence.contradicted) == (0.8, contradicted)
    np.testing.assert_allclose(where.pose, POSE, atol=1e-6)
    if verdict == AMBIGUOUS:
        ((pose, evidence),) = where.alternatives
        assert pose == pytest.approx((1.0, 1.0, 1.0))
        assert evidence.log_odds == pytest.approx(other)
    else:
        assert where.alternatives == []


@pytest.mark.parametrize(("sigma", "verdict"), [(0.13, LOCATED), (0.17, UNOBSERVED)])
def test_a_direction_is_unobserved_that_is_known_worse_than_15_cm(sigma, verdict):
    """One wall of the plan says where the pose is along a corridor, and it is known so well."""
    c, s = math.cos(0.4), math.sin(0.4)
    ends = np.array([(-9, -1, 9, -1), (9, -1, 9, 1), (9, 1, -9, 1)]).reshape(-1, 2)
    walls = LineMap.from_lines((ends @ [[c, s], [-s, c]]).reshape(-1, 4), side=1).walls.copy()
    walls["covariance"] = np.diag((1e-3, 1e-3)) ** 2
    walls["covariance"][1, 0, 0] = sigma**2
    plan = LineMap(walls)
    pose = (0.5, 0.1, 0.2)
    where = _judged(np.array([pose]), np.array([(99, 1, 0, 0)]), query_at(pose, plan), plan, ROOM)
    assert where.verdict == verdict
    values = np.linalg.eigvalsh(where.covariance[:2, :2])
    assert math.sqrt(values[1]) == pytest.approx(sigma, rel=0.03)
    if verdict == UNOBSERVED:
        assert abs(np.dot(where.unobserved, (c, s))) > 0.999


@pytest.mark.parametrize(
    ("control", "contradicted", "verdict"),
    [
        (-3.1, 0.0, LOCATED),
        (-2.9, 0.0, AMBIGUOUS),
        (SURE - 0.1, 0.0, AMBIGUOUS),
        (SURE + 0.1, 0.0, LOST),
        (-9.0, 0.029, LOCATED),
        (-9.0, 0.031, LOST),
    ],
)
def test_the_mirror_image_does_worse(monkeypatch, control, contradicted, verdict):
    """By e³; where it does a thousand times better, this is another place."""
    query, answers = query_at(POSE, PLAN), []
    answers.append((np.array([POSE]), np.array([(60.0, 0.9, 0.1, contradicted)])))
    answers.append((np.array([POSE]), np.array([(60.0 + control, 0.9, 0.1, 0.0)])))
    given = iter(answers)
    monkeypatch.setattr(MODULE, "_searched", lambda *_: next(given))
    assert locate(query, PLAN).verdict == verdict
    # With a guess it is not asked.
    given = iter(answers)
    assert locate(query, PLAN, POSE).verdict == LOCATED


def test_chance_is_one_in_the_poses_that_a_plan_has_room_for(monkeypatch):
    found = np.array([POSE]), np.array([(60.0, 0.9, 0.1, 0.0)])
    monkeypatch.setattr(MODULE, "_searched", lambda *_: found)
    where = locate(query_at(POSE, PLAN), PLAN)
    room = 7.0 * 5.0 / BOX**2 * 2 * math.pi / TURN
    assert where.evidence.log_odds == pytest.approx(60 - math.log(room))


def test_on_a_map_of_scans_more_beams_may_pass_through_walls(monkeypatch):
    """Not as on a drawing; other poses and the mirror image have to be farther behind."""
    drawn, mapped = PLAN, LineMap(PLAN.walls, sigma=MAPPED)
    assert (drawn.is_mapped, mapped.is_mapped) == (False, True)
    query, poses = query_at(POSE, PLAN), np.array([POSE, (1.5, 0.5, 0.7)])
    shares = 0.82, 0.1, 0.08
    for plan, behind, verdict in (
        (drawn, 99.0, LOST),
        (mapped, 99.0, LOCATED),
        (mapped, LEAD + 0.1, LOCATED),
        (mapped, LEAD - 0.1, AMBIGUOUS),
    ):
        found = np.array([(99.0, *shares), (99.0 - behind, 0.5, 0.4, 0.1)])
        assert _judged(poses, found, query, plan, ROOM).verdict == verdict
    # The best pose on the map of another building is like that.
    found = np.array([(99.0, 0.35, 0.35, 0.3), (0.0, 0.1, 0.4, 0.5)])
    assert _judged(poses, found, query, mapped, 1e6).verdict == LOST
    # What is more than 18 nats likelier than that has to lead the mirror image by 12.
    for ahead, verdict in ((LEAD + 0.1, LOCATED), (LEAD - 0.1, AMBIGUOUS)):
        assert beside_the_mirror_image(monkeypatch, mapped, 0.99, ahead) == verdict


def beside_the_mirror_image(monkeypatch, plan, explained, ahead, odds=60.0):
    """Verdict on a pose that explains so much, and is so far ahead of the mirror image."""
    of_best = np.array([(odds, explained, 1 - explained, 0.0)])
    rows = iter([of_best, np.array([(odds - ahead, 0.9, 0.1, 0.0)])])
    monkeypatch.setattr(MODULE, "_searched", lambda *_: (np.array([POSE]), next(rows)))
    query = query_at(POSE, PLAN)
    return _anywhere(replace(query, beams=np.repeat(query.beams, 2, axis=0)), plan).verdict


@pytest.mark.parametrize(("is_mapped", "both"), [(False, 18.0), (True, 30.0)])
def test_what_hardly_passes_one_limit_has_to_pass_the_other_by_more(monkeypatch, is_mapped, both):
    """The odds over chance and the lead over the mirror image together exceed a limit."""
    plan = LineMap(PLAN.walls, sigma=MAPPED) if is_mapped else PLAN
    n = 2 * len(query_at(POSE, PLAN).beams) / 3
    chance = math.log(7.0 * 5.0 / BOX**2 * 2 * math.pi / TURN)
    for share in (0.60, 0.66):
        over = share * math.log(0.80 / 0.39) + (1 - share) * math.log(0.17 / 0.33)
        odds = chance + 8.0
        ahead = both - (over * n if is_mapped else 8.0)
        assert ahead > (LEAD if is_mapped else 3.0)
        assert beside_the_mirror_image(monkeypatch, plan, share, ahead + 0.1, odds) == LOCATED
        assert beside_the_mirror_image(monkeypatch, plan, share, ahead - 0.1, odds) == AMBIGUOUS


def test_a_prior_favours_the_poses_near_it_on_a_map():
    """Of a graph, not of a claim: by the poses that chance does not have. On a drawing always."""
    mapped, query = LineMap(PLAN.walls, sigma=MAPPED), query_at(POSE, PLAN)
    covariance = np.diag((0.3, 0.3, 0.1)) ** 2
    tried = len(_near(POSE, covariance, query, PLAN))
    room = 7.0 * 5.0 / BOX**2 * 2 * math.pi / TURN
    for plan, favour in ((mapped, math.log(room / tried)), (PLAN, 0.0)):
        claim = locate(query, plan, POSE, covariance)
        prior = located_near(query, plan, POSE, covariance, is_prior=True)
        off = prior.evidence.log_odds - claim.evidence.log_odds
        assert off == pytest.approx(favour)
        assert prior.pose == claim.pose


def test_a_map_may_be_as_exact_as_a_drawing(monkeypatch):
    """What is not found as on a map of scans is looked for as on a drawing."""
    mapped, looked_at = LineMap(PLAN.walls, sigma=MAPPED), []
    places = {
        True: Location(LOST, POSE, UNKNOWN, ALL),
        False: Location(LOCATED, POSE, UNKNOWN, ALL),
    }

    def anywhere(_, plan):
        looked_at.append((plan.is_mapped, plan.sigma))
        return places[plan.is_mapped]

    monkeypatch.setattr(MODULE, "_anywhere", anywhere)
    query = query_at(POSE, PLAN)
    found = locate(query, mapped)
    assert (found.verdict, found.pose) == (LOCATED, POSE)
    # Its walls are as far off as before: those of four sides, and of each side two.
    added = found.covariance - UNKNOWN
    assert 0.3 * MAPPED < math.sqrt(added[0, 0]) < MAPPED
    assert 0.3 * MAPPED < math.sqrt(added[1, 1]) < MAPPED
    assert looked_at == [(True, MAPPED), (False, 0.0)]
    places[False] = Location(AMBIGUOUS, POSE, UNKNOWN, ALL)
    assert locate(query, mapped) is places[True]
    places[True] = Location(LOCATED, POSE, UNKNOWN, ALL)
    looked_at.clear()
    assert locate(query, mapped) is places[True]
    assert len(looked_at) == 1
    assert locate(query, PLAN) is places[False]


@pytest.mark.parametrize(
    ("off", "behind", "variance", "left"),
    [
        ((0.08, 0.0, 0.0), 0.0, 0.0032, 0),  # as likely: half of the square
        ((0.08, 0.0, 0.0), math.log(3), 0.0016, 0),
        ((0.14, 0.0, 0.0), 0.0, 0.0098, 0),
        ((0.16, 0.0, 0.0), 0.0, 0.0, 1),  # too far to be one place
        ((5.0, 0.0, 0.0), 0.0, 0.0, 1),
        ((0.08, 0.0, 0.2), 0.0, 0.0, 1),  # turned
    ],
)
def test_poses_beside_the_best_are_one_place_that_is_known_less_well(off, behind, variance, left):
    best, known = np.array(POSE), np.diag((1e-6, 1e-6, 1e-8))
    others = [(tuple((best + off).tolist()), ALL)]
    covariance, rest = _mixture(best, known, others, np.exp([-behind]))
    assert covariance[0, 0] == pytest.approx(1e-6 + variance)
    assert covariance[1, 1] == 1e-6
    assert len(rest) == left


def test_poses_around_a_guess():
    """Within 2 σ by half a box; where there are more than 800, those within 4 σ that have votes."""
    query = query_at(POSE, PLAN)
    near = _near(POSE, None, query, PLAN)
    off = near - POSE
    assert len(near) == 9 * 9 * 9
    np.testing.assert_allclose(np.abs(off).max(axis=0), (1.0, 1.0, 2 * math.radians(10)))
    for axis, most in enumerate((BOX / 2, BOX / 2, TURN / 2)):
        assert 0 < np.diff(np.unique(np.round(off[:, axis], 9))).max() <= most + 1e-9
    spread = np.diag((2.0, 2.0, 1.0)) ** 2
    far = _near(POSE, spread, query, PLAN)
    np.testing.assert_allclose(far[0], POSE)
    squares = squares_off(far, POSE, spread)
    assert 1 < squares.max() < 16
    turned = np.array([(0.3, -0.2, 0.7 + 2 * math.pi - 0.1)])
    assert squares_off(turned, POSE, spread)[0] == pytest.approx(0.01)


def test_poses_that_are_chosen_are_apart():
    poses = np.array([(0, 0, 0), (0.14, 0, 0), (0, 0, 0.05), (0.16, 0, 0), (0, 0, 0.07), (9, 0, 0)])
    scores = np.array([6.0, 5, 4, 3, 2, 7])
    assert distinct(poses, scores, (0.15, 0.06), 9).tolist() == [5, 0, 3, 4]
    assert distinct(poses, scores, (0.15, 0.06), 2).tolist() == [5, 0]


@pytest.mark.parametrize("flipped", [False, True])
def test_a_turn_is_found_at_once_by_the_angles(flipped):
    query, n = query_at(POSE, PLAN), len(RING)
    walls = query.walls.copy()
    if flipped:
        walls["angle"] += math.pi
    known = np.kron(np.eye(n), np.diag((0.5, 1e-5)) ** 2)
    for turn in (0.3, -0.2):
        start = np.add(POSE, (0.0, 0.0, turn))
        pose, _ = adjusted(start, np.arange(n), Query(walls, known, query.beams), PLAN.index)
        assert pose[2] == pytest.approx(POSE[2], abs=1e-4)


def test_how_far_a_sweep_may_be_off_as_a_whole(monkeypatch):
    """By the change of the velocity and a tenth of it, over half the sweep of 0.1 s; 1 at first.

    And by what the velocity turns out to be beside the one that it was deskewed by.
    """
    twists, skews = iter([None, (2.0, 0.0, 0.5), (2.0, 0.0, 0.5), None]), []

    class Stub:
        twist, believes_odometry = None, True

        def __init__(self, plan):
            assert plan is PLAN

        def __call__(self, _, pose, skew):
            assert pose is None
            skews.append(skew)
            self.twist = next(twists)
            turned = 0.0, 0.0, math.pi / 2
            return Whereabouts("located", turned, np.zeros((3, 3)), Evidence(9.0, 1.0, 0.0, 0.0, 9))

    monkeypatch.setattr("lineament.mapping.following.Follower", Stub)
    scan = LaserScan([2.0] * 11, 0.0, 0.1, time_increment=0.01)
    found = list(follow([scan] * 4, PLAN, lambda straight: straight, odometry=False))
    expected = [(0.05, 0, 0.05), (0, 0, 0), (0.11, 0, 0.0275), (0.01, 0, 0.0025)]
    np.testing.assert_allclose(skews, expected, atol=1e-12)
    late = np.zeros((4, 3, 3))
    late[1] = np.outer((0, 0.1, 0.025), (0, 0.1, 0.025))
    np.testing.assert_allclose([where.covariance for _, where in found], late, atol=1e-12)
