"""Two sessions as one map: `lineament map --onto --merge`, and what it refuses."""

import numpy as np
import pytest
from click.testing import CliRunner
from lineament_lab.evaluation.maps import doubled_walls

from lineament.cli import cli, run
from lineament.errors import NothingFoundError
from lineament.logs import save_log
from lineament.mapping import LineMap
from lineament.mapping.index import MAPPED
from lineament.mapping.sessions import (
    _add_common,
    _again,
    _seen_before,
    placements,
)
from lineament.scan.poses import relative
from lineament.simulation import SENSORS, World, drive
from lineament.tasks.mapping import Mapping, map_log
from lineament.walls import walls_of

#: Two rooms behind each other, and a door between them.
ROOMS = [
    (-3, -2, 3, -2), (3, -2, 3, 1.5), (3, 1.5, 1, 1.5), (1, 1.5, 1, 2.5), (1, 2.5, -1, 2.5),
    (-1, 2.5, -1, 3), (-1, 3, 4, 3), (4, 3, 4, 6.5), (4, 6.5, -2.5, 6.5), (-2.5, 6.5, -2.5, 3),
    (-2.5, 3, -2, 3), (-2, 3, -2, 2.5), (-2, 2.5, -3, 2.5), (-3, 2.5, -3, -2),
]  # fmt: skip
BELOW = [(-2, 0), (1.5, 0.5), (-2, 1), (1.5, -1), (-1, 0.5)]
#: From where the first drive begins, 1 m further on and turned.
BOTH = [(-1.5, 1), (-1.5, 5), (2.5, 4.5), (-1.5, 4), (-1.5, 0), (1.5, 0), (-1, -1)]


def box(x, y, half=0.3):
    """A box, seen from outside."""
    a, b, c, d = x - half, y - half, x + half, y + half
    return [(a, b, a, d), (a, d, c, d), (c, d, c, b), (c, b, a, b)]


def logged(path, way, *boxes):
    lines = ROOMS + [line for of in boxes for line in box(*of)]
    world = World(np.array(lines, float))
    scans = list(drive(world, way, SENSORS["lms361"], speed=0.6, rate=3, seed=len(way)))
    save_log(path, scans)
    return [scan.pose for scan in scans]


@pytest.fixture(scope="module")
def sessions(tmp_path_factory):
    """Monday's drive through a room, Tuesday's through two, in which a box is elsewhere."""
    folder = tmp_path_factory.mktemp("sessions")
    monday = logged(folder / "monday.npz", BELOW, (0.5, -1.2), (2.6, 1.1))
    tuesday = logged(folder / "tuesday.npz", BOTH, (-2.4, -1.2), (2.6, 1.1))
    for ending in ("parquet", "svg", "dxf", "yaml"):
        map_log(folder / "monday.npz", folder / f"monday.{ending}", odometry=False)
    return folder, monday, tuesday


def at_length(ends):
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()


def seen_at(plan, place):
    """Whether a wall of a plan passes near a place."""
    a, b = plan.ends[:, 0], plan.ends[:, 1]
    t = np.clip(((place - a) * (b - a)).sum(1) / ((b - a) ** 2).sum(1), 0, 1)
    return bool((np.hypot(*(place - a - t[:, None] * (b - a)).T) < 0.1).any())


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["parquet", "svg", "dxf", "yaml"])
def test_two_sessions_are_one_map(sessions, tmp_path, ending):
    folder, monday, tuesday = sessions
    both, poses = tmp_path / "both.parquet", tmp_path / "both.tum"
    given = ["map", folder / "tuesday.npz", "--onto", folder / f"monday.{ending}", "--merge"]
    given += ["-o", both, "--poses", poses, "--no-odometry"]
    result = CliRunner().invoke(cli, [*map(str, given)])
    assert result.exit_code == 0, result.output
    assert "walls of the plan seen again" in result.output
    found = np.loadtxt(poses)[:, 1:3]
    true = [relative(monday[0], pose)[:2] for pose in tuesday]
    assert np.linalg.norm(found - true, axis=1).max() < 0.05
    plan = LineMap.read(both)
    assert doubled_walls(plan.ends.reshape(-1, 4)) < 0.1
    for name, place in (("room", (0, -2)), ("other room", (1, 6.5)), ("box", (2.3, 1.1))):
        assert seen_at(plan, relative(monday[0], (*place, 0.0))[:2]), name
    # The box is where it was seen last.
    assert seen_at(plan, relative(monday[0], (-2.1, -1.2, 0.0))[:2])
    assert not seen_at(plan, relative(monday[0], (0.5, -0.9, 0.0))[:2])


@pytest.mark.slow
def test_what_was_not_seen_again_stays(sessions, tmp_path):
    """The other way around: of the map of two rooms the drive sees one."""
    folder, *_ = sessions
    map_log(folder / "tuesday.npz", tmp_path / "two.parquet", odometry=False)
    done = map_log(
        folder / "monday.npz", tmp_path / "both.parquet",
        onto=tmp_path / "two.parquet", merge=True, odometry=False,
    )  # fmt: skip
    two, both = (LineMap.read(tmp_path / f"{name}.parquet") for name in ("two", "both"))
    assert at_length(both.ends) == pytest.approx(at_length(two.ends), rel=0.1)
    assert done.merged.before == len(two.walls)
    assert 0 < done.merged.again < done.merged.before
    # Nothing is surer than the map that it was seen on.
    least = two.walls["covariance"][:, 0, 0].min()
    assert (both.walls["covariance"][:, 0, 0] > 0.99 * least).all()


@pytest.mark.slow
def test_a_map_of_sessions_is_a_map_like_any_other(sessions, tmp_path):
    """The same drive once more, and once more: nothing is added."""
    folder, *_ = sessions
    plans, before = [], folder / "monday.parquet"
    for k in range(3):
        after = tmp_path / f"{k}.parquet"
        map_log(folder / "tuesday.npz", after, onto=before, merge=True, odometry=False)
        plans.append(LineMap.read(after))
        before = after
    lengths = [at_length(plan.ends) for plan in plans]
    np.testing.assert_allclose(lengths, lengths[0], rtol=0.02)
    assert max(doubled_walls(plan.ends.reshape(-1, 4)) for plan in plans) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("merge", [True, False])
def test_another_building_is_refused_and_nothing_is_written(sessions, tmp_path, capsys, merge):
    folder, *_ = sessions
    lines = np.array([(0, 0, 9, 0), (9, 0, 9, 2), (9, 2, 5, 5), (5, 5, 0, 4), (0, 4, 0, 0)], float)
    LineMap.from_lines(lines, side=1).write(tmp_path / "other.svg")
    given = ["map", folder / "tuesday.npz", "--onto", tmp_path / "other.svg"]
    given += ["-o", tmp_path / "both.svg", *(["--merge"] if merge else [])]
    assert run([*map(str, given)]) == 3
    said = capsys.readouterr().err.splitlines()
    assert "not on the plan" in said[-1]
    assert sum(line.startswith("lineament:") for line in said) == 1
    assert [of.name for of in tmp_path.iterdir()] == ["other.svg"]


def test_merging_is_for_a_plan(refused, tmp_path):
    (tmp_path / "log.npz").touch()
    given = ["map", tmp_path / "log.npz", "-o", tmp_path / "a.svg", "--merge"]
    assert "--merge is for the plan of --onto" in refused(given, 2)
    with pytest.raises(ValueError, match="merge is for a plan"):
        map_log(tmp_path / "log.npz", tmp_path / "a.svg", merge=True)


def test_parts_that_are_not_on_the_plan_are_named():
    about = {"log": "a", "output": "b", "scans": 9, "frames": 9, "lost": 0, "loops": 0}
    about |= {"refused": 0, "known": [0.1] * 3, "unsure": [], "map": None, "seconds": 1.0}
    made = Mapping(ways=[30.0, 8.0, 11.0], located=(0, 2), **about)
    beside = "parts of the drive are not found on the plan, and lie beside it: 8 m of way"
    assert made.warning == beside
    assert Mapping(ways=[30.0, 8.0], located=(0, 1), **about).warning == ""
    assert Mapping(ways=[30.0], **about).warning == ""
    assert "in 2 parts" in Mapping(ways=[30.0, 8.0], **about).warning


def test_of_a_wall_seen_from_either_side_one_is_enough():
    """Four walls: seen from one side; from either, of which one, the other, and none was seen."""
    walls = walls_of(np.zeros((7, 2, 2)))
    walls["side"][:1] = 1
    is_left, count = _again(walls, np.array([1, 1, 0, 0, 0, 1, 0], bool))
    assert is_left.tolist() == [0, 0, 0, 1, 0, 0, 0]
    assert count == 3


def test_drawings_are_known_as_maps_are_seen_later():
    plan = LineMap.from_lines([(0, 0, 4, 0)], side=0)
    old, loose, is_drawn = _seen_before(plan)
    assert is_drawn.tolist() == [True, True]
    np.testing.assert_allclose(old["start"], [(0, 0), (4, 0)])
    np.testing.assert_allclose(loose["covariance"][:, 0, 0], MAPPED**2)
    walls = walls_of(np.array([[(0.0, 0.0), (4.0, 0.0)]]), side=1, covariance=np.diag((0.04, 1e-4)))
    old, loose, is_drawn = _seen_before(LineMap(walls))
    assert is_drawn.tolist() == [False]
    np.testing.assert_allclose(old["covariance"][0], np.diag((0.04, 1e-4)))
    np.testing.assert_allclose(loose["covariance"][0, 0, 0], MAPPED**2)


def test_what_the_walls_around_are_off_counts_for_what_is_seen_beside_them():
    """A wall that was seen again; one 2 m further on along it, back to back; and one across."""
    ends = np.array([[(0, 0), (2, 0)], [(4, 1), (2, 1)], [(0, 0), (0, 2)]], float)
    lines = walls_of(ends, covariance=np.diag((1e-6, 1e-8)))
    old = walls_of(ends[:1], covariance=[[1e-4, 2e-5], [2e-5, 1e-5]])
    found = lines.copy()
    _add_common(found, np.array([True]), np.array([0]), old)
    added = found["covariance"] - lines["covariance"]
    np.testing.assert_allclose(added[0], old["covariance"][0])
    # Turned by one deviation, a place 2 m on is off by 2 m of it more.
    np.testing.assert_allclose(added[1, 0, 0], 1e-4 + 2 * 2 * 2e-5 + 4 * 1e-5)
    np.testing.assert_allclose(added[1, 1, 1], 1e-5)
    _add_common(found, np.array([False]), np.array([0]), old)  # none was: nothing is known
    np.testing.assert_allclose(found["covariance"] - lines["covariance"], added)


def test_without_a_place_there_is_no_placement(monkeypatch):
    class Made:
        class parts:  # noqa: N801
            deviations = np.zeros(2)
            frames = staticmethod(lambda _: np.arange(3))

        survey = None

    monkeypatch.setattr("lineament.mapping.sessions.surely_on", lambda *_: None)
    with pytest.raises(NothingFoundError, match="expected 3 places along the way"):
        placements(Made, None)
