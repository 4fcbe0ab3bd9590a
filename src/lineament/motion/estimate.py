"""The motion of the sensor between two frames, from the features that both have."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..kernels.tracking.motion import NOT_POSITIVE, NOT_THERE
from ..kernels.tracking.motion import estimate_motion as kernel
from ..kernels.tracking.residuals import COLUMNS
from ..scan import Array, Pose
from ..scan.fields import at_least_0, checked_pose
from ..scan.poses import Twist, twist_between
from .association import Frame, Matches, Pairs, chi_square, matrix_of, words_of

#: Without a prior, the motion is known this badly [m, m, rad].
_UNKNOWN = np.diag((10.0, 10.0, math.pi)) ** 2
#: Pairs beyond this quantile of χ² count less, the less the farther they are.
_RIGHT = 0.99


@dataclass(frozen=True, slots=True, eq=False, repr=False)
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
        Directions in (x, y, theta) of which the features say nothing, unit vectors in metres (an
        angle as the way at the features' distance): there, the motion is the prior's. Along a bare
        corridor there is one, where nothing was matched there are three.
    """

    x: float
    y: float
    theta: float
    covariance: Array
    unobserved: Array = field(default_factory=lambda: np.empty((0, 3)))

    def __repr__(self) -> str:
        x, y, theta = np.sqrt(np.diag(self.covariance))
        return (
            f"Motion({self.x:.4f} ± {x:.4f} m, {self.y:.4f} ± {y:.4f} m, "
            f"{self.theta:.5f} ± {theta:.5f} rad)"
        )

    @property
    def pose(self) -> Pose:
        """(x, y, theta)."""
        return self.x, self.y, self.theta

    @property
    def observable(self) -> bool:
        """Whether the features determine the motion in all directions."""
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
    of each corner and arc from where it was, each by the covariance of both. A segment that is too
    short for its direction to be known to 0.1 rad, such as the jamb of a door, is left to its
    corners. A corner is the intersection of its two segments: where both count it is nothing new
    and is left out; where one does, its place along that one counts alone. Pairs beyond the 99 %
    quantile of χ² count less, by the square of how far they are off.

    The covariances of the segments, of noise alone, count whole. The misfit of a wall is the same
    in both frames: it counts by the part of the wall that one frame saw alone.

    Directions of which the features say nothing are found by the eigenvalues of their information
    (angles as the way at the features' distance): one counts as unobserved if its deviation is
    more than 0.1 m, or if the information is no more than what errors of the walls' own directions
    feign: parallel walls are never quite parallel as measured. The prior fills these in.

    Parameters
    ----------
    matches : Matches
        Of two frames.
    prior : (x, y, theta)
        The motion as known before [m, m, rad]: from odometry or from the last frames.
    covariance : array_like, shape (3, 3), optional
        Of the prior; where it is not given, to 10 m and half a turn.
    roughness : float
        How far surfaces are from straight and round [m].

    Raises
    ------
    ValueError
        If the covariance of the prior is not positive definite, a number is not finite, the
        roughness is negative, or a pair is not of features that are there.

    Examples
    --------
    Two walls of a room, seen again after 0.1 m and a turn of 0.05 rad:

    >>> import lineament as ln
    >>> from lineament.simulation import SENSORS, room, truth
    >>> from lineament.motion import associate
    >>> before = truth(room(), (0.0, 0.0, 0.0), SENSORS["utm30lx"])
    >>> now = truth(room(), (0.1, 0.0, 0.05), SENSORS["utm30lx"])
    >>> motion = estimate_motion(associate(before, now, covariance=np.diag([0.01, 0.01, 0.01])))
    >>> [round(value, 6) for value in motion.pose], motion.observable
    ([0.1, 0.0, 0.05], True)
    """
    spread = _UNKNOWN if covariance is None else matrix_of(covariance)
    guess, rough = checked_pose(prior, "prior"), at_least_0("roughness", roughness)
    frames = Frame.of(words_of(matches.before)), Frame.of(words_of(matches.now))
    pairs = matches.segments, matches.corners, matches.arcs
    return motion_by(*frames, pairs, guess, spread, rough)


def motion_by(
    before: Frame,
    now: Frame,
    pairs: tuple[Pairs, Pairs, Pairs],
    prior: Pose,
    spread: Array,
    roughness: float,
) -> Motion:
    """Estimate a motion as `estimate_motion` does, by pairs of segments, corners and arcs."""
    segments, corners, arcs = (np.array(of, np.int64, order="C") for of in pairs)
    pairs = segments, corners, arcs
    count, later = sum(map(len, pairs)), np.zeros(len(now.words[0]), np.int64)
    matrices, vectors = np.empty((5, 3, 3)), np.empty((3, 3))
    scratch = matrices, vectors, np.empty((count, COLUMNS)), np.empty(count), later
    found = np.empty((3, 3, 3))
    quantiles = chi_square(_RIGHT, 2), chi_square(0.5, 2)
    given = before.words, now.words, now.sides, pairs, prior, spread, roughness, quantiles
    lost = kernel(*given, scratch, found)
    if lost == NOT_POSITIVE:
        raise ValueError(
            f"covariance of the prior is {spread.tolist()}, expected (3, 3), positive definite"
        )
    if lost == NOT_THERE:
        raise ValueError("the pairs of the matches name features that are not there")
    x, y, theta = found[0, 0].tolist()
    return Motion(x, y, math.remainder(theta, 2 * math.pi), found[1], found[2, :lost])
