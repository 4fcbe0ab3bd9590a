"""The tracker: who is who, by hand, through occlusion, and what must always hold."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from handmade import arc, corner, features, random_features, segment, shaken

import lineament as ln
from lineament.motion import Tracker, associate
from lineament.scan.poses import compose, inverse, relative
from lineament.simulation import SENSORS, building, drive, drive_poses, room, truth

WALLS = (segment((2, -1), (2, 1), 10, 30), segment((2, 1), (-1, 1), 31, 60))
CORNER = corner(2, 1, segments=(0, 1))
COLUMN = arc(0, -2, 0.3, 70, 80)
FRAME = features(segments=WALLS, corners=[CORNER], arcs=[COLUMN])
#: Deviations of 1 cm and 10 mrad.
NEAR = np.diag((0.01, 0.01, 0.01)) ** 2


def at(frame, stamp):
    return replace(frame, stamp=stamp)


# Association


def test_pairs_within_and_beyond_the_gate_by_hand():
    # Deviations of 1 cm on both sides: d² = (3 cm)²/2 cm² = 4.5 within 9.21, (5 cm)² = 12.5 not.
    for shift, found in ((0.03, [[0, 0]]), (0.05, [])):
        moved = features(corners=[corner(2 + shift, 1)])
        assert associate(FRAME, moved).corners.tolist() == found
    # Roughness and a motion that is not known widen it.
    moved = features(corners=[corner(2.05, 1)])
    assert len(associate(FRAME, moved, roughness=0.02).corners) == 1
    assert len(associate(FRAME, moved, covariance=4 * NEAR).corners) == 1


def test_offset_angle_and_overlap_of_segments():
    wall = features(segments=[WALLS[0]])

    def found(start, end):
        return len(associate(wall, features(segments=[segment(start, end, 10, 30)])).segments)

    assert found((2.02, -1), (2.02, 1))
    assert not found((2.06, -1), (2.06, 1))
    assert not found((2.0, 1), (2.0, -1))  # The back of the wall.
    assert not found((1.9, -1), (2.1, 1))  # 0.1 rad with deviations of 0.01 rad.
    assert found((2.0, -0.2), (2.0, 0.2))  # A part of it.
    assert found((2.0, 0.4), (2.0, 1.5))  # 0.6 of 1.1 m beside it.
    assert not found((2.0, 0.6), (2.0, 1.7))


def test_far_along_an_uncertain_line_the_offset_is_uncertain():
    wall = features(segments=[segment((2, -1), (2, 1), 10, 30, sigma=(0.01, 0.05))])
    piece = features(segments=[segment((2.05, 0.8), (2.05, 1.0), 10, 30)])
    # At 0.9 m from the centroid: 1 cm² + 1 cm² + (0.9 · 5 cm)² make 5 cm likely.
    assert len(associate(wall, piece).segments) == 1


def test_arcs_by_centre_and_radius_and_corners_by_convexity():
    assert len(associate(FRAME, features(arcs=[arc(0.02, -2, 0.31, 70, 80)])).arcs) == 1
    assert len(associate(FRAME, features(arcs=[arc(0, -2, 0.37, 70, 80)])).arcs) == 0
    other = corner(2, 1)
    other["convex"] = True
    assert len(associate(FRAME, features(corners=[other])).corners) == 0


def test_of_several_the_nearest_and_of_pieces_the_longest_is_taken():
    now = features(corners=[corner(2.02, 1), corner(2.005, 1)])
    assert associate(FRAME, now).corners.tolist() == [[0, 1]]
    pieces = [segment((2, -1), (2, -0.7), 10, 15), segment((2, -0.6), (2, 1), 16, 30)]
    assert associate(FRAME, features(segments=pieces)).segments.tolist() == [[0, 1]]


@pytest.mark.parametrize("seed", range(10))
def test_pairs_are_one_to_one(seed):
    before = random_features(seed)
    now = shaken(before, seed).transform(0.02, -0.01, 0.003)
    matches = associate(before, now, covariance=9 * NEAR)
    for kind in ("segments", "corners", "arcs"):
        for side in getattr(matches, kind).T:
            assert len(set(side.tolist())) == len(side)


def test_a_gate_must_be_a_share():
    with pytest.raises(ValueError, match="gate is 1, expected"):
        associate(FRAME, FRAME, gate=1)


def test_the_covariance_of_the_motion_must_be_a_matrix():
    with pytest.raises(ValueError, match=r"covariance is .* expected \(3, 3\)"):
        associate(FRAME, FRAME, covariance=np.eye(2))


@pytest.mark.parametrize(
    ("before", "now"), [("edge", "edge"), ("edge", "corner"), ("corner", "edge"), ("slit", "edge")]
)
def test_edges_have_no_pair(before, now):
    frames = [features(corners=[corner(2, 1, kind=kind)]) for kind in (before, now)]
    assert associate(*frames).corners.tolist() == []


def test_corners_and_slits_pair_and_keep_their_rows_among_edges():
    # An edge lies nearer to where the corner was than the corner itself.
    rows = [corner(2, 1, kind="edge"), corner(2.01, 1, kind="slit"), corner(0, 0, kind="edge")]
    assert associate(FRAME, features(corners=rows)).corners.tolist() == [[0, 1]]
    assert associate(features(corners=rows), FRAME).corners.tolist() == [[1, 0]]


def test_features_without_a_covariance_are_left_alone():
    unknown = features(corners=[corner(2, 1, sigma=math.nan)])
    assert associate(FRAME, unknown).corners.tolist() == []


# Tracks


def test_numbers_last_while_the_sensor_moves():
    tracker, pose = Tracker(roughness=0.0), (0.0, 0.0, 0.0)
    numbers = set()
    for i in range(8):
        tracks = tracker(at(FRAME.transform(*inverse(pose)), 0.1 * i))
        numbers.add((*tracks.segments.tolist(), *tracks.corners.tolist(), *tracks.arcs.tolist()))
        if tracks.motion is not None:
            # The expected motion counts a little.
            np.testing.assert_allclose(tracks.motion.pose, (0.05, 0.01, 0.02), atol=1e-3)
        pose = compose(pose, (0.05, 0.01, 0.02))
    assert numbers == {(0, 1, 2, 3)}
    assert tracker.twist == pytest.approx((0.5010, 0.0950, 0.2), abs=1e-2)


def test_births_deaths_and_occlusion_of_a_few_frames():
    tracker = Tracker(max_missed=2, roughness=0.0)
    hidden = features(segments=WALLS[1:], arcs=[COLUMN])
    assert tracker(FRAME).born.tolist() == [0, 1, 2, 3]
    for _ in range(2):
        tracks = tracker(hidden)
        assert (tracks.segments.tolist(), tracks.ended.tolist()) == ([1], [])
    assert tracker(FRAME).segments.tolist() == [0, 1]
    for expected in ([], [], [0, 2]):
        assert tracker(hidden).ended.tolist() == expected
    tracks = tracker(FRAME)
    assert (tracks.segments.tolist(), tracks.corners.tolist()) == ([4, 1], [5])
    assert tracks.born.tolist() == [4, 5]


def test_edges_are_ignored():
    # The silhouette of a column goes with the sensor; everything else stays.
    plain, tracker, pose = Tracker(), Tracker(), (0.0, 0.0, 0.0)
    for i in range(4):
        frame = at(FRAME.transform(*inverse(pose)), 0.1 * i)
        silhouettes = [corner(0.3, -2, segments=(-1, 1), kind="edge"), frame.corners[0]]
        silhouettes.append(corner(-0.3, -2, segments=(1, -1), kind="edge"))
        with_edges = replace(frame, corners=np.array(silhouettes))
        expected, tracks = plain(frame), tracker(with_edges)
        assert tracks.corners.tolist() == [-1, *expected.corners, -1]
        for name in ("segments", "arcs", "born", "ended"):
            assert getattr(tracks, name).tolist() == getattr(expected, name).tolist()
        if i:
            assert tracks.motion.pose == expected.motion.pose
        pose = compose(pose, (0.05, 0.01, 0.02))
    assert len(tracker._seen.corners) == 1


def test_a_track_is_found_where_the_motion_has_brought_it():
    tracker, numbers = Tracker(roughness=0.0), []
    for i in range(6):
        frame = FRAME if i in (0, 5) else replace(FRAME, corners=FRAME.corners[:0])
        tracks = tracker(at(frame.transform(*inverse((0.2 * i, 0.0, 0.05 * i))), 0.1 * i))
        numbers.append(tracks.corners.tolist())
    assert numbers[0] == numbers[5] == [2]


def test_frames_without_features_are_survived():
    tracker = Tracker(max_missed=1)
    none = features()
    assert tracker(none).motion is None
    assert len(tracker(none).motion.unobserved) == 3
    assert tracker(FRAME).born.tolist() == [0, 1, 2, 3]
    tracker(none)
    assert sorted(tracker(none).ended.tolist()) == [0, 1, 2, 3]


def test_odometry_is_taken_for_its_change_alone():
    tracker, far = Tracker(roughness=0.0), (100.0, -50.0, 2.0)
    motion = (0.6, -0.3, 0.8)
    tracker(FRAME, far)
    tracks = tracker(FRAME.transform(*inverse(motion)), compose(far, (0.62, -0.28, 0.79)))
    assert tracks.segments.tolist() == [0, 1]
    np.testing.assert_allclose(tracks.motion.pose, motion, atol=1e-3)


def test_odometry_must_be_finite():
    tracker = Tracker()
    tracker(FRAME, (0, 0, 0))
    with pytest.raises(ValueError, match=r"odometry is .*, expected three finite numbers"):
        tracker(FRAME, (0, math.nan, 0))
    assert tracker(FRAME, (0, 0, 0)).born.tolist() == []


@pytest.mark.parametrize("seed", range(5))
def test_no_number_is_given_twice(seed):
    tracker, rng, ended, last = Tracker(max_missed=1), np.random.default_rng(seed), set(), -1
    frame = random_features(seed)
    for _ in range(10):
        tracks = tracker(shaken(frame, int(rng.integers(1000))))
        numbers = np.concatenate((tracks.segments, tracks.corners, tracks.arcs)).tolist()
        assert len(set(numbers)) == len(numbers)
        assert not ended & set(numbers)
        assert tracks.born.tolist() == list(range(last + 1, last + 1 + len(tracks.born)))
        last += len(tracks.born)
        ended |= set(tracks.ended.tolist())
    assert ended


def test_memory_does_not_grow():
    tracker = Tracker(max_missed=3)
    for i in range(40):
        tracker(random_features(i))
    assert len(tracker._seen.segments) <= 4 * 12
    assert len(tracker._seen.segments) == len(tracker._tracks["segments"])


def test_stamps_that_stand_still_or_run_back_give_no_twist():
    tracker = Tracker()
    for stamp in (1.0, 1.0, 0.5):
        tracker(at(FRAME, stamp))
        assert tracker.twist is None


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"max_missed": -1}, "max_missed is -1, expected"),
        ({"max_missed": True}, "max_missed is True, expected"),
        ({"gate": 0.0}, "gate is 0.0, expected"),
        ({"roughness": math.nan}, "roughness is nan, expected"),
    ],
)
def test_settings_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        Tracker(**settings)


def test_a_drive_through_rooms_without_noise_is_followed_exactly():
    world, waypoints = building()
    sensor = SENSORS["utm30lx"]
    stamps, poses = drive_poses(waypoints[:3], speed=0.6, rate=5)
    tracker, way = Tracker(roughness=0.0), (0.0, 0.0, 0.0)
    for stamp, pose in zip(stamps.tolist(), map(tuple, poses.tolist()), strict=True):
        tracks = tracker(at(truth(world, pose, sensor), stamp))
        if tracks.motion is not None:
            way = compose(way, tracks.motion.pose)
    np.testing.assert_allclose(way, relative(tuple(poses[0]), tuple(poses[-1])), atol=0.02)


@pytest.mark.slow
def test_scans_tell_their_own_twist_for_deskewing():
    sensor, extract, tracker = replace(SENSORS["utm30lx"], rate=10.0), ln.Extractor(), Tracker()
    way = drive(room(), [(-1.5, 0), (1, 0)], sensor, speed=0.8, moving=True, seed=3)
    twists = []
    for scan in way:
        tracker(extract(ln.deskew(scan, tracker.twist)))
        twists.append(tracker.twist)
    assert twists[0] is None
    errors = np.array(twists[6:-1]) - (0.8, 0.0, 0.0)
    assert np.abs(errors).max() < 0.06


@pytest.mark.parametrize("gap", [1e-9, 1e-4])
def test_a_stamp_that_is_wrong_does_not_throw_the_tracks_off(gap):
    # By its stamp the sensor has gone 10 cm in no time.
    extract, tracker = ln.Extractor(), Tracker()
    numbers = []
    for i, scan in enumerate(drive(room(), [(-1, 0), (1, 0)], SENSORS["lms361"], speed=1, rate=10)):
        features = replace(extract(scan), stamp=0.9 + gap if i == 10 else scan.stamp)
        numbers.append(set(tracker(features).segments.tolist()))
        if i == 10:
            assert tracker.twist is None
    assert all(now & before for before, now in pairwise(numbers))
    assert len(numbers[8] & numbers[16]) >= 4
    assert tracker.twist == pytest.approx((1.0, 0.0, 0.0), abs=0.05)
