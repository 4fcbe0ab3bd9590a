"""Poses and twists: by hand, and by what must hold."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lineament.scan.poses import compose, inverse, poses_along, relative, twist_between

lengths = st.floats(-20, 20)
poses = st.tuples(lengths, lengths, st.floats(-3, 3))


def test_a_motion_is_in_the_frame_of_the_pose():
    assert compose((1, 2, math.pi / 2), (3, 1, 0.5)) == pytest.approx((0, 5, math.pi / 2 + 0.5))
    assert relative((1, 2, math.pi / 2), (0, 5, 2.0)) == pytest.approx((3, 1, 2 - math.pi / 2))


def test_turns_are_the_short_way_round():
    assert compose((0, 0, 3.0), (0, 0, 1.0))[2] == pytest.approx(4.0 - 2 * math.pi)


@given(poses, poses)
def test_relative_undoes_compose(pose, motion):
    np.testing.assert_allclose(relative(pose, compose(pose, motion)), motion, atol=1e-9)
    np.testing.assert_allclose(compose(pose, inverse(pose)), (0, 0, 0), atol=1e-9)


@given(poses, st.floats(-2, 2).filter(lambda t: abs(t) > 0.01))
def test_a_twist_leads_to_the_other_pose(motion, duration):
    start = (1.0, -2.0, 0.7)
    twist = twist_between(start, compose(start, motion), duration)
    np.testing.assert_allclose(poses_along(twist, [duration])[0], motion, atol=1e-6)


def test_refused():
    with pytest.raises(ValueError, match="duration is 0, expected"):
        twist_between((0, 0, 0), (1, 0, 0), 0)
    with pytest.raises(ValueError, match=r"poses are .*, expected finite"):
        twist_between((0, 0, 0), (math.nan, 0, 0), 1.0)
    with pytest.raises(ValueError, match=r"twist is .*, expected three finite numbers"):
        poses_along((1.0, 2.0), [0.0])
