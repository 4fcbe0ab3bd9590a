"""`Judge`: whether a pose on a plan that somebody else believes in is right, scan by scan."""

import math
from dataclasses import dataclass

import numpy as np

from .._copies import InTurn, in_turn
from ..features import Features
from ..scan import Pose
from ..scan.poses import relative
from .evidence import Evidence
from .following import Whereabouts
from .line_map import LineMap
from .local_map import query_of_scan
from .locate import Location, locate

#: What a pose may be.
RIGHT, WRONG, UNSURE = JUDGEMENTS = ("right", "wrong", "not sure")
#: A pose that is off by less is right [m, rad].
REACH = 0.5, math.radians(15)
#: How well somebody else knows a pose that is right: it is looked for so near to it [m, m, rad].
_NEAR = np.diag((0.2, 0.2, math.radians(5))) ** 2
#: A scan that is likelier by less at our pose is looked for at the other one as well [nats].
_PLAIN = 8.0
#: A scan denies a pose below such log-odds of the best pose near it [nats], where that explains no
#: more of the beams. Below 0 chance does as well: so it is too among things that the plan does not
#: have, or has elsewhere.
DENIED, LEAST = -8.0, 0.4
#: So many scans in a row that deny a pose are enough; one, where we are somewhere else.
ENOUGH = 2


@dataclass(frozen=True, slots=True, eq=False)
class Judgement:
    """Whether a pose that somebody else believes in is right.

    Attributes
    ----------
    verdict : str
        One of `JUDGEMENTS`. "right": we are there too, and the scan is; "wrong": chance explains
        the last scans much better than this pose, or any near it; "not sure": neither.
    pose : (x, y, theta)
        Of the sensor, as it is believed [m, m, rad].
    off : (x, y, theta) or None
        Our pose in the frame of this one [m, m, rad]; None where we are not located.
    evidence : Evidence
        What the beams of this scan say of this pose, or of the best one near it.
    """

    verdict: str
    pose: Pose
    off: Pose | None
    evidence: Evidence

    def __bool__(self) -> bool:
        return self.verdict == RIGHT


class Judge(InTurn):
    """Judges the poses of another localiser by the same scans, beside a `Follower`.

    The follower knows nothing of the other's poses. Where both are at the same place, and the scan
    is plainly of that place, the pose is right. Else the scan alone is looked for near the pose: a
    robot that was carried away is noticed with the next scan, long before it is found again.

    Parameters
    ----------
    plan : LineMap

    Examples
    --------
    >>> import lineament as ln
    >>> from lineament.mapping.following import Follower
    >>> from lineament.simulation import SENSORS, drive, room
    >>> plan = LineMap.from_lines(room().segments)
    >>> judge, follower, extract = Judge(plan), Follower(plan), ln.Extractor()
    >>> for scan in drive(room(), [(-2, 0), (-1, 0)], SENSORS["utm30lx"], speed=1, rate=10):
    ...     features = extract(scan)
    ...     where = follower(features)
    ...     judgement = judge(features, scan.pose, where)
    ...     carried = judge(features, (3.0, 1.0, 2.0), where)
    >>> judgement.verdict, carried.verdict
    ('right', 'wrong')
    """

    def __init__(self, plan: LineMap) -> None:
        self.plan = plan
        self._denied = 0

    @in_turn
    def __call__(self, features: Features, pose: Pose, where: Whereabouts) -> Judgement:
        """Judge a pose of the sensor at a scan.

        Parameters
        ----------
        features : Features
            Of the scan, which they have.
        pose : (x, y, theta)
            Of the sensor on the plan, as the other one believes [m, m, rad].
        where : Whereabouts
            What a `Follower` on the same plan says of the same scan.
        """
        off = relative(pose, where.pose) if where else None
        is_near = off is not None and math.hypot(*off[:2]) < REACH[0] and abs(off[2]) < REACH[1]
        if is_near and where.evidence.log_odds > _PLAIN:
            self._denied = 0
            return Judgement(RIGHT, pose, off, where.evidence)
        found = self._near(features, pose)
        is_denied = found.evidence.log_odds < DENIED and found.evidence.explained < LEAST
        self._denied = self._denied + 1 if is_denied else 0
        verdict = UNSURE
        if self._denied >= (1 if off is not None and not is_near else ENOUGH):
            verdict = WRONG
        elif is_near and found.evidence.log_odds > 0:
            verdict = RIGHT
        return Judgement(verdict, pose, off, found.evidence)

    def _near(self, features: Features, pose: Pose) -> Location:
        return locate(query_of_scan(features), self.plan, pose, _NEAR)
