"""Motions between key frames: how well each is known, and what the way back knows of lost ones."""

import math
from dataclasses import replace

import numpy as np

from ..motion.estimate import Motion
from ..scan import Array, Pose
from ..scan.poses import compose, inverse, relative
from .drive_map import REMEMBERED, UNKNOWN, Drive, KeyFrame

#: What walls say of motions and loops is known by the walls already: a 25th of it counts, and
#: nothing of motions below these deviations [m, m, rad].
TWICE, _LEAST = 25.0, np.diag((0.02, 0.02, 0.01)) ** 2
#: So many key frames on either side are not lost, and those before are found where they were, to
#: these errors of each step [m, rad].
_BESIDE, _SAME = 6, (0.3, 0.3)


def spread_of(frame: KeyFrame) -> Array:
    """Return the covariance of the motion to a key frame, of which walls say nothing twice.

    What was expected before counts whole: odometry, that the motion goes on, or where beams find
    it. In a direction that no wall shows nothing else holds the pose.
    """
    if frame.is_torn:
        return UNKNOWN
    if frame.is_contradicted or frame.is_lost:
        return np.asarray(frame.expected + np.outer(frame.off, frame.off) + _LEAST)
    known = np.linalg.inv(frame.motion.covariance) / TWICE + np.linalg.inv(frame.expected)
    return np.asarray(np.linalg.inv(known) + _LEAST)


def found_back(frames: list[KeyFrame]) -> list[KeyFrame]:
    """Return the key frames, of which those that are lost are placed by those after, if they can.

    What came before says where a key frame is, and so does what comes after. Where one does not, as
    a door was passed or the robot turned at once, the other often does: it is as good as odometry.
    """
    found, lost = list(frames), np.array([frame.is_torn for frame in frames])
    for k in np.flatnonzero(lost).tolist():
        if lost[max(k - _BESIDE, 0) : k + _BESIDE + 1].sum() == 1:
            found[k] = _found(frames, k)
    for k in range(1, len(found)):
        pose = compose(found[k - 1].pose, found[k].motion.pose)
        found[k] = replace(found[k], pose=pose)
    return found


def _found(frames: list[KeyFrame], k: int) -> KeyFrame:
    """Return key frame k, placed by those after it, if those before it are where they were."""
    first, way = max(k - 1 - _BESIDE, 0), frames[: k + REMEMBERED]
    drive, last = Drive(), way[-1].scan.stamp_ns
    for frame in way[first:][::-1]:
        scan = frame.scan
        drive.add(scan.stamped(scan.stamp_beam, last - scan.stamp_ns), frame.features)
    by_index = {len(way) - 1 - back.index: back for back in drive.frames}
    backs = [by_index.get(j) for j in range(k, first - 1, -1)]
    steps = [back for back in backs[1:] if back and not back.is_torn]
    if backs[0] is None or len(steps) < k - first:
        return frames[k]
    for back, frame in zip(steps[1:], frames[k - 1 : first : -1], strict=True):
        if not _is_same(back.motion.pose, inverse(frame.motion.pose)):
            return frames[k]
    derivative = _turned_round(steps[0].motion)
    expected = derivative @ spread_of(steps[0]) @ derivative.T
    x, y, theta = inverse(steps[0].motion.pose)
    motion = Motion(x, y, theta, expected)
    return replace(frames[k], motion=motion, expected=expected, has_odometry=True)


def _is_same(one: Pose, other: Pose) -> bool:
    """Whether two steps are the same to the errors above."""
    x, y, theta = relative(one, other)
    return math.hypot(x, y) < _SAME[0] and abs(theta) < _SAME[1]


def _turned_round(motion: Motion) -> Array:
    """Return the derivative of the inverse of a motion, shape (3, 3)."""
    x, y, theta = motion.pose
    c, s = math.cos(theta), math.sin(theta)
    return -np.array([[c, s, c * y - s * x], [-s, c, -s * y - c * x], [0.0, 0.0, 1.0]])
