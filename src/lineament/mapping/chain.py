"""Motions between key frames: how well each is known, and what the way back knows of lost ones."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..motion.estimate import Motion
from ..scan import Array, Pose
from ..scan.poses import compose, inverse, relative
from ..walls import Records
from .around import open_ways
from .drive_map import REMEMBERED, UNKNOWN, Drive, KeyFrame
from .following import UNSURE

#: What walls say of motions and loops is known by the walls already: a 25th of it counts, and
#: nothing of motions below these deviations [m, m, rad].
TWICE, _LEAST = 25.0, np.diag((0.02, 0.02, 0.01)) ** 2
#: The speed of a robot lasts so long [s]. It differs by as much as is seen, and for so long a time
#: by what is usual [s, m/s].
_LASTING, _FEW, _USUAL = 2.5, 10.0, 0.2
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


def unseen(frames: list[KeyFrame]) -> Array:
    """Return what is not known of the motion to each key frame that is bare, covariances (n, 3, 3).

    Where neither walls nor odometry show how far the robot went, it is placed as if it went on as
    it did. How far it may be off is known by how much the speed differs along this drive, an
    Ornstein-Uhlenbeck process: of each motion, by what that adds to the variance of the way since
    the speed was seen; or by beams, if they know it better.
    """
    found, since, deviation = np.zeros((len(frames), 3, 3)), 0.0, _deviation(frames)
    for k, frame in enumerate(frames):
        if frame.beams_alone is None:
            since = 0.0
            continue
        before, since = since, since + frame.duration
        by_speed = deviation**2 * (_wandered(since) - _wandered(before))
        for u in open_ways(frame.motion):
            by_beams = float(u @ frame.beams_alone[:2, :2] @ u)
            found[k, :2, :2] += min(by_speed, by_beams) * np.outer(u, u)
            since = since if by_speed < by_beams else 0.0
    return found


def slid(frames: list[KeyFrame]) -> NDArray[np.bool_]:
    """Return whether the robot may be elsewhere along a bare stretch, of each key frame (n,).

    It is lost at the end of the stretch, and beams alone leave open how far it went. What walls say
    there proves nothing: who slides along a corridor takes walls for others.
    """
    found, is_lost = np.zeros(len(frames), bool), False
    for k, frame in reversed(list(enumerate(frames))):
        if frame.is_lost or frame.beams_alone is None:
            is_lost = frame.is_lost
        elif is_lost:
            found[k] = np.linalg.eigvalsh(frame.beams_alone[:2, :2])[1] > UNSURE**2
    return found


def loosened(chain: Records, unknown: Array) -> Records:
    """Return motions between key frames that are known worse, by covariances of each key frame."""
    loose, before = chain.copy(), np.linalg.inv(chain["information"])
    is_next = np.diff(chain["ends"], axis=1)[:, 0] == 1
    more = np.where(is_next[:, None, None], unknown[chain["ends"][:, 1]], 0.0)
    loose["information"] = np.linalg.inv(before + more)
    return loose


def _deviation(frames: list[KeyFrame]) -> float:
    """Return the deviation of the speed where it is seen, with a little of what is usual [m/s]."""
    seen = [frame for frame in frames if frame.motion.observable and not frame.is_lost]
    times = np.array([frame.duration for frame in seen])
    off = np.array([frame.motion.x for frame in seen]) / np.maximum(times, 1e-9)
    off -= times @ off / max(times.sum(), 1e-9)
    return math.sqrt((times @ off**2 + _FEW * _USUAL**2) / (times.sum() + _FEW))


def _wandered(time: float) -> float:
    """Return the variance of the way after a time, of a unit deviation of the speed [s²]."""
    t = time / _LASTING
    return _LASTING**2 * (2 * t - 3 + 4 * math.exp(-t) - math.exp(-2 * t))


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
