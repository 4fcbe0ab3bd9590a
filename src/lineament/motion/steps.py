"""Motions of a scanner and of its odometry over the same steps, as `calibrate` takes them."""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from ..features import Features
from ..scan import Array, Pose
from ..scan.poses import compose, poses_along, relative, twist_between
from .association import associate
from .estimate import Motion, estimate_motion
from .odometry import covariance_grown
from .tracker import Tracker

#: A step is so long, or turns by so much [m, rad].
WAY, TURN = 0.3, 0.35
#: How well the motion of a step is known by those from scan to scan [m, rad], with way and turn.
_NEAR, _GROWS = (0.03, 0.02), (0.1, 0.1)
#: How well a mounting is known by the motions, where shared walls are looked for.
_MOUNTED = np.diag((0.05, 0.05, 0.02)) ** 2
#: How well it is known beside what the scans show: directions that they do not have no weight.
_WIDE = np.diag((0.5, 0.5, 0.3)) ** 2
_ROUNDS = 3
#: Between scans that are farther apart, a motion is not even [s].
_LONGEST = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """Steps of a drive: scans at the ends, odometry from end to end (k, 3), and motions."""

    ends: list[tuple[int, int]] = field(default_factory=list)
    odometry: list[Array] = field(default_factory=list)
    motions: list[Motion] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.ends)


def steps_of(
    features: Sequence[Features],
    odometry: Sequence[Pose | None],
    mounting: Pose | None = None,
    roughness: float = 0.01,
) -> Steps:
    """Match the scans at the ends of each step of a drive.

    With a `mounting`, odometry says where to look for the walls; without, the scanner goes on as
    it did. A step that is without odometry, or on which the scanner was lost, is left out.
    """
    steps, tracker = Steps(), Tracker(roughness=roughness)
    first, moved = -1, (0.0, 0.0, 0.0)
    for i, (seen, pose) in enumerate(zip(features, odometry, strict=True)):
        expected = None if pose is None or mounting is None else compose(pose, mounting)
        motion = tracker(seen, expected).motion
        if motion is None or len(motion.unobserved) == 3 or pose is None or first < 0:
            first, moved = -1 if pose is None else i, (0.0, 0.0, 0.0)
            continue
        moved = compose(moved, motion.pose)
        if math.hypot(moved[0], moved[1]) < WAY and abs(moved[2]) < TURN:
            continue
        spread = covariance_grown(moved, _NEAR, _GROWS)
        motion = _matched(features[first], seen, moved, spread, roughness)
        if len(motion.unobserved) < 3:
            steps.ends.append((first, i))
            steps.odometry.append(np.array(odometry[first : i + 1]))
            steps.motions.append(motion)
        first, moved = i, (0.0, 0.0, 0.0)
    return steps


@dataclass(frozen=True, slots=True, eq=False)
class Carried:
    """Where a scanner was between its own scans, in the frame of its first one.

    `poses` are those at its stamps [s]; `is_lost` is whether the motion to each is not known.
    """

    stamps: list[float]
    poses: list[Pose]
    is_lost: list[bool]

    @classmethod
    def of(cls, features: Sequence[Features], roughness: float = 0.01) -> Self:
        """Add up the motions from scan to scan."""
        tracker, is_lost = Tracker(roughness=roughness), []
        poses: list[Pose] = []
        for seen in features:
            motion = tracker(seen).motion
            is_lost.append(motion is None or not motion.observable)
            before = poses[-1] if poses else (0.0, 0.0, 0.0)
            poses.append(before if motion is None else compose(before, motion.pose))
        return cls([seen.stamp for seen in features], poses, is_lost)

    def at(self, stamp: float) -> Pose | None:
        """Return the pose at a time; None if it is not known."""
        i = bisect_right(self.stamps, stamp)
        if i > 0 and self.stamps[i - 1] == stamp:
            return None if self.is_lost[i - 1] else self.poses[i - 1]
        if not 0 < i < len(self.stamps) or self.is_lost[i]:
            return None
        duration = self.stamps[i] - self.stamps[i - 1]
        if duration > _LONGEST:
            return None
        twist = twist_between(self.poses[i - 1], self.poses[i], duration)
        x, y, theta = poses_along(twist, [stamp - self.stamps[i - 1]])[0].tolist()
        return compose(self.poses[i - 1], (x, y, theta))


def shared_walls(
    others: Sequence[Features],
    carried: Carried,
    features: Sequence[Features],
    mounting: Pose,
    roughness: float = 0.01,
) -> list[Motion]:
    """Match what two scanners see at once: each is the mounting of the later, as a motion.

    `mounting` is a guess, within 5 cm and 1° or so; sights without a shared wall are left out.
    """
    sights = []
    for seen in features:
        pose, i = carried.at(seen.stamp), bisect_right(carried.stamps, seen.stamp) - 1
        if pose is None:
            continue
        if i + 1 < len(others) and carried.stamps[i + 1] + carried.stamps[i] < 2 * seen.stamp:
            i += 1
        other = others[i].transform(*relative(pose, carried.poses[i]))
        sight = _matched(other, seen, mounting, _MOUNTED, roughness)
        if len(sight.unobserved) < 3:
            sights.append(sight)
    return sights


def _matched(
    before: Features, now: Features, guess: Pose, spread: Array, roughness: float
) -> Motion:
    """Match two scans near a guess of the motion, which then has hardly any weight."""
    motion = Motion(*guess, spread)
    for _ in range(_ROUNDS):
        matches = associate(before, now, motion.pose, motion.covariance, roughness=roughness)
        motion = estimate_motion(matches, guess, spread, roughness=roughness)
    return estimate_motion(matches, motion.pose, _WIDE, roughness=roughness)
