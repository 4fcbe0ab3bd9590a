"""Repeated corners as a curve: ranked by a score, with what chance repeats taken off."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..scan import Array, LaserScan
from ..scan.poses import relative
from .counts import Summable, ratio
from .matching import match
from .repeatability import checked_poses, in_sight

__all__ = ["RankedRepeats", "ranked_repeats"]

#: Turns about the sensor by which a corner is moved to where it is not, to see what is found there.
TURNS = 24
#: The least of them [rad]: an eighth of a right angle, beyond the gate at any range that counts.
LEAST_TURN = math.radians(11.25)


@dataclass(frozen=True, slots=True, eq=False)
class RankedRepeats(Summable):
    """Corners of one view that are in sight of another, each with its score.

    Attributes
    ----------
    scores : ndarray, shape (m,)
        What they are ranked by: the highest first.
    repeated : bool array, shape (m,)
        Whether each is found again.
    chance : ndarray, shape (m,)
        Probability that something is found in its place by chance.

    Examples
    --------
    Of the two best both are found again, of the others one:

    >>> ranked = RankedRepeats(
    ...     np.array([0.2, 0.9, 0.8, 0.1]), np.array([False, True, True, True]), np.zeros(4)
    ... )
    >>> ranked.count_at(0.8), ranked.rate, ranked.auc
    (2.0, 0.75, 0.6666666666666666)
    """

    scores: Array = field(default_factory=lambda: np.empty(0))
    repeated: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, np.bool_))
    chance: Array = field(default_factory=lambda: np.empty(0))

    @property
    def rate(self) -> float:
        """Share of all that are found again, chance taken off."""
        rates = self.curve()[1]
        return float(rates[-1]) if len(rates) else math.nan

    @property
    def auc(self) -> float:
        """Probability that one that is found again has a higher score than one that is not."""
        good, bad = self.scores[self.repeated], np.sort(self.scores[~self.repeated])
        below = np.searchsorted(bad, good, "left") + np.searchsorted(bad, good, "right")
        return ratio(0.5 * float(below.sum()), len(good) * len(bad))

    def curve(self) -> tuple[Array, Array]:
        """Corners repeated among the best 1, 2, …, m, and the share of these, chance taken off.

        Where a share c is found by chance, of N corners R = T + c (N - T) are found again if T
        truly are: T/N = (R/N - c)/(1 - c). Corners of equal scores come as one.
        """
        order = np.argsort(-self.scores, kind="stable")
        count = np.arange(1.0, len(order) + 1)
        found = np.cumsum(self.repeated[order]) / count
        chance = np.cumsum(self.chance[order]) / count
        rate = (found - chance) / np.maximum(1.0 - chance, 1e-9)
        ranked = self.scores[order]
        ends = np.append(ranked[1:] != ranked[:-1], True)[: len(order)]
        return (rate * count)[ends], rate[ends]

    def rate_between(self, low: float, high: float) -> float:
        """Share found again, chance taken off, of those whose score is from `low` to below `high`.

        Examples
        --------
        >>> ranked = RankedRepeats(
        ...     np.array([0.5, 0.6, 0.9]), np.array([True, False, True]), np.array([0.0, 0.0, 0.1])
        ... )
        >>> ranked.rate_between(0.4, 0.8)
        0.5
        """
        inside = (low <= self.scores) & (self.scores < high)
        ranked = RankedRepeats(self.scores[inside], self.repeated[inside], self.chance[inside])
        return ranked.rate

    def count_at(self, rate: float) -> float:
        """Most corners repeated, chance taken off, among the best of which this share is."""
        repeated, rates = self.curve()
        return float(repeated[rates >= rate].max(initial=0.0))


def ranked_repeats(
    scan: LaserScan,
    features: Features,
    other_scan: LaserScan,
    other_features: Features,
    scores: Array,
    *,
    gate: float = 0.10,
) -> RankedRepeats:
    """Look for the corners of another scan in this one, and for what chance finds.

    As `repeatability`, corner by corner. By chance a corner is found if, turned about this sensor
    to another bearing where it would be in sight too, there is one within the gate.

    Parameters
    ----------
    scan, features
        Where corners are looked for, with its pose.
    other_scan, other_features
        Whose corners are looked for, with its pose.
    scores : ndarray, shape (K,)
        Score of each of the other's corners.
    gate : float
        Largest distance of what is found again [m].

    Returns
    -------
    RankedRepeats

    Raises
    ------
    ValueError
        If a scan has no pose.
    """
    pose, other_pose = checked_poses(scan, other_scan)
    others = other_features.transform(*relative(pose, other_pose)).corners["position"]
    expected = in_sight(scan, others, gate)
    others, positions = others[expected], features.corners["position"]
    distance = _apart(others, positions)
    repeated = np.zeros(len(others), dtype=np.bool_)
    repeated[match(distance, distance <= gate)[0]] = True
    return RankedRepeats(scores[expected], repeated, _chances(scan, positions, others, gate))


def _apart(points: Array, others: Array) -> Array:
    difference = points[:, np.newaxis] - others
    return np.asarray(np.hypot(difference[..., 0], difference[..., 1]))


def _chances(scan: LaserScan, positions: Array, others: Array, gate: float) -> Array:
    """Share of the turns of each corner, among those in sight, that put it near another."""
    turns = np.linspace(LEAST_TURN, 2 * math.pi - LEAST_TURN, TURNS)
    c, s = np.cos(turns)[:, np.newaxis], np.sin(turns)[:, np.newaxis]
    x, y = others.T
    turned = np.stack((c * x - s * y, s * x + c * y), axis=-1).reshape(-1, 2)
    seen = in_sight(scan, turned, gate)
    found = (_apart(turned, positions) <= gate).any(axis=1) & seen
    seen, found = seen.reshape(TURNS, -1).sum(axis=0), found.reshape(TURNS, -1).sum(axis=0)
    return np.asarray(found / np.maximum(seen, 1))
