"""What is done with each scan: deskewing, feature extraction, tracking."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import fields
from typing import TYPE_CHECKING, NamedTuple

from .._copies import InTurn, in_turn
from ..features import Features
from ..limits import Limits
from ..logs.sweeps import Sweeps
from ..motion import CornerPose, Odometer, Tracker, Tracks, Travel
from ..motion.deskew import beam_times, deskew
from ..motion.tracker import FASTEST
from ..rosmsg.poses import Odometry
from ..scan import LaserScan, Pose
from ..scan.fields import NANO
from ..scan.poses import Twist, twist_between
from .config import LiveConfig
from .configured import dock_of, extractor_of, plan_of
from .received import MANY, ODOMETRY, Heard

if TYPE_CHECKING:
    from ..docking import ShapePose
    from ..mapping import LineMap
    from ..mapping.following import Whereabouts
    from ..mapping.judging import Judgement
    from .localiser import Localiser, Placed

#: The last stamp that a message of ROS 2 holds [ns]; those of ROS 1 go on for longer.
_LATEST = 2**31 * NANO - 1
#: Publishers whose buffers and tracks are kept; the oldest are forgotten.
_MOST_PUBLISHERS = 8
#: Odometry farther from a scan in time says nothing of it [s].
_OLDEST = 0.5
#: Poses farther apart in time give no velocity [s].
_LONGEST = 1.0
#: Fields of `LiveConfig` that may change while a node runs.
CHANGEABLE = ("method", "parameters", "noise", "scale", "stamp", "mask")


def stamp_of(nanoseconds: int) -> tuple[int, int]:
    """Seconds and nanoseconds of a time, clipped to what a message can hold."""
    return divmod(min(max(nanoseconds, 0), _LATEST), NANO)


def twist_of_laser(twist: Twist, laser_pose: Pose) -> Twist:
    """Twist of a scanner in its own frame [m/s, m/s, rad/s], by that of the body that carries it.

    A point at p of a rigid body moves with v + ω × p. `laser_pose` is in the frame of the body.
    """
    forward, left, turn_rate = twist
    x, y, theta = laser_pose
    vx, vy = forward - turn_rate * y, left + turn_rate * x
    c, s = math.cos(theta), math.sin(theta)
    return c * vx + s * vy, c * vy - s * vx, turn_rate


class Frame(NamedTuple):
    """What was found in a scan.

    Attributes
    ----------
    scan : LaserScan
        As it came.
    straight : LaserScan
        The scan that the features were found in: the same, or deskewed.
    features : Features
    tracks : Tracks or None
        None unless tracking is on.
    travel : Travel or None
        Where the sensor has come to; None unless features are tracked, for whatever purpose.
    dock : CornerPose, ShapePose or None
        What is docked to; None unless it was asked for, and where it is not seen.
    where : Whereabouts or None
        Where the sensor is on the plan; None without one.
    placed : Placed or None
        Where the robot is on the plan; None without one, and where it is lost.
    judgement : Judgement or None
        Whether the pose of another localiser is right; None unless it is asked, and has one.
    plan : LineMap or None
        The map so far; None unless one is made.
    """

    scan: LaserScan
    straight: LaserScan
    features: Features
    tracks: Tracks | None
    travel: Travel | None = None
    dock: CornerPose | ShapePose | None = None
    where: Whereabouts | None = None
    placed: Placed | None = None
    judgement: Judgement | None = None
    plan: LineMap | None = None


class Pipeline(InTurn):
    """Processes the scans of some publishers, with separate buffers and tracks for each.

    Parameters
    ----------
    config : LiveConfig
        Method, parameters, noise, deskewing and tracking.

    Raises
    ------
    ValueError
        If the method or one of its parameters is unknown or out of bounds.
    LineamentError
        If the plan cannot be read.

    Examples
    --------
    >>> pipeline = Pipeline(LiveConfig(track=True))
    >>> scan = LaserScan([2.0] * 5, angle_min=-0.02, angle_increment=0.01)
    >>> frame = pipeline("front", scan)
    >>> len(frame.features.segments), frame.tracks.segments.tolist()
    (1, [0])
    """

    def __init__(self, config: LiveConfig) -> None:
        self._config, self._limits = config, Limits.of(config.limits)
        self._publishers: dict[str, _Publisher] = {}
        self._publisher("")  # An unknown method is an error at once.
        self._localiser: Localiser | None = None
        if config.mapping is not None:
            from .mapping import LiveMapper

            self._localiser = LiveMapper(config, self._extract)
        elif config.map is not None:
            from .localiser import Localiser

            self._localiser = Localiser(config, plan_of(config), self._extract)
        self._odometry: Odometry | None = None
        self._unmoved = 0
        self._problems: set[str] = set()

    @in_turn
    def __call__(self, publisher: str, scan: LaserScan) -> Frame:
        """Find the features of a scan of a publisher.

        ValueError for a scan without beams, or with more than the limit.
        """
        kept = self._publisher(publisher)
        return self._followed(kept, *self._found(kept, scan))

    def frames(self, publisher: str, scan: LaserScan) -> tuple[Frame, ...]:
        """Return what is to be published now that a scan of a publisher has come."""
        return (self(publisher, scan),)

    def _found(
        self, kept: _Publisher, scan: LaserScan, mounting: Pose | None = None
    ) -> tuple[Frame, Twist | None]:
        """Find the features of a scan; and the twist: of the robot, where the mounting is given."""
        if not len(scan):
            raise ValueError("has no beams")
        self._limits.check("beams", len(scan))
        scan = self._as_configured(scan)
        twist, kept.last = self._twist(kept, scan), scan
        kept.sweeps.add(scan)
        own = None if kept.sweeps.is_too_long else twist
        self._note(kept, scan, own)
        if own is not None and mounting is not None:
            own = twist_of_laser(own, mounting)
        straight = deskew(scan, own)
        return Frame(scan, straight, kept.extractor(straight), None), twist

    def _followed(self, kept: _Publisher, frame: Frame, twist: Twist | None) -> Frame:
        """Track the features of a frame, and find where they show the scanner to be."""
        scan, straight, features, tracks, travel, dock, *_ = frame
        if kept.tracker is not None:
            tracks = kept.tracker(features)
            # A circle of a time that is not known takes as long as from scan to scan.
            sweep, by_scans = abs(scan.scan_time) or math.inf, self._config.deskew == "scans"
            is_straight = straight is not scan
            if is_straight and not by_scans:
                sweep = 0.0  # What odometry leaves of the motion is not known here.
            travel = kept.odometer(tracks, scan.stamp, sweep, deskewed=is_straight)
            if by_scans and twist is None and not kept.sweeps.is_too_long:
                straight = deskew(scan, kept.tracker.twist)
                if straight is not scan:
                    features = kept.extractor(straight)
                    tracks = kept.tracker.again(features)
            if kept.dock is not None:
                dock = kept.dock(features, tracks, travel.pose, travel.covariance)
                kept.undocked = kept.undocked + 1 if dock is None else 0
                if kept.undocked >= MANY:
                    self._problems.add(
                        f"what is docked to is not seen in {MANY} scans in a row: "
                        "expected it near dock, in the frame of the first scan, or of dock_track"
                    )
        if not self._config.track:
            tracks = None
        frame = Frame(scan, straight, features, tracks, travel, dock)
        if self._localiser is None:
            return frame
        where, placed, judgement = self._localiser(features, scan, straight)
        plan = self._localiser.plan
        return frame._replace(where=where, placed=placed, judgement=judgement, plan=plan)

    def save(self) -> str:
        """Write the map that was made; return a line about it, empty if none was to be made."""
        return "" if self._localiser is None else self._localiser.save()

    def close(self) -> None:
        """End what runs beside it."""
        if self._localiser is not None:
            self._localiser.close()

    def _as_configured(self, scan: LaserScan) -> LaserScan:
        """Return a scan with its times, in metres, without what sees the robot."""
        if self._config.stamp != "first":
            scan = scan.stamped(self._config.stamp)
        if self._config.scale != 1:
            scan = scan.scaled(self._config.scale)
        return scan.masked(self._config.mask) if self._config.mask else scan

    @in_turn
    def change(self, config: LiveConfig) -> None:
        """Go on with another method, noise, scale, stamp or mask; tracks and places stay.

        ValueError if the method or a parameter is unknown, or the configuration differs in what is
        read once, at the start; then nothing changes.
        """
        for one in fields(config):
            was, will = getattr(self._config, one.name), getattr(config, one.name)
            if one.name not in CHANGEABLE and was != will:
                raise ValueError(
                    f"{one.name} is read at the start, expected a change of one of "
                    f"{', '.join(CHANGEABLE)}"
                )
        extractors = [extractor_of(config) for _ in self._publishers]
        self._config = config
        for kept, extractor in zip(self._publishers.values(), extractors, strict=True):
            kept.extractor = extractor

    @in_turn
    def hear(self, message: Heard, what: str = ODOMETRY) -> None:
        """Take what was heard beside the scans, the newest odometry say; ValueError for nonsense.

        Nothing can move faster than `FASTEST`.
        """
        if isinstance(message, Odometry):
            if not all(abs(speed) <= FASTEST for speed in message.twist):
                raise ValueError(
                    f"its twist is {message.twist}, expected finite numbers, at most {FASTEST:g}"
                )
            self._odometry = message
        if self._localiser is not None:
            self._localiser.hear(message, what)

    def problems(self) -> Iterator[str]:
        """Yield why scans are not deskewed, or a robot is not placed, although they should be."""
        yield from sorted(self._problems)
        if self._localiser is not None:
            yield from self._localiser.problems()

    def _note(self, kept: _Publisher, scan: LaserScan, twist: Twist | None) -> None:
        """Note what keeps a scan from being deskewed, where that was asked for."""
        how = self._config.deskew
        if how == "off":
            return
        self._unmoved = self._unmoved + 1 if twist is None else 0
        if beam_times(scan) is None:
            why = "they have neither time_increment nor scan_time"
        elif self._unmoved < MANY:
            return
        elif kept.sweeps.is_too_long:
            why = "their time_increment or scan_time is far longer than from scan to scan"
        elif how == "poses":
            why = "the log has no poses less than a second apart"
        elif how == "scans":
            why = "they do not show the motion"
        else:
            topic = self._config.odometry_topic
            why = f"no odometry on {topic} is within {_OLDEST} s of their stamps"
        self._problems.add(f"scans are not deskewed: {why}")

    def _twist(self, kept: _Publisher, scan: LaserScan) -> Twist | None:
        """Twist of the scanner while it takes a scan, in its own frame; None if unknown."""
        last, odometry = kept.last, self._odometry
        if self._config.deskew == "off":
            return None
        if self._config.deskew == "scans":
            return kept.tracker.twist if kept.tracker else None
        if self._config.deskew == "poses":
            if last is None or last.pose is None or scan.pose is None:
                return None
            seconds = scan.stamp - last.stamp
            is_near = 0 < seconds < _LONGEST
            return twist_between(last.pose, scan.pose, seconds) if is_near else None
        if odometry is None or abs(scan.stamp - odometry.stamp) > _OLDEST:
            return None
        twist = twist_of_laser(odometry.twist, self._config.laser_pose)
        forward, left, turn_rate = twist
        return (forward, -left, -turn_rate) if self._config.upside_down else twist

    def _extract(self, scan: LaserScan) -> Features:
        return self._publisher("").extractor(scan)

    def _publisher(self, name: str) -> _Publisher:
        if name not in self._publishers:
            if len(self._publishers) >= _MOST_PUBLISHERS:
                del self._publishers[next(iter(self._publishers))]
            self._publishers[name] = _Publisher(self._config)
        return self._publishers[name]


class _Publisher:
    """What is kept of a publisher from scan to scan."""

    def __init__(self, config: LiveConfig) -> None:
        self.extractor = extractor_of(config)
        self.tracker = Tracker() if config.is_tracking else None
        self.odometer = Odometer()
        self.sweeps = Sweeps()
        self.undocked = 0
        self.dock = dock_of(config) if config.is_docking else None
        self.last: LaserScan | None = None
