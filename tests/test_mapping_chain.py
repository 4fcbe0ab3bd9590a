"""Lost key frames that are placed by what came after: a drive through rooms, and cases of it."""

from dataclasses import replace

import numpy as np
import pytest
from small_room import placed

from lineament.mapping import chain
from lineament.mapping.chain import _turned_round, found_back
from lineament.mapping.making import make_map
from lineament.motion.estimate import Motion
from lineament.scan.poses import compose, inverse, relative
from lineament.simulation import SENSORS, World, drive

ROOMS = [
    *([-3, 2, 1, 2], [1, 2, 1, 3], [1, 3, 4, 3], [4, 3, 4, 0.6], [4, 0.6, 9, 0.6]),
    *([9, 0.6, 9, 3], [9, 3, 13, 3], [13, 3, 13, -3], [13, -3, 9, -3], [9, -3, 9, -0.6]),
    *([9, -0.6, 4, -0.6], [4, -0.6, 4, -2], [4, -2, -3, -2], [-3, -2, -3, 2]),
]


ELSEWHERE = [
    *([-9, 1.4, 7, 1.4], [7, 1.4, 7, 5.5], [7, 5.5, 8.2, 5.5], [8.2, 5.5, 8.2, -1]),
    *([8.2, -1, 3, -1], [3, -1, 3, -1.8], [3, -1.8, 1.5, -1.8], [1.5, -1.8, 1.5, -1]),
    *([1.5, -1, -9, -1], [-9, -1, -9, 1.4]),
]


def frames_on(walls, way):
    """Return the key frames of a drive, and where they were taken."""
    scans = [*drive(World(walls), way, SENSORS["utm30lx"], speed=1.0, rate=4.0, seed=2)]
    frames = placed(scans).frames
    assert not any(frame.is_lost for frame in frames)
    return frames, [scans[frame.index].pose for frame in frames]


@pytest.fixture(scope="module")
def driven():
    return frames_on(ROOMS, [(-2.0, 0.5), (2.0, 0.0), (11.0, 0.0), (11.0, 2.0)])


def lost_at(frames, *which):
    """Return key frames of which some are lost, half a metre and 1 rad aside."""
    guess = Motion(0.5, 0.5, 1.0, np.eye(3))
    return [
        replace(f, is_lost=True, motion=guess) if k in which else f for k, f in enumerate(frames)
    ]


@pytest.mark.parametrize("k", [1, 7, 20, 30])
def test_one_that_is_lost_is_where_those_after_say(driven, k):
    frames, truth = driven
    found = found_back(lost_at(frames, k))
    assert not found[k].is_torn
    off = np.array(relative(relative(*truth[k - 1 : k + 1]), found[k].motion.pose))
    np.testing.assert_allclose(off, 0, atol=0.03)
    # Its covariance is that of any other, and all that follow are moved.
    deviations = np.sqrt(np.diag(found[k].motion.covariance))
    assert (deviations[1:] < 0.1).all()
    at = [relative(found[0].pose, frame.pose) for frame in found]
    np.testing.assert_allclose(at[-1], relative(truth[0], truth[-1]), atol=0.1)


def test_those_that_are_not_lost_stay(driven):
    frames, _ = driven
    for before, after in zip(frames, found_back(frames), strict=True):
        assert after.motion is before.motion
        np.testing.assert_allclose(after.pose, before.pose, atol=1e-9)


def test_two_that_are_lost_beside_each_other_stay_lost(driven):
    frames, _ = driven
    found = found_back(lost_at(frames, 12, 18))
    assert [k for k, frame in enumerate(found) if frame.is_torn] == [12, 18]
    found = found_back(lost_at(frames, 12, 19))
    assert not any(frame.is_torn for frame in found)


def test_elsewhere_it_is_a_part_of_the_map(driven):
    """The robot is carried into another building."""
    frames, others = driven[0][:24], frames_on(ELSEWHERE, [(-6.0, 0.2), (6.0, 0.2)])[0]
    carried = [*frames, *lost_at(others, 0)]
    carried = [replace(frame, index=k) for k, frame in enumerate(carried)]
    made = make_map(carried, [(k, (0.0, 0.0, 0.0)) for k in range(len(carried))])
    assert made.parts.count == 2
    np.testing.assert_array_equal(made.parts.numbers, np.repeat((0, 1), (24, len(others))))


def test_it_stays_lost_if_those_before_are_not_where_they_were(driven, monkeypatch):
    frames, _ = driven
    monkeypatch.setattr(chain, "_SAME", (0.0, 0.3))
    assert found_back(lost_at(frames, 20))[20].is_torn


def test_the_derivative_of_the_inverse_is_that_of_differences():
    pose = np.array((0.7, -0.3, 0.9))
    steps = 1e-6 * np.eye(3)
    expected = [
        np.subtract(inverse(tuple(pose + d)), inverse(tuple(pose - d))) / 2e-6 for d in steps
    ]
    found = _turned_round(Motion(*pose, np.eye(3)))
    np.testing.assert_allclose(found, np.transpose(expected), atol=1e-8)
    np.testing.assert_allclose(compose(tuple(pose), inverse(tuple(pose))), 0, atol=1e-12)
