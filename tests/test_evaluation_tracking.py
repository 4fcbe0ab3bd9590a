"""Scores of tracks and motions, by hand; ICP."""

import math
from dataclasses import replace

import numpy as np
import pytest
from handmade import corner, features, segment

from lineament import LaserScan, RangeNoise
from lineament.evaluation.icp import icp
from lineament.evaluation.tracking import MotionErrors, motion_errors, track_scores
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
    errors, over_both = (motion_errors(motions, poses, step) for step in (1, 2))
    np.testing.assert_allclose(errors.ways, [0.0, 0.1], atol=1e-12)
    np.testing.assert_allclose(errors.turns, [0.0, 0.02], atol=1e-12)
    np.testing.assert_allclose(over_both.ways, [0.1], atol=1e-12)
    assert (errors + over_both).summary() == pytest.approx(
        {
            "way_rmse": math.sqrt(0.02 / 3), "way_median": 0.1, "way_p95": 0.1,
            "turn_rmse": math.sqrt(0.0008 / 3), "turn_median": 0.02, "turn_p95": 0.02,
        }
    )  # fmt: skip
    nothing = [MotionErrors(), motion_errors(motions, poses, 3)]
    assert all(math.isnan(value) for none in nothing for value in none.summary().values())
    with pytest.raises(ValueError, match="there are 3 poses, expected one more than motions"):
        motion_errors(motions[:1], poses)


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
        {"pairs": 2, "kept": 0.5, "switches": 0, "length_mean": 4 / 3, "length_p90": 1.8}
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


def test_icp_finds_the_motion():
    sensor = replace(SENSORS["utm30lx"], noise=RangeNoise(0.005), outlier=0.0)
    rng, motion = np.random.default_rng(0), (0.12, -0.05, 0.08)
    pose = (-1.0, 0.5, 0.3)
    before, now = (sensor.scan(room(), at, rng) for at in (pose, compose(pose, motion)))
    np.testing.assert_allclose(icp(before, now), motion, atol=2e-3)
    np.testing.assert_allclose(icp(now, before), relative(motion, (0, 0, 0)), atol=2e-3)


def test_icp_without_points_stays_where_it_began():
    empty, scan, far = (LaserScan([r] * 9, 0.0, 0.01) for r in (0.0, 2.0, 9.0))
    for before, now in ((empty, scan), (scan, empty), (scan, far)):
        assert icp(before, now, (1.0, 2.0, 0.5)) == (1.0, 2.0, 0.5)
