"""Where a scanner is on its robot, and what is wrong with the wheels, by the motions of both.

The idea is that of Censi, Franchi, Marchionni and Oriolo (2013): from scan to scan the robot moves
by its wheels, the scanner by its walls, and one mounting leads from all of the one to all of the
other. Motions are taken as twists over a unit of time, in which both are linear in all but θ. The
wheels are what is noisy: their motion is predicted from that of the scanner, not the other way
round, as noise of what explains makes each scale too small.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..scan import Array, Pose
from .association import chi_square
from .estimate import Motion
from .mounting import HINT, Fit, Model, fitted, heading_of
from .relocation import wrapped

#: What is estimated; the last three are as the others where there is a track.
_NAMES, _OF_WHEELS = ("x", "y", "theta", "way", "turn", "drift"), ("left", "right", "track")
#: What is not known better than this is not known at all: deviations, as the names.
_KNOWN = {"x": 0.05, "y": 0.05, "theta": 0.035, "way": 0.03, "turn": 0.03, "drift": 0.03}
_KNOWN |= {"left": 0.03, "right": 0.03, "track": 0.03}
#: What deviations are in; without, a share.
_UNITS = {"x": " m", "y": " m", "theta": " rad", "drift": " rad/m"}
#: What goes with something that is not known by such a correlation is not known either.
_COUPLED = 0.9
#: Odometry of less than this share of the scanner's motions stands still.
_STANDS = 0.05
#: Rounds in which shared walls are joined; median of χ² of three degrees.
_JOINING, _MEDIAN = 10, 2.366
#: Steps that are needed.
FEWEST = 8


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Calibration:
    """Mounting of a scanner, and corrections of the wheels.

    Attributes
    ----------
    names : tuple of str
        ``x``, ``y``, ``theta`` of the mounting, in the frame that odometry is of; and of wheels
        ``way`` and ``turn``, by which ways and turns of the odometry are to be multiplied, and
        ``drift``, the turn that odometry has too much in each metre. With a `track` these are
        ``left`` and ``right``, by which the radii of the wheels are, and ``track``.
    values, deviations : dict of float
        Of each name that is known [m, rad, rad/m, or a share].
    unknown : dict of str
        Why each other is not.
    covariance : ndarray, shape (k, k)
        Of `values`, in their order.
    residuals, deviates : ndarray, shape (n, 3)
        What is left of the odometry of each motion: forward, to the left, turn [m, m, rad]; the
        deviations of this by all noise.
    is_slip : ndarray of bool, shape (n,)
        Motions that were left out: slips, or scans that were matched wrongly.
    noise : tuple of float
        Estimated: by how much the deviations of the scans' motions are larger than they say;
        deviations of odometry forward, to the left, and of its turn after a metre [m, m, rad].
    """

    names: tuple[str, ...]
    values: dict[str, float]
    deviations: dict[str, float]
    unknown: dict[str, str]
    covariance: Array
    residuals: Array
    deviates: Array
    is_slip: NDArray[np.bool_]
    noise: tuple[float, float, float, float]

    def __repr__(self) -> str:
        known = [f"{name}={v:.4f} ± {self.deviations[name]:.4f}" for name, v in self.values.items()]
        return f"Calibration({', '.join((*known, *(f'{name} unknown' for name in self.unknown)))})"

    @property
    def mounting(self) -> Pose | None:
        """Pose of the scanner on the robot (x, y, theta) [m, m, rad]; None if it is not known."""
        x, y, theta = (self.values.get(name, math.nan) for name in _NAMES[:3])
        return None if math.isnan(x + y + theta) else (x, y, theta)


def calibrate(
    odometry: Sequence[ArrayLike],
    motions: Sequence[Motion],
    *,
    track: float = 0.0,
    wheels: bool = True,
) -> Calibration:
    """Find the mounting of a scanner, and what is wrong with the wheels, by their motions.

    Weighted least squares over all motions at once. The noise of the odometry, which grows with
    the way, is estimated along with it, and so is a factor on the covariances of the scans;
    slips are left out. What the drive does not show is not known: without turns, x, y and what a
    turn counts; without ways, θ.

    Parameters
    ----------
    odometry : sequence of array_like, shapes (k, 3)
        Of each step the poses of the robot by odometry [m, m, rad], in any frame: at its first scan
        and at its last, and at those between.
    motions : sequence of Motion
        Of the scanner, from the first scan of each step to the last. Best are steps of 0.3 m, or
        20°: in shorter ones there is more noise, in longer ones the way is not known.
    track : float
        Distance between the wheels by which the odometry was computed [m]; 0 if it is not known.
    wheels : bool
        Whether odometry is by wheels, whose radii and track may be wrong; otherwise the mounting
        alone is estimated.

    Raises
    ------
    ValueError
        If there are fewer than 8 motions, their numbers differ, a number is not finite, or the two
        do not go together, as where the odometry is another robot's or in other units.

    Examples
    --------
    A scanner 0.2 m ahead of the axle, whose robot drives three squares:

    >>> from lineament.motion import compose, inverse
    >>> driven = [(0.5, 0.0, 0.0), (0.5, 0.0, 0.0), (0.0, 0.0, math.pi / 4)] * 12
    >>> mounting, spread = (0.2, 0.0, 0.1), np.diag((1e-3, 1e-3, 1e-3)) ** 2
    >>> seen = [compose(inverse(mounting), compose(step, mounting)) for step in driven]
    >>> motions = [Motion(*step, spread) for step in seen]
    >>> found = calibrate([[(0, 0, 0), step] for step in driven], motions)
    >>> [round(value, 3) for value in found.mounting], round(found.values["turn"], 3)
    ([0.2, 0.0, 0.1], 1.0)
    """
    if len(odometry) != len(motions):
        raise ValueError(f"odometry has {len(odometry)} steps, expected {len(motions)}")
    if not 0 <= track < math.inf:
        raise ValueError(f"track is {track}, expected a finite length ≥ 0")
    if len(motions) < FEWEST:
        raise ValueError(f"there are {len(motions)} motions, expected at least {FEWEST}")
    model = Model.of(odometry, motions, track)
    if np.linalg.norm(model.wheels) < _STANDS * np.linalg.norm(model.sensor):
        raise ValueError("odometry stands still while the scanner moves")
    model.values[2] = heading_of(model)
    fit = fitted(model, 6 if wheels else 3)
    _check(model, fit)
    return _named(model, fit)


def joined(found: Calibration, sights: Sequence[Motion]) -> tuple[Calibration, int]:
    """Improve a mounting by sights of walls that both scanners see, each a mounting by itself.

    Returns what both say, and how many sights agree with it. Their covariances grow by what they
    differ more than they say.
    """
    pose, before = np.array(found.mounting), np.linalg.inv(found.covariance)
    values, information, kept = pose, before, np.zeros(len(sights), bool)
    if not sights:
        return found, 0
    measured = np.array([sight.pose for sight in sights])
    spread = np.array([sight.covariance for sight in sights])
    degrees, weights = np.array([3 - len(s.unobserved) for s in sights]), np.linalg.inv(spread)
    for _ in range(_JOINING):
        off = measured - values
        off[:, 2] = wrapped(off[:, 2])
        square = np.einsum("ni,nij,nj->n", off, weights, off)
        kept = square < chi_square(0.999, 3) * max(1.0, float(np.median(square)) / _MEDIAN)
        factor = max(1.0, float(square[kept].sum() / max(degrees[kept].sum() - 3, 1)))
        information = before + weights[kept].sum(axis=0) / factor
        pull = np.einsum("nij,nj->i", weights[kept], off[kept]) / factor
        values = values + np.linalg.solve(information, pull + before @ (pose - values))
    covariance: Array = np.asarray(np.linalg.inv(information))
    deviations = np.sqrt(np.diag(covariance)).tolist()
    new = replace(
        found,
        values=dict(zip(found.names, values.tolist(), strict=True)),
        deviations=dict(zip(found.names, deviations, strict=True)),
        covariance=covariance,
    )
    return new, int(kept.sum())


def _check(model: Model, fit: Fit) -> None:
    """Raise a ValueError if odometry and scans do not go together."""
    ratios, shown, kept = model.values[3:5], model.shows, ~fit.is_slip
    deviations = np.append(np.sqrt(np.diag(fit.covariance)), (np.inf, np.inf))[3:5]
    is_known = shown[3:5] & (deviations < _KNOWN["way"])
    if (is_known & (abs(np.log(ratios)) > math.log(2))).any():
        raise ValueError(
            f"odometry has {ratios[0]:.3g} times the ways and {ratios[1]:.3g} times the turns of "
            f"the scans: {HINT}"
        )
    left, seen = (fit.residuals[kept] ** 2).sum(axis=0), (model.wheels[kept] ** 2).sum(axis=0)
    if (shown[[3, 4]] & (left > 0.5 * seen)[[0, 2]]).any():
        raise ValueError(f"odometry does not go with the motions of the scans: {HINT}")


def _named(model: Model, fit: Fit) -> Calibration:
    """Name what was found, and leave out what was not."""
    way, turn, drift = model.values[3:]
    names, values, free = _NAMES[: len(fit.covariance)], model.values.copy(), len(fit.covariance)
    values[2] = math.remainder(values[2], 2 * math.pi)
    slopes = np.eye(6)
    if model.track and free > 3:
        half = model.track / 2
        left, right = way - half * drift, way + half * drift
        values[3:] = 1 / left, 1 / right, turn / way * model.track
        slopes[3] = np.array((0, 0, 0, 1, 0, -half)) / -(left**2)
        slopes[4] = np.array((0, 0, 0, 1, 0, half)) / -(right**2)
        slopes[5] = np.array((0, 0, 0, -turn / way, 1, 0)) * model.track / way
        names = (*_NAMES[:3], *_OF_WHEELS)
    elif free > 3:
        values[3:5] = 1 / values[3:5]
        slopes[3, 3], slopes[4, 4] = -(values[3] ** 2), -(values[4] ** 2)
    slopes = slopes[:free, :free]
    covariance = slopes @ fit.covariance @ slopes.T
    deviations = dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    correlations = covariance / np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    unknown = _unknown(model, deviations, abs(correlations) > _COUPLED)
    known = [k for k, name in enumerate(names) if name not in unknown]
    factor, forward, left_walk, turned = np.sqrt(fit.noise).tolist()
    return Calibration(
        names=names,
        values={names[k]: float(values[k]) for k in known},
        deviations={names[k]: deviations[names[k]] for k in known},
        unknown=unknown,
        covariance=covariance[np.ix_(known, known)],
        residuals=fit.residuals,
        deviates=fit.deviates,
        is_slip=fit.is_slip,
        noise=(factor, forward, left_walk, turned),
    )


def _unknown(
    model: Model, deviations: dict[str, float], coupled: NDArray[np.bool_]
) -> dict[str, str]:
    """Say of each name that is not known why."""
    turns, goes = model.shows[[0, 3]]
    why: dict[str, str] = {}
    if not goes:
        still = ("x", "y", "theta", "way", "drift", "left", "right", "track")
        why = dict.fromkeys(still, "the drive hardly goes anywhere")
    if not turns:
        why |= dict.fromkeys(("x", "y", "turn", "track"), "the drive hardly turns")
    for name, deviation in deviations.items():
        if deviation > _KNOWN[name] and name not in why:
            why[name] = f"the drive shows it to ± {deviation:.2g}{_UNITS.get(name, '')} only"
    if "theta" in why:  # They turn with it.
        why = dict.fromkeys(("x", "y"), "the drive shows it only together with theta") | why
    names = list(deviations)
    for name, other in permutations(names, 2):
        if other in why and name not in why and coupled[names.index(name), names.index(other)]:
            why[name] = f"the drive shows it only together with {other}"
    return {name: why[name] for name in names if name in why}
