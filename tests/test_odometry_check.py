"""Odometry that contradicts the scans: it is left out, and warned of."""

import math
import warnings
from itertools import pairwise

import numpy as np
import pytest
from robot_driving import storey_driven

import lineament as ln
from lineament.cli import run
from lineament.logs import save_log
from lineament.mapping import LineMap, wheels
from lineament.mapping.drive_map import Drive
from lineament.mapping.following import Follower, follow
from lineament.mapping.wheels import OdometryCheck, with_twists
from lineament.scan.poses import compose, relative

SAID = "odometry contradicts the scans, and is left out where it does"
WRONG = {
    "mirrored": lambda pose: (pose[0], -pose[1], -pose[2]),
    "of a scanner that looks back": lambda pose: compose(pose, (0.0, 0.0, math.pi)),
    "of a scanner that looks left": lambda pose: compose(pose, (0.0, 0.0, math.pi / 2)),
    "without headings": lambda pose: (pose[0], pose[1], 0.0),
    "that stands": lambda pose: (0.0, 0.0, 0.0),  # noqa: ARG005
    "of half the way": lambda pose: (pose[0] / 2, pose[1] / 2, pose[2]),
}


@pytest.fixture(scope="module")
def drive():
    storey, scans, truth = storey_driven()
    return LineMap.from_lines(storey.plan.segments, side=1), scans, truth


def believed(check, scans):
    return [check(scan, scan.pose) is not None for scan in scans]


def test_wheels_that_slip_are_believed(drive):
    assert all(believed(OdometryCheck(), drive[1]))


@pytest.mark.parametrize(("kind", "after"), list(zip(WRONG, (26, 12, 10, 29, 12, 12), strict=True)))
def test_wrong_odometry_is_left_out_and_warned_of_once(drive, kind, after):
    # A robot that goes straight ahead for long does so in a mirror, too, and without headings.
    scans = [scan.with_pose(WRONG[kind](scan.pose)) for scan in drive[1]]
    with pytest.warns(ln.LineamentWarning, match=SAID) as said:
        known = believed(OdometryCheck(), scans)
    assert len(said) == 1
    assert known == [True] * after + [False] * (len(scans) - after)


def test_the_cumulated_sum_by_hand(monkeypatch):
    holds = iter([False] * 5 + [True] + [False] * 3 + [True] * 24 + [False] + [True] * 2)
    monkeypatch.setattr(wheels, "agreement", lambda *_: [0.85 if next(holds) else 0.84])
    check, scan = OdometryCheck(), ln.LaserScan([1.0], 0.0, 0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ln.LineamentWarning)
        # 0.2 m are too little to compare; 0.6 m are enough.
        known = [check(scan, (0.2 * k, 0.0, 0.0)) is not None for k in range(3 * 36 + 1)][::3]
    # ln 1000 = 6.9; five times ln 2.5 = 0.92 give 11.49 of 11.51; one that holds takes 0.47.
    expected = [True] * 7 + [False]
    assert known[:8] == expected
    # 11.51 less 24 of those that hold is 0.23, more by one that fails: 1.15, less two: 0.21.
    assert not any(known[7:])


def test_odometry_that_goes_with_the_scans_again_is_believed_again(drive):
    _, scans, _ = drive
    turned = [scan.with_pose(WRONG["mirrored"](scan.pose)) for scan in scans[:60]]
    with pytest.warns(ln.LineamentWarning, match=SAID):
        known = believed(OdometryCheck(), turned + scans + scans[::-1])
    assert not known[60]
    assert all(known[130:])


def test_scans_that_share_nothing_say_nothing(drive):
    blind = ln.LaserScan(np.full(181, np.nan), -math.pi / 2, math.pi / 180)
    check = OdometryCheck()
    for k in range(50):
        check(blind, (float(k), 0.0, 0.0))
    assert check.is_believed
    with pytest.warns(ln.LineamentWarning, match=SAID):
        known = believed(check, [s.with_pose(WRONG["mirrored"](s.pose)) for s in drive[1]])
    assert known.index(False) == 26  # as if it had seen nothing before


def test_scans_without_odometry_are_not_compared(drive):
    check = OdometryCheck()
    assert not any(check(scan, None) for scan in drive[1])
    assert check.is_believed


@pytest.mark.parametrize("kind", ["mirrored", "of a scanner that looks back"])
def test_who_follows_leaves_wrong_odometry_out(drive, kind):
    plan, scans, truth = drive
    wrong = [scan.with_pose(WRONG[kind](scan.pose)) for scan in scans]
    with pytest.warns(ln.LineamentWarning, match=SAID):
        found = [where for _, where in follow(wrong, plan, ln.Extractor())]
    late = [(where, pose) for where, pose in zip(found, truth, strict=True) if where][-40:]
    assert len(late) == 40
    off = np.array([relative(pose, where.pose) for where, pose in late])
    assert np.abs(off[:, :2]).max() < 0.1
    assert np.abs(off[:, 2]).max() < math.radians(1.5)


def test_a_follower_says_whether_it_believes_odometry(drive):
    plan, scans, _ = drive
    follower, extract = Follower(plan), ln.Extractor()

    def seen(turned):
        return [follower(extract(scan), turned(scan.pose)) for scan in scans[:40]]

    seen(lambda pose: pose)
    assert follower.believes_odometry
    with pytest.warns(ln.LineamentWarning, match=SAID):
        seen(WRONG["of a scanner that looks left"])
    assert not follower.believes_odometry


def test_a_map_is_made_without_wrong_odometry(drive):
    _, scans, truth = drive
    made, extract = Drive(), ln.Extractor()

    def add(scan):
        made.add(scan, extract(scan), WRONG["mirrored"](scan.pose))

    with pytest.warns(ln.LineamentWarning, match=SAID):
        list(map(add, scans))
    for before, frame in pairwise(made.frames):
        if frame.index > 26:
            right = relative(truth[before.index], truth[frame.index])
            np.testing.assert_allclose(relative(right, frame.motion.pose), 0, atol=0.05)
            assert not frame.is_lost
            assert not frame.has_odometry


def test_the_twist_while_a_scan_is_swept_is_that_to_the_next_scan():
    poses = [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0), None, (0.5, 0.0, 0.0), (0.5, 0.0, 0.2)]
    stamps = [0.0, 0.1, 0.2, 0.3, 0.5]
    scans = [
        ln.LaserScan([1.0], 0.0, 0.1, stamp=stamp).with_pose(pose)
        for stamp, pose in zip(stamps, poses, strict=True)
    ]
    found = list(with_twists(scans, odometry=True))
    assert [scan for scan, _ in found] == scans
    twists = [None if twist is None else pytest.approx(twist) for _, twist in found]
    assert twists == [(1.0, 0, 0), None, None, (0, 0, 1.0), (0, 0, 1.0)]
    assert [twist for _, twist in with_twists(scans, odometry=False)] == [None] * 5
    late = [scan.stamped("first", k * 10**10) for k, scan in enumerate(scans[:2])]
    assert [twist for _, twist in with_twists(late, odometry=True)] == [None, None]
    assert list(with_twists([], odometry=True)) == []


def test_commands_warn_of_it(tmp_path, drive, capsys):
    plan, scans, _ = drive
    wrong = [scan.with_pose(WRONG["mirrored"](scan.pose)) for scan in scans[:70]]
    save_log(tmp_path / "a.npz", wrong)
    plan.write(tmp_path / "plan.dxf")
    log = str(tmp_path / "a.npz")
    commands = (
        ["locate", log, "--map", str(tmp_path / "plan.dxf"), "-o", str(tmp_path / "a.csv")],
        ["map", log, "-o", str(tmp_path / "a.svg")],
    )
    for command in commands:
        for given in ([], ["--no-odometry"]):
            assert run([*command, *given]) == 0
            assert (SAID in capsys.readouterr().err) == (not given)
