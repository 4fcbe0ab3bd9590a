"""Motions of a scanner and of its odometry over the same steps, as `calibrate` takes them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..features import Features
from ..scan import Array, Pose
from ..scan.poses import compose
from .association import associate
from .estimate import Motion, estimate_motion
from .tracker import Tracker

#: A step is so long, or turns by so much [m, rad].
WAY, TURN = 0.3, 0.35
#: How well the motion of a step is known by those from scan to scan [m, rad], with way and turn.
_NEAR, _GROWS = (0.03, 0.02), (0.1, 0.1)
#: How well it is known beside what the scans show: directions that they do not have no weight.
_WIDE = np.diag((0.5, 0.5, 0.3)) ** 2
_ROUNDS = 3


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
        motion = _matched(features[first], seen, moved, roughness)
        if len(motion.unobserved) < 3:
            steps.ends.append((first, i))
            steps.odometry.append(np.array(odometry[first : i + 1]))
            steps.motions.append(motion)
        first, moved = i, (0.0, 0.0, 0.0)
    return steps


def _matched(before: Features, now: Features, guess: Pose, roughness: float) -> Motion:
    """Match two scans near a guess of the motion, which then has hardly any weight."""
    (way, turn), (by_way, by_turn) = _NEAR, _GROWS
    way, turn = way + by_way * math.hypot(guess[0], guess[1]), turn + by_turn * abs(guess[2])
    spread = np.diag((way, way, turn)) ** 2
    motion = Motion(*guess, spread)
    for _ in range(_ROUNDS):
        matches = associate(before, now, motion.pose, motion.covariance, roughness=roughness)
        motion = estimate_motion(matches, guess, spread, roughness=roughness)
    return estimate_motion(matches, motion.pose, _WIDE, roughness=roughness)
