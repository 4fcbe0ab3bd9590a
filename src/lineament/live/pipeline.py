"""What is done with a scan that came: made straight, its features found, and recognised."""

from __future__ import annotations

from typing import NamedTuple

from ..extractor import Extractor
from ..features import Features
from ..methods import get_method
from ..motion import Tracker, Tracks
from ..motion.deskew import deskew
from ..motion.tracker import FASTEST
from ..scan import LaserScan, RangeNoise
from .config import LiveConfig
from .motion import OdometryMotion, PoseMotion, ScanMotion, StandingMotion
from .received import Odometry, Time

__all__ = ["Frame", "Pipeline", "check_beams"]

NANO = 1_000_000_000
#: The seconds of a stamp in ROS 2 have 31 bits.
_LAST = 2.0**31 - 1
#: More beams than any scanner has: buffers of such a size are not made for a broken message.
MOST_BEAMS = 65_536
#: Publishers whose buffers and tracks are kept: beyond, those of the oldest go.
_MOST_PUBLISHERS = 8


def check_beams(scan: LaserScan) -> None:
    """Refuse a scan without beams, or with more than any scanner has; ValueError."""
    if not 0 < len(scan) <= MOST_BEAMS:
        raise ValueError(f"has {len(scan)} beams, expected 1 to {MOST_BEAMS}")


def time_of(stamp: float) -> Time:
    """Seconds and nanoseconds of a stamp; what a message cannot hold is its first or last time.

    Examples
    --------
    >>> time_of(7.25)
    (7, 250000000)
    """
    seconds, nanoseconds = divmod(round(min(max(stamp, 0.0), _LAST) * NANO), NANO)
    return seconds, nanoseconds


class Frame(NamedTuple):
    """What was found in a scan.

    Attributes
    ----------
    scan : LaserScan
        As it came.
    straight : LaserScan
        What the features were found in: the same, or without the motion of the sensor.
    features : Features
    tracks : Tracks or None
        None where they are not asked for.
    time : (int, int)
        Stamp of its message, exactly: seconds and nanoseconds.
    """

    scan: LaserScan
    straight: LaserScan
    features: Features
    tracks: Tracks | None
    time: Time


class Pipeline:
    """Works at the scans of some publishers, each with buffers and tracks of its own.

    Parameters
    ----------
    config : LiveConfig
        Method, parameters, noise, deskewing and tracking.

    Raises
    ------
    ValueError
        If the method or a parameter of it is unknown or out of bounds.

    Examples
    --------
    >>> pipeline = Pipeline(LiveConfig(track=True))
    >>> scan = LaserScan([2.0] * 5, angle_min=-0.02, angle_increment=0.01)
    >>> frame = pipeline("front", scan)
    >>> len(frame.features.segments), frame.tracks.segments.tolist()
    (1, [0])
    """

    def __init__(self, config: LiveConfig) -> None:
        self._config = config
        self._lines: dict[str, _Line] = {}
        self._line_of("")  # What is wrong with the method shows at once.
        self._odometry: Odometry | None = None

    def __call__(self, publisher: str, scan: LaserScan, time: Time | None = None) -> Frame:
        """Find the features of a scan.

        Parameters
        ----------
        publisher : str
            Who sent it.
        scan : LaserScan
        time : (int, int), optional
            Its stamp, exactly; by default that of the scan.
        """
        line = self._line_of(publisher)
        if self._odometry is not None:
            line.motion.hear(self._odometry)
        straight = deskew(scan, line.motion.twist(scan))
        features = line.extractor(straight)
        tracks = None if line.tracker is None else line.tracker(features)
        if not self._config.track:
            tracks = None
        return Frame(scan, straight, features, tracks, time or time_of(scan.stamp))

    def hear(self, odometry: Odometry) -> None:
        """Take in what the odometry tells of the motion; ValueError if nothing moves so."""
        if not all(abs(speed) <= FASTEST for speed in odometry.twist):
            raise ValueError(
                f"its twist is {odometry.twist}, expected finite numbers, at most {FASTEST:g}"
            )
        self._odometry = odometry

    def _line_of(self, publisher: str) -> _Line:
        line = self._lines.get(publisher)
        if line is None:
            if len(self._lines) >= _MOST_PUBLISHERS:
                del self._lines[next(iter(self._lines))]
            line = self._lines[publisher] = _Line.of(self._config)
        return line


class _Line(NamedTuple):
    """What is kept of one publisher from scan to scan."""

    extractor: Extractor
    tracker: Tracker | None
    motion: StandingMotion

    @classmethod
    def of(cls, config: LiveConfig) -> _Line:
        noise = None if config.noise is None else RangeNoise(sigma=config.noise)
        method = get_method(config.method, **config.parameters)
        extractor = Extractor(method, noise=noise)
        needs_tracker = config.track or config.deskew == "scans"
        tracker = Tracker() if needs_tracker else None
        motion = StandingMotion()
        if config.deskew == "scans" and tracker is not None:
            motion = ScanMotion(tracker)
        elif config.deskew == "poses":
            motion = PoseMotion()
        elif config.odometry_topic is not None:
            motion = OdometryMotion(config.laser_pose)
        return cls(extractor, tracker, motion)
