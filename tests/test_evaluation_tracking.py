"""Scores of tracks and motions, by hand; ICP, and the experiment on a small log."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from handmade import corner, features, segment

import lineament as ln
from lineament.evaluation.icp import icp
from lineament.evaluation.tracking import MotionErrors, motion_errors, track_scores
from lineament.logs import save_npz
from lineament.motion import Tracker, Tracks
from lineament.reproduce import Setting, tracking
from lineament.scan import RangeNoise
from lineament.scan.poses import compose, inverse, relative
from lineament.simulation import SENSORS, drive, room

NONE = np.empty(0, np.int64)


def silent(_):
    pass


def tracks_of(segments, corners=(), born=()):
    numbers = (np.array(n, np.int64) for n in (segments, corners))
    return Tracks(*numbers, NONE, np.array(born, np.int64), NONE, None)


def test_motion_errors_by_hand():
    # A quarter turn each metre, the second leg 10 cm too long.
    turn = math.pi / 2
    poses = [(0.0, 0.0, 0.0), (1.0, 0.0, turn), (1.0, 1.0, 2 * turn)]
    motions = [(1.0, 0.0, turn), (1.1, 0.0, turn + 0.02)]
    errors = motion_errors(motions, poses)
    np.testing.assert_allclose(errors.ways, [0.0, 0.1], atol=1e-12)
    np.testing.assert_allclose(errors.turns, [0.0, 0.02], atol=1e-12)
    over_both = motion_errors(motions, poses, 2)
    np.testing.assert_allclose(over_both.ways, [0.1], atol=1e-12)
    assert (errors + over_both).summary()["way_median"] == pytest.approx(0.1)
    assert math.isnan(MotionErrors().summary()["way_p95"])
    with pytest.raises(ValueError, match="there are 3 poses, expected one more than motions"):
        motion_errors(motions[:1], poses)


def test_switches_losses_and_lengths_by_hand():
    pose = (0.5, 0.2, 0.3)
    walls = [segment((3, -2), (3, 2), 10, 30), segment((3, 2), (-3, 2), 31, 60)]
    first = features(segments=walls, corners=[corner(3, 2), corner(-3, 2)])
    second = first.transform(*inverse(pose))
    tracks = [
        tracks_of([0, 1], [2, 3], born=[0, 1, 2, 3]),
        tracks_of([1, 0], [2, 4], born=[4]),
    ]
    scores = track_scores([first, second], tracks, [(0.0, 0.0, 0.0), pose])
    segments, corners = scores["segments"], scores["corners"]
    assert (segments.pairs, segments.switched, segments.lost) == (2, 2, 0)
    assert (corners.pairs, corners.switched, corners.lost) == (2, 0, 1)
    assert sorted(corners.lengths.tolist()) == [1, 1, 2]
    assert corners.summary()["kept"] == 0.5
    # What is 0.11 m off is not the same.
    far = features(segments=walls, corners=[corner(3.11, 2), corner(-3, 2)])
    assert track_scores([first, far], tracks, [(0.0, 0.0, 0.0)] * 2)["corners"].pairs == 1


def test_segments_are_the_same_if_they_lie_side_by_side():
    wall = features(segments=[segment((3, -2), (3, 2), 10, 30)])
    tracks, still = [tracks_of([0]), tracks_of([0])], [(0.0, 0.0, 0.0)] * 2

    def pairs(start, end):
        other = features(segments=[segment(start, end, 10, 30)])
        return track_scores([wall, other], tracks, still)["segments"].pairs

    assert pairs((3.09, 1), (3.09, 2.9)) == 1
    assert pairs((3.11, 1), (3.11, 2.9)) == 0
    assert pairs((3, 1.5), (3, 2.6)) == 0
    assert pairs((3, 2), (3, -2)) == 0


def test_icp_finds_the_motion():
    sensor = replace(SENSORS["utm30lx"], noise=RangeNoise(0.005), outlier=0.0)
    rng, motion = np.random.default_rng(0), (0.12, -0.05, 0.08)
    pose = (-1.0, 0.5, 0.3)
    before, now = (sensor.scan(room(), at, rng) for at in (pose, compose(pose, motion)))
    np.testing.assert_allclose(icp(before, now), motion, atol=2e-3)
    np.testing.assert_allclose(icp(now, before), relative(motion, (0, 0, 0)), atol=2e-3)


def test_icp_without_points_stays_where_it_began():
    empty, scan = (ln.LaserScan([r] * 9, 0.0, 0.01) for r in (0.0, 2.0))
    far = ln.LaserScan([9.0] * 9, 0.0, 0.01)
    for before, now in ((empty, scan), (scan, empty), (scan, far)):
        assert icp(before, now, (1.0, 2.0, 0.5)) == (1.0, 2.0, 0.5)


def test_the_stand_in_for_odometry_has_the_errors_that_are_told():
    poses = [(0.5 * i, 0.0, 0.0) for i in range(2000)]
    way = tracking.stand_in_odometry(poses, seed=1)
    steps = np.array([relative(a, b) for a, b in pairwise(way)])
    np.testing.assert_allclose(steps.mean(axis=0), (0.5, 0.0, 0.0), atol=0.006)
    np.testing.assert_allclose(steps.std(axis=0), (0.07, 0.07, 0.01), rtol=0.06)
    assert way == tracking.stand_in_odometry(poses, seed=1)


@pytest.mark.slow
def test_the_experiment_on_a_small_log(tmp_path, monkeypatch):
    folder = tmp_path / "truth"
    folder.mkdir()
    scans = list(drive(room(), [(-2, 0), (1, 0)], SENSORS["lms361"], speed=1, rate=10))
    save_npz(folder / "small.npz", scans)
    monkeypatch.setattr(tracking, "LOGS", {"small": ("truth/small.npz", 0.5), "none": ("no", 0.0)})
    monkeypatch.setattr(tracking, "SCANS_A_FRAME", 12)
    findings = tracking.run(Setting(frames=1, data=tmp_path), silent)
    numbers = findings.numbers["small"]
    assert numbers["frames"] == 12
    assert list(findings.numbers) == ["small"]
    for name in ("features", "ICP", "features, no odometry"):
        assert numbers["motion"][name]["step"]["way_median"] < 0.01
    assert numbers["tracks"]["features"]["segments"]["kept"] > 0.95
    assert [len(table.rows) for table in findings.tables] == [5, 4]


def test_without_recordings_it_says_so():
    findings = tracking.run(Setting(frames=1), silent)
    assert findings.text == ("The recordings are not there: nothing was measured.",)


@pytest.mark.slow
def test_a_recorded_arena_is_followed(data_dir):
    file, skipped = tracking.LOGS["arena, moving"]
    recording = tracking.load_recording(data_dir / file, 40, skipped)
    extract, tracker = ln.Extractor(), Tracker()
    frames = [extract(scan) for scan in recording.scans]
    tracks = [tracker(found) for found in frames]
    errors = motion_errors([t.motion.pose for t in tracks[1:]], recording.poses)
    assert np.median(errors.ways) < 0.01
    assert track_scores(frames, tracks, recording.poses)["segments"].summary()["kept"] > 0.85
