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
from .local_map import Query, query_of_scan
from .locate import locate

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
#: So many scans in a row that deny a pose are enough, over so long [s]: those of a fast scanner see
#: the same. One is enough where we are somewhere else.
ENOUGH, LASTING = 2, 0.15
#: After so much way or turn a scan is compared with a later one [m, rad].
_STEP, _TURN = 0.3, 0.26


@dataclass(frozen=True, slots=True, eq=False)
class Judgement:
    """Whether a pose that somebody else believes in is right.

    Attributes
    ----------
    verdict : str
        One of `JUDGEMENTS`. "right": we are there too, and the scan is; "wrong": chance explains
        the last scans much better than this pose, or any near it, and they show nothing of what was
        seen before, or we are elsewhere; "not sure": neither.
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
    is plainly of that place, the pose is right. Else the scan alone is looked for near the pose, on
    the plan and in what was seen since that was plain: a robot that was carried away sees
    neither, and is noticed with the next scans, long before it is found again. One that is where it
    is believed to be, among things that have moved since the plan was made, sees them again.

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
        # A pose is denied where chance does as well, not where the best pose of a map would.
        self.plan = plan.as_drawn if plan.is_mapped else plan
        self._denied, self._since = 0, math.nan
        self._seen: tuple[Features, Pose] | None = None

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
        is_near = off is not None and not _is_beyond(off, *REACH)
        if is_near and where.evidence.log_odds > _PLAIN:
            self._denied, self._seen = 0, (features, where.pose)
            return Judgement(RIGHT, pose, off, where.evidence)
        query = query_of_scan(features)
        found = locate(query, self.plan, pose, _NEAR)
        is_denied = found.evidence.log_odds < DENIED and found.evidence.explained < LEAST
        if found.evidence.log_odds > _PLAIN and not _is_beyond(relative(pose, found.pose), *REACH):
            self._seen = features, found.pose  # wherever we are ourselves
        goes_on = self._goes_on(features, query, pose, is_denied)
        self._denied = self._denied + 1 if is_denied and not goes_on else 0
        if self._denied == 1:
            self._since = features.stamp
        is_lasting = not 0 < features.stamp - self._since < LASTING  # no clock, or it went back
        verdict = UNSURE
        is_elsewhere = off is not None and not is_near
        if (is_denied and is_elsewhere) or (self._denied >= ENOUGH and is_lasting):
            verdict = WRONG
        elif is_near and max(found.evidence.log_odds, where.evidence.log_odds) > 0:
            verdict = RIGHT
            self._seen = features, where.pose
        return Judgement(verdict, pose, off, found.evidence)

    def _goes_on(self, features: Features, query: Query, pose: Pose, is_asked: bool) -> bool:
        """Whether a scan shows, near this pose, what was seen since that was plainly right.

        Things that the plan does not have, or has elsewhere, are seen again; a robot that was
        carried away sees others.
        """
        if self._seen is None:
            return False
        seen, at = self._seen
        if not len(seen.segments) or not (is_asked or _is_beyond(relative(at, pose), _STEP, _TURN)):
            return False
        found = locate(query, LineMap.from_features([seen], [at]), pose, _NEAR)
        if not found or _is_beyond(relative(pose, found.pose), *REACH):
            return False
        self._seen = features, found.pose
        return True


def _is_beyond(off: Pose, reach: float, turn: float) -> bool:
    return math.hypot(*off[:2]) >= reach or abs(off[2]) >= turn
