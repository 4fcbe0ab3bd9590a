"""Maps of drives: the graph, the joint adjustment, and a small storey from end to end."""

import math
import re
from dataclasses import replace
from itertools import accumulate

import numpy as np
import pytest
from click.testing import CliRunner
from lineament_lab.evaluation.maps import absolute_errors
from robot_driving import storey_driven
from small_room import placed

from lineament import Extractor, LaserScan
from lineament.cli import cli, run
from lineament.errors import LineamentError
from lineament.features import SEGMENT
from lineament.logs import save_log
from lineament.mapping import LineMap, hypotheses
from lineament.mapping.adjust import edges_of, errors_of_motions, optimise
from lineament.mapping.drive_map import Drive
from lineament.mapping.making import make_map, roughness, single, widened
from lineament.mapping.sessions import onto_plan, placements
from lineament.scan.poses import compose, relative
from lineament.simulation import SENSORS, World, drive, room
from lineament.walls import walls_of, wrapped
from lineament.walls.sights import SIGHT, misfits, renumbered, same


def edges(poses, pairs, sigma=0.05, loop=False):
    poses = [tuple(pose) for pose in poses]
    motions = [relative(poses[i], poses[k]) for i, k in pairs]
    return edges_of(pairs, motions, np.tile(np.eye(3) * sigma**2, (len(pairs), 1, 1)), loop)


@pytest.fixture(scope="module")
def ring():
    """Forty poses on a circle, and the motions from each to the next, with errors."""
    turns = np.linspace(0, 2 * math.pi, 40, endpoint=False)
    poses = np.column_stack((5 * np.cos(turns), 5 * np.sin(turns), wrapped(turns + math.pi / 2)))
    chain = edges(poses, [(k, k + 1) for k in range(39)])
    chain["motion"] += np.random.default_rng(1).normal(0, 0.02, (39, 3))
    return poses, chain


@pytest.mark.parametrize("side", [0, 1])
def test_jacobians_are_those_of_differences(ring, side):
    poses, chain = ring
    off, *jacobians = errors_of_motions(chain, poses)
    for axis in range(3):
        for k in range(39):
            moved = poses.copy()
            moved[chain["ends"][k, side], axis] += 1e-6
            step = (errors_of_motions(chain, moved)[0][k] - off[k]) / 1e-6
            np.testing.assert_allclose(jacobians[side][k, :, axis], step, atol=1e-5)


def test_a_loop_closes_the_ring_and_a_wrong_one_has_no_weight(ring):
    poses, chain = ring
    start = np.array(
        list(accumulate(map(tuple, chain["motion"]), compose, initial=tuple(poses[0])))
    )
    right = edges(poses, [(0, 39), (3, 36), (10, 30)], 0.02, loop=True)
    wrong = edges(poses, [(5, 25), (8, 33)], 0.02, loop=True)
    wrong["motion"] += (3.0, -2.0, 1.0)
    found = optimise(start, np.concatenate((chain, right, wrong)))
    np.testing.assert_allclose(found.poses[0], start[0], atol=1e-8)
    np.testing.assert_array_equal(found.right, np.arange(44) < 42)
    errors = np.hypot(*(found.poses - poses)[:, :2].T)
    assert errors.max() < 0.15 < np.hypot(*(start - poses)[:, :2].T).max()
    alone = optimise(start, np.append(chain, right))
    np.testing.assert_allclose(found.poses, alone.poses, atol=0.02)


@pytest.mark.parametrize(("square", "is_right"), [(3.8, True), (11.3, True), (11.4, False)])
def test_a_loop_is_right_as_far_as_99_of_100_right_ones_are(ring, square, is_right):
    """The quantile of 99 % of χ² with three degrees of freedom is 11.345."""
    poses, chain = ring
    loop = edges(poses, [(3, 36)], 0.02, loop=True)
    loop["motion"][0, 0] += math.sqrt(square / loop["information"][0, 0, 0])
    found = optimise(poses, np.append(chain, loop), rounds=0)
    assert found.right[-1] == is_right
    assert found.right[:-1].all()


def sights_of_a_square(seed, sigma, poses, rough=0.0):
    """Sights of the four walls of a square room of 8 m, each in two parts, from all poses."""
    rng, sights = np.random.default_rng(seed), np.zeros((len(poses), 8), SIGHT)
    for (k, wall), sight in np.ndenumerate(sights):
        angle = wall // 2 * math.pi / 2
        u, n = np.array((math.cos(angle), math.sin(angle))), (math.sin(angle), -math.cos(angle))
        centre = 4 * np.array(n) + (2 if wall % 2 else -2) * u + rng.uniform(-0.5, 0.5) * u
        off, turn = rng.normal(0, (sigma, sigma)) + rng.normal(0, (rough, rough))
        x, y, theta = relative(tuple(poses[k]), (*(centre - off * np.array(n)), angle + turn))
        sight["frame"], sight["wall"] = k, wall
        sight["centroid"], sight["angle"], sight["ends"] = (x, y), theta, (-1.0, 1.0)
        sight["covariance"] = np.eye(2) * sigma**2
        sights[k, wall] = sight
    return sights.ravel()


POSES = np.array([(0.3 * k - 1.5, 0.1 * k, 0.4 * k) for k in range(12)])
LOOSE = edges(POSES, [(k, k + 1) for k in range(11)], sigma=1.0)


@pytest.mark.slow
def test_walls_have_the_covariance_that_they_scatter_by():
    """NEES of the walls, in the frame of the first pose, whose errors the others share."""
    true_angle = np.arange(8) // 2 * math.pi / 2
    normals = np.column_stack((-np.sin(true_angle), np.cos(true_angle)))
    found = []
    for seed in range(60):
        poses = POSES + np.random.default_rng([seed, 1]).normal(0, 0.02, POSES.shape)
        poses[0] = POSES[0]
        sights = sights_of_a_square(seed, 0.01, POSES)
        lines = optimise(poses, LOOSE, sights).with_poses(sights)
        off = (lines["centroid"] * normals).sum(axis=1) + 4
        e = np.column_stack((off, wrapped(lines["angle"] - true_angle)))
        found.append(np.einsum("ni,nij,nj->n", e, np.linalg.inv(lines["covariance"]), e) / 2)
    assert np.mean(found) == pytest.approx(1.0, abs=0.15)


def test_a_segment_is_less_sure_by_its_misfit():
    """Squares of 25 points: 4 mm² of noise and 12 of misfit; as much as noise explains; exact."""
    segments = np.zeros(3, SEGMENT)
    segments["rms"], segments["misfit"] = (4e-3, 1e-3, 0.0), (math.sqrt(12) * 1e-3, 2e-4, 0.0)
    segments["n_points"], segments["covariance"] = 25, np.diag((2.0, 3.0))
    excess = 12 / 4 - 1 / math.sqrt(25 * math.pi)
    expected = np.array((1 + excess, 1, 1))[:, None, None] * np.diag((2.0, 3.0))
    np.testing.assert_allclose(widened(segments)["covariance"], expected)


def test_a_wall_whose_sights_contradict_each_other_is_less_sure():
    """Two walls seen from two poses that are held: 1 σ to either side of one, 2 σ of the other."""
    poses, sights = np.zeros((2, 3)), np.zeros(4, SIGHT)
    sights["frame"], sights["wall"], sights["ends"] = (0, 1, 0, 1), (0, 0, 1, 1), (-1, 1)
    sights["centroid"][:, 1] = np.array((-1, 1, -2, 2)) * 0.01
    sights["covariance"] = np.eye(2) * 0.01**2
    held = edges(poses, [(0, 1)], sigma=1e-6)
    lines = optimise(poses, held, sights).with_poses(sights)
    # χ² of 2 and 8 with two degrees of freedom.
    half = np.eye(2) * 0.01**2 / 2
    np.testing.assert_allclose(lines["covariance"], [half, 4 * half], rtol=1e-4, atol=1e-9)


def test_dense_and_sparse_equations_are_the_same(monkeypatch):
    sights = sights_of_a_square(1, 0.01, POSES)
    a, b = (optimise(POSES, LOOSE, sights, dense=dense) for dense in (False, True))
    np.testing.assert_allclose(a.poses, b.poses, atol=1e-9)
    np.testing.assert_allclose(a.lines["centroid"], b.lines["centroid"], atol=1e-9)
    np.testing.assert_allclose(a.matrix.toarray(), b.matrix, rtol=1e-6, atol=1e-3)
    small = a.with_poses(sights)["covariance"]
    monkeypatch.setattr("lineament.mapping.adjust._DENSE", 0)
    np.testing.assert_allclose(a.with_poses(sights)["covariance"], small, rtol=1e-6)


def test_what_another_wall_hides_is_left_out():
    """A wall of 9 m; in front of it and behind, 10 cm off, parts that no beam could have seen."""
    ends = [(0, 0, 9, 0), (4, 0.1, 6, 0.1), (8, -0.1, 12, -0.1), (-1, 0.1, 10, 0.1)]
    stay = [(9, 0.1, 0, 0.1), (3, 0.3, 5, 0.3), (2, 0, 2, 3)]  # faces away, farther off, across
    walls = walls_of(np.array([*ends, *stay], float).reshape(-1, 2, 2), covariance=np.eye(2) * 1e-4)
    walls["views"] = 20, 9, 8, 7, 6, 5, 4
    found = single(walls)
    lines = np.concatenate((found["start"], found["end"]), axis=1)
    expected = [(0, 0, 9, 0), (9, -0.1, 12, -0.1), (-1, 0.1, 0, 0.1), (9, 0.1, 10, 0.1), *stay]
    np.testing.assert_allclose(lines, expected, atol=1e-12)
    np.testing.assert_allclose(found["centroid"], (found["start"] + found["end"]) / 2, atol=1e-12)
    # Its direction is known to 10 mrad, 0.5 m farther on than the centroid was.
    assert found["covariance"][1, 0, 0] == pytest.approx(1e-4 * (1 + 0.5**2))


def test_noise_is_no_misfit_of_a_wall_but_a_bow_is():
    """Of a straight wall half of the fits have a misfit, by the positive part of their χ²."""
    rng, sights = np.random.default_rng(4), np.zeros(4000, SIGHT)
    squares = rng.chisquare(50, 4000) / 50 * 1e-4  # 10 mm, 50 points
    bow = np.repeat((0.0, 4e-4), 2000)  # 0 and 20 mm
    sights["wall"], sights["misfit"] = np.repeat((0, 1), 2000), np.maximum(squares - 1e-4 + bow, 0)
    sights["noise"] = 1e-4 / math.sqrt(math.pi * 50)
    straight, bent = misfits(sights, 2)
    assert straight < 3e-7 < sights["misfit"][:2000].mean() / 20
    assert bent == pytest.approx(4e-4, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("stamps", ["same", "bunched"])
def test_a_way_is_found_whatever_the_stamps_are(stamps):
    """Half a metre from scan to scan, with one stamp for all, or two scans at a time."""
    poses = [(-3.0 + 0.5 * k, 0.2, 0.05 * k) for k in range(12)]
    ring = np.array([(-4, -2), (4, -2), (4, 1), (3, 1), (3, 2), (-1, 2), (-1, 3), (-4, 3)])
    world = World(np.column_stack((ring, np.roll(ring, -1, axis=0))), [])
    times = [0.0 if stamps == "same" else 1.0 * (k // 2 * 2) for k in range(12)]
    found = placed(
        SENSORS["utm30lx"].scan(world, pose, np.random.default_rng(k), times[k])
        for k, pose in enumerate(poses)
    )
    at = [compose(found.frames[k].pose, pose) for k, pose in found.scans]
    assert not any(frame.is_lost for frame in found.frames)
    assert absolute_errors(at, poses).summary()["way_rmse"] < 0.02


def walls_of_parts(sights, found):
    return renumbered(sights, same(sights, found.poses, found.lines, 0.03))["wall"]


def test_roughness_is_found_and_parts_of_one_wall_are_merged():
    for rough in (0.0, 0.02):
        found = []
        for seed in range(6):
            sights = sights_of_a_square(seed, 0.005, POSES, rough)
            sights["covariance"] += 0.01**2 * np.diag((1, 1))  # as surfaces are thought to be
            result = optimise(POSES, LOOSE, sights)
            found.append(roughness(sights, result.poses, 0.01))
        assert 0.75 * rough <= np.mean(found) <= 1.1 * rough + 1e-3
        # Parts that are apart are two walls: nobody has seen what is between them.
        labels = walls_of_parts(sights, result)
        assert labels.tolist() == 12 * [*range(8)]
        sights["ends"] = -2.5, 2.5
        labels = walls_of_parts(sights, result)
        assert labels.tolist() == 12 * [0, 0, 1, 1, 2, 2, 3, 3]


@pytest.fixture(scope="module")
def driven():
    """A storey, a drive through it, and its map to be: without odometry, each scan once."""
    storey, scans, truth = storey_driven()
    return storey, scans, truth, placed(scans, [scan.pose for scan in scans])


@pytest.mark.slow
def test_a_drive_becomes_a_map(driven):
    storey, scans, truth, way = driven
    assert not any(frame.is_lost for frame in way.frames)
    assert len(way.scans) == len(scans)
    made = make_map(way.frames, way.scans)
    assert absolute_errors(made.poses, truth).summary()["way_rmse"] < 0.03
    plan = LineMap.from_lines(storey.plan.segments, side=1)
    moved = onto_plan(made, plan, placements(made, plan))
    off = np.array([relative(a, b) for a, b in zip(truth, moved.poses, strict=True)])
    assert np.hypot(*off[:, :2].T).max() < 0.1
    with pytest.raises(LineamentError, match="not on the plan"):
        placements(made, LineMap.from_lines([[0, 0, 1, 0], [0, 5, 3, 9]]))


@pytest.mark.slow
@pytest.mark.parametrize(("carried", "first"), [(100, 20), (150, 40)])
def test_a_robot_that_is_carried_is_found_where_it_was_before(driven, carried, first):
    _, scans, truth, _ = driven
    order = [*range(carried), *range(first, first + 40)]
    way = placed(scans[k] for k in order)
    assert [frame.index for frame in way.frames if frame.is_lost] == [carried]
    made = make_map(way.frames, way.scans)
    off = [
        relative(truth[k], compose(truth[0], pose))
        for k, pose in zip(order, made.poses, strict=True)
    ]
    assert np.hypot(*np.array(off)[:, :2].T).max() < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["dxf", "svg", "parquet"])
def test_the_command_writes_map_and_poses(tmp_path, ending):
    scans = list(drive(room(), [(-2, 0), (1, 0.5)], SENSORS["lms181"], speed=0.5, rate=4, seed=2))
    save_log(tmp_path / "log.npz", scans)
    target, poses = tmp_path / f"map.{ending}", tmp_path / "out.tum"
    arguments = ["map", str(tmp_path / "log.npz"), "-o", str(target), "--poses", str(poses)]
    result = CliRunner().invoke(cli, [*arguments, "--no-odometry"])
    assert result.exit_code == 0, result.output
    assert "key frames" in result.output
    rows = np.loadtxt(poses)
    assert rows.shape == (len(scans), 8)
    np.testing.assert_allclose(rows[:, 0], [scan.stamp for scan in scans])
    last = relative(scans[0].pose, scans[-1].pose)
    np.testing.assert_allclose(rows[-1, 1:3], last[:2], atol=0.05)
    assert target.stat().st_size > 500
    if ending == "svg":
        assert re.search(r"> *\d+ walls? and \d+ corners?(, .*)? *<", target.read_text("utf-8"))
    if ending == "parquet":
        assert len(LineMap.read(target).walls) >= 4


@pytest.mark.parametrize("scans", [1, 4])
@pytest.mark.parametrize(
    ("output", "status", "message"),
    [
        ("m.dxf", 1, "no beam returned anything"),
        ("m.png", 2, "expected an ending of .dxf, .svg, .parquet, .yaml"),
        ("m.svg --poses p.csv", 2, "expected an ending of .tum"),
        ("m.svg --onto none.dxf", 1, "none.dxf"),
    ],
)
def test_what_makes_no_map_is_one_line(
    tmp_path, monkeypatch, refused, scans, output, status, message
):
    monkeypatch.chdir(tmp_path)
    empty = LaserScan([np.inf] * 90, 0.0, 0.01)
    save_log("log.npz", [empty.with_pose((0.01 * k, 0, 0)) for k in range(scans)])
    assert message in refused(f"map log.npz -o {output}", status)
    assert not (tmp_path / output.split()[0]).exists()


def test_a_map_with_too_many_walls_beside_each_other_is_not_called_a_plan(
    tmp_path, monkeypatch, refused
):
    monkeypatch.setattr(hypotheses, "_MOST_PAIRS", 20)
    monkeypatch.setattr(hypotheses, "_FEW", 3)
    scans = drive(room(), [(-2, 0), (-1, 0.5)], SENSORS["lms181"], speed=0.5, rate=1)
    save_log(tmp_path / "log.npz", list(scans))
    error = refused(["map", tmp_path / "log.npz", "-o", tmp_path / "m.svg", "-q"])
    assert re.search(r"^lineament: \d+ pairs of \d+ walls lie beside each other", error)
    assert "plan" not in error


@pytest.mark.parametrize("stood", [1, 200])
def test_odometry_is_no_worse_after_standing(stood):
    """In a bare corridor odometry alone shows how far: by its way, however many scans it took."""
    world, rng = World([[-40, 1, 40, 1], [40, -1, -40, -1]]), np.random.default_rng(0)
    extract, way = Extractor(), Drive()
    for k, x in enumerate([0.0] * stood + [0.1, 0.2, 0.3, 0.4]):
        scan = SENSORS["lms181"].scan(world, (x, 0.0, 0.0), rng).stamped(0, k * 25_000_000)
        # Odometry may be an array as well.
        way.add(scan, extract(scan), np.array((x, 0.0, 0.0)) if stood > 1 else (x, 0.0, 0.0))
    _, frame = way.frames
    assert not frame.is_lost
    np.testing.assert_allclose(np.sqrt(np.diag(frame.expected)), (0.06, 0.06, 0.02), atol=0.011)


def test_in_a_bare_corridor_a_robot_goes_on_by_more_than_its_last_two_scans():
    """At 20 Hz a step is 2 cm, and a pose known to half of that where a door shows it."""
    walls = [[-40, 1, 0, 1], [0, 1, 0, 1.5], [0, 1.5, 1, 1.5], [1, 1.5, 1, 1], [1, 1, 60, 1]]
    world, rng = World([*walls, [60, -1, -40, -1]]), np.random.default_rng(2)
    extract, way = Extractor(), Drive()
    for k in range(400):
        scan = SENSORS["lms181"].scan(world, (0.02 * k - 1.0, 0.0, 0.0), rng)
        at = way.add(scan.stamped(0, k * 50_000_000), extract(scan)).pose
        if k == 60:
            seen = at[0]
    assert seen == pytest.approx(60 * 0.02, abs=0.03)
    assert at[0] - seen == pytest.approx(339 * 0.02, rel=0.02)


@pytest.mark.parametrize("rate", [10, 40])
def test_jambs_of_doors_show_how_far(rate):
    """Of 15 cm, too short to say where they point: their corners say where they are."""
    walls, begin = [[-8, -2, -8, 2], [60, -1, -8, -1]], -8.0
    for x in range(-3, 60, 4):
        walls += [[begin, 1, x, 1], [x, 1, x, 1.15], [x, 1.15, x + 0.9, 1.15]]
        walls.append([x + 0.9, 1.15, x + 0.9, 1])
        begin = x + 0.9
    world, rng = World([*walls, [begin, 1, 60, 1]]), np.random.default_rng(0)
    n, sensor = 8 * rate, SENSORS["utm30lx"]
    scans = (sensor.scan(world, (0.9 * k / rate - 6.0, 0.0, 0.0), rng) for k in range(n))
    way = placed(scan.stamped(0, k * (10**9 // rate)) for k, scan in enumerate(scans))
    assert not any(frame.is_lost for frame in way.frames)
    last, at = way.scans[-1]
    assert compose(way.frames[last].pose, at)[0] == pytest.approx(0.9 * (n - 1) / rate, abs=0.05)


def test_one_scan_is_a_map():
    scan = next(drive(room(), [(-2, 0), (1, 0.5)], SENSORS["lms361"]))
    way = placed([scan])
    made = make_map(way.frames, way.scans)
    np.testing.assert_allclose(made.poses, [(0, 0, 0)], atol=1e-12)
    assert len(made.map.walls) >= 4


def test_scans_of_a_moving_robot_are_deskewed(tmp_path):
    """By odometry they are as if they had been taken at once; else poses are off by decimetres."""
    sensor = replace(SENSORS["rplidar"], rate=8.0)
    walk = [(-2, -1), (2, -1), (2, 1), (-2, 1), (-2, -1), (1, 0)]
    scans = list(drive(room(), walk, sensor, speed=1.0, moving=True, seed=2))
    save_log(tmp_path / "log.npz", scans)
    off = {}
    for given in ((), ("--no-deskew",)):
        out = [str(tmp_path / name) for name in ("map.svg", "poses.tum")]
        assert run(["map", str(tmp_path / "log.npz"), "-o", out[0], "--poses", out[1], *given]) == 0
        _, x, y, *_ = np.loadtxt(out[1]).T
        true = np.array([relative(scans[0].pose, scan.pose)[:2] for scan in scans])
        off[given] = np.sqrt(np.mean((x - true[:, 0]) ** 2 + (y - true[:, 1]) ** 2))
    assert off[()] < 0.02
    assert off["--no-deskew",] > 0.08
