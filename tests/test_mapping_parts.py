"""Parts of maps and places by hand-worked cases: walls, lines, local maps, what is expected."""

import math

import numpy as np
import pytest
from handmade import features, segment

from lineament import Extractor, Tracker
from lineament.features import SEGMENT
from lineament.mapping import LineMap, LocalMap, Query, locate
from lineament.mapping.drive_map import Drive, _likely_turns
from lineament.mapping.evidence import evidence_of
from lineament.mapping.hypotheses import anchors, directions, hypotheses
from lineament.mapping.local_map import moved_beams, thinned
from lineament.mapping.locate import _searched
from lineament.mapping.making import single
from lineament.mapping.refine import adjusted
from lineament.mapping.sights import lines_of, merged, sights_of
from lineament.mapping.walls import walls_of
from lineament.simulation import SENSORS, World

#: A room without symmetry, its walls seen from inside.
RING = np.array([(-3, -2), (4, -2), (4, 1), (2, 1), (2, 3), (-1, 3), (-1, 2.4), (-3, 2.4)], float)


def plan_of(ring):
    return LineMap.from_lines(np.hstack((ring, np.roll(ring, -1, axis=0))), side=1)


def query_at(pose, plan):
    """What is seen of all walls of a plan, and beams to them from a place beside the sensor."""
    x, y, theta = pose
    c, s = math.cos(theta), math.sin(theta)
    walls = plan.walls.copy()
    for name in ("start", "end", "centroid"):
        walls[name] = (plan.walls[name] - (x, y)) @ np.array([[c, -s], [s, c]])
    walls["angle"] = plan.walls["angle"] - theta
    walls["covariance"] = np.array([[4e-6, 5e-7], [5e-7, 1e-6]])
    walls["covariance"][::2, 0, 0] *= 9
    origin, along = np.array((0.1, 0.2)), walls["end"] - walls["start"]
    ends = (walls["start"][:, None] + np.linspace(0.1, 0.9, 9)[:, None] * along[:, None]) - origin
    ends, beams = ends.reshape(-1, 2), np.zeros((ends.size // 2, 10))
    beams[:, 4] = np.linalg.norm(ends, axis=1)
    beams[:, :2], beams[:, 2:4], beams[:, 6] = origin, ends / beams[:, 4:5], 1.0
    beams[:, 5], beams[:, 7:] = 1e-4, (2e-4, 1e-4, 3e-4)
    beams[::3, 4] -= 0.05
    blocks = np.zeros((len(walls), 2, len(walls), 2))
    k = np.arange(len(walls))
    blocks[k, :, k] = walls["covariance"]
    return Query(walls, blocks.reshape(2 * len(walls), -1), beams)


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


def test_a_wall_is_hidden_by_how_far_it_is_in_the_middle_of_what_they_share():
    """A wall of 10 m, and others askew from x = 2 to 8: 12 and 20 cm off at x = 5."""
    for middle, hidden in ((0.12, True), (0.20, False)):
        ends = [(0, 0, 10, 0), (2, middle - 0.1, 8, middle + 0.1)]
        walls = walls_of(np.array(ends).reshape(-1, 2, 2))
        walls["views"] = 9, 3
        assert len(single(walls)) == (1 if hidden else 2)


def test_a_short_part_of_a_bowed_wall_may_be_askew():
    """Half a metre, off by 10 mm: its direction is known to 2 · 10 mm / 0.5 m = 40 mrad."""
    for turn, parts in ((0.1, 1), (0.14, 2)):
        segments = np.zeros(2, SEGMENT)
        for k, (x, half, angle) in enumerate([(0.0, 5.0, 0.0), (0.0, 0.25, turn)]):
            u = np.array((math.cos(angle), math.sin(angle)))
            segments["start"][k], segments["end"][k] = (x, 0) - half * u, (x, 0) + half * u
            segments["centroid"][k], segments["angle"][k] = (x, 0), angle
        segments["length"], segments["rms"] = (10, 0.5), (0, 0.01)
        segments["misfit"], segments["n_points"] = (0, 0.01), 1000
        segments["covariance"] = np.eye(2) * 1e-8
        sights = sights_of([(segments, np.arange(2))])
        lines = lines_of(sights, np.zeros((1, 3)), 2)
        walls = merged(sights, np.zeros((1, 3)), lines, 0.0)["wall"]
        assert len({*walls.tolist()}) == parts


@pytest.mark.parametrize("turned", [0.0, 0.4, -0.9])
def test_the_likeliest_turns_are_those_near_the_expected_one(turned):
    """In a square room four turns are as good; of two on either side, none is preferred."""
    corners = np.array([(-2, -2), (2, -2), (2, 2), (-2, 2)], float)
    ends = np.stack((corners, np.roll(corners, -1, axis=0)), axis=1)
    around = features(segments=[segment(a, b, 0, 9) for a, b in ends.tolist()])
    seen = around.transform(0.0, 0.0, -turned)
    turns = _likely_turns(around, seen, turned, 0.1)
    off = np.abs(np.remainder(turns - turned + math.pi, 2 * math.pi) - math.pi)
    assert off[0] < math.radians(3)
    assert np.round(off[:4] / (math.pi / 2)).tolist() == [0, 1, 1, 2]
    wide = _likely_turns(around, seen, turned + math.pi / 4, 9.0)
    off = np.remainder(wide - turned - math.pi / 4 + math.pi, 2 * math.pi) - math.pi
    assert sorted(np.round(off[:2] / (math.pi / 4)).tolist()) == [-1, 1]


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


def scans_on(way, world=None, turn=0.0):
    """Scans of a room, from place to place, with the poses as exact odometry."""
    world = World(np.hstack((RING, np.roll(RING, -1, axis=0))), []) if world is None else world
    for k, x in enumerate(way):
        yield SENSORS["lms361"].scan(world, (x, 0.0, turn * k), np.random.default_rng(k), 0.1 * k)


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


def test_of_parts_that_were_seen_as_often_the_longest_gathers_the_others():
    """A wall of 4 m between two of 1 m, which do not touch each other."""
    ends = np.array([(-3.1, 0, -2.1, 0), (-2, 0, 2, 0), (2.1, 0, 3.1, 0)]).reshape(-1, 2, 2)
    for order in ([0, 1, 2], [1, 0, 2], [2, 0, 1]):
        segments = np.zeros(3, SEGMENT)
        segments["start"], segments["end"] = ends[order, 0], ends[order, 1]
        segments["centroid"] = ends[order].mean(axis=1)
        segments["length"] = np.linalg.norm(segments["end"] - segments["start"], axis=1)
        segments["covariance"] = np.eye(2) * 1e-6
        sights = sights_of([(segments, np.arange(3))])
        lines = lines_of(sights, np.zeros((1, 3)), 3)
        found = merged(sights, np.zeros((1, 3)), lines, 0.0)["wall"]
        assert found.tolist() == [0, 0, 0]


def test_poses_near_the_expected_one_are_tried():
    """Wherever within two deviations the pose is, one is tried within reach of refinement."""
    placed, extract = Drive(), Extractor()
    for scan in scans_on([0.0]):
        placed.add(scan, found := extract(scan))
    rng, prior = np.random.default_rng(0), (0.2, -0.1, 0.3)
    for way, turn in ((0.02, 0.02), (0.1, 0.1), (0.3, 0.2)):
        tried = placed._tried(found, prior, way, turn)
        for off in rng.uniform(-1, 1, (50, 3)) * (2 * way, 2 * way, min(2 * turn, 0.3)):
            away = np.abs(tried - np.add(prior, off)) / (0.16, 0.16, 0.06)
            assert away.max(axis=1).min() < 1


@pytest.mark.parametrize("theta", [0.0, 1.1])
def test_poses_some_way_along_the_walls_are_looked_at(theta):
    """In a corridor that leads by 0.3 rad, from one pose alone."""
    c, s = math.cos(0.3), math.sin(0.3)
    ends = np.array([[-100, -1, 100, -1], [100, 1, -100, 1]]).reshape(-1, 2) @ [[c, s], [-s, c]]
    plan = LineMap.from_lines(ends.reshape(-1, 4), side=1)
    poses, _ = _searched(np.array([(0.5, 0.2, theta)]), query_at((0.5, 0.2, theta), plan), plan)
    off = (poses[:, :2] - (0.5, 0.2)) @ np.array([[c, -s], [s, c]])
    assert {*np.round(off[:, 0], 3)} == {-1, -0.6, -0.3, 0, 0.3, 0.6, 1}
    np.testing.assert_allclose(off[:, 1], 0, atol=1e-3)
