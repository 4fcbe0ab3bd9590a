"""What a log holds, in a few lines: its scans, their geometry, time, ranges and poses."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime

from ..errors import one_line
from ..scan import LaserScan
from .base import Log, Topic
from .counters import Clock, Geometry, Ranges, Way

__all__ = ["LogInfo", "TopicInfo", "summarize"]

_FRAMES = 16
#: How many topics are looked at, and how many kinds of messages are listed.
_TOPICS = 32
_LISTED = 20
#: Ends of the types of messages that poses can be taken from.
_POSE_TYPES = ("/PoseStamped", "/PoseWithCovarianceStamped", "/Odometry", "/TFMessage")
#: Stamps between these are seconds since 1970, and make a date (1990 to 2100).
_LONG_AGO, _FAR_OFF = 631_152_000.0, 4_102_444_800.0


@dataclass(frozen=True)
class TopicInfo:
    """What the scans of one topic are like.

    Parameters
    ----------
    name : str
        The topic.
    scans : int
        Scans read.
    beams : (int, int)
        Least and largest number of beams.
    field_of_view, resolution : float
        First to last bearing, and step between beams [rad], of the first scan with most beams.
    full_circle : bool
        Whether that scan goes all around.
    start, duration : float or None
        Earliest stamp [s], and latest minus earliest; None where stamps are missing.
    rate : float or None
        Scans per second, from the median of the stamp steps that go forward; None where most
        stamps stand still, or many run backwards.
    backwards : int
        How many stamps are before the one that precedes them.
    valid : float
        Share of beams that are valid.
    ranges : (float, float, float) or None
        Least, median (to 1 mm) and largest valid range [m]; None where no beam is valid.
    limits : (float, float)
        Least `range_min` and largest `range_max` of the scans [m]; 0 and inf where unknown.
    intensities : float
        Share of scans with intensities.
    poses : float
        Share of scans with a pose.
    travelled : float
        Length of the way from pose to pose [m].
    frame_ids : tuple of str
        Names of frames, in order of appearance, the first 16.
    """

    name: str
    scans: int
    beams: tuple[int, int]
    field_of_view: float
    resolution: float
    full_circle: bool
    start: float | None
    duration: float | None
    rate: float | None
    backwards: int
    valid: float
    ranges: tuple[float, float, float] | None
    limits: tuple[float, float]
    intensities: float
    poses: float
    travelled: float
    frame_ids: tuple[str, ...]

    def rows(self) -> list[tuple[str, str]]:
        """Names and values for a person to read, angles in degrees."""
        return [
            ("scans", f"{self.scans}"),
            ("beams", self._beams()),
            ("time", self._time()),
            ("ranges", self._ranges()),
            ("poses", self._poses()),
            ("frames", self._frames()),
        ]

    def _beams(self) -> str:
        low, high = self.beams
        count = f"{low}" if low == high else f"{low} to {high}"
        span = "full circle" if self.full_circle else f"{math.degrees(self.field_of_view):.4g}°"
        more = ", with intensities" if self.intensities else ""
        return f"{count}, {span}, every {math.degrees(self.resolution):.4g}°{more}"

    def _time(self) -> str:
        if self.start is None or self.duration is None:
            return "no stamps"
        parts = [f"{self.duration:.1f} s"]
        if self.rate is not None:
            parts.append(f"{self.rate:.4g} Hz")
        elif not self.backwards and self.scans > 1:
            parts.append("no rate: most stamps stand still")
        if _LONG_AGO <= self.start < _FAR_OFF:
            parts.insert(0, f"{datetime.fromtimestamp(self.start, UTC):%Y-%m-%d %H:%M:%S} UTC")
        if self.backwards:
            parts.append(f"{self.backwards} stamps run backwards")
        return ", ".join(parts)

    def _ranges(self) -> str:
        valid = f"{100 * self.valid:.1f} % valid"
        low, high = self.limits
        if high < math.inf:
            valid += f" (limits {low:.4g} to {high:.4g} m)"
        if self.ranges is None:
            return valid
        low, median, high = self.ranges
        return f"{low:.2f} to {high:.2f} m, median {median:.2f} m, {valid}"

    def _frames(self) -> str:
        several = ": more than one scanner on this topic?" if len(self.frame_ids) > 1 else ""
        return (", ".join(self.frame_ids) or "not named") + several

    def _poses(self) -> str:
        if not self.poses:
            return "none"
        way = f", {self.travelled:.1f} m travelled" if self.scans > 1 else ""
        return f"{100 * self.poses:.0f} % of scans{way}"


@dataclass(frozen=True)
class LogInfo:
    """What a log holds; ``str(info)`` is a text block for a person to read.

    Parameters
    ----------
    path, format : str
        The log, as it was given, and its format.
    topics : tuple of TopicInfo
        The topics that were read, in order of appearance, the first 32.
    contents : tuple of Topic
        All that the log says it holds, scans and other messages.
    skipped : int
        Faults gone over.
    unread : int
        Scans of further topics.
    """

    path: str
    format: str
    topics: tuple[TopicInfo, ...]
    contents: tuple[Topic, ...] = ()
    skipped: int = 0
    unread: int = 0

    def lines(self) -> list[str]:
        """Aligned lines ``name  value``, a block for each topic that was read."""
        read = f": {self.topics[0].name}" if len(self.topics) == 1 else ""
        rows = [("log", f"{self.path} ({self.format}{read})"), *self._holds()]
        for topic in self.topics:
            if len(self.topics) > 1:
                rows += [("", ""), ("topic", topic.name)]
            rows += topic.rows()
        poses = [kind.name for kind in self.contents if kind.type.endswith(_POSE_TYPES)]
        if poses and not any(topic.poses for topic in self.topics):
            rows.append(("", f"poses are in {', '.join(poses[:_LISTED])}: choose with --poses"))
        if not self.topics:
            rows.append(("scans", "0"))
        if self.unread:
            rows.append(("more", f"{self.unread} scans of further topics"))
        if self.skipped:
            rows.append(("skipped", f"{self.skipped}"))
        return [f"{name:<9}{one_line(value)}".rstrip() for name, value in rows]

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def _holds(self) -> list[tuple[str, str]]:
        """One row for each kind of messages, in columns."""
        shown = self.contents[:_LISTED]
        widths = [
            max((len(text) for text in column), default=0)
            for column in ([t.name for t in shown], [t.type for t in shown])
        ]
        texts = [f"{t.name:<{widths[0]}}  {t.type:<{widths[1]}}".rstrip() for t in shown]
        width = max(map(len, texts), default=0)
        values = [
            f"{text:<{width}}  {t.count}"
            + (f", {t.publishers} publishers" if t.publishers > 1 else "")
            for text, t in zip(texts, shown, strict=True)
        ]
        if len(self.contents) > _LISTED:
            values.append(f"and {len(self.contents) - _LISTED} more topics")
        return [("" if i else "holds", value) for i, value in enumerate(values)]


def summarize(log: Log, items: Iterable[tuple[str, LaserScan]] | None = None) -> LogInfo:
    """Read a log once and tell what it holds, in bounded memory.

    Parameters
    ----------
    log : Log
        The log.
    items : iterable of (str, LaserScan), optional
        Its topics and scans, for instance wrapped by a progress bar; ``log.items()`` if None.

    Returns
    -------
    LogInfo
        The summary.

    Raises
    ------
    LogError
        If a scan is faulty and the log does not keep going.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> from lineament.logs import open_log, save_npz
    >>> path = pathlib.Path(tempfile.mkdtemp(), "two.npz")
    >>> save_npz(path, [LaserScan([1.0, 2.0], 0.0, 0.1, stamp=t) for t in (7.0, 7.5)])
    >>> (topic,) = summarize(open_log(path)).topics
    >>> topic.scans, topic.beams, topic.rate, topic.ranges
    (2, (2, 2), 2.0, (1.0, 1.5, 2.0))
    """
    parts: dict[str, _Part] = {}
    unread = 0
    for topic, scan in log.items() if items is None else items:
        if topic not in parts and len(parts) >= _TOPICS:
            unread += 1
            continue
        parts.setdefault(topic, _Part()).add(scan)
    return LogInfo(
        path=log.name,
        format=log.format,
        topics=tuple(part.told(name) for name, part in parts.items()),
        contents=tuple(log.contents()),
        skipped=log.skipped,
        unread=unread,
    )


class _Part:
    """What is counted of one topic."""

    def __init__(self) -> None:
        self.count = self.with_intensities = 0
        self.geometry, self.clock, self.ranges, self.way = Geometry(), Clock(), Ranges(), Way()
        self.frames: dict[str, None] = {}

    def add(self, scan: LaserScan) -> None:
        self.count += 1
        self.geometry.add(scan)
        self.clock.add(scan.stamp)
        self.ranges.add(scan)
        self.with_intensities += scan.intensities is not None
        self.way.add(scan.pose)
        if scan.frame_id and len(self.frames) < _FRAMES:
            self.frames[scan.frame_id] = None

    def told(self, name: str) -> TopicInfo:
        geometry, clock = self.geometry, self.clock
        start, duration = clock.span()
        return TopicInfo(
            name=name,
            scans=self.count,
            beams=(geometry.least, geometry.most),
            field_of_view=geometry.field_of_view,
            resolution=geometry.resolution,
            full_circle=geometry.full_circle,
            start=start,
            duration=duration,
            rate=clock.rate(),
            backwards=clock.backwards,
            valid=self.ranges.count / max(geometry.total, 1),
            ranges=self.ranges.quantiles(),
            limits=self.ranges.limits,
            intensities=self.with_intensities / max(self.count, 1),
            poses=self.way.count / max(self.count, 1),
            travelled=self.way.length,
            frame_ids=tuple(self.frames),
        )
