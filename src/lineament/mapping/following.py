"""`Follower`: where a sensor is on a plan, scan by scan; when it is lost, and found again."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from .._copies import InTurn, in_turn
from ..extractor import Extractor
from ..features import Features
from ..motion import Tracker, Tracks
from ..motion.deskew import beam_times, deskew
from ..motion.odometry import compose_covariances
from ..scan import Array, LaserScan, Pose
from ..scan.fields import covariance_of_pose
from ..scan.poses import Twist, compose
from .consistency import is_consistent
from .evidence import ON_DRAWING, Evidence, evidence_of
from .line_map import LineMap
from .local_map import FASTEST, LocalMap, beams_of, thinned
from .locate import GUESS, LOCATED, LOST, SURE, UNKNOWN, UNOBSERVED, Location, locate
from .refine import combined
from .wheels import GAP, OdometryCheck, with_twists

#: The plan is looked at after so much way, turn or time [m, rad, s].
STEP, TURN, PERIOD = 0.5, 0.26, 1.0
#: What was seen on so much way is compared with the plan where the pose is known [m].
SEEN = 1.0
#: Scans farther apart by odometry are not of one drive [m].
JUMP = 2.0
#: A pose that is known no better is lost [m, rad]; one direction of it unobserved [m].
WORST, WORST_TURN, UNSURE = 0.75, 0.15, 0.3
#: So many looks at the plan that say that the sensor is not there are too many; each that says
#: otherwise takes back a part of one.
MOST_MISSED, TAKEN_BACK = 2.0, 0.25
#: A scan that is contradicted by a larger share of its beams is not where the pose says, nor is one
#: that is no likelier there than by chance.
DENIED = 0.12
#: So many looks are taken near a pose that somebody says, before the whole plan is.
GUESSED = 3
#: Errors of a motion beside its covariance: those of motions that follow each other add up [m/√m].
_DRIFT, _TURN_DRIFT = 0.005, 0.002
#: Error of walls and beams beside their covariances [m]: where scans are judged by themselves.
_TIGHT = 0.03
#: Velocity that a sensor may have at first [m/s, m/s, rad/s]; share by which it is off later.
_USUAL, _UNEVEN = np.array((1.0, 0.0, 1.0)), 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Whereabouts:
    """Where the sensor is at one scan.

    Attributes
    ----------
    verdict : str
        One of `VERDICTS`; "located" too between two looks at the plan, while the covariance of the
        pose is small.
    pose : (x, y, theta)
        In the frame of the plan [m, m, rad]; only a guess where the verdict is not "located".
    covariance : ndarray, shape (3, 3)
        Of the pose [m, m, rad].
    evidence : Evidence
        What the beams of this scan alone say of the pose.
    location : Location or None
        What `locate` found, if the plan was looked at with this scan.
    """

    verdict: str
    pose: Pose
    covariance: Array
    evidence: Evidence
    location: Location | None = None

    @property
    def is_known(self) -> bool:
        """Whether there is a pose, at least but for a direction."""
        return self.verdict in (LOCATED, UNOBSERVED) and self.covariance[2, 2] < 1.0

    def __bool__(self) -> bool:
        return self.verdict == LOCATED


def unsure(covariance: Array) -> float:
    """Return the largest deviation of the place of a pose [m]."""
    return math.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[1])


def verdict_of(covariance: Array) -> str:
    """Return the verdict on a pose that was located, as well as it is known now."""
    if unsure(covariance) > WORST or covariance[2, 2] > WORST_TURN**2:
        return LOST
    return UNOBSERVED if unsure(covariance) > UNSURE else LOCATED


class Follower(InTurn):
    """Follows a sensor on a plan from scan to scan, without a first guess.

    The last metres are looked for on the whole plan until they are located. From then on the pose
    moves on with the tracker, and each few decimetres the plan is looked at near it. The sensor is
    lost where a scan does not go on from the last one (it was carried away), where look after look
    contradicts the plan, and where nothing fixes the pose any more: its covariance grows. It is
    then looked for on the whole plan again, by what was seen since.

    Parameters
    ----------
    plan : LineMap
    way : float
        Length of the way that is looked for [m].

    Examples
    --------
    >>> import lineament as ln
    >>> from lineament.simulation import SENSORS, drive, room
    >>> plan = LineMap.from_lines(room().segments)
    >>> follower, extract = Follower(plan), ln.Extractor()
    >>> for scan in drive(room(), [(-2, 0), (-1, 0)], SENSORS["utm30lx"], speed=1, rate=10):
    ...     where = follower(extract(scan))
    >>> where.verdict, [round(value, 2) + 0.0 for value in where.pose]
    ('located', [-1.0, 0.0, 0.0])
    """

    def __init__(self, plan: LineMap, way: float = 5.0) -> None:
        self.plan, self.way = plan, way
        self._stamp = math.nan
        self._odometry: Pose | None = None
        self._check = OdometryCheck()
        self._scan: LaserScan | None = None
        self._restart()

    def _restart(self) -> None:
        """Forget what was seen, and where."""
        self._tracker, self._local = Tracker(), LocalMap(self.way)
        self._verdict, self._pose, self._covariance = LOST, (0.0, 0.0, 0.0), UNKNOWN
        self._missed, self._looked = 0.0, math.nan
        self._since = self._turned = math.inf
        self._guessed = 0

    @in_turn
    def forget(self) -> None:
        """Look for the sensor on the whole plan, by what it sees from now on."""
        self._restart()

    @in_turn
    def suppose(self, pose: Pose, covariance: ArrayLike | None = None) -> None:
        """Look for the sensor near a pose that somebody says: its next scans have to confirm it.

        The covariance (3, 3) is by default that of 0.5 m and 10°, as of `locate`.
        """
        self._restart()
        self._pose, self._guessed = pose, GUESSED
        self._covariance = GUESS if covariance is None else covariance_of_pose(covariance)

    @property
    def is_known(self) -> bool:
        """Whether the pose is known well enough to be followed."""
        return self._verdict in (LOCATED, UNOBSERVED) and unsure(self._covariance) < WORST

    @property
    def twist(self) -> Twist | None:
        """Velocity of the sensor in the last scans, as `deskew` takes it."""
        return self._tracker.twist

    @property
    def believes_odometry(self) -> bool:
        """Whether the odometry went with the scans so far: else it is left out."""
        return self._check.is_believed

    @in_turn
    def __call__(
        self, features: Features, odometry: Pose | None = None, skew: Pose = (0.0, 0.0, 0.0)
    ) -> Whereabouts:
        """Take in the next scan.

        Parameters
        ----------
        features : Features
            As `Extractor` returns them, with their scan.
        odometry : (x, y, theta), optional
            Pose of the sensor by odometry, in any frame that stays [m, m, rad].
        skew : (x, y, theta)
            What the scan as a whole may be off, as the sensor moved while it swept [m, m, rad].
        """
        if features.scan is not None:
            odometry = self._check(features.scan, odometry)
        tracks, was_known = self._tracked(features, odometry), self.is_known
        self._local.add(features, tracks, odometry)
        if tracks.motion is not None:
            self._move(tracks.motion.pose, tracks.motion.covariance)
        blurred = _blur(self._pose, skew)
        evidence = self._judge(features)
        if self._missed > MOST_MISSED or was_known > self.is_known:
            # What was seen before may be of another place: this scan begins anew.
            self._restart()
            self._local.add(features, self._tracker(features, odometry))
        location = None
        is_due = self._since > STEP or self._turned > TURN
        is_due |= abs(features.stamp - self._looked) > PERIOD
        if is_due or self._is_denied(evidence):
            location = self._look(blurred)
            self._since, self._turned, self._looked = 0.0, 0.0, features.stamp
            evidence = self._judge(features)
        verdict = LOST if self._is_denied(evidence) else self._verdict
        return Whereabouts(verdict, self._pose, self._covariance + blurred, evidence, location)

    def _tracked(self, features: Features, odometry: Pose | None) -> Tracks:
        """Track the features of a scan; begin anew if the motion since the last one is unknown."""
        duration = features.stamp - self._stamp
        if self._is_torn(duration, odometry):
            self._restart()
        before, self._scan = self._scan, features.scan
        self._stamp, self._odometry = features.stamp, odometry
        tracks = self._tracker(features, odometry)
        if (motion := tracks.motion) is None or before is None or features.scan is None:
            return tracks
        if not is_consistent(before, features.scan, motion.pose):
            self._restart()
            return self._tracker(features, odometry)
        if odometry is None and duration <= 0:
            # Without a clock nothing says how far it went where no wall does.
            unknown = FASTEST**2 * motion.unobserved.T @ motion.unobserved
            motion = replace(motion, covariance=motion.covariance + unknown)
        return replace(tracks, motion=motion)

    def _is_torn(self, duration: float, odometry: Pose | None) -> bool:
        """Whether the motion since the last scan is unknown.

        Clocks of real logs go back by tenths of a second: the order of the scans holds.
        """
        if odometry is None or self._odometry is None:
            return abs(duration) > GAP
        return duration < -GAP or math.dist(self._odometry[:2], odometry[:2]) > JUMP

    def _move(self, motion: Pose, covariance: Array) -> None:
        """Go on by a motion."""
        way, turn = math.hypot(motion[0], motion[1]), abs(motion[2])
        drift = np.diag((_DRIFT**2 * way,) * 2 + (_TURN_DRIFT**2 * (way + turn),))
        self._covariance = compose_covariances(
            self._pose, self._covariance, motion, covariance + drift
        )
        self._pose = compose(self._pose, motion)
        self._since += way
        self._turned += turn
        if self._verdict in (LOCATED, UNOBSERVED):
            self._verdict = verdict_of(self._covariance)

    def _judge(self, features: Features) -> Evidence:
        """Return what the beams of a scan alone say of the pose."""
        beams = thinned(beams_of(features))
        spread = min(math.hypot(_TIGHT, unsure(self._covariance)), UNSURE)
        says = ON_DRAWING._replace(opens=self.plan.is_mapped)
        found = evidence_of(np.array([self._pose]), beams, self.plan.index, spread, says)
        odds, explained, short, contradicted = found[0].tolist()
        return Evidence(odds, explained, short, contradicted, len(beams))

    def _is_denied(self, evidence: Evidence) -> bool:
        """Whether a scan is not of where the sensor is believed to be."""
        is_doubtful = evidence.log_odds < 0 or evidence.contradicted > DENIED
        return self.is_known and is_doubtful

    def _look(self, blurred: Array) -> Location:
        """Look for what was seen on the plan: near the pose if it is known, or everywhere."""
        if not self.is_known and self._guessed:
            self._guessed -= 1
            near = locate(self._local, self.plan, self._pose, self._covariance)
            # Who says where it is may be wrong: on a map, it is to be as sure as on a drawing.
            return self._found(near, blurred) if near.evidence.log_odds > SURE else near
        if not self.is_known:
            found = locate(self._local, self.plan)
            self._verdict, self._pose = found.verdict, found.pose
            self._covariance = found.covariance + blurred if found else UNKNOWN
            self._missed = 0.0
            return found
        found = locate(self._local.query(SEEN), self.plan, self._pose, self._covariance)
        # It takes more to leave a place than to believe it at first.
        odds, contradicted = found.evidence.log_odds, found.evidence.contradicted
        least = 0.0 if self.plan.is_mapped else SURE
        is_missed = found.verdict == LOST and (odds < least or contradicted > DENIED)
        self._missed += 1.0 if is_missed else -min(TAKEN_BACK, self._missed)
        return self._found(found, blurred)

    def _found(self, found: Location, blurred: Array) -> Location:
        """Join what was found near a pose with that pose."""
        if found.verdict in (LOCATED, UNOBSERVED):
            known, other = (self._pose, self._covariance), (found.pose, found.covariance + blurred)
            self._pose, self._covariance = combined(known, other)
            self._verdict = verdict_of(self._covariance)
        return found


def follow(
    scans: Iterable[LaserScan],
    plan: LineMap,
    extractor: Extractor,
    *,
    odometry: bool = True,
    deskewed: bool = True,
) -> Iterator[tuple[LaserScan, Whereabouts]]:
    """Yield each scan and where it was taken.

    `odometry` is whether the poses of the scans are odometry; `deskewed`, whether scans are to be
    deskewed that say how long their sweep takes.
    """
    follower, last = Follower(plan), _USUAL
    for scan, by_odometry in with_twists(scans, odometry):
        pose, skew = scan.pose if odometry else None, np.zeros(3)
        is_by_scans = by_odometry is None or not follower.believes_odometry
        twist = follower.twist if is_by_scans else by_odometry
        straight = deskew(scan, twist) if deskewed else scan
        times = beam_times(scan) if deskewed else None
        if times is not None:
            now = np.array(twist or (0.0, 0.0, 0.0))
            skew = (np.abs(now - last) + _UNEVEN * np.abs(now)) * np.ptp(times) / 2
            last = now
        x, y, turn = skew.tolist()
        where = follower(extractor(straight), pose, (x, y, turn))
        if times is not None and is_by_scans and follower.twist is not None:
            # Without odometry what was seen says how it went: not as it did before, perhaps.
            x, y, turn = (np.abs(np.subtract(follower.twist, last)) * np.ptp(times) / 2).tolist()
            where = replace(where, covariance=where.covariance + _blur(where.pose, (x, y, turn)))
        yield scan, where


def _blur(pose: Pose, skew: Pose) -> Array:
    """Covariance of a scan that as a whole is off by so much in its own frame."""
    x, y, _ = compose((0.0, 0.0, pose[2]), skew)
    return np.outer((x, y, skew[2]), (x, y, skew[2]))
