"""`OdometryCheck`: whether odometry goes with the scans, by which it is believed or left out."""

import math
from collections.abc import Iterable, Iterator

from ..errors import warn
from ..scan import LaserScan, Pose
from ..scan.poses import Twist, relative, twist_between
from .consistency import LEAST, agreement

#: Scans are compared after so much way or turn by odometry, or time [m, rad, s].
_WAY, _TURN, _TIME = 0.5, math.radians(15.0), 1.0
#: Scans farther apart do not show a velocity, nor are they of one drive without odometry [s].
GAP = 5.0
#: Of odometry that is right, so large a share of the comparisons fails: wheels that slip, people.
#: Of odometry that is wrong, half of them do: in bare corridors it may go with the scans.
_RIGHT, _WRONG = 0.2, 0.5
_FAILED, _HELD = math.log(_WRONG / _RIGHT), math.log((1 - _WRONG) / (1 - _RIGHT))
#: Log of the odds at which it is wrong; the odds before anything is seen are lower by these: of a
#: hundred robots one is set up wrongly.
_MOST = math.log(1e5)
_FIRST = _MOST + math.log(0.01)


def with_twists(
    scans: Iterable[LaserScan], odometry: bool
) -> Iterator[tuple[LaserScan, Twist | None]]:
    """Yield each scan, and the velocity by odometry while it is swept; None if it is not known.

    That is the one to the next scan, as stamps are of the first beam; of the last scan, the one
    from the scan before.
    """
    before: LaserScan | None = None
    twist: Twist | None = None
    for scan in scans:
        if before is not None:
            twist = _twist(before, scan) if odometry else None
            yield before, twist
        before = scan
    if before is not None:
        yield before, twist


def _twist(scan: LaserScan, after: LaserScan) -> Twist | None:
    duration = after.stamp - scan.stamp
    if scan.pose is None or after.pose is None or not 0 < duration < GAP:
        return None
    return twist_between(scan.pose, after.pose, duration)


class OdometryCheck:
    """Leaves out odometry that contradicts the scans, and warns of it once.

    Odometry of a scanner that is mounted otherwise than is said, or upside down, of other times or
    of another robot does not help, nor does one that stands still while the robot is pushed: scans
    are looked for where they are not. Each half metre, or second, two scans are compared by the
    motion that odometry says between them. Whether they contradict it more often than those of
    wheels that slip is Page's test (1954), the cumulated sum of the log likelihood ratios. Odometry
    that goes with the scans for as long again is believed again.

    Examples
    --------
    >>> from lineament.simulation import SENSORS, drive, room
    >>> check = OdometryCheck()
    >>> for scan in drive(room(), [(-2, 0), (1, 0)], SENSORS["utm30lx"], speed=1, rate=10):
    ...     odometry = check(scan, scan.pose)
    >>> check.is_believed
    True
    """

    def __init__(self) -> None:
        self.is_believed, self._is_warned = True, False
        self._score = _FIRST
        self._since: tuple[LaserScan, Pose] | None = None

    def __call__(self, scan: LaserScan, odometry: Pose | None) -> Pose | None:
        """Return the odometry of the next scan; None where it is not believed."""
        if odometry is None:
            return None
        if self._since is None:
            self._since = scan, odometry
        before, since = self._since
        motion = relative(since, odometry)
        is_far = math.hypot(motion[0], motion[1]) >= _WAY or abs(motion[2]) >= _TURN
        if is_far or abs(scan.stamp - before.stamp) >= _TIME:
            self._since = scan, odometry
            self._weigh(agreement(before, scan, [motion])[0])
        return odometry if self.is_believed else None

    def _weigh(self, share: float) -> None:
        """Take in one more comparison, by the share of explained ends; NaN says nothing."""
        if math.isnan(share):
            return
        self._score += _FAILED if share < LEAST else _HELD
        self._score = min(max(self._score, 0.0), _MOST)
        if self._score in (0.0, _MOST):
            self.is_believed = self._score == 0.0
        if not (self.is_believed or self._is_warned):
            self._is_warned = True
            warn(
                "odometry contradicts the scans, and is left out where it does: does it stand "
                "still, is the scanner mounted otherwise (laser_pose) or upside down, are its "
                "times others? lineament calibrate compares both"
            )
