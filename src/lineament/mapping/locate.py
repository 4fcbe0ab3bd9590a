"""`locate`: where a local map lies on a plan, how sure that is, and whether it is lost."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..features import Features
from ..kernels.mapping.votes import choose
from ..scan import Array, LaserScan, Pose
from ..scan.fields import checked_pose, covariance_of_pose
from ..walls import wrapped
from .evidence import ON_DRAWING, Evidence, evidence_of, on_map, over_chance
from .hypotheses import BOX, TURN, agreement, hypotheses, image_of, spectrum
from .line_map import LineMap
from .local_map import LocalMap, Query, query_of_scan, some
from .refine import COARSE, FINE, WEAK, adjusted, refined

#: What `Location.verdict` may be.
LOCATED, AMBIGUOUS, UNOBSERVED, LOST = VERDICTS = (
    "located",
    "ambiguous",
    "direction unobserved",
    "not on this map",
)

#: Poses that are tried by few beams, refined, and judged by all beams; on a map, those with the
#: most votes are refined in any case.
TRIED, SIFTED, REFINED, JUDGED, VOTED = 800, 60, 24, 20, 16
_FEWEST_BEAMS, _FEW_BEAMS = 12, 40
#: The best is compared with poses so far off along what it is known least [m].
_SLIDES = np.kron((0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0), (-1.0, 1.0))
#: Poses nearer to each other are one, before and after they are refined [m, rad].
_NEAR, _SAME = (0.15, 0.06), (0.06, 0.02)
#: The best pose is more likely than the next by so much (nats), and than chance: that of a wrong
#: pose, times the number of poses that a plan has room for.
SURE = math.log(1000)
#: The same over the best pose of the mirror image; and this and what it is over chance together,
#: as one that only just passes both limits is rarely right.
NOT_MIRRORED, BOTH = 3.0, 18.0
#: On maps that scans made: over the best pose on another's map, and over other poses of this one
#: and of its mirror image, and both; nearer to the best than `FAR` [m], as on a drawing.
SURE_ON_MAP, LEAD, BOTH_ON_MAP, FAR = math.log(100), 12.0, 30.0, 0.5
#: If more of the beams are contradicted, it is not this map: where there is a guess, and where not.
MOST_CONTRADICTED, LESS_CONTRADICTED = 0.05, 0.03
#: A direction in which the pose is known no better is unobserved [m]; poses nearer to the best, and
#: turned by less [rad], are one place with it.
UNSURE, BESIDE = 0.15, 0.1
#: Errors of beams and walls beside their covariances [m]: where poses are tried, and judged.
_WIDE, _TIGHT = 0.12, 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Location:
    """Where the sensor is on a plan.

    Attributes
    ----------
    verdict : str
        One of `VERDICTS`. Only a pose that is "located" is to be relied upon.
    pose : (x, y, theta)
        The best pose of the sensor in the frame of the plan [m, m, rad].
    covariance : ndarray, shape (3, 3)
        Of the pose [m, m, rad]; large in the direction that is unobserved. It contains poses beside
        the best that are nearly as likely.
    evidence : Evidence
        What the beams say of the pose.
    unobserved : (x, y) or None
        Unit vector in the plan's frame, along which the pose is not known.
    alternatives : list of (pose, Evidence)
        Other poses that explain what was seen nearly as well, the best first.
    """

    verdict: str
    pose: Pose
    covariance: Array
    evidence: Evidence
    unobserved: tuple[float, float] | None = None
    alternatives: list[tuple[Pose, Evidence]] = field(default_factory=list)

    def __bool__(self) -> bool:
        return self.verdict == LOCATED

    def __repr__(self) -> str:
        x, y, theta = self.pose
        of_x, of_y, of_theta = np.sqrt(np.diag(self.covariance))
        others = f", {len(self.alternatives)} alternatives" if self.alternatives else ""
        return (
            f"Location({self.verdict}: {x:.3f} ± {of_x:.3f} m, {y:.3f} ± {of_y:.3f} m, "
            f"{math.degrees(theta):.2f} ± {math.degrees(of_theta):.2f}°, "
            f"{100 * self.evidence.explained:.0f} % explained{others})"
        )


def locate(
    query: Features | LocalMap | Query,
    plan: LineMap,
    guess: Pose | None = None,
    covariance: ArrayLike | None = None,
    *,
    scan: LaserScan | None = None,
) -> Location:
    """Find where features, or a local map, lie on a plan, with or without a first guess.

    Corners of both that are alike vote for poses; those are refined by weighted least squares of
    walls on walls, and judged by the beams: explained, short, or passing through a wall. What is
    not located on walls that are some centimetres off is looked for as if they were exact, too.

    Parameters
    ----------
    query : Features, LocalMap or Query
        What was seen. Features of one scan need the scan, which they have from `extract`; a local
        map of several metres says much more.
    plan : LineMap
    guess : (x, y, theta), optional
        Pose of the sensor in the frame of the plan, as it is known before [m, m, rad].
    covariance : array_like, shape (3, 3), optional
        Of the guess; by default that of 0.5 m and 10°.
    scan : LaserScan, optional
        The scan of the features, where they do not have it themselves.

    Returns
    -------
    Location

    Raises
    ------
    ValueError
        If a covariance is given without a guess.

    Examples
    --------
    >>> import lineament as ln
    >>> from lineament.simulation import SENSORS, room
    >>> plan = LineMap.from_lines(room().segments)
    >>> seen = SENSORS["utm30lx"].scan(room(), (-1.0, 0.5, 0.7), np.random.default_rng(0))
    >>> where = locate(ln.extract(seen), plan)
    >>> where.verdict, [round(value, 2) for value in where.pose]
    ('located', [-1.0, 0.5, 0.7])
    """
    if guess is None and covariance is not None:
        raise ValueError("a covariance is given without a guess, which it would be that of")
    if not isinstance(plan, LineMap):
        raise TypeError(f"plan is of type {type(plan).__name__}, expected LineMap: LineMap.read")
    if isinstance(query, LocalMap):
        query = query.query()
    elif not isinstance(query, Query):
        query = query_of_scan(query, scan)
    if guess is not None:
        return located_near(query, plan, checked_pose(guess, "guess"), covariance)
    where = _anywhere(query, plan)
    if where or not plan.is_mapped:
        return where
    # It may be as exact and as whole as it is drawn; its walls are no better known by that.
    drawn = _anywhere(query, plan.as_drawn)
    if not drawn:
        return where
    best = np.array([drawn.pose])
    _, (pairs, *_), _ = refined(best, query, plan.index, FINE)
    _, information = adjusted(best[0], pairs, query, plan.index)
    return replace(drawn, covariance=drawn.covariance + np.linalg.inv(information + WEAK))


def located_near(
    query: Query,
    plan: LineMap,
    guess: Pose,
    covariance: ArrayLike | None = None,
    *,
    is_prior: bool = False,
) -> Location:
    """Look for what was seen near a guess, as `locate` does.

    If the guess is a prior, as of a graph that knows how far its poses are off, chance has only the
    poses near it to choose from, also on a map. It has all where somebody only says where it is, or
    the sensor may have been carried away.
    """
    tried = _near(guess, covariance, query, plan)
    poses, found = _searched(tried, query, plan)
    if not len(poses):
        return Location(LOST, guess, UNKNOWN, _NOTHING)
    favour = max(math.log(max(poses_on(plan), 1.0) / len(tried)), 0.0) if is_prior else 0.0
    return _judged(poses, found, query, plan, len(tried), favour)


def _anywhere(query: Query, plan: LineMap) -> Location:
    """Look for what was seen without a guess."""
    poses, found = _searched(voted(query.anchors, query, plan), query, plan)
    if not len(poses):
        return Location(LOST, (0.0, 0.0, 0.0), UNKNOWN, _NOTHING)
    odds, where = found[0, 0], _judged(poses, found, query, plan, poses_on(plan))
    if where.verdict != LOCATED:
        return where
    if not plan.is_mapped and where.evidence.contradicted > LESS_CONTRADICTED:
        return replace(where, verdict=LOST)
    # Chance, and a plan that is mirrored, do as well by the mirror image of what was seen.
    image = query.mirrored()
    _, feigned = _searched(voted(image_of(query.anchors), image, plan), image, plan, 0.0)
    ahead = odds - feigned[:, 0].max(initial=-math.inf)
    if ahead < -SURE:
        return replace(where, verdict=LOST)
    least, both = (LEAD, BOTH_ON_MAP) if plan.is_mapped else (NOT_MIRRORED, BOTH)
    is_doubtful = ahead < max(least, both - where.evidence.log_odds)
    return replace(where, verdict=AMBIGUOUS) if is_doubtful else where


#: Covariance of a pose of which nothing is known, and of a guess for which none is given.
UNKNOWN = np.diag((1e6, 1e6, 10.0))
GUESS = np.diag((0.5, 0.5, math.radians(10))) ** 2
_NOTHING = Evidence(-math.inf, 0.0, 0.0, 0.0, 0)


def voted(anchors: Array, query: Query, plan: LineMap) -> Array:
    """Poses of a local map for which its anchors vote: corners and ends of walls."""
    by_turn = agreement(spectrum(query.walls), plan.spectrum)
    return hypotheses(anchors, plan.anchors, by_turn, TRIED)


def _near(guess: Pose, covariance: ArrayLike | None, query: Query, plan: LineMap) -> Array:
    """Poses within 2 σ of a guess; where those are too many, those within 4 σ that have votes."""
    spread = GUESS if covariance is None else covariance_of_pose(covariance)
    reach = 2 * np.sqrt(np.diag(spread))
    counts = 2 * np.ceil(reach / (*[BOX / 2] * 2, TURN / 2)).astype(np.int64) + 1
    if np.prod(counts.astype(float)) <= TRIED:
        steps = [np.linspace(-d, d, n) for d, n in zip(reach, counts, strict=True)]
        return np.asarray(guess + np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 3))
    tried = voted(query.anchors, query, plan)
    return np.vstack((guess, tried[squares_off(tried, guess, spread) < 16.0]))


def squares_off(poses: Array, guess: Pose, covariance: Array) -> Array:
    """Return the squares of poses (n, 3) off a guess, over its covariance."""
    off = poses - guess
    off[:, 2] = wrapped(off[:, 2])
    return np.asarray(np.einsum("ni,ij,nj->n", off, np.linalg.inv(covariance), off))


def _searched(
    tried: Array, query: Query, plan: LineMap, apart: float = LEAD
) -> tuple[Array, Array]:
    """Try poses by few beams, refine the best, and judge them by all; the best come first.

    What is less likely than the best by more than `apart` [nats] need not be judged by all.
    """
    if not len(tried):
        return tried, np.zeros((0, 4))
    wide, tight = (on_map(s) if plan.is_mapped else ON_DRAWING for s in (_WIDE, _TIGHT))
    voted = tried[: VOTED if plan.is_mapped else 0]
    for count, most in ((_FEWEST_BEAMS, SIFTED), (_FEW_BEAMS, REFINED)):
        found = evidence_of(tried, some(query.beams, count), plan.index, _WIDE, wide)
        tried = tried[distinct(tried, found[:, 0], _NEAR, most)]
    tried = np.concatenate((tried, voted))
    # What is near enough may be moved away by a wrong pair of walls that is looked for far off.
    starts = np.concatenate((tried, refined(tried, query, plan.index, COARSE)[0]))
    poses, _, information = refined(starts, query, plan.index, FINE)
    found = evidence_of(poses, query.beams, plan.index, _TIGHT, tight, apart=apart)
    # Along a corridor, poses some way off may be nearly as likely.
    best = found[:, 0].argmax()
    covariance = np.linalg.inv(information[best] + WEAK)
    slid = np.tile(poses[best], (len(_SLIDES), 1))
    slid[:, :2] += np.outer(_SLIDES, np.linalg.eigh(covariance[:2, :2])[1][:, 1])
    slid, _, _ = refined(slid, query, plan.index, FINE)
    limits = {"best": found[best, 0], "apart": apart}
    of_slid = evidence_of(slid, query.beams, plan.index, _TIGHT, tight, **limits)
    found = np.concatenate((found, of_slid))
    poses = np.concatenate((poses, slid))
    kept = distinct(poses, found[:, 0], _SAME, JUDGED)
    return poses[kept], found[kept]


def distinct(
    poses: Array, scores: Array, apart: tuple[float, float], most: int
) -> NDArray[np.int64]:
    """Return the best poses, each farther from all better ones than `apart` [m, rad]."""
    chosen = np.empty(most, np.int64)
    order = np.argsort(-scores, kind="stable")
    return chosen[: choose(np.ascontiguousarray(poses), order, *apart, chosen)]


def _judged(
    poses: Array, found: Array, query: Query, plan: LineMap, room: float, favour: float = 0.0
) -> Location:
    """Give the verdict on the best of some poses, which a guess favours by so much [nats]."""
    (refit, *_), (pairs, *_), (information, *_) = refined(poses[:1], query, plan.index, FINE)
    chance, n = math.log(max(room, 1.0)), len(query.beams)
    every = [Evidence(odds - chance, a, b, c, n) for odds, a, b, c in found.tolist()]
    is_lost = every[0].log_odds < SURE or every[0].contradicted > MOST_CONTRADICTED
    if plan.is_mapped:
        shares = found[:, 1:].tolist()
        every = [Evidence(over_chance((a, b, c), n) + favour, a, b, c, n) for a, b, c in shares]
        is_lost = every[0].log_odds < SURE_ON_MAP
    first, *rest = every
    if is_lost:
        return Location(LOST, _pose(refit), np.linalg.inv(information + WEAK), first)
    best, information = adjusted(poses[0], pairs, query, plan.index)
    covariance = np.asarray(np.linalg.inv(information + WEAK), np.float64)
    behind = found[0, 0] - found[1:, 0]
    is_far = np.hypot(*(poses[1:, :2] - poses[0, :2]).T) > FAR
    is_other = behind < np.where(is_far & plan.is_mapped, LEAD, SURE)
    others = [(_pose(poses[1 + k]), rest[k]) for k in np.flatnonzero(is_other)]
    by_odds = np.exp(-behind[is_other])
    if len(distinct(np.stack((best, poses[0])), np.zeros(2), _SAME, 2)) == 2:
        # Walls that depend on each other disagree.
        others.insert(0, (_pose(poses[0]), first))
        by_odds = np.append(1.0, by_odds)
    covariance, others = _mixture(best, covariance, others, by_odds)
    values, vectors = np.linalg.eigh(covariance[:2, :2])
    x, y = vectors[:, 1].tolist()
    if values[1] > UNSURE**2:
        return Location(UNOBSERVED, _pose(best), covariance, first, (x, y), others)
    return Location(AMBIGUOUS if others else LOCATED, _pose(best), covariance, first, None, others)


def _mixture(
    best: Array, covariance: Array, others: list[tuple[Pose, Evidence]], by_odds: Array
) -> tuple[Array, list[tuple[Pose, Evidence]]]:
    """Take poses beside the best into its covariance; return that, and the other ones.

    They are what walls that stand in front of each other allow: one place, not as well known. It is
    a mixture of the poses by their likelihoods, `by_odds` times that of the best.
    """
    off = np.array([pose for pose, _ in others]).reshape(-1, 3) - best
    off[:, 2] = wrapped(off[:, 2])
    is_beside = (np.hypot(off[:, 0], off[:, 1]) < UNSURE) & (abs(off[:, 2]) < BESIDE)
    weights = np.where(is_beside, by_odds, 0.0)
    mixed = covariance + (off.T * weights) @ off / (1.0 + weights.sum())
    return mixed, [other for other, beside in zip(others, is_beside, strict=True) if not beside]


def poses_on(plan: LineMap) -> float:
    """Return the number of poses that a plan has room for."""
    return plan.area / BOX**2 * 2 * math.pi / TURN


def _pose(row: Array) -> Pose:
    x, y, theta = row.tolist()
    return x, y, math.remainder(theta, 2 * math.pi)
