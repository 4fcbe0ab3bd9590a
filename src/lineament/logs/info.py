"""What a log holds, in a few lines: its scans, their geometry, time, ranges and poses."""

import math
import statistics
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..errors import one_line
from ..rosmsg.poses import POSE_TYPES, TRANSFORMS
from ..scan import LaserScan, Pose
from ..scan.changes import Mask
from ..scan.fields import date_of
from ..scan.units import FAR
from .base import Log, Topic
from .own import OwnParts

#: How many frames, topics and kinds of messages are listed.
_FRAMES, _TOPICS, _LISTED = 16, 32, 20
#: Stamps make a rate when at least this share of their steps goes forward, and at most that share
#: backwards: two clocks have no common rate.
_FORWARD, _BACKWARD = 0.5, 0.1
#: Ranges are counted in steps of 1 mm up to here [m], for a median in constant memory.
_LONGEST = 1e3
#: Most steps of stamps that are kept.
_STEPS = 1 << 16


@dataclass(frozen=True)
class TopicInfo:
    """What the scans of one topic are like; angles in radians."""

    name: str
    scans: int
    beams: tuple[int, int]  # Least and largest number.
    field_of_view: float  # First to last bearing of the first scan with most beams.
    resolution: float  # Step between its beams.
    full_circle: bool  # Whether it goes all around.
    start: float | None  # Earliest stamp [s]; None where stamps are missing.
    duration: float | None  # Latest stamp minus earliest [s].
    rate: float | None  # Scans per second: of the median step of stamps that go forward.
    backwards: int  # Stamps before the one that precedes them.
    valid: float  # Share of beams that are valid.
    ranges: tuple[float, float, float] | None  # Least, median (to 1 mm), largest valid range [m].
    limits: tuple[float, float]  # Least `range_min` and largest `range_max` [m].
    intensities: float  # Share of scans with intensities.
    poses: float  # Share of scans with a pose.
    travelled: float  # Length of the way from pose to pose [m].
    frame_ids: tuple[str, ...]  # In order of appearance, the first 16.
    own: Mask = ()  # Sectors that see the robot itself [rad].

    def rows(self) -> list[tuple[str, str]]:
        """Names and values for a person to read, angles in degrees."""
        low, high = self.beams
        span = "full circle" if self.full_circle else f"{math.degrees(self.field_of_view):.4g}°"
        beams = f"{low}" if low == high else f"{low} to {high}"
        beams += f", {span}, every {math.degrees(self.resolution):.4g}°"
        ranges = f"{100 * self.valid:.1f} % valid"
        if self.limits[1] < math.inf:
            ranges += f" (limits {self.limits[0]:.4g} to {self.limits[1]:.4g} m)"
        if self.ranges is not None:
            low_range, median, high_range = self.ranges
            ranges = f"{low_range:.2f} to {high_range:.2f} m, median {median:.2f} m, {ranges}"
            ranges += ": in millimetres? (scale=0.001)" * (median > FAR)
        way = f", {self.travelled:.1f} m travelled" if self.scans > 1 else ""
        several = ": more than one scanner on this topic?" if len(self.frame_ids) > 1 else ""
        return [
            ("scans", f"{self.scans}"),
            ("beams", beams + ", with intensities" * bool(self.intensities)),
            ("time", self._time()),
            ("ranges", ranges),
            ("poses", f"{100 * self.poses:.0f} % of scans{way}" if self.poses else "none"),
            ("frames", (", ".join(self.frame_ids) or "not named") + several),
            *([("robot", self._own_parts())] if self.own else []),
        ]

    def _own_parts(self) -> str:
        """Bearings at which the scanner sees the robot itself, and how to leave them out."""
        shown = ", ".join(
            f"{math.degrees(low):.0f}° to {math.degrees(high):.0f}°" for low, high in self.own
        )
        masks = " ".join(f"--mask {low:g} {high:g}" for low, high in self.own)
        return f"the scanner sees the robot itself from {shown}: leave it out by {masks}"

    def _time(self) -> str:
        if self.start is None or self.duration is None:
            return "no stamps"
        parts = [f"{self.duration:.1f} s"]
        if self.rate is not None:
            parts.append(f"{self.rate:.4g} Hz")
        elif not self.backwards and self.scans > 1:
            parts.append("no rate: most stamps stand still")
        if date := date_of(self.start):
            parts.insert(0, date)
        if self.backwards:
            parts.append(f"{self.backwards} stamps run backwards")
        return ", ".join(parts)


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
        All kinds of messages in the log.
    skipped, unread : int
        Number of faults that were skipped, and of scans of further topics.
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
        posed = {*POSE_TYPES, *TRANSFORMS}
        poses = [topic.name for topic in self.contents if topic.type in posed]
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
        names = max((len(topic.name) for topic in shown), default=0)
        types = max((len(topic.type) for topic in shown), default=0)
        values = []
        for topic in shown:
            several = f", {topic.publishers} publishers" if topic.publishers > 1 else ""
            kind = f"{topic.type:<{types}}  " if types else ""
            values.append(f"{topic.name:<{names}}  {kind}{topic.count}{several}")
        if len(self.contents) > _LISTED:
            values.append(f"and {len(self.contents) - _LISTED} more topics")
        return [("" if i else "holds", value) for i, value in enumerate(values)]


def summarize(log: Log, items: Iterable[tuple[str, LaserScan]] | None = None) -> LogInfo:
    """Read a log once and report what it holds, in bounded memory.

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
    counters: dict[str, _Counter] = {}
    unread = 0
    for topic, scan in log.items() if items is None else items:
        if topic not in counters:
            if len(counters) >= _TOPICS:
                unread += 1
                continue
            counters[topic] = _Counter(scan)
        counters[topic].add(scan)
    return LogInfo(
        path=log.name,
        format=log.format,
        topics=tuple(counter.info(name) for name, counter in counters.items()),
        contents=tuple(log.contents()),
        skipped=log.skipped,
        unread=unread,
    )


class _Counter:
    """What is counted over the scans of a topic, in constant memory."""

    def __init__(self, first: LaserScan) -> None:
        self.scans = self.beams = self.valid = self.with_intensities = self.with_pose = 0
        self.least, self.widest = len(first), first
        self.start = self.end = self.stamp = first.stamp
        # Steps of stamps that go forward are thinned: every second one goes when there are many.
        self.forward, self.backwards, self.stride = 0, 0, 1
        self.steps: list[float] = []
        self.limits = first.range_min, first.range_max
        self.low, self.high = math.inf, -math.inf
        self.histogram = np.zeros(round(1000 * _LONGEST) + 1, dtype=np.int64)
        self.travelled, self.pose = 0.0, first.pose
        self.frames: dict[str, None] = {}
        self.own = OwnParts(first)

    def add(self, scan: LaserScan) -> None:
        self.scans += 1
        self.beams += len(scan)
        self.least = min(self.least, len(scan))
        if len(scan) > len(self.widest):
            self.widest = scan
        self.with_intensities += scan.intensities is not None
        if scan.frame_id and len(self.frames) < _FRAMES:
            self.frames[scan.frame_id] = None
        self.own.add(scan)
        self._add_stamp(scan.stamp)
        self._add_pose(scan.pose)
        self.limits = min(self.limits[0], scan.range_min), max(self.limits[1], scan.range_max)
        ranges = scan.ranges[scan.valid]
        if len(ranges):
            self.valid += len(ranges)
            self.low = min(self.low, float(ranges.min()))
            self.high = max(self.high, float(ranges.max()))
            millimetres = np.rint(1000 * np.minimum(ranges, _LONGEST)).astype(np.intp)
            np.add.at(self.histogram, millimetres, 1)

    def _add_stamp(self, stamp: float) -> None:
        step, self.stamp = stamp - self.stamp, stamp
        self.start, self.end = min(self.start, stamp), max(self.end, stamp)
        self.backwards += step < 0
        if step > 0:
            if self.forward % self.stride == 0:
                self.steps.append(step)
            self.forward += 1
            if len(self.steps) >= _STEPS:
                self.steps, self.stride = self.steps[::2], 2 * self.stride

    def _add_pose(self, pose: Pose | None) -> None:
        if pose is not None:
            self.with_pose += 1
            self.travelled += math.dist(pose[:2], (self.pose or pose)[:2])
            self.pose = pose

    def _ranges(self) -> tuple[float, float, float] | None:
        if not self.valid:
            return None
        ranks = ((self.valid - 1) // 2 + 1, self.valid // 2 + 1)
        median = float(np.mean(np.searchsorted(np.cumsum(self.histogram), ranks))) / 1000
        # Half a millimetre of rounding must not carry it past the extremes.
        return self.low, min(max(median, self.low), self.high), self.high

    def info(self, name: str) -> TopicInfo:
        has_stamps = (self.start, self.end) != (0, 0)  # A log without stamps has zeros.
        most_forward = self.forward >= _FORWARD * (self.scans - 1)
        has_rate = self.steps and most_forward and self.backwards <= _BACKWARD * (self.scans - 1)
        widest = self.widest
        return TopicInfo(
            name=name,
            scans=self.scans,
            beams=(self.least, len(widest)),
            field_of_view=float(np.ptp(widest.angles)) if len(widest) else 0.0,
            resolution=widest.angle_increment if len(widest) else 0.0,
            full_circle=widest.is_full_circle if len(widest) else False,
            start=self.start if has_stamps else None,
            duration=self.end - self.start if has_stamps else None,
            rate=1 / statistics.median(self.steps) if has_rate else None,
            backwards=self.backwards,
            valid=self.valid / max(self.beams, 1),
            ranges=self._ranges(),
            limits=self.limits,
            intensities=self.with_intensities / self.scans,
            poses=self.with_pose / self.scans,
            travelled=self.travelled,
            frame_ids=tuple(self.frames),
            own=self.own.sectors(),
        )
