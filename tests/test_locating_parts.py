"""Parts of locating by hand-worked cases: local maps, votes, evidence, what is followed."""

import math
from dataclasses import replace

import numpy as np
import pytest
from handmade import features
from robot_driving import MOUNTING, driven
from small_room import RING, plan_of, query_at, scans_on

from lineament import Extractor, LaserScan, RangeNoise, Tracker
from lineament.mapping import LineMap, LocalMap, Query, locate
from lineament.mapping.evidence import ON_DRAWING, Evidence, evidence_of
from lineament.mapping.following import Follower
from lineament.mapping.hypotheses import agreement, anchors, hypotheses, spectrum
from lineament.mapping.local_map import beams_of, moved_beams, query_of_scan, thinned
from lineament.mapping.locate import Location, _searched
from lineament.mapping.refine import adjusted, refined
from lineament.scan.poses import compose
from lineament.simulation import office
from lineament.walls import walls_of


def test_the_mirror_image_lies_on_the_mirrored_plan_as_the_view_does_on_the_plan():
    pose, plan, image = (0.3, -0.2, 0.7), plan_of(RING), plan_of(RING[::-1] * (1, -1))
    query = query_at(pose, plan)
    for off in (0.0, 0.06):
        seen, mirrored = (
            evidence_of(np.array([place]), of.beams, on.index, 0.02)
            for of, on, place in (
                (query, plan, (0.3 + off, -0.2, 0.7)),
                (query.mirrored(), image, (0.3 + off, 0.2, -0.7)),
            )
        )
        np.testing.assert_allclose(mirrored, seen, rtol=1e-9)
    here, there = locate(query, plan, pose), locate(query.mirrored(), image, (0.3, 0.2, -0.7))
    np.testing.assert_allclose(there.pose, np.array(here.pose) * (1, -1, -1), atol=1e-9)
    signs = np.array((1, -1, -1))
    np.testing.assert_allclose(there.covariance, here.covariance * np.outer(signs, signs))
    np.testing.assert_allclose(query.mirrored().mirrored().beams, query.beams)
    # An offset and an angle to the left are to the right of the image.
    query.walls["covariance"] = [[4.0, 1.0], [1.0, 2.0]]
    mirrored = query.mirrored().walls["covariance"]
    np.testing.assert_array_equal(
        mirrored, np.broadcast_to([[4.0, -1.0], [-1.0, 2.0]], mirrored.shape)
    )


def test_beams_end_at_the_same_places_in_another_frame():
    """With the covariance of these places, by differences of the pose that they are seen from."""
    plan, pose = plan_of(RING), (0.3, -0.2, 0.7)
    beams = query_at(pose, plan).beams.copy()
    beams[:, :2] = 0.0
    root = np.array([[0.02, 0, 0], [0.01, 0.03, 0], [0.004, -0.003, 0.01]])

    def ends(place):
        moved = moved_beams(beams, tuple(place), root @ root.T)
        return moved[:, :2] + moved[:, 4:5] * moved[:, 2:4], moved

    here, moved = ends(pose)
    c, s = math.cos(0.7), math.sin(0.7)
    seen = (beams[:, 4:5] * beams[:, 2:4]) @ np.array([[c, s], [-s, c]]) + (0.3, -0.2)
    np.testing.assert_allclose(here, seen, atol=1e-12)
    np.testing.assert_allclose(moved[:, 4:7], beams[:, 4:7])
    steps = [(ends(np.add(pose, 1e-6 * step))[0] - here) / 1e-6 for step in root.T]
    spread = np.einsum("kni,knj->nij", steps, steps)
    np.testing.assert_allclose(moved[:, 7:], spread.reshape(-1, 4)[:, (0, 1, 3)], rtol=1e-4)


def test_beams_know_their_noise_or_are_known_to_2_cm():
    ranges = [1.0, 2.0, math.nan, 10.0]
    scan = LaserScan(ranges, 0.0, 0.5)
    for noise, sigmas in (
        (None, (0.02, 0.02, 0.02)),
        (RangeNoise(0.03, proportional=0.02), np.hypot(0.03, (0.02, 0.04, 0.2))),
    ):
        found = replace(features(), noise=noise)
        beams = beams_of(found, scan)
        np.testing.assert_allclose(np.arctan2(beams[:, 3], beams[:, 2]), (0.0, 0.5, 1.5))
        np.testing.assert_allclose(beams[:, 4], (1.0, 2.0, 10.0))
        np.testing.assert_allclose(beams[:, 5], np.square(sigmas))


def test_one_beam_is_kept_of_those_that_end_in_a_square_and_no_more_than_160():
    beams = np.zeros((400, 10))
    beams[:, 2], beams[:, 4] = 1.0, 0.125 + 0.0625 * np.arange(400)  # four to a square
    beams[:, 5] = np.arange(400)
    ends = np.floor(beams[:, 4] / 0.25)
    kept = thinned(beams[:300])
    np.testing.assert_array_equal(np.floor(kept[:, 4] / 0.25), np.unique(ends[:300]))
    assert kept[:, 5].tolist() == [0, *range(2, 300, 4)]
    aside = np.concatenate((beams, beams, beams))
    aside[:, 1] = np.repeat((-0.1, 0.1, 0.3), 400)
    few = thinned(aside)
    assert len(few) == 160 < len(np.unique(ends)) * 3
    np.testing.assert_array_equal(few[[0, -1]], aside[[0, 1198]])


def test_a_local_map_keeps_a_scan_for_each_0_3_m_or_15_degrees():
    """Scans between those that are kept replace each other: the way from the one kept before."""
    extract = Extractor()
    for step, turn, count, length in ((0.11, 0.0, 4, 0.99), (0.01, 0.14, 6, 0.09)):
        tracker, local = Tracker(), LocalMap()
        for scan in scans_on(step * np.arange(10), turn=turn):
            found = extract(scan)
            local.add(found, tracker(found, scan.pose), scan.pose)
        # 0.33, 0.66, 0.99 m; 0.28, 0.56, ... 1.26 rad.
        assert repr(local) == f"LocalMap({count} scans, {length:.1f} m)"


@pytest.mark.parametrize("way", [0.0, 0.5, 1.0])
def test_a_query_reaches_back_by_a_way(way):
    """Beams of the scans on it: the first place is where the scan was taken."""
    tracker, local, extract = Tracker(roughness=0.0), LocalMap(way=1.7, roughness=0.0), Extractor()
    for scan in scans_on(-1.0 + 0.4 * np.arange(7)):
        found = extract(scan)
        local.add(found, tracker(found, scan.pose), scan.pose)
    # What is farther back than 1.7 m is forgotten.
    for of, kept in ((way, int(way / 0.4 + 1e-9)), (math.inf, 4)):
        origins = np.unique(np.round(local.query(of).beams[:, 0], 2))
        np.testing.assert_allclose(origins, -0.4 * np.arange(kept, -1, -1.0), atol=0.02)


@pytest.mark.parametrize("flipped", [False, True])
@pytest.mark.parametrize("at", [(0.0,), (4.0,), (-3.0, 4.0)])
def test_errors_of_a_wall_of_the_plan_are_those_of_all_that_is_seen_of_it(at, flipped):
    """A wall known to 1 mm and 10 mrad moves and turns the pose with it, wherever it is seen."""
    plan = LineMap.from_lines([[-5, 0, 5, 0], [0, -5, 0, 5]])
    plan.walls.flags.writeable = True
    plan.walls["covariance"] = np.diag((1e-6, 1e-4)), np.diag((1e-6, 1.0))
    n, pairs = len(at) + 1, np.array([*[0] * len(at), 1])
    walls = plan.walls[pairs].copy()
    walls["centroid"][: len(at), 0] = at
    own = np.array([[1e-10, 2e-11], [2e-11, 1e-10]])
    if flipped:  # Its left is the other way, and turns are the same.
        walls["angle"] += math.pi
        own = own * [[1, -1], [-1, 1]]
    query = Query(walls, np.kron(np.eye(n), own), np.zeros((0, 10)))
    pose, information = adjusted(np.array((1e-3, -2e-3, 3e-4)), pairs, query, plan.index)
    np.testing.assert_allclose(pose, 0.0, atol=1e-4)
    spread = np.linalg.inv(information)
    np.testing.assert_allclose(np.diag(spread), (1e-6, 1e-6, 1e-4), rtol=0.05)


def directions(local, walls):
    return agreement(spectrum(local), spectrum(walls))


def test_walls_of_a_turned_room_agree_with_its_turn():
    """All of it at the turn, hardly any between; no more of a wall than 10 m counts."""
    plan = plan_of(RING)
    votes = directions(query_at((0.3, -0.2, math.radians(50)), plan).walls, plan.walls)
    assert votes.shape == (360,)
    assert votes.argmax() == 50
    assert votes[50] == pytest.approx(1.0)
    assert votes.min() < 1e-6
    assert votes[[5, 95, 185, 275]].max() < 0.01
    # Two walls of 10 m and one of 50 m, at right angles: half of the votes and less.
    ends = [[0, 0, 50, 0], [0, 0, 0, 10], [3, 0, 3, 10]]
    lines = walls_of(np.reshape(ends, (-1, 2, 2)).astype(float), side=1)
    votes = directions(lines, lines)
    # Lengths of 10 and 20 m: 100 + 400 along each other, 200 across.
    assert votes[90] == pytest.approx(200 / 500)
    # Those that may be seen from either side agree with half a turn, too.
    either = walls_of(np.reshape(ends, (-1, 2, 2)).astype(float))
    votes = directions(lines, either)
    np.testing.assert_allclose(votes, np.roll(votes, 180), atol=1e-9)


@pytest.mark.parametrize("most", [1, 5, 20, 10**6])
def test_the_poses_with_the_most_votes_are_tried(most):
    pose, plan = (0.3, -0.2, 0.7), plan_of(RING)
    query = query_at(pose, plan)
    local, votes = anchors(query.walls, query.corners), directions(query.walls, plan.walls)
    every = hypotheses(local, plan.anchors, votes, 10**7)
    found = hypotheses(local, plan.anchors, votes, most)
    np.testing.assert_array_equal(found, every[: min(most, len(every))])
    assert len(every) > 20
    np.testing.assert_allclose(found[0], pose, atol=0.05)


@pytest.mark.parametrize("theta", [0.0, 1.1])
def test_poses_some_way_along_the_walls_are_looked_at(theta):
    """In a corridor that leads by 0.3 rad, from one pose alone."""
    c, s = math.cos(0.3), math.sin(0.3)
    ends = np.array([[-100, -1, 100, -1], [100, 1, -100, 1]]).reshape(-1, 2) @ [[c, s], [-s, c]]
    plan = LineMap.from_lines(ends.reshape(-1, 4), side=1)
    poses, _ = _searched(np.array([(0.5, 0.2, theta)]), query_at((0.5, 0.2, theta), plan), plan)
    off = (poses[:, :2] - (0.5, 0.2)) @ np.array([[c, -s], [s, c]])
    steps = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0]
    np.testing.assert_allclose(
        np.sort(off[:, 0]), sorted([0, *steps, *np.negative(steps)]), atol=1e-3
    )
    np.testing.assert_allclose(off[:, 1], 0, atol=1e-3)


def test_what_beams_say_of_a_pose():
    """Of 30 beams onto a wall 2 m ahead, so many end 1 m before and behind it."""
    plan, beams = LineMap.from_lines([[2, -10, 2, 10]]), np.zeros((30, 10))
    beams[:, 2], beams[:, 4], beams[:, 6] = 1.0, 2.0, 1.0
    beams[:, 1] = np.linspace(-1, 1, 30)
    for short, behind in ((0, 0), (9, 0), (0, 6), (12, 3)):
        seen = beams.copy()
        seen[:short, 4], seen[short : short + behind, 4] = 1.0, 3.0
        odds, *shares = evidence_of(np.zeros((1, 3)), seen, plan.index, 0.02)[0]
        hits = 30 - short - behind
        # As often at a right pose over a wrong one: 70 to 30, 28 to 40, 2 to 30; of three beams
        # that are near each other one counts.
        says = hits * (math.log(70 / 30) + 0.5) + short * math.log(0.7) + behind * math.log(2 / 30)
        assert odds == pytest.approx(says / 3)
        np.testing.assert_allclose(shares, np.array((hits, short, behind)) / 30)
    assert not evidence_of(np.zeros((2, 3)), beams[:0], plan.index, 0.02).any()
    # What is known of a pose before adds to what beams say.
    poses, known = np.zeros((3, 3)), np.array((-2.0, 0.0, 5.0))
    alone, both = (evidence_of(poses, beams, plan.index, 0.02, before=k) for k in (0.0, known))
    np.testing.assert_allclose(both[:, 0], alone[:, 0] + known)
    np.testing.assert_array_equal(both[:, 1:], alone[:, 1:])


@pytest.mark.parametrize("opens", [False, True])
def test_on_a_map_a_beam_that_ends_on_a_wall_may_pass_others(opens):
    """Windows, lattices and doors: of 30 beams, 20 pass one, and 10 of them end on the next."""
    beams, says = np.zeros((30, 10)), ON_DRAWING._replace(opens=opens)
    beams[:, 2], beams[:, 6] = 1.0, 1.0
    beams[:, 1], beams[:, 4] = np.linspace(-1, 1, 30), np.repeat((2.0, 4.0, 5.0), 10)
    plan = LineMap.from_lines([[2, -10, 2, 10], [4, -10, 4, 10]])
    _, *shares = evidence_of(np.zeros((1, 3)), beams, plan.index, 0.02, says)[0]
    np.testing.assert_allclose(shares, np.array((2, 0, 1) if opens else (1, 0, 2)) / 3)
    beams[:, 4] = 3.0
    _, *shares = evidence_of(np.zeros((1, 3)), beams, plan.index, 0.02, says)[0]
    np.testing.assert_allclose(shares, (0, 0, 1))


def follower(covariance, verdict="located"):
    """One whose pose is known, on a plan."""
    found = Follower(plan_of(RING))
    found._pose, found._covariance, found._verdict = (0.0, 0.0, 0.0), covariance, verdict
    return found


@pytest.mark.parametrize(
    ("deviations", "verdict"),
    [
        ((0.1, 0.29, 0.14), "located"),
        ((0.29, 0.1, 0.14), "located"),
        ((0.1, 0.31, 0.14), "direction unobserved"),
        ((0.74, 0.74, 0.14), "direction unobserved"),
        ((0.1, 0.76, 0.14), "not on this map"),
        ((0.1, 0.1, 0.16), "not on this map"),
    ],
)
def test_a_pose_is_lost_as_it_is_known_less(deviations, verdict):
    """Known to 30 cm in all directions; but for one; no better than 75 cm or 9°."""
    found = follower(np.diag(deviations) ** 2)
    found._move((0.0, 0.0, 0.0), np.zeros((3, 3)))
    assert found._verdict == verdict
    assert found.is_known == (verdict != "not on this map")


def test_a_pose_that_goes_on_is_known_less():
    """Each motion by its covariance; errors that motions share, by 5 mm and 2 mrad a root metre."""
    found, spread = follower(np.diag((0.01, 0.01, 0.001)) ** 2), np.diag((2e-3, 1e-3, 1e-3)) ** 2
    found._pose = 1.0, 2.0, math.pi / 2
    found._move((2.0, 0.0, 0.5), spread)
    np.testing.assert_allclose(found._pose, (1.0, 4.0, math.pi / 2 + 0.5))
    # Towards +y: along by 2 mm, beside by 1 mm and by the turn, 2 m away.
    x = 1e-4 + 1e-6 + (2 * 1e-3) ** 2 + 25e-6 * 2
    y = 1e-4 + 4e-6 + 25e-6 * 2
    theta = 1e-6 + 1e-6 + 4e-6 * 2.5
    np.testing.assert_allclose(np.diag(found._covariance), (x, y, theta))
    found._move((0.0, 0.0, -0.25), spread)
    assert found._since == found._turned == math.inf  # not looked yet


@pytest.mark.parametrize(
    ("duration", "odometry", "torn"),
    [
        (4.9, None, False),
        (5.1, None, True),
        (-4.9, None, False),
        (-5.1, None, True),
        (0.0, None, False),
        (98.0, (4.9, 4.0, 3.0), False),
        (98.0, (3.0, 6.1, 0.0), True),
        (-4.9, (3.0, 4.0, 0.0), False),
        (-5.1, (3.0, 4.0, 0.0), True),
    ],
)
def test_scans_far_apart_are_not_of_one_drive(duration, odometry, torn):
    """By 5 s without odometry, by 2 m with it; or where the clock goes back by 5 s."""
    found = follower(np.eye(3))
    found._odometry = 3.0, 4.0, 0.0
    assert found._is_torn(duration, odometry) == torn


def location(verdict="located", odds=50.0, contradicted=0.0):
    evidence = Evidence(odds, 0.9, 0.1 - contradicted, contradicted, 100)
    return Location(verdict, (0.0, 0.0, 0.0), np.diag((0.01, 0.01, 0.002)) ** 2, evidence)


LOST, SURELY = "not on this map", math.log(1000)


@pytest.mark.parametrize(
    ("looks", "known"),
    [
        # Two looks that contradict are not too many; after a third the plan is looked at anew.
        ([location(LOST, -5.0)] * 2 + [location()], [True] * 4),
        ([location(LOST, -5.0)] * 3 + [location(LOST)], [True] * 4 + [False]),
        ([location(LOST, SURELY - 0.1)] * 3 + [location(LOST)], [True] * 4 + [False]),
        ([location(LOST, SURELY + 0.1)] * 4, [True] * 5),
        ([location(LOST, 50.0, 0.13)] * 3 + [location(LOST)], [True] * 4 + [False]),
        ([location(LOST, 50.0, 0.11)] * 4, [True] * 5),
        # Four looks that agree take back one that does not, three do not.
        ([location(LOST, -5.0)] * 2 + [location()] * 4 + [location(LOST, -5.0)] * 2, [True] * 9),
        (
            [location(LOST, -5.0)] * 2 + [location()] * 3 + [location(LOST, -5.0), location(LOST)],
            [True] * 7 + [False],
        ),
    ],
)
def test_looks_that_contradict_the_plan(monkeypatch, looks, known):
    """A sensor that stands, and looks at the plan with each scan, once a second."""
    answers = iter([location(), *looks])
    monkeypatch.setattr("lineament.mapping.following.locate", lambda *_: next(answers))
    found, extract = Follower(plan_of(RING)), Extractor()
    scan = next(scans_on([0.0]))
    wheres = [found(extract(scan.stamped("first", int(1.1e9 * k)))) for k in range(len(known))]
    assert [bool(where) for where in wheres] == known


def test_a_guess_that_somebody_says_is_as_sure_as_on_a_drawing(monkeypatch):
    """Also on a map, where what is looked for everywhere is only a hundred times likelier."""
    scan, guessed = next(scans_on([0.0])), 3
    for odds, is_known in ((SURELY + 0.1, True), (SURELY - 0.1, False)):
        looks = []

        def answer(*given, of=odds, looks=looks):
            looks.append(len(given) > 2)
            return location(odds=of) if looks[-1] else location(LOST, -5.0)

        monkeypatch.setattr("lineament.mapping.following.locate", answer)
        found, extract = Follower(LineMap(plan_of(RING).walls, sigma=0.045)), Extractor()
        found.suppose((0.1, 0.0, 0.0))
        for k in range(5):
            where = found(extract(scan.stamped("first", int(1.1e9 * k))))
            assert bool(where) == is_known
        expected = 5 if is_known else guessed
        assert sum(looks) == expected


@pytest.mark.parametrize("sigma", [0.0, 0.045])
def test_a_scan_that_chance_explains_as_well_is_not_of_the_place(monkeypatch, sigma):
    found, extract = Follower(LineMap(plan_of(RING).walls, sigma=sigma)), Extractor()
    scan = next(scans_on([0.0]))
    monkeypatch.setattr("lineament.mapping.following.locate", lambda *_: location())
    for odds, shares, is_known in (
        (0.1, (0.5, 0.5, 0.0), True),
        (-0.1, (0.5, 0.5, 0.0), False),
        (50.0, (0.5, 0.5, 0.0), True),
    ):
        rows = np.array([(odds, *shares)])
        monkeypatch.setattr("lineament.mapping.following.evidence_of", lambda *_, of=rows: of)
        assert bool(found(extract(scan))) == is_known


@pytest.mark.parametrize(
    ("step", "turn", "pace", "every"),
    [(0.11, 0.0, 0.01, 5), (0.0, 0.055, 0.01, 5), (0.0, 0.0, 0.3, 4), (0.0, 0.0, 0.1, 11)],
)
def test_the_plan_is_looked_at_each_half_metre_15_degrees_or_second(
    monkeypatch, step, turn, pace, every
):
    found, extract = Follower(plan_of(RING)), Extractor()
    wheres = []
    for k, scan in enumerate(scans_on(step * np.arange(12), turn=turn)):
        of_scan = location()
        answer = Location("located", scan.pose, of_scan.covariance, of_scan.evidence)
        monkeypatch.setattr("lineament.mapping.following.locate", lambda *_, got=answer: got)
        scan = scan.stamped("first", int(1e9 * pace * k))
        wheres.append(found(extract(scan), scan.pose))
    looked = [k for k, where in enumerate(wheres) if where.location is not None]
    assert looked == [*range(0, 12, every)]
    assert all(wheres)


def test_a_wall_far_off_is_not_paired_with_its_other_face():
    """From 9 cm and 0.1° off; 0.2 m behind a wall 10 m away is its other face."""
    moment, plan = driven(count=174)[-1], LineMap.from_lines(office(1, (30, 20)).plan.segments)
    true = compose(moment.base, MOUNTING)
    start = np.add([true], (0.033, -0.086, 0.0018))
    (found,), _, _ = refined(start, query_of_scan(Extractor()(moment.scan)), plan.index)
    np.testing.assert_allclose(found, true, atol=0.002)
