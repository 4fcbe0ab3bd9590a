"""Whether features are found again from another place, in logs with known poses."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from lineament.features import CORNER, Features
from lineament.scan import Array, LaserScan, Pose
from lineament.scan.poses import relative

from .beams import nearest_beams, with_neighbours
from .counts import Summable, ratio, rms
from .kinds import ANGLE
from .matching import distances, distances_from_segments, match, match_points

#: Places on a segment at which it is looked for, and the share of them that must be in view, and
#: found again.
_PLACES, _SHARE = 16, 0.5
#: Turns about the sensor that move a corner to where it is not, to see what is found there; the
#: least is an eighth of a right angle [rad], beyond the gate at any range that counts.
TURNS, LEAST_TURN = 24, math.radians(11.25)


@dataclass(frozen=True, slots=True, eq=False)
class Repeats(Summable):
    """Features of one view that are expected in another, and how far those found there are [m]."""

    expected: int = 0
    distances: Array = field(default_factory=lambda: np.empty(0))

    @property
    def repeated(self) -> int:
        """How many are found again."""
        return len(self.distances)

    @property
    def rate(self) -> float:
        """Share of the expected that are found again; NaN if none is expected."""
        return ratio(self.repeated, self.expected)

    @property
    def rmse(self) -> float:
        """Root of the mean squared distance [m]; of the errors of both views and of the poses."""
        return rms(self.distances)


@dataclass(frozen=True, slots=True, eq=False)
class Repeatability(Summable):
    """Corners and segments of some views that are found again in others."""

    corners: Repeats = field(default_factory=Repeats)
    segments: Repeats = field(default_factory=Repeats)


@dataclass(frozen=True, slots=True, eq=False)
class RankedRepeats(Summable):
    """Corners of one view that are in sight of another, ranked by a score, the highest first.

    Examples
    --------
    >>> repeated = np.array([False, True, True, True])
    >>> ranked = RankedRepeats(np.array([0.2, 0.9, 0.8, 0.1]), repeated, np.zeros(4))
    >>> ranked.count_at(0.8), ranked.rate, ranked.auc
    (2.0, 0.75, 0.6666666666666666)
    """

    scores: Array = field(default_factory=lambda: np.empty(0))
    #: Whether each is found again, and the probability that something is in its place by chance.
    repeated: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, np.bool_))
    chance: Array = field(default_factory=lambda: np.empty(0))

    @property
    def rate(self) -> float:
        """Share of all that are found again, less what chance finds."""
        rates = self.curve()[1]
        return float(rates[-1]) if len(rates) else math.nan

    @property
    def auc(self) -> float:
        """Probability that one that is found again has a higher score than one that is not."""
        good, bad = self.scores[self.repeated], np.sort(self.scores[~self.repeated])
        below = np.searchsorted(bad, good, "left") + np.searchsorted(bad, good, "right")
        return ratio(0.5 * float(below.sum()), len(good) * len(bad))

    def curve(self) -> tuple[Array, Array]:
        """Corners repeated among the best 1, 2, …, m, and the share of these, without chance.

        If a share c is found by chance, of N corners R = T + c (N - T) are found again if T
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
        """`rate` of those whose score is from `low` to below `high`."""
        inside = (low <= self.scores) & (self.scores < high)
        ranked = RankedRepeats(self.scores[inside], self.repeated[inside], self.chance[inside])
        return ranked.rate

    def count_at(self, rate: float) -> float:
        """Most corners repeated, without chance, among the best of which this share is."""
        repeated, rates = self.curve()
        return float(repeated[rates >= rate].max(initial=0.0))


def repeatability(
    scan: LaserScan,
    features: Features,
    other_scan: LaserScan,
    other_features: Features,
    *,
    gate: float = 0.10,
) -> Repeatability:
    """Look for the features of another scan in this one; swap them for the other direction.

    They are moved into this scan's frame by the two poses. One is expected here if it lies in
    the field of view and within the limits of range, and a beam that passes by it (the nearest,
    or a neighbour) goes at least that far, less the gate: then nothing occludes it. A corner is
    found again within the gate, and expected even if only one of its sides is in sight. A segment
    is expected if it shows this scanner its front, and at least half of 16 places along it are in
    sight; it is found again as one whose direction differs by at most 10° and which is within the
    gate of at least half of those in sight. Both are matched one to one.

    The gate [m] must allow for the errors of the poses. Raises ValueError if a scan has no pose,
    or the gate is not more than 0.

    Examples
    --------
    >>> import lineament as ln
    >>> from lineament.simulation import SENSORS, room
    >>> rng, poses = np.random.default_rng(1), ((0, 0, 0), (0.3, 0.2, 0.1))
    >>> here, there = (SENSORS["paper"].scan(room(), pose, rng) for pose in poses)
    >>> found = repeatability(here, ln.extract(here), there, ln.extract(there))
    >>> found.corners.rate, found.segments.rate
    (1.0, 1.0)
    """
    if not gate > 0:
        raise ValueError(f"gate is {gate}, expected a distance > 0")
    moved = other_features.transform(*_motion(scan, other_scan))
    others = moved.corners["position"]
    others = others[in_sight(scan, others, gate)]
    *_, apart = match_points(features.corners["position"], others, gate)
    return Repeatability(
        Repeats(len(others), apart),
        _segments_again(scan, features.segments, moved.segments, gate),
    )


def with_edges(features: Features) -> Features:
    """Return features with the edges among the corners: both have a quality."""
    corners = np.zeros(len(features.corners) + len(features.edges), CORNER)
    for name in ("position", "covariance", "quality"):
        corners[name] = np.concatenate((features.corners[name], features.edges[name]))
    return replace(features, corners=corners)


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

    As `repeatability`, corner by corner, each with its score (K,). By chance a corner is found if,
    turned about this sensor to another bearing where it would be in sight too, there is one within
    the gate. Raises ValueError if a scan has no pose.
    """
    others = other_features.transform(*_motion(scan, other_scan)).corners["position"]
    expected = in_sight(scan, others, gate)
    others, positions = others[expected], features.corners["position"]
    repeated = np.zeros(len(others), dtype=np.bool_)
    repeated[match_points(others, positions, gate)[0]] = True
    # Share of the turns of each corner, among those in sight, that put it near another.
    turns = np.linspace(LEAST_TURN, 2 * math.pi - LEAST_TURN, TURNS)
    c, s = np.cos(turns)[:, np.newaxis], np.sin(turns)[:, np.newaxis]
    x, y = others.T
    turned = np.stack((c * x - s * y, s * x + c * y), axis=-1).reshape(-1, 2)
    seen = in_sight(scan, turned, gate)
    met = (distances(turned, positions) <= gate).any(axis=1) & seen
    seen, met = seen.reshape(TURNS, -1).sum(axis=0), met.reshape(TURNS, -1).sum(axis=0)
    return RankedRepeats(scores[expected], repeated, met / np.maximum(seen, 1))


def _motion(scan: LaserScan, other_scan: LaserScan) -> Pose:
    """Pose of the other scan in the frame of this one."""
    if scan.pose is None or other_scan.pose is None:
        which = "scan" if scan.pose is None else "other_scan"
        raise ValueError(f"{which} has no pose, expected (x, y, theta)")
    return relative(scan.pose, other_scan.pose)


def _segments_again(
    scan: LaserScan, segments: NDArray[np.void], others: NDArray[np.void], gate: float
) -> Repeats:
    along = (np.arange(_PLACES) + 0.5)[:, np.newaxis] / _PLACES
    start, end = others["start"][:, np.newaxis], others["end"][:, np.newaxis]
    places = start + along * (end - start)
    seen = in_sight(scan, places.reshape(-1, 2), gate).reshape(-1, _PLACES)
    # Beams run counter-clockwise: a surface that is seen has the scanner on its left.
    normal = np.column_stack((-np.sin(others["angle"]), np.cos(others["angle"])))
    in_front = (others["centroid"] * normal).sum(axis=1) < 0
    expected = in_front & (seen.mean(axis=1) >= _SHARE)
    places, seen = places[expected], seen[expected]
    # By segment here, expected segment, and place on it.
    distance = distances_from_segments(places, segments[:, np.newaxis, np.newaxis])
    n_seen = seen.sum(axis=1)
    again = ((distance <= gate) & seen).sum(axis=2) >= _SHARE * n_seen
    turn = segments["angle"][:, np.newaxis] - others["angle"][expected]
    again &= np.cos(turn) >= math.cos(ANGLE)
    mean = np.minimum(distance, gate).sum(axis=2, where=seen) / n_seen
    return Repeats(int(expected.sum()), mean[match(mean, again)])


def in_sight(scan: LaserScan, points: Array, margin: float) -> NDArray[np.bool_]:
    """Whether a scan can have seen each point: in view, in range, and with nothing before it.

    A beam may be shorter than the way to the point by the margin [m].
    """
    if not len(scan):
        return np.zeros(len(points), dtype=np.bool_)
    distance = np.hypot(points[:, 0], points[:, 1])
    nearest, in_view = nearest_beams(scan, points)
    reach = np.where(scan.valid, scan.ranges, -np.inf)[with_neighbours(scan)].max(axis=1)[nearest]
    in_range = (distance >= scan.range_min) & (distance < scan.range_max)
    return np.asarray(in_view & in_range & (reach >= distance - margin))


def score_pairs(
    pairs: Sequence[tuple[LaserScan, LaserScan]],
    extract: Callable[[LaserScan], Features],
    rate: float,
) -> tuple[RankedRepeats, dict[str, float]]:
    """Return the ranked corners of all pairs of scans, both ways, and their numbers.

    ``count`` is of the best corners of which the share `rate` is repeated.
    """
    found = [(a, extract(a), b, extract(b)) for a, b in pairs]
    views = [view for a, fa, b, fb in found for view in ((a, fa, b, fb), (b, fb, a, fa))]
    each_way = [repeatability(*view) for view in views]
    again = Repeatability.total(each_way)
    both_ways = list(zip(each_way[::2], each_way[1::2], strict=True))
    every, alone = (
        RankedRepeats.total(
            ranked_repeats(a, of(fa), b, of(fb), of(fb).corners["quality"])
            for a, fa, b, fb in views
        )
        for of in (with_edges, replace)
    )
    return every, {
        "expected": len(every.scores),
        "rate": every.rate,
        "auc": every.auc,
        "count": every.count_at(rate),
        "chance": float(every.chance.mean()) if len(every.chance) else 0.0,
        "count_without_edges": alone.count_at(rate),
        "auc_without_edges": alone.auc,
        "rate_without_edges": alone.rate,
        "corners_per_scan": sum(len(features.corners) for _, features, _, _ in found) / len(found),
        "corners_expected": again.corners.expected,
        "corner_rate": again.corners.rate,
        "corner_rmse": again.corners.rmse,
        "fewer_rate": ratio(
            sum(min(a.corners.repeated, b.corners.repeated) for a, b in both_ways),
            sum(min(a.corners.expected, b.corners.expected) for a, b in both_ways),
        ),
        "segments_expected": again.segments.expected,
        "segment_rate": again.segments.rate,
        "segment_rmse": again.segments.rmse,
    }
