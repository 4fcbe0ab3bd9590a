"""What a map says of itself: parts that do not hang together, and poses that are not sure."""

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from lineament_lab.evaluation.maps import absolute_errors
from robot_driving import storey_driven
from small_room import placed

from lineament import LineamentWarning, open_log
from lineament.cli import cli
from lineament.logs import save_log
from lineament.mapping import LineMap
from lineament.mapping.adjust import edges_of, errors_of_motions, optimise
from lineament.mapping.believed import believed
from lineament.mapping.loops import Survey
from lineament.mapping.making import make_map
from lineament.mapping.parts import apart, beside, between, boxes_of, parts_of
from lineament.mapping.sessions import merge_onto, onto_plan, placements
from lineament.scan.poses import compose, inverse, relative
from lineament.walls.sights import SIGHT, lines_of, sights_of


def adjusted(poses, edges):
    return optimise(poses, edges, rounds=2)


def chain(n, sigma=0.01, step=1.0):
    """Poses on a straight way, and the motions between them, all of one deviation."""
    poses = np.column_stack((step * np.arange(n), np.zeros((n, 2))))
    pairs = [(k, k + 1) for k in range(n - 1)]
    spreads = np.tile(np.diag((sigma, sigma, 1e-4)) ** 2, (n - 1, 1, 1))
    return poses, edges_of(pairs, np.tile((step, 0.0, 0.0), (n - 1, 1)), spreads)


def test_covariances_between_poses_are_those_of_the_dense_inverse():
    rng = np.random.default_rng(3)
    poses, edges = chain(9, 0.05)
    poses[:, 2] = rng.uniform(-3, 3, 9)
    edges["motion"] = 0.0
    edges["motion"] = errors_of_motions(edges, poses)[0]
    root = rng.normal(size=(8, 3, 3))
    edges["information"] = root @ root.transpose(0, 2, 1) + 10 * np.eye(3)
    found = adjusted(poses, edges)
    pairs = np.array([(0, 5), (7, 2), (3, 4), (6, 6)])
    inverse = np.linalg.inv(found.matrix.toarray())
    for (a, b), spread in zip(pairs, between(found.poses, pairs, found.solver()), strict=True):
        jacobian = np.zeros((3, 27))
        for column in range(27):
            motions = []
            for sign in (1e-6, -1e-6):
                moved = found.poses.ravel().copy()
                moved[column] += sign
                first, last = moved.reshape(-1, 3)[[a, b]].tolist()
                motions.append(relative(tuple(first), tuple(last)))
            jacobian[:, column] = np.subtract(*motions) / 2e-6
        np.testing.assert_allclose(spread, jacobian @ inverse @ jacobian.T, atol=1e-8)


def test_what_is_known_is_one_part_and_its_deviation_grows_with_the_way():
    poses, edges = chain(17, 0.1)
    found = parts_of(adjusted(poses, edges), edges, np.zeros(17, bool))
    assert found.count == 1
    assert found.unsure.tolist() == []
    assert found.is_sure.all()
    # Sixteen motions of 0.1 m each; their turns add little.
    assert found.deviations[0] == pytest.approx(0.4, rel=0.01)


@pytest.mark.parametrize(
    ("sigma", "parts", "unsure"), [(0.2, 1, []), (0.5, 1, [[7, 8]]), (2.0, 2, [[7, 8]])]
)
def test_a_motion_that_is_not_known_ends_a_part(sigma, parts, unsure):
    """Known to 0.3 m it is sure, beyond 0.75 m nothing hangs together."""
    poses, edges = chain(16)
    edges["information"][7, 0, 0] = sigma**-2
    found = parts_of(adjusted(poses, edges), edges, np.zeros(16, bool))
    assert found.count == parts
    assert found.unsure.tolist() == unsure
    assert found.numbers.tolist() == 8 * [0] + 8 * [parts - 1]
    assert found.roots.tolist() == [0, 8][:parts]


def test_a_loop_joins_what_the_way_does_not():
    poses, edges = chain(24)
    edges["information"][(7, 15), :, :] = np.eye(3) * 1e-2
    found = parts_of(adjusted(poses, edges), edges, np.zeros(24, bool))
    assert found.numbers.tolist() == 8 * [0] + 8 * [1] + 8 * [2]
    loop = edges_of([(2, 20)], [(18.0, 0.0, 0.0)], [np.eye(3) * 1e-4], loop=True)
    found = parts_of(adjusted(poses, np.append(edges, loop)), edges, np.zeros(24, bool))
    assert found.numbers.tolist() == 8 * [0] + 8 * [1] + 8 * [0]
    assert found.unsure.tolist() == [[7, 8], [15, 16]]


def test_doubted_key_frames_are_not_sure_unless_what_lies_around_them_is_known():
    """Odometry over four doubted key frames, of 0.1 m each, or of 0.25 m.

    With the last of them a new stretch begins: what follows is placed beside it.
    """
    is_doubted = np.zeros(20, bool)
    is_doubted[8:12] = True
    for sigma, unsure in ((0.1, []), (0.25, [[7, 11]])):
        poses, edges = chain(20)
        edges["information"][7:12, :2, :2] = np.eye(2) * sigma**-2
        found = parts_of(adjusted(poses, edges), edges, is_doubted)
        assert found.unsure.tolist() == unsure
        assert found.is_sure.tolist() == [not unsure or not 8 <= k < 11 for k in range(20)]


def test_a_start_and_an_end_that_are_not_known_are_of_the_part_beside_them():
    poses, edges = chain(12)
    edges["information"][[0, 1, 10]] = np.eye(3) * 1e-2
    found = parts_of(adjusted(poses, edges), edges, np.zeros(12, bool))
    assert found.count == 1
    assert found.unsure.tolist() == [[0, 2], [10, 11]]
    assert found.is_sure.tolist() == [False, False, *9 * [True], False]
    assert found.roots.tolist() == [2]


def test_parts_lie_beside_each_other_and_have_walls_of_their_own():
    poses, edges = chain(16)
    edges["information"][7] = np.eye(3) * 1e-2
    sights = np.zeros(16, SIGHT)  # one wall along the way, which both parts see
    sights["frame"], sights["ends"] = np.arange(16), (-2.0, 2.0)
    sights["centroid"], sights["covariance"] = (0.0, 1.0), np.eye(2) * 1e-4
    found = optimise(poses, edges, sights)
    parts = parts_of(found, edges, np.zeros(16, bool))
    assert parts.count == 2
    moved, hung, of_parts = apart(found, edges, sights, parts)
    assert of_parts["wall"].tolist() == 8 * [0] + 8 * [1]
    first, second = moved.poses[:8], moved.poses[8:]
    assert second[:, 0].min() - 2.0 == pytest.approx(first[:, 0].max() + 2.0 + 6.0)
    np.testing.assert_allclose(np.diff(second, axis=0), np.diff(poses[8:], axis=0), atol=1e-9)
    np.testing.assert_allclose(moved.lines["centroid"][:, 1], 1.0)
    # No motion leads from one to the other, and what is left agrees with the poses.
    assert (parts.numbers[hung["ends"][:, 0]] == parts.numbers[hung["ends"][:, 1]]).all()
    np.testing.assert_allclose(errors_of_motions(hung, moved.poses)[0], 0.0, atol=1e-9)
    again = optimise(moved.poses, hung, of_parts, held=parts.roots)
    np.testing.assert_allclose(again.poses, moved.poses, atol=1e-6)


def test_boxes_lie_in_a_row_beside_those_that_stay():
    points = np.array([(0, 0), (2, 1), (5, 5), (9, 7), (-3, -3), (-2, 4)], float)
    boxes = boxes_of(points, np.repeat([0, 1, 2], 2))
    moves = beside(boxes, np.array([0, 1]))
    assert moves.tolist() == [[0, 0], [0, 0], [9 + 6 + 3, 3]]


def mapped(scans, odometry):
    drive = placed(scans, odometry)
    return make_map(drive.frames, drive.scans)


def errors_by_part(made, truth):
    """Absolute errors [m] of the sure poses of each part beside themselves."""
    part, is_sure = (of[made.frame_of] for of in (made.parts.numbers, made.parts.is_sure))
    found = []
    for k in range(made.parts.count):
        chosen = np.flatnonzero((part == k) & is_sure).tolist()
        both = [[of[i] for i in chosen] for of in (made.poses, truth)]
        found.append(absolute_errors(*both).summary()["way_rmse"])
    return found


@pytest.mark.slow
@pytest.mark.parametrize("odometry", [True, False])
@pytest.mark.parametrize("seen", [np.inf, 0.25])
def test_a_scanner_that_is_blocked_is_named(seen, odometry):
    """For thirty scans nothing comes back, or a cover just before it does.

    Odometry that goes on is off by 1.3 m after it; loops to what came before show that: then all
    of the way is known, and right to 2 cm. Without loops, what lies between is not sure.
    """
    _, scans, truth = storey_driven(3, 170)
    cover = seen + 0.02 * np.random.default_rng(0).normal(size=len(scans[0]))
    scans = [scan._changed(ranges=cover) if 80 <= k < 110 else scan for k, scan in enumerate(scans)]
    made = mapped(scans, [scan.pose if odometry else None for scan in scans])
    assert max(errors_by_part(made, truth)) < 0.02
    is_tied = odometry and seen == np.inf
    assert bool(len(made.loops)) == is_tied
    assert any(first <= 80 and last >= 109 for first, last, _ in made.unsure) == (not is_tied)


@pytest.mark.slow
def test_odometry_that_jumps_ends_a_part_or_is_bridged_by_walls():
    _, scans, truth = storey_driven(3, 170)
    far = (50.0, 10.0, 1.0)
    jumps = [scan.pose if k < 100 else compose(far, scan.pose) for k, scan in enumerate(scans)]
    made = mapped(scans, jumps)
    assert max(errors_by_part(made, truth)) < 0.02
    if made.parts.count > 1:
        assert [(first, last) for first, last, _ in made.unsure] == [(99, 100)]
    # No wall lies 50 m away.
    assert max(made.ways) < 70


@pytest.mark.slow
def test_odometry_of_another_robot_is_not_believed():
    (_, scans, truth), (_, others, _) = storey_driven(3, 150), storey_driven(5, 150)
    with pytest.warns(LineamentWarning, match="odometry contradicts the scans, and is left out"):
        made = mapped(scans, [scan.pose for scan in others])
    assert max(errors_by_part(made, truth)) < 0.01
    # Until it is left out, the robot is lost where the two did not go alike.
    ((first, last, _),) = made.unsure
    assert 10 < first < last < 30


@pytest.mark.slow
def test_two_floors_are_two_parts_and_each_is_found_on_its_own_plan():
    (ground, below, truth), (_, above, of_above) = storey_driven(3), storey_driven(7)
    made = mapped([*below, *above], [None] * 300)
    assert made.parts.count == 2
    assert made.parts.numbers[made.frame_of].tolist() == 150 * [0] + 150 * [1]
    assert max(errors_by_part(made, [*truth, *of_above])) < 0.02
    assert len(made.walls_of) == len(made.map.walls)
    ends = [made.map.ends[made.walls_of == k].reshape(-1, 2) for k in (0, 1)]
    assert ends[0][:, 0].max() < ends[1][:, 0].min()
    # Of the upper floor the plan of the lower one says nothing: it stays beside it.
    plan = LineMap.from_lines(ground.plan.segments, side=1)
    on_plan = onto_plan(made, plan, placements(made, plan))
    assert on_plan.located == (0,)
    off = [relative(a, b) for a, b in zip(truth, on_plan.poses, strict=False)]
    assert np.hypot(*np.array(off)[:, :2].T).max() < 0.1
    beyond = on_plan.map.ends[on_plan.walls_of == 1].reshape(-1, 2)[:, 0]
    assert beyond.min() > plan.ends[:, :, 0].max()
    np.testing.assert_array_equal(on_plan.walls_of, made.walls_of)
    # As one map with it, the upper floor is left out, and no wall of the lower one is missing.
    merged = merge_onto(made, plan, placements(made, plan))
    assert merged.made.located == (0,)
    assert merged.made.map.ends[:, :, 0].max() < plan.ends[:, :, 0].max() + 0.1
    assert merged.again > 50
    assert merged.gone < 1.0


@pytest.mark.slow
def test_two_floors_are_two_parts_with_odometry_that_stands_still_in_the_lift():
    (_, below, truth), (_, above, of_above) = storey_driven(3, 80), storey_driven(5, 80)
    lift = compose(below[-1].pose, inverse(above[0].pose))
    odometry = [scan.pose for scan in below] + [compose(lift, scan.pose) for scan in above]
    made = mapped([*below, *above], odometry)
    assert made.parts.numbers[made.frame_of].tolist() == 80 * [0] + 80 * [1]
    assert max(errors_by_part(made, [*truth, *of_above])) < 0.02


@pytest.mark.slow
def test_odometry_over_a_lost_key_frame_is_believed_unless_walls_deny_it():
    """What is seen after it goes on, lies where nothing was seen, or contradicts what was."""
    _, scans, _ = storey_driven(3, 60)
    frames = placed(scans, [scan.pose for scan in scans]).frames
    poses = np.array([frame.pose for frame in frames])
    frames[30] = replace(frames[30], is_lost=True)
    sights = sights_of([(frame.features.segments, frame.walls) for frame in frames], 0.01)
    lines = lines_of(sights, poses, int(sights["wall"].max()) + 1)
    for move, is_believed in (
        ((0.0, 0.0, 0.0), True),
        ((99.0, 0.0, 0.0), True),
        ((0, 0, 2), False),
    ):
        moved, at = poses.copy(), tuple(poses[30])
        by = compose(compose(at, move), inverse(at))
        moved[30:] = [compose(by, tuple(pose)) for pose in poses[30:]]
        found = believed(Survey(frames, moved, sights, lines_of(sights, moved, len(lines))))
        assert [frame.is_torn for frame in found] == [
            k == 30 and not is_believed for k in range(len(frames))
        ]


@pytest.mark.slow
@pytest.mark.parametrize("clock", ["none", "set back", "each fifth lost"])
def test_a_log_is_mapped_in_its_order_whatever_the_clock(tmp_path, clock):
    _, scans, truth = storey_driven(3, 60)
    stamps = np.array([scan.stamp_ns for scan in scans])
    if clock == "none":
        stamps[:] = 0
    elif clock == "set back":
        stamps[30:] -= 10**10
    else:
        stamps[::5] = 0
    pairs = zip(scans, stamps.tolist(), strict=True)
    save_log(tmp_path / "log.npz", [scan.stamped("first", stamp) for scan, stamp in pairs])
    given = ["map", str(tmp_path / "log.npz"), "-o", str(tmp_path / "a.svg"), "--no-odometry"]
    said = pytest.warns(LineamentWarning, match="all rows have the stamp 0")
    with said if clock == "none" else nullcontext():
        result = CliRunner().invoke(cli, [*given, "--poses", str(tmp_path / "a.tum")])
    assert result.exit_code == 0, result.output
    rows = np.loadtxt(tmp_path / "a.tum")
    off = rows[:, 1:3] - [relative(truth[0], pose)[:2] for pose in truth]
    assert np.hypot(*off.T).max() < 0.02


@pytest.mark.slow
def test_the_command_says_what_does_not_hang_together(tmp_path):
    whole = storey_driven(3, 60)[1]
    later = [scan.stamped("first", scan.stamp_ns + 10**11) for scan in storey_driven(7, 60)[1]]
    for scans, is_torn in ((whole, False), ([*whole, *later], True)):
        save_log(tmp_path / "log.npz", scans)
        given = ["map", str(tmp_path / "log.npz"), "-o", str(tmp_path / "a.yaml")]
        drawn = ["--picture", str(tmp_path / "a.png")]
        result = CliRunner().invoke(cli, [*given, *drawn, "--no-odometry"])
        assert result.exit_code == 0, result.output
        assert (tmp_path / "a.png").stat().st_size > 5000
        assert ("the map is in 2 parts" in result.stderr) == is_torn
        assert ("of the way: of scans 59 to 60" in result.stdout) == is_torn
        assert ("in each part from the start" in result.stdout) == is_torn


@pytest.mark.slow
@pytest.mark.parametrize(
    ("log", "most", "parts", "worst"),
    [("csail", 7.0, 1, 0.15), ("intel", 40.0, 1, 0.4), ("aces", 30.0, 1, 0.2)],
)
def test_real_logs_say_where_they_are_not_sure(data_dir, log, most, parts, worst):
    """Each is whole without odometry, and names the places where it was lost or saw little."""
    path = data_dir / f"carmen/{log}-corrected.log.gz"
    scans = list(open_log(path))
    made = mapped(scans, [None] * len(scans))
    assert sum(way for *_, way in made.unsure) <= most
    assert made.parts.count == parts
    errors = errors_by_part(made, [scan.pose for scan in scans])
    assert max(errors) < worst
    for error, deviation in zip(errors, made.parts.deviations, strict=True):
        assert error < 3 * deviation
