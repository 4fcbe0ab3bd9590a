"""Scores of tracks and motions, by hand; ICP."""

import math
from dataclasses import replace

import numpy as np
import pytest
from handmade import corner, features, segment
from lineament_lab.evaluation.icp import icp
from lineament_lab.evaluation.relations import read_relations
from lineament_lab.evaluation.tracking import MotionErrors, chained, motion_errors, track_scores

from lineament import LaserScan, LogError, RangeNoise
from lineament.motion import Tracks
from lineament.scan.poses import compose, inverse, relative
from lineament.simulation import SENSORS, room

NONE = np.empty(0, np.int64)
STILL = [(0.0, 0.0, 0.0)] * 2


def tracks_of(segments, corners=(), born=()):
    numbers = (np.array(n, np.int64) for n in (segments, corners))
    return Tracks(*numbers, NONE, np.array(born, np.int64), NONE, None)


def test_motion_errors_by_hand():
    # A quarter turn each metre, the second leg 10 cm too long.
    turn = math.pi / 2
    poses = [(0.0, 0.0, 0.0), (1.0, 0.0, turn), (1.0, 1.0, 2 * turn)]
    motions = [(1.0, 0.0, turn), (1.1, 0.0, turn - 0.02)]
    np.testing.assert_allclose(chained(motions)[1:], [motions[0], (1, 1.1, math.pi - 0.02)])
    errors, over_both = (motion_errors(motions, poses, step) for step in (1, 2))
    np.testing.assert_allclose(errors.ways, [0.0, 0.1], atol=1e-12)
    np.testing.assert_allclose(errors.turns, [0.0, 0.02], atol=1e-12)
    np.testing.assert_allclose(over_both.ways, [0.1], atol=1e-12)
    # Two of three are off by 0.1 m and 0.02: the variance is 2/3 - 4/9 of the square of that.
    shares = {"rmse": math.sqrt(2 / 3), "mean": 2 / 3, "std": math.sqrt(2) / 3}
    shares |= {"median": 1, "p95": 1}
    assert (errors + over_both).summary() == pytest.approx(
        {"motions": 3}
        | {f"way_{key}": 0.1 * share for key, share in shares.items()}
        | {f"turn_{key}": 0.02 * share for key, share in shares.items()}
    )
    for nothing in (MotionErrors(), motion_errors(motions, poses, 3)):
        count, *figures = nothing.summary().values()
        assert count == 0
        assert all(map(math.isnan, figures))
    with pytest.raises(ValueError, match="there are 3 poses, expected one more than motions"):
        motion_errors(motions[:1], poses)


def test_relations_by_hand(tmp_path):
    """Scans out of order in time, of which two have stamps that are nearly the same."""
    stamps = np.array([200.0, 100.0, 130.0, 130.0015, 160.1])
    rows = [
        *("100.0009 200 1 2 9 9 9 1.5", "130 100 0.1 0 0 0 0 0.2", ""),
        *("100 160.1001 0 0 0 0 0 -3", "100 160 0 0 0 0 0 0", "99.9989 200 0 0 0 0 0 0"),
        "130.0011 130.0004 0 0 0 0 0 0",
    ]
    path = tmp_path / "log.relations"
    path.write_text("\n".join(rows))
    relations = read_relations(path, stamps)
    assert relations.scans.tolist() == [[1, 0], [2, 1], [1, 4], [3, 2]]
    assert relations.motions[:2].tolist() == [[1, 2, 1.5], [0.1, 0, 0.2]]
    assert relations.seconds == pytest.approx([99.9991, 30, 60.1001, 0.0007])
    far = relations.far_apart()
    assert far.scans.tolist() == [[1, 0], [1, 4]]
    assert relations.far_apart(False).scans.tolist() == [[2, 1], [3, 2]]
    # Of the first 0.5 m and 0.1 rad, of the second a turn of 3.2 rad, which is 2π less 3.2.
    poses = [(0.0, 0.0, 0.0)] * 5
    poses[1] = (4.0, 1.0, math.pi / 2)
    poses[0] = (4.0 - 2.3, 1.0 + 1.4, math.pi / 2 + 1.6)
    poses[4] = (4.0, 1.0, math.pi / 2 + 0.2)
    errors = far.errors(poses)
    np.testing.assert_allclose(errors.ways, [0.5, 0.0], atol=1e-12)
    np.testing.assert_allclose(errors.turns, [0.1, 2 * math.pi - 3.2])


@pytest.mark.parametrize("text", ["1 2 3\n", "1 2 0 0 0 0 0 x\n", "1 2 0 0 0 0 0 0\n1\n"])
def test_no_file_of_relations(tmp_path, text):
    (tmp_path / "a").write_text(text)
    with pytest.raises(LogError, match="a: is no file of relations: expected eight numbers a l"):
        read_relations(tmp_path / "a", np.arange(3.0))
    with pytest.raises(LogError, match="b: "):
        read_relations(tmp_path / "b", np.arange(3.0))


def test_relations_of_the_corrected_poses_are_those_known(data_dir):
    """350 of Intel are of its scans, and its corrected poses are .0313 ± .0225 m off."""
    from lineament_lab.evaluation.arena import archived_scans

    scans = archived_scans(data_dir / "truth/intel_graph.npz")
    stamps = np.array([scan.stamp for scan in scans])
    relations = read_relations(data_dir / "graph/intel-lab.relations", stamps)
    figures = relations.errors([scan.pose for scan in scans]).summary()
    found = [figures[name] for name in ("motions", "way_mean", "way_std")]
    assert found == pytest.approx([350, 0.0313, 0.0225], abs=5e-5)


def test_switches_losses_and_lengths_by_hand():
    pose = (0.5, 0.2, 0.3)
    walls = [segment((3, -2), (3, 2), 10, 30), segment((3, 2), (-3, 2), 31, 60)]
    first = features(segments=walls, corners=[corner(3, 2), corner(-3, 2), corner(0, 0)])
    second = first.transform(*inverse(pose))
    tracks = [
        tracks_of([0, 1], [2, 3, -1], born=[0, 1, 2, 3]),  # The last corner has no track.
        tracks_of([1, 0], [2, 4, -1], born=[4]),
    ]
    scores = track_scores([first, second], tracks, [(0.0, 0.0, 0.0), pose])
    segments, corners = scores["segments"], scores["corners"]
    assert (segments.pairs, segments.switched, segments.lost) == (2, 2, 0)
    assert (corners.pairs, corners.switched, corners.lost) == (2, 0, 1)
    assert corners.summary() == pytest.approx(
        {
            "pairs": 2,
            "kept": 0.5,
            "switched": 0,
            "lost": 0.5,
            "length_mean": 4 / 3,
            "length_p90": 1.8,
        }
    )
    assert (segments + corners).summary()["kept"] == 0.25


@pytest.mark.parametrize(("x", "pairs"), [(3.09, 2), (3.11, 1)])
def test_corners_are_the_same_within_10_cm(x, pairs):
    tracks = [tracks_of([], [2, 3])] * 2
    frames = [features(corners=[corner(at, 2), corner(-3, 2)]) for at in (3, x)]
    assert track_scores(frames, tracks, STILL)["corners"].pairs == pairs


@pytest.mark.parametrize(
    ("start", "end", "pairs"),
    [
        ((3.09, 1), (3.09, 2.9), 1),
        ((3.11, 1), (3.11, 2.9), 0),
        ((3, 1.5), (3, 2.6), 0),  # 0.5 m of 1.1 m beside it
        ((3, 1.4), (3, 2.5), 1),
        ((3, 2), (3, -2), 0),  # the other side
        ((2.93, -0.4), (3.07, 0.4), 1),  # turned by 9.9°
        ((2.92, -0.4), (3.08, 0.4), 0),  # turned by 11.3°
        ((3.06, 1.4), (2.94, 2.2), 0),  # on the line, which is 27 cm from it
    ],
)
def test_segments_are_the_same_if_they_lie_side_by_side(start, end, pairs):
    frames = [
        features(segments=[segment(*ends, 10, 30)]) for ends in (((3, -2), (3, 2)), (start, end))
    ]
    for both in (frames, frames[::-1]):
        assert track_scores(both, [tracks_of([0])] * 2, STILL)["segments"].pairs == pairs


@pytest.mark.parametrize("motion", [(0.12, -0.05, 0.08), (-0.1, 0.2, -0.2)])
def test_icp_finds_the_motion_of_the_least_squares(motion):
    sensor = replace(SENSORS["utm30lx"], noise=RangeNoise(0.005), outlier=0.0)
    rng, pose = np.random.default_rng(0), (-1.0, 0.5, 0.3)
    before, now = (sensor.scan(room(), at, rng) for at in (pose, compose(pose, motion)))
    found = icp(before, now)
    np.testing.assert_allclose(found, motion, atol=2e-3)
    np.testing.assert_allclose(icp(now, before), relative(motion, (0, 0, 0)), atol=2e-3)
    # Of the pairs that it ends with, within 10 cm: any other motion has a greater sum.
    points = before.points[before.valid]
    arms = np.diff(points, axis=0)
    near = np.hypot(*arms.T) < 0.3
    anchors, normals = (points[1:] + points[:-1])[near] / 2, arms[near] @ [[0, 1], [-1, 0]]
    normals /= np.hypot(*normals.T)[:, np.newaxis]

    def moved(x, y, theta):
        c, s = math.cos(theta), math.sin(theta)
        return now.points[now.valid] @ [[c, s], [-s, c]] + (x, y)

    apart = np.linalg.norm(moved(*found)[:, np.newaxis] - anchors, axis=2)
    nearest, kept = apart.argmin(axis=1), apart.min(axis=1) <= 0.1

    def squares(at):
        off = (moved(*at) - anchors[nearest]) * normals[nearest]
        return np.square(off.sum(axis=1)[kept]).sum()

    for step in 1e-5 * np.vstack((np.eye(3), -np.eye(3))):
        assert squares(found + step) > squares(found)


def test_icp_without_points_stays_where_it_began():
    empty, scan, far = (LaserScan([r] * 9, 0.0, 0.01) for r in (0.0, 2.0, 9.0))
    for before, now in ((empty, scan), (scan, empty), (scan, far)):
        assert icp(before, now, (1.0, 2.0, 0.5)) == (1.0, 2.0, 0.5)
