"""The motion of the sensor between two frames, from the features that both have."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..poses import Twist, twist_between
from ..scan import Array, Pose
from .association import Matches, chi_square, turned
from .residuals import residuals

__all__ = ["Motion", "estimate_motion"]

#: Without a prior, the motion is known this badly [m, m, rad].
_UNKNOWN = np.diag((10.0, 10.0, math.pi)) ** 2
#: A direction that the features tell with a larger deviation than this counts as unobserved [m].
_KNOWN = 0.1
#: What the errors of the walls' own directions feign is this many deviations at most.
_FEIGNED = 3.0
#: Pairs beyond this quantile of χ² count less, the less the farther they are.
_RIGHT = 0.99
_ROUNDS, _SMALL = 20, 1e-7


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Pose of the later sensor in the frame of the earlier one.

    Attributes
    ----------
    x, y : float
        Forward and to the left [m].
    theta : float
        Turn, counter-clockwise [rad].
    covariance : ndarray, shape (3, 3)
        Of (x, y, theta) [m, m, rad].
    unobserved : ndarray, shape (m, 3)
        Directions in (x, y, theta) of which the features told nothing, unit vectors in metres (an
        angle as the way at the features' distance): there, the motion is the prior's. Along a bare
        corridor there is one, where nothing was matched there are three.
    """

    x: float
    y: float
    theta: float
    covariance: Array
    unobserved: Array = field(default_factory=lambda: np.empty((0, 3)))

    @property
    def pose(self) -> Pose:
        """(x, y, theta)."""
        return self.x, self.y, self.theta

    @property
    def observable(self) -> bool:
        """Whether the features told the motion in all directions."""
        return not len(self.unobserved)

    def twist(self, duration: float) -> Twist:
        """Return the constant velocity that makes this motion in a time [s]."""
        return twist_between((0.0, 0.0, 0.0), self.pose, duration)


def estimate_motion(
    matches: Matches,
    prior: Pose = (0.0, 0.0, 0.0),
    covariance: ArrayLike | None = None,
    *,
    roughness: float = 0.0,
) -> Motion:
    """Estimate the motion between two frames by weighted least squares, robustly.

    Gauss-Newton on the offset and angle of each segment from its earlier line, and on the distance
    of each corner and arc from where it was, each by the covariance of both. A corner is the
    intersection of its two segments: where both are matched it tells nothing new and is left out;
    where one is, its place along that one counts alone. Pairs beyond
    the 99 % quantile of χ² count less, by the square of how far they are off.

    Directions of which the features tell nothing are found by the eigenvalues of their information
    (angles as the way at the features' distance): one counts as unobserved if its deviation is
    more than 0.1 m, or if the information is no more than what errors of the walls' own directions
    feign: parallel walls are never quite parallel as measured. The prior fills these in.

    Parameters
    ----------
    matches : Matches
        Pairs of features, each in the frame of its own sensor.
    prior : (x, y, theta)
        The motion as known before [m, m, rad]: from odometry or from the last frames.
    covariance : array_like, shape (3, 3), optional
        Covariance of the prior; where it is not given, the prior is where the search begins and
        is known to 10 m and half a turn.
    roughness : float
        How far surfaces are from straight and round [m].

    Returns
    -------
    Motion

    Raises
    ------
    ValueError
        If the covariance of the prior is not positive definite.

    Examples
    --------
    Two walls of a room, seen again after 0.1 m and a turn of 0.05 rad:

    >>> import lineament as ln
    >>> from lineament.simulation import SENSORS, room, truth
    >>> from lineament.tracking import associate
    >>> before = truth(room(), (0.0, 0.0, 0.0), SENSORS["utm30lx"])
    >>> now = truth(room(), (0.1, 0.0, 0.05), SENSORS["utm30lx"])
    >>> motion = estimate_motion(associate(before, now, covariance=np.diag([0.01, 0.01, 0.01])))
    >>> [round(value, 6) for value in motion.pose], motion.observable
    ([0.1, 0.0, 0.05], True)
    """
    spread = _UNKNOWN if covariance is None else np.asarray(covariance, dtype=np.float64)
    if spread.shape != (3, 3) or not _is_positive(spread):
        raise ValueError(
            f"covariance of the prior is {spread.tolist()}, expected (3, 3), positive definite"
        )
    prior_information = np.linalg.inv(spread)
    start = state = np.array(prior, dtype=np.float64)
    scale = np.array((1.0, 1.0, _distance(matches)))
    for _ in range(_ROUNDS):
        errors = residuals(matches, state, roughness)
        information, gradient, feigned = errors.normal_equations(_weights(errors.squares))
        unobserved = _unobserved(information, feigned, scale)
        # Nothing is taken from the features in directions that they do not tell.
        kept = np.eye(3) - (unobserved.T @ unobserved) * scale / scale[:, np.newaxis]
        total = kept.T @ information @ kept + prior_information
        off = state - start
        off[2] = turned(off[2])
        step = -np.linalg.solve(total, kept.T @ gradient + prior_information @ off)
        state = state + step
        if np.abs(step).max() < _SMALL:
            break
    x, y, theta = state.tolist()
    theta = math.remainder(theta, 2 * math.pi)
    return Motion(x, y, theta, np.linalg.inv(total), unobserved)


def _weights(squares: Array) -> Array:
    """Weigh pairs by their squares: 1 within the quantile, then falling; shape (m,)."""
    limit, counted = chi_square(_RIGHT, 2), squares[squares > 0]
    if len(counted):
        # Far from the solution all are far off: what counts is which are more so than others.
        limit *= max(1.0, float(np.median(counted)) / chi_square(0.5, 2))
    return np.asarray(limit / np.maximum(squares, limit))


def _unobserved(information: Array, feigned: Array, scale: Array) -> Array:
    """Directions (m, 3) of which the information tells nothing, in scaled units."""
    in_metres = 1.0 / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(information * in_metres)
    seeming = np.einsum("ik,ij,jk->k", vectors, feigned * in_metres, vectors)
    return np.asarray(vectors.T[values <= _KNOWN**-2 + _FEIGNED**2 * seeming])


def _is_positive(matrix: Array) -> bool:
    return bool(np.isfinite(matrix).all() and np.linalg.eigvalsh(matrix)[0] > 0)


def _distance(matches: Matches) -> float:
    """Root of the mean squared distance of what was matched, 1 m at least [m]."""
    places = [
        matches.tables(kind)[1][name]
        for kind, name in (("segments", "centroid"), ("corners", "position"), ("arcs", "center"))
    ]
    points = np.concatenate(places)
    return max(1.0, math.sqrt(np.square(points).sum() / max(len(points), 1)))
