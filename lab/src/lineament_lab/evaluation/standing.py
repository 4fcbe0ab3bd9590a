"""Standing still: the scatter of the same feature in scan after scan, by its covariance."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lineament.features import Features
from lineament.scan import Array

from .beams import beams_of, overlap_ratios
from .consistency import NormalisedErrors, largest_variance, usable_covariances
from .counts import Summable, ratio
from .kinds import line_errors
from .matching import Indices, match, match_points

#: Fewest measurements of the shorter arm of each bin; the next bin begins where it ends.
ARM_BINS = (3, 5, 10, 30, 100)
#: The same segment has this share of its beams in both scans; a corner is within this distance
#: [m], or within this many deviations if that is more.
OVERLAP, GATE, DEVIATIONS = 0.5, 0.10, 5.0


@dataclass(frozen=True, slots=True, eq=False)
class ScatterScores(Summable):
    """How features of one kind scatter."""

    #: Difference between the two sightings of each pair (m,), by the sum of their covariances.
    differences: NormalisedErrors = field(default_factory=lambda: NormalisedErrors.none(2))
    #: Measurements of the shorter arm: of each pair (m,), of each feature that is looked for (f,).
    arms: NDArray[np.int32] = field(default_factory=lambda: np.empty(0, np.int32))
    seen: NDArray[np.int32] = field(default_factory=lambda: np.empty(0, np.int32))
    #: Whether each is found in the next scan (f,).
    again: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, np.bool_))

    def figures(self, low: float = 0, high: float = math.inf) -> dict[str, float]:
        """List the figures of features whose shorter arm has `low` to below `high` measurements."""
        of_bin = (self.arms >= low) & (self.arms < high)
        looked_for = (self.seen >= low) & (self.seen < high)
        differences = NormalisedErrors(self.differences.whitened[of_bin])
        return {
            "pairs": int(of_bin.sum()),
            "nees_median": differences.median_ratio,
            "in_95_ellipse": differences.share_within(0.95),
            "found_again": ratio(int(self.again[looked_for].sum()), int(looked_for.sum())),
        }

    def bins(self) -> dict[str, dict[str, float]]:
        """List the figures of each bin of arm lengths by the name of the bin, as "5-9"."""
        return {
            f"{low}-{high - 1}" if math.isfinite(high) else f"{low}-": self.figures(low, high)
            for low, high in pairwise((*ARM_BINS, math.inf))
        }


@dataclass(frozen=True, slots=True, eq=False)
class StandingScores(Summable):
    """Scatter of the segments and corners of a sensor that stands still."""

    segments: ScatterScores = field(default_factory=ScatterScores)
    corners: ScatterScores = field(default_factory=ScatterScores)


def standing_scores(scans: Iterable[Features]) -> StandingScores:
    """Compare the features of each scan with those of the next, from the same place.

    The true values are the same, so that the difference of two sightings scatters by the sum of
    their covariances, whatever the truth is: it holds what is random alone. Segments are matched
    by the overlap of their beams, at least half; corners by distance, within 0.1 m or 5
    deviations. The shorter arm of a corner is the shorter of its two segments in either scan.

    All are in the sensor's frame. Raises ValueError if two in a row have different numbers of
    beams.

    Examples
    --------
    >>> import lineament as ln
    >>> from lineament.simulation import SENSORS, room
    >>> rng, extract = np.random.default_rng(1), ln.Extractor()
    >>> scans = (SENSORS["paper"].scan(room(), (0, 0, 0), rng) for _ in range(50))
    >>> scores = standing_scores(map(extract, scans)).segments.bins()
    >>> 0.7 < scores["100-"]["nees_median"] < 1.4
    True
    """
    parts = []
    for features, after in pairwise(scans):
        if len(features.clusters) != len(after.clusters):
            raise ValueError(
                f"two scans have {len(features.clusters)} and {len(after.clusters)} beams, "
                "expected the same number"
            )
        parts.append(StandingScores(_segments(features, after), _corners(features, after)))
    return StandingScores.total(parts)


def _segments(features: Features, after: Features) -> ScatterScores:
    one, other = features.segments, after.segments
    n = len(features.clusters)
    overlap = overlap_ratios(beams_of(one, n), beams_of(other, n))
    rows, columns = match(1.0 - overlap, overlap >= OVERLAP)
    first, second = one[rows], other[columns]
    errors = np.column_stack(line_errors(second, first))
    between = second["centroid"] - first["centroid"]
    # The covariance of the first is moved along it to the centroid of the second.
    lever = np.tile(np.eye(2), (len(rows), 1, 1))
    lever[:, 0, 1] = between[:, 0] * np.cos(first["angle"]) + between[:, 1] * np.sin(first["angle"])
    covariances = lever @ first["covariance"] @ lever.transpose(0, 2, 1) + second["covariance"]
    arms = np.minimum(first["n_points"], second["n_points"])
    return _scores(errors, covariances, arms, one["n_points"], rows)


def _corners(features: Features, after: Features) -> ScatterScores:
    one, other = features.corners, after.corners
    variances = largest_variance(one["covariance"])[:, np.newaxis]
    spread = np.sqrt(variances + largest_variance(other["covariance"]))
    gate = np.maximum(GATE, DEVIATIONS * spread)
    rows, columns, _ = match_points(one["position"], other["position"], gate)
    errors = one["position"][rows] - other["position"][columns]
    covariances = one["covariance"][rows] + other["covariance"][columns]
    seen, seen_after = _shorter_arms(features), _shorter_arms(after)
    return _scores(errors, covariances, np.minimum(seen[rows], seen_after[columns]), seen, rows)


def _scores(
    errors: Array,
    covariances: Array,
    arms: NDArray[np.int32],
    seen: NDArray[np.int32],
    found: Indices,
) -> ScatterScores:
    usable = usable_covariances(covariances)
    again = np.isin(np.arange(len(seen)), found)
    differences = NormalisedErrors.of(errors[usable], covariances[usable])
    return ScatterScores(differences, arms[usable], seen, again)


def _shorter_arms(features: Features) -> NDArray[np.int32]:
    """Measurements of the shorter segment of each vertex; 0 if it has not two."""
    counts = np.append(features.segments["n_points"], np.int32(0))
    return np.asarray(counts[features.corners["segments"]].min(axis=1))
