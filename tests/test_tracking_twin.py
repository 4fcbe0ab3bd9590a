"""Association, motion and tracker equal their slow twins, on random features and real logs."""

import math
from dataclasses import replace

import naive_association
import naive_motion
import numpy as np
import pytest
from handmade import arc, corner, features, random_features, segment, shaken
from naive_tracking import NaiveTracker

import lineament as ln
from lineament.motion import Tracker, associate, estimate_motion
from lineament.motion.association import KINDS, chi_square
from lineament.reproduce.tracking import LOGS, load_recording, stand_in_odometry
from lineament.scan.poses import inverse

SPREAD = np.array([[4e-4, 1e-4, 1e-4], [1e-4, 9e-4, -2e-4], [1e-4, -2e-4, 4e-4]])


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
    noise = ln.RangeNoise(0.01, 0.002, 0.001, 0.01) if seed % 4 else None
    frame.corners["convex"] = rng.random(len(frame.corners)) < 0.3
    frame.corners["kind"] = rng.choice(["corner", "slit", "edge"], len(frame.corners))
    frame.corners["segments"][:, 0] -= rng.random(len(frame.corners)) < 0.3
    return replace(frame, noise=noise)


@pytest.mark.parametrize("seed", range(40))
def test_pairs_and_motion_of_random_features(seed):
    before, rng = varied(seed), np.random.default_rng([seed, 1])
    motion = tuple((rng.normal(size=3) * (0.1, 0.1, 0.3 if seed % 3 else 3.0)).tolist())
    now = shaken(before, seed).transform(*motion)
    back = inverse(motion)
    for spread, roughness in ((None, 0.0), (SPREAD, 0.0), (SPREAD, 0.02)):
        found = associate(before, now, back, spread, gate=0.9, roughness=roughness)
        expected = naive_association.associate(
            before, now, back, spread, gate=0.9, roughness=roughness
        )
        assert_same_pairs(found, expected)
        assert_same_motion(
            estimate_motion(found, back, spread, roughness=roughness),
            naive_motion.estimate_motion(expected, back, spread, roughness=roughness),
        )


@pytest.mark.parametrize("seed", range(20))
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
    assert_same_pairs(associate(*crowds), naive_association.associate(*crowds))


@pytest.mark.parametrize("seed", range(5))
def test_tracker_of_random_features(seed):
    tracker, twin, frame = Tracker(max_missed=2), NaiveTracker(max_missed=2), varied(seed)
    for k in range(6):
        now = replace(shaken(frame, 10 * seed + k), stamp=0.1 * k)
        assert_same_tracks(tracker(now), twin(now))


def assert_same_tracks(found, expected):
    for name in (*KINDS, "born", "ended"):
        assert getattr(found, name).tolist() == getattr(expected, name).tolist()
    assert_same_motion(found.motion, expected.motion)


@pytest.mark.parametrize("log", LOGS)
@pytest.mark.slow
def test_tracker_of_a_real_log(data_dir, log):
    file, skipped = LOGS[log]
    recording, extract = load_recording(data_dir / file, 60, skipped), ln.Extractor()
    frames = [extract(scan) for scan in recording.scans]
    odometry = stand_in_odometry(recording.poses, seed=1)
    for poses in (odometry, [None] * len(frames)):
        tracker, twin = Tracker(), NaiveTracker()
        for frame, pose in zip(frames, poses, strict=True):
            assert_same_tracks(tracker(frame, pose), twin(frame, pose))


@pytest.mark.parametrize("degrees", [2, 3])
@pytest.mark.parametrize("probability", [1e-9, 0.1, 0.5, 0.99, 1 - 1e-12])
def test_quantiles(probability, degrees):
    expected = naive_association.chi_square(probability, degrees)
    np.testing.assert_allclose(chi_square(probability, degrees), expected, rtol=1e-7)
