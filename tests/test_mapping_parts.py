"""Parts of maps of drives by hand-worked cases: walls and lines, what is expected, loops."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from handmade import features, segment
from small_room import placed, scans_on

from lineament import Extractor, Tracker
from lineament.mapping import LocalMap, placing
from lineament.mapping.loops import Survey
from lineament.mapping.making import single
from lineament.mapping.placing import is_enough, placed_on, surely_on
from lineament.scan.poses import compose
from lineament.simulation import World
from lineament.walls import walls_of
from lineament.walls.sights import SIGHT, lines_of, renumbered, same, sights_of, walls_along


@pytest.mark.parametrize("turn", [0.0, 1.0, 2.5])
def test_a_wall_is_hidden_by_how_far_it_is_in_the_middle_of_what_they_share(turn):
    """A wall of 10 m, and others askew from x = 2 to 8: 12 and 20 cm off at x = 5."""
    c, s = math.cos(turn), math.sin(turn)
    for middle, hidden in ((0.12, True), (0.20, False)):
        ends = [(0, 0, 10, 0), (2, middle - 0.1, 8, middle + 0.1)]
        walls = walls_of(np.array(ends).reshape(-1, 2, 2) @ np.array([[c, s], [-s, c]]))
        walls["views"] = 9, 3
        assert len(single(walls)) == (1 if hidden else 2)


def merged_walls(*rows, **fields):
    """Numbers of the walls that the segments of one key frame become."""
    segments = features(segments=rows).segments.copy()
    for name, values in fields.items():
        segments[name] = values
    sights = sights_of([(segments, np.arange(len(rows)))])
    lines = lines_of(sights, np.zeros((1, 3)), len(rows))
    return renumbered(sights, same(sights, np.zeros((1, 3)), lines, 0.0))["wall"].tolist()


@pytest.mark.parametrize(("turn", "walls"), [(0.1, 1), (0.14, 2)])
def test_a_short_part_of_a_bowed_wall_may_be_askew(turn, walls):
    """Half a metre, off by 10 mm: its direction is known to 2 · 10 mm / 0.5 m = 40 mrad."""
    half = 0.25 * np.array((math.cos(turn), math.sin(turn)))
    whole, part = (
        segment(-end, end, 0, 999, sigma=(1e-4, 1e-4)) for end in (np.array((5, 0)), half)
    )
    found = merged_walls(whole, part, rms=(0, 0.01), misfit=(0, 0.01))
    assert len({*found}) == walls


def survey_at(places, lost=()):
    """Key frames at places, of which some are lost."""
    frames = [SimpleNamespace(is_torn=k in lost) for k in range(len(places))]
    return Survey(frames, np.column_stack((places, np.zeros(len(places)))), None, None)


def test_most_places_of_a_drive_agree_where_it_is_on_a_plan(monkeypatch):
    """Of five places two are wrong alike in direction, but not in where they are."""
    survey = survey_at(np.column_stack((3.0 * np.arange(6), np.zeros(6))))
    seen = [(9.0, 0.0, 0.0), (1.0, 2.0, 0.0), (1.1, 2.0, 0.0), (-7.0, 4.0, 0.0), (1.0, 2.1, 1.0)]
    queries = [(k, compose(move, survey.pose(k))) for k, move in enumerate(seen)]
    monkeypatch.setattr(Survey, "queries", lambda *of: [q for q in queries if q[0] in of[2]])
    monkeypatch.setattr(placing, "locate", lambda pose, _: SimpleNamespace(pose=pose))
    found = placed_on(None, survey, np.arange(6), 0.0)
    assert found.move in (seen[1], seen[2])
    assert (sorted(found.places), found.others) == ([1, 2], 3)
    assert placed_on(None, survey, np.arange(3, 6), 0.0).move in (seen[3], seen[4])
    assert placed_on(None, survey, np.arange(5, 6), 0.0) is None


@pytest.mark.parametrize(("against", "sure"), [(5, True), (6, False)])
def test_a_drive_that_looks_through_walls_at_most_places_is_elsewhere(monkeypatch, against, sure):
    """Five of thirty places are located and agree; so many others contradict the plan there.

    The rest are off the plan and say nothing.
    """
    every = np.arange(30)
    survey = survey_at(np.column_stack((3.0 * every, np.zeros(30))))
    queries = [(k, compose((1.0, 2.0, 0.5), survey.pose(k))) for k in every.tolist()]

    class Where(SimpleNamespace):
        def __bool__(self):
            return self.is_located

    def locate(pose, _, guess=None, spread=None):
        k = [of for _, of in queries].index(pose)
        if guess is None and k >= 5:
            return None
        if guess is not None:
            np.testing.assert_allclose(guess, pose)
            np.testing.assert_allclose(np.diag(spread), [0.09, 0.09, 0.0025])
        evidence = SimpleNamespace(contradicted=0.06 if k < 5 + against else 0.05)
        return Where(pose=pose, evidence=evidence, is_located=guess is None or k < 2)

    monkeypatch.setattr(Survey, "queries", lambda *of: [q for q in queries if q[0] in of[2]])
    monkeypatch.setattr(placing, "locate", locate)
    found = surely_on(None, survey, every, 0.1)
    assert (found is not None) == sure
    assert surely_on(None, survey, every[:2], 0.1) is None


def test_three_places_that_agree_are_sure_and_thrice_those_that_do_not():
    assert [is_enough(*of) for of in ((2, 0), (3, 0), (3, 1), (5, 2), (6, 2))] == [0, 1, 1, 0, 1]


@pytest.mark.parametrize("order", [[0, 1, 2], [1, 0, 2], [2, 0, 1]])
def test_of_parts_that_were_seen_as_often_the_longest_gathers_the_others(order):
    """A wall of 4 m between two of 1 m, which do not touch each other."""
    ends = [((-3.1, 0), (-2.1, 0)), ((-2, 0), (2, 0)), ((2.1, 0), (3.1, 0))]
    found = merged_walls(*(segment(*ends[k], 0, 9, sigma=(1e-3, 1e-3)) for k in order))
    assert found == [0, 0, 0]


@pytest.mark.parametrize("middle", [0.0, math.pi, math.pi / 2])
def test_parts_of_a_wall_are_one_whatever_its_direction(middle):
    """Two parts of 2 m in one line, 10 cm from each other, whose directions differ by 20 mrad."""
    parts = []
    for along, turn in ((-1.05, -0.01), (1.05, 0.01)):
        u, own = (np.array((math.cos(a), math.sin(a))) for a in (middle, middle + turn))
        parts.append(segment(along * u - own, along * u + own, 0, 9, sigma=(0.01, 0.02)))
    assert merged_walls(*parts) == [0, 0]


def test_a_wall_along_another_is_hidden_by_it_up_to_10_degrees():
    for degrees, left in ((9.5, 1), (10.5, 2)):
        half = 0.5 * np.array((math.cos(math.radians(degrees)), math.sin(math.radians(degrees))))
        ends = np.array([[(-5, 0), (5, 0)], [-half, half]], float)
        walls = walls_of(ends)
        walls["views"] = 9, 3
        assert len(single(walls)) == left


def going(steps, pace, count=60):
    """A drive whose scans come at a pace, which went on by the same step from each to the next."""
    drive = placed(scans_on([0.0]))
    for k in range(1, count + 1):
        x, y, theta = np.multiply(steps, k)
        drive._go_on(pace * k, (x, y, theta), np.eye(3), None)
        drive._last = pace * k, None, (x, y, theta)
    return drive


def test_without_odometry_a_drive_goes_on_as_it_did():
    """By the last step, and by 30 % of it beside what it may do in 0.1 s at 0.4 m/s, 0.8 rad/s."""
    drive = going((0.05, 0.01, 0.0), 0.1)
    pose, spread = drive._expected(6.1, None)
    np.testing.assert_allclose(pose, (61 * 0.05, 61 * 0.01, 0.0))
    way, turn = 0.02 + 0.4 * 0.1 + 0.3 * math.hypot(0.05, 0.01), 0.02 + 0.8 * 0.1
    np.testing.assert_allclose(np.sqrt(np.diag(spread)), (way, way, turn), rtol=0.02)
    # After a second it may be anywhere near; the same stamp again is one step.
    wide = np.sqrt(np.diag(drive._expected(7.0, None)[1]))
    np.testing.assert_allclose(wide, (0.3 + 0.0153, 0.3 + 0.0153, 0.7), rtol=0.02)
    np.testing.assert_allclose(drive._expected(6.0, None)[1], spread, rtol=0.05)


@pytest.mark.parametrize(("pace", "share"), [(0.1, 0.2), (1.0, 1.0), (2.0, 1.0)])
def test_a_step_is_believed_by_as_much_as_it_is_known_better_than_what_is_usual(pace, share):
    """Half of the deviation that is expected is usual; beams know the step as well.

    What goes on is the step of the last half second.
    """
    drive = going((0.05, 0.01, 0.0), pace)
    usual, now = np.diag((0.1, 0.1, 0.2)) ** 2, 61 * pace
    drive._go_on(now, (61 * 0.05 + 0.02, 61 * 0.01, 0.04), 4.0 * usual, usual)
    believed = 0.05 + share * 0.01, 0.01, share * 0.02
    np.testing.assert_allclose(drive._step, believed, atol=3e-4)


def test_a_robot_is_not_thought_to_go_on_faster_than_1_2_metres_a_second():
    for speed, thought in (((1.0, -1.1), (0.1, -0.11)), ((3.0, -4.0), (0.12, -0.12))):
        last = np.multiply(speed, 6.0)
        pose, _ = going((*np.multiply(speed, 0.1), 0.0), 0.1)._expected(6.1, None)
        np.testing.assert_allclose(pose[:2] - last, thought, rtol=0.03)
    pose, _ = going((0.0, 0.0, 0.3), 0.1)._expected(6.1, None)
    assert math.remainder(pose[2] - 60 * 0.3, 2 * math.pi) == pytest.approx(0.12, rel=0.03)


def test_odometry_says_how_a_drive_goes_on():
    """30 mm and 20 mrad, and a tenth of the motion, beside it."""
    drive = going((0.0, 0.0, 0.0), 0.1, 1)
    drive._last = 0.1, (5.0, 1.0, math.pi / 2), (0.2, 0.1, 0.0)
    pose, spread = drive._expected(0.2, (5.0, 1.3, math.pi / 2 - 0.2))
    np.testing.assert_allclose(pose, (0.5, 0.1, -0.2))
    np.testing.assert_allclose(spread, np.diag((0.06, 0.06, 0.04)) ** 2)
    # Odometry that begins with this scan says nothing of the motion from the last one.
    drive._last = 0.1, None, (0.2, 0.1, 0.0)
    begun, without = (drive._expected(0.2, given) for given in ((5.0, 1.3, 0.0), None))
    for one, other in zip(begun, without, strict=True):
        np.testing.assert_array_equal(one, other)


def test_sights_keep_of_a_segment_its_misfit_and_noise_as_squares():
    """Points of a wall scatter by 10 mm, of which a bow is 6: 64 mm² are noise, of 25 points."""
    segments = features(segments=[segment((0.0, 1.0), (3.0, 1.0), 0, 24)]).segments.copy()
    segments["rms"], segments["misfit"], segments["n_points"] = 0.010, 0.006, 25
    (sight,) = sights_of([(segments, np.array([7]))])
    assert (sight["frame"], sight["wall"]) == (0, 7)
    assert sight["misfit"] == pytest.approx(36e-6)
    assert sight["noise"] == pytest.approx(64e-6 / math.sqrt(25 * math.pi))
    np.testing.assert_allclose(sight["covariance"], segments["covariance"][0])
    # Surfaces that are 2 cm off, each time elsewhere, are so over 3 m.
    rough = sights_of([(segments, np.array([7]))], 0.02)["covariance"] - sight["covariance"]
    np.testing.assert_allclose(rough[0], np.diag((4e-4, 4 * 4e-4 / 9)))
    # More misfit than scatter is rounding.
    segments["misfit"] = 0.011
    assert sights_of([(segments, np.array([7]))])["noise"].tolist() == [0.0]


def test_parts_of_a_wall_are_known_where_they_are():
    """A line known to 1 mm and 1 mrad at its middle, which one of its three parts has."""
    sights = np.zeros(3, SIGHT)
    sights["covariance"] = np.eye(2) * 1e-6
    sights["ends"] = (-3.0, -0.5), (0.5, 3.5), (-0.1, 0.2)
    lines = walls_of(np.array([[(0.0, 0.0), (1.0, 0.0)]]))
    lines["centroid"], lines["covariance"] = 0.0, np.eye(2) * 1e-6
    walls = walls_along(sights, np.zeros((1, 3)), lines, gap=0.25)
    np.testing.assert_allclose(walls["start"][:, 0], (-3.0, -0.1, 0.5))
    np.testing.assert_allclose(walls["end"][:, 0], (-0.5, 0.2, 3.5))
    np.testing.assert_allclose(walls["centroid"][:, 0], (-1.75, 0.0, 2.0))
    variance = 1e-6 * (1 + np.square((1.75, 0, 2)))
    np.testing.assert_allclose(walls["covariance"][:, 0, 0], variance)
    assert walls["views"].tolist() == [1, 1, 1]


def test_where_a_way_was_passed_before():
    """Around a square of 10 m, twice, by 0.5 m: 80 key frames a round, 40 m of way."""
    leg = np.linspace(0, 10, 20, endpoint=False)
    x = np.concatenate((leg, 0 * leg + 10, 10 - leg, 0 * leg))
    ring = np.column_stack((x, np.roll(x, 20)))
    survey = survey_at(np.tile(ring, (2, 1)))
    np.testing.assert_allclose(survey.way, 0.5 * np.arange(160))
    # In the second round, the same place in the first; then the nearest at least 5 m of way from
    # those before. Nothing of the last 12 m was seen before.
    assert survey._passed(90) == [10, 0, 20]
    assert survey._passed(93) == [13, 23, 3]
    assert survey._passed(24) == []
    assert survey._passed(25) == [0]
    # The three nearest of four stretches that pass.
    across = np.column_stack((np.arange(-10, 10, 0.5), np.full(40, 5.0)))
    places = np.concatenate([np.add(across, (0, k)) for k in (3, 0.5, 1, 9)] + [across[20:21]])
    assert survey_at(places)._passed(160) == [60, 100, 20]
    # What comes back after 4.9 m is one stretch with what it left; after 5.1 m two. What is 25 m
    # away was not passed.
    for out, stretches in ((2.5, [0]), (2.6, [0, 2])):
        places = [(0.0, 0.0), (out, 0.0), (0.1, 0.0), (500.0, 0.0), (0.0, 25.0), (0.0, 0.0)]
        assert survey_at(places)._passed(5) == stretches
    # Where it was lost, what was seen before is far.
    survey = survey_at(np.column_stack((np.arange(20) * 0.5, np.zeros(20))), lost=[10])
    np.testing.assert_allclose(np.diff(survey.way), [*[0.5] * 9, 12, *[0.5] * 9])


@pytest.mark.parametrize(("step", "turn"), [(0.11, 0.0), (0.0, 0.1)])
def test_a_key_frame_is_taken_for_each_0_3_m_or_15_degrees(step, turn):
    scans = [*scans_on(step * np.arange(10), turn=turn)]
    poses = [scan.pose for scan in scans]
    drive = placed(scans, poses)
    assert [frame.index for frame in drive.frames] == [0, 3, 6, 9]
    assert [k for k, _ in drive.scans] == [0, 0, 0, 1, 1, 1, 2, 2, 2, 3]
    found = [compose(drive.frames[k].pose, pose) for k, pose in drive.scans]
    off = np.subtract(found, poses)
    off[:, 2] = np.remainder(off[:, 2] + math.pi, 2 * math.pi) - math.pi
    assert np.abs(off).max() < 0.02
    # Walls keep their numbers while they are seen.
    first, last = drive.frames[0].walls, drive.frames[-1].walls
    assert len({*first} & {*last}) >= 5
    assert len({*first}) == len(first)


@pytest.mark.parametrize("given", [True, False])
def test_how_well_a_local_map_knows_its_motions(given):
    """By odometry 5 mm, 5 mrad and a tenth; else 5 cm and all of the way, 20 mrad and a fifth."""
    tracker, local, extract = Tracker(), LocalMap(), Extractor()
    for scan in scans_on([-0.2, 0.2], turn=0.2):
        found, at = extract(scan), scan.pose if given else None
        local.add(found, tracker(found, scan.pose), at)
    (_, last) = local._sights
    sigma = (0.005 + 0.04, 0.005 + 0.04, 0.005 + 0.02) if given else (0.45, 0.45, 0.02 + 0.04)
    np.testing.assert_allclose(np.sqrt(np.diag(last.covariance)), sigma, rtol=0.02)
    np.testing.assert_allclose(last.motion, (0.4, 0.0, 0.2), atol=0.02)


def test_in_a_corridor_a_motion_along_it_is_not_known():
    """To half a metre more, where no odometry shows it."""
    corridor = World([[-90, -1, 90, -1], [90, 1, -90, 1]], [])
    tracker, local, extract = Tracker(), LocalMap(), Extractor()
    for scan in scans_on([0.0, 0.4], corridor):
        found = extract(scan)
        local.add(found, tracker(found))
    along, across, _ = np.sqrt(np.diag(local._sights[-1].covariance))
    assert 0.5 < along < 1.1
    assert across < 0.6 < 0.5 + along
    assert along**2 - across**2 == pytest.approx(0.25, rel=0.05)


def test_each_stretch_of_the_way_that_passed_near_is_looked_at():
    """One that passes 1.5 m away at key frame 8, and one that begins 0.5 m away at key frame 40."""
    first = np.column_stack((0.5 * np.arange(-8, 8), np.full(16, 1.5)))
    away = np.column_stack((np.full(24, 50.0), np.arange(24)))
    second = np.column_stack((np.zeros(10), 0.5 + 0.3 * np.arange(10)))
    places = np.concatenate((first, away, second, away, [(0.0, 0.0)]))
    assert survey_at(places)._passed(len(places) - 1) == [40, 8]
