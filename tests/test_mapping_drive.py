"""Maps of drives: the graph, the joint adjustment, and a small storey from end to end."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from lineament import Extractor, LaserScan
from lineament.cli import cli, run
from lineament.errors import LineamentError
from lineament.evaluation.maps import absolute_errors
from lineament.logs import save_log
from lineament.mapping import LineMap
from lineament.mapping.drive_map import Drive
from lineament.mapping.graph import Edges, optimise
from lineament.mapping.joint import Sights, adjust, roughened, roughness
from lineament.mapping.loops import merged
from lineament.mapping.making import make_map, onto_plan
from lineament.scan.poses import compose, relative
from lineament.simulation import SENSORS, Wheels, drive, office, room


def edges(poses, pairs, sigma=0.05, robust=False):
    poses = [tuple(pose) for pose in poses]
    return Edges(
        np.array(pairs),
        np.array([relative(poses[i], poses[k]) for i, k in pairs]),
        np.tile(np.eye(3) / sigma**2, (len(pairs), 1, 1)),
        np.full(len(pairs), robust),
    )


@pytest.fixture(scope="module")
def ring():
    """Forty poses on a circle, and the motions from each to the next, with errors."""
    turns = np.linspace(0, 2 * math.pi, 40, endpoint=False)
    poses = np.column_stack((5 * np.cos(turns), 5 * np.sin(turns), turns + math.pi / 2))
    poses[:, 2] = np.remainder(poses[:, 2] + math.pi, 2 * math.pi) - math.pi
    chain = edges(poses, [(k, k + 1) for k in range(39)])
    return poses, replace(
        chain, motions=chain.motions + np.random.default_rng(1).normal(0, 0.02, (39, 3))
    )


def chained(first, motions):
    poses = [tuple(first)]
    for motion in motions:
        poses.append(compose(poses[-1], tuple(motion)))
    return np.array(poses)


def test_jacobians_are_those_of_differences(ring):
    poses, chain = ring
    of_a, of_b = chain.jacobians(poses)
    for side, jacobian in ((0, of_a), (1, of_b)):
        for axis in range(3):
            step = np.zeros((39, 3))
            for k in range(39):
                moved = poses.copy()
                moved[chain.ends[k, side], axis] += 1e-6
                step[k] = (chain.errors(moved)[k] - chain.errors(poses)[k]) / 1e-6
            np.testing.assert_allclose(jacobian[:, :, axis], step, atol=1e-5)


def test_a_loop_closes_the_ring_and_a_wrong_one_has_no_weight(ring):
    poses, chain = ring
    start = chained(poses[0], chain.motions)
    right = edges(poses, [(0, 39), (3, 36), (10, 30)], 0.02, robust=True)
    wrong = edges(poses, [(5, 25), (8, 33)], 0.02, robust=True)
    wrong.motions += (3.0, -2.0, 1.0)
    found, weights = optimise(start, chain.together(right).together(wrong))
    np.testing.assert_allclose(found[0], start[0], atol=1e-8)
    assert weights[:42].min() > 0.5
    assert weights[42:].max() < 0.01
    errors = np.hypot(*(found - poses)[:, :2].T)
    assert errors.max() < 0.15 < np.hypot(*(start - poses)[:, :2].T).max()
    alone, _ = optimise(start, chain.together(right))
    np.testing.assert_allclose(found, alone, atol=0.02)


def sights_of_a_square(seed, sigma, poses, rough=0.0):
    """Sights of the four walls of a square room of 8 m, each in two parts, from all poses."""
    rng, rows = np.random.default_rng(seed), []
    for k, pose in enumerate(poses):
        for wall in range(8):
            angle = wall // 2 * math.pi / 2
            u, n = np.array((math.cos(angle), math.sin(angle))), None
            n = np.array((-u[1], u[0]))
            centre = -4 * n + (2 if wall % 2 else -2) * u + rng.uniform(-0.5, 0.5) * u
            off, turn = rng.normal(0, sigma), rng.normal(0, sigma)
            off += rng.normal(0, rough)
            turn += rng.normal(0, rough)
            x, y, theta = relative(tuple(pose), (*(centre + off * n), angle + turn))
            rows.append((k, wall, x, y, theta))
    table = np.array(rows)
    return Sights(
        table[:, 0].astype(int),
        table[:, 1].astype(int),
        table[:, 2:4],
        table[:, 4],
        np.tile(np.eye(2) * sigma**2, (len(table), 1, 1)),
        np.tile((-1.0, 1.0), (len(table), 1)),
    )


POSES = np.array([(0.3 * k - 1.5, 0.1 * k, 0.4 * k) for k in range(12)])


def test_walls_have_the_covariance_that_they_scatter_by():
    """NEES of the walls, in the frame of the first pose, whose errors the others share."""
    loose = edges(POSES, [(k, k + 1) for k in range(11)], sigma=1.0)
    true_angle = np.arange(8) // 2 * math.pi / 2
    normals = np.column_stack((-np.sin(true_angle), np.cos(true_angle)))
    found = []
    for seed in range(60):
        poses = POSES + np.random.default_rng([seed, 1]).normal(0, 0.02, POSES.shape)
        poses[0] = POSES[0]
        _, lines, _ = adjust(poses, loose, sights_of_a_square(seed, 0.01, POSES), 8, True)
        off = (lines.points * normals).sum(axis=1) + 4
        turn = np.remainder(lines.angles - true_angle + math.pi, 2 * math.pi) - math.pi
        e = np.column_stack((off, turn))
        found.append(np.einsum("ni,nij,nj->n", e, np.linalg.inv(lines.covariances), e) / 2)
    assert np.mean(found) == pytest.approx(1.0, abs=0.15)


def test_roughness_is_found_and_parts_of_one_wall_are_merged():
    loose = edges(POSES, [(k, k + 1) for k in range(11)], sigma=1.0)
    for rough in (0.0, 0.02):
        found = []
        for seed in range(6):
            sights = roughened(sights_of_a_square(seed, 0.005, POSES, rough), 0.01)
            poses, lines, _ = adjust(POSES, loose, sights, 8)
            found.append(roughness(sights, lines, poses))
        assert 0.75 * rough <= np.mean(found) <= 1.1 * rough + 1e-3
        sights = roughened(sights, found[-1])
        np.testing.assert_allclose(sights.covariances[:, 0, 0], 0.005**2 + found[-1] ** 2)
        labels = merged(sights, lines, poses)
        # Parts that are apart are two walls: nobody has seen what is between them.
        assert labels.tolist() == [*range(8)]
        near = replace(sights, ends=np.tile((-2.5, 2.5), (len(sights.walls), 1)))
        assert merged(near, lines, poses).tolist() == [0, 0, 1, 1, 2, 2, 3, 3]


@pytest.fixture(scope="module")
def storey():
    return office(3, (24, 16), visits=0.1)


@pytest.fixture(scope="module")
def driven(storey):
    """A drive without odometry, every scan of which is extracted once."""
    scans, truth = storey.drive(SENSORS["utm30lx"], seed=1, rate=2, people=2, wheels=Wheels())
    extract, placed = Extractor(), Drive()
    kept = [scan for scan, _ in zip(scans, range(150), strict=False)]
    for scan in kept:
        placed.add(scan, extract(scan), scan.pose)
    return kept, truth[:150], placed


@pytest.mark.slow
def test_a_drive_becomes_a_map(driven, storey):
    scans, truth, placed = driven
    assert placed.lost == []
    assert len(placed.scans) == len(scans)
    made = make_map(placed.frames, placed.scans)
    assert absolute_errors(made.poses, truth).summary()["way_rmse"] < 0.03
    plan = LineMap.from_lines(storey.plan.segments, side=1)
    moved = onto_plan(made, placed.frames, plan)
    off = np.array([relative(a, b) for a, b in zip(truth, moved.poses, strict=True)])
    assert np.hypot(*off[:, :2].T).max() < 0.1
    with pytest.raises(LineamentError, match="not on the plan"):
        onto_plan(made, placed.frames, LineMap.from_lines([[0, 0, 1, 0], [0, 5, 3, 9]]))


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["dxf", "svg", "parquet"])
def test_the_command_writes_map_and_poses(tmp_path, ending):
    scans = list(drive(room(), [(-2, 0), (1, 0.5)], SENSORS["lms181"], speed=0.5, rate=4, seed=2))
    mixed = [*scans[:3], scans[4], scans[3], *scans[5:]]  # as in logs of several writers
    save_log(tmp_path / "log.npz", mixed)
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
    ("given", "message"),
    [
        (["-o", "m.dxf"], "no walls are seen in"),
        (["-o", "m.png"], "expected an ending of .dxf, .svg, .parquet"),
        (["-o", "m.svg", "--poses", "p.csv"], "expected an ending of .tum"),
        (["-o", "m.svg", "--onto", "none.dxf"], "none.dxf"),
    ],
)
def test_what_makes_no_map_is_one_line(tmp_path, monkeypatch, capsys, scans, given, message):
    monkeypatch.chdir(tmp_path)
    empty = LaserScan([np.inf] * 90, 0.0, 0.01)
    save_log("log.npz", [empty.with_pose((0.01 * k, 0, 0)) for k in range(scans)])
    assert run(["map", "log.npz", *given]) != 0
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / given[1]).exists()


def test_one_scan_is_a_map():
    scan = next(drive(room(), [(-2, 0), (1, 0.5)], SENSORS["lms361"]))
    placed = Drive()
    placed.add(scan, Extractor()(scan))
    made = make_map(placed.frames, placed.scans)
    assert made.poses == [(0, 0, 0)]
    assert len(made.map.walls) >= 4
