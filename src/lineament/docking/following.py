"""`ShapeDock`: a shape followed from scan to scan."""

import math
from collections.abc import Sequence

from .._copies import InTurn, in_turn
from ..features import Features
from ..motion.tracker import Tracks
from ..scan import Array, Pose
from ..scan.fields import checked_pose
from ..scan.poses import compose, inverse
from .search import find_shape
from .shape import Shape, ShapePose

#: How far off it is looked for where it was seen last [m, m, rad].
_REACH = 0.1, 0.1, 0.15
#: How far it is looked for around the point where it is said to be [m].
_FIRST = 0.5
#: After so many scans in which it is not seen, it is looked for as at first.
_PATIENCE = 10


class ShapeDock(InTurn):
    """Follows a shape, and returns its pose in each scan that shows it; twin of `Dock`.

    Parameters
    ----------
    shape : Shape
    point : (x, y)
        Where the origin of its frame is, to 0.5 m, in the frame of the first scan [m]. It may be
        turned anyhow.

    Examples
    --------
    >>> import lineament as ln
    >>> from lineament.simulation import SENSORS, World, drive
    >>> shape = Shape([[(0, -0.4), (0.3, -0.4), (0.3, 0.4), (0, 0.4)]])  # a recess
    >>> world = World([*shape.placed((3.0, 0.0, 0.0)).reshape(-1, 4), (-2, -3, 6, -3)])
    >>> dock, extract = ShapeDock(shape, (3.8, 0.1)), ln.Extractor()
    >>> for scan in drive(world, [(-1, 0), (0, 0)], SENSORS["lms361"], speed=1, rate=10):
    ...     x, y, theta = scan.pose
    ...     found = dock(extract(scan), None, (x + 1.0, y, theta))
    >>> [round(value, 1) + 0.0 for value in found.pose], found.seen > 0.9
    ([3.0, 0.0, 0.0], True)
    """

    def __init__(self, shape: Shape, point: Sequence[float]) -> None:
        self.shape = shape
        x, y = point
        self._first: Pose = checked_pose((x, y, 0.0), "point")
        self._last: Pose | None = None
        self._missed = 0

    @in_turn
    def __call__(
        self,
        features: Features,
        tracks: Tracks | None,  # noqa: ARG002  (what `Dock` needs)
        pose: Pose,
        covariance: Array | None = None,  # noqa: ARG002
    ) -> ShapePose | None:
        """Find the shape in a scan; None where it is not seen for sure.

        The pose is that of the scan, in the frame of the point: by `Odometer`, or in the world.
        """
        here, reach = inverse(pose), (_FIRST, _FIRST, math.pi)
        guess = compose(here, self._first)
        if self._last is not None:
            guess, reach = compose(here, self._last), _REACH
        found = find_shape(features, self.shape, guess, reach)
        self._missed = 0 if found else self._missed + 1
        if found is not None:
            self._last = compose(pose, found.pose)
            self._first = (*self._last[:2], 0.0)
        elif self._missed >= _PATIENCE:
            self._last = None
        return found
