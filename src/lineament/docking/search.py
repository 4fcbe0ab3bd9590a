"""`find_shape`: where a shape is in a scan, from a rough guess."""

import math
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..features import Features
from ..features.features import scan_of
from ..scan import Array, LaserScan, Pose, RangeNoise
from ..scan.fields import checked_pose
from ..scan.poses import compose
from .fitting import SIGMAS, Beams, Fit, beams_of, fit
from .shape import Shape, ShapePose

#: Steps in which a shape is looked for around a guess [m, rad], no wider than a foot of a pallet;
#: starts that are fitted.
_STEP, _TURN, _STARTS = 0.1, math.radians(15), 16
#: A guess is no farther off, unless it is in millimetres [m, m, rad].
_FARTHEST = 10.0
#: Points of a shape that are compared with so many of the scan, none worse than so far off [m].
_SAMPLES, _POINTS, _WORST = 32, 120, 0.3
#: Noise where a scan has none that is known.
_USUAL = RangeNoise(sigma=0.01)
#: So much of a shape has to be seen; no more than so much of it may be passed through by beams.
LEAST_SEEN, MOST_THROUGH = 0.5, 0.1
#: Its pose is no worse known [m, rad]; χ² a degree of freedom is no larger.
WORST, WORST_TURN, WORST_CHI2 = 0.05, math.radians(5), 4.0
#: χ² is beyond chance by so many of its deviations.
_CHANCE = 2.0
#: A fit of few beams may stop beside the best: it is tried again from so far off [m, m, rad].
_ASIDE = [(0.0, y, turn) for y in (-0.02, 0.02) for turn in (-0.03, 0.03)]
#: Another pose so far off [m, rad] that meets so many of the beams makes it ambiguous.
_APART, _AS_MANY = (0.08, math.radians(10)), 0.8


def find_shape(
    features: Features,
    shape: Shape,
    guess: Pose,
    reach: Pose = (0.5, 0.5, math.pi),
    *,
    scan: LaserScan | None = None,
) -> ShapePose | None:
    """Find a shape in a scan.

    Parameters
    ----------
    features : Features
        Of the scan; they have it, and the noise of its ranges.
    shape : Shape
    guess : (x, y, theta)
        Where the shape is, roughly, in the frame of the scan [m, m, rad].
    reach : (x, y, theta)
        How far off the guess may be [m, m, rad].
    scan : LaserScan, optional
        The scan of the features, where they do not have it themselves.

    Returns
    -------
    ShapePose or None
        None where it is not found for sure: less than half of it is seen, beams pass through where
        it should be, another pose explains the scan nearly as well, or the scan does not show its
        pose to 5 cm and 5°.

    Raises
    ------
    ValueError
        If the features have no scan, or the guess or its reach make no sense.

    Examples
    --------
    See `lineament.docking`.
    """
    scan, guess = scan_of(features, scan), checked_pose(guess, "guess")
    if not all(0 <= part <= _FARTHEST for part in checked_pose(reach, "reach")):
        raise ValueError(f"reach is {reach}, expected 0 to {_FARTHEST:g} [m, m, rad]")
    beams = beams_of(scan, features.noise or _USUAL)
    found = (fit(beams, shape, start) for start in _starts(beams, shape, guess, reach))
    fits = [one for one in found if one is not None and _is_within(one.pose, guess, reach)]
    good = sorted(filter(_is_seen, fits), key=_score, reverse=True)
    if not good:
        return None
    best, *rest = good
    again = (fit(beams, shape, compose(best.pose, aside)) for aside in _ASIDE)
    best = max((one for one in (best, *again) if one is not None and _is_seen(one)), key=_score)
    if any(_is_other(best, one) and _score(one) > _AS_MANY * _score(best) for one in rest):
        return None
    # By chance χ² exceeds 1 in half of the scans: to grow by that makes it too large on average.
    mean = best.chi2 / best.freedom
    growth = mean if mean > 1 + _CHANCE * math.sqrt(2 / best.freedom) else 1.0
    # A direction that nothing shows is as good as unknown.
    covariance = np.linalg.inv(best.information + 1e-3 * np.eye(3)) * growth
    place, turn = np.linalg.eigvalsh(covariance[:2, :2])[1], covariance[2, 2]
    if place > WORST**2 or turn > WORST_TURN**2:
        return None
    seen = best.reached / (best.reached + best.short + best.through)
    return ShapePose(best.pose, np.asarray(covariance), seen)


def _starts(beams: Beams, shape: Shape, guess: Pose, reach: Pose) -> list[Pose]:
    """Poses to begin with: the best of a grid around the guess by the points near the shape."""
    steps = [
        np.arange(-math.ceil(r / step), math.ceil(r / step) + 1) * min(step, r)
        for r, step in zip(reach, (_STEP, _STEP, _TURN), strict=True)
    ]
    starts = np.array(list(product(*steps))) + guess
    starts = starts[_is_in_front(starts)]
    if len(starts) == 1:
        return [guess]
    samples = _samples(shape)
    seen = np.isfinite(beams.ranges)
    points = beams.along[seen] * beams.ranges[seen, None]
    size = float(np.linalg.norm(samples, axis=1).max()) + math.hypot(*reach[:2]) + _WORST
    points = points[np.linalg.norm(points - guess[:2], axis=1) < size]
    if not len(points):
        return []
    points = points[:: math.ceil(len(points) / _POINTS)]
    scores = np.array([_distance(points, samples, start) for start in starts])
    chosen: list[Pose] = []
    for k in np.argsort(scores, kind="stable").tolist():
        x, y, theta = starts[k].tolist()
        if all(math.dist((x, y), one[:2]) > _STEP or abs(theta - one[2]) > _TURN for one in chosen):
            chosen.append((x, y, theta))
        if len(chosen) == _STARTS:
            break
    return chosen


def _is_in_front(poses: Array) -> NDArray[np.bool_]:
    """Whether the scanner is before the shape, at negative x of its frame."""
    x, y, theta = poses.T
    return np.asarray(x * np.cos(theta) + y * np.sin(theta) > 0)


def _samples(shape: Shape) -> Array:
    """Points along the shape, evenly spread."""
    lengths = np.linalg.norm(shape.ends[:, 1] - shape.ends[:, 0], axis=1)
    edges = np.concatenate(([0.0], np.cumsum(lengths)))
    along = (np.arange(_SAMPLES) + 0.5) / _SAMPLES * edges[-1]
    piece = np.searchsorted(edges, along, side="right") - 1
    share = ((along - edges[piece]) / lengths[piece])[:, None]
    return np.asarray(shape.ends[piece, 0] * (1 - share) + shape.ends[piece, 1] * share)


def _distance(points: Array, samples: Array, pose: Array) -> float:
    """Mean square distance of the samples from the nearest points [m²]."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    placed = samples @ np.array([[c, s], [-s, c]]) + pose[:2]
    off = ((placed[:, None] - points) ** 2).sum(axis=2).min(axis=1)
    return float(np.minimum(off, _WORST**2).mean())


def _score(one: Fit) -> float:
    """Beams that reach it, each less by its share of the largest χ² at which it would."""
    return one.reached - one.chi2 / SIGMAS**2 - 2.0 * one.through


def _is_seen(one: Fit) -> bool:
    total = one.reached + one.short + one.through
    is_solid = one.through <= MOST_THROUGH * total and one.chi2 <= WORST_CHI2 * one.freedom
    return is_solid and one.reached >= LEAST_SEEN * total


def _between(one: Pose, other: Pose) -> tuple[float, float]:
    """Distance and turn from one pose to another [m, rad]."""
    turn = abs(math.remainder(one[2] - other[2], 2 * math.pi))
    return math.dist(one[:2], other[:2]), turn


def _is_other(one: Fit, other: Fit) -> bool:
    way, turn = _between(one.pose, other.pose)
    return way > _APART[0] or turn > _APART[1]


def _is_within(pose: Pose, guess: Pose, reach: Pose) -> bool:
    way, turn = _between(pose, guess)
    is_near = way < math.hypot(*reach[:2]) + 0.1 and turn < reach[2] + 0.1
    return is_near and bool(_is_in_front(np.array([pose]))[0])
