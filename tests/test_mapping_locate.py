"""Where am I on this plan: the four verdicts, poses by their covariances, and what is no query."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from lineament_lab.evaluation.arena import archived_scans

import lineament as ln
from lineament.mapping import LineMap, LocalMap, Query, locate
from lineament.mapping.evidence import evidence_of
from lineament.mapping.local_map import query_of_scan
from lineament.mapping.refine import adjusted
from lineament.motion import compose, relative
from lineament.simulation import SENSORS, World, drive, drive_poses
from lineament.simulation.buildings import office
from lineament.simulation.raycast import cast_rays

SENSOR = SENSORS["utm30lx"]
pytestmark = pytest.mark.slow


def plan_of(world):
    return LineMap.from_lines(world.segments, side=1)


@cache
def storey():
    return office(11, (32.0, 20.0), identical=0.0)


@cache
def storey_plan():
    return plan_of(storey().plan)


def local_map(world, way, seed=0, odometry=None):
    """Drive along a way; returns the local map and the last pose."""
    stamps, poses = drive_poses(way, speed=1.0, rate=5.0)
    tracker, local, extract = ln.Tracker(roughness=0.0), LocalMap(roughness=0.0), ln.Extractor()
    for k, (stamp, pose) in enumerate(zip(stamps, poses, strict=True)):
        scan = SENSOR.scan(world, tuple(pose), np.random.default_rng([seed, k]), stamp)
        features, at = extract(scan), tuple(pose) if odometry else None
        local.add(features, tracker(features, at), at)
    return local, tuple(poses[-1])


def ways(building, count, length=2.0):
    """Stretches of the way through a building."""
    legs = np.stack((building.waypoints[:-1], building.waypoints[1:]), axis=1)
    legs = np.concatenate((legs, legs[:, ::-1]))
    long = legs[np.linalg.norm(legs[:, 1] - legs[:, 0], axis=1) > length]
    for start, end in long[:: max(len(long) // count, 1)][:count]:
        yield np.array([start, start + (end - start) * length / math.dist(start, end)])


def error(where, pose):
    x, y, turn = relative(pose, where.pose)
    return math.hypot(x, y), abs(turn)


@cache
def seen():
    """Local maps of a furnished storey, with their poses."""
    found = []
    for k, way in enumerate(ways(storey(), 12)):
        found.append(local_map(storey().world, way, k, odometry=True))
    return found


def test_places_are_found_and_their_errors_are_those_of_the_covariances():
    squares, right = [], 0
    for local, pose in seen():
        where = locate(local, storey_plan())
        if where:
            assert where.verdict == "located"
            assert error(where, pose) < (0.05, 0.01)
            off = np.subtract(where.pose, pose)
            off[2] = math.remainder(off[2], 2 * math.pi)
            squares.append(off @ np.linalg.solve(where.covariance, off))
            right += 1
            assert where.evidence.explained > 0.35
            assert where.evidence.contradicted < 0.05
    assert right >= 10
    # Sum of χ² of three degrees of freedom, within four deviations.
    assert abs(sum(squares) - 3 * right) < 4 * math.sqrt(6 * right)


@pytest.mark.parametrize("trap", ["mirrored", "other storey", "feet"])
def test_plans_that_are_not_of_this_place(trap):
    storeys = {
        "mirrored": storey().mirrored(),
        "other storey": office(12, (32.0, 20.0)).plan,
        "feet": World(storey().plan.segments / 0.3048),
    }
    plan = plan_of(storeys[trap])
    verdicts = [locate(local, plan).verdict for local, _ in seen()]
    assert "located" not in verdicts
    assert verdicts.count("not on this map") >= 8


def test_moved_walls_do_not_move_the_pose():
    plan = plan_of(storey().moved(1, share=1.0).plan)
    found = [(locate(local, plan), pose) for local, pose in seen()]
    located = [error(where, pose) for where, pose in found if where]
    assert len(located) >= 4
    assert max(located) < (0.1, 0.02)


def test_identical_rooms_are_ambiguous_and_the_right_one_is_among_them():
    rooms = [
        [(x, 0), (x + 4, 0), (x + 4, 3), (x + 2.5, 3), (x + 2.5, 2.4), (x, 2.4), (x, 0)]
        for x in (0, 5, 10)
    ]
    world = World.of_polygons(rooms)
    scan = SENSOR.scan(world, (6.0, 1.0, 0.5), np.random.default_rng(0))
    where = locate(ln.extract(scan), plan_of(world))
    assert where.verdict == "ambiguous"
    poses = [where.pose, *(pose for pose, _ in where.alternatives)]
    assert sorted(round(x) for x, _, _ in poses) == [1, 6, 11]
    assert all(error(locate(ln.extract(scan), plan_of(world), pose), pose) < (0.03, 0.01)
               for pose in poses)  # fmt: skip
    # The room next to it has another depth.
    other = World.of_polygons([rooms[0], [(5, 0), (9, 0), (9, 4), (5, 4), (5, 0)]])
    alone = SENSOR.scan(other, (1.0, 1.0, 0.5), np.random.default_rng(0))
    assert locate(ln.extract(alone), plan_of(other)).verdict == "located"


def test_a_right_pose_is_not_refined_away():
    """A wrong pair of walls moved it by 0.2 m, and a place 18 m off was called located."""
    building, rng = office(34, (24.0, 18.0), identical=0.0), np.random.default_rng(4290404217)
    pose = building.free_pose(rng)
    where = locate(ln.extract(SENSOR.scan(building.world, pose, rng)), plan_of(building.plan))
    assert where.verdict == "located"
    assert error(where, pose) < (0.01, 0.002)


def test_place_that_is_its_own_mirror_image_is_ambiguous():
    """A niche in the middle of one wall: a mirrored plan would look the same."""
    room = [(0, 0), (5, 0), (5, 4), (3, 4), (3, 4.6), (2, 4.6), (2, 4), (0, 4), (0, 0)]
    world = World.of_polygons([room])
    aside = World.of_polygons([[(0, 0), (6, 0), (6, 3), (3, 3), (3, 5), (0, 5), (0, 0)]])
    verdicts = []
    for of in (world, aside):
        scan = SENSOR.scan(of, (2.0, 2.5, 1.4), np.random.default_rng(0))
        where = locate(ln.extract(scan), plan_of(of))
        assert error(where, (2.0, 2.5, 1.4)) < (0.02, 0.01)
        verdicts.append(where.verdict)
    assert verdicts == ["ambiguous", "located"]


def test_errors_of_the_plan_are_those_of_the_pose():
    local, pose = seen()[0]
    exact, rough = (
        locate(local, LineMap.from_lines(storey().plan.segments, side=1, sigma=sigma), pose)
        for sigma in (0.0, 0.05)
    )
    assert np.sqrt(exact.covariance[0, 0]) < 0.01
    assert 0.015 < np.sqrt(rough.covariance[0, 0]) < 0.06


def test_corridor_leaves_its_direction_unobserved():
    c, s = math.cos(0.3), math.sin(0.3)
    walls = np.array([[0, 0, 200, 0], [200, 2, 0, 2]]).reshape(-1, 2) @ [[c, s], [-s, c]]
    world = World(walls.reshape(-1, 4))
    middle = 100 * c - s, 100 * s + c
    local, pose = local_map(world, [middle, (middle[0] + 2 * c, middle[1] + 2 * s)])
    where = locate(local, plan_of(world), pose)
    assert where.verdict == "direction unobserved"
    assert abs(np.dot(where.unobserved, (c, s))) > 0.999
    across = np.array([-s, c])
    assert math.sqrt(across @ where.covariance[:2, :2] @ across) < 0.01
    assert abs(across @ np.subtract(where.pose, pose)[:2]) < 0.03
    assert abs(where.pose[2] - 0.3) < 0.01


@pytest.mark.parametrize("off", [(0.4, -0.3, 0.12), (0.9, 0.7, -0.3), (-0.9, -0.7, 0.3)])
def test_guess_is_faster_but_finds_the_same(off):
    """Within two deviations, 1 m and 20°, on all sides."""
    for local, pose in seen()[:4]:
        without = locate(local, storey_plan())
        guess = tuple(np.add(pose, off))
        given = locate(local, storey_plan(), guess)
        np.testing.assert_allclose(given.pose, without.pose, atol=1e-4)
        np.testing.assert_allclose(given.covariance, without.covariance, rtol=1e-2, atol=1e-9)
        far = locate(local, storey_plan(), guess, np.diag((25.0, 25.0, 1.0)))
        np.testing.assert_allclose(far.pose, without.pose, atol=1e-4)
    wrong = locate(seen()[0][0], storey_plan(), (2.0, 2.0, 1.0), np.diag((0.01, 0.01, 0.001)))
    assert not wrong


def test_same_query_same_answer():
    local, _ = seen()[0]
    first, second = locate(local, storey_plan()), locate(local.query(), plan_of(storey().plan))
    assert first.pose == second.pose
    assert first.evidence == second.evidence
    np.testing.assert_array_equal(first.covariance, second.covariance)


@pytest.mark.parametrize("ranges", [[], [math.inf] * 50, [2.0] * 3])
def test_scans_that_show_nothing_are_nowhere(ranges):
    where = locate(ln.extract(ln.LaserScan(ranges, 0.0, 0.01)), storey_plan())
    assert where.verdict != "located"
    assert np.isfinite(where.pose).all()
    assert np.isfinite(where.covariance).all()


def test_local_map_keeps_the_way_and_needs_the_scan():
    local, _ = seen()[0]
    assert repr(local).startswith("LocalMap(")
    extract, tracker = ln.Extractor(), ln.Tracker()
    short, none = LocalMap(way=1.0), LocalMap()
    for scan in drive(storey().world, next(ways(storey(), 1)), SENSOR, speed=1, rate=5):
        features = extract(scan)
        tracks = tracker(features, scan.pose)
        short.add(features, tracks, scan.pose)
    assert 0.3 < float(repr(short).split()[-2]) <= 1.0
    with pytest.raises(ValueError, match="local map is empty"):
        none.query()
    with pytest.raises(ValueError, match="features have no scan"):
        none.add(features.transform(0, 0, 0), tracks)
    with pytest.raises(ValueError, match="features have no scan"):
        locate(features.transform(0, 0, 0), storey_plan())
    with pytest.raises(ValueError, match="way is -1"):
        LocalMap(-1)


def test_walls_of_a_local_map_are_off_by_their_covariance():
    """The walls of an empty storey, seen from the last pose, against those of the plan."""
    squares, count, lines = 0.0, 0, storey_plan().walls
    u = np.column_stack((np.cos(lines["angle"]), np.sin(lines["angle"])))
    for k, way in enumerate(ways(storey(), 6, 2.5)):
        local, pose = local_map(storey().plan, way, 50 + k, odometry=True)
        query, used, errors = local.query(), [], []
        for number, wall in enumerate(query.walls):
            between = np.array(compose(pose, (*wall["centroid"], 0.0))[:2]) - lines["centroid"]
            offset = u[:, 0] * between[:, 1] - u[:, 1] * between[:, 0]
            turn = np.remainder(wall["angle"] + pose[2] - lines["angle"] + 1, 2 * math.pi) - 1
            reach = np.linalg.norm(lines["end"] - lines["centroid"], axis=1)
            same = (np.abs((between * u).sum(axis=1)) < reach) & (np.abs(turn) < 0.05)
            best = np.where(same, np.abs(offset), math.inf).argmin()
            if (
                same[best]
                and abs(offset[best]) < 0.03
                and math.dist(wall["start"], wall["end"]) > 1
            ):
                errors += [offset[best], turn[best]]
                used += [2 * number, 2 * number + 1]
        squares += np.array(errors) @ np.linalg.solve(query.covariance[np.ix_(used, used)], errors)
        count += len(errors)
    assert count > 60
    assert 0.4 < squares / count < 1.4


def test_the_walls_of_one_scan_are_as_sure_as_its_segments():
    """The pose that they are seen from is held, and adds nothing: 30 m away, 1e-5 rad is 0.3 mm."""
    world = World([[-30, -1, 30, -1], [30, -1, 30, 1], [30, 1, -30, 1], [-30, 1, -30, -1]], [])
    features = ln.extract(SENSOR.scan(world, (0.3, 0.1, 0.2), np.random.default_rng(1)))
    own = features.segments.copy()
    own["misfit"] = 0.0
    walls = query_of_scan(replace(features, segments=own)).walls
    assert len(walls) == len(own) > 1
    assert own["covariance"][:, 1, 1].min() < 2e-9
    np.testing.assert_allclose(walls["covariance"], own["covariance"], rtol=0.05, atol=1e-10)


@pytest.mark.parametrize("off", [0.0, 0.03, 0.06])
def test_a_pair_that_contradicts_the_others_is_left_out(off):
    """Six walls of a room, each known to 1 mm; a cupboard in front of one of them is not it."""
    ring = np.array([(-4, -3), (0, -3), (4, -3), (4, 3), (0, 3), (-4, 3)])
    plan = LineMap.from_lines(np.column_stack((ring, np.roll(ring, -1, axis=0))))
    walls = plan.walls.copy()
    walls["covariance"] = np.diag((0.001, 0.001)) ** 2
    walls["centroid"][0, 1] += off
    spread = np.kron(np.eye(6), np.diag((0.001, 0.001)) ** 2)
    query = Query(walls, spread, np.zeros((0, 10)))
    pose, information = adjusted(np.zeros(3), np.arange(6), query, plan.index)
    np.testing.assert_allclose(pose, 0.0, atol=1e-6)
    # Of the walls along y = -3 and y = 3, four or three say what y is.
    along = 4 - (off > 0)
    assert information[1, 1] == pytest.approx(along * 1e6, rel=1e-6)


def test_evidence_counts_beams_as_a_slow_twin_does():
    plan, rng = storey_plan(), np.random.default_rng(3)
    pose = storey().free_pose(rng)
    scan = SENSOR.scan(storey().world, pose, rng)
    query = query_of_scan(ln.extract(scan))
    poses = np.array([pose, (pose[0] + 0.5, pose[1], pose[2]), (pose[0], pose[1], pose[2] + 0.5)])
    found = evidence_of(poses, query.beams, plan.index, 0.02)
    for (x, y, theta), (_, hit, short, through) in zip(poses, found, strict=True):
        bearings = np.arctan2(query.beams[:, 3], query.beams[:, 2])
        expected, met = cast_rays(storey().plan, (x, y, theta), bearings)
        r = query.beams[:, 4]
        px, py, qx, qy = storey().plan.segments[met].T
        length = np.hypot(qx - px, qy - py)
        towards = np.abs(
            (qx - px) * np.sin(bearings + theta) - (qy - py) * np.cos(bearings + theta)
        )
        off = (r - expected) * towards / length
        assert abs(hit - (np.abs(off) < 0.066).mean()) < 0.06
        assert abs(through - (off > 0.09).mean()) < 0.06
        assert hit + short + through == pytest.approx(1.0)


@pytest.mark.parametrize(("name", "median"), [("static_data", 0.010), ("mocap_02171554", 0.015)])
def test_kidnapped_in_the_real_arena(data_dir, name, median):
    path = data_dir / "truth" / f"jackal_{name}.npz"
    if not path.exists():
        pytest.skip(f"no {path}")
    plan = LineMap.from_lines(np.load(path)["gt_segments"], sigma=0.005)
    scans = archived_scans(path)[::5]
    found = [(locate(ln.extract(scan), plan), scan.pose) for scan in scans]
    errors = [error(where, pose)[0] for where, pose in found if where]
    assert len(errors) >= 60
    assert np.median(errors) <= median
    assert max(errors) < 0.2
