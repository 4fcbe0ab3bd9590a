"""Association and tracker: by hand, against their slow twins, by what must hold."""

import math
from dataclasses import replace
from itertools import pairwise

import naive_tracking as naive
import numpy as np
import pytest
from handmade import arc, corner, edge, features, random_features, segment, shaken
from lineament_lab.reproduce.tracking import LOGS, load_recording, stand_in_odometry

import lineament as ln
from lineament.motion import Tracker, associate, estimate_motion
from lineament.motion.association import KINDS, chi_square
from lineament.scan.poses import compose, inverse
from lineament.simulation import SENSORS, drive, room

WALLS = (segment((2, -1), (2, 1), 10, 30), segment((2, 1), (-1, 1), 31, 60))
FRAME = features(
    segments=WALLS, corners=[corner(2, 1, segments=(0, 1))], arcs=[arc(0, -2, 0.3, 70, 80)]
)
#: A motion that is known to 1 cm and 10 mrad.
NEAR = np.diag((0.01, 0.01, 0.01)) ** 2
SPREAD = np.array([[4e-4, 1e-4, 1e-4], [1e-4, 9e-4, -2e-4], [1e-4, -2e-4, 4e-4]])


def at(frame, stamp):
    return replace(frame, stamp=stamp)


def uneven(misfit):
    """A corner 10 cm off, and the walls that it is of."""
    walls = np.array(WALLS)
    walls["misfit"] = misfit
    return {"segments": walls, "corners": [corner(2.1, 1, segments=(0, 1))]}


CONVEX = corner(2, 1)
CONVEX["convex"] = True


# Association


@pytest.mark.parametrize(
    ("now", "settings", "found"),
    [
        # Deviations of 1 cm on both sides: d² = (3 cm)²/2 cm² = 4.5 is within 9.21.
        ({"corners": [corner(2.03, 1)]}, {}, 1),
        ({"corners": [corner(2.05, 1)]}, {}, 0),
        ({"corners": [corner(2.05, 1)]}, {"roughness": 0.02}, 1),
        ({"corners": [corner(2.05, 1)]}, {"covariance": 4 * NEAR}, 1),
        ({"corners": [CONVEX]}, {}, 0),
        ({"corners": [corner(2, 1, sigma=math.nan)]}, {}, 0),
        ({"corners": [corner(2, 1, kind="slit")]}, {}, 1),
        ({"arcs": [arc(0.02, -2, 0.31, 70, 80)]}, {}, 1),
        ({"arcs": [arc(0, -2, 0.37, 70, 80)]}, {}, 0),
        ({"segments": [segment((2.02, -1), (2.02, 1), 10, 30)]}, {}, 1),
        ({"segments": [segment((2.06, -1), (2.06, 1), 10, 30)]}, {}, 0),
        # The back of the wall; 0.1 rad with deviations of 0.01 rad.
        ({"segments": [segment((2.0, 1), (2.0, -1), 10, 30)]}, {}, 0),
        ({"segments": [segment((1.9, -1), (2.1, 1), 10, 30)]}, {}, 0),
        # A part of it; 0.6 of 1.1 m beside it, and 0.48.
        ({"segments": [segment((2.0, -0.2), (2.0, 0.2), 10, 30)]}, {}, 1),
        ({"segments": [segment((2.0, 0.4), (2.0, 1.5), 10, 30)]}, {}, 1),
        ({"segments": [segment((2.0, 0.52), (2.0, 1.62), 10, 30)]}, {}, 0),
        # Two walls and their corner: (10 cm)² over 2 cm² and four misfits is 8.2, and 11.4.
        (uneven(0.016), {}, 3),
        (uneven(0.013), {}, 2),
    ],
)
def test_a_pair_is_within_its_gate(now, settings, found):
    for pairs in (associate, naive.associate):
        assert len(pairs(FRAME, features(**now), **settings)) == found


@pytest.mark.parametrize("degrees", [2, 3])
@pytest.mark.parametrize("probability", [1e-9, 0.1, 0.5, 0.99, 1 - 1e-12])
def test_quantiles(probability, degrees):
    expected = naive.chi2.ppf(probability, degrees)
    np.testing.assert_allclose(chi_square(probability, degrees), expected, rtol=1e-7)


# Against the twins


def assert_same_pairs(found, expected):
    for kind in KINDS:
        assert getattr(found, kind).tolist() == getattr(expected, kind).tolist()


def assert_same_motion(found, expected):
    if expected is None:
        assert found is None
        return
    np.testing.assert_allclose(found.pose, expected.pose, rtol=0, atol=1e-7)
    np.testing.assert_allclose(
        found.covariance, expected.covariance, rtol=1e-6, atol=1e-6 * expected.covariance.max()
    )
    # The directions have no sign, and no order.
    projections = [motion.unobserved.T @ motion.unobserved for motion in (found, expected)]
    np.testing.assert_allclose(*projections, atol=1e-6)


def varied(seed):
    """Random features with full covariances, of which some are not known."""
    rng, frame = np.random.default_rng(seed), random_features(seed)
    for table in (frame.segments, frame.corners, frame.arcs):
        size = table["covariance"].shape[-1]
        factor = 0.01 * rng.normal(size=(len(table), size, size))
        table["covariance"] = factor @ np.swapaxes(factor, 1, 2)
        table["covariance"][rng.random(len(table)) < 0.05] = math.nan
    frame.segments["misfit"] = rng.choice([0.0, 0.01], len(frame.segments))
    frame.corners["convex"] = rng.random(len(frame.corners)) < 0.3
    frame.corners["kind"] = rng.choice(["corner", "slit"], len(frame.corners))
    frame.corners["segments"][:, 0] -= rng.random(len(frame.corners)) < 0.3
    return frame


@pytest.mark.parametrize("seed", range(24))
def test_pairs_and_motion_of_random_features(seed):
    before, rng = varied(seed), np.random.default_rng([seed, 1])
    motion = tuple((rng.normal(size=3) * (0.1, 0.1, 0.3 if seed % 3 else 3.0)).tolist())
    now = shaken(before, seed)
    sides = now.corners["segments"]
    sides[:] = rng.integers(-1, len(now.segments), sides.shape)
    now = now.transform(*motion)
    back = inverse(motion)
    for spread, roughness in ((None, 0.0), (SPREAD, 0.0), (SPREAD, 0.02)):
        given = {"gate": 0.9, "roughness": roughness}
        found = associate(before, now, back, spread, **given)
        assert_same_pairs(found, naive.associate(before, now, back, spread, **given))
        estimates = [
            estimate(found, back, spread, roughness=roughness)
            for estimate in (estimate_motion, naive.estimate_motion)
        ]
        assert_same_motion(*estimates)


@pytest.mark.parametrize("seed", range(12))
def test_crowds_are_paired_at_the_least_cost(seed):
    rng = np.random.default_rng(seed)
    crowds = [
        features(
            corners=[corner(*rng.normal(size=2) * 0.03) for _ in range(rng.integers(12))],
            arcs=[arc(*rng.normal(size=2) * 0.03, 0.2, 0, 9) for _ in range(rng.integers(12))],
            segments=[
                segment((2, -y), (2 + 0.01 * rng.normal(), y), 10, 30)
                for y in rng.uniform(0.3, 2, size=rng.integers(12))
            ],
        )
        for _ in range(2)
    ]
    assert_same_pairs(associate(*crowds), naive.associate(*crowds))


def assert_same_tracks(found, expected):
    for name in (*KINDS, "born", "ended"):
        assert getattr(found, name).tolist() == getattr(expected, name).tolist()
    assert_same_motion(found.motion, expected.motion)


@pytest.mark.parametrize("seed", range(5))
def test_tracker_of_random_features(seed):
    tracker, twin = Tracker(max_missed=2), naive.NaiveTracker(max_missed=2)
    frame = varied(seed)
    for k in range(6):
        now = replace(shaken(frame, 10 * seed + k), stamp=0.1 * k)
        assert_same_tracks(tracker(now), twin(now))
        assert [*map(len, tracker._seen.words)] == [len(getattr(twin._seen, k)) for k in KINDS]


@pytest.mark.parametrize("log", LOGS)
@pytest.mark.slow
def test_tracker_of_a_real_log(data_dir, log):
    file, skipped = LOGS[log]
    scans, extract = load_recording(data_dir / file, 12, skipped), ln.Extractor()
    frames = [extract(scan) for scan in scans]
    odometry = stand_in_odometry([scan.pose for scan in scans], seed=1)
    for poses in (odometry, [None] * len(frames)):
        tracker, twin = Tracker(), naive.NaiveTracker()
        for frame, pose in zip(frames, poses, strict=True):
            assert_same_tracks(tracker(frame, pose), twin(frame, pose))


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
    hidden = features(segments=WALLS[1:], arcs=FRAME.arcs)
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


@pytest.mark.parametrize("convex", [False, True])
def test_a_corner_seen_wrongly_once_does_not_share_its_sights_with_another_track(convex):
    tracker, numbers, ended = Tracker(roughness=0.02), [], []
    for x in (2.0, 2.15, 2.06, 2.11, 2.06):
        found = corner(x, 1, segments=(0, 1))
        found["convex"] = convex
        tracks = tracker(replace(FRAME, corners=np.array([found])))
        numbers += tracks.corners.tolist()
        ended.append(tracks.ended.tolist())
    first, wrong = numbers[:2]
    assert first != wrong
    assert numbers == [first, wrong, first, first, first]
    assert ended == [[], [], [wrong], [], []]


def test_edges_are_ignored():
    # The silhouette of a column goes with the sensor; everything else stays.
    plain, tracker, pose = Tracker(), Tracker(), (0.0, 0.0, 0.0)
    for i in range(4):
        frame = at(FRAME.transform(*inverse(pose)), 0.1 * i)
        silhouettes = [edge(0.3, -2, side="start"), edge(-0.3, -2, side="end")]
        seen = replace(frame, edges=np.array(silhouettes))
        assert_same_tracks(tracker(seen), plain(frame))
        pose = compose(pose, (0.05, 0.01, 0.02))
    assert len(tracker._seen.corners) == 1


def test_frames_without_features_are_survived():
    tracker, none = Tracker(max_missed=1), features()
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
    for bad in ((0, math.nan, 0), (0, 0), "abc", 3.0):
        with pytest.raises(ValueError, match=r"odometry is .*, expected (three finite|\(x, y, th)"):
            tracker(FRAME, bad)
    assert tracker(FRAME.transform(*inverse(motion))).born.tolist() == []


@pytest.mark.parametrize(
    ("name", "accepted", "refused"),
    [
        *(("max_missed", 0, -1), ("max_missed", 1, True), ("gate", 1e-9, 0.0)),
        *(("gate", 1 - 1e-9, 1.0), ("roughness", 0.0, -1e-9), ("roughness", 1e9, math.inf)),
        *(("gate", 0.5, math.nan), ("max_missed", np.int64(1), -2)),
    ],
)
def test_settings(name, accepted, refused):
    tracker = Tracker(**{name: accepted})
    assert tracker(FRAME).born.tolist() == [0, 1, 2, 3]
    ended = len(tracker(FRAME).ended) + len(tracker(features()).ended)
    assert ended == (0 if accepted else 4 * (name == "max_missed"))
    with pytest.raises(ValueError, match=f"{name} is {refused}, expected"):
        Tracker(**{name: refused})
    if name == "gate":
        with pytest.raises(ValueError, match=f"gate is {refused}, expected"):
            associate(FRAME, FRAME, gate=refused)


def test_stamps_that_stand_still_or_run_back_give_no_twist():
    tracker = Tracker()
    for stamp in (1.0, 1.0, 0.5):
        tracker(at(FRAME, stamp))
        assert tracker.twist is None


@pytest.mark.parametrize("gap", [1e-9, 1e-4])
def test_a_stamp_that_is_wrong_does_not_throw_the_tracks_off(gap):
    # By its stamp the sensor has gone 10 cm in no time.
    extract, tracker, numbers = ln.Extractor(), Tracker(), []
    for i, scan in enumerate(drive(room(), [(-1, 0), (1, 0)], SENSORS["lms361"], speed=1, rate=10)):
        frame = replace(extract(scan), stamp=0.9 + gap if i == 10 else scan.stamp)
        numbers.append(set(tracker(frame).segments.tolist()))
        if i == 10:
            assert tracker.twist is None
    assert all(now & before for before, now in pairwise(numbers))
    assert len(numbers[8] & numbers[16]) >= 4
    assert tracker.twist == pytest.approx((1.0, 0.0, 0.0), abs=0.05)


@pytest.mark.slow
def test_scans_give_their_own_twist_for_deskewing():
    sensor, extract, tracker = replace(SENSORS["utm30lx"], rate=10.0), ln.Extractor(), Tracker()
    twists = []
    for scan in drive(room(), [(-1.5, 0), (1, 0)], sensor, speed=0.8, moving=True, seed=3):
        tracker(extract(ln.deskew(scan, tracker.twist)))
        twists.append(tracker.twist)
    assert twists[0] is None
    assert np.abs(np.array(twists[6:-1]) - (0.8, 0.0, 0.0)).max() < 0.06


def test_a_corner_where_it_was_is_double_without_a_motion():
    """A motion that is not known is none: nothing turns."""
    corners = features(corners=[corner(3.0, 1.0)]).corners
    tracker = Tracker()
    assert tracker._doubles(corners, corners, np.ones((1, 1), bool), None).tolist() == [True]
    assert tracker._doubles(corners, corners, np.zeros((1, 1), bool), None).tolist() == [False]


def test_what_the_documents_say_of_a_tracker_nobody_set():
    """Five frames, 99 % of the right pairs, walls that are straight to a centimetre."""
    tracker = Tracker()
    assert (tracker.max_missed, tracker.gate, tracker.roughness) == (5, 0.99, 0.01)
