"""Segments: how many are found, in how many pieces, how far off, and whether they tell it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..scan import Array
from .beams import (
    MIN_BEAMS,
    Spans,
    beams_of,
    common_beams,
    on_small_surfaces,
    overlap_ratios,
    shared_beams,
)
from .consistency import NormalisedErrors, tolerance
from .counts import Counts, Summable, quantile, ratio, rms
from .matching import match

__all__ = ["SegmentScores", "line_errors", "segment_scores"]

#: A found segment is right within this distance [m] and angle [rad] of a true one, if the beams
#: that both have are at least this share of those that either has.
DISTANCE, ANGLE, OVERLAP = 0.10, math.radians(10.0), 0.5


@dataclass(frozen=True, slots=True, eq=False)
class SegmentScores(Summable):
    """Scores of the segments of some scans.

    Attributes
    ----------
    counts : Counts
        Found, true and paired segments.
    fragmented : int
        True segments found in several pieces.
    merged : int
        Found segments that are several true ones.
    errors : ndarray, shape (m, 2)
        Offset [m] of the found line at the true centroid along the left normal, and angle [rad],
        found less true, of the pairs.
    end_distances : ndarray, shape (2m,)
        Distance from each found end point to the true one [m].
    offset_over_bound, angle_over_bound : NormalisedErrors
        `errors` by the bound of the true segment.
    consistency : NormalisedErrors
        Offset at the found centroid and angle, by the found covariance.
    """

    counts: Counts = field(default_factory=Counts)
    fragmented: int = 0
    merged: int = 0
    errors: Array = field(default_factory=lambda: np.empty((0, 2)))
    end_distances: Array = field(default_factory=lambda: np.empty(0))
    offset_over_bound: NormalisedErrors = field(default_factory=lambda: NormalisedErrors.none(1))
    angle_over_bound: NormalisedErrors = field(default_factory=lambda: NormalisedErrors.none(1))
    consistency: NormalisedErrors = field(default_factory=lambda: NormalisedErrors.none(2))

    @property
    def fragmentation(self) -> float:
        """Share of the true segments that were found in several pieces."""
        return ratio(self.fragmented, self.counts.true)

    @property
    def merging(self) -> float:
        """Share of the found segments that are several true ones."""
        return ratio(self.merged, self.counts.found)

    def summary(self) -> dict[str, float]:
        """List all figures by name."""
        return {
            **self.counts.summary(),
            "fragmentation": self.fragmentation,
            "merging": self.merging,
            "offset_rmse": rms(self.errors[:, 0]),
            "angle_rmse": rms(self.errors[:, 1]),
            "end_median": quantile(self.end_distances, 0.5),
            "end_p90": quantile(self.end_distances, 0.9),
            **self.offset_over_bound.bound_summary("offset_"),
            **self.angle_over_bound.bound_summary("angle_"),
            **self.consistency.nees_summary(),
        }


def segment_scores(found: Features, truth: Features) -> SegmentScores:
    """Compare the segments of one scan with the true ones.

    A found segment may be a true one if its centroid is within 0.10 m of the true line, the
    angle between their directions is at most 10°, each or three deviations of the bound if that is
    more, and the overlap of their beams (intersection over union) is at least 0.5. They are
    matched by that overlap. One that is not matched, and has at least half of its beams on
    surfaces too small to be demanded, is left out of the count.

    A true segment is fragmented where several found ones each have more than half of their beams
    in it, and together more than half of its own; a found one is merged where that holds the
    other way round. These are over- and under-segmentation in Hoover et al., *An experimental
    comparison of range image segmentation algorithms*, PAMI 1996, with a tolerance of one half.

    Parameters
    ----------
    found, truth : Features
        Features of one scan, in one frame.

    Returns
    -------
    SegmentScores

    Raises
    ------
    ValueError
        If the two are of scans with different numbers of beams.

    Examples
    --------
    >>> import lineament as ln
    >>> features = ln.extract(ln.LaserScan([2.0] * 9, angle_min=-0.04, angle_increment=0.01))
    >>> segment_scores(features, features).counts
    Counts(correct=1, found=1, true=1)
    """
    n = common_beams(found, truth)
    lines, true_lines = found.segments, truth.segments
    spans, true_spans = beams_of(lines, n), beams_of(true_lines, n)
    demanded = true_lines["n_points"] >= MIN_BEAMS
    offset, turn = line_errors(lines[:, np.newaxis], true_lines)
    overlap = overlap_ratios(spans, true_spans, n)
    spread = tolerance(np.diagonal(true_lines["covariance"], axis1=1, axis2=2))
    near = abs(offset) <= np.maximum(DISTANCE, spread[:, 0])
    near &= (abs(turn) <= np.maximum(ANGLE, spread[:, 1])) & (overlap >= OVERLAP)
    rows, columns = match(1.0 - overlap, near & demanded)
    one, other = lines[rows], true_lines[columns]
    # The other way round: how far the true centroid is from the found line.
    errors = np.column_stack((-line_errors(other, one)[0], turn[rows, columns]))
    at_found = np.column_stack((offset[rows, columns], turn[rows, columns]))
    bound = other["covariance"]
    return SegmentScores(
        Counts.of(rows, on_small_surfaces(spans, truth), demanded),
        _in_pieces(true_spans[demanded], spans, n),
        _in_pieces(spans, true_spans[demanded], n),
        errors,
        np.concatenate([np.hypot(*(one[end] - other[end]).T) for end in ("start", "end")]),
        NormalisedErrors.of(errors[:, :1], bound[:, :1, :1]),
        NormalisedErrors.of(errors[:, 1:], bound[:, 1:, 1:]),
        NormalisedErrors.of(at_found, one["covariance"]),
    )


def line_errors(found: NDArray[np.void], true: NDArray[np.void]) -> tuple[Array, Array]:
    """Offset [m] of each found centroid from its true line, to the left, and angle between them.

    The angle [rad] is the found less the true direction, -π … π. Shapes are broadcast.
    """
    apart = found["centroid"] - true["centroid"]
    offset = apart[..., 1] * np.cos(true["angle"]) - apart[..., 0] * np.sin(true["angle"])
    turn = found["angle"] - true["angle"]
    return offset, (turn + math.pi) % (2 * math.pi) - math.pi


def _in_pieces(wholes: Spans, parts: Spans, n: int) -> int:
    """Count the wholes of which several parts are, that together are most of them."""
    shared = shared_beams(wholes, parts, n)
    of_whole = 2 * shared > parts[:, 1] - parts[:, 0]
    together = (shared * of_whole).sum(axis=1)
    in_pieces = (of_whole.sum(axis=1) > 1) & (2 * together > wholes[:, 1] - wholes[:, 0])
    return int(in_pieces.sum())
