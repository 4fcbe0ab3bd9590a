"""Where a corner is and how it is turned: what a robot that docks steers by."""

import math
import operator
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .._copies import InTurn, in_turn
from ..features import Features
from ..scan import Array, Pose
from ..scan.fields import finite
from ..scan.poses import compose, inverse
from .tracker import Tracks

#: Walls that meet at a smaller sine are taken as one: they meet anywhere.
_LEAST_SINE = 0.05
#: A corner farther than this from where it is expected is another one [m].
_REACH = 1.0


class CornerPose(NamedTuple):
    """The pose of a corner in the frame of the scan.

    Attributes
    ----------
    pose : (x, y, theta)
        Where the lines of its two walls meet [m, m], and the direction of the x axis [rad]: along
        the bisector of the walls, to where they open. The corner of a room looks into the room; the
        corner of a box, seen from outside, looks into the box. y is to the left, z is up.
    covariance : ndarray, shape (3, 3)
        Of the pose [m, m, rad], from those of both walls: of noise alone, without their misfit.
    """

    pose: Pose
    covariance: Array


def corner_pose(features: Features, index: int) -> CornerPose | None:
    """Return the pose of a corner, or None if it has no two walls that cross.

    The offset o and angle a of a wall, at the distance t from its centroid, move its line by
    e = o + t a along its normal. The corner moves by N⁻¹ e, with the normals of both walls as the
    rows of N, and the bisector turns by the mean of both angles.

    Examples
    --------
    A corner of a room, 2 m ahead and 1 m to the left:

    >>> import lineament as ln
    >>> bearings = np.linspace(-0.5, 1.2, 400)
    >>> ranges = np.minimum(2 / np.cos(bearings), 1 / np.maximum(np.sin(bearings), 1e-9))
    >>> features = ln.extract(ln.LaserScan(ranges, angles=bearings), noise=ln.RangeNoise(0.01))
    >>> x, y, theta = corner_pose(features, 0).pose
    >>> round(x, 3), round(y, 3), round(math.degrees(theta))
    (2.0, 1.0, -135)
    """
    sides = features.corners["segments"][index]
    if sides.min() < 0:
        return None
    walls = features.segments[sides]
    along = np.column_stack((np.cos(walls["angle"]), np.sin(walls["angle"])))
    normals = np.column_stack((-along[:, 1], along[:, 0]))
    if abs(np.linalg.det(normals)) < _LEAST_SINE:
        return None
    inverse_normals = np.linalg.inv(normals)
    place = inverse_normals @ (normals * walls["centroid"]).sum(axis=1)
    levers = (along * (place - walls["centroid"])).sum(axis=1)
    x, y = (along * -np.sign(levers)[:, None]).sum(axis=0)
    # By (offset, angle) of the first wall, then of the second.
    jacobian = np.zeros((3, 4))
    jacobian[:2, 0::2] = inverse_normals
    jacobian[:2, 1::2] = inverse_normals * levers
    jacobian[2, 1::2] = 0.5
    of_walls = np.zeros((4, 4))
    of_walls[:2, :2], of_walls[2:, 2:] = walls["covariance"]
    pose = float(place[0]), float(place[1]), math.atan2(y, x)
    return CornerPose(pose, jacobian @ of_walls @ jacobian.T)


class Dock(InTurn):
    """Follows one corner from scan to scan, and returns its pose.

    Parameters
    ----------
    point : (x, y), optional
        The corner that is nearest to this point, in the frame of the first scan [m], within 1 m.
        It is followed by its track; when that ends, the corner nearest to where it was is chosen.
    track : int, optional
        The corner of this track alone.

    Raises
    ------
    ValueError
        If both or none are given, or a number makes no sense.

    Examples
    --------
    >>> import lineament as ln
    >>> from lineament.motion import Odometer
    >>> from lineament.simulation import SENSORS, drive, room
    >>> tracker, odometer, extract = ln.Tracker(), Odometer(), ln.Extractor()
    >>> dock = Dock((5.0, 2.0))
    >>> for scan in drive(room(), [(-2, 0), (-1, 0)], SENSORS["utm30lx"], speed=1, rate=10):
    ...     features = extract(scan)
    ...     tracks = tracker(features)
    ...     found = dock(features, tracks, odometer(tracks, scan.stamp).pose)
    >>> [round(value, 1) for value in found.pose]
    [4.0, 2.0, -2.4]
    """

    def __init__(self, point: Sequence[float] | None = None, *, track: int | None = None) -> None:
        if (point is None) == (track is None):
            raise ValueError("expected a point or a track, one of them")
        if point is not None:
            try:
                x, y = point
            except (TypeError, ValueError):
                raise ValueError(f"point is {point!r}, expected (x, y)") from None
            point = finite("x of the point", x), finite("y of the point", y)
        if track is not None and operator.index(track) < 0:
            raise ValueError(f"track is {track}, expected ≥ 0")
        #: The track that is followed; None before a corner is chosen.
        self.track = track
        self._point = point

    @in_turn
    def __call__(
        self, features: Features, tracks: Tracks, pose: Pose, covariance: Array | None = None
    ) -> CornerPose | None:
        """Find the corner in a scan; None where it is not seen, or has not two walls.

        Parameters
        ----------
        features : Features
        tracks : Tracks
            Of the features.
        pose : (x, y, theta)
            Of the scan, in the frame of the point: by `Odometer`, or in the world.
        covariance : ndarray, shape (3, 3), optional
            Of the pose. A corner is looked for where it shows the point to 0.5 m.
        """
        if self._point is not None:
            if self.track in tracks.ended:
                self.track = None
            if self.track is None:
                self.track = self._nearest(features, tracks, pose, covariance)
        if self.track is None:
            return None
        places = np.flatnonzero(tracks.corners == self.track)
        found = corner_pose(features, int(places[0])) if len(places) else None
        if found is not None and self._point is not None:
            x, y, _ = compose(pose, found.pose)
            self._point = x, y
        return found

    def _nearest(
        self, features: Features, tracks: Tracks, pose: Pose, covariance: Array | None
    ) -> int | None:
        """Return the track of the corner with two walls that is nearest to the point."""
        assert self._point is not None
        x, y, _ = compose(inverse(pose), (self._point[0], self._point[1], 0.0))
        if covariance is not None:
            along, across, turn = np.sqrt(np.diag(covariance)).tolist()
            if 2 * math.hypot(along, across, turn * math.hypot(x, y)) > _REACH:
                return None
        corners = features.corners
        away = np.hypot(*(corners["position"] - (x, y)).T)
        away[(corners["segments"] < 0).any(axis=1)] = math.inf
        if away.min(initial=math.inf) > _REACH:
            return None
        return int(tracks.corners[away.argmin()])
