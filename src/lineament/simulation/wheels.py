"""Odometry as two wheels have it: wrong radii, a wrong track, slip, and ticks."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..scan import Pose
from ..scan.poses import compose, twist_between


@dataclass(frozen=True, slots=True)
class Wheels:
    """Two wheels on one axle under the sensor, whose turns are counted.

    Parameters
    ----------
    track : float
        Distance between the wheels [m].
    radius : float
        Deviation of the radius of each wheel from what is believed, as a share; constant.
    base : float
        The same of the track: every turn is wrong by this share.
    slip : float
        Deviation of the way of a wheel, as a share of the square root of the way [√m].
    jolts : float
        Chance of a jolt per metre: one wheel spins or is held, and its way is off by up to 4 cm.
    tick : float
        Way of a wheel from count to count [m].

    Examples
    --------
    A way of 10 m straight ahead:

    >>> poses = [(0.1 * k, 0.0, 0.0) for k in range(101)]
    >>> believed = Wheels().odometry(poses, seed=1)
    >>> len(believed), believed[0], 9.5 < believed[-1][0] < 10.5
    (101, (0.0, 0.0, 0.0), True)
    """

    track: float = 0.4
    radius: float = 0.004
    base: float = 0.02
    slip: float = 0.006
    jolts: float = 0.02
    tick: float = 0.0005

    def odometry(self, poses: Sequence[Pose], seed: int) -> list[Pose]:
        """Return the poses that wheels report which go along these; the first is the origin.

        Way across the wheels is not counted.
        """
        rng = np.random.default_rng([seed, 5])
        radii = 1.0 + self.radius * rng.standard_normal(2)
        base = self.track * (1.0 + self.base * rng.standard_normal())
        believed: list[Pose] = [(0.0, 0.0, 0.0)]
        counted, rolled = np.zeros(2), np.zeros(2)
        for pose, following in pairwise(poses):
            forward, _, turn = twist_between(pose, following, 1.0)
            ways = forward + np.array((-0.5, 0.5)) * self.track * turn
            ways = ways * radii + self.slip * np.sqrt(np.abs(ways)) * rng.standard_normal(2)
            jolt, wheel, by = rng.random(), int(rng.integers(2)), rng.uniform(-0.04, 0.04)
            if jolt < self.jolts * abs(forward):
                ways[wheel] += by
            rolled += ways
            ticks = np.floor(rolled / self.tick) * self.tick - counted
            counted += ticks
            (left, right), middle = ticks.tolist(), float(ticks.mean())
            turned = (right - left) / base
            chord = middle * float(np.sinc(turned / (2 * math.pi)))
            step = (chord * math.cos(turned / 2), chord * math.sin(turned / 2), turned)
            believed.append(compose(believed[-1], step))
        return believed
