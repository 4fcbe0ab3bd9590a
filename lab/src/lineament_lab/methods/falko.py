"""FALKO: keypoints with two straight arms, in a neighbourhood that grows with range.

F. Kallasi, D. Lodi Rizzini, S. Caselli, *Fast keypoint features from laser scanner for robot
localization and mapping*, IEEE Robotics and Automation Letters 1(1), 2016.
"""

import math
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from lineament.methods.parameters import method, parameter
from lineament.scan import Array, LaserScan

from .keypoints import KeypointMethod, Keypoints, runs_of

Indices = NDArray[np.intp]

#: The neighbourhood of a measurement so near that it would reach the scanner is so much of its
#: range.
_LARGEST = 0.8
#: Exponents beyond this overflow nothing yet, and reach farther than any scanner.
_STEEPEST = 50.0
#: Where the lines of both arms meet, unless that is so far [m] from the measurement.
_MOVED = 0.2


@method
class FALKO(KeypointMethod):
    """Keypoints of Kallasi et al. 2016.

    1. *Neighbourhood*: the points beside each within ``a exp(b ρ)`` of it, on either side.
    2. *Triangle* of the point and both ends of its neighbourhood: its base and its height are at
       least a part `flatness` of the radius.
    3. *Score*: the bearings of the neighbours from the point, in `sectors`; the sum of the sectors
       between each two of one side, less than the largest of the scan: what is left is large where
       both arms are straight.
    4. *Maxima* within `suppression`, above `least_score` of the largest. Of equal ones beside each
       other the middle one. Where the lines of both arms meet is the keypoint.

    The preset `paper` has the numbers of the authors' implementation; `a` was chosen as the rivals'
    parameters are, by F1 of corners in simulated scenes of which nothing is reported.
    """

    name = "falko"
    presets = ("paper",)

    a: float = parameter(0.15, "radius of the neighbourhood at the scanner", above=0, unit="m")
    b: float = parameter(0.07, "how fast it grows with range", low=0, unit="1/m")
    least_neighbours: int = parameter(2, "fewest neighbours on either side", low=1)
    flatness: float = parameter(0.4, "least base and height of the triangle, in radii", low=0)
    sectors: int = parameter(16, "sectors of bearings about the point", low=2)
    suppression: float = parameter(0.1, "keypoints are farther from each other", above=0, unit="m")
    least_score: float = parameter(0.5, "least score, of the largest of the scan", low=0)

    @classmethod
    def paper(cls, **changes: Any) -> Self:
        """Make the detector with the numbers of the authors' implementation."""
        return cls(**{"a": 0.1, **changes})

    def keypoints(self, scan: LaserScan) -> Keypoints:
        """Find the keypoints of a scan."""
        points, ranges = scan.points[scan.valid], scan.ranges[scan.valid]
        radii = np.minimum(
            self.a * np.exp(np.minimum(self.b * ranges, _STEEPEST)), _LARGEST * ranges
        )
        sides = [_neighbours(points, i, radii[i], scan.is_full_circle) for i in range(len(points))]
        spread = np.full(len(points), math.inf)
        for i, (left, right) in enumerate(sides):
            if min(len(left), len(right)) >= self.least_neighbours:
                spread[i] = self._spread(points[i], points[left], points[right], radii[i])
        corners = np.isfinite(spread)
        if not corners.any():
            return Keypoints(np.empty((0, 2)), np.empty(0))
        largest = max(spread[corners].max(), 1.0)
        scores = np.where(corners, 1.0 - spread / largest, 0.0)
        chosen = self._maxima(points, scores, scan.is_full_circle)
        places = [_meeting(points, i, *sides[i]) for i in chosen]
        return Keypoints(np.array(places).reshape(-1, 2), scores[chosen])

    def _spread(self, point: Array, left: Array, right: Array, radius: float) -> float:
        """Sum of the sectors between the neighbours of each side; infinite if they are flat."""
        base = right[-1] - left[-1]
        arm, length = left[-1] - point, math.hypot(*base)
        area = abs(base[0] * arm[1] - base[1] * arm[0])
        least = self.flatness * radius
        if length < least or area < least * length:
            return math.inf
        # Sectors begin where the corner points: they turn with it.
        ahead = np.mean(left - point, axis=0) + np.mean(right - point, axis=0)
        turns = 0.0
        for side in (left, right):
            x, y = (side - point).T
            bearings = np.arctan2(y, x) - math.atan2(ahead[1], ahead[0])
            sectors = np.floor(bearings % (2 * math.pi) * self.sectors / (2 * math.pi))
            apart = np.abs(sectors[:, np.newaxis] - sectors)
            turns += np.minimum(apart, self.sectors - apart).sum() / 2
        return float(turns)

    def _maxima(self, points: Array, scores: Array, circular: bool) -> list[int]:
        """Return the points with the largest score about them, the middle one of equal ones."""
        largest = np.zeros(len(points), dtype=np.bool_)
        for k in np.flatnonzero(scores > self.least_score * scores.max()):
            near = np.hypot(*(points - points[k]).T) <= self.suppression
            largest[k] = scores[k] >= scores[near].max()
        kept: list[int] = []
        for run in runs_of(largest, circular):
            i = int(run[len(run) // 2])
            if all(math.dist(points[i], points[j]) > self.suppression for j in kept):
                kept.append(i)
        return kept


def _neighbours(points: Array, i: int, radius: float, circular: bool) -> tuple[Indices, Indices]:
    """Return the points before and after one until the first beyond the radius, nearest first."""
    n = len(points)
    sides = []
    for way in (-1, 1):
        reach = n // 2 if circular else (i if way < 0 else n - 1 - i)
        others = (i + way * np.arange(1, reach + 1)) % n
        beyond = np.hypot(*(points[others] - points[i]).T) >= radius
        sides.append(others[: int(np.argmax(beyond))] if beyond.any() else others)
    return sides[0], sides[1]


def _meeting(points: Array, i: int, left: Indices, right: Indices) -> Array:
    """Where the lines through both arms meet; the point itself if that is far off."""
    normals, offsets = [], []
    for side in (left, right):
        arm = points[np.append(side, i)]
        centre = arm.mean(axis=0)
        normal = np.linalg.eigh(np.cov(arm.T))[1][:, 0]
        normals.append(normal)
        offsets.append(normal @ centre)
    place: Array = points[i]
    if abs(np.linalg.det(normals)) > 1e-6:
        crossing = np.linalg.solve(normals, offsets)
        place = crossing if math.dist(crossing, place) < _MOVED else place
    return place
