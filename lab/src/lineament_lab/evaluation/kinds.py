"""Corners, segments and arcs against the true ones: found, how far off, and consistent."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lineament.features import TABLES, Features, make_records
from lineament.scan import Array

from .beams import (
    MIN_BEAMS,
    Masks,
    beams_of,
    common_beams,
    on_small_surfaces,
    overlap_ratios,
    shared_beams,
)
from .consistency import NormalisedErrors, largest_variance, tolerance
from .counts import Counts, Summable, quantile, ratio, rms
from .matching import Indices, distances, match

#: A feature is right within this distance of a true one [m], a segment also within this angle
#: [rad]; segments and arcs if their beams overlap by this share.
GATE, ANGLE, OVERLAP = 0.10, math.radians(10.0), 0.5
#: Corners are counted within each of these distances [m].
CORNER_GATES = (0.05, GATE, 0.25)

#: Figures of the errors: which errors, and their measure.
_FIGURES: dict[str, tuple[str, Callable[[Array], float]]] = {
    "rmse": ("position", rms),
    "median_error": ("position", partial(quantile, share=0.5)),
    "offset_rmse": ("offset", rms),
    "angle_rmse": ("angle", rms),
    "end_median": ("end", partial(quantile, share=0.5)),
    "end_p90": ("end", partial(quantile, share=0.9)),
    "center_rmse": ("center", rms),
    "radius_rmse": ("radius", rms),
}


@dataclass(frozen=True, slots=True, eq=False)
class FeatureScores(Summable):
    """Scores of the features of one kind in some scans."""

    #: Found, true and paired features by distance [m]: 0.10, of corners 0.05 and 0.25 too.
    by_gate: dict[float, Counts]
    #: Of segments "fragmentation", true ones in several pieces, and "merging", several in one.
    pieces: dict[str, int]
    #: Of the pairs within 0.10 m: distance of the "position" of corners [m]; "offset" of the found
    #: line at the true centroid to the left [m], "angle" [rad] and distances of both "end" points
    #: [m] of segments; distance of the "center", and "radius" of arcs [m].
    errors: dict[str, Array]
    #: Errors by the bound of the true feature, as "", of segments as "offset_" and "angle_".
    over_bound: dict[str, NormalisedErrors]
    #: Errors by the found covariance; of segments offset at the found centroid, and angle.
    consistency: NormalisedErrors

    @classmethod
    def none(cls, kind: str) -> "FeatureScores":
        """Return those of no scan, of "corners", "segments" or "arcs"."""
        score = {"corners": corner_scores, "segments": segment_scores, "arcs": arc_scores}[kind]
        tables: dict[str, Any] = {name: make_records(name, []) for name in TABLES}
        nothing = Features(**tables, clusters=np.empty(0, np.int32))
        return score(nothing, nothing)

    @property
    def counts(self) -> Counts:
        """Found, true and paired features within 0.10 m."""
        return self.by_gate[GATE]

    def summary(self) -> dict[str, float]:
        """List all figures by name."""
        figures: dict[str, float] = {}
        for gate, counts in self.by_gate.items():
            figures |= counts.summary(f"_{gate:.2f}" if len(self.by_gate) > 1 else "")
        wholes = {"fragmentation": self.counts.true, "merging": self.counts.found}
        figures |= {name: ratio(count, wholes[name]) for name, count in self.pieces.items()}
        for name, (errors, measure) in _FIGURES.items():
            if errors in self.errors:
                figures[name] = measure(self.errors[errors])
        for prefix, normalised in self.over_bound.items():
            figures |= normalised.bound_summary(prefix)
        return figures | self.consistency.nees_summary()


def corner_scores(found: Features, truth: Features) -> FeatureScores:
    """Compare the corners of one scan with the true ones; the parameters are those of `evaluate`.

    They are matched by distance, within each gate or three deviations of the bound if that is
    more: no estimate can be asked to be nearer. A true corner is demanded if both its segments
    have at least `MIN_BEAMS` beams; demanded ones are matched first, and a found corner that is
    then matched with one of the others is left out of the count. All others that are found, on a
    round column or anywhere else, are mistakes.

    Examples
    --------
    >>> import lineament as ln
    >>> bearings = np.linspace(-0.5, 0.5, 101)
    >>> wedge = ln.LaserScan(2.0 / (np.cos(bearings) + abs(np.sin(bearings))), angles=bearings)
    >>> features = ln.extract(wedge, method="liu:scale_free")
    >>> corner_scores(features, features).counts
    Counts(correct=1, found=1, true=1)
    """
    corners, true = found.corners, truth.corners
    apart = distances(corners["position"], true["position"])
    spread = tolerance(largest_variance(true["covariance"]))
    large = np.append(truth.segments["n_points"] >= MIN_BEAMS, False)
    demanded = np.asarray(large[true["segments"]].all(axis=1))
    by_gate, pairs = {}, {}
    for gate in CORNER_GATES:
        near = apart <= np.maximum(gate, spread)
        pairs[gate] = match(apart, near & demanded)
        unmatched = np.ones((len(corners), 1), dtype=np.bool_)
        unmatched[pairs[gate][0]] = False
        excused = np.zeros(len(corners), dtype=np.bool_)
        excused[match(apart, near & ~demanded & unmatched)[0]] = True
        by_gate[gate] = Counts.of(pairs[gate][0], excused, demanded)
    one, other = corners[pairs[GATE][0]], true[pairs[GATE][1]]
    errors = one["position"] - other["position"]
    return FeatureScores(
        by_gate,
        {},
        {"position": apart[pairs[GATE]]},
        {"": NormalisedErrors.of(errors, other["covariance"])},
        NormalisedErrors.of(errors, one["covariance"]),
    )


def segment_scores(found: Features, truth: Features) -> FeatureScores:
    """Compare the segments of one scan with the true ones; the parameters are those of `evaluate`.

    A found segment may be a true one if its centroid is within 0.10 m of the true line, the
    angle between their directions is at most 10°, each or three deviations of the bound if that is
    more, and the overlap of their beams (intersection over union) is at least 0.5. They are
    matched by that overlap. One that is not matched, and has at least half of its beams on
    surfaces too small to be demanded, is left out of the count.

    A true segment is fragmented if several found ones each have more than half of their beams
    in it, and together more than half of its beams; a found one is merged if that holds the
    other way round. These are over- and under-segmentation in Hoover et al., *An experimental
    comparison of range image segmentation algorithms*, PAMI 1996, with a tolerance of one half.

    Examples
    --------
    >>> import lineament as ln
    >>> features = ln.extract(ln.LaserScan([2.0] * 9, angle_min=-0.04, angle_increment=0.01))
    >>> segment_scores(features, features).counts
    Counts(correct=1, found=1, true=1)
    """
    offset, turn = line_errors(found.segments[:, np.newaxis], truth.segments)
    spread = _deviations(truth.segments)
    near = abs(offset) <= np.maximum(GATE, spread[:, 0])
    near &= abs(turn) <= np.maximum(ANGLE, spread[:, 1])
    pairs, counts, masks, true_masks = _matched(found, truth, "segments", near)
    one, other = found.segments[pairs[0]], truth.segments[pairs[1]]
    # The other way round: how far the true centroid is from the found line.
    offset_there, turn = -line_errors(other, one)[0], turn[pairs]
    bound = other["covariance"]
    ends = [np.hypot(*(one[end] - other[end]).T) for end in ("start", "end")]
    return FeatureScores(
        {GATE: counts},
        {"fragmentation": _in_pieces(true_masks, masks), "merging": _in_pieces(masks, true_masks)},
        {"offset": offset_there, "angle": turn, "end": np.concatenate(ends)},
        {
            "offset_": NormalisedErrors.of(offset_there[:, np.newaxis], bound[:, :1, :1]),
            "angle_": NormalisedErrors.of(turn[:, np.newaxis], bound[:, 1:, 1:]),
        },
        NormalisedErrors.of(np.column_stack((offset[pairs], turn)), one["covariance"]),
    )


def arc_scores(found: Features, truth: Features) -> FeatureScores:
    """Compare the arcs of one scan with the true ones; the parameters are those of `evaluate`.

    As `segment_scores`, with centre and radius each within 0.10 m, or three deviations of the
    bound if that is more.
    """
    one, other = (np.column_stack((f.arcs["center"], f.arcs["radius"])) for f in (found, truth))
    spread = _deviations(truth.arcs)
    apart = distances(one[:, :2], other[:, :2])
    near = apart <= np.maximum(GATE, np.hypot(spread[:, 0], spread[:, 1]))
    near &= abs(one[:, np.newaxis, 2] - other[:, 2]) <= np.maximum(GATE, spread[:, 2])
    pairs, counts, *_ = _matched(found, truth, "arcs", near)
    errors = one[pairs[0]] - other[pairs[1]]
    return FeatureScores(
        {GATE: counts},
        {},
        {"center": apart[pairs], "radius": errors[:, 2]},
        {"": NormalisedErrors.of(errors, truth.arcs["covariance"][pairs[1]])},
        NormalisedErrors.of(errors, found.arcs["covariance"][pairs[0]]),
    )


def _deviations(true: NDArray[np.void]) -> Array:
    """Tolerance of each component of true features, shape (T, k)."""
    return tolerance(np.diagonal(true["covariance"], axis1=1, axis2=2))


def _matched(
    found: Features, truth: Features, kind: str, near: NDArray[np.bool_]
) -> tuple[tuple[Indices, Indices], Counts, Masks, Masks]:
    """Match segments or arcs by the overlap of their beams.

    Returns the pairs, the counts, the beams of the found ones, and those of the demanded ones.
    """
    n = common_beams(found, truth)
    true = getattr(truth, kind)
    masks, true_masks = beams_of(getattr(found, kind), n), beams_of(true, n)
    demanded = true["n_points"] >= MIN_BEAMS
    overlap = overlap_ratios(masks, true_masks)
    pairs = match(1.0 - overlap, near & (overlap >= OVERLAP) & demanded)
    counts = Counts.of(pairs[0], on_small_surfaces(masks, truth), demanded)
    return pairs, counts, masks, true_masks[demanded]


def _in_pieces(wholes: Masks, parts: Masks) -> int:
    """Count the wholes that several parts lie in, which together are most of them."""
    shared = shared_beams(wholes, parts)
    inside = 2 * shared > parts.sum(axis=1)
    together = (shared * inside).sum(axis=1)
    return int(((inside.sum(axis=1) > 1) & (2 * together > wholes.sum(axis=1))).sum())


def line_errors(found: NDArray[np.void], true: NDArray[np.void]) -> tuple[Array, Array]:
    """Offset [m] of each found centroid from its true line, to the left, and angle between them.

    The angle [rad] is the found less the true direction, -π … π. Shapes are broadcast.
    """
    apart = found["centroid"] - true["centroid"]
    offset = apart[..., 1] * np.cos(true["angle"]) - apart[..., 0] * np.sin(true["angle"])
    turn = found["angle"] - true["angle"]
    return offset, (turn + math.pi) % (2 * math.pi) - math.pi
